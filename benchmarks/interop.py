"""Fragility curves as OpenQuake and pelicun read them, and OpenQuake's own calculation: run by `make interop`.

Curves with and without a lognormal fit are written, loaded by the real packages and evaluated at 200 intensities.
OpenQuake then computes a year of damage of one asset from the same file and a hazard curve, which is held against
`annual_frequency`. Writes docs/benchmarks/openquake_and_pelicun.json.
"""

import dataclasses
import importlib.metadata
import os
import pathlib
import sys
import tempfile
from xml.etree import ElementTree as ET

import numpy as np
import pandas as pd
import report

from fpk_rocking.risk import Hazard, IntensityCurve, annual_frequency, to_nrml, to_pelicun
from fpk_rocking.risk.lognormal import LognormalFit

TOLERANCE = 1e-6
RATE_TOLERANCE = {"lognormal": 1e-3, "points": 0.03}
"""Relative."""

GRID = np.geomspace(0.11, 2.9, 200)
HAZARD = Hazard([0.1, 0.5, 2.0], [5e-2, 3e-3, 2.5e-5])
LEVELS = np.geomspace(0.05, 8.0, 400)

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
    """Yield a lognormal curve and one of points, against PGV and PGA."""
    scale = np.geomspace(0.1, 3.0, 12)
    for measure in ("PGV", "PGA"):
        fit = LognormalFit(0.7, 0.4, misfit=0.0)
        share = np.append(fit(scale[:-1]), 1.0)
        limits = np.stack([share, share], axis=-1)
        curve = IntensityCurve("overturned", measure, scale, share, limits, fit, np.empty((0, 2)), 1)
        yield curve
        yield dataclasses.replace(curve, fit=LognormalFit(reason="left out here"))


def by_openquake(file, curve):
    """Probabilities on the grid by OpenQuake's reader and its fragility functions."""
    from openquake.hazardlib import nrml
    from openquake.risklib import read_nrml  # its readers are known to nrml once it is imported

    (functions,) = read_nrml.get_fragility_model(nrml.read(str(file))[0], str(file)).values()
    (function,) = functions.build(["overturned"])
    return function((100.0 if curve.measure == "PGV" else 1.0) * GRID)


def by_pelicun(file, curve):  # noqa: ARG001  (as by_openquake)
    """Probabilities on the grid by the distribution that pelicun makes of a row of its table."""
    from pelicun import uq

    row = pd.read_csv(file).iloc[0]
    if row["LS1-Family"] == "lognormal":
        theta = np.array([float(row["LS1-Theta_0"]), float(row["LS1-Theta_1"])])
        variable = uq.LogNormalRandomVariable("x", theta=theta)
    else:
        theta = np.array([list(map(float, part.split(","))) for part in row["LS1-Theta_0"].split("|")]).T
        variable = uq.MultilinearCDFRandomVariable("x", theta=theta)
    return variable.cdf(GRID)


def expected(curve):
    """Our own probabilities; between points both packages go by straight lines in the intensity itself."""
    if curve.fitted:
        return curve(GRID)
    return np.interp(GRID, curve.intensity, curve.probability)


def rate_by_openquake(folder, curve):
    """Annual rate of the damage state by OpenQuake's classical_damage, from the files of a folder that are written."""
    from openquake.calculators import base
    from openquake.commonlib import dbapi, logs
    from openquake.server.db import actions

    to_nrml(folder / "rack.xml", [curve], "RACK")
    namespace = ET.parse(folder / "rack.xml").getroot().tag[1:].partition("}")[0]
    (folder / "exposure.xml").write_text(EXPOSURE.format(namespace=namespace), encoding="utf-8")
    (folder / "job.ini").write_text(JOB, encoding="utf-8")
    levels = (100.0 if curve.measure == "PGV" else 1.0) * LEVELS
    tree = f"source_model_tree_path=['b'], gsim_tree_path=['b'], investigation_time=1.0, imt='{curve.measure}'"
    lines = [
        "#" + "," * (len(levels) + 2) + f'"{tree}"',
        ",".join(["lon,lat,depth", *(f"poe-{level!r}" for level in levels.tolist())]),
        ",".join(["9.2,45.5,0", *map(repr, (-np.expm1(-HAZARD(LEVELS))).tolist())]),
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
    rows, off_rate = [], dict.fromkeys(RATE_TOLERANCE, 0.0)
    worst = 0.0
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        os.environ |= {"OQ_DISTRIBUTE": "no", "OQ_DATABASE": "127.0.0.1", "OQ_DATADIR": name}
        for curve in curves():
            kind = "lognormal" if curve.fitted else "points"
            off = {}
            for package, write, read in (("openquake", to_nrml, by_openquake), ("pelicun", to_pelicun, by_pelicun)):
                file = folder / f"{package}.{'xml' if package == 'openquake' else 'csv'}"
                write(file, [curve] if package == "openquake" else curve, "RACK")
                off[package] = float(np.abs(read(file, curve) - expected(curve)).max())
            rates = rate_by_openquake(folder, curve), annual_frequency(curve, HAZARD).rate
            worst = max(worst, *off.values())
            off_rate[kind] = max(off_rate[kind], abs(rates[0] / rates[1] - 1.0))
            shown = [f"{value:.1e}" for value in off.values()] + [f"{rate:.5g}" for rate in rates]
            rows.append([curve.measure, kind, *shown])
    versions = {package: importlib.metadata.version(package) for package in ("openquake.engine", "pelicun")}
    lognormal, points = (100.0 * off_rate[kind] for kind in ("lognormal", "points"))
    job = JOB.replace("\n", "\n    ").rstrip()
    report.write_section(
        "OpenQuake and pelicun",
        f"""**Result.** Both packages read the curves to {worst:.0e}. OpenQuake's `classical_damage` computes the annual
rate of `annual_frequency` to {lognormal:.1g} % where the curve is lognormal, to {points:.1g} % where it is points:
between them OpenQuake goes by straight lines in the intensity, `annual_frequency` in its logarithm.

OpenQuake engine {versions["openquake.engine"]}, pelicun {versions["pelicun"]}. A curve of median .7 and dispersion .4,
and its values at 12 intensities; largest difference of the probabilities at {len(GRID)} intensities; annual rates with
the hazard curve of [the tutorial](tutorials/fragility.md#the-study), in g or m/s.

{report.table(["measure", "curve", "OpenQuake reads", "pelicun reads", "rate by OpenQuake", "rate here"], rows)}

The `job.ini`; `rack.xml` is what `to_nrml` writes, the exposure has one asset of the taxonomy `RACK`, and `hazard.csv`
the probabilities of exceedance at its place:

    {job}
""",
        page=None,
    )
    return 0 if worst <= TOLERANCE and all(off_rate[kind] <= RATE_TOLERANCE[kind] for kind in off_rate) else 1


if __name__ == "__main__":
    sys.exit(main())
