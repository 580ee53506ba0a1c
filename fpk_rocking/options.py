"""Options of the command line: their names and help, and what their texts stand for."""

import argparse
import pathlib
import re
import sys
import tomllib
from typing import Any

from fpk_rocking import console

DESCRIPTION = "Rocking and overturning of a free-standing rigid block under noisy shaking."


EXAMPLES = """\
a scene is a TOML file, or the name of a scene of the package: main, second, fig05, second_harmonic, rest, record

examples:
  fpk-rocking probability rack.toml --cycles 10 --tol 0.002
      the probability that the block overturns, to the wanted error, by the engine expected to be fastest
  fpk-rocking fpk main
      probability density by finite elements, 40 forcing cycles
  fpk-rocking mc main --realizations 20000 --seed 7
      Monte Carlo of the same scene
  fpk-rocking mc main --realizations 10000000 --tally --checkpoint results/main/tally.npz
      an ensemble larger than memory; if the run is stopped, the same command continues from the file
  fpk-rocking compare main --cycles 10 --out results/main
      finite elements and Monte Carlo side by side; saves results, a figure and a summary
  fpk-rocking compare results/main/density.npz results/main/ensemble.npz
      two saved results side by side
  fpk-rocking fragility main --scales 0.2:2:20 --cycles 10 --out results/fragility
      probability of overturning against the scale of the shaking, with a lognormal fit
  fpk-rocking risk rack.toml --records motions/*.AT2 --hazard pgv.csv --out results/risk
      annual rate of overturning, with curves that OpenQuake and pelicun read
  fpk-rocking records motions/*
      what is in files of recorded motions: components, units, intervals, peaks
  fpk-rocking fpk main --json > survival.json
      one JSON object instead of a table
  fpk-rocking compare cases/scenes/main.toml --cycles 10 --report main.html
      numbers, verdict and densities as one file for the browser

fpk-rocking COMMAND --help lists the options of a command
"""
DENSITY = "--tol --bins-tol --noise-replacement --no-check"


SAMPLE = "--realizations --seed --method --steps-per-cycle --tally --checkpoint"


