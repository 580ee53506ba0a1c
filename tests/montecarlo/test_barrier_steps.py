"""Steps next to x = 0 and the cut-off, by the functions themselves and without noise."""

import math
import types

import numpy as np
import pytest

from fpk_rocking.physics.motion import equation, flight
from fpk_rocking.physics.motion.equation import KernelBlock
from montecarlo.engines import barrier_steps

PARAMETERS = types.SimpleNamespace(block=KernelBlock(0.6, 1.5), shortest=1e-6)


@pytest.fixture(autouse=True)
def plain(monkeypatch):
    """As Python, with what it calls, and normals of 0."""
    for name in (
        "velocity_after_impact",
        "reflect_draw",
        "step_near_barrier",
        "covariance_factor",
        "value_and_slope",
        "safe_step",
        "least_closing_time",
    ):
        monkeypatch.setattr(barrier_steps, name, getattr(barrier_steps, name).py_func)
    for name in ("acceleration", "acceleration_bounds"):
        monkeypatch.setattr(barrier_steps, name, getattr(equation, f"slender_{name}").py_func)
    monkeypatch.setattr(barrier_steps, "slender_flight_end", flight.slender_flight_end.py_func)
    monkeypatch.setattr(barrier_steps, "_mean", barrier_steps._slender_mean.py_func)
    monkeypatch.setattr(barrier_steps, "normal", lambda _: 0.0)


def test_a_step_is_as_long_as_a_gap_surely_stays_open():
    """All nine tenths of the reach are kept all along the step; it is the limit, or the whole reach is not."""
    rng, lengths = np.random.default_rng(3), []
    for _ in range(300):
        gap, slope, reach = rng.uniform(0.0, 0.2), rng.normal(), rng.uniform(0.01, 0.3)
        bend = -rng.uniform(0.0, 3.0)
        h = barrier_steps.safe_step(gap, slope, bend, reach, 0.5, 1e-9)
        times = np.linspace(0.0, h, 50)

        def left(t, part, gap=gap, slope=slope, bend=bend, reach=reach):
            return gap + t * (slope + 0.5 * bend * t - part * reach * np.sqrt(t))

        assert left(times, 0.9).min() > -1e-12
        assert h == 0.5 or left(h, 1.0) < 1e-12
        lengths.append(h)
    assert 0.1 < np.mean(np.array(lengths) == 0.5) < 0.9


def test_a_step_without_noise_ends_where_the_gap_closes():
    for gap, slope, bend in np.random.default_rng(4).uniform((0.0, -2.0, -3.0), (0.2, 2.0, 0.0), (300, 3)):
        closes = max(np.roots([0.5 * bend, slope, gap]).real)
        assert barrier_steps.safe_step(gap, slope, bend, 0.0, 0.5, 1e-9) == pytest.approx(min(closes, 0.5), rel=1e-9)


def near(u, w, side, force, diffusion=0.0):
    coefficients = np.zeros(16)
    coefficients[0] = force
    segment = types.SimpleNamespace(force=coefficients, particular=-coefficients, force_low=force, force_high=force)
    parameters = types.SimpleNamespace(**vars(PARAMETERS), diffusion=[diffusion], reach=[1e-4])
    return barrier_steps.step_near_barrier(None, u, w, side, segment, 0, 0.2, 1.2, parameters, None, 0.0)


@pytest.mark.parametrize("side", [1, -1])
def test_a_step_ends_before_a_bound_of_the_acceleration_brings_a_block_to_a_barrier(side):
    """From rest: -u'' is at most 1 - s f, and u'' at most cutoff - 1 + s f; no step is shortened without a need."""
    for u, folded, bound in ((0.2, -3.0, 4.0), (1.3, 3.0, 3.5)):
        gap = min(u, PARAMETERS.block.cutoff - u)
        *_, end = near(u, 0.0, side, side * folded)
        assert end - 0.2 == pytest.approx(math.sqrt(2.0 * gap / bound), rel=1e-3)
    assert near(1.0, 0.0, side, 0.0)[-1] == 1.2
    # Towards a barrier at a speed against which noise is nothing a flight goes there at once.
    assert near(0.01, -1.0, side, 0.0)[::2] == (0.0, -side)
    assert near(1.49, 1.0, side, 0.0)[0] == PARAMETERS.block.cutoff


def test_an_impact_lies_on_the_parabola_through_the_draw(monkeypatch):
    monkeypatch.setattr(barrier_steps, "acceleration", lambda *_: -1.5)
    segment = types.SimpleNamespace(force=np.zeros(16))
    for late in (0.01, 0.05, -0.02):  # a draw may end before its impact, if the step was to end with it
        u, w = -late * (0.8 + 0.75 * late), -(0.8 + 1.5 * late)
        reflected = barrier_steps.reflect_draw(u, w, 1, segment, 0.1, 0.3, 0.33, PARAMETERS, None, 0.0)
        assert reflected == pytest.approx((0.0, 0.6 * 0.8, -1, 0.3 - late))


@pytest.mark.parametrize(("w", "lift"), [(0.2, 100.0), (0.0, 100.0), (-0.05, -1.0), (-0.1, 0.0)])
def test_a_draw_beyond_an_impact_that_no_parabola_has_is_scaled(monkeypatch, w, lift):
    """It rises, its impact would be before the step, or there is none."""
    monkeypatch.setattr(barrier_steps, "acceleration", lambda *_: lift)
    segment = types.SimpleNamespace(force=np.zeros(16))
    reflected = barrier_steps.reflect_draw(-0.01, w, -1, segment, 0.25, 0.3, 0.3, PARAMETERS, None, 0.0)
    assert reflected == pytest.approx((0.006, -0.6 * w, 1, 0.3))
