"""The command line: ``fpk-rocking probability|fpk|mc|compare|fragility|risk|records|warmup``.

Results go to standard output or to files, progress and errors to standard error. Exit status: 0, 2 for bad input or
what the machine refuses, 130 when interrupted, 143 when terminated. Files are complete or not there.
"""

import argparse
import json
import shlex
import sys
import time
import warnings

from fpk_rocking import console
from fpk_rocking.options import (
    DENSITY,
    DESCRIPTION,
    EXAMPLES,
    SAMPLE,
    Parser,
    Version,
    arguments_by_name,
    building_of,
    cases_of,
    distributions,
    events_of,
    hazard_of,
    numbers,
    passed,
    rows_of,
    samples_of,
    scene_of,
    scenes_at_scales,
    shaken_scenes,
)


def main(arguments=None) -> int:
    """Run the command line; return the exit status. The arguments are by default those of the process."""
    options, begun = command_line().parse_args(arguments), time.time()
    options.typed = shlex.join(["fpk-rocking", *(sys.argv[1:] if arguments is None else map(str, arguments))])
    try:
        with console.terminable(), console.insistent(), console.plain_warnings(options.command):
            if options.out:
                console.check_folder("--out", options.out)
            for name, file in (("--report", options.report), ("--movie", options.movie)):
                if file:
                    console.check_folder(name, file.parent)
                    if file.is_dir():
                        raise ValueError(f"{name}: got the folder {str(file)!r}, accepted: a file to write")
            if options.movie:
                from fpk_rocking.results.movie import movie_writer

                movie_writer(options.movie, name="--movie")
            if options.checkpoint and not options.tally:
                raise ValueError(f"--checkpoint: got {str(options.checkpoint)!r}, accepted: together with --tally")
            options.run(options)
            sys.stdout.flush()
    except KeyboardInterrupt as stop:
        left = console.what_is_left(begun, options.out, options.checkpoint or options.store)
        word = "terminated" if isinstance(stop, console.Terminated) else "interrupted"
        sys.stderr.write(f"fpk-rocking: {word}; {left}\n")
        return 143 if isinstance(stop, console.Terminated) else 130
    except (ValueError, TypeError, OSError, ArithmeticError, MemoryError) as error:
        sys.stderr.write(f"fpk-rocking {options.command}: {console.line(error) or type(error).__name__}\n")
        console.drop_unwritten()
        return 2
    return 0


def command_line() -> argparse.ArgumentParser:
    """Parser of the command line, with one for each command."""
    layout = argparse.RawDescriptionHelpFormatter
    parser = Parser("fpk-rocking", description=DESCRIPTION, epilog=EXAMPLES, formatter_class=layout)
    parser.add_argument("--version", action=Version, nargs=0, help="print the version and exit")
    # What every command is asked for, whether it has the option or not.
    parser.set_defaults(**dict.fromkeys(("out", "report", "movie", "checkpoint", "store", "records", "synthetic")))
    commands, arguments = parser.add_subparsers(dest="command", required=True, metavar="COMMAND"), arguments_by_name()

    def command(name, run, does, more="", options="", files=""):
        """Add the parser of a command: what it does, its options by name, and what the help of --out says it writes."""
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
    command("probability", _probability, does, "Takes the engine expected to be fastest.", wanted, files)
    does = "probability density by finite elements (Fokker-Planck equation)"
    files = "result.npz, summary.json and a VTK series jpdf.pvd"
    within = "--samples-per-cycle --movie"
    command("fpk", _fpk, does, printed, f"scene {rows} {within} {DENSITY}", files)
    does = "Monte Carlo simulation of many realizations"
    command("mc", _mc, does, printed, f"scene {rows} {within} {SAMPLE}", "result.npz and summary.json")
    does = "finite elements and Monte Carlo on one scene, or two saved results, side by side"
    files = "summary.json, survival.png and, if a scene was solved, density.npz and ensemble.npz"
    command("compare", _compare, does, printed, f"inputs {rows} {DENSITY} {SAMPLE}", files)
    does = "probability of overturning against the scale of the shaking, with a lognormal fit"
    options = f"scenes --scales --pga --pgv {rows} --engine --levels --over --keep-noise --realizations --tol --seed"
    files = "result.npz, summary.json, fragility.csv and fragility.png"
    options += " --uncertain --blocks --workers --store --records --units --interval --component --baseline --corner-hz"
    options += " --ground --building --intensities --measure --vertical"
    command("fragility", _fragility, does, "", options, files)
    does = "annual rate of overturning, from records and a hazard curve"
    options = "scenes --set --records --hazard --site --intensities --measure --units --realizations --keep-noise"
    options += " --vertical --azimuth --depth --events --ground --building"
    options += (
        " --interval --component --synthetic --baseline --corner-hz --uncertain --blocks --mass --friction --workers"
    )
    options += " --store --name --seed --out --json"
    more = "Several scenes are blocks that are compared under the same records, motion by motion."
    command("risk", _risk, does, more, options, "risk.json, report.html, risk.png, tables, curves for other programs")
    does = "contents of files of recorded motions"
    options = "files --units --interval --component --baseline --corner-hz --json"
    more = "Prints a row for each component, with what risk would do with it, then the files that cannot be read."
    command("records", _records, does, more, options)
    command("warmup", _warmup, "compile all engines for this machine now, so that no first run has to wait for it")
    return parser


