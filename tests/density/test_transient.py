"""The density solver under pulses and envelopes, against paths of white noise and exact flights."""

from types import SimpleNamespace

import numpy as np
import oracle
import pytest
from flight_moments import flight_moments

from fpk_rocking import (
    Block,
    Dimensions,
    Evolution,
    Harmonic,
    Harmonics,
    Pulse,
    Record,
    Scene,
    Start,
    WhiteNoise,
    load_scene,
    solve_fpk,
)
from fpk_rocking.density import solver
from fpk_rocking.density.propagator import Solution
from fpk_rocking.density.resolution import RESOLUTIONS, explore, resolutions_for
from fpk_rocking.density.space import Space
from fpk_rocking.density.startup import StartUp
from fpk_rocking.density.step.dynamics import Dynamics
from fpk_rocking.density.sticking import Sticking, density_at_rest
from fpk_rocking.density.transient import TransientPropagator
from fpk_rocking.density.tuning import TUNING
from fpk_rocking.envelopes import Table, Trapezoid
from montecarlo import simulate

SAMPLES = np.sin(np.arange(70) * 0.35) * np.sin(np.arange(70) * np.pi / 69)


SHAKEN = Scene(
    Block(None, Dimensions(0.5, 1.8)), Record(0.04, SAMPLES, "g", 0.5), WhiteNoise(0.004, Trapezoid(1.0, 8.0, 4.0))
)


PULSED = Scene(Block(0.8), Pulse("one-cosine", 2.6, 3.0), WhiteNoise(0.02))


def at_resolution(number, scene, times):
    """Space and densities of one of the solutions of `solve_fpk` at tol = 1e-2, without those that tell its error."""
    times = np.append(0.0, times)
    grid = solver._discretizations(scene, scene, explore(scene, times), resolutions_for(1e-2, before=2))[number]
    run = TransientPropagator(scene, grid, 1e-2 * TUNING.negligible_mass)
    return run.space, run.propagate(times)


def test_a_pulse_agrees_with_paths(tmp_path):
    # False alarms: 1e-3 for the 4 times together.
    times, size = [0.05, 1.0, PULSED.forcing.duration, PULSED.forcing.duration + 6.0], 40_000
    density = solve_fpk(PULSED, times=times, tol=1e-2)
    paths = simulate(PULSED, times=times, realizations=size, seed=3)
    assert density.times.tolist() == [0.0, *times]
    assert density.cycles is None
    assert density.settings["unresolved"] == [1]  # so soon after the start it is too narrow
    error = 3.7 * np.sqrt(paths.survival * (1.0 - paths.survival) / size) + 1.0 / size
    assert (np.abs(density.survival - paths.survival) <= density.error_estimate + error).all()
    assert 0.1 < density.survival[-1] < 0.5
    assert np.abs(density.overturned[-1] - paths.overturned[-1]).max() < 0.01
    assert density.mass_defect < 1e-12
    assert density.truncated[-1] < 1e-4
    edges = np.linspace(-1.6, 1.6, 9), np.linspace(-9.0, 9.0, 9)
    assert density.bin_probabilities(3, *edges).sum() == pytest.approx(density.survival[3], abs=1e-6)
    density.save(tmp_path / "density.npz")
    again = Evolution.load(tmp_path / "density.npz")
    assert again.scene == PULSED
    assert again.times.tobytes() == density.times.tobytes()


RISE_AND_FALL = (0.0, 0.4, 0.7, 1.1)


