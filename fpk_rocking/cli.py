"""The command line: ``fpk-rocking probability|fpk|mc|compare|fragility|risk|warmup``.

Results go to standard output or to files, progress and errors to standard error. Exit status: 0, 2 for bad input or
what the machine refuses, 130 when interrupted, 143 when terminated. Files are complete or not there.
"""

import argparse
import json
import pathlib
import re
import sys
import time
import tomllib
from typing import Any

from fpk_rocking import console

_DESCRIPTION = "Rocking of a rigid block under noisy periodic excitation: will it overturn, and where is it if not?"
_EXAMPLES = """\
a scene is a TOML file, or the name of a scene of the package: main, second, fig05, second_harmonic, rest, record

examples:
  fpk-rocking probability rack.toml --cycles 10 --tol 0.002
      the probability that the block overturns, to the wanted error, by the engine that gets there soonest
  fpk-rocking fpk main
      probability density by finite elements, 40 forcing cycles
  fpk-rocking mc main --realizations 20000 --seed 7
      Monte Carlo of the same scene
  fpk-rocking mc main --realizations 10000000 --tally --checkpoint results/main/tally.npz
      an ensemble larger than memory; once stopped, the same command goes on from the file
  fpk-rocking compare main --cycles 10 --out results/main
      both, side by side; keeps results, a figure and a summary
  fpk-rocking compare results/main/density.npz results/main/ensemble.npz
      two saved results
  fpk-rocking fragility main --scales 0.2:2:20 --cycles 10 --out results/fragility
      probability of overturning against the scale of the shaking, with a lognormal fit
  fpk-rocking risk rack.toml --records motions/*.AT2 --hazard pgv.csv --intensities 0.1:3:12 --out results/risk
      annual rate of overturning, with curves that OpenQuake and pelicun read
  fpk-rocking fpk main --json > survival.json
      one JSON object instead of a table
  fpk-rocking compare cases/scenes/main.toml --cycles 10 --report main.html
      numbers, verdict and densities as one file for the browser

fpk-rocking COMMAND --help lists the options of a command
"""
_DENSITY = "--tol --bins-tol --noise-replacement --no-check"
_SAMPLE = "--realizations --seed --method --steps-per-cycle --tally --checkpoint"
_OPTIONS = """
scene SCENE             scene file (TOML), or the name of a scene of the package
scenes SCENE+           scene file (TOML), or the name of a scene of the package; several give a curve each
inputs FILE+            a scene (file or name) to solve by both engines, or two saved results (.npz)
--set KEY=VALUE*        value that replaces one of the scene file, as noise.kind=none or forcing.peak_acceleration='0.3
                        g'; may be repeated
--cycles N:int          forcing cycles (default 40)
--times T:float+        for a pulse or a record: nondimensional times (default: 21 over its duration, and 10 after its
                        end)
--out DIR:path          folder for files
--report FILE:path      HTML file to write: numbers, verdict, pictures and the density after every cycle
--json                  print one JSON object instead of a table
--tol X:float           error of survival that the density solver aims at (default 0.001; for a pulse, a record or
                        fragility 0.01)
--rtol X:float          wanted error in parts of the probability; with --tol too, the larger error is enough
--limit S:float         seconds that it may take; what is predicted to take longer is refused (default 600)
--bins-tol X:float      error of the binned density (L1) that it aims at (default: a third of the square root of --tol;
                        for a pulse or a record, and with inf: any)
--noise-replacement NAME  what replaces band noise in the density solver: white (default), or filtered, which lets
                        blocks rest
--no-check              where the density solver replaces noise, do not sample the noise of the scene beside it
--realizations N:int    number of paths, of each scene at each scale or intensity (default 10,000, or 1 where nothing
                        is random)
--seed N:int            seed of the random numbers (default 1)
--method NAME           for band noise or none, exact (event-driven) or rk4 (Runge-Kutta); white, which replaces other
                        noise by white noise; filtered, which replaces band noise by low-pass noise (default: exact,
                        white or filtered, whichever fits the noise)
--steps-per-cycle N:int  time steps in a forcing cycle (default 200; the method exact takes none)
--tally                 keep survival, histograms and moments alone, which takes little memory for any number of paths
--checkpoint FILE:path  with --tally: file that keeps the state of the run; where it exists, the run goes on from it
--scales LIST           factors of the shaking: A,B,C, or LOW:HIGH:COUNT for logarithmic spacing
--pga LIST              in place of --scales: peak accelerations in g of the shaking without noise; the column scale is
                        then the PGA
--pgv LIST              likewise: peak velocities in m/s
--engine NAME           exact, rk4, white or filtered (Monte Carlo), or density (default: Monte Carlo that fits the
                        noise)
--levels LIST           also compute the probability of reaching the angles A,B,C, in units of the critical angle
--over NAME=LIST        a surface over a parameter: NAME=A,B,C or NAME=LOW:HIGH:COUNT, as in size=0.5,1,2
--keep-noise            scale the motion alone and keep the noise as it is
--uncertain NAME=DIST*  distribution of a value: NAME is width, height or size (half diagonal) in m, slenderness, or a
                        name of the scene file such as block.restitution, each in its own unit; NAME_factor is a
                        multiple of the scene's own value. DIST is uniform:LOW:HIGH, normal:MEAN:DEVIATION or
                        lognormal:MEDIAN:DISPERSION or beta:A:B:LOW:HIGH, as in size_factor=lognormal:1:0.05; may be
                        repeated
--blocks N:int          with --uncertain: blocks drawn for each scene or record (default: 100 in all; of one record 5 or
                        more)
--workers N:int         worker processes, one processor each (default 1: this process alone, on all processors)
--store FILE:path       file that keeps the points as they come; where it exists, the run goes on from it
--records FILE+         recorded motions (.AT2, .ASC or two columns); the scene gives block and noise, and needs no
                        forcing
--synthetic N:int       in place of records: as many synthetic motions on firm ground
--hazard FILE|K0:K!     file of two columns, intensity (g or m/s) and annual rate of exceedance; or K0:K for the hazard
                        K0 im^-K
--intensities LIST!     intensities to compute: A,B,C, or LOW:HIGH:COUNT for logarithmic spacing
--measure NAME          intensity of the motion: PGV in m/s (default) or PGA in g
--units NAME            unit of the records where their files do not say it: g, m/s2 or cm/s2
--baseline NAME         what is removed from the records before they act: none, mean, linear (line of least squares), or
                        high-pass (that line, and what lies below 0.1 Hz); default: none, or what the scene file says
--corner-hz F:float     corner of the high-pass correction of baselines, Hz (default 0.1, or what the scene file says)
--name NAME             identifier of the block in the exported files (default rocking_block)
"""
"""Every argument of the command line: name, what stands for its value with the type, and help.

Without what stands for a value it is a switch. After it, + means one value or more, * that the option may be repeated,
! that it is required.
"""

