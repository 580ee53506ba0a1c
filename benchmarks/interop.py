"""Annual rates of exported curves by the calculations of OpenQuake and pelicun themselves: run by `make interop`.

Twenty curves, lognormal and of points, against PGV and PGA, are written, and both programs compute with the files.
OpenQuake's `classical_damage` takes a hazard curve and one asset; pelicun's damage calculation a sample of demands that
is spread over the hazard. Each rate is held against the one that a study states. Writes
docs/benchmarks/openquake_and_pelicun.json.
"""

import dataclasses
import importlib.metadata
import logging
import os
import pathlib
import sys
import tempfile
import warnings
from xml.etree import ElementTree as ET

import numpy as np
import pandas as pd
import report

from fpk_rocking.risk import Hazard, IntensityCurve, annual_frequency, to_nrml, to_pelicun
from fpk_rocking.risk.export import enough_levels, rate_by_levels, rising
from fpk_rocking.risk.lognormal import LognormalFit

TOLERANCE = {"openquake": 5e-3, "levels": 1e-3, "pelicun": 4.0}
"""Relative, of rates by levels 5 % apart and by the hazard's own three; of pelicun's in standard errors: 1e-3."""

HAZARD = Hazard([0.1, 0.5, 2.0], [5e-2, 3e-3, 2.5e-5])
DEMANDS = 400_000

JOB = """\
[general]
description = a year of one rack
calculation_mode = classical_damage
exposure_file = exposure.xml
contents_fragility_file = rack.xml
hazard_curves_csv = hazard.csv
continuous_fragility_discretization = 1000
investigation_time = 1
risk_investigation_time = 1
maximum_distance = 200
reference_vs30_type = measured
reference_vs30_value = 800
reference_depth_to_2pt5km_per_sec = 2.5
reference_depth_to_1pt0km_per_sec = 100
"""
EXPOSURE = """\
<?xml version="1.0" encoding="UTF-8"?>
<nrml xmlns="{namespace}">
  <exposureModel id="one" category="contents">
    <description>one rack</description>
    <conversions><costTypes><costType name="contents" type="per_asset" unit="EUR"/></costTypes></conversions>
    <assets>
      <asset id="a1" taxonomy="RACK" number="1">
        <location lon="9.2" lat="45.5"/>
        <costs><cost type="contents" value="1"/></costs>
      </asset>
    </assets>
  </exposureModel>
</nrml>
"""


def curves():
    """Yield a name and a curve, twenty in all."""
    wide, high, few = np.geomspace(0.1, 3.0, 12), np.geomspace(0.4, 3.0, 9), np.geomspace(0.1, 3.0, 5)
    laws = [(0.3, 0.3), (0.7, 0.4), (1.5, 0.6)]
    made = [("lognormal", wide, law) for law in laws] + [("points", wide, law) for law in laws]
    made += [("points from .4", high, (0.7, 0.4)), ("points from .4", high, (0.9, 0.5)), ("5 points", few, (0.7, 0.4))]
    made += [("points that fall", wide, (0.7, 0.4))]
    for measure in ("PGV", "PGA"):
        for kind, scale, law in made:
            fit = LognormalFit(*law, misfit=0.0)
            share = np.append(fit(scale[:-1]), 1.0)
            share[6:8] = share[7:5:-1] if "fall" in kind else share[6:8]
            limits = np.stack([share, share], axis=-1)
            curve = IntensityCurve("overturned", measure, scale, share, limits, fit, np.empty((0, 2)), 1)
            reason = LognormalFit(reason="left out here")
            yield (
                f"{kind}, {law[0]}, {law[1]}",
                curve if kind == "lognormal" else dataclasses.replace(curve, fit=reason),
            )


def rate_by_pelicun(folder, curve, seed):
    """Annual rate, and its standard error by sampling, by pelicun's damage calculation."""
    from pelicun import assessment, file_io

    to_pelicun(folder / "rack.csv", curve, "RACK")
    unit = {"PGA": "g", "PGV": "mps"}[curve.measure]
    # Most demands lie where the rate comes from and the outcome is open, for the least scatter.
    grid = np.geomspace(0.01, 30.0, 20_001)
    share = curve(grid[1:])
    dense = -np.diff(HAZARD(grid)) * np.sqrt(share * (1.0 - share))
    dense = np.append(0.0, np.cumsum(dense + 0.05 * dense.mean()))
    edges = np.interp(np.linspace(0.0, dense[-1], DEMANDS + 1), dense, grid)
    own = assessment.Assessment({"PrintLog": False, "Seed": seed})
    own.stories = 1
    demand = np.append(unit, np.sqrt(edges[1:] * edges[:-1]).astype(str))
    names = ["Units", *map(str, range(DEMANDS))]
    own.demand.load_sample(pd.DataFrame({f"{curve.measure}-0-1": demand}, index=names))
    place = {"Units": ["ea"], "Location": ["0"], "Direction": ["1"], "Theta_0": ["1"], "Blocks": ["1"]}
    own.asset.load_cmp_model({"marginals": pd.DataFrame(place, index=["RACK"])})
    own.asset.generate_cmp_sample(DEMANDS)
    factors = own.unit_conversion_factors
    table = file_io.load_data(str(folder / "rack.csv"), reindex=False, unit_conversion_factors=factors)
    own.damage.load_model_parameters([table], {"RACK"})
    own.damage.calculate()
    damaged = own.damage.ds_model.sample["RACK", "0", "1", "0", "1"].to_numpy()
    weights = -np.diff(HAZARD(edges))
    share = curve(edges[1:])
    return float(weights @ damaged), float(np.sqrt(weights**2 @ (share * (1.0 - share))))