@pytest.mark.parametrize(
    "noise",
    [
        WhiteNoise(0.004, Trapezoid(0.4, 0.3, 0.4)),
        # The same noise: its largest D g² is .004 too, though g never reaches .01.
        WhiteNoise(0.004 / 0.009**2, Table(RISE_AND_FALL, (0.0, 0.009, 0.009, 0.0))),
    ],
    ids=["peak 1", "peak .009"],
)
def test_a_flight_under_an_envelope_has_the_exact_moments(noise):
    # Steps have the mean of D: second order in them, about 1e-3 of the covariance here.
    start = Start(0.9, -0.2, ((0.002, 0.0), (0.0, 0.003)))
    scene = Scene(Block(0.8), Pulse("one-sine", 0.6, 3.0), noise, start)
    times = np.array([0.25, 0.6])
    density = solve_fpk(scene, times=times, tol=1e-2)
    mean, gathered = flight_moments(scene, times, None)
    for k, time in enumerate(times):
        flow = np.array([[np.cosh(time), np.sinh(time)], [np.sinh(time), np.cosh(time)]])
        covariance = gathered[k] + flow @ np.array(start.covariance) @ flow.T
        assert density.at(k + 1).mean == pytest.approx(mean[k], abs=2e-5)
        assert density.at(k + 1).covariance == pytest.approx(covariance, abs=5e-3 * np.abs(covariance).max())


def test_dynamics_have_the_diffusion_of_a_step():
    noise = WhiteNoise(0.004, Trapezoid(1.0, 1.0, 1.0))
    dynamics = Dynamics.of(Scene(Block(0.8), Harmonic(1.0, 2.0), noise))
    assert dynamics.averaged_over(1.2, 0.3).diffusion == pytest.approx(0.004, rel=1e-12)
    assert dynamics.averaged_over(0.0, 0.3).diffusion == pytest.approx(0.004 * 0.03, rel=1e-12)
    assert dynamics.averaged_over(5.0, 0.3).diffusion == pytest.approx(0.004 * Dynamics.least_intensity)
    strong = Dynamics.of(Scene(Block(0.8), Harmonic(1.0, 2.0), WhiteNoise(200.0, Trapezoid(1.0, 1.0, 1.0))))
    assert strong.averaged_over(5.0, 0.3).diffusion == pytest.approx(TUNING.least_diffusion)
    assert dynamics.covariance(0.0, 0.6)[2] < dynamics.covariance(1.1, 0.6)[2]


def test_blocks_that_come_to_rest_after_a_record_are_held_there():
    # Steps over a layer at rest that no mesh resolves let a signed density grow without bound.
    # False alarms: 1e-3 for the 3 times together. The mesh takes over at once from a start that is as wide as this.
    scene = SHAKEN.varied(forcing={"scale": 0.6}, start=Start(0.2, 0.0, ((0.01, 0.0), (0.0, 0.02))))
    end, size = scene.forcing.duration, 4_000
    times = np.array([0.6 * end, end, end + 5.0, end + 60.0])
    space, solution = at_resolution(0, scene, times)
    paths = simulate(scene, times=times[:3], realizations=size, seed=4)
    error = 3.7 * np.sqrt(paths.survival * (1.0 - paths.survival) / size) + 1.0 / size
    assert (np.abs(solution.survival[:4] - paths.survival) <= 1e-2 + error).all()
    assert 0.1 < solution.survival[-1] < 0.9
    assert solution.coefficients[-1] == pytest.approx(solution.survival[-1] * density_at_rest(space), abs=1e-12)
    assert np.abs(solution.survival + solution.outflow.sum(axis=1) - 1.0).max() < 1e-12
    assert space.negative_mass(solution.coefficients[-1]) == 0.0


def test_a_record_lifts_off_a_block_that_rests_at_that_instant():
    """Its re-injection begins on the level of lift-off. The survival is that of a finer solution."""
    density = solve_fpk(load_scene("record").white_equivalent(), times=[6.0], tol=5e-2, bins_tol=np.inf)
    assert density.survival[-1] == pytest.approx(1.0, abs=1e-5)


def test_a_record_that_never_stirs_a_block_leaves_it_at_rest():
    scene = SHAKEN.varied(forcing={"scale": 0.05}, noise={"diffusion": 0.001})
    density = solve_fpk(scene, tol=1e-2)
    assert (density.survival == 1.0).all()
    assert density.at_rest[1:] == pytest.approx(1.0, abs=1e-12)