_REPLACED = {"amplitude": 1.0, "frequency": 1.0}
"""Table [forcing] of a scene whose forcing recorded motions replace."""


def _arguments():
    """Return a dict of keyword arguments of argparse for each entry of `_OPTIONS`, by its name, such as "--tol"."""
    arguments: dict[str, dict[str, Any]] = {}
    types = {"int": int, "float": float, "path": pathlib.Path, "": None}
    marks = {"+": {"nargs": "+"}, "*": {"action": "append"}, "!": {"required": True}, "": {}}
    for entry in re.split(r"\n(?=\S)", _OPTIONS.strip()):
        head, text = re.split(r"\s{2,}", entry, maxsplit=1)
        name, _, form = head.partition(" ")
        metavar, kind, mark = re.fullmatch(r"(.*?)(?::(int|float|path))?([+*!]?)", form).groups("")
        own = {"metavar": metavar, "type": types[kind]} if form else {"action": "store_true", "default": None}
        arguments[name] = {"help": " ".join(text.split())} | own | marks[mark]
    return arguments


class _Parser(argparse.ArgumentParser):
    """Refuses bad input in one line, as the rest of the command line does."""

    def error(self, message):
        """Exit with status 2 and a message (text) in one line."""
        self.exit(2, f"{self.prog}: {console.line(message)}\n")