_OPTIONS = """
scene SCENE             scene file (TOML), or the name of a scene of the package
scenes SCENE+           scene file (TOML), or the name of a scene of the package; several give a curve each
files FILE+             files of recorded motions
inputs FILE+            a scene (file or name) to solve by both engines, or two saved results (.npz)
--set KEY=VALUE*        change a value of the scene file, as in noise.kind=none or forcing.peak_acceleration='0.3 g';
                        may be repeated
--cycles N:int          forcing cycles (default 40)
--times T:float+        for a pulse or a record, in place of --cycles: nondimensional times of the results (default: 21
                        equally spaced times over its duration, and one more, 10 after its end)
--out DIR:path          folder for files
--samples-per-cycle N:int  number of times in each forcing cycle for which results are given (default 1; with --movie
                        16, or fewer if there are many cycles); with --out, fpk writes VTK files for all of them
--movie FILE:path       movie to write, .gif, or .mp4 (needs the program ffmpeg): the density, the overturned part and
                        the survival over time
--report FILE:path      HTML file to write: numbers, verdict, pictures and the density after every cycle
--json                  print one JSON object instead of a table
--tol X:float           wanted error: of the answer of the command probability (default 0.005); elsewhere of survival by
                        the density solver (default 0.001; 0.01 for a pulse, a record, noise with an envelope, or the
                        command fragility)
--rtol X:float          wanted relative error of the probability; if --tol is given too, the larger error is enough
--limit S:float         longest run time in seconds, without compilation (default 600); a run predicted to take longer
                        is refused
--bins-tol X:float      error of the binned density (L1) that the density solver aims at (default: a third of the square
                        root of --tol; for a pulse, a record or noise with an envelope this default only enters the
                        verdict); inf accepts any error
--noise-replacement NAME  noise that replaces band noise in the density solver: white; exponential or filtered, under
                        which blocks can come to rest; or auto (default), the fastest whose estimated error is within
                        --tol
--no-check              if the density solver replaces the noise, do not measure the resulting error by Monte Carlo
                        with the noise of the scene
--realizations N:int    number of paths, for each scene at each scale or intensity (default 10,000, or 1 where nothing
                        is random)
--seed N:int            seed of the random numbers (default 1)
--method NAME           exact (event-driven) or rk4 (Runge-Kutta), both for band noise or no noise; white, which
                        replaces other noise by white noise; filtered, which replaces band noise by low-pass noise
                        (default: exact, white or filtered, whichever fits the noise)
--steps-per-cycle N:int  time steps in a forcing cycle (default 200; the method exact has no time steps)
--tally                 keep only survival, histograms and moments, which need little memory for any number of paths
--checkpoint FILE:path  with --tally: file that keeps the state of the run; if it exists, the run continues from it
--scales LIST           factors that multiply the shaking: A,B,C, or LOW:HIGH:COUNT for logarithmic spacing
--pga LIST              in place of --scales: peak accelerations in g of the shaking without noise; the column scale is
                        then the PGA
--pgv LIST              in place of --scales: peak velocities in m/s; the column scale is then the PGV
--engine NAME           exact, rk4, white or filtered (Monte Carlo), or density (default: the Monte Carlo method that
                        fits the noise)
--levels LIST           also compute the probability of reaching the angles A,B,C, in units of the critical angle
--over NAME=LIST        vary a parameter as well, for a surface over scale and parameter: NAME=A,B,C or
                        NAME=LOW:HIGH:COUNT, as in size=0.5,1,2
--keep-noise            scale the motion alone and keep the noise as it is
--uncertain NAME=DIST*  distribution of a value: NAME is width, height or size (half diagonal) in m, slenderness, or a
                        name of the scene file such as block.restitution, each in its own unit; NAME_factor is a
                        multiple of the scene's own value. DIST is uniform:LOW:HIGH, normal:MEAN:DEVIATION,
                        lognormal:MEDIAN:DISPERSION or beta:A:B:LOW:HIGH, as in size_factor=lognormal:1:0.05; may be
                        repeated
--blocks N:int          with --uncertain: number of blocks drawn for each scene or record (default: as many as make 100
                        in all; with one record at least 5 are needed)
--events N:int          every N consecutive records are components of one event and count as one motion (default:
                        records whose files state the same event and station)
--mass KG:float         mass of the block: the forces of a tie that would hold it are then in N, not fractions of its
                        weight
--friction MU:float     coefficient of friction below the block: the verdict says whether it slides before it rocks
--workers N:int         number of worker processes, one processor each (default 1: this process alone, on all
                        processors)
--store FILE:path       file that keeps every point once it is computed; if it exists, the run continues from it
--records FILE+         files of recorded motions (the command records lists their contents); the scene gives block and
                        noise, and needs no forcing
--synthetic N:int       in place of --records: number of synthetic motions on firm ground
--hazard FILE|K0:K      hazard curve: a file of two columns, intensity in g or m/s and annual rate of exceedance, or the
                        quantities that its first line names, as in "PGA (cm/s2),return period (years)"; a file of
                        OpenQuake's hazard curves; or K0:K for the rate K0 intensity^-K. Without it, the fragility curve
                        is computed, but no rate
--site LON,LAT|N        site in a file of OpenQuake's hazard curves: --site=LON,LAT in degrees, or its number from 1
--ground FILE+          for records of an upper floor: files of the ground motion of each record, in the same order;
                        intensities are those of the ground, and both motions are scaled together
--building T,ZETA,FACTOR  for a block on an upper floor and records of the ground: period in seconds and damping ratio
                        of a building of one mode, and its participation factor times mode shape at the floor, as in
                        0.5,0.05,1.3
--intensities LIST      intensities to compute: A,B,C, or LOW:HIGH:COUNT for logarithmic spacing (default of risk: 12
                        over the range in which the motions overturn the block)
--measure NAME          intensity of the motion: PGV in m/s (default), PGA in g, "Sa(1.0)" in g (at 1 s, 5 %% damped) or
                        "PGV*", which is p PGV/(g tan θ_cr); for a block on an upper floor also the peak of the floor
                        motion, PFA in g or PFV in m/s
--units NAME            unit of the records where their files do not say it: g, m/s2, cm/s2, mm/s2, mg, g/10, %%g, ft/s2
                        or in/s2
--interval S:float      time between samples, seconds, where the files do not say it
--component NAME        component to use of files with several, by its name or its number from 1
--vertical FILE+        files of the vertical motion of each record, in the same order (the same files if they have
                        both): it changes the weight of the block, and is scaled with the record
--baseline NAME         baseline to remove from the records: none, mean, linear (line of least squares), or high-pass
                        (that line, and frequencies below --corner-hz); default: none, or what the scene file says
--corner-hz F:float     corner frequency of --baseline high-pass, Hz (default 0.1, or what the scene file says)
--name NAME             identifier of the block in the exported files (default rocking_block; several blocks have the
                        names of their scene files)
--azimuth DEG:float     direction in which the block rocks, degrees clockwise from north. Each record is then two
                        horizontal components, in one file or in two consecutive files, and the names of the components
                        state their azimuths
--depth LENGTH          with --azimuth: width of the block in the plane at right angles, in m or as "90 cm"; that plane
                        is then studied too
"""
"""Every argument of the command line: name, what stands for its value with the type, and help.

Without what stands for a value it is a switch. After it, + means one value or more, * that the option may be repeated.
"""