def test_what_is_released_late_has_the_force_and_the_noise_of_its_time():
    noise = WhiteNoise(0.01, Trapezoid(2.0, 3.0, 4.0))
    scene = Scene(Block(0.8), Pulse("one-sine", 1.3, 0.5), noise)
    times, origin = np.array([0.0, 12.0]), 1.3
    run = TransientPropagator(
        scene, solver._discretizations(scene, scene, explore(scene, times), resolutions_for(1e-2, before=2))[0], 1e-8
    )
    run._sticking = Sticking(run.dynamics, times[-1], run._forgetting)
    late = run._injection(origin, 1.0, Start(), np.arange(origin, 12.0, 0.2)).startup.dynamics
    for time in (0.0, 0.9, 3.0):
        assert late.force(time) == pytest.approx(1.3 * np.sin(0.5 * (origin + time)), abs=1e-12)
        strength = run.dynamics.averaged_over(origin + time, 0.1).diffusion
        assert late.averaged_over(time, 0.1).diffusion == pytest.approx(strength, rel=1e-12)
        assert late.covariance(time, 0.4) == pytest.approx(run.dynamics.covariance(origin + time, 0.4), rel=1e-12)
        for part in ("segment", "affine"):
            for now, then in zip(
                getattr(late, part)(time, 0.4), getattr(run.dynamics, part)(origin + time, 0.4), strict=True
            ):
                assert now == pytest.approx(then, rel=1e-12, abs=1e-12)
        assert late.since_lift_off(time) == pytest.approx(run.dynamics.since_lift_off(origin + time), abs=1e-10)
        assert late.rest_gap(time) == pytest.approx(run.dynamics.rest_gap(origin + time), abs=1e-12)


def test_the_estimate_is_four_times_as_large_where_blocks_rested_and_were_lifted_off():
    space = Space(np.linspace(-1.0, 1.0, 5), np.linspace(-1.0, 1.0, 5), 1)
    propagator, rows = SimpleNamespace(space=space, memory=0.0), np.array([False, True])
    for reinjected, error in ((0.0, 1e-3), (0.9e-3, 1e-3), (1.1e-3, 4e-3)):
        solution = Solution(propagator, np.ones(2), np.zeros((2, 3)), np.zeros(0), None, rows, reinjected)
        assert solution.error(1e-3, 0.0) == pytest.approx(error)


def test_what_rested_and_was_lifted_off_is_told_and_a_start_at_rest_is_not():
    noise = WhiteNoise(0.01, Trapezoid(0.5, 2.5, 0.5))
    _, solution = at_resolution(0, Scene(Block(0.9), Pulse("symmetric-ricker", 1.3, 1.0), noise), [9.5])
    assert 0.1 < solution.reinjected <= 1.0
    _, solution = at_resolution(0, Scene(Block(0.9), Pulse("one-sine", 1.6, 0.8), WhiteNoise(1e-3)), [1.5])
    assert solution.reinjected == 0.0