def _probability(options):
    from fpk_rocking.output.tables import probability_table, reporting
    from fpk_rocking.results.pictures import save
    from fpk_rocking.studies.probability import probability

    scene = scene_of(options, options.scene)
    own = rows_of(options, scene) | passed(options, "tol", "rtol", "seed")
    own |= {} if options.limit is None else {"limit_s": options.limit}
    with reporting("probability") as progress:
        answer = probability(scene, progress=progress, **own)
    if options.out:
        answer.save(options.out / "result.npz")
        answer.to_csv(options.out / "probability.csv")
        save(answer.plot(), options.out / "probability.png")
    _hand_over(options, answer, answer.summary(), probability_table(answer))
    if answer.interrupted:
        raise KeyboardInterrupt


def _fpk(options):
    from fpk_rocking.compare import shown_cycles
    from fpk_rocking.output import tables, vtk

    scene = scene_of(options, options.scene)
    density = _checked(options, _solved(options, scene, **samples_of(options, scene)))
    if options.out:
        density.save(options.out / "result.npz")
        whole = sorted({0, *shown_cycles((len(density.times) - 1) // density.samples_per_cycle)})
        vtk.write_series(options.out, "jpdf", density, None if options.samples_per_cycle else whole)
    _animate(options, density)
    _hand_over(options, density, density.summary(), tables.result_table(density), [density])


def _mc(options):
    from fpk_rocking.output import tables

    scene = scene_of(options, options.scene)
    samples = passed(options, "samples_per_cycle") if options.tally else samples_of(options, scene)
    if options.tally and samples:
        accepted = "nothing beside --tally, which counts after whole cycles"
        raise ValueError(f"--samples-per-cycle: got {options.samples_per_cycle}, accepted: {accepted}")
    sample = _simulated(options, scene, **samples)
    if options.out:
        sample.save(options.out / "result.npz")
    _animate(options, sample)
    _hand_over(options, sample, sample.summary(), tables.result_table(sample), [sample])


def _compare(options):
    from fpk_rocking.compare import compare
    from fpk_rocking.output import figures, tables

    if len(options.inputs) == 2:
        first, second = _loaded(options)
    elif len(options.inputs) == 1:
        scene = scene_of(options, options.inputs[0])
        second, first = _solved(options, scene), _simulated(options, scene)
        second = _checked(options, second, beside=first)
    else:
        raise ValueError(f"inputs: got {len(options.inputs)} files, accepted: one scene file or two saved results")
    compared = compare(first, second)
    if options.out:
        if len(options.inputs) == 1:
            first.save(options.out / "ensemble.npz")
            second.save(options.out / "density.npz")
        figures.survival_figure(options.out / "survival.png", [second, first])
    _hand_over(options, compared, compared.summary(), tables.comparison_table([compared]), [second, first])


def _fragility(options):
    from fpk_rocking.output.tables import reporting
    from fpk_rocking.results.storage import write_csv
    from fpk_rocking.risk import IntensityCurve, drawn, fragility
    from fpk_rocking.risk.motions import motion_lines, motion_table
    from fpk_rocking.risk.picture import curve_columns, curve_table, fragility_table

    (scenes, replaced), over = shaken_scenes(options), None
    if options.over is not None:
        name, equals, values = options.over.partition("=")
        if not equals:
            raise ValueError(f"--over: got {options.over!r}, accepted: NAME=A,B,C or NAME=LOW:HIGH:COUNT")
        over = {name: numbers("--over", values)}
        if len(scenes) > 1:
            raise ValueError(f"--over: got {options.over!r}, accepted: with one motion, not {len(scenes)}")
    scenes, scales, measure = scenes_at_scales(options, scenes)
    motions = scenes
    uncertain, draws = distributions(options), None
    if uncertain:
        if over is not None:
            raise ValueError(f"--uncertain: got {options.uncertain}, accepted: nothing beside --over")
        draws = drawn(scenes, uncertain, **passed(options, "seed"), count=options.blocks or -(-100 // len(scenes)))
        scenes = draws.scenes
    with reporting("fragility") as progress:
        result = fragility(
            scenes[0] if len(scenes) == 1 else scenes,
            scale=scales,
            measure=measure,
            **rows_of(options, scenes[0]),
            levels=numbers("--levels", options.levels) if options.levels else (),
            over=over,
            scale_noise=not options.keep_noise,
            progress=progress,
            **passed(options, "engine", "realizations", "tol", "seed", "workers", "store"),
        )
    curves, values = [], result.summary()
    if draws is not None or (options.records and len(scenes) > 1):
        # The saved result keeps the rows of each scene; what is looked at are the curves over all of them.
        curves = [IntensityCurve.of(result, result.measure, which, draws=draws) for which in range(len(result.names))]
        values |= {"pooled": curves[0].summary(), "pooled_levels": [curve.summary() for curve in curves[1:]]}
    if options.out:
        result.save(options.out / "result.npz")
        write_csv(options.out / "fragility.csv", result.table() if draws is None else curve_columns(curves))
        _fragility_figure(options.out / "fragility.png", result, curves)
    title, table, sentences = curve_table(curves) if curves else fragility_table(result)
    if curves and options.records:
        of_motions = result.motion_table if draws is None else motion_table(motions)
        sentences += tuple(motion_lines(of_motions, result.measure, at_one=True))
    sentences += (replaced,) * bool(replaced)
    _hand_over(options, curves[0] if curves else result, values, (title, table, sentences))


def _fragility_figure(path, result, curves):
    """Draw a `Fragility` as curves or as a surface, or its `IntensityCurve`s, if any."""
    from fpk_rocking.results.pictures import page
    from fpk_rocking.risk.picture import curves_figure, curves_title, draw_curve, surface_figure

    if curves:
        with page(path, (6.0 * len(curves) + 1.0, 5.0), curves_title(curves)) as figure:
            for axes, curve in zip(figure.subplots(1, len(curves), squeeze=False)[0], curves, strict=True):
                draw_curve(axes, curve)
    elif result.axis == "scene":
        curves_figure(path, [result], which=None)
    else:
        surface_figure(path, result)


def _risk(options):
    from fpk_rocking.output.tables import reporting
    from fpk_rocking.risk.designs import Designs
    from fpk_rocking.risk.study import study

    intensities = None if options.intensities is None else numbers("--intensities", options.intensities)
    hazard = None if options.hazard is None else hazard_of(options.hazard, options.site)
    (cases, turns), studies = cases_of(options), []
    for name, scene, records in cases:
        # What files leave open counts for files alone.
        own = passed(options, "units", "interval", "component") if records is options.records else {}
        own |= passed(options, "store") if len(cases) == 1 else {}
        with reporting(f"records, {name}" if len(cases) > 1 else "records") as progress:
            result = study(
                scene,
                records,
                hazard,
                intensities,
                events=events_of(options, records),
                scale_noise=not options.keep_noise,
                uncertain=distributions(options),
                name=name,
                building=building_of(options),
                progress=progress,
                **passed(
                    options,
                    "ground",
                    "blocks",
                    "mass",
                    "friction",
                    "measure",
                    "baseline",
                    "corner_hz",
                    "realizations",
                    "seed",
                    "workers",
                ),
                **passed(options, "vertical"),
                **own,
            )
        studies.append(result)
    result = studies[0] if len(studies) == 1 else Designs(tuple(studies), turns)
    if options.out:
        result.write(options.out, options.typed)
        for one in studies:
            files = {f"{one.name}.xml for OpenQuake is not written": one.not_for_openquake}
            files[f"{one.name}.csv and {one.name}.json for pelicun are not written"] = one.not_for_pelicun
            for missing, why in files.items():
                sys.stderr.write(f"fpk-rocking risk: {missing}: {why}\n" * bool(why))
    text = json.dumps(result.summary(), allow_nan=False, ensure_ascii=False) if options.json else result.text()
    sys.stdout.write(text + "\n")


def _records(options):
    from fpk_rocking.results.storage import plain
    from fpk_rocking.risk.records import survey, table_lines

    rows, refused = survey(options.files, **passed(options, "units", "interval", "component", "baseline", "corner_hz"))
    if options.json:
        values = plain({"records": [row._asdict() for row in rows], "refused": refused})
        sys.stdout.write(json.dumps(values, allow_nan=False, ensure_ascii=False) + "\n")
    else:
        sys.stdout.write("\n".join([*table_lines(rows), *refused, ""]))
    if refused:
        raise ValueError(f"files: {len(refused)} of {len(options.files)} cannot be read")


def _warmup(_):
    compile_ahead(warmup_compilations())


def compile_ahead(compilations):
    """Run compilations, and say how long that took; OSError where some failed."""
    from fpk_rocking.base.precompilation import compile_all

    begin = time.monotonic()
    sys.stderr.write("compiling machine code for this machine: about 80 s\n")
    failed = compile_all(compilations, lambda text: sys.stderr.write(f"fpk-rocking warmup: {text}\n"))
    if failed:
        raise OSError(f"{failed} of {len(compilations)} parts were not compiled; they will be when they are first used")
    sys.stdout.write(f"Compiled in {time.monotonic() - begin:.0f} s.\n")


def warmup_compilations():
    """Compilations of all kernels, but for blocks of unequal sides: the first call compiles these."""
    from fpk_rocking.density.filtered import REST
    from fpk_rocking.density.solver import DENSITY, FREE_FLIGHT
    from fpk_rocking.horizon.operator import OPERATOR
    from fpk_rocking.scene.least import least_scenes
    from montecarlo.engines import ENGINES
    from montecarlo.engines.batches import compilation_of

    kinds = "slender", "exact"
    scenes = [scene for kind in kinds for scene in least_scenes(kind).values()]
    paths = {compilation_of(engine, scene) for engine in ENGINES for scene in scenes if engine.takes(scene)}
    return [FREE_FLIGHT, *(table[kind] for table in (DENSITY, REST) for kind in kinds), *sorted(paths), OPERATOR]


def _animate(options, result):
    """Write the movie of a result, if one is asked for."""
    from fpk_rocking.output.tables import reporting

    if options.movie:
        with reporting("movie") as progress:
            result.animate(options.movie, progress=progress)


def _solved(options, scene, **samples):
    """Return the density of a scene."""
    from fpk_rocking.base import precompilation
    from fpk_rocking.density import solve_fpk
    from fpk_rocking.output.tables import reporting
    from fpk_rocking.studies import tasks

    own = rows_of(options, scene) | samples | passed(options, "tol", "bins_tol", "noise_replacement")
    for kernels in () if options.no_check else tasks.kernels_of_check(scene):
        precompilation.queue_for_helpers(kernels)
    with reporting("density") as progress:
        return solve_fpk(scene, progress=progress, **own)


def _checked(options, density, beside=None):
    """Return a density with the measured change by the replacement of its noise, unless that is not wanted."""
    from fpk_rocking.output.tables import reporting
    from fpk_rocking.studies import tasks

    if options.no_check:
        return density
    with reporting("check of the noise") as progress:
        return tasks.checked(density, beside=beside, progress=progress)


def _simulated(options, scene, **samples):
    """Return an `Ensemble` of a scene or, with --tally, a `Tally`."""
    from fpk_rocking.output.tables import reporting
    from fpk_rocking.results.remarks import describe_replacement
    from montecarlo import simulate, tally

    if options.method in ("white", "filtered"):
        sampled = scene.white_equivalent() if options.method == "white" else scene.filtered_equivalent()
        if said := describe_replacement(scene, sampled):
            warnings.warn(said, stacklevel=2)
        scene = sampled
    own = {} if scene.deterministic else {"realizations": 10_000}
    own |= rows_of(options, scene) | samples
    own |= passed(options, "realizations", "seed", "method", "steps_per_cycle", "checkpoint")
    with reporting("Monte Carlo") as progress:
        return (tally if options.tally else simulate)(scene, progress=progress, **own)


def _loaded(options) -> list:
    """Return two saved results; ValueError for an option that has no effect on them."""
    from fpk_rocking.density import Evolution
    from fpk_rocking.results.storage import result_kind
    from montecarlo import Ensemble, Tally

    for flag in f"--set --cycles --times {DENSITY} {SAMPLE}".split():
        if passed(options, flag.removeprefix("--").replace("-", "_")):
            raise ValueError(f"{flag}: has no effect on saved results, accepted: with a scene file")
    kinds = {"evolution": Evolution, "ensemble": Ensemble, "tally": Tally}
    for path in options.inputs:
        if result_kind(path) not in kinds:
            accepted = " or ".join(map(repr, kinds))
            raise ValueError(f"{path}: got a saved result of kind {result_kind(path)!r}, accepted: {accepted}")
    return [kinds[result_kind(path)].load(path) for path in options.inputs]


def _hand_over(options, result, values, table, films=()):
    """Write summary and report of a result where they are asked for, and print `values` as JSON or a table.

    `table`: title, table and sentences; `films`: the results whose densities the report shows.
    """
    from fpk_rocking.output import tables
    from fpk_rocking.results.storage import write_json

    if options.out:
        write_json(options.out / "summary.json", values)
    if options.report:
        from fpk_rocking.output.report import write_report

        scenes = [film.scene for film in films] or result.scenes
        size = write_report(options.report, result, values, table[2], films, scenes)
        sys.stderr.write(f"fpk-rocking {options.command}: {options.report}: {size / 1000:,.0f} kB\n")
    if options.json:
        sys.stdout.write(json.dumps(values, allow_nan=False, ensure_ascii=False) + "\n")
    else:
        tables.show(*table)
