"""The one-cycle operator: dual, one with the solver's steps, and right where the answer is known."""

import dataclasses
import pathlib

import numpy as np
import pytest
from scipy import stats

from fpk_rocking import CycleOperator, NoNoise, Start, WhiteNoise, load_scene, solve_fpk
from fpk_rocking.density.run import turn
from fpk_rocking.horizon import ladder
from montecarlo import simulate, tally

SCENES = pathlib.Path(__file__).parents[1] / "cases" / "scenes"
MAIN = load_scene(SCENES / "main.toml")


@pytest.fixture(scope="module")
def operator():
    """Main scene on the coarsest ladder."""
    return CycleOperator(MAIN, tol=1e-2)


@pytest.fixture(scope="module")
def elastic():
    """Impacts without loss, and a forcing that is even in time: the flow is its own mirror image backwards in time."""
    return CycleOperator(MAIN.white_equivalent().varied(block={"restitution": 1.0}, forcing={"phase": 0.0}), tol=1e-2)


def inner(space, first, second):
    """Integral of the product of two functions."""
    return float(np.einsum("xvab,xvab,xv->", first, second, space.areas))


def turned_back(coefficients):
    """The function at (x, -v) in place of (x, v)."""
    return coefficients[:, ::-1] * (-1.0) ** np.arange(coefficients.shape[-1])


def escape_interval(standing, first, last):
    """99.9 % confidence limits of the escape rate from the blocks that stand after each cycle (Clopper and Pearson)."""
    count, exposure = standing[first] - standing[last], standing[first:last].sum()
    limits = stats.beta.ppf([5e-4, 1.0 - 5e-4], [count, count + 1], [exposure - count + 1, exposure - count])
    return -np.log1p(-limits)


def test_matvec_and_rmatvec_are_adjoint(operator):
    rng = np.random.default_rng(1)
    for _ in range(3):
        first, second = rng.normal(size=(2, operator.shape[0]))
        one, other = operator.matvec(first) @ second, first @ operator.rmatvec(second)
        assert one == pytest.approx(other, abs=1e-12 * np.linalg.norm(first) * np.linalg.norm(second))


def test_survival_map_is_dual_to_the_forward_run(operator):
    """Mass after k cycles of any density is its integral against the map, to 1e-12, by modes too."""
    space, rng = operator.space, np.random.default_rng(2)
    density = rng.random(space.shape)
    mass = inner(space, density, operator.survival_map(0).coefficients)
    assert mass == pytest.approx(space.masses(density).sum(), rel=1e-14)
    vector = operator.vector(density)
    for cycles in range(1, 6):
        vector = operator.matvec(vector)
        remaining = space.masses(operator.density(vector).coefficients).sum()
        assert inner(space, density, operator.survival_map(cycles).coefficients) == pytest.approx(
            remaining, abs=1e-12 * mass
        )


def test_survival_by_modes_is_that_step_by_step(operator):
    """S(k) up to 200 cycles to 1e-6 of itself, on the coarser mesh; it has fallen to 3e-9."""
    level, cycles = operator._coarse, np.arange(201)
    departure = operator._departure(level)
    stepped = level.leg.run.evolve(200, departure).inside
    survival, left_out = level.survival(departure, cycles)
    assert survival == pytest.approx(stepped, rel=1e-6)
    assert left_out[:20].max() == 0.0 < left_out[21:].max()
    assert np.all(left_out <= 1e-6 * survival)


def test_survival_takes_numbers_of_cycles_in_any_order(operator):
    ordered = operator.survival([3, 7, 9])
    assert np.array_equal(operator.survival([9, 3, 7]), ordered[[2, 0, 1]])
    assert operator.survival(7) == ordered[1]


def test_survival_agrees_with_the_density_solver(operator):
    """Within the sum of both estimates, which are of two solutions of one kind."""
    density = solve_fpk(MAIN, cycles=10, tol=1e-3)
    outlook = operator.outlook(range(11))
    assert np.all(np.abs(outlook.survival - density.survival) <= outlook.error_estimate + density.error_estimate)
    assert outlook.error_estimate.max() < 1e-2