_REPLACED = {"amplitude": 0.0, "frequency": 1.0}
"""Table [forcing] of a scene that has none, or none that can be read, as recorded motions replace it."""


def arguments_by_name():
    """Keyword arguments of argparse for each entry of `_OPTIONS`, by its name, such as "--tol"."""
    arguments: dict[str, dict[str, Any]] = {}
    types = {"int": _whole, "float": _real, "path": pathlib.Path, "": None}
    marks = {"+": {"nargs": "+"}, "*": {"action": "append"}, "": {}}
    for entry in re.split(r"\n(?=\S)", _OPTIONS.strip()):
        head, text = re.split(r"\s{2,}", entry, maxsplit=1)
        name, _, form = head.partition(" ")
        metavar, kind, mark = re.fullmatch(r"(.*?)(?::(int|float|path))?([+*]?)", form).groups("")
        own = {"metavar": metavar, "type": types[kind]} if form else {"action": "store_true", "default": None}
        arguments[name] = {"help": " ".join(text.split())} | own | marks[mark]
    return arguments


def _real(text):
    """Number of a text; argparse puts the name of the option before the refusal."""
    try:
        return float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"got {text!r}, accepted: a number without a unit") from None


def _whole(text):
    """Whole number of a text, as `_real`."""
    try:
        return int(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"got {text!r}, accepted: a whole number") from None


class Parser(argparse.ArgumentParser):
    """Refuses bad input in one line, as the rest of the command line does."""

    def error(self, message):
        # What a file of its own is for other commands.
        hint = " (risk writes its report into the folder of --out)" * ("arguments: --report" in message)
        self.exit(2, f"{self.prog}: {console.line(message)}{hint}\n")


class Version(argparse.Action):
    """Prints the version, which is looked up only then."""

    def __call__(self, parser, *_):
        from importlib.metadata import version

        sys.stdout.write(f"fpk-rocking {version('fpk-rocking')}\n")
        parser.exit(0)


def hazard_of(text, site=None):
    """Return the hazard of a text K0:K, or of the file of this name, at a site of it."""
    from fpk_rocking.risk.hazard import Hazard

    rate, colon, exponent = text.partition(":")
    try:
        if colon and site is None:
            return Hazard.power_law(float(rate), float(exponent))
    except ValueError as error:
        if not pathlib.Path(text).exists():
            raise ValueError(f"--hazard: got {text!r}, accepted: a file, or K0:K ({error})") from None
    return Hazard.from_csv(text, site)


