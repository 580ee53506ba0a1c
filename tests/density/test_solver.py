"""How `solve_fpk` holds itself to a tolerance: its estimate, its refinement, what it says when memory ends that."""

import dataclasses
import functools
import math
import pathlib
import types

import numpy as np
import pytest

from fpk_rocking import FilteredNoise, load_scene, solve_fpk
from fpk_rocking.density import propagator, refinement, resolution, solver
from fpk_rocking.density.propagator import PeriodicPropagator, Solution
from fpk_rocking.density.refinement import SOLUTIONS, safe_difference
from fpk_rocking.density.resolution import (
    COARSEST,
    INTERMEDIATE,
    RESOLUTIONS,
    USUAL,
    StateRange,
    explore,
    resolutions_for,
)
from fpk_rocking.density.space import Space, velocity_bound
from fpk_rocking.density.step.step import Step
from fpk_rocking.density.tuning import TUNING
from fpk_rocking.scene import Block, Harmonic, Pulse, Scene, Start, WhiteNoise

MAIN = load_scene(pathlib.Path(__file__).parents[2] / "cases" / "scenes" / "main.toml").white_equivalent()


def mesh_of(scene, fineness, cycles=10):
    """The mesh and steps that `solve_fpk` uses."""
    motion = explore(scene, scene.period * np.arange(cycles + 1))
    return fineness.adapted(scene, velocity_bound(scene, scene.noise.diffusion), motion)


@pytest.mark.parametrize(
    ("distances", "bins", "lost", "expected"),
    [
        ((1e-3, 4e-4), 1e-3, 0.0, 1.4 * 4e-4),  # the last distance rules
        ((1e-3, 2e-4), 1e-3, 0.0, 1.4 * 3e-4),  # small by chance: the one before tells
        ((1e-2, 1e-6), 1e-3, 0.0, 1.4 * 3e-3),  # however small the last one is
        ((2e-3, 1e-3, 2e-4), 1e-3, 0.0, 1.4 * 3e-4),  # it hardly falls: to .3 over two solutions
        ((1e-6, 1e-6), 1e-2, 0.0, 1e-4),  # survival says nothing, the bins do
        ((1e-6, 1e-6), 1e-6, -3e-3, 3e-3),  # what was lost is an error
    ],
)
def test_estimate_from_three_solutions_or_more(distances, bins, lost, expected):
    outflow = np.array([[0.0, 0.0, 0.0], [0.1, 0.2, lost]])
    space, rows = Space(np.linspace(-1.0, 1.0, 3), np.linspace(-1.0, 1.0, 3), 0), np.array([False, True])
    propagator = types.SimpleNamespace(space=space, memory=0.0)
    solution = Solution(propagator, np.ones(2), outflow, np.zeros((2, *space.shape)), None, rows)
    assert solution.error(safe_difference(distances), bins) == pytest.approx(expected, rel=1e-12)


def test_a_probability_below_0_is_an_error():
    space = Space(np.linspace(-1.0, 1.0, 3), np.linspace(-1.0, 1.0, 3), 0)
    propagator, rows = types.SimpleNamespace(space=space, memory=0.0), np.array([False, True])
    for survival, left, right in ((1.0, -2e-6, 2e-6), (1.0, 2e-6, -2e-6), (1.0 + 2e-6, 0.0, 0.0), (-2e-6, 0.5, 0.5)):
        outflow = np.array([[0.0, 0.0, 0.0], [left, right, 0.0]])
        survivals = np.array([1.0, survival])
        solution = Solution(propagator, survivals, outflow, np.zeros((2, *space.shape)), None, rows)
        assert solution.error(1e-9, 1e-9) == pytest.approx(2e-6, rel=1e-6)


def test_the_sides_count_where_survival_is_the_same():
    """All may overturn at every resolution, and to another side at each."""
    space = Space(np.linspace(-1.0, 1.0, 3), np.linspace(-1.0, 1.0, 3), 0)
    propagator, solutions, rows = types.SimpleNamespace(space=space, memory=0.0), [], np.array([False, True])
    for left in (0.60, 0.66, 0.64):
        outflow = np.array([[0.0, 0.0, 0.0], [left, 1.0 - left, 0.0]])
        survivals, density = np.array([1.0, 0.0]), np.zeros((2, *space.shape))
        edges = [np.linspace(-1.0, 1.0, 4)] * 2
        solutions.append(Solution(propagator, survivals, outflow, density, None, rows, edges=edges))
    assert refinement.estimate_errors(solutions, 0).error == pytest.approx(1.4 * 0.02)


