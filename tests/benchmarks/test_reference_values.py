"""The published reference values: scenes and file agree, and the solver keeps to the values."""

import collections
import importlib
import pathlib
import sys

import numpy as np
import pytest

from fpk_rocking import load_scene, solve_fpk
from montecarlo import tally

sys.path.insert(0, str(pathlib.Path(__file__).parents[2] / "benchmarks"))
reference_values = importlib.import_module("reference_values")
ROWS = reference_values.rows()
VALUES = collections.defaultdict(dict)
for _line in reference_values.load():
    VALUES[_line["scene"]].setdefault(_line["quantity"], []).append(_line)
CHANCES = ("survival", "overturned left", "overturned right")


def column(name, quantity, what):
    """Return a column of a scene and quantity, nan where it is left out."""
    return np.array([float(line[what] or "nan") for line in VALUES[name][quantity]])


@pytest.mark.parametrize("name", sorted(ROWS))
def test_the_file_is_of_the_scenes_and_its_two_methods_agree(name):
    """False alarms: below 1e-4 for each scene."""
    assert load_scene(reference_values.FOLDER / f"{name}.toml") == ROWS[name].scene
    assert set(VALUES[name]) == set(reference_values.QUANTITIES)
    chances = {what: column(name, what, "value") for what in CHANCES}
    assert sum(chances.values()) == pytest.approx(np.ones(5), abs=3e-7)
    for what in CHANCES:
        error, other = column(name, what, "standard error"), column(name, what, "second error")
        assert error.max() <= reference_values.LARGEST_ERROR
        sampled = reference_values.by_paths(ROWS[name].scene)
        allowed = 5.0 * np.hypot(error, other) if sampled else other + 5.0 * error
        assert (np.abs(chances[what] - column(name, what, "second value")) <= allowed + 2.5e-6).all()


@pytest.mark.parametrize(
    "name", ["paper-white", *(pytest.param(name, marks=pytest.mark.slow) for name in ("second-white", "pulse-white"))]
)
def test_the_density_keeps_to_the_values(name):
    """False alarms: below 1e-4 for each scene."""
    row = ROWS[name]
    density = solve_fpk(row.scene, tol=1e-3, **row.when)
    chances = np.column_stack([density.survival, density.overturned])[1:]
    for what, own in zip(CHANCES, chances.T, strict=True):
        error = density.error_estimate + 5.0 * column(name, what, "standard error")
        assert (np.abs(own - column(name, what, "value")) <= error).all()


@pytest.mark.parametrize(
    "name",
    [
        "exact-band",
        "exact-start",
        pytest.param("record-band", marks=pytest.mark.slow),
        pytest.param("exponential", marks=pytest.mark.slow),
        "kanai-tajimi",
    ],
)
def test_sampling_keeps_to_the_values(name):
    """Of 20,000 paths of another seed. False alarms: below 1e-3 for each scene."""
    row, size = ROWS[name], 20_000
    run = tally(row.scene, realizations=size, seed=77, **row.when)
    shares = np.column_stack([run.survival, run.overturned])[1:]
    for what, own in zip(CHANCES, shares.T, strict=True):
        value = column(name, what, "value")
        error = np.hypot(np.sqrt(value * (1.0 - value) / size), column(name, what, "standard error"))
        assert (np.abs(own - value) <= 4.5 * error + 3.0 / size).all()