def test_long_horizon_decays_at_the_escape_rate(operator):
    later = operator.survival([1000, 2000])
    assert np.log(later[0] / later[1]) == pytest.approx(1000 * operator.escape_rate, rel=1e-9)


def test_quasi_stationary_density_keeps_its_shape(operator):
    """A cycle leaves it e^-rate of itself, and loses what `leakage` says."""
    space, density = operator.space, operator.quasi_stationary
    after = operator.density(operator.matvec(operator.vector(density.coefficients)))
    kept = np.exp(-operator.escape_rate)
    assert density.moment(0, 0) == pytest.approx(1.0, abs=1e-12)
    assert space.absolute_mass(after.coefficients - kept * density.coefficients) < 1e-9
    assert operator.leakage.sum() + operator.lost == pytest.approx(1.0 - kept, rel=1e-10)
    assert abs(operator.eigenvalues[0] - kept) < 1e-9
    assert operator.residuals.max() < 1e-8


def test_right_and_left_modes_are_biorthogonal(operator):
    """Of two iterations from different starts: the same eigenvalues, and orthogonal where these differ."""
    values, right = operator.modes()
    others, left = operator.modes(adjoint=True)
    assert np.abs(values[:3] - others[:3]).max() < 1e-9
    products = np.array([[inner(operator.space, one, other) for other in right[:3]] for one in left[:3]])
    scaled = products / np.diag(products)
    assert np.abs(scaled - np.eye(3)).max() < 1e-7


def test_mean_time_is_the_sum_over_survival(operator):
    """A block that overturns at a rate: the mean from the quasi-stationary density is about 1/rate; sum by modes."""
    space, mean = operator.space, operator.mean_cycles_map()
    survived = sum(operator.survival_map(k).coefficients for k in range(3))
    assert mean.integral > space.masses(survived).sum() - 3 * 0.5 * space.areas.sum()
    on_attractor = inner(space, operator.quasi_stationary.coefficients, mean.coefficients)
    assert operator.mean_cycles - 1.0 < on_attractor < operator.mean_cycles
    after = operator.density(operator.rmatvec(operator.vector(mean.coefficients))).coefficients
    within = inner(space, operator.quasi_stationary.coefficients, mean.coefficients - after)
    assert within == pytest.approx(on_attractor * operator.leakage.sum(), rel=1e-8)


def test_first_passage_map_is_the_loss_of_survival(operator):
    loss = operator.survival_map(2).coefficients - operator.survival_map(3).coefficients
    assert np.abs(operator.first_passage_map(3).coefficients - loss).max() < 1e-13


def test_half_a_turn_of_the_phase_turns_the_map(operator):
    """(x, v, Psi) -> (-x, -v, Psi + pi)."""
    there, here = operator.survival_map(2, phase=MAIN.forcing.phase + np.pi), operator.survival_map(2)
    assert np.abs(turn(there.coefficients) - here.coefficients).max() < 1e-10


@pytest.mark.slow
def test_elastic_impacts_left_modes_mirror_right_ones(elastic):
    """With e = 1 and even forcing the adjoint is the map itself, velocities turned back (derived in docs/theory).

    Of the mesh's error alone: on three meshes, each 1.4 times as fine, the modes differ by .117, .040 and .021 in L1.
    """
    space = elastic.space
    (_, right), (_, left) = elastic.modes(), elastic.modes(adjoint=True)
    mirrored = turned_back(left[0])
    first, second = (one / space.masses(one).sum() for one in (right[0], mirrored))
    assert space.absolute_mass(first - second) < 0.06
    uniform = elastic.survival_map(0).coefficients
    spread = elastic.density(elastic.matvec(elastic.vector(uniform))).coefficients
    difference = turned_back(elastic.survival_map(1).coefficients) - spread
    assert space.absolute_mass(difference) < 0.08 * space.masses(spread).sum()


def test_survival_map_against_white_noise_paths(operator):
    """Five random starts and a fast one inward, 4,000 paths each, 99.9 % intervals: false alarms in 0.6 % of seeds."""
    chances = operator.survival_map(4)
    starts = np.random.default_rng(10).uniform([-1.2, -1.0], [1.2, 1.0], (5, 2))
    assert chances(-1.5, 2.5) > 0.1
    for k, (angle, velocity) in enumerate([*starts, (-1.5, 2.5)]):
        scene = dataclasses.replace(MAIN.white_equivalent(), start=Start(angle, velocity))
        ensemble = simulate(scene, cycles=4, realizations=4000, seed=k)
        low, high = ensemble.survival_interval(0.999)[4]
        assert low - 0.005 < chances(angle, velocity) < high + 0.005


