"""Steps under filtered noise: what is at rest in the mirror image, and transitions over steps of unequal length."""

import dataclasses
import math

import numpy as np
import pytest

from fpk_rocking import Block, FilteredNoise, Harmonic, Overturning, Scene, Start
from fpk_rocking.density.filter_nodes import FilteredDiscretization, Nodes
from fpk_rocking.density.filtered import FilteredPropagator
from fpk_rocking.density.filtered_start import FilteredStart
from fpk_rocking.density.resolution import RESOLUTIONS, explore
from fpk_rocking.density.space.density import Density
from fpk_rocking.density.space.mesh import velocity_bound
from fpk_rocking.density.step.step import Dynamics


def plane_of(scene):
    white, times = scene.white_equivalent(), scene.period * np.arange(3)
    return RESOLUTIONS[0].adapted(white, velocity_bound(white, white.noise.diffusion), explore(white, times))


@pytest.mark.parametrize("noise", [FilteredNoise("low-pass", 0.04, 1.5, 0.7), FilteredNoise("exponential", 0.04, 1.0)])
def test_half_a_cycle_and_its_mirror_image_are_a_cycle(noise):
    """Steps of half a cycle used twice, or of a whole one: the same to rounding, and what rests at each node too."""
    scene = Scene(Block(0.5), Harmonic(0.9, 2.0, 0.4), noise)
    plane, found = plane_of(scene), []
    for periods in (2, 1):
        grid = FilteredDiscretization(plane, (5, 3), 3, np.linspace(0.0, 1.0 / periods, 8 // periods + 1))
        run = FilteredPropagator(scene, grid, 1e-12)
        states = run.states(scene.period * np.arange(2), scene.start)
        rests = [(state.mirror_image() if state.reflected else state).at_rest for state in states]
        found.append((run.propagate(scene.period * np.arange(2)), np.array(rests)))
    (halves, rests), (wholes, wanted) = found
    assert 0.1 < wholes.at_rest[1] < 0.9
    assert wholes.reinjected == 0.0  # what rests is an atom of its own, whose error the estimate has
    assert np.abs(wanted - wanted[:, ::-1, ::-1]).max() > 1e-3  # a mirror image is another state
    if wanted.shape[2] > 1:
        assert np.abs(wanted - wanted[:, :, ::-1]).max() > 1e-3
    assert rests == pytest.approx(wanted, abs=1e-10)
    assert halves.at_rest == pytest.approx(wholes.at_rest, abs=1e-10)
    assert halves.survival == pytest.approx(wholes.survival, abs=1e-10)


@pytest.mark.parametrize(
    ("start", "amplitude", "rests"),
    [
        (Start(), 0.9, True),
        (Start(), 3.0, False),
        (Start(0.1), 0.9, False),
        (Start(0.0, 0.1), 0.9, False),
        (Start(0.0, 0.0, ((1e-4, 0.0), (0.0, 1e-4))), 0.9, False),
    ],
)
def test_a_start_is_at_rest_where_only_noise_can_lift_the_block(start, amplitude, rests):
    scene = Scene(Block(0.5), Harmonic(amplitude, 2.0), FilteredNoise("exponential", 0.01, 1.0), start)
    dynamics = Dynamics(scene.forcing, 0.0, 0.5, scene.overturning.angle)
    assert FilteredStart(scene, Nodes(scene.noise, (3,)), dynamics).at_rest is rests


def test_piecewise_constant_noise_is_of_second_order_in_flight():
    """Variance of the velocity of a Gaussian far from all events, with steps that grow fivefold over the cycle.

    The mesh keeps it exactly, the step does not.
    """
    noise, start = FilteredNoise("exponential", 0.5, 3.0), Start(10.0, 0.0, ((0.25, 0.0), (0.0, 0.25)))
    scene = Scene(Block(0.5), Harmonic(0.0, 6.0), noise, start, Overturning(40.0))
    plane = dataclasses.replace(
        plane_of(scene),
        angle_lines=np.array([-40.0, *np.arange(-22.0, -5.0), 0.0, *np.arange(6.0, 23.0), 40.0]),
        velocity_lines=np.arange(-20.0, 21.0),
    )
    errors, counts = [], np.array([24, 48])
    for steps in counts:
        part = np.linspace(0.0, 1.0, steps + 1)
        run = FilteredPropagator(scene, FilteredDiscretization(plane, (3,), 5, part * (1.0 + 2.0 * part) / 3.0), 1e-12)
        _, wanted = FilteredStart(scene, run.nodes, run.steps[0][0].characteristics.dynamics).at(scene.period)
        density = Density(run.space, run.propagate(scene.period * np.arange(2)).coefficients[1])
        errors.append(abs(density.covariance[1, 1] - wanted[1, 1]))
    assert math.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.15)


@pytest.mark.parametrize(("clear", "fine", "last"), [(0.55, 9.0, 5), (0.55, 0.25, 3), (0.05, 9.0, 0), (9.0, 9.0, 8)])
def test_the_mesh_takes_over_before_anything_can_happen_or_once_it_resolves(clear, fine, last, monkeypatch):
    """Steps of a tenth: nothing happens until `clear`, and the Gaussian is resolved from `fine` on."""
    monkeypatch.setattr(FilteredStart, "undisturbed", lambda _, time: time < clear)
    monkeypatch.setattr(FilteredStart, "resolution", lambda _, time, __: float(time > fine))
    assert FilteredStart.__new__(FilteredStart).takeover_step(None, 0.1 * np.arange(9)) == last
