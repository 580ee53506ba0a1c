#!/usr/bin/env bash
# pelicun: a demand "without a direction" counts 1.2 times.
#
# One would guess: where only one direction of a floor acceleration is given, a component of Demand-Directional 0 meets
# that acceleration. At the median of its fragility half of the sample is then damaged.
# What happens: pelicun takes the largest of the directions times 1.2 (FEMA P-58's factor for two horizontal
# components), also where there is one direction alone. With a dispersion of .4 the share is Phi(ln(1.2)/.4) = .676.
# Demand-Directional 1 takes the demand as it is.
# Seen with pelicun 3.10.0.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check pelicun==3.10.0 numpy==1.26.4 pandas==2.3.3 'setuptools<81'
cd "$folder"
"$folder/venv/bin/python" - <<'PYTHON'
import importlib.metadata
import math
import statistics
import warnings

import numpy as np
import pandas as pd
from pelicun import assessment

warnings.simplefilter("ignore")
COUNT, MEDIAN, DISPERSION = 40_000, 0.5, 0.4


def damaged(directional):
    """Share of components that is damaged by a peak floor acceleration of MEDIAN, in g."""
    own = assessment.Assessment({"PrintLog": False, "Seed": 1})
    own.stories = 1
    demand = pd.DataFrame({"PFA-0-1": ["g", *[str(MEDIAN)] * COUNT]}, index=["Units", *map(str, range(COUNT))])
    own.demand.load_sample(demand)
    place = {"Units": ["ea"], "Location": ["1"], "Direction": ["1"], "Theta_0": ["1"], "Blocks": ["1"]}
    own.asset.load_cmp_model({"marginals": pd.DataFrame(place, index=["BOX"])})
    own.asset.generate_cmp_sample(COUNT)
    columns = {
        ("Incomplete", ""): 0,
        ("Demand", "Type"): "Peak Floor Acceleration",
        ("Demand", "Unit"): "g",
        ("Demand", "Offset"): 0,
        ("Demand", "Directional"): directional,
        ("LS1", "Family"): "lognormal",
        ("LS1", "Theta_0"): MEDIAN,
        ("LS1", "Theta_1"): DISPERSION,
    }
    table = pd.DataFrame([columns.values()], index=["BOX"], columns=pd.MultiIndex.from_tuples(columns))
    own.damage.load_model_parameters([table], {"BOX"})
    own.damage.calculate()
    sample = own.damage.ds_model.sample
    (column,) = (name for name in sample.columns if name[0] == "BOX" and name[-1] == "1")
    return float(sample[column].mean())


print("pelicun", importlib.metadata.version("pelicun"))
without, along = damaged(0), damaged(1)
expected = statistics.NormalDist().cdf(math.log(1.2) / DISPERSION)
print(f"damaged at the median: directional 0 {without:.3f} (1.2 times the demand: {expected:.3f}), directional 1 {along:.3f}")
assert abs(without - expected) < 0.01
assert abs(along - 0.5) < 0.01
PYTHON
