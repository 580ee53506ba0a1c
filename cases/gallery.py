"""Render every figure of the cases into docs/gallery.

Each case is run as its own command line would, Fig. 6 with smaller errors, into a folder under ``results``, and its
pictures are reduced to at most 150 kB: fewer colours first, then fewer pixels. A picture file holds its title, which
says what it shows. What the case wrote as ``.json`` stands beside the pictures under the same name. A case that fails
leaves the gallery as it was. Some cases draw from these numbers alone: for a change of their looks they need not run
again. docs/gallery.md shows all pictures, those of the benchmarks too.

Run time: about half an hour on 2 cores, half of it for the noise band.

    python cases/gallery.py
    python cases/gallery.py --only fig04_phase_flux
    python cases/gallery.py --redraw --only band_inferred
"""

import argparse
import importlib
import json
import pathlib
import sys
import time

from fpk_rocking.results.storage import replaced_atomically, write_text

# The pictures of each case, and what they are called in the gallery.
PICTURES = {
    "fig02_phase_portrait": {"fig02.png": "fig02.png"},
    "fig03_critical_amplitude": {"fig03.png": "fig03.png"},
    "fig04_phase_flux": {"fig04.png": "fig04.png"},
    "fig05_overturning": {"fig05.png": "fig05.png"},
    "fig06_jpdf_evolution": {
        "fig06.png": "fig06.png",
        "maps.png": "fig06_maps.png",
        "survival.png": "fig06_survival.png",
    },
    "fig07_survival_against_noise": {"fig07.png": "fig07.png"},
    "fig08_mean_poincare": {"fig08.png": "fig08.png"},
    "fig09_mean_map_and_noise": {"fig09.png": "fig09.png"},
    "bifurcation": {"bifurcation.png": "bifurcation.png"},
    "survival_against_restitution": {"restitution.png": "restitution.png"},
    "first_passage": {"passage.png": "passage.png"},
    "band_inferred": {"band.png": "band.png"},
    "leakage_against_flux": {"flux.png": "flux.png"},
    "equivalence": {"equivalence.png": "equivalence.png"},
    "time_histories": {"histories.png": "histories.png"},
    "noisy_attractor": {"attractor.png": "attractor.png"},
    "safe_basins": {"basins.png": "basins.png"},
    "low_noise": {"low_noise.png": "low_noise.png"},
    "second_harmonic": {"second_harmonic.png": "second_harmonic.png"},
    "fragility_of_blocks": {"blocks.png": "fragility_blocks.png"},
    "fragility_surface": {"surface.png": "fragility_surface.png"},
    "fema_p58": {"fema_p58.png": "fema_p58.png"},
    "rest": {"rest.png": "rest.png"},
    "overturning_spectrum": {"overturning_spectrum.png": "spectrum.png"},
    "slenderness": {"slenderness.png": "slenderness.png"},
}
# Cases with a ``draw(path, values)`` that asks for nothing beyond their numbers.
DRAWN_FROM_NUMBERS = (
    "band_inferred",
    "equivalence",
    "fema_p58",
    "fig02_phase_portrait",
    "fig03_critical_amplitude",
    "fig04_phase_flux",
    "fig07_survival_against_noise",
    "first_passage",
    "fragility_of_blocks",
    "fragility_surface",
    "leakage_against_flux",
    "low_noise",
    "rest",
    "second_harmonic",
    "slenderness",
    "survival_against_restitution",
)
# Parts of docs/gallery.md: the cases from this one on, up to the next part.
PARTS = {
    "fig02_phase_portrait": "Lin and Yim's figures",
    "bifurcation": "Dynamics of one scene",
    "band_inferred": "Noise, and what replaces it",
    "time_histories": "Paths, long runs, every start",
    "fragility_of_blocks": "Blocks in metres",
}
# What docs/gallery.md writes below a picture, where that is not the headline of its case.
CAPTIONS = {
    "fig05.png": "Fig. 5: time histories, Poincaré points, and survival under three noise bands",
    "fig06.png": "Fig. 6: the joint density after 2 to 20 cycles",
    "fig06_maps.png": "Fig. 6 as maps, by density solver and Monte Carlo",
    "fig06_survival.png": "Fig. 6: survival by both engines, and their difference",
    "convergence.png": "Error of the density on finer meshes",
    "physics_engines.png": "Engines for many bodies on one rocking block",
    "shake_table_fragility.png": "Shake-table tests: predictions and outcomes against PGV",
    "shake_table_missed.png": "Shake-table tests that are predicted wrongly",
    "shake_table_reliability.png": "Shake-table tests: reliability of the probabilities",
    "time_at_equal_error.png": "Error against computing time, density solver and samplers",
    "time_at_equal_error_growth.png": "Computing time against noise and number of cycles",
}
# Of cases that are quicker by themselves than what the gallery shows.
FINER = {"fig06_jpdf_evolution": {"realizations": 4_000_000, "tol": 1e-3}}
ROOT = pathlib.Path(__file__).parents[1]
LARGEST = 150_000
WIDTHS = (1260, 1130, 1010, 900, 800)


