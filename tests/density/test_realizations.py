"""Ensembles of finite sums of harmonics as mixtures of white noises."""

import dataclasses
import json
import pathlib

import numpy as np
import pytest
from scipy.integrate import quad

from fpk_rocking import BandNoise, NoNoise, load_scene
from fpk_rocking.compare import compare
from fpk_rocking.density.realizations import gauss_quadrature, realized_diffusions, solve_realizations
from fpk_rocking.physics.noise.equivalence import equivalent_diffusion, realized_spread
from montecarlo import simulate

MAIN = load_scene(pathlib.Path(__file__).parents[2] / "cases" / "scenes" / "main.toml")


@pytest.mark.parametrize("band", [(0.0, 10.0), (1.0, 6.0)])
def test_realizations_have_the_bands_diffusion_on_average(band):
    """Mean and spread over 100,000 realizations, against quadrature; false alarm 6e-5 each, four in all.

    |F|² = [(1+e)² + (1-e)²ω²]/(1+ω²)² weighs a frequency, and a realization has the mean of N of them.
    """

    def weight(omega):
        return (2.25 + 0.25 * omega**2) / (1.0 + omega**2) ** 2

    first, second = (quad(lambda x, n=n: weight(x) ** n, *band)[0] / (band[1] - band[0]) for n in (1, 2))
    for harmonics in (10, 40):
        noise = BandNoise(0.04, band, harmonics)
        drawn = realized_diffusions(noise, 0.5, 100_000, seed=2)
        assert drawn.mean() == pytest.approx(equivalent_diffusion(noise), abs=4.0 * drawn.std() / np.sqrt(drawn.size))
        spread = np.sqrt((second / first**2 - 1.0) / harmonics)
        assert drawn.std() / drawn.mean() == pytest.approx(spread, rel=0.02)


def test_diffusions_that_realizations_stand_for_are_those_of_the_block():
    """Mean and spread of an exact block, far from those of a slender one; false alarm 6e-5 for the mean."""
    noise = BandNoise(0.04, (1.0, 6.0), 10)
    drawn = realized_diffusions(noise, 0.5, 100_000, 2, 1.0)
    error = drawn.std() / np.sqrt(drawn.size)
    assert drawn.mean() == pytest.approx(equivalent_diffusion(noise, 1.0), abs=4.0 * error)
    assert abs(drawn.mean() - equivalent_diffusion(noise)) > 20.0 * error
    assert drawn.std() / drawn.mean() == pytest.approx(realized_spread(noise, 0.5, 1.0), rel=0.02)


@pytest.mark.parametrize("count", [2, 3, 5])
def test_quadrature_has_the_moments_of_the_values(count):
    values = np.random.default_rng(3).gamma(3.0, 1.0, 1000)
    nodes, weights = gauss_quadrature(values, count)
    assert np.all(weights > 0.0)
    assert np.all((nodes > values.min()) & (nodes < values.max()))
    for power in range(2 * count):
        assert weights @ nodes**power == pytest.approx((values**power).mean(), rel=1e-9)


@pytest.fixture(scope="module")
def average():
    scene = dataclasses.replace(MAIN, noise=BandNoise(0.04, (0.0, 10.0), 30))
    return solve_realizations(scene, cycles=4, tol=1e-2, nodes=3)


def test_average_is_that_of_its_evolutions(average):
    parts = np.array([evolution.survival for evolution in average.evolutions])
    assert average.survival == pytest.approx(average.weights @ parts, abs=1e-15)
    assert parts[:, 4].max() > average.survival[4] > parts[:, 4].min()
    errors = [evolution.error_estimate for evolution in average.evolutions]
    assert min(errors) < average.error_estimate < max(errors)
    assert average.error_estimate == pytest.approx(np.average(errors, weights=average.weights), rel=1e-12)
    assert average.wall_s > max(evolution.wall_s for evolution in average.evolutions)
    lost = average.weights @ [evolution.lost[4] for evolution in average.evolutions]
    assert average.survival[4] + average.overturned[4].sum() + lost == pytest.approx(1.0, abs=1e-12)
    bins = average.bin_probabilities(4, np.linspace(-1.6, 1.6, 17), np.linspace(-4.0, 4.0, 17))
    assert bins.sum() == pytest.approx(average.survival[4], abs=1e-12)


def test_average_is_compared_with_paths(average):
    paths = simulate(average.scene, cycles=4, realizations=2000, seed=3)
    found = compare(paths, average)
    # 4.5 standard errors: a false alarm in 1e5, plus what the closure itself is off by within 4 cycles.
    assert np.all(np.abs(found.difference) < 4.5 * found.standard_error + 0.02)
    assert (found.error_estimate[1], found.wall_s[1]) == (average.error_estimate, average.wall_s)
    remarks = " ".join(found.remarks)
    assert "mixture of 3 white noises" in remarks
    assert "Few harmonics" not in remarks


@pytest.mark.parametrize(
    ("noise", "nodes", "message"),
    [
        (MAIN.white_equivalent().noise, 5, "noise: got"),
        (NoNoise(), 5, "noise: got"),
        (BandNoise(0.04, (0.0, 10.0), 1), 5, "two harmonics or more"),
        (MAIN.noise, 1, "nodes: got 1, accepted: a whole number from 2 to 12"),
        (MAIN.noise, 13, "nodes: got 13"),
    ],
)
def test_refuses_by_name(noise, nodes, message):
    with pytest.raises(ValueError, match=message):
        solve_realizations(dataclasses.replace(MAIN, noise=noise), cycles=1, nodes=nodes)


@pytest.mark.slow
def test_equivalence_study_divides_the_difference(case, tmp_path):
    """The case, coarse: parts sum to the whole; few harmonics stand longer, and so does the average over them.

    S(20) of N = 30 is .209 (100,000 realizations), .174 of the density: 4.7 standard errors, a false alarm of 1e-6.
    """
    module = case("equivalence")
    coarse = {"restitutions": (0.5,), "harmonics": (30, 1000), "diffusions": (0.0045, 0.0065, 0.015)}
    findings = module.run(tmp_path, noises=(((0.0, 10.0), 0.2), ((1.0, 6.0), 0.3)), realizations=3000, **coarse)
    assert json.loads((tmp_path / "equivalence.json").read_text(encoding="utf-8"))["budget"] == findings["budget"]
    assert (tmp_path / "equivalence.png").stat().st_size > 10_000
    (row, low), parts = findings["noises"], findings["budget"]
    divided = np.sum([parts[name] for name in ("finite N", "band", "discretization")], axis=0)
    assert divided == pytest.approx(parts["whole"], abs=1e-12)
    assert row["density"][:3] == pytest.approx([0.8627, 0.4696, 0.1739], abs=4e-3)
    assert row["averaged"][0][2] > row["density"][2] + 0.02
    assert row["sampled"][0][2] > row["density"][2]
    assert (low["cover"] < 0.2 < row["cover"], low["jump"] > 1.2 * low["diffusion"]) == (True, True)
    assert list(module.worst([[0.1, -0.3], [0.2, 0.1]])) == [-0.3, 0.2]