def test_escape_rate_against_white_noise_paths(operator):
    """Of 20,000 paths, those that stand after 10 cycles: 99.9 % interval."""
    ensemble = simulate(MAIN.white_equivalent(), cycles=25, realizations=20_000, seed=3)
    low, high = escape_interval(ensemble.survivors, 10, 25)
    assert low < operator.escape_rate < high


@pytest.mark.slow
def test_survival_map_against_many_paths():
    """Twenty random starts that are not lost, 1e5 paths each, 99.9 % intervals: false alarms in 2 % of all seeds."""
    chances, kept = CycleOperator(MAIN, tol=1e-3).survival_map(10), 0
    starts = iter(np.random.default_rng(20).uniform([-1.5, -2.0], [1.5, 2.5], (1000, 2)))
    while kept < 20:
        angle, velocity = next(starts)
        if chances(angle, velocity) > 0.02:
            scene = dataclasses.replace(MAIN.white_equivalent(), start=Start(angle, velocity))
            low, high = simulate(scene, cycles=10, realizations=100_000, seed=kept).survival_interval(0.999)[10]
            assert low - 1e-3 < chances(angle, velocity) < high + 1e-3, (angle, velocity)
            kept += 1


@pytest.mark.slow
def test_escape_rate_against_a_million_paths():
    """From the twentieth cycle on the survivors of a million paths fall at the operator's rate: 99.9 % interval."""
    everywhere = {"angle_edges": [-2.0, 2.0], "velocity_edges": [-20.0, 20.0]}
    counts = tally(MAIN.white_equivalent(), cycles=40, realizations=10**6, seed=5, **everywhere)
    standing = np.rint(counts.survival * 10**6).astype(int)
    low, high = escape_interval(standing, 20, 40)
    assert low < CycleOperator(MAIN).escape_rate < high


@pytest.mark.slow
def test_too_little_memory_is_warned_of(monkeypatch):
    monkeypatch.setattr(ladder, "MEMORY", 1e6)
    with pytest.warns(RuntimeWarning, match="not within the tolerance: estimated error .* in the escape rate"):
        operator = CycleOperator(MAIN.varied(noise=WhiteNoise(3e-3), forcing={"amplitude": 3.0}), tol=1e-2)
    assert np.e * 1e-2 < operator.escape_error < 1.0


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"forcing": {"amplitude": 15.0}}, "not everything overturns within a cycle"),
        pytest.param(
            {"forcing": {"amplitude": 2.0}, "noise": WhiteNoise(4e-4)},
            "nothing overturns as far as one can see",
            marks=pytest.mark.slow,
        ),
        ({"noise": NoNoise()}, "^noise"),
        ({"block": {"restitution": 0.1}}, "^block.restitution"),
    ],
)
def test_trivial_scenes_are_refused_by_name(changes, message):
    with pytest.raises(ValueError, match=message):
        CycleOperator(MAIN.white_equivalent().varied(**changes), tol=1e-2)


def test_bad_arguments_are_named(operator):
    for error, name, call in (
        (TypeError, "scene", lambda: CycleOperator("main.toml")),
        (ValueError, "tol", lambda: CycleOperator(MAIN, tol=1e-6)),
        (TypeError, "tol", lambda: CycleOperator(MAIN, tol="fine")),
        (ValueError, "cycles", lambda: operator.survival([10, -1])),
        (TypeError, "cycles", lambda: operator.survival([10, 2.5])),
        (ValueError, "cycles", lambda: operator.survival_map(-1)),
        (TypeError, "cycles", lambda: operator.survival_map("ten")),
        (ValueError, "cycle", lambda: operator.first_passage_map(0)),
        (ValueError, "phase", lambda: operator.survival_map(1, phase=np.nan)),
    ):
        with pytest.raises(error, match=f"^{name}: got"):
            call()