@pytest.mark.parametrize(
    ("survival", "negative", "taken"),
    [
        ({1: 0.5, 2: 0.6, 3: 0.61, 4: 0.6101}, 0.0, [1, 2, 3, 4]),
        ({1: 0.5022, 2: 0.5, 3: 0.5}, 0.0, [1, 2, 3]),  # 1.4 times the difference is beyond the tolerance
        ({0: 0.507, 1: 0.5021, 2: 0.5}, 0.0, [1, 2, 0]),
        ({0: 0.7, 1: 0.501, 2: 0.5, 3: 0.5}, 0.0, [1, 2, 0, 3]),  # the coarsest is too far off to tell anything
        ({1: 0.5001, 2: 0.5, 3: 0.5}, 0.011, [1, 2, 3]),  # the verdict would be "caution"
    ],
)
def test_where_two_solutions_agree_the_third_is_a_coarser_one(survival, negative, taken):
    solved = []

    def solve(number, before):
        assert before is None or before.number == solved[-1] or solved[-1] == 0
        solved.append(number)
        compared = {"quantity": np.array([survival[number]]), "bins": np.zeros((1, 1)), "resolved": np.array([True])}
        return types.SimpleNamespace(number=number, error=max, negative_mass=negative, **compared)

    refined = refinement.refine(
        [1, 2, 3, 4], solve, lambda *_: True, lambda refined: refined.within(0.003, 0.1), coarser=[0]
    )
    assert solved == taken
    assert [solution.number for solution in refined.solutions] == sorted(taken)


@pytest.mark.parametrize(
    ("bins", "factor", "expected"),
    [
        ((0.1, 0.08), 0.6, 0.6 * 0.08),  # the last difference rules
        ((0.1, 0.03), 0.6, 0.4 * 0.1),  # it is small by chance: the one before tells
        ((0.1, 0.01), 0.6, 1.5 * 0.01),  # that one is of a solution too coarse to tell
        ((0.1, 0.08), 1.0, 0.08),  # of a kind whose errors have not been held against true ones
        ((0.02,), 0.6, 0.02),  # two solutions alone
    ],
)
def test_the_error_of_the_bins_by_both_differences(bins, factor, expected):
    def solution(distance):
        values = {"quantity": np.zeros(1), "bins": np.array([[distance]]), "resolved": np.array([True])}
        return types.SimpleNamespace(error=lambda *_: 0.0, negative_mass=0.0, **values)

    solutions = [*map(solution, bins), solution(0.0)]
    assert refinement.estimate_errors(solutions, 0, factor).bins_error == pytest.approx(expected, rel=1e-12)


def test_a_coarser_solution_serves_the_middle_tolerance_alone():
    names = [*RESOLUTIONS[:4], INTERMEDIATE, *RESOLUTIONS[4:]]
    coarsest, *later = resolutions_for(1e-3, SOLUTIONS, early=True)
    assert (coarsest, later[2:]) == (COARSEST, names[2:])
    assert [dataclasses.replace(one, patches=RESOLUTIONS[0].patches) for one in later[:2]] == names[:2]
    # A start-up that three solutions share would have an error that none of them tells.
    assert [one.patches for one in later[:3]] == [RESOLUTIONS[2].patches] * 3
    assert resolutions_for(1e-3, SOLUTIONS) == names
    for tol in (1e-2, 1e-4):
        assert resolutions_for(tol, SOLUTIONS, early=True) == resolutions_for(tol, SOLUTIONS)
    assert COARSEST.patches.reach < RESOLUTIONS[2].patches.reach


def test_filtered_noise_begins_coarser_as_each_solution_takes_three_times_as_long():
    first, moving = RESOLUTIONS[0], functools.partial(resolutions_for, filtered=True, early=True)
    # Of blocks that move the coarsest tells the error of the second, if two are enough.
    for tol in (1e-2, 1e-3):
        assert (moving(tol, SOLUTIONS - 1)[0], moving(tol, SOLUTIONS)[0]) == (first, COARSEST)
        resting = [resolutions_for(tol, before, filtered=True) for before in (SOLUTIONS - 1, SOLUTIONS)]
        assert resting == [list(RESOLUTIONS)] * 2
    assert [resolution.degree for resolution in moving(1e-4, SOLUTIONS - 1)[:3]] == [3, 3, 4]