class _Version(argparse.Action):
    """Prints the version, which is looked up only then."""

    def __call__(self, parser, *_):
        from importlib.metadata import version

        sys.stdout.write(f"fpk-rocking {version('fpk-rocking')}\n")
        parser.exit(0)


def main(arguments=None) -> int:
    """Run the command line.

    Parameters
    ----------
    arguments : list of str, optional
        By default those of the process.

    Returns
    -------
    int
        Exit status: 0, 2 for bad input or what the machine refuses, 130 when interrupted, 143 when terminated.
    """
    options, begun = _parser().parse_args(arguments), time.time()
    try:
        with console.terminable(), console.insistent(), console.plain_warnings(options.command):
            if getattr(options, "out", None):
                console.check_folder("--out", options.out)
            if getattr(options, "report", None):
                console.check_folder("--report", options.report.parent)
                if options.report.is_dir():
                    raise ValueError(f"--report: got the folder {str(options.report)!r}, accepted: a file to write")
            if getattr(options, "checkpoint", None) and not options.tally:
                raise ValueError(f"--checkpoint: got {str(options.checkpoint)!r}, accepted: together with --tally")
            options.run(options)
            sys.stdout.flush()
    except KeyboardInterrupt as stop:
        state = getattr(options, "checkpoint", None) or getattr(options, "store", None)
        left = console.what_is_left(begun, getattr(options, "out", None), state)
        word = "terminated" if isinstance(stop, console.Terminated) else "interrupted"
        sys.stderr.write(f"fpk-rocking: {word}; {left}\n")
        return 143 if isinstance(stop, console.Terminated) else 130
    except (ValueError, TypeError, OSError, ArithmeticError, MemoryError) as error:
        sys.stderr.write(f"fpk-rocking {options.command}: {console.line(error) or type(error).__name__}\n")
        console.drop_unwritten()
        return 2
    return 0


def _parser() -> argparse.ArgumentParser:
    """Return the parser of the command line, with a subparser for each command."""
    layout = argparse.RawDescriptionHelpFormatter
    parser = _Parser("fpk-rocking", description=_DESCRIPTION, epilog=_EXAMPLES, formatter_class=layout)
    parser.add_argument("--version", action=_Version, nargs=0, help="print the version and exit")
    commands, arguments = parser.add_subparsers(dest="command", required=True, metavar="COMMAND"), _arguments()

    def command(name, run, does, more="", options="", files=""):
        """Add the subparser of the command `name`, which calls `run` with the parsed options.

        `does` and `more` are its description, `options` the names of its arguments in `_OPTIONS`, parted by blanks, and
        `files` what stands in the help of --out.
        """
        added = commands.add_parser(name, help=does, description=f"{does[0].upper()}{does[1:]}. {more}")
        for option in options.split():
            own = {"help": f"{arguments[option]['help']}: {files}"} if option == "--out" else {}
            added.add_argument(option, **arguments[option] | own)
        added.set_defaults(run=run)

    rows = "--set --cycles --times --out --report --json"
    printed = "Prints the survival, the probability that the block has not overturned, after each forcing cycle."
    does = "probability of overturning, to a wanted error (--tol, default 0.005, or --rtol)"
    files = "result.npz, summary.json, probability.csv and probability.png"
    wanted = "scene --set --cycles --times --tol --rtol --limit --seed --out --json"
    command("probability", _probability, does, "Takes the engine that gets there soonest.", wanted, files)
    does = "probability density by finite elements (Fokker-Planck equation)"
    files = "result.npz, summary.json and a VTK series jpdf.pvd"
    command("fpk", _fpk, does, printed, f"scene {rows} {_DENSITY}", files)
    does = "Monte Carlo simulation of many realizations"
    command("mc", _mc, does, printed, f"scene {rows} {_SAMPLE}", "result.npz and summary.json")
    does = "both engines on one scene, or two saved results, side by side"
    files = "summary.json, survival.png and, of a scene, density.npz and ensemble.npz"
    command("compare", _compare, does, printed, f"inputs {rows} {_DENSITY} {_SAMPLE}", files)
    does = "probability of overturning against the scale of the shaking, with a lognormal fit"
    options = f"scenes --scales --pga --pgv {rows} --engine --levels --over --keep-noise --realizations --tol --seed"
    files = "result.npz, summary.json, fragility.csv and fragility.png"
    options += " --uncertain --blocks --workers --store --records --units --baseline --corner-hz"
    command("fragility", _fragility, does, "", options, files)
    does = "annual rate of overturning, from records and a hazard curve"
    options = "scene --set --records --hazard --intensities --measure --units --realizations --keep-noise --synthetic"
    options += " --baseline --corner-hz --uncertain --blocks --workers --store --name --seed --out --json"
    command("risk", _risk, does, "", options, "all of --json, report.html, risk.png, curves for other programs")
    command("warmup", _warmup, "compile all engines for this machine now, so that no first run has to wait for it")
    return parser


