"""Envelopes as steep as the grid: spikes shorter than an interval, and strength that rises from 0 within one."""

import numpy as np
import pytest
from scipy import stats

from fpk_rocking import BandNoise, Block, FilteredNoise, Pulse, Scene
from fpk_rocking.envelopes import Table
from montecarlo import simulate
from montecarlo.engines import exact_enveloped, filtered


@pytest.mark.parametrize("middle", [0.35, 0.6, 1.0])
def test_a_spike_shorter_than_an_interval_lifts_blocks_off(middle):
    """By the exact engine as by Runge-Kutta steps of a 40th of it: of 100 blocks next to all, path by path."""
    spike = Table((middle - 0.01, middle, middle + 0.01), (0.0, 200.0, 0.0))
    scene = Scene(Block(0.9), Pulse("one-cosine", 1e-4, 3.0), BandNoise(4.0, (0.0, 5.0), 40, envelope=spike))
    times = [middle - 0.02, middle + 0.5]
    assert exact_enveloped.parameters_of(scene, 200, np.array([0.0, *times])).grid.spacing > 0.1
    ensemble = simulate(scene, times=times, realizations=100)
    steps = simulate(scene, times=times, realizations=100, method="rk4", steps_per_cycle=4000)
    assert np.all(ensemble.angle[:, 1] == 0.0)
    assert np.mean(ensemble.angle[:, 2] != 0.0) > 0.9
    assert ensemble.angle == pytest.approx(steps.angle, abs=1e-3, nan_ok=True)


@pytest.mark.parametrize(("steps", "intervals"), [(200, 2), (40_000, 5)])
def test_filtered_noise_lifts_blocks_off_while_its_envelope_rises(steps, intervals):
    """From rest under η g, g = 10 τ: lift-off at τ = 1/(10 |η|), and a flight in closed form from there on.

    η hardly changes meanwhile, so that the angles are those of a normal η. The part that has left rest and the mean
    size of the angle at two times, each within 4 standard errors: one false alarm in 4,000 for each number of steps.
    """
    noise = FilteredNoise("low-pass", 0.49, 0.05, 0.7, Table((0.0, 1.0), (0.0, 10.0)))
    scene, times, paths = Scene(Block(0.9), Pulse("one-cosine", 1e-6, 1.9), noise), np.array([0.1, 0.2]), 20_000
    assert filtered.parameters_of(scene, steps, np.append(0.0, times)).low.size == intervals
    angles = simulate(scene, times=times, realizations=paths, steps_per_cycle=steps).angle[:, 1:]
    part = (np.arange(100_000) + 0.5) / 100_000
    slope = 10.0 * 0.7 * np.abs(stats.norm.ppf(part))[:, None]
    late = np.maximum(times - 1.0 / slope, 0.0)
    law = np.where(late > 0.0, 1.0 - slope * times + slope * np.sinh(late), 0.0)
    for of in (np.sign, np.abs):
        values, wanted = of(np.abs(angles)), of(law)
        assert np.all(np.abs(values.mean(axis=0) - wanted.mean(axis=0)) < 4.0 * wanted.std(axis=0) / np.sqrt(paths))
