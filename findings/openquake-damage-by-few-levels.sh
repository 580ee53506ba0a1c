#!/usr/bin/env bash
# OpenQuake: classical_damage takes a hazard curve at its levels alone.
#
# One would guess: with hazard levels .1, .5 and 2 g the calculation joins them, by lines or power laws, and the annual
# rate of damage is about that of the hazard curve itself.
# What happens: at each level counts half of what is exceeded between its neighbours, times the fragility there; nothing
# is joined, and nothing warns. For a power law and a lognormal fragility three levels give 8.5 times the rate that
# levels 5 % apart give, which is that of the integral.
# Seen with openquake.engine 3.26.2.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
pip() { "$folder/venv/bin/pip" --quiet --disable-pip-version-check "$@"; }
pip install --no-deps openquake.engine==3.26.2
pip install alpha_shapes==1.1.1 decorator==5.3.1 docutils==0.23 fiona==1.10.1 geopandas==1.2.0 h3==4.5.0 h5py==3.16.0 \
    matplotlib==3.11.2 numba==0.68.1 numpy==2.4.6 pandas==2.3.3 psutil==7.2.2 pyproj==3.7.2 pyzmq==27.3.0 \
    requests==2.34.2 scipy==1.15.3 shapely==2.2.0 toml==0.10.2
cd "$folder"
OQ_DISTRIBUTE=no OQ_DATABASE=127.0.0.1 OQ_DATADIR="$folder" "$folder/venv/bin/python" - <<'PYTHON'
import importlib.metadata
import logging
import pathlib
import warnings

import numpy as np
from openquake.calculators import base
from openquake.commonlib import dbapi, logs
from openquake.server.db import actions
from scipy.integrate import quad
from scipy.stats import norm

logging.disable(logging.WARNING)
warnings.simplefilter("ignore")
MEDIAN, DISPERSION, RATE, EXPONENT = 0.7, 0.4, 5e-4, 2.5
MEAN = MEDIAN * np.exp(DISPERSION**2 / 2)
NRML = '<?xml version="1.0"?><nrml xmlns="http://openquake.org/xmlns/nrml/0.5">{}</nrml>'
pathlib.Path("fragility.xml").write_text(
    NRML.format(
        '<fragilityModel id="f" assetCategory="contents" lossCategory="contents"><description>box</description>'
        '<limitStates>down</limitStates><fragilityFunction id="BOX" format="continuous" shape="logncdf">'
        '<imls imt="PGA" noDamageLimit="0.05" minIML="0.05" maxIML="5"/>'
        f'<params ls="down" mean="{MEAN}" stddev="{MEAN * np.sqrt(np.expm1(DISPERSION**2))}"/>'
        "</fragilityFunction></fragilityModel>"
    )
)
pathlib.Path("exposure.xml").write_text(
    NRML.format(
        '<exposureModel id="e" category="contents"><description>box</description><conversions><costTypes>'
        '<costType name="contents" type="per_asset" unit="EUR"/></costTypes></conversions><assets>\n'  # without a blank here it fails
        '<asset id="a" taxonomy="BOX" number="1"><location lon="10" lat="45"/>'
        '<costs><cost type="contents" value="1"/></costs></asset></assets></exposureModel>'
    )
)
pathlib.Path("job.ini").write_text("""[general]
description = one box
calculation_mode = classical_damage
exposure_file = exposure.xml
contents_fragility_file = fragility.xml
hazard_curves_csv = hazard.csv
continuous_fragility_discretization = 1000
investigation_time = 1
risk_investigation_time = 1
maximum_distance = 200
reference_vs30_type = measured
reference_vs30_value = 800
reference_depth_to_2pt5km_per_sec = 2.5
reference_depth_to_1pt0km_per_sec = 100
""")


def rate(levels):
    """Annual rate of damage that the calculation gives with the hazard at some levels, g."""
    probabilities = -np.expm1(-RATE * levels**-EXPONENT)
    comment = "source_model_tree_path=['b'], gsim_tree_path=['b'], investigation_time=1.0, imt='PGA'"
    lines = [
        "#" + "," * (len(levels) + 2) + f'"{comment}"',
        ",".join(["lon,lat,depth", *(f"poe-{level!r}" for level in levels.tolist())]),
        ",".join(["10,45,0", *map(repr, probabilities.tolist())]),
    ]
    pathlib.Path("hazard.csv").write_text("\n".join(lines) + "\n")
    actions.upgrade_db(dbapi.db)
    with logs.init("job.ini", log_level="error") as log:
        calculator = base.calculators(log.get_oqparam(), log.calc_id)
        calculator.run()
    (damage,) = calculator.datastore["damages-rlzs"][:].ravel().tolist()
    return -np.log1p(-np.ravel(damage)[-1])


def density(y):
    return EXPONENT * RATE * np.exp(-EXPONENT * y) * norm.cdf((y - np.log(MEDIAN)) / DISPERSION)


integral = quad(density, np.log(0.02), np.log(50.0), epsabs=0.0)[0]
three, many = rate(np.array([0.1, 0.5, 2.0])), rate(np.geomspace(0.05, 20.0, 124))
print("openquake.engine", importlib.metadata.version("openquake.engine"))
print(f"annual rate: integral {integral:.3e}, 124 levels {many:.3e}, 3 levels {three:.3e}, {three / integral:.2f} times")
assert abs(many / integral - 1.0) < 0.01
assert abs(three / integral - 8.54) < 0.1
PYTHON