def test_solutions_begin_coarser_where_most_blocks_stand(monkeypatch):
    """Half of the exploratory paths of the main scene overturn in ten cycles."""
    first = []

    def stop(meshes, *_):
        first.append(meshes[0].cells[0])
        raise StopIteration

    monkeypatch.setattr(solver, "refine", stop)
    for scene, number in ((Scene(Block(0.87), Harmonic(0.5, 9.0), WhiteNoise(0.001)), 0), (MAIN, 1)):
        with pytest.raises(StopIteration):
            solve_fpk(scene, cycles=10, tol=1e-3)
        assert first[-1] == mesh_of(scene, RESOLUTIONS[number]).cells[0]


def test_a_block_that_hardly_moves_takes_the_second_resolution_and_is_within_its_estimate(monkeypatch):
    """Against one of twice the cells and steps; of three solutions the first is the coarsest."""
    scene = Scene(Block(0.87), Harmonic(0.5, 9.0), WhiteNoise(0.001))
    kept, refine = [], refinement.refine
    monkeypatch.setattr(solver, "refine", lambda *args: kept.append(refine(*args)) or kept[-1])
    density = solve_fpk(scene, cycles=2, tol=1e-3)
    solutions = kept[0].solutions
    assert len(solutions) == SOLUTIONS
    assert density.settings["angle_cells"] == mesh_of(scene, RESOLUTIONS[1], 2).cells[0]
    run = PeriodicPropagator(scene, mesh_of(scene, RESOLUTIONS[3], 2), 1e-9)
    truth = run.propagate(scene.period * np.arange(3))
    truth.edges = solutions[-1].edges
    error = np.abs(solutions[-1].bins - truth.bins).sum(axis=1)[1:].max()
    assert 0.1 * density.bins_error_estimate < error < density.bins_error_estimate < math.sqrt(1e-3) / 3.0
    assert np.abs(density.survival - truth.survival).max() < density.error_estimate


def test_a_first_solution_is_set_up_in_fewer_parts_and_is_the_same(monkeypatch):
    counts, survivals, activate = [], [], Step.activate

    def counted(step, cells):
        counts[-1] += 1
        activate(step, cells)

    monkeypatch.setattr(Step, "activate", counted)
    for rings in (1, TUNING.first_rings):
        monkeypatch.setattr(propagator, "TUNING", TUNING._replace(first_rings=rings))
        counts.append(0)
        run = PeriodicPropagator(MAIN, mesh_of(MAIN, RESOLUTIONS[0], 2), 1e-9)
        survivals.append(run.propagate(MAIN.period * np.arange(3)).survival)
    assert counts[1] < counts[0]
    assert survivals[1] == pytest.approx(survivals[0], abs=1e-6)


@pytest.mark.parametrize(("filtered", "order"), [("low-pass", 1.0), ("kanai-tajimi", 0.5), ("exponential", 0.5)])
def test_the_error_at_rest_is_that_of_the_order_of_the_noise_by_either_difference(filtered, order):
    """Noise that has no derivative passes a level between two steps more often than smooth noise."""
    noise = FilteredNoise(filtered, 0.02, 6.0, None if filtered == "exponential" else 0.6)
    rows = np.array([False, True])
    for rests, part in (((0.3, 0.34, 0.36), 0.06 / (1.96**order - 1.0)), ((0.34, 0.34, 0.36), 0.02 / (1.4**order - 1))):
        densities = [np.array([0.0, rest]) for rest in rests]
        solutions = [Solution(None, np.ones(2), np.zeros((2, 3)), None, rest, rows) for rest in densities]
        assert solver._rest_error(solutions, noise) == pytest.approx(part)


def test_the_error_of_the_bins_is_the_largest_of_all_cycles(monkeypatch):
    """Where nearly all overturns it is that of the first cycle, however many follow."""
    scene = MAIN.varied(forcing={"amplitude": 6.0})
    monkeypatch.setattr(solver, "TUNING", TUNING._replace(finer_white=0.0))
    exploration = explore(scene, scene.period * np.arange(4))
    monkeypatch.setattr(solver, "explore", lambda *_: exploration)  # one mesh for both
    first, last = (solve_fpk(scene, cycles=cycles, tol=1e-2) for cycles in (1, 3))
    assert last.survival[3] < 0.1
    assert last.bins_error_estimate == pytest.approx(first.bins_error_estimate, rel=1e-6)


