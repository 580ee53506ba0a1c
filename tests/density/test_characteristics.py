"""How a displacement is carried through a fast impact: an expansion, against exact flights with an impact each.

The flights are closed forms in numpy, without the kernels of the package.
"""

import dataclasses
import itertools
import math

import numpy as np
import pytest
from density_operators import affine, flight_noise, flow

from fpk_rocking import Harmonic
from fpk_rocking.density.space import Space
from fpk_rocking.density.step.dynamics import Dynamics
from fpk_rocking.density.step.step import Characteristics, Quadrature
from fpk_rocking.physics.motion import impact as saltation
from fpk_rocking.physics.motion.equation import KernelBlock

START, DURATION, TIME = 0.0, 0.25, 0.13
AMPLITUDE, FREQUENCY, PHASE = 4.6, 2.7, math.pi - 1.0
DYNAMICS = Dynamics(Harmonic(AMPLITUDE, FREQUENCY, PHASE), 0.0, KernelBlock(0.6, 10.0))
DIRECTIONS = ((0.7, 0.7), (-0.7, 0.7), (0.8, -0.2), (-0.4, -0.6), (0.3, 1.0))


def forcing(time):
    """Forcing and its derivative."""
    angle = FREQUENCY * time + PHASE
    return -AMPLITUDE * math.cos(angle), AMPLITUDE * FREQUENCY * math.sin(angle)


def expansion(displacement, time, speed, side, duration=DURATION):
    """Displacement at the end and whether the impact came within the step, by the kernel."""
    impact = saltation.linearize_impact(speed, side, *forcing(START + time), DYNAMICS.block)
    return saltation.displacement_through_impact(
        *displacement, time, duration - time, impact, DYNAMICS.block.restitution
    )


def flown(displacement, time, speed, side):
    """Displacement at the end: the difference of two flights that are so far apart when the first meets x = 0."""
    back = np.linalg.inv(affine(DYNAMICS, START, time, side)[0])
    there = np.array([0.0, speed]) - affine(DYNAMICS, START, time, side)[1]
    ends = [
        flow(DYNAMICS, back @ (there + shift), side, START, START + DURATION) for shift in (displacement, (0.0, 0.0))
    ]
    return ends[0] - ends[1]


@pytest.mark.parametrize(("side", "speed"), [(1, -0.7), (-1, 0.8), (1, -1.5)])
def test_a_displacement_is_carried_through_an_impact_with_an_error_of_third_order(side, speed):
    """Fitted order 3 in each of five directions, early and late impacts among them."""
    sizes = np.array([0.01, 0.005, 0.0025, 0.00125])
    for direction in DIRECTIONS:
        errors = []
        for size in sizes:
            displacement = size * np.array(direction)
            *end, inside = expansion(displacement, TIME, speed, side)
            assert inside
            errors.append(np.abs(end - flown(displacement, TIME, speed, side)).max())
        assert np.polyfit(np.log(sizes), np.log(errors), 1)[0] == pytest.approx(3.0, abs=0.15)


def test_the_error_is_what_the_fourth_derivatives_leave():
    """The first neglected term: x'''' = x'' + f'' on either side, over the time by which the impact comes late."""
    speed, side, size = -0.7, 1, 0.00125
    force, _ = forcing(START + TIME)
    curvature, rest = -(FREQUENCY**2) * force, DURATION - TIME
    before, after = (sign * side + force + curvature for sign in (-1, 1))
    for direction in DIRECTIONS:
        displacement = size * np.array(direction)
        late = -displacement[0] / (speed + displacement[1])
        missing = late**3 / 6.0 * (DYNAMICS.block.restitution * before - after)
        *end, _ = expansion(displacement, TIME, speed, side)
        error = flown(displacement, TIME, speed, side) - end
        assert error == pytest.approx(missing * np.array([math.sinh(rest), math.cosh(rest)]), rel=0.05)


@pytest.mark.parametrize("side", [1, -1])
def test_impacts_outside_the_step_are_told(side):
    """A displacement that would come to x = 0 before the step begins or after it ends is not carried."""
    speed = -0.8 * side
    for time, late in itertools.product((0.02, 0.23), (-0.05, -0.01, 0.01, 0.05)):
        *_, inside = expansion((-speed * late, 0.0), time, speed, side)
        assert inside == (0.0 < time + late < DURATION)


def before_impact(speed, side):
    """State at the begin of the step from which a flight meets x = 0 at TIME with a speed."""
    matrix, shift = affine(DYNAMICS, START, TIME, side)
    return np.linalg.inv(matrix) @ (np.array([0.0, speed]) - shift)


def nodes_from(point, diffusion, **changed):
    """Ends (n, 2) and flags (n,) of the nodes, three along the long axis and two along the short one, from a point."""
    space = Space(*(coordinate + np.array([-1e-10, 1e-10]) for coordinate in point), 1)
    dynamics = dataclasses.replace(DYNAMICS, diffusion=diffusion, **changed)
    trace = Characteristics(space, START, DURATION, dynamics, Quadrature(2, 2, 3, 2))
    return trace.ends[0, 0, 0], trace.flags[0, 0, 0]


