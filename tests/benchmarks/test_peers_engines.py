"""What the comparison with physics engines does itself: ratios, thresholds, places of boxes, outcomes at nodes."""

import importlib
import math
import pathlib

import numpy as np
import pytest

ROOT = pathlib.Path(__file__).parents[2]


@pytest.fixture
def engines(monkeypatch):
    monkeypatch.syspath_prepend(ROOT / "benchmarks")
    return importlib.import_module("peers_engines")


def swings(engines, ratios):
    """Tilts of a path whose swings have the energies that ratios of velocities at impacts leave."""
    energy = math.cos(0.5 * engines.ANGLE) - math.cos(engines.ANGLE)
    tilts, side = [], 1.0
    for ratio in (1.0, *ratios):
        energy *= ratio**2
        peak = engines.ANGLE - math.acos(energy + math.cos(engines.ANGLE))
        tilts.append(side * peak * np.sin(np.linspace(0.0, math.pi, 401)[1:-1]))
        side = -side
    return np.concatenate(tilts)


def test_ratios_follow_from_the_energies_of_swings(engines):
    assert engines.ratios(swings(engines, (0.9, 0.8, 0.7))) == pytest.approx([0.9, 0.8], rel=1e-3)
    once = engines.ratios(swings(engines, (0.9,)))
    assert once[0] == pytest.approx(0.9, rel=1e-3)
    assert math.isnan(once[1])


def test_the_lowest_amplitude_is_found_by_halving(engines):
    assert engines.lowest(lambda a: a > 2.2) == pytest.approx(2.2, abs=0.004)
    assert math.isnan(engines.lowest(lambda a: a > 5.0))


def test_a_tilted_box_stands_on_its_edge(engines):
    centre, turn = engines.placed((0.25, 0.5, 1.0), 0.1)
    corners = np.array([[x, 0.0, z] for x in (-0.25, 0.25) for z in (-1.0, 1.0)]) @ turn.T + centre
    lowest = corners[np.argmin(corners[:, 2])]
    np.testing.assert_allclose(lowest, [0.25, 0.0, 0.0], atol=1e-15)
    assert centre[0] > 0.0  # towards the edge


def test_nodes_between_equal_outcomes_are_not_followed(engines):
    followed = []

    class Fake:
        """Engine in which the blocks of small critical angles overturn."""

        step = 0.01

        def tilt(self, _, limit, half_sizes):
            followed.append(math.atan2(half_sizes[0], half_sizes[2]))
            return np.array([2.0 * limit if followed[-1] < 0.1 else 0.0])

    outcomes, _ = engines.overturned(Fake(), [np.zeros(100)], 0.005)
    np.testing.assert_array_equal(outcomes[0, 0], engines.NODES < 0.1)
    assert len(followed) == 6
    assert followed[0] == pytest.approx(engines.NODES[0])


def test_the_pulse_is_one_cycle(engines):
    times = np.linspace(0.0, 2.0, 20_001)
    pulse = engines.sine_pulse(times, 2.0)
    assert pulse.max() == pytest.approx(2.0 * engines.LIFT_OFF, rel=1e-4)
    assert times[np.flatnonzero(pulse)[-1]] == pytest.approx(math.pi / (2.0 * engines.PARAMETER), abs=2e-4)
