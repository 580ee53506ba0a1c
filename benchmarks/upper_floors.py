"""A cabinet on an upper floor: its rate by the ground's intensity and by the floor's own, and which records look so.

RECORDS is a folder with the far-field set of FEMA P-695 (44 files .AT2, as PEER hands them out), MOTIONS an .npz of
measured motions as for shake_table.py. The repository holds no copy of either. Writes upper_floors.json in
docs/benchmarks; ten processor minutes:

    python benchmarks/upper_floors.py --records RECORDS --motions MOTIONS
"""

import argparse
import pathlib

import numpy as np
from report import table, write_section

from fpk_rocking import Record, Scene
from fpk_rocking.risk import Building, Hazard, critical_intensities, floors, response_spectrum
from fpk_rocking.risk.motions import NARROW, intensity_of
from fpk_rocking.risk.spectra import narrowness

G = 9.80665
CABINET, THIRD = Scene.from_block(0.6, 2.0, "0.3 g", "1.5 Hz"), Building(0.6, 0.05, 1.1)
PGA = Hazard([0.02, 0.05, 0.1, 0.2, 0.4, 0.8, 1.6], [9e-2, 2.5e-2, 8e-3, 2.1e-3, 4e-4, 4e-5, 2e-6])
SA = Hazard([0.01, 0.03, 0.1, 0.2, 0.4, 0.8, 1.6], [8e-2, 2e-2, 3.5e-3, 1e-3, 2e-4, 2.5e-5, 1.5e-6])


def narrow(records):
    """Number of records, largest narrowness, and share above the bound, of each of some sets by name."""
    found = {name: np.array(list(map(narrowness, motions))) for name, motions in records.items()}
    return {name: (len(values), values.max(), (values > NARROW).mean()) for name, values in found.items()}


def rate(jumps, own, hazard):
    """Annual rate of motions whose scales of overturning are `jumps` (m, k), of intensities `own` (m,) at scale 1."""
    signs = 1.0 - 2.0 * (np.arange(jumps.shape[1]) % 2)
    return np.nansum(signs * hazard(jumps * np.asarray(own)[:, None]), axis=1).mean()


def scales(motions):
    """Scales at which outcomes of the cabinet change, (m, k)."""
    scenes = [Scene.from_block(0.6, 2.0, record=motion) for motion in motions]
    return critical_intensities(scenes, measure="scale").jumps


def finer_samples(ground):
    """Largest change of the critical scales, relative, if the floor has eight times as many samples."""
    few, usual = [THIRD.floor_motion(motion) for motion in ground], floors.PER_PERIOD
    floors.PER_PERIOD = 8 * usual
    many = [THIRD.floor_motion(motion) for motion in ground]
    floors.PER_PERIOD = usual
    ratio = [np.log(scales(motions)[:, 0]) for motions in (few, many)]
    return float(np.abs(np.diff(ratio, axis=0)).max())


def run(folder, motions):
    """What is measured, as a dict of plain values."""
    ground = [Record.from_file(path) for path in sorted(pathlib.Path(folder).glob("*.AT2"))]
    file, rng = np.load(motions), np.random.default_rng(56)
    table_motions = [Record(float(file["dt"]), 1e-4 * file[f"a{one}"].astype(float), "g") for one in file["ids"]]
    buildings = [
        Building(np.exp(rng.uniform(np.log(0.15), np.log(2.0))), rng.choice([0.02, 0.05]), rng.uniform(0.6, 1.4))
        for _ in range(5 * len(ground))
    ]
    made = [one.floor_motion(ground[number % len(ground)]) for number, one in enumerate(buildings)]
    sets = narrow({"far-field records": ground, "shake table": table_motions, "floors": made})
    ground = ground[::2]
    third = [THIRD.floor_motion(motion) for motion in ground]
    on, below = scales(third), scales(ground)
    scenes = [Scene.from_block(0.6, 2.0, record=motion) for motion in third]
    pga, pfa = ([intensity_of(scene, name) for scene in scenes] for name in ("PGA", "PFA"))
    spectral = [response_spectrum(motion, [1.0])[0] / G for motion in ground]
    of_floor = [response_spectrum(Record(one.interval, one.samples, one.units), [1.0])[0] / G for one in third]
    rates = {
        "PGA": (rate(on, pga, PGA), rate(on, pfa, PGA), rate(below, pga, PGA)),
        "Sa(1.0)": (rate(on, spectral, SA), rate(on, of_floor, SA), rate(below, spectral, SA)),
    }
    return {"sets": sets, "rates": rates, "finer": finer_samples(ground[:4])}


def body(values):
    """Text of the section."""
    rows = [
        [name, f"{right:.3e}", f"{wrong:.3e}", f"{right / wrong:.3g}", f"{below:.3e}"]
        for name, (right, wrong, below) in values["rates"].items()
    ]
    looks = [[name, count, f"{most:.3f}", f"{share:.3f}"] for name, (count, most, share) in values["sets"].items()]
    return (
        "A cabinet, 0.6 m × 2 m, on a floor of a building of one mode (0.6 s, 5 %, Γφ = 1.1), under 22 far-field "
        "records of FEMA P-695: annual rates by the intensity of the ground, and by that of the floor against the same "
        "hazard, which is wrong.\n\n"
        + table(["hazard", "right", "by the floor's own", "ratio", "at the ground"], rows)
        + f"\n\nEight times as many samples of the floor change critical scales by up to {values['finer']:.1e}, under "
        "four motions. Largest share of the energy within 18 % of one frequency, and share of records with more than "
        f"{NARROW} of it, which are told; floors are computed from the far-field records, periods .15 to 2 s, damping "
        ".02 or .05, Γφ .6 to 1.4:\n\n" + table(["records", "number", "largest", "told"], looks)
    )


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--records", required=True)
    parser.add_argument("--motions", required=True)
    options = parser.parse_args()
    write_section("Upper floors", body(run(options.records, options.motions)), page=None)
