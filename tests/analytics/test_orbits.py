"""Symmetric orbits and free rocking in closed form, against integration of the motion."""

import math
from collections import Counter

import numpy as np
import pytest
from oracle import Block

from fpk_rocking.analytics.orbits import _speeds, symmetric_orbits
from fpk_rocking.physics.forcing import Harmonic
from fpk_rocking.physics.motion import TERMS
from fpk_rocking.physics.motion.equation import KernelBlock, segment_from_particular
from fpk_rocking.physics.motion.events import advance_through_events

CUTOFF = math.pi / 2
STABLE = [(1.5, 2.7, 0.5), (3.0, 3.0, 0.9), (5.0, 5.0, 0.925)]
UNSTABLE = [(4.6, 2.7, 0.5), (4.0, 4.0, 0.3), (0.9, 4.9, 0.9)]
LIMITS = [(2.0, 2.0, 1.0), (6.0, 5.0, 0.0)]
SEGMENTS = 16


def segments_of(orbit, phase):
    """Forcing of one cycle in `SEGMENTS` parts, from a phase on, and their duration."""
    span = 2.0 * math.pi / orbit.frequency / SEGMENTS
    pieces = Harmonic(orbit.amplitude, orbit.frequency, phase).pieces(span * np.arange(SEGMENTS))
    return [segment_from_particular(piece, np.empty(TERMS), span) for piece in pieces], span


