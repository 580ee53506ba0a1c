"""The one-cycle operator: dual, one with the solver's steps, and right where the answer is known."""

import contextlib
import copy
import dataclasses
import pathlib
import types

import numpy as np
import pytest
from scipy import stats

from fpk_rocking import CycleOperator, NoNoise, Start, WhiteNoise, load_scene
from fpk_rocking.density.space import reflected
from fpk_rocking.density.tuning import TUNING
from fpk_rocking.horizon import mesh_operator
from fpk_rocking.horizon.mesh_operator import bound_for_all_phases
from fpk_rocking.results.remarks import UNCHECKED
from fpk_rocking.scene import Block, Harmonic, Scene
from montecarlo import simulate, tally

MAIN = load_scene(pathlib.Path(__file__).parents[2] / "cases" / "scenes" / "main.toml")
REPORTED: list[tuple[int, int]] = []


@pytest.fixture(scope="module")
def operator():
    """Main scene from the coarsest resolutions on."""
    return CycleOperator(MAIN, tol=1e-2, progress=lambda done, total: REPORTED.append((done, total)))


@pytest.fixture(scope="module")
def elastic():
    """Impacts without loss, and a forcing that is even in time: the flow is its own mirror image backwards in time."""
    return CycleOperator(MAIN.white_equivalent().varied(block={"restitution": 1.0}, forcing={"phase": 0.0}), tol=1e-2)


@pytest.fixture(scope="module")
def estimate(operator):
    """From the scene's start, up to 40 cycles and far beyond."""
    return operator.estimate_survival([*range(41), 1000, 2000])


@pytest.fixture(scope="module")
def mean(operator):
    """Map of the mean time until overturning."""
    return operator.mean_cycles_map()


@pytest.fixture(scope="module")
def stepped(operator):
    """The coarser mesh's evolution from the scene's start over 80 cycles, step by step."""
    mesh = operator._coarse
    return mesh.propagator.propagate(operator.scene.period * np.arange(81))


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
        forward, backward = operator.matvec(first) @ second, first @ operator.rmatvec(second)
        assert forward == pytest.approx(backward, abs=1e-12 * np.linalg.norm(first) * np.linalg.norm(second))


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


def test_survival_by_modes_is_that_step_by_step(operator, stepped):
    """S(k) up to 80 cycles to 1e-6 of itself, on the coarser mesh; the modes take over after 20."""
    mesh, cycles = operator._coarse, np.arange(81)
    survival, left_out = mesh.survival(cycles, operator.scene.start)
    assert survival == pytest.approx(stepped.survival, rel=1e-6)
    assert left_out[:20].max() == 0.0 < left_out[21:].max()
    assert np.all(left_out <= 1e-6 * survival)


def test_leaks_are_those_of_late_cycles_to_either_side(operator, stepped):
    """The start is forgotten by .78 a cycle, so that 1e-8 of it is left of 80 cycles; the sides differ by 4 %."""
    leaked = np.diff(stepped.outflow, axis=0) / stepped.survival[:-1, None]
    left, right, lost = operator._coarse.leaks
    assert [left, right, lost] == pytest.approx(leaked[-1], rel=1e-7, abs=1e-12)
    assert right > 1.03 * left
    assert np.array_equal(operator.leakage, operator._fine.leaks[:2])


def test_forgetting_cycles_are_the_time_in_which_the_start_is_forgotten(operator, stepped):
    """Its distance from the density that keeps its shape falls by a factor e in `forgetting_cycles`; two meshes."""
    space, distances = operator._coarse.space, []
    for density in stepped.coefficients[10:30]:
        shape = density / space.masses(density).sum()
        distances.append(space.absolute_mass(shape - operator._coarse.quasi_stationary))
    cycles = -1.0 / np.polyfit(np.arange(20), np.log(distances), 1)[0]
    assert operator.forgetting_cycles == pytest.approx(cycles, rel=0.02)


def test_survival_takes_numbers_of_cycles_in_any_order(operator, estimate):
    assert np.array_equal(operator.survival([[9, 3], [7, 7]]), estimate.survival[[[9, 3], [7, 7]]])
    assert operator.survival(7) == estimate.survival[7]