@pytest.fixture(scope="module")
def refined():
    """A density that begins at resolutions too coarse for its tolerance, and what is announced of the finer ones."""
    announced = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(solver, "announce", lambda *_: None)
        patch.setattr(solver, "announce_finer", lambda *arguments: announced.append(arguments))
        patch.setattr(resolution, "USUAL", {1e-3: 2})
        return solve_fpk(MAIN, cycles=1, tol=1e-3, bins_tol=5e-3), announced


def test_resolutions_are_refined_until_the_estimate_is_met(refined):
    """Where resolutions are too coarse a tolerance is met on a later one, and never by the first two alone."""
    density, _ = refined
    cells = [mesh_of(MAIN, fineness, 1).cells[0] for fineness in RESOLUTIONS]
    assert cells.index(density.settings["angle_cells"]) > 2
    assert density.error_estimate <= 1e-3
    assert density.bins_error_estimate <= 5e-3


def test_the_tolerance_of_the_bins_is_refused_by_name_or_left_out():
    for wrong in (0.0, -1.0, math.nan):
        with pytest.raises(ValueError, match=r"^bins_tol: got "):
            solve_fpk(MAIN, cycles=1, tol=1e-2, bins_tol=wrong)
    left_out, within = (solve_fpk(MAIN, cycles=2, tol=1e-2, bins_tol=most) for most in (math.inf, 5e-3))
    assert left_out.settings["angle_cells"] == mesh_of(MAIN, RESOLUTIONS[2], 2).cells[0]
    assert left_out.bins_error_estimate > 5e-3 >= within.bins_error_estimate


def test_a_tolerance_that_memory_does_not_allow_is_missed_with_a_warning(monkeypatch):
    monkeypatch.setattr(solver, "TUNING", TUNING._replace(finer_white=0.0))
    monkeypatch.setattr(resolution, "USUAL", {1e-4: 2})
    with pytest.warns(
        RuntimeWarning, match=r"not within the tolerance: estimated error .* in survival \(1.0e-04 wanted\)"
    ) as caught:
        density = solve_fpk(MAIN, cycles=2, tol=1e-4)
    assert caught[0].filename == __file__
    assert density.settings["angle_cells"] == mesh_of(MAIN, RESOLUTIONS[2], 2).cells[0]


@pytest.mark.parametrize(
    ("error", "bins", "names", "allowed"),
    [
        (0.2, 0.1, {}, "a larger tol, or"),
        (0.1, 0.4, {}, "a larger bins_tol, or"),
        (0.2, 0.4, {}, "a larger tol and bins_tol, or"),
        (0.2, 0.4, {"names": ("tol", "tol")}, "a larger tol, or"),
    ],
)
def test_the_warning_names_the_tolerance_that_is_missed(error, bins, names, allowed):
    refined = refinement.Refined([], error, bins, 0)
    with pytest.warns(RuntimeWarning, match=f"; allow {allowed} run$"):
        refinement.warn_beyond("survival", refined, 0.1, 0.3, "run", stacklevel=1, **names)


@pytest.mark.parametrize(
    ("now", "before", "left", "stagnated"),
    [
        (0.04, 0.04, 1, False),  # resolved
        (0.2, 0.4, 1, False),  # 0.2 / 4 next
        (0.2, 0.3, 1, True),
        (0.2, 0.3, 2, False),
        (0.2, 0.1, 3, True),  # it grows
        (0.13, 0.12, 4, False),  # it falls late
        (0.13, 0.0, 4, False),  # the solution before showed no density
        (0.0, 0.0, 4, False),
        (0.06, 0.1, 0, True),  # no finer one
    ],
)
def test_hope_ends_where_negative_mass_falls_too_slowly(now, before, left, stagnated):
    fine, coarse = (types.SimpleNamespace(negative_mass=mass) for mass in (now, before))
    assert solver._is_stagnated(refinement.Refined([coarse, coarse, coarse, fine], 0.0, 0.0, left)) is stagnated