def half_cycles(orbit, phase, state, count):
    """States (count + 1, 2) each half cycle from a phase on, seen from the side of the first one."""
    segments, span = segments_of(orbit, phase)
    x, v, side = *state, int(np.sign(state[0]))
    states = [(x, v)]
    for k in range(count):
        for i in range(SEGMENTS // 2):
            segment = segments[(k % 2) * SEGMENTS // 2 + i]
            x, v, side, _ = advance_through_events(
                x, v, side, segment, 0.0, span, KernelBlock(orbit.restitution, CUTOFF)
            )
        states.append((x, v) if k % 2 else (-x, -v))
    return np.array(states)


def test_an_elastic_block_keeps_its_orbit_without_a_force_worth_the_name():
    """At an amplitude whose square is 0 both roots are that of free rocking, and their discriminant is 0."""
    impact_speeds = _speeds(1e-200, 2.7, 1.0)
    assert [impact_speeds[0], impact_speeds[-1]] == pytest.approx([math.tanh(0.5 * math.pi / 2.7)] * 2, rel=1e-14)
    assert _speeds(1e-200, 2.7, 0.9) == []


def flow(time):
    return np.array([[math.cosh(time), math.sinh(time)], [math.sinh(time), math.cosh(time)]])


@pytest.mark.parametrize("scene", [*STABLE, *UNSTABLE, *LIMITS])
@pytest.mark.parametrize("phase", [0.4, 2.9])
def test_orbits_close_after_one_cycle_with_two_impacts(scene, phase):
    orbits = symmetric_orbits(*scene)
    assert len(orbits) == (2 if scene == (0.9, 4.9, 0.9) else 1)
    for orbit in orbits:
        x, v = orbit.state(phase)
        block = Block(*scene[:2], phase, scene[2], CUTOFF, x, v, int(np.sign(x)))
        for turned in np.linspace(0.0, 2.0 * math.pi, 9)[1:]:
            block.advance(turned / scene[1])
            assert (block.x, block.v) == pytest.approx(orbit.state(phase + turned), abs=block.bound)
        assert block.bound < 1e-10
        assert (block.x, block.v) == pytest.approx((x, v), abs=block.bound)
        impacts = sorted((scene[1] * t + phase) % math.pi for t, name in block.events if name == "impact")
        assert impacts == pytest.approx([orbit.impact_phase % math.pi] * 2, abs=1e-10)


def candidates(amplitude, frequency, restitution):
    """(W, phase of the impact) of all flights of half a cycle that begin with eW and end with -W at x = 0, W > 0.

    P and P' at the begin follow linearly from W; that they are those of the forcing leaves a quadratic.
    """
    (cosh, sinh), _ = flow(math.pi / frequency)
    matrix, e = np.eye(2) + flow(math.pi / frequency), restitution
    unit = (1.0 + frequency**2) / amplitude / np.array([1.0, -frequency])
    constant = unit * np.linalg.solve(matrix, [1.0 - cosh, -sinh])
    linear = unit * np.linalg.solve(matrix, [sinh * e, 1.0 + cosh * e])
    speeds = np.roots([linear @ linear, 2.0 * linear @ constant, constant @ constant - 1.0])
    speeds = np.sort(speeds[np.isreal(speeds)].real)
    return [(w, math.atan2(*(constant + linear * w)[::-1])) for w in speeds if w > 0.0]


def first_end(scene, speed, phase):
    """What ends the flight that an impact begins, and when."""
    block = Block(*scene[:2], phase, scene[2], CUTOFF, 0.0, scene[2] * speed, 1)
    block.advance(1.01 * math.pi / scene[1])
    return block.events[0][::-1]


def test_every_orbit_is_found_and_no_flight_with_an_event_in_between():
    rng, ends = np.random.default_rng(8), Counter()
    for trial in range(140):
        amplitudes = (0.2, 9.0) if trial % 2 else (1.2, 1.7)
        scene = rng.uniform(*amplitudes), rng.uniform(0.5, 6.0), rng.uniform(0.05, 1.0)
        expected = []
        for speed, phase in candidates(*scene):
            name, time = first_end(scene, speed, phase)
            half_cycle = name == "impact" and time == pytest.approx(math.pi / scene[1], abs=1e-9)
            ends["orbit" if half_cycle else name] += 1
            expected += [(speed, phase % (2.0 * math.pi))] if half_cycle else []
        orbits = [(orbit.impact_speed, orbit.impact_phase) for orbit in symmetric_orbits(*scene)]
        assert len(orbits) == len(expected), scene
        assert np.array(orbits) == pytest.approx(np.array(expected), rel=1e-9)
    assert min(ends[end] for end in ("orbit", "impact", "overturning")) >= 10, ends


def test_the_cutoff_decides_what_is_an_orbit():
    (orbit,) = symmetric_orbits(4.6, 2.7, 0.5)
    peak = np.abs(orbit.state(np.linspace(0.0, 2.0 * math.pi, 20001))[0]).max()
    assert symmetric_orbits(4.6, 2.7, 0.5, cutoff=peak + 1e-6) == (orbit,)
    assert symmetric_orbits(4.6, 2.7, 0.5, cutoff=peak - 1e-6) == ()


def jacobian(orbit):
    """Derivative (2, 2) of the half-cycle map at the orbit, from just after an impact: of flight and jump."""
    e, half = orbit.restitution, math.pi / orbit.frequency
    jump = ((1.0 + e) + (1.0 - e) * orbit.amplitude * math.cos(orbit.impact_phase)) / -orbit.impact_speed
    return -np.array([[e, 0.0], [jump, e]]) @ flow(half)


@pytest.mark.parametrize("scene", [*STABLE, *UNSTABLE, LIMITS[0]])
def test_multipliers_against_differences_of_the_half_cycle_map(scene):
    # In the middle of a flight the map is smooth all around the orbit; a quarter of a cycle of flight leads there.
    for orbit in symmetric_orbits(*scene):
        middle, size = orbit.impact_phase + 0.5 * math.pi, 1e-5
        centre, quarter = np.array(orbit.state(middle)), 0.5 * math.pi / orbit.frequency
        pairs = [[half_cycles(orbit, middle, centre + s * step, 1)[1] for s in (1, -1)] for step in size * np.eye(2)]
        measured = np.array([(plus - minus) / (2.0 * size) for plus, minus in pairs]).T
        expected = flow(quarter) @ jacobian(orbit) @ flow(-quarter)
        assert measured == pytest.approx(expected, abs=1e-6 * np.abs(expected).max())
        assert orbit.multipliers.sum() == pytest.approx(np.trace(jacobian(orbit)))
        assert orbit.multipliers.prod() == pytest.approx(scene[2] ** 2)
        assert abs(orbit.multipliers[0]) <= abs(orbit.multipliers[1]) * (1.0 + 1e-12)


@pytest.mark.parametrize("scene", STABLE)
def test_stable_orbits_are_held_and_returned_to(scene):
    """Of a disturbance less than 1e-9 is left after 150 cycles; by then what is off in the orbit has settled too."""
    orbit = symmetric_orbits(*scene)[-1]
    assert orbit.stable
    start = np.array(orbit.state(1.0))
    states = half_cycles(orbit, 1.0, start, 200)
    assert states == pytest.approx(np.tile(start, (201, 1)), abs=1e-9)
    disturbed = half_cycles(orbit, 1.0, start + np.array([1e-4, -1e-4]), 300)
    assert np.abs(disturbed[-1] - start).max() < 1e-10


@pytest.mark.parametrize("scene", UNSTABLE)
def test_unstable_orbits_are_left_at_the_predicted_rate(scene):
    orbit = symmetric_orbits(*scene)[0]
    growth, size = orbit.multipliers[1].real, 1e-9
    assert abs(growth) > 1.0
    assert not orbit.stable
    middle, quarter = orbit.impact_phase + 0.5 * math.pi, 0.5 * math.pi / orbit.frequency
    values, vectors = np.linalg.eig(flow(quarter) @ jacobian(orbit) @ flow(-quarter))
    direction = vectors[:, np.abs(values).argmax()].real
    count = int(math.log(1e4) / math.log(abs(growth)))
    start = np.array(orbit.state(middle))
    departures = half_cycles(orbit, middle, start + size * direction, count) - start
    sizes = departures @ direction / (direction @ direction) / size
    assert sizes == pytest.approx(growth ** np.arange(count + 1), rel=2e-3)
    assert abs(sizes[-1]) > 1e3


def test_without_losses_no_orbit_is_stable():
    orbits = [orbit for amplitude in np.linspace(0.1, 4.0, 40) for orbit in symmetric_orbits(amplitude, 2.0, 1.0)]
    sizes = np.abs([orbit.multipliers for orbit in orbits])
    assert sizes[np.ptp(sizes, axis=1) < 1e-9] == pytest.approx(1.0, rel=1e-12)
    assert (sizes < 1.0).any(axis=1).sum() > 20
    assert not any(orbit.stable for orbit in orbits)


def test_two_orbits_meet_at_the_least_amplitude():
    # Where the quadratic has a double root the faster orbit and the slower one, always unstable, have a multiplier 1.
    e, omega = 0.9, 4.9
    t = math.tanh(0.5 * math.pi / omega)
    loss = (1.0 - e) * t * omega
    least = t * loss * (1.0 + omega**2) / omega / math.hypot(loss, 1.0 + e)
    assert symmetric_orbits(least * (1.0 - 1e-9), omega, e) == ()
    for amplitude, gap in ((least * (1.0 + 1e-9), 1e-3), (1.01 * least, 1.0)):
        slow, fast = symmetric_orbits(amplitude, omega, e)
        assert slow.impact_speed < fast.impact_speed
        assert 1.0 < slow.multipliers[1].real < 1.0 + gap
        assert not slow.stable
        assert fast.stable
        assert fast.multipliers[1].real > 1.0 - gap


def test_state_just_after_impact_and_between_slow_impacts():
    (orbit,) = symmetric_orbits(1.5, 2.7, 0.5)
    speed = orbit.impact_speed
    for side, phase in ((1.0, orbit.impact_phase), (-1.0, orbit.impact_phase + math.pi)):
        assert orbit.state(phase) == pytest.approx((0.0, 0.5 * side * speed), abs=1e-14)
        assert orbit.state(phase - 1e-9) == pytest.approx((-side * speed * 1e-9 / 2.7, side * speed), abs=1e-8)
    gentle = symmetric_orbits(0.9, 4.9, 0.9)[0]
    assert gentle.state(np.nextafter(gentle.impact_phase, 0.0)) == pytest.approx((0.0, gentle.impact_speed), rel=0.11)
    angle, velocity = orbit.state(np.full((2, 3), 0.3))
    assert angle.shape == velocity.shape == (2, 3)
    # Between impacts that are 63 apart the block stands within exp(-31) of the moving equilibrium 1 + P.
    for slow in symmetric_orbits(0.5, 0.05, 0.5):
        phase = slow.impact_phase + 0.5 * math.pi
        scale = 0.5 / (1.0 + 0.05**2)
        balance = 1.0 + scale * math.cos(phase), -0.05 * scale * math.sin(phase)
        assert slow.state(phase) == pytest.approx(balance, abs=1e-12)


@pytest.mark.parametrize(
    ("changed", "error", "message"),
    [
        ({"amplitude": 0.0}, ValueError, r"amplitude: got 0\.0, accepted: a finite number > 0"),
        ({"amplitude": "4"}, TypeError, "amplitude: got '4'"),
        ({"frequency": 0.001}, ValueError, r"frequency: got 0\.001, accepted: a finite number >= 0\.01"),
        ({"frequency": math.nan}, ValueError, "frequency: got nan"),
        ({"restitution": 1.1}, ValueError, r"restitution: got 1\.1, accepted: a finite number >= 0\.0 and <= 1\.0"),
        ({"cutoff": -1.0}, ValueError, r"cutoff: got -1\.0, accepted: a finite number > 0"),
    ],
)
def test_bad_parameters_are_refused(changed, error, message):
    with pytest.raises(error, match=message):
        symmetric_orbits(**{"amplitude": 4.6, "frequency": 2.7, "restitution": 0.5, **changed})


def test_free_rocking_peaks_in_closed_form():
    # From a peak u the block falls as 1 - (1 - u) cosh t, meets x = 0 with w^2 = 1 - (1 - u)^2 and rises to the peak
    # 1 - sqrt(1 - e^2 w^2) at the time artanh(e w).
    free, e, peak, side, time = segment_from_particular(np.zeros(TERMS), np.empty(TERMS), 10.0), 0.5, 0.5, 1, 0.0
    peaks = []
    for _ in range(8):
        speed = e * math.sqrt(1.0 - (1.0 - peak) ** 2)
        time += math.acosh(1.0 / (1.0 - peak)) + math.atanh(speed)
        peak, side = 1.0 - math.sqrt(1.0 - speed**2), -side
        x, v, now, _ = advance_through_events(0.5, 0.0, 1, free, 0.0, time, KernelBlock(e, CUTOFF))
        assert (x, v, now) == (pytest.approx(side * peak, abs=1e-14), pytest.approx(0.0, abs=1e-13), side)
        peaks.append(peak)
    assert peaks[:3] == pytest.approx([0.098612, 0.023719, 0.005877], abs=5e-7)