def distributions(options):
    """Distributions of --uncertain, texts by the names of the values."""
    laws = {}
    for text in options.uncertain or ():
        name, equals, law = text.partition("=")
        if not (equals and name):
            raise ValueError(f"--uncertain: got {text!r}, accepted: NAME=DIST, as in size_factor=lognormal:1:0.05")
        laws[name] = law
    if options.blocks is not None and not laws:
        raise ValueError(f"--blocks: got {options.blocks}, accepted: together with --uncertain")
    return laws


def numbers(name, text):
    """Numbers of a text A,B,C or LOW:HIGH:COUNT, of which the latter are spaced evenly in their logarithm."""
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


def scene_of(options, path):
    """Return the scene of a file, or of the package, with the changes of --set."""
    from fpk_rocking.scene.scene import load_scene

    if path.endswith(".npz"):
        raise ValueError(f"SCENE: got {path!r}, accepted: a scene file (TOML); compare takes two saved results")
    changes = dict(map(_setting, options.set or ()))
    try:
        return load_scene(path, changes)
    except (TypeError, ValueError, OSError):
        if not (options.records or options.synthetic):
            raise
    # What the motions replace need not be there, neither its table nor its file.
    kept = {name: value for name, value in changes.items() if name[:7] != "forcing"}
    return load_scene(path, {"forcing": _REPLACED} | kept)


def _setting(text):
    """Name and value of a text KEY=VALUE, the value as TOML reads it; one that is not TOML is a text."""
    name, equals, value = text.partition("=")
    if not (equals and name.strip()):
        raise ValueError(f"--set: got {text!r}, accepted: KEY=VALUE, as in noise.kind=none")
    # TOML asks for a digit before the point.
    number = re.sub(r"^ *(-?)[.](?=[0-9])", r"\g<1>0.", value)
    try:
        return name.strip(), tomllib.loads(f"value = {number}")["value"]
    except ValueError:
        return name.strip(), value.strip()


def cases_of(options):
    """(cases, azimuths) of the command risk: name, scene and records of each study; azimuths of both planes or ()."""
    from fpk_rocking.risk.inputs import synthetic_records
    from fpk_rocking.risk.planes import in_plane
    from fpk_rocking.scene.units import in_units
    from fpk_rocking.studies.scenes import varied

    scenes, records = [scene_of(options, path) for path in options.scenes], options.records or ()
    check_noise_kept(options, scenes)
    name, depth, azimuth = options.name or "rocking_block", options.depth, options.azimuth
    refused = (
        (options.synthetic and records, "synthetic", "nothing beside --records"),
        (
            len(scenes) > 1 and not (records or options.synthetic),
            "records",
            "motions for several blocks (or --synthetic)",
        ),
        (len(scenes) > 1 and options.name, "name", "one scene; several blocks have the names of their files"),
        (len(scenes) > 1 and options.mass, "mass", f"one scene, not {len(scenes)}"),
        (azimuth is not None and not records, "azimuth", "together with --records"),
        (azimuth is not None and options.component, "component", "nothing beside --azimuth"),
        (azimuth is not None and options.ground, "azimuth", "without --ground, whose motions are not turned"),
        (depth and options.ground, "depth", "without --ground, whose motions are not turned"),
        (depth and azimuth is None, "depth", "together with --azimuth, which is missing"),
        (depth and len(scenes) > 1, "depth", f"with one scene, not with {len(scenes)}"),
    )
    for wrong, option, accepted in refused:
        if wrong:
            raise ValueError(f"--{option}: got {getattr(options, option)!r}, accepted: {accepted}")
    names = [re.sub(r"[^A-Za-z0-9_-]+", "_", pathlib.Path(path).stem) for path in options.scenes]
    names = [name] if len(scenes) == 1 else names
    if options.synthetic:
        records = synthetic_records(options.synthetic, **passed(options, "seed"))
    if azimuth is None:
        return [(*pair, records) for pair in zip(names, scenes, strict=True)], ()
    turns = (azimuth, (azimuth + 90.0) % 360.0)[: 1 + bool(depth)]
    motions = [in_plane(records, turn, **passed(options, "units", "interval")) for turn in turns]
    if not depth:
        return [(*pair, motions[0]) for pair in zip(names, scenes, strict=True)], ()
    across = varied(scenes[0], "width", in_units("--depth", _setting(f"depth={depth}")[1], "length"))
    return [(f"{name}_width", scenes[0], motions[0]), (f"{name}_depth", across, motions[1])], turns


