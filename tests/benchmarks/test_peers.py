"""What `make peers` reads off solutions; the peers themselves are not needed."""

import importlib
import math
import pathlib
import sys

import numpy as np
import pytest
from scipy.special import ndtr

ROOT = pathlib.Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "benchmarks"))
problems = importlib.import_module("peers_problems")


def masses(lines):
    """Probabilities of a Gaussian between lines of the angle and of the velocity."""
    angle, velocity = (np.diff(ndtr((line - 0.2) / 0.3)) for line in lines)
    return np.outer(angle, velocity)


def test_bins_of_cells_are_of_fourth_order_and_keep_the_mass():
    sizes, errors = (32, 64, 128), []
    for size in sizes:
        lines = np.linspace(-1.5, 1.5, size + 1), np.linspace(-3.0, 3.0, size + 1)
        bins = problems.cell_bins(masses(lines), lines, problems.EDGES)
        assert bins.shape == (32, 64)
        assert bins.sum() == pytest.approx(masses(lines).sum(), rel=1e-13)
        edges = [np.clip(edge, line[0], line[-1]) for edge, line in zip(problems.EDGES, lines, strict=True)]
        errors.append(np.abs(bins - masses(edges)).sum())
    assert -np.polyfit(np.log(sizes), np.log(errors), 1)[0] > 3.85


def test_exponents_of_slow_impacts():
    """Known values, the critical restitution included; e = .5 has λ = 1."""
    assert problems.persistence_exponent(0.3) == pytest.approx(0.399, abs=5e-4)
    assert problems.persistence_exponent(0.5) == pytest.approx(1.0, abs=1e-12)
    assert problems.persistence_exponent(0.7) == pytest.approx(1.515, abs=5e-4)
    assert problems.persistence_exponent(1.001 * math.exp(-math.pi / math.sqrt(3.0))) < 0.04


@pytest.mark.parametrize("exponent", [0.4, 1.0, 1.5])
def test_fitted_exponent_finds_that_of_samples(exponent):
    """200,000 samples of w^(λ-1) below 1, of which those in [.1, 1) count: within 4 standard errors (6e-5)."""
    speeds = np.random.default_rng(3).uniform(size=200_000) ** (1.0 / exponent)
    inside = np.log(speeds[speeds >= 0.1])
    error = 1.0 / math.sqrt(inside.size * inside.var())
    assert abs(problems.fitted_exponent(speeds, 0.1, 1.0) - exponent) < 4.0 * error