def test_survival_is_that_of_an_independent_program(estimate, reference):
    """Within the estimate, the program's own 3e-4 and 4.5 standard errors of its paths; false alarm 3e-4 in all."""
    truth, paths = (reference("main_white")[name] for name in ("survival", "paths"))
    error, sampling = estimate.error_estimate[:41], 4.5 * np.sqrt(truth * (1.0 - truth) / paths) + 3e-4
    assert np.all(np.abs(estimate.survival[:41] - truth) <= error + sampling)
    assert error.max() < 2e-3


def test_the_error_of_survival_covers_both_of_its_reasons(operator, estimate):
    """The difference of two meshes, and what the error of the rate makes of it; here that error is set."""
    mesh, operator = operator._coarse, copy.copy(operator)
    rough, _ = mesh.survival(estimate.cycles, operator.scene.start)
    meshes = np.abs(estimate.survival - rough)
    ruled = []
    for error in (1e-9, 0.05):
        operator.escape_error = error
        rate = estimate.survival * (1.0 - np.exp(-estimate.cycles * operator.escape_rate * error))
        estimated = operator.estimate_survival(estimate.cycles).error_estimate
        assert np.all(estimated >= np.maximum(meshes, rate) * (1.0 - 1e-9))
        ruled.append(((meshes > 1.5 * rate).any(), (rate > 1.5 * meshes).any()))
    assert ruled[0][0]
    assert ruled[1][1]


def test_a_map_has_the_forward_value_at_rest_and_at_the_scene_s_own_start(operator):
    """Beside them it is the adjoint's, which differs more at rest: no mesh resolves how noise sets a block off."""
    moving = Start(0.3, 0.4)
    shifted = copy.copy(operator)  # the operator knows its start, and does not depend on it
    shifted.scene, shifted._white = (scene.varied(start=moving) for scene in (operator.scene, operator._white))
    passage = [operator.survival_map(cycles)(0.0, 0.0) for cycles in (3, 4)]
    assert passage == pytest.approx(operator.survival([3, 4]), rel=1e-12)
    assert operator.first_passage_map(4)(0.0, 0.0) == pytest.approx(passage[0] - passage[1], rel=1e-9)
    chances = shifted.survival_map(4)
    assert chances([0.0, 0.3], [0.0, 0.4])[1] == pytest.approx(shifted.survival([4])[0], rel=1e-12)
    assert chances(0.0, 0.0) == pytest.approx(passage[1], abs=2e-3)
    assert chances(0.3, 0.4) == pytest.approx(chances(0.3 + 1e-9, 0.4), abs=5e-3)
    assert np.isnan(chances([np.nan, 0.3, 0.3], [0.4, np.nan, 0.4])).tolist() == [True, True, False]


def test_the_error_of_a_map_is_its_difference_from_the_coarser_mesh(operator):
    """L1 over the integral, by values on a grid of 300 x 600 points, which is good to some percent."""
    mesh, chances = operator._coarse, operator.survival_map(4)
    coarse = mesh.coefficients(mesh.backward_powers().after(8))
    angle, velocity = (
        line[0] + (line[-1] - line[0]) * (np.arange(count) + 0.5) / count
        for line, count in zip(chances.mesh_lines, (300, 600), strict=True)
    )
    fine, rough = chances(angle[:, None], velocity), mesh.space.evaluate(coarse, angle[:, None], velocity)
    # The integral of the absolute value within a cell is bounded, not computed, where it changes sign.
    assert 0.8 < np.abs(fine - rough).mean() / fine.mean() / chances.error_estimate < 1.2


def test_long_horizon_decays_at_the_escape_rate(operator, estimate):
    assert np.log(estimate.survival[-2] / estimate.survival[-1]) == pytest.approx(1000 * operator.escape_rate, rel=1e-9)


def test_quasi_stationary_density_keeps_its_shape(operator):
    """A cycle leaves it e^-rate of itself, and loses what `leakage` says."""
    space, density = operator.space, operator.quasi_stationary
    after = operator.density(operator.matvec(operator.vector(density.coefficients)))
    kept = np.exp(-operator.escape_rate)
    assert density.moment(0, 0) == pytest.approx(1.0, abs=1e-12)
    assert space.absolute_mass(after.coefficients - kept * density.coefficients) < 1e-9
    assert operator.leakage.sum() + operator.truncated == pytest.approx(1.0 - kept, rel=1e-10)
    assert abs(operator.eigenvalues[0] - kept) < 1e-9
    assert operator.residual == operator.residuals.max() < 1e-8
    assert np.ptp(operator.residuals) > 0.0