FROM_REST = {
    "noise that rises in a long flight": (
        Scene(Block(0.93), Pulse("one-cosine", 4.13, 0.635), WhiteNoise(0.019, Trapezoid(3.85, 0.07, 1.75))),
        {0.98: 0.83133, 1.0: 0.0},
        1,
        3e-3,
    ),
    "thick layer": (
        Scene(Block(0.845), Pulse("antisymmetric-ricker", 1.2866, 1.3232), WhiteNoise(0.035385)),
        {11.5: 0.18431, 12.5: 0.11848, 17.0: 0.06600},
        0,
        3e-3,
    ),
    "atom after the noise": (
        Scene(Block(0.9), Pulse("symmetric-ricker", 1.3, 1.0), WhiteNoise(0.01, Trapezoid(0.5, 2.5, 0.5))),
        {8.0: 1.0, 14.0: 0.00358},
        1,
        1e-2,
    ),
    "record with a silent begin": (
        Scene(
            Block(None, Dimensions(0.5, 1.8)),
            Record(0.01, np.append(np.zeros(150), 0.45 * np.sin(0.08 * np.arange(200))), "g"),
            WhiteNoise(0.02, Trapezoid(6.0, 8.0, 4.0)),
        ),
        {7.0: 0.9996, 12.0: 0.43858},
        0,
        3e-3,
    ),
}
"""Scene, times and survival of 100,000 paths, number of the resolution, and what it is right to within, as finer ones
tell.
"""


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.slow] * name.startswith("record")) for name in FROM_REST]
)
def test_blocks_that_rest_before_they_are_lifted_off_agree_with_paths(name):
    """Survival off by .03 to 1 where a block at rest was left there until |f| = .5, and by .03 where a long flight had
    the mean of D; false alarms 1e-3 a scene.
    """
    (scene, sampled, number, within), size = FROM_REST[name], 100_000
    _, solution = at_resolution(number, scene, list(sampled))
    survival = np.array([1.0, *sampled.values()])
    error = 3.7 * np.sqrt(survival * (1.0 - survival) / size) + 1.0 / size
    assert (np.abs(solution.survival - survival) <= within + error).all()
    assert np.abs(solution.survival + solution.outflow.sum(axis=1) - 1.0).max() < 1e-12


def test_noise_that_begins_late_is_solved():
    """Lifted off by a weak force before the noise comes, back at x = 0 when it does: the first solution had a negative
    mass of .9 after a cycle. Survival is that of 20,000 paths of seed 5; false alarms 1e-3.
    """
    noise = WhiteNoise(0.0079, Trapezoid(2.2, 6.1, 5.2))
    scene = Scene(Block(None, Dimensions(0.34, 2.04)), Harmonic(1.12, 3.81, 0.0), noise)
    space, solution = at_resolution(0, scene, scene.period * np.arange(1, 9))
    survival = 1.0 - np.array([0.0242, 0.0436, 0.0608])
    assert (np.abs(solution.survival[-3:] - survival) <= 3.5 * np.sqrt(survival * (1.0 - survival) / 20_000)).all()
    assert [bool(row) for row in solution.resolved] == [False, False, False, True, True, True, True, True, False]
    assert max(map(space.negative_mass, solution.coefficients[1:])) < 0.2


def test_a_start_stays_on_patches_for_longer_than_a_cycle_where_noise_grows_from_nothing():
    """A block near its saddle: 100,000 paths of seed 5 give the truth."""
    noise = WhiteNoise(0.00039, Trapezoid(1.44, 4.53, 1.62))
    forcing = Harmonics(3.4656, (1.6213, 0.5677, 2.0120), (0.0696, 2.8509, 4.9647))
    scene = Scene(Block(0.83), forcing, noise, Start(-0.408, -0.3533))
    space, solution = at_resolution(2, scene, scene.period * np.arange(1, 4))
    assert solution.survival[3] == pytest.approx(0.25101, abs=0.002 + 3.0 * 0.0014)
    assert space.negative_mass(solution.coefficients[3]) < 0.01


def test_a_start_is_carried_on_patches_past_the_time_within_which_a_mesh_should_take_over():
    # A record that overturns a block at once leaves no step at which the mesh resolves the density.
    dynamics, target = Dynamics.of(PULSED), Space(np.linspace(-1.57, 1.57, 9), np.linspace(-4.0, 4.0, 9), 3)
    startup = StartUp(dynamics, PULSED.start, RESOLUTIONS[0].patches, 0.1)
    coefficients, outflow = startup.project(0.2, target)
    assert target.masses(coefficients).sum() + outflow.sum() == pytest.approx(1.0, abs=1e-12)


def sticking(noise, forgetting, amplitude=0.9, restitution=0.8):
    """Sticking of a block under two periods of a sine of period 20."""
    scene = Scene(Block(restitution), Pulse("n-sine", amplitude, 0.1 * np.pi, 2), noise)
    return Sticking(Dynamics.of(scene), 45.0, forgetting)