def test_a_long_call_says_so_before_it_begins(monkeypatch, capsys):
    """Seconds of one processor grow with the cycles; the paths are those of a standard error below the tolerance."""
    times = MAIN.period * np.arange(11)
    mesh = mesh_of(MAIN, RESOLUTIONS[2])
    few, many = (solver.estimated_seconds(MAIN, mesh, MAIN.period * np.arange(cycles + 1)) for cycles in (10, 1000))
    assert 10.0 * few < many < 100.0 * few
    solver.announce(MAIN, [mesh], times, 1e-2)
    assert capsys.readouterr().err == ""
    monkeypatch.setattr(solver, "estimated_seconds", lambda *_: 26.0)
    solver.announce(MAIN, [mesh, mesh], times, 1e-2)
    said = capsys.readouterr().err
    assert "about 50 s of one processor" in said
    assert "10,000 sampled paths give a standard error of 0.005" in said


@pytest.mark.parametrize("tol", [1e-2, 1e-3, 1e-4])
def test_the_seconds_of_as_many_solutions_are_predicted_as_are_made(tol):
    """Two, and the coarser one that tells the error: it is the fastest, or else the last and finest."""
    first, second, third = solver.predicted_seconds(load_scene("main").white_equivalent(), tol=tol, cycles=4)
    assert 0.0 < first < second
    assert third < first or third > second


def test_a_long_finer_solution_says_so_before_it_begins(monkeypatch, capsys, refined):
    """By what the one before took; the first three are told of together."""
    monkeypatch.setattr(solver, "estimated_seconds", lambda _scene, mesh, _times: float(mesh))
    solver.announce_finer(MAIN, 2.0, 5.0, None, 7.9)
    assert capsys.readouterr().err == ""
    solver.announce_finer(MAIN, 2.0, 5.0, None, 16.1)
    assert capsys.readouterr().err == "density: the tolerance asks for a finer solution, about 40 s\n"
    density, announced = refined
    assert announced[-1][2].cells[0] == density.settings["angle_cells"]
    assert all(seconds > 0.0 for *_, seconds in announced)
    first = mesh_of(MAIN, RESOLUTIONS[2], 1).cells[0]
    assert announced[0][1].cells[0] == first


def test_a_mesh_goes_beyond_the_fastest_paths():
    """By a tenth; blocks that are bound to overturn may be faster than any bound of those that are not."""
    motion = explore(MAIN, MAIN.period * np.arange(3))._replace(fastest=50.0)
    pulse = MAIN.varied(forcing=Pulse("one-sine", 1.0, 2.0))
    ends = [
        solver._discretizations(scene, scene, motion, RESOLUTIONS[:1])[0].velocity_lines[-1] for scene in (MAIN, pulse)
    ]
    assert ends == pytest.approx([55.0, 55.0])


def test_default_tolerances_depend_on_whether_the_scene_repeats():
    usual = resolution.bins_tolerance(1e-3)
    assert solver._tolerances(MAIN, None, None) == (1e-3, usual, usual)
    once = types.SimpleNamespace(repeats=False)
    assert solver._tolerances(once, None, None) == (1e-2, math.inf, resolution.bins_tolerance(1e-2))
    assert solver._tolerances(once, 1e-3, 0.1) == (1e-3, 0.1, 0.1)
    assert solver._tolerances(once, 1e-3, math.inf) == (1e-3, math.inf, math.inf)


def test_what_three_solutions_do_not_resolve_is_tried_once_more():
    """A block under weak noise was refused at tol 1e-2 and solved at 1e-3, which begins one resolution further."""
    levels = [types.SimpleNamespace(negative_mass=mass) for mass in (0.3, 0.2, 0.2, 0.2)]
    assert not solver._is_stagnated(refinement.Refined(levels[:3], 0.0, 0.0, 3))
    assert solver._is_stagnated(refinement.Refined(levels, 0.0, 0.0, 2))


@pytest.mark.slow
def test_a_density_that_is_not_resolved_is_refused(monkeypatch):
    """Lifted off from rest under so weak noise that the density stays narrower than the cells."""
    monkeypatch.setattr(solver, "TUNING", TUNING._replace(finer_white=0.0))
    with pytest.raises(ValueError, match=r"scene: got a density .*negative mass .*diffusion 2e-05.*Monte"):
        solve_fpk(Scene(Block(0.9), Harmonic(1.41, 2.7, math.pi), WhiteNoise(2e-5)), cycles=2, tol=1e-2)


