"""The velocity bound for starts anywhere, against the slowest of the paths that noise of eight deviations allows."""

import itertools
import math

import numpy as np
import pytest
from density_operators import scene_of
from scipy.optimize import brentq

from fpk_rocking.horizon.mesh_operator import bound_for_all_phases


def slowed_impact(speed, scene, phase):
    """Speed of the first impact of a block that starts inward from the cut-off, slowed by noise, in closed form.

    The noise is the least that moves e^-t z by eight standard deviations up to the impact, a force c e^-t; z and q are
    the unstable and the stable coordinate of the flight (docs/theory, section 7), folded so that the angle is positive.
    """
    amplitude, frequency, diffusion = scene.forcing.amplitude, scene.forcing.frequency, scene.noise.diffusion
    height, size = scene.overturning.angle, amplitude / (1.0 + frequency**2)

    def particular(time):
        angle = frequency * time + phase
        return size * math.cos(angle), -size * frequency * math.sin(angle)

    def state(time):
        p, q = particular(0.0)
        spread = math.sqrt(-diffusion * math.expm1(-2.0 * time))
        force = 16.0 * spread / -math.expm1(-2.0 * time)
        unstable = math.exp(time) * (height - speed - 1.0 - p - q + 8.0 * spread)
        stable = math.exp(-time) * (height + speed - 1.0 - p + q - force * time)
        p, q = particular(time)
        return 1.0 + p + 0.5 * (unstable + stable), q + 0.5 * (unstable - stable)

    after = next(time for time in np.linspace(1e-3, 3.0, 3000) if state(time)[0] < 0.0)
    time = brentq(lambda time: state(time)[0], max(after - 1e-3, 1e-6), after)
    return -state(time)[1]


@pytest.mark.parametrize("restitution", [0.3, 0.5, 1.0])
def test_what_starts_faster_escapes_after_its_impact_at_every_phase(restitution):
    """From weak noise to very strong noise, with and without forcing: e v is above the speed of a sure escape."""
    for amplitude, frequency, diffusion in itertools.product((0.0, 4.6), (0.7, 2.7, 12.0), (0.006, 0.05, 0.5, 5.0)):
        scene = scene_of(amplitude=amplitude, frequency=frequency, diffusion=diffusion)
        scene = scene.varied(block={"restitution": restitution})
        escape = 1.0 + amplitude / math.hypot(1.0, frequency) + 8.0 * math.sqrt(diffusion)
        bound = bound_for_all_phases(scene)
        for phase in np.linspace(0.0, 2.0 * math.pi, 24):
            assert restitution * slowed_impact(bound, scene, phase) > escape
