"""How a displacement is carried through a fast impact: an expansion, against exact flights with an impact each.

The flights are closed forms in numpy, without the kernels of the package.
"""

import itertools
import math

import numpy as np
import pytest
from density_operators import affine, flow

from fpk_rocking import Harmonic
from fpk_rocking.density.step.step import Dynamics
from fpk_rocking.physics.motion import saltation

START, DURATION, TIME = 0.0, 0.25, 0.13
AMPLITUDE, FREQUENCY, PHASE = 4.6, 2.7, math.pi - 1.0
DYNAMICS = Dynamics(Harmonic(AMPLITUDE, FREQUENCY, PHASE), 0.0, 0.6, 10.0)
DIRECTIONS = ((0.7, 0.7), (-0.7, 0.7), (0.8, -0.2), (-0.4, -0.6), (0.3, 1.0))


def forcing(time):
    """Forcing and its derivative."""
    angle = FREQUENCY * time + PHASE
    return -AMPLITUDE * math.cos(angle), AMPLITUDE * FREQUENCY * math.sin(angle)


def expansion(displacement, time, speed, side, duration=DURATION):
    """Displacement at the end and whether the impact came within the step, by the kernel."""
    impact = saltation.encounter(speed, side, *forcing(START + time), DYNAMICS.block)
    return saltation.through_impact_expanded(*displacement, time, duration - time, impact, DYNAMICS.block)


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
        missing = late**3 / 6.0 * (DYNAMICS.restitution * before - after)
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