def test_a_block_sticks_until_it_would_remember_it_at_the_lift_off():
    """The rate 9 (1 - e²)² (1 - f²)² / (256 D), integrated here by Simpson's rule."""
    diffusion, memory, lift_off = 4e-4, 3.0, 20.0 / (2.0 * np.pi) * np.arcsin(1.0 / 1.3)

    def forgotten(begin):
        times = np.linspace(begin, lift_off, 2001)
        rate = 9.0 * 0.36**2 * (1.0 - (1.3 * np.sin(0.1 * np.pi * times)) ** 2) ** 2 / (256.0 * diffusion)
        return (times[1] - times[0]) / 3.0 * (rate[0] + 4.0 * rate[1::2].sum() + 2.0 * rate[2:-1:2].sum() + rate[-1])

    rule = sticking(WhiteNoise(diffusion), memory, 1.3)
    first = rule.next_lift_off(0.0)
    assert first == pytest.approx(lift_off, abs=0.02)
    assert rule.next_lift_off(first) == first
    assert memory <= forgotten(rule.until(0.0)) < memory + 0.25
    assert sticking(WhiteNoise(diffusion), 2.0 * memory, 1.3).until(0.0) < rule.until(0.0) - 0.1
    assert rule.until(lift_off + 0.05) == pytest.approx(lift_off + 0.05)


def test_a_block_sticks_only_where_its_layer_is_thin():
    # Scale of the speeds 4 D / (3 (1 - e²)(1 - f²)): at most an eighth of .1, here D = .00216 at f = .6, and at most
    # (1 - f) / 25, here D = .000205 at f = .9.
    for amplitude, diffusion in ((0.6, 2.16e-3), (0.9, 2.05e-4)):
        assert sticking(WhiteNoise(0.98 * diffusion), 1.0, amplitude).until(0.0) == np.inf
        assert sticking(WhiteNoise(1.02 * diffusion), 1.0, amplitude).until(0.0) < 5.0
    assert sticking(WhiteNoise(0.02), 1.0).until(41.0) == 41.0
    assert sticking(WhiteNoise(0.02, Trapezoid(0.0, 30.0, 1.0)), 1.0).until(41.0) == np.inf


def test_what_still_hops_long_before_a_lift_off_stops_and_what_hops_just_before_it_does_not():
    space = Space(np.linspace(-0.004, 0.004, 17), np.linspace(-0.1, 0.1, 21), 2)
    rule = sticking(WhiteNoise(1e-6), 1.0, 1.3)
    lift_off = rule.next_lift_off(0.0)
    assert rule.stopping_cells(0.0, space).all()
    assert rule.stopping_cells(lift_off + 10.0, space).sum() < space.areas.size
    early, late = (rule.stopping_cells(lift_off - before, space).sum() for before in (2.0, 1.2))
    assert 4 < late < early < space.areas.size
    assert rule.stopping_cells(lift_off - 0.04, space).sum() == 4


def test_a_fast_force_keeps_blocks_hopping_that_a_slow_one_lets_stop():
    """Under .5 sin 20τ a block at e = .9 can hop on for ever at w = π/40: each hop lasts half a period."""
    scene = Scene(Block(0.9), Pulse("n-sine", 0.5, 20.0, 300), WhiteNoise(1e-9))
    space = Space(np.linspace(-1e-6, 1e-6, 3), np.linspace(-0.1, 0.1, 41), 2)
    stops = Sticking(Dynamics.of(scene), 45.0, 1.0).stopping_cells(0.0, space)[1, 20:]
    hopping = []
    for v in space.velocity_lines[21:-1:2] + 0.0025:
        block = oracle.Block(0.5, 20.0, 0.5 * np.pi, 0.9, 1.5, 5e-7, v, 1)
        block.advance(4.0)
        hopping.append(block.side != 0)
    assert np.count_nonzero(hopping) > 4
    assert not (stops[1::2] & hopping).any()
    assert 1 < stops.sum() < 8