def rate_by_openquake(folder, curve, levels):
    """Annual rate of the damage state by OpenQuake's classical_damage, with the hazard at levels (n,)."""
    from openquake.calculators import base
    from openquake.commonlib import dbapi, logs
    from openquake.server.db import actions

    to_nrml(folder / "rack.xml", [curve], "RACK")
    namespace = ET.parse(folder / "rack.xml").getroot().tag[1:].partition("}")[0]
    (folder / "exposure.xml").write_text(EXPOSURE.format(namespace=namespace), encoding="utf-8")
    (folder / "job.ini").write_text(JOB, encoding="utf-8")
    rates, levels = HAZARD(levels), (100.0 if curve.measure == "PGV" else 1.0) * levels
    tree = f"source_model_tree_path=['b'], gsim_tree_path=['b'], investigation_time=1.0, imt='{curve.measure}'"
    lines = [
        "#" + "," * (len(levels) + 2) + f'"{tree}"',
        ",".join(["lon,lat,depth", *(f"poe-{level!r}" for level in levels.tolist())]),
        ",".join(["9.2,45.5,0", *map(repr, (-np.expm1(-rates)).tolist())]),
    ]
    (folder / "hazard.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    actions.upgrade_db(dbapi.db)
    with logs.init(str(folder / "job.ini"), log_level="error") as log:
        calculator = base.calculators(log.get_oqparam(), log.calc_id)
        calculator.run()
    (damage,) = calculator.datastore["damages-rlzs"][:].ravel().tolist()
    return -np.log1p(-np.ravel(damage)[-1])


def main():
    """Compare; return 1 where a difference is beyond its tolerance."""
    rows, apart, off = [], [], {name: [0.0] for name in TOLERANCE}
    logging.disable(logging.WARNING)
    warnings.simplefilter("ignore")
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        os.environ |= {"OQ_DISTRIBUTE": "no", "OQ_DATABASE": "127.0.0.1", "OQ_DATADIR": name}
        for kind, curve in curves():
            risk = annual_frequency(curve, HAZARD)
            stated = risk.exported_rate
            for_pelicun = stated if curve.fitted else annual_frequency(rising(curve), HAZARD).exported_rate
            dense = rate_by_openquake(folder, curve, enough_levels(risk))
            three = rate_by_openquake(folder, curve, HAZARD.intensity)
            sampled, error = rate_by_pelicun(folder, curve, seed=len(rows))
            off["openquake"].append(abs(dense / stated - 1.0))
            off["levels"].append(abs(three / rate_by_levels(curve, HAZARD.intensity, HAZARD.rate) - 1.0))
            off["pelicun"].append(abs(sampled - for_pelicun) / error)
            apart.append(abs(sampled / for_pelicun - 1.0))
            stated_text = f"{stated:.5g}" + f" ({for_pelicun:.5g} for pelicun)" * (for_pelicun != stated)
            shown = [f"{dense:.5g}", f"{three / stated:.3g}", f"{sampled:.5g} ± {error:.2g}"]
            rows.append([curve.measure, kind, stated_text, *shown])
            print(*rows[-1], sep=" | ", flush=True)
    versions = {package: importlib.metadata.version(package) for package in ("openquake.engine", "pelicun")}
    worst = {name: max(values) for name, values in off.items()}
    percent = {name: 100.0 * value for name, value in worst.items()}
    job = JOB.replace("\n", "\n    ").rstrip()
    head = ["measure", "curve", "stated", "OpenQuake", "from three levels, times that stated", "pelicun"]
    report.write_section(
        "OpenQuake and pelicun",
        f"""**Result.** Of {len(rows)} exported curves OpenQuake's `classical_damage` gives the stated annual rate to
{percent["openquake"]:.1g} %, with the hazard at levels 5 % apart, and pelicun's damage calculation to
{100.0 * max(apart):.1g} %, at most {worst["pelicun"]:.2g} standard errors of its sample. From the three levels of the
hazard alone OpenQuake gives up to {max(float(row[4]) for row in rows):.2g} times the stated rate, and the files say so
beforehand (to {percent["levels"]:.1g} %).

OpenQuake engine {versions["openquake.engine"]}, pelicun {versions["pelicun"]}. Annual rates, 1/year, of curves by
median and dispersion under [the tutorial's hazard curve](tutorials/fragility.md#the-study), in g or m/s. "Stated" is
`Risk.exported_rate`; points that fall count for pelicun each as the largest up to it. pelicun computes the damage of
one component of direction 1 under {DEMANDS:,} demands, weighted with the hazard; ±: standard error.

{report.table(head, rows)}

The `job.ini`; `rack.xml` is what `to_nrml` writes, the exposure has one asset of the taxonomy `RACK`, and `hazard.csv`
the probabilities of exceedance at its place:

    {job}
""",
        page=None,
    )
    return 0 if all(worst[name] <= limit for name, limit in TOLERANCE.items()) else 1


if __name__ == "__main__":
    sys.exit(main())
