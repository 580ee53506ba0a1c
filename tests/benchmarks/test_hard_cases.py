"""Cheap rows of the table of hard cases, its references, and its judgement, which has to be able to fail."""

import importlib
import pathlib
import sys
from types import SimpleNamespace

import numpy as np
import pytest

ROOT = pathlib.Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "benchmarks"))
hard_cases = importlib.import_module("hard_cases")
hard_rows = importlib.import_module("hard_rows")

ROWS = {row.name: row for row in hard_rows.rows()}
REFERENCES = hard_rows.load()


@pytest.mark.parametrize(
    "name", ["D = 0.05", "e = 0.9", pytest.param("start on the separatrix", marks=pytest.mark.slow)]
)
def test_cheap_rows_are_inside_their_tolerance(name):
    """As in the table but looser; right in everything, a row fails by chance with a probability below 1e-3."""
    finding = hard_cases.judged(ROWS[name], REFERENCES[name], tol=1e-2)
    assert finding.verdict.startswith("inside"), finding


@pytest.mark.parametrize(
    ("name", "parameter"), [("e = 0.1", "block.restitution"), ("e = 0", "block.restitution"), ("σ = 0", "noise")]
)
def test_what_has_no_density_is_refused_with_a_way_out(name, parameter):
    finding = hard_cases.judged(ROWS[name], None)
    assert finding.verdict == "refused"
    assert finding.remark.startswith(f"{parameter}: got ")
    assert "Monte Carlo" in finding.remark


def test_references_are_those_of_the_rows():
    assert REFERENCES.keys() == {row.name for row in ROWS.values() if row.paths}
    assert all(REFERENCES[name].is_of(row) for name, row in ROWS.items() if row.paths)
    assert hard_rows.REFERENCES.stat().st_size < 200_000


@pytest.mark.parametrize("name", sorted(REFERENCES))
def test_a_reference_is_consistent(name):
    """Blocks do not stand up again, and all that stand are in the bins, but for the tails in velocity."""
    reference = REFERENCES[name]
    assert reference.standing[0] <= reference.paths
    assert np.all(np.diff(reference.standing) <= 0)
    binned = reference.counts.sum(axis=(1, 2))
    standing = reference.standing[reference.binned]
    assert np.all(binned <= standing)
    assert np.all(binned >= 0.999 * standing - 1.0)


def test_the_main_scene_agrees_with_independent_paths(reference):
    """Against 10^7 paths of another program: 4.5 standard errors at ten cycles are a false alarm of 1e-4."""
    other = reference("main_white")["survival"]
    survival, noise = hard_cases.sampling(REFERENCES["main scene"])
    assert np.all(np.abs(survival - other[:11]) <= 4.5 * noise + 3e-4)


@pytest.fixture
def sampled():
    """A result that is the reference itself, so right in everything."""
    reference = REFERENCES["D = 0.05"]
    bins = dict(zip(reference.binned.tolist(), reference.counts / reference.paths, strict=True))
    return SimpleNamespace(
        tol=1e-3,
        survival=hard_cases.sampling(reference)[0],
        error_estimate=1e-3,
        truncated=np.zeros(11),
        bin_probabilities=lambda cycle, *_: bins[cycle],
    )


def faults(evolution):
    return hard_cases.faults(ROWS["D = 0.05"], evolution, REFERENCES["D = 0.05"])


def test_judgement_of_a_right_result(sampled):
    assert faults(sampled) == []


def test_judgement_of_wrong_survival(sampled):
    noise = hard_cases.sampling(REFERENCES["D = 0.05"])[1]
    sampled.survival = sampled.survival + 3.5 * noise + 0.9e-3
    assert faults(sampled) == []
    sampled.error_estimate = 1e-4
    assert faults(sampled) == ["estimate"]
    sampled.survival = sampled.survival + 2e-4
    assert faults(sampled) == ["survival", "estimate"]
    sampled.survival[3] = np.nan
    assert faults(sampled) == ["survival", "estimate"]


def test_judgement_of_lost_mass(sampled):
    sampled.truncated = np.linspace(0.0, 2e-3, 11)
    assert faults(sampled) == ["truncated"]


def test_judgement_of_wrong_bins(sampled):
    right = sampled.bin_probabilities
    sampled.bin_probabilities = lambda cycle, *_: np.roll(right(cycle), cycle == 10, axis=1)
    assert faults(sampled) == ["bins"]


def test_judgement_of_a_wrong_tail():
    """A tail that is lost 3 % too fast."""
    row, reference = ROWS["500 cycles"], REFERENCES["500 cycles"]
    survival = hard_cases.sampling(reference)[0]
    rate = np.log(survival[10] / survival[40]) / 30

    def long(factor):
        tail = survival[40] * np.exp(-factor * rate * np.arange(1, 461))
        bins = dict(zip(reference.binned.tolist(), reference.counts / reference.paths, strict=True))
        return SimpleNamespace(
            tol=1e-3,
            survival=np.concatenate([survival, tail]),
            error_estimate=1e-3,
            truncated=np.zeros(501),
            bin_probabilities=lambda cycle, *_: bins[cycle],
        )

    assert hard_cases.faults(row, long(1.0), reference) == []
    assert hard_cases.faults(row, long(1.03), reference) == ["tail"]
