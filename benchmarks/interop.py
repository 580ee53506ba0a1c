"""Fragility curves as OpenQuake and pelicun read them, against our own: run by `make interop`.

Curves with and without a lognormal fit are written, loaded by the real packages and evaluated at 200 intensities.
"""

import dataclasses
import importlib.metadata
import pathlib
import sys
import tempfile

import numpy as np
import pandas as pd

from fpk_rocking.risk import IntensityCurve, to_nrml, to_pelicun
from fpk_rocking.studies.lognormal import LognormalFit

TOLERANCE = 1e-6
GRID = np.geomspace(0.11, 2.9, 200)


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


def main():
    """Compare; return 1 where a difference is beyond the tolerance."""
    worst = 0.0
    with tempfile.TemporaryDirectory() as folder:
        for curve in curves():
            for name, write, read in (("openquake", to_nrml, by_openquake), ("pelicun", to_pelicun, by_pelicun)):
                file = pathlib.Path(folder) / f"{name}.{'xml' if name == 'openquake' else 'csv'}"
                write(file, [curve] if name == "openquake" else curve, "RACK")
                off = float(np.abs(read(file, curve) - expected(curve)).max())
                worst = max(worst, off)
                package = "openquake.engine" if name == "openquake" else name
                kind = "lognormal" if curve.fitted else "points"
                print(
                    f"{package} {importlib.metadata.version(package)}, {curve.measure}, {kind}: "
                    f"largest difference {off:.1e}"
                )
    return 0 if worst <= TOLERANCE else 1


if __name__ == "__main__":
    sys.exit(main())