def test_right_and_left_modes_are_biorthogonal(operator):
    """Of two iterations from different starts: the same eigenvalues, and orthogonal where these differ."""
    values, right = operator.modes()
    others, left = operator.modes(adjoint=True)
    assert np.abs(values[:3] - others[:3]).max() < 1e-9
    products = np.array(
        [[inner(operator.space, left_mode, right_mode) for right_mode in right[:3]] for left_mode in left[:3]]
    )
    scaled = products / np.diag(products)
    assert np.abs(scaled - np.eye(3)).max() < 1e-7


def test_time_inside_is_dual_to_the_mass_step_by_step(operator, mean):
    """The time that any density spends inside within a cycle is the trapezoidal sum of its mass over the steps."""
    fine, space = operator._fine, operator.space
    density = np.random.default_rng(4).random(space.shape)
    masses, now = [space.masses(density).sum()], density
    for _ in range(2):
        for step in fine.propagator.steps:
            now, _ = step.apply(now)
            masses.append(space.masses(now).sum())
        now = reflected(now)
    spent = np.trapezoid(masses, dx=1.0 / fine.propagator.steps_per_cycle)
    assert masses[-1] < 0.9 * masses[0]
    first = fine.time_inside()
    assert inner(space, density, first + fine.backward(first)) == pytest.approx(spent, rel=1e-12)
    assert inner(space, density - now, mean.coefficients) == pytest.approx(spent, rel=1e-9)


def test_mean_time_is_the_sum_over_survival(operator, mean):
    """Between the sums over the ends and over the begins of all half cycles, from anywhere and from the attractor."""
    powers, unity, kept = operator._fine.backward_powers(), operator._fine.one, np.exp(-0.5 * operator.escape_rate)
    standing = [powers.after(k) @ operator.vector(unity) for k in range(60)]
    begins = 0.5 * (sum(standing) + standing[-1] * kept / (1.0 - kept))
    assert begins - 0.5 * standing[0] < mean.integral < begins
    on_attractor = inner(operator.space, operator.quasi_stationary.coefficients, mean.coefficients)
    assert 0.5 * kept / (1.0 - kept) < on_attractor < 0.5 / (1.0 - kept)
    assert operator.mean_cycles == pytest.approx(1.0 / (1.0 - kept**2), rel=1e-12)


def test_first_passage_map_is_the_loss_of_survival(operator):
    loss = operator.survival_map(2).coefficients - operator.survival_map(3).coefficients
    assert np.abs(operator.first_passage_map(3).coefficients - loss).max() < 1e-13


def test_half_a_turn_of_the_phase_turns_the_map(operator):
    """(x, v, Psi) -> (-x, -v, Psi + pi)."""
    there, here = operator.survival_map(2, phase=MAIN.forcing.phase + np.pi), operator.survival_map(2)
    assert np.abs(reflected(there.coefficients) - here.coefficients).max() < 1e-10


@pytest.mark.slow
def test_elastic_impacts_left_modes_mirror_right_ones(elastic):
    """With e = 1 and even forcing the adjoint is the map itself, velocities turned back (derived in docs/theory).

    Of the mesh's error alone: on three meshes, each 1.4 times as fine, the modes differ by .117, .040 and .021 in L1.
    """
    space = elastic.space
    (_, right), (_, left) = elastic.modes(), elastic.modes(adjoint=True)
    mirrored = turned_back(left[0])
    first, second = (density / space.masses(density).sum() for density in (right[0], mirrored))
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