def _probability(options):
    """Run the command ``probability`` with its parsed `options`: answer, and print and save the answer."""
    from fpk_rocking.base.files import write_json
    from fpk_rocking.output import tables
    from fpk_rocking.output.progress import reporting
    from fpk_rocking.results.style import save
    from fpk_rocking.studies.overturning import probability

    scene = _scene(options, options.scene)
    own = _rows(options, scene) | _passed(options, "tol", "rtol", "seed")
    own |= {} if options.limit is None else {"limit_s": options.limit}
    with reporting("probability") as progress:
        answer = probability(scene, progress=progress, **own)
    if options.out:
        answer.save(options.out / "result.npz")
        answer.to_csv(options.out / "probability.csv")
        save(answer.plot(), options.out / "probability.png")
        write_json(options.out / "summary.json", answer.summary())
    _print(options, answer, answer.summary(), lambda: tables.probability_table(answer))
    if answer.interrupted:
        raise KeyboardInterrupt


def _fpk(options):
    """Run the command ``fpk`` with its parsed `options`: solve a scene, and print and save the density."""
    _finish(options, _checked(options, _solved(options, _scene(options, options.scene))))


def _mc(options):
    """Run the command ``mc`` with its parsed `options`: simulate a scene, and print and save the sample."""
    _finish(options, _simulated(options, _scene(options, options.scene)))


def _finish(options, result):
    """Save and print a `SurvivalResult` of one engine, of a density its VTK series too, as the parsed `options` say."""
    from fpk_rocking.base.files import write_json
    from fpk_rocking.compare import shown_cycles
    from fpk_rocking.output import tables, vtk

    values = result.summary()
    if options.out:
        result.save(options.out / "result.npz")
        if result.realizations is None:
            vtk.write_series(options.out, "jpdf", result, sorted({0, *shown_cycles(len(result.times) - 1)}))
        write_json(options.out / "summary.json", values)
    _print(options, result, values, lambda: tables.result_table(result), [result])


def _compare(options):
    """Run the command ``compare`` with its parsed `options`.

    It solves and simulates a scene, or loads two saved results, and prints and saves the comparison.
    """
    from fpk_rocking.base.files import write_json
    from fpk_rocking.compare import compare
    from fpk_rocking.output import curves, tables

    if len(options.inputs) == 2:
        first, second = _loaded(options)
    elif len(options.inputs) == 1:
        scene = _scene(options, options.inputs[0])
        second, first = _solved(options, scene), _simulated(options, scene)
        second = _checked(options, second, beside=first)
    else:
        raise ValueError(f"inputs: got {len(options.inputs)} files, accepted: one scene file or two saved results")
    compared = compare(first, second)
    if options.out:
        if len(options.inputs) == 1:
            first.save(options.out / "ensemble.npz")
            second.save(options.out / "density.npz")
        curves.survival_figure(options.out / "survival.png", [second, first])
        write_json(options.out / "summary.json", compared.summary())
    _print(options, compared, compared.summary(), lambda: tables.comparison_table([compared]), [second, first])