def test_a_gaussian_that_its_patch_does_not_resolve_is_refused():
    start = Start(0.3, 0.0, ((0.09, 0.089973), (0.089973, 0.09)))
    with pytest.raises(ValueError, match=r"start.covariance: got .*, accepted: a wider Gaussian"):
        solve_fpk(dataclasses.replace(MAIN, start=start), cycles=1, tol=1e-2)


def test_slow_blocks_take_more_steps():
    """As the root of the usual speed below 1, and where blocks rest no fewer than for rest."""

    def steps(scene, speed):
        return RESOLUTIONS[6].adapted(scene, 4.0, StateRange(1.2, speed, (-1.2, 1.2), (-1.8, 1.8), 2.0)).steps

    assert steps(MAIN, 1.8) == steps(MAIN, 1.0) == 40
    assert steps(MAIN, 0.25) == pytest.approx(80, abs=2)
    exact = dataclasses.replace(MAIN, block=Block(0.5, critical_angle=0.3))
    assert steps(exact, 1.8) == 40
    pulse = dataclasses.replace(exact, forcing=Pulse("one-sine", 4.6, 2.7))
    assert steps(pulse, 1.8) == steps(pulse, 0.25) == steps(dataclasses.replace(pulse, block=MAIN.block), 1.8)
    assert steps(pulse, 0.2) == steps(MAIN, 0.2) == pytest.approx(90, abs=2)


def test_a_short_cycle_has_the_steps_of_the_main_one():
    """The force changes as much in a cycle, however short that is."""
    motion, quick = StateRange(1.2, 1.8, (-1.2, 1.2), (-1.8, 1.8), 2.0), MAIN.varied(forcing={"frequency": 12.0})
    for fineness in RESOLUTIONS:
        assert fineness.adapted(quick, 4.0, motion).steps == fineness.adapted(MAIN, 4.0, motion).steps


def test_meshes_and_steps_follow_what_the_block_does():
    """Fine cells where exploratory paths went, growing ones up to the bounds; short steps where blocks rest."""

    def scene(amplitude, frequency, diffusion):
        forcing = dataclasses.replace(MAIN.forcing, amplitude=amplitude, frequency=frequency)
        return dataclasses.replace(MAIN, forcing=forcing, noise=WhiteNoise(diffusion))

    main, small, slow = (
        mesh_of(shaken, RESOLUTIONS[2]) for shaken in (MAIN, scene(2.8, 9.5, 0.002), scene(0.8, 2.0, 0.002))
    )
    assert main.steps == 12
    rare = scene(0.98, 2.0, 0.02)
    assert mesh_of(rare, RESOLUTIONS[2]).steps == pytest.approx(12 / 16 * math.pi / 0.07, abs=2.0)
    assert slow.steps > 12 / 16 * math.pi / 0.07
    quick = scene(2.8, 9.5, 0.002)
    motion = explore(quick, quick.period * np.arange(11))
    assert motion.angle < 0.2
    for lines, usual in ((small.angle_lines, motion.angle), (small.velocity_lines, motion.velocity)):
        assert usual in lines
        sizes = np.diff(lines[lines >= 0.0])
        assert np.all(np.diff(sizes) > -1e-12)
        assert (sizes[1:] / sizes[:-1])[-4:] == pytest.approx(1.3, rel=0.05)
    assert small.angle_lines[-1] == MAIN.overturning.angle
    assert np.diff(small.angle_lines).min() < 0.05 * np.diff(main.angle_lines).min()


def test_what_is_not_active_is_little_and_counted_as_truncated():
    """With all cells active from the start, and with those that hold something."""
    mesh, solutions = mesh_of(MAIN, RESOLUTIONS[USUAL[1e-2]]), []
    for negligible in (0.0, 1e-8):
        run = PeriodicPropagator(MAIN, mesh, negligible)
        solutions.append(run.propagate(MAIN.period * np.arange(3)))
        active = np.mean([step.characteristics.active.mean() for step in run.steps])
    all_cells, part = solutions
    assert active < 0.6
    assert 0.0 < abs(part.outflow[2, 2] - all_cells.outflow[2, 2]) < 1e-5
    assert np.abs(part.survival - all_cells.survival).max() < 1e-5
    assert part.survival + part.outflow.sum(axis=1) == pytest.approx(np.ones(3), abs=1e-13)
