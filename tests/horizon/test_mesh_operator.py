"""The operator on one mesh: its velocity bound for starts anywhere, what it loses, and what is refused."""

import itertools
import math
import types

import numpy as np
import pytest
from density_operators import scene_of
from scipy.optimize import brentq

from fpk_rocking.density.resolution import RESOLUTIONS, explore
from fpk_rocking.density.tuning import TUNING
from fpk_rocking.horizon.mesh_operator import (
    MeshOperator,
    bound_for_all_phases,
    is_stagnated,
    judge,
    refuse_different,
)


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
    """Against the slowest of the paths that noise of eight deviations allows: e v is above the speed of a sure escape.

    From weak noise to very strong noise, with and without forcing.
    """
    for amplitude, frequency, diffusion in itertools.product((0.0, 4.6), (0.7, 2.7, 12.0), (0.006, 0.05, 0.5, 5.0)):
        scene = scene_of(amplitude=amplitude, frequency=frequency, diffusion=diffusion)
        scene = scene.varied(block={"restitution": restitution})
        escape = 1.0 + amplitude / math.hypot(1.0, frequency) + 8.0 * math.sqrt(diffusion)
        bound = bound_for_all_phases(scene)
        for phase in np.linspace(0.0, 2.0 * math.pi, 24):
            assert restitution * slowed_impact(bound, scene, phase) > escape


def test_another_leading_eigenvalue_of_the_adjoint_is_refused():
    def modes(*values):
        return types.SimpleNamespace(values=np.array(values))

    refuse_different(modes(0.9, 0.5), modes(0.9, 0.4))
    with pytest.raises(ValueError, match=r"scene: got 'eigenvalues 0\.9\d+ and 0\.8999999\d+', accepted: .* adjoint"):
        refuse_different(modes(0.9, 0.5), modes(0.9 - 1e-7, 0.5))


@pytest.mark.parametrize(
    ("negative", "error", "refused"),
    [
        (TUNING.unresolved_negative_mass, 0.99, None),
        (TUNING.unresolved_negative_mass * 1.0001, 0.1, "does not resolve"),
        (0.0, 1.0, "one above the error of the finest"),
        (0.0, math.nan, "one above the error of the finest"),
    ],
)
def test_what_no_mesh_resolves_is_refused_beyond_its_limit(negative, error, refused):
    fine = types.SimpleNamespace(negative_mass=negative, rate=1e-3)
    refined = types.SimpleNamespace(solutions=[fine], error=error, bins_error=0.0)
    if refused:
        with pytest.raises(ValueError, match=refused):
            judge(refined, 1e-3)
    else:
        with pytest.warns(RuntimeWarning, match="not within the tolerance"):
            judge(refined, 1e-3)


@pytest.mark.parametrize(
    ("rates", "negative", "stagnated"),
    [
        ((0.0, 9e-16), (0.0, 0.0), True),
        ((0.0, 2e-15), (0.0, 0.0), False),
        ((1e-3, 1e-3), (1.9, 0.0), False),
        ((1e-3, 1e-3), (2.1, 0.0), True),
        ((1e-3, 1e-3), (3.0, 4.0), True),
        ((1e-3, 1e-3), (3.0, 4.5), False),
    ],
)
def test_hope_ends_where_nothing_leaks_or_a_finer_mesh_hardly_helps(rates, negative, stagnated):
    fine, coarse = (
        types.SimpleNamespace(rate=rate, negative_mass=TUNING.unresolved_negative_mass * part)
        for rate, part in zip(rates, negative, strict=True)
    )
    assert is_stagnated(types.SimpleNamespace(solutions=[coarse, fine])) == stagnated


def test_what_the_mesh_loses_is_an_error_of_the_rate(main_scene):
    """With velocities up to 2.5 alone, blocks that would come back are lost: however well two meshes agree."""
    white = main_scene.white_equivalent()
    motion = explore(white, white.period * np.arange(5))
    wide, cut = (MeshOperator(white, RESOLUTIONS[0], motion, bound, bound) for bound in (4.0, 2.5))
    off = abs(cut.rate / wide.rate - 1.0)
    assert off > 0.01
    assert cut.error(0.0, 0.0) == pytest.approx(cut.leaks[2] / cut.rate)
    assert cut.error(0.0, 0.0) > 0.5 * off
    assert cut.error(0.5, 0.0) == pytest.approx(math.expm1(0.5))
    assert abs(wide.error(0.0, 0.0)) < 1e-3