def run(gallery, results, cases=PICTURES, redraw=False) -> dict:
    """Run cases, or draw anew what the gallery holds of them, and put their pictures into the gallery.

    Parameters
    ----------
    gallery, results : path
        Folders for the reduced pictures, and for all that the cases write; created if missing.
    cases : dict of str to dict
        Pictures of cases by their names, as `PICTURES`; of `DRAWN_FROM_NUMBERS` if `redraw`.
    redraw : bool
        Draw from the numbers in the gallery.

    Returns
    -------
    dict
        Seconds of each case.
    """
    seconds = {}
    for name, pictures in cases.items():
        started = time.monotonic()
        folder, numbers = pathlib.Path(results) / name, pathlib.Path(gallery) / numbers_of(name, cases)
        module = importlib.import_module(name)
        if redraw:
            (picture,) = pictures
            module.draw(folder / picture, json.loads(numbers.read_text(encoding="utf-8")))
        else:
            module.run(folder, **FINER.get(name, {}))
        for picture, reduced in pictures.items():
            reduce(folder / picture, pathlib.Path(gallery) / reduced)
        if not redraw:
            write_text(numbers, _numbers(folder))
        seconds[name] = time.monotonic() - started
        sys.stderr.write(f"{name}: {seconds[name]:.0f} s\n")
    return seconds


def numbers_of(name, cases=PICTURES):
    """Return the name under which the gallery holds the numbers of a case: that of its first picture."""
    return pathlib.Path(next(iter(cases[name].values()))).with_suffix(".json").name


def _numbers(folder):
    """Return the one JSON file of a case with a line for each of its entries."""
    (numbers,) = folder.glob("*.json")
    entries = json.loads(numbers.read_text(encoding="utf-8")).items()
    lines = (f"{json.dumps(name)}: {json.dumps(entry, ensure_ascii=False)}" for name, entry in entries)
    return "{\n" + ",\n".join(lines) + "\n}\n"


def reduce(source, target, largest=LARGEST):
    """Write a picture with 256 colours, as wide as the largest size of a file lets it be, and with its title."""
    from PIL import Image, PngImagePlugin

    about = PngImagePlugin.PngInfo()
    with Image.open(source) as opened:
        picture = opened.convert("RGB")
        about.add_itxt("Title", title_of(opened))
    for width in WIDTHS:
        size = (min(width, picture.width), round(picture.height * min(1.0, width / picture.width)))
        # Of Pillow's methods this one alone leaves lines in their colours where other colours fill more of the picture.
        method = {"method": Image.Quantize.MAXCOVERAGE, "dither": Image.Dither.NONE}
        few = picture.resize(size, Image.Resampling.LANCZOS).quantize(256, **method)
        with replaced_atomically(target) as temporary:
            few.save(temporary, format="PNG", optimize=True, pnginfo=about)
        if pathlib.Path(target).stat().st_size <= largest:
            return


def shown(docs):
    """Return the text of docs/gallery.md: every picture of the gallery and of the benchmarks once, with a caption.

    A picture's own title says what follows from it, the caption what is drawn: the headline of its case, or `CAPTIONS`.

    Parameters
    ----------
    docs : path
        Folder in which the page, ``gallery/`` and ``benchmarks/`` are.
    """
    parts = ["# Gallery", "Each picture links to its source. Its numbers lie beside it."]
    for name, pictures in PICTURES.items():
        parts += [f"## {PARTS[name]}"] if name in PARTS else []
        source = (ROOT / "cases" / f"{name}.py").read_text(encoding="utf-8")
        headline = source.partition("\n")[0].strip('".')
        for kept in pictures.values():
            parts += [f"[![cases/{name}.py](gallery/{kept})](../cases/{name}.py)", f"*{CAPTIONS.get(kept, headline)}.*"]
    parts += ["## Measurements"]
    for kept in sorted(path.name for path in pathlib.Path(docs, "benchmarks").glob("*.png")):
        parts += [f"[![benchmarks](benchmarks/{kept})](benchmarks.md)", f"*{CAPTIONS[kept]}.*"]
    return "\n\n".join(parts) + "\n"


def title_of(picture):
    """Return the title that an open picture holds; empty where it holds none."""
    return picture.info.get("Title", "")


def main() -> int:
    """Read the command line, run, print the times."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=pathlib.Path, default=ROOT / "docs" / "gallery", help="folder of the pictures")
    parser.add_argument("--results", type=pathlib.Path, default=ROOT / "results", help="folder of what the cases write")
    parser.add_argument("--only", choices=PICTURES, nargs="+", help="cases to run (all)")
    parser.add_argument(
        "--redraw", action="store_true", help="draw from the numbers in the gallery, where these suffice"
    )
    options = parser.parse_args()
    cases = DRAWN_FROM_NUMBERS if options.redraw else tuple(PICTURES)
    only = options.only or cases
    if not set(only) <= set(cases):
        parser.error(f"--redraw: got {' '.join(only)}, accepted: {', '.join(cases)}")
    seconds = run(options.out, options.results, {name: PICTURES[name] for name in only}, options.redraw)
    write_text(ROOT / "docs" / "gallery.md", shown(ROOT / "docs"))
    print(f"{len(seconds)} cases, {sum(seconds.values()):.0f} s: pictures in {options.out}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