def check_noise_kept(options, scenes):
    """Raise ValueError for --keep-noise where no scene has noise."""
    if options.keep_noise and all(scene.noise.kind == "none" for scene in scenes):
        raise ValueError("--keep-noise: got scenes without noise, accepted: scenes with [noise]")


def events_of(options, records):
    """Labels of --events, one for each of some records; None without it."""
    each, count = options.events, len(records)
    if each is None:
        return None
    if each < 1 or not count or count % each:
        raise ValueError(f"--events: got {each}, accepted: a number of which the {count} records are a multiple")
    return [place // each for place in range(count)]


def rows_of(options, scene):
    """Cycles or times as keyword argument of the solvers; 40 cycles by default where the scene has any."""
    return passed(options, "cycles", "times") or ({} if scene.period is None else {"cycles": 40})


def samples_of(options, scene):
    """Times in each cycle as keyword argument of the solvers; with a movie so many that it has about 320 frames."""
    cycles = rows_of(options, scene).get("cycles")
    frames = {"samples_per_cycle": min(16, max(1, 320 // max(cycles, 1)))} if options.movie and cycles else {}
    return frames | passed(options, "samples_per_cycle")


def passed(options, *names):
    """Values of those options that were passed, by name."""
    return {name: getattr(options, name) for name in names if getattr(options, name) is not None}


def scenes_at_scales(options, scenes):
    """Scenes at scale 1, where that is an intensity of 1, scales, and the measure that was stated."""
    from fpk_rocking.risk.motions import at_intensity

    lists = passed(options, "scales", "pga", "pgv", "intensities")
    if len(lists) != 1:
        raise ValueError(
            f"--scales: got {options.scales!r}, accepted: factors, or --pga, --pgv or --intensities in its place"
        )
    ((option, text),) = lists.items()
    if options.measure and option != "intensities":
        raise ValueError(f"--measure: got {options.measure!r}, accepted: together with --intensities")
    measure = {"scales": None, "intensities": options.measure or "PGV"}.get(option, option.upper())
    if measure:
        scenes = [at_intensity(scene, measure, noise=not options.keep_noise) for scene in scenes]
    # That of --pga and --pgv is seen where all scenes have it, which those of --over may not.
    return scenes, numbers(f"--{option}", text), measure if option == "intensities" else None


def building_of(options):
    """Return the building of --building, or None."""
    from fpk_rocking.risk.floors import Building

    if options.building is None:
        return None
    try:
        period, damping, factor = map(float, options.building.split(","))
    except ValueError:
        accepted = "T,ZETA,FACTOR: three numbers, as 0.6,0.05,1.1"
        raise ValueError(f"--building: got {options.building!r}, accepted: {accepted}") from None
    return Building(period, damping, factor)


def shaken_scenes(options):
    """The scenes that are named, or one scene under each of the records; a sentence on the forcing they replace."""
    from fpk_rocking.risk.motions import recorded_scenes, unused_forcing_text

    scenes = [scene_of(options, path) for path in options.scenes]
    check_noise_kept(options, scenes)
    if options.records and len(scenes) > 1:
        raise ValueError(f"--records: got {len(scenes)} scenes, accepted: one, which gives block and noise")
    for name, value in passed(options, "units", "interval", "component", "ground", "building", "vertical").items():
        if not options.records:
            raise ValueError(f"--{name}: got {value!r}, accepted: together with --records")
    corrections = passed(options, "units", "interval", "component", "baseline", "corner_hz", "ground", "vertical")
    corrections["building"] = building_of(options)
    if not options.records and corrections == {"building": None}:
        return scenes, ""
    records = options.records or ()
    shaken = [one for scene in scenes for one in recorded_scenes(scene, records, **corrections)]
    return shaken, unused_forcing_text(scenes[0], records, shaken)