@pytest.mark.parametrize(("restitution", "amplitude", "frequency"), [(0.2, 4.6, 2.7), (0.3, 1.5, 2.0)])
def test_no_start_above_the_bound_for_all_phases_stands_for_a_cycle(restitution, amplitude, frequency):
    """Of 4,000 starts at each of 16 phases, inward at speeds around the bound and below; some stand at .6 of it."""
    fastest, rng = 0.0, np.random.default_rng(6)
    for k, phase in enumerate(rng.uniform(0.0, 2.0 * np.pi, 16)):
        start = Start(1.5, -20.0, ((1e-6, 0.0), (0.0, 100.0)))
        scene = Scene(Block(restitution), Harmonic(amplitude, frequency, phase), WhiteNoise(1e-4), start)
        ensemble = simulate(scene, cycles=1, realizations=4000, seed=k)
        fastest = max(fastest, -ensemble.velocity[np.isfinite(ensemble.angle[:, 1]), 0].min())
    assert 0.6 * bound_for_all_phases(scene) < fastest < bound_for_all_phases(scene)


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
    monkeypatch.setattr(mesh_operator, "TUNING", TUNING._replace(finer_operator=1e6))
    with pytest.warns(RuntimeWarning, match="not within the tolerance: estimated error .* in the escape rate"):
        operator = CycleOperator(MAIN.varied(noise=WhiteNoise(3e-3), forcing={"amplitude": 3.0}), tol=1e-2)
    assert np.e * 1e-2 < operator.escape_error < 1.0


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"forcing": {"amplitude": 15.0}}, "not every block overturns within a cycle"),
        pytest.param(
            {"forcing": {"amplitude": 2.0}, "noise": WhiteNoise(4e-4)},
            "blocks overturn too rarely",
            marks=pytest.mark.slow,
        ),
        ({"noise": NoNoise()}, "^noise"),
        ({"block": {"restitution": 0.1}}, "^block.restitution"),
    ],
)
def test_trivial_scenes_are_refused_by_name(changes, message):
    with pytest.raises(ValueError, match=message):
        CycleOperator(MAIN.white_equivalent().varied(**changes), tol=1e-2)


def test_a_rate_that_is_not_above_its_error_is_refused():
    for error in (0.99, 1.01):
        fine = types.SimpleNamespace(negative_mass=0.0, rate=1e-6)
        refused = pytest.raises(ValueError, match="overturn too rarely") if error > 1.0 else contextlib.nullcontext()
        with refused:
            mesh_operator.judge(types.SimpleNamespace(solutions=[fine], error=error, bins_error=0.0), 1.0)


def test_each_mesh_is_reported(operator):
    assert [(done, max(done, 3)) for done in range(1, len(operator.refinement) + 1)] == REPORTED


def test_bad_arguments_are_named(operator):
    for error, name, call in (
        (TypeError, "scene", lambda: CycleOperator("main.toml")),
        (ValueError, "tol", lambda: CycleOperator(MAIN, tol=1e-6)),
        (TypeError, "tol", lambda: CycleOperator(MAIN, tol="fine")),
        (TypeError, "progress", lambda: CycleOperator(MAIN, progress=True)),
        (ValueError, "cycles", lambda: operator.survival([10, -1])),
        (TypeError, "cycles", lambda: operator.survival([10, 2.5])),
        (ValueError, "cycles", lambda: operator.survival_map(-1)),
        (TypeError, "cycles", lambda: operator.survival_map("ten")),
        (ValueError, "cycle", lambda: operator.first_passage_map(0)),
        (ValueError, "phase", lambda: operator.survival_map(1, phase=np.nan)),
        (ValueError, "coefficients", lambda: operator.vector(np.ones(5))),
    ):
        with pytest.raises(error, match=f"^{name}: got"):
            call()


def test_it_shows_itself_with_a_verdict(operator, mean):
    assert repr(operator).startswith(f"<CycleOperator: escape rate {operator.escape_rate:.4g} per cycle")
    assert operator.trust.verdict == "caution"
    assert operator.trust.reasons == (UNCHECKED,)
    assert len(operator._repr_html_()) < 150_000
    assert operator.table()["modulus"][0] == pytest.approx(np.exp(-operator.escape_rate), rel=1e-9)
    variables, places = operator.variables, operator.coordinates
    dims, bins = variables["bin_probability"]
    assert bins.shape == tuple(places[name][1].size for name in dims)
    assert bins.sum() == pytest.approx(1.0, abs=2e-3)
    assert repr(mean).startswith(f"<PlaneMap: integral {mean.integral:.4g} on ")
    assert len(mean.plot().axes) == 2