def _fragility(options):
    """Run the command ``fragility`` with its parsed `options`: compute, print and save fragility curves."""
    from fpk_rocking.base.files import write_json
    from fpk_rocking.output.progress import reporting
    from fpk_rocking.studies import IntensityCurve, drawn, fragility
    from fpk_rocking.studies.picture import curve_table, fragility_table
    from fpk_rocking.studies.scenes import motion_lines

    scenes, over = _shaken(options), None
    if options.over is not None:
        name, equals, values = options.over.partition("=")
        if not equals:
            raise ValueError(f"--over: got {options.over!r}, accepted: NAME=A,B,C or NAME=LOW:HIGH:COUNT")
        over = {name: _numbers("--over", values)}
    scenes, scales = _at_scales(options, scenes)
    uncertain, draws = _uncertain(options), None
    if uncertain:
        if over is not None:
            raise ValueError(f"--uncertain: got {options.uncertain}, accepted: nothing beside --over")
        draws = drawn(scenes, uncertain, **_passed(options, "seed"), count=options.blocks or -(-100 // len(scenes)))
        scenes = draws.scenes
    with reporting("fragility") as progress:
        result = fragility(
            scenes[0] if len(scenes) == 1 else scenes,
            scale=scales,
            **_rows(options, scenes[0]),
            levels=_numbers("--levels", options.levels) if options.levels else (),
            over=over,
            scale_noise=not options.keep_noise,
            progress=progress,
            **_passed(options, "engine", "realizations", "tol", "seed", "workers", "store"),
        )
    shown, values = result, result.summary()
    if draws is not None or (options.records and len(scenes) > 1):
        # The saved result keeps the rows of each scene; what is looked at is the curve over all of them.
        shown = IntensityCurve.of(result, "scale", draws=draws)
        values |= {"pooled": shown.summary()}
    if options.out:
        result.save(options.out / "result.npz")
        (result if draws is None else shown).to_csv(options.out / "fragility.csv")
        write_json(options.out / "summary.json", values)
        _fragility_figure(options.out / "fragility.png", shown)
    motions = motion_lines(result.motion_table, "scale") if options.records and options.scales else ()
    _print(options, shown, values, lambda: fragility_table(result) if shown is result else curve_table(shown, motions))


def _fragility_figure(path, result):
    """Draw fragility curves, a surface over a parameter, or the one curve for all scenes as a file."""
    from fpk_rocking.results.style import page
    from fpk_rocking.studies import Fragility
    from fpk_rocking.studies.picture import curves_figure, draw_curve, surface_figure

    if not isinstance(result, Fragility):
        with page(path, (7.0, 5.0), result.title) as figure:
            draw_curve(figure.subplots(), result)
    elif result.axis == "scene":
        curves_figure(path, [result], which=None)
    else:
        surface_figure(path, result)


def _at_scales(options, scenes):
    """Return scenes (a list) as they are at scale 1, an intensity of 1 with --pga or --pgv, and the scales (a list).

    `options` are the parsed arguments.
    """
    from fpk_rocking.studies.scenes import at_intensity

    lists = _passed(options, "scales", "pga", "pgv")
    if len(lists) != 1:
        raise ValueError(
            f"--scales: got {options.scales!r}, accepted: a list of factors, or --pga or --pgv in its place"
        )
    ((measure, numbers),) = lists.items()
    if measure != "scales":
        scenes = [at_intensity(scene, measure.upper(), noise=not options.keep_noise) for scene in scenes]
    return scenes, _numbers(f"--{measure}", numbers)


def _shaken(options):
    """List of the scenes that the parsed `options` name, or of the one scene under each of the records named there."""
    from fpk_rocking.studies.scenes import recorded_scenes

    scenes = [_scene(options, path) for path in options.scenes]
    if options.records and len(scenes) > 1:
        raise ValueError(f"--records: got {len(scenes)} scenes, accepted: one, which gives block and noise")
    if options.units and not options.records:
        raise ValueError(f"--units: got {options.units!r}, accepted: together with --records")
    given = _passed(options, "units", "baseline", "corner_hz")
    if not (options.records or given):
        return scenes
    return [shaken for scene in scenes for shaken in recorded_scenes(scene, options.records or (), **given)]


def _risk(options):
    """Run the command ``risk`` with its parsed `options`: compute, print and save an annual rate of overturning."""
    from fpk_rocking.output.progress import reporting
    from fpk_rocking.risk.study import study

    intensities = _numbers("--intensities", options.intensities)
    records = options.records or ()
    if options.synthetic:
        from fpk_rocking.studies.drawing import synthetic_records

        if records:
            raise ValueError(f"--synthetic: got {options.synthetic}, accepted: nothing beside --records")
        records = synthetic_records(options.synthetic, **_passed(options, "seed"))
    with reporting("records") as progress:
        result = study(
            _scene(options, options.scene),
            records,
            _hazard(options.hazard),
            intensities,
            scale_noise=not options.keep_noise,
            uncertain=_uncertain(options),
            progress=progress,
            **_passed(options, "blocks", "measure", "units", "baseline", "corner_hz", "realizations", "seed", "name"),
            **_passed(options, "workers", "store"),
        )
    if options.out:
        result.write(options.out)
        if result.not_for_pelicun:
            missing = f"{result.name}.csv and {result.name}.json for pelicun are not written"
            sys.stderr.write(f"fpk-rocking risk: {missing}: {result.not_for_pelicun}\n")
    text = json.dumps(result.summary(), allow_nan=False, ensure_ascii=False) if options.json else result.text()
    sys.stdout.write(text + "\n")


def _hazard(text):
    """Return the `Hazard` of a text K0:K, or the text itself where it is the name of a file."""
    from fpk_rocking.risk.hazard import Hazard

    rate, colon, exponent = text.partition(":")
    try:
        return Hazard.power_law(float(rate), float(exponent)) if colon else text
    except ValueError as error:
        if pathlib.Path(text).exists():
            return text
        raise ValueError(f"--hazard: got {text!r}, accepted: a file, or K0:K ({error})") from None


def _uncertain(options):
    """Return the distributions of --uncertain in the parsed `options`, as texts by the names of the values."""
    distributions = {}
    for text in options.uncertain or ():
        name, equals, distribution = text.partition("=")
        if not (equals and name):
            raise ValueError(f"--uncertain: got {text!r}, accepted: NAME=DIST, as in size_factor=lognormal:1:0.05")
        distributions[name] = distribution
    if options.blocks is not None and not distributions:
        raise ValueError(f"--blocks: got {options.blocks}, accepted: together with --uncertain")
    return distributions


def _numbers(name, text):
    """Return the list of numbers of a text A,B,C or LOW:HIGH:COUNT; the latter are spaced evenly in their logarithm.

    `name` is that of the option, for the message that refuses the text.
    """
    parts = text.split(":")
    try:
        if len(parts) == 1:
            return [float(number) for number in text.split(",")]
        low, high, count = float(parts[0]), float(parts[1]), int(parts[2])
        if len(parts) == 3 and 0.0 < low < high < float("inf") and 2 <= count <= 10_000:
            return [low * (high / low) ** (k / (count - 1)) for k in range(count)]
    except (ValueError, IndexError):
        pass
    accepted = "numbers A,B,C, or LOW:HIGH:COUNT with 0 < LOW < HIGH and COUNT from 2 to 10,000"
    raise ValueError(f"{name}: got {text!r}, accepted: {accepted}")


def _warmup(_):
    """Run the command ``warmup``: compile all kernels, and say how long that took."""
    from fpk_rocking.base import precompilation

    begin = time.monotonic()
    sys.stderr.write(f"compiling machine code for this machine: about {precompilation.ALL_S} s\n")
    failed = precompilation.compile_all(lambda text: sys.stderr.write(f"fpk-rocking warmup: {text}\n"))
    if failed:
        raise OSError(
            f"{failed} of {len(precompilation.TASKS)} parts were not compiled; they will be when they are first used"
        )
    sys.stdout.write(f"Compiled in {time.monotonic() - begin:.0f} s.\n")


def _scene(options, path):
    """Return the `Scene` of a file at a path, or of the package, with the changes of --set in the parsed `options`."""
    from fpk_rocking.scene.scene import load_scene

    if path.endswith(".npz"):
        raise ValueError(f"SCENE: got {path!r}, accepted: a scene file (TOML); compare takes two saved results")
    changes = dict(map(_setting, options.set or ()))
    if getattr(options, "records", None) or getattr(options, "synthetic", None):
        # What the motions replace is not read: neither a file that is missing nor a table that is.
        changes = {"forcing": _REPLACED} | {name: value for name, value in changes.items() if name[:7] != "forcing"}
    return load_scene(path, changes)


def _setting(text):
    """Return the name and the value of a text KEY=VALUE; a value that is not TOML is a text."""
    name, equals, value = text.partition("=")
    if not (equals and name.strip()):
        raise ValueError(f"--set: got {text!r}, accepted: KEY=VALUE, as in noise.kind=none")
    try:
        return name.strip(), tomllib.loads(f"value = {value}")["value"]
    except ValueError:
        return name.strip(), value.strip()


def _solved(options, scene):
    """Solve a scene with those of the parsed `options` that are the density solver's; return the `Evolution`."""
    from fpk_rocking.density import solve_fpk
    from fpk_rocking.output.progress import reporting
    from fpk_rocking.studies import tasks

    own = _rows(options, scene) | _passed(options, "tol", "bins_tol", "noise_replacement")
    if not options.no_check:
        tasks.expect_check(scene)
    with reporting("density") as progress:
        return solve_fpk(scene, progress=progress, **own)


def _checked(options, density, beside=None):
    """Return a density, an `Evolution`, with the measured change by the replacement of its noise.

    `options` are the parsed arguments; the paths are those of `beside`, an `Ensemble` or `Tally`, if they are enough.
    """
    from fpk_rocking.output.progress import reporting
    from fpk_rocking.studies import tasks

    if options.no_check:
        return density
    with reporting("check of the noise") as progress:
        return tasks.checked(density, beside=beside, progress=progress)


def _rows(options, scene):
    """Return the cycles or the times of the parsed `options`, or the default ones for a scene, as a dict."""
    return _passed(options, "cycles", "times") or ({} if scene.period is None else {"cycles": 40})


def _passed(options, *names):
    """Return those of some parsed `options` that were passed, their values by name, as a dict."""
    return {name: getattr(options, name) for name in names if getattr(options, name) is not None}


def _simulated(options, scene):
    """Simulate a scene with those of the parsed `options` that are the engines'.

    Return an `Ensemble` or, with --tally, a `Tally`.
    """
    from fpk_rocking.output.progress import reporting
    from montecarlo import simulate, tally

    if options.method == "white":
        scene = scene.white_equivalent()
    if options.method == "filtered":
        scene = scene.filtered_equivalent()
    own = {} if scene.deterministic else {"realizations": 10_000}
    own |= _rows(options, scene)
    own |= _passed(options, "realizations", "seed", "method", "steps_per_cycle", "checkpoint")
    with reporting("Monte Carlo") as progress:
        return (tally if options.tally else simulate)(scene, progress=progress, **own)


def _loaded(options) -> list:
    """Return the list of the two saved results that the parsed `options` name."""
    from fpk_rocking.density import Evolution
    from fpk_rocking.results.storage import result_kind
    from montecarlo import Ensemble, Tally

    for flag in f"--set --cycles --times {_DENSITY} {_SAMPLE}".split():
        if _passed(options, flag.removeprefix("--").replace("-", "_")):
            raise ValueError(f"{flag}: has no effect on saved results, accepted: with a scene file")
    kinds = {"evolution": Evolution, "ensemble": Ensemble, "tally": Tally}
    for path in options.inputs:
        if result_kind(path) not in kinds:
            accepted = " or ".join(map(repr, kinds))
            raise ValueError(f"{path}: got a saved result of kind {result_kind(path)!r}, accepted: {accepted}")
    return [kinds[result_kind(path)].load(path) for path in options.inputs]


def _print(options, result, values, table, films=()):
    """Print a `Result` as JSON or as a table, and write its report where the parsed `options` ask for one.

    `values` is what JSON shows, `table` returns the arguments of `tables.show`, and `films` are the `SurvivalResult`
    whose densities the report shows.
    """
    from fpk_rocking.output import tables

    if getattr(options, "report", None):
        from fpk_rocking.output.report import write_report

        scenes = [one.scene for one in films] or result.scenes
        size = write_report(options.report, result, values, table()[2], films, scenes)
        sys.stderr.write(f"fpk-rocking {options.command}: {options.report}: {size / 1000:,.0f} kB\n")
    if options.json:
        sys.stdout.write(json.dumps(values, allow_nan=False, ensure_ascii=False) + "\n")
    else:
        tables.show(*table())


if __name__ == "__main__":
    sys.exit(main())
