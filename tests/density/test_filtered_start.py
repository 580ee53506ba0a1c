"""The start-up under filtered noise: what counts as at rest, and when the mesh takes over."""

import numpy as np
import pytest

from fpk_rocking import Block, FilteredNoise, Harmonic, Scene, Start
from fpk_rocking.density.filter_nodes import Nodes
from fpk_rocking.density.filtered_start import FilteredStart
from fpk_rocking.density.step.dynamics import Dynamics


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


@pytest.mark.parametrize(("clear", "fine", "last"), [(0.55, 9.0, 5), (0.55, 0.25, 3), (0.05, 9.0, 0), (9.0, 9.0, 8)])
def test_the_mesh_takes_over_before_anything_can_happen_or_once_it_resolves(clear, fine, last, monkeypatch):
    """Steps of a tenth: nothing happens until `clear`, and the Gaussian is resolved from `fine` on."""
    monkeypatch.setattr(FilteredStart, "undisturbed", lambda _, time: time < clear)
    monkeypatch.setattr(FilteredStart, "resolution", lambda _, time, __: float(time > fine))
    assert FilteredStart.__new__(FilteredStart).takeover_step(None, 0.1 * np.arange(9)) == last