@pytest.mark.parametrize(("side", "speed"), [(1, -0.7), (-1, 0.8)])
def test_nodes_lie_along_the_axes_of_the_noise_that_went_through_an_impact(side, speed):
    """J A J' + B, of the noise A before and B after the impact and the derivatives J of the flow from there on."""
    noise, size = dataclasses.replace(DYNAMICS, diffusion=1e-10), 1e-5
    moves = [flown(sign * size * direction, TIME, speed, side) for direction in np.eye(2) for sign in (1, -1)]
    jacobian = np.array([moves[0] - moves[1], moves[2] - moves[3]]).T / (2.0 * size)
    spread = jacobian @ flight_noise(noise, TIME) @ jacobian.T + flight_noise(noise, DURATION - TIME)
    variances, vectors = np.linalg.eigh(spread)
    point = before_impact(speed, side)
    ends, flags = nodes_from(point, noise.diffusion)
    along = (ends - flow(DYNAMICS, point, side, START, START + DURATION)) @ vectors / np.sqrt(variances)
    nodes = np.array([(b, a) for a in (-math.sqrt(3.0), 0.0, math.sqrt(3.0)) for b in (-1.0, 1.0)])
    assert np.abs(along) == pytest.approx(np.abs(nodes), abs=2e-3)
    assert along[:, 0] * along[0, 0] == pytest.approx(nodes[:, 0] * nodes[0, 0], abs=4e-3)
    assert along[:, 1] * along[0, 1] == pytest.approx(nodes[:, 1] * nodes[0, 1], abs=4e-3)
    assert flags.tolist() == [-side] * 6


def test_noise_has_one_diffusion_before_an_impact_and_another_after_it():
    """An exact block is moved by the noise as cos φ says where it is."""
    rest, before, after = DURATION - TIME, 2e-3, 5e-3
    met = saltation.linearize_impact(-0.7, 1, *forcing(START + TIME), DYNAMICS.block)
    parts = [
        saltation.covariance_through_impact(diffusions, TIME, rest, met, DYNAMICS.block.restitution)
        for diffusions in ((before, after), (before, 0.0), (0.0, after))
    ]
    (final, early, _), (first, alone, _), (last, none, _) = parts
    assert final == pytest.approx(np.add(first, last))
    xx, xv, _, vv = flight_noise(dataclasses.replace(DYNAMICS, diffusion=after), rest).ravel()
    assert last == pytest.approx((xx, xv, vv))
    xx, xv, _, vv = flight_noise(dataclasses.replace(DYNAMICS, diffusion=before), TIME).ravel()
    assert early == alone == pytest.approx((xx, xv, vv))
    assert none == (0.0, 0.0, 0.0)


def test_nodes_carried_by_an_expansion_and_one_by_one_are_the_same_but_for_its_third_order():
    """On either side of the speed at which the one takes over from the other, 5 sqrt(2 D h)."""
    point, speed = before_impact(-0.7, 1), 0.7
    change = (speed / 5.0) ** 2 / (2.0 * DURATION)
    ends = [nodes_from(point, change * (1.0 + part))[0] for part in (-1e-9, 1e-9)]
    undisturbed = flow(DYNAMICS, point, 1, START, START + DURATION)
    assert np.abs(ends[1] - ends[0]).max() < 0.04 * np.abs(ends[0] - undisturbed).max()


def test_what_comes_to_rest_is_set_off_by_the_last_jump_to_its_own_side():
    """Where impacts accumulate in a part of a step, the noise is a jump at its begin and one at its end."""
    diffusion = 1e-2
    ends, flags = nodes_from(np.array([1e-7, 0.0]), diffusion, forcing=Harmonic(0.5, FREQUENCY, PHASE))
    assert (ends[2:4, 0] == 0.0).all()
    assert ends[2:4, 1] == pytest.approx(np.array([-1.0, 1.0]) * math.sqrt(diffusion * DURATION), rel=1e-12)
    assert flags[2:4].tolist() == [-1, 1]


def test_strong_noise_acts_through_a_slow_impact_as_two_kicks_at_gauss_points():
    """Each of sqrt(D h); between kicks the block moves without noise, through impacts."""
    point, diffusion = before_impact(-0.3, 1), 0.5
    ends, flags = nodes_from(point, diffusion)
    times = START + DURATION * (0.5 + np.array([-1.0, 1.0]) / math.sqrt(12.0))
    size, expected = math.sqrt(diffusion * DURATION), []
    for kicks in itertools.product((-math.sqrt(3.0), 0.0, math.sqrt(3.0)), (-1.0, 1.0)):
        state, side, begin = point, 1, START
        for time, kick in zip((*times, START + DURATION), (*kicks, 0.0), strict=True):
            state = flow(DYNAMICS, state, side, begin, time) + np.array([0.0, kick * size])
            side, begin = math.copysign(1, state[0]), time
        expected.append(state)
    assert ends == pytest.approx(np.array(expected), abs=1e-7)
    assert flags.tolist() == [math.copysign(1, x) for x, _ in expected]
    assert -1 in flags
    assert 1 in flags


def test_two_kicks_at_gauss_points_have_the_covariance_of_the_noise_to_fifth_order():
    errors, durations = [], np.array([0.4, 0.2, 0.1])
    for duration in durations:
        left = duration * (0.5 + np.array([-1.0, 1.0]) / math.sqrt(12.0))
        moved = np.array([np.sinh(left), np.cosh(left)])
        error = duration * moved @ moved.T - flight_noise(dataclasses.replace(DYNAMICS, diffusion=1.0), duration)
        errors.append(np.abs(error).max())
    assert np.polyfit(np.log(durations), np.log(errors), 1)[0] == pytest.approx(5.0, abs=0.1)
