"""When a block at rest under white noise may stick there: times, thickness of its layer, and what comes to rest."""

import numpy as np
import oracle
import pytest

from fpk_rocking import Block, Pulse, Scene, WhiteNoise
from fpk_rocking.density.space.space import Space
from fpk_rocking.density.step.dynamics import Dynamics
from fpk_rocking.density.sticking import Sticking
from fpk_rocking.envelopes import Trapezoid


def sticking(noise, forgetting, amplitude=0.9, restitution=0.8):
    """Sticking of a block under two periods of a sine of period 20."""
    scene = Scene(Block(restitution), Pulse("n-sine", amplitude, 0.1 * np.pi, 2), noise)
    return Sticking(Dynamics.of(scene), 45.0, forgetting)


def test_a_block_sticks_until_it_would_remember_it_at_the_lift_off():
    """The rate 9 (1 - e²)² (1 - f²)² / (256 D), integrated here by Simpson's rule."""
    diffusion, memory, lift_off = 4e-4, 3.0, 20.0 / (2.0 * np.pi) * np.arcsin(1.0 / 1.3)

    def forgotten(begin):
        times = np.linspace(begin, lift_off, 2001)
        rate = 9.0 * 0.36**2 * (1.0 - (1.3 * np.sin(0.1 * np.pi * times)) ** 2) ** 2 / (256.0 * diffusion)
        return (times[1] - times[0]) / 3.0 * (rate[0] + 4.0 * rate[1::2].sum() + 2.0 * rate[2:-1:2].sum() + rate[-1])

    rule = sticking(WhiteNoise(diffusion), memory, 1.3)
    first = rule.next_lift_off(0.0)
    assert first == pytest.approx(lift_off, abs=0.02)
    assert rule.next_lift_off(first) == first
    assert memory <= forgotten(rule.until(0.0)) < memory + 0.25
    assert sticking(WhiteNoise(diffusion), 2.0 * memory, 1.3).until(0.0) < rule.until(0.0) - 0.1
    assert rule.until(lift_off + 0.05) == pytest.approx(lift_off + 0.05)


def test_a_block_sticks_only_where_its_layer_is_thin():
    # Scale of the speeds 4 D / (3 (1 - e²)(1 - f²)): at most an eighth of .1, here D = .00216 at f = .6, and at most
    # (1 - f) / 25, here D = .000205 at f = .9.
    for amplitude, diffusion in ((0.6, 2.16e-3), (0.9, 2.05e-4)):
        assert sticking(WhiteNoise(0.98 * diffusion), 1.0, amplitude).until(0.0) == np.inf
        assert sticking(WhiteNoise(1.02 * diffusion), 1.0, amplitude).until(0.0) < 5.0
    assert sticking(WhiteNoise(0.02), 1.0).until(41.0) == 41.0
    assert sticking(WhiteNoise(0.02, Trapezoid(0.0, 30.0, 1.0)), 1.0).until(41.0) == np.inf


def test_what_still_hops_long_before_a_lift_off_stops_and_what_hops_just_before_it_does_not():
    space = Space(np.linspace(-0.004, 0.004, 17), np.linspace(-0.1, 0.1, 21), 2)
    rule = sticking(WhiteNoise(1e-6), 1.0, 1.3)
    lift_off = rule.next_lift_off(0.0)
    assert rule.stopping_cells(0.0, space).all()
    assert rule.stopping_cells(lift_off + 10.0, space).sum() < space.areas.size
    early, late = (rule.stopping_cells(lift_off - before, space).sum() for before in (2.0, 1.2))
    assert 4 < late < early < space.areas.size
    assert rule.stopping_cells(lift_off - 0.04, space).sum() == 4


def test_a_fast_force_keeps_blocks_hopping_that_a_slow_one_lets_stop():
    """Under .5 sin 20τ a block at e = .9 can hop on for ever at w = π/40: each hop lasts half a period."""
    scene = Scene(Block(0.9), Pulse("n-sine", 0.5, 20.0, 300), WhiteNoise(1e-9))
    space = Space(np.linspace(-1e-6, 1e-6, 3), np.linspace(-0.1, 0.1, 41), 2)
    stops = Sticking(Dynamics.of(scene), 45.0, 1.0).stopping_cells(0.0, space)[1, 20:]
    hopping = []
    for v in space.velocity_lines[21:-1:2] + 0.0025:
        block = oracle.Block(0.5, 20.0, 0.5 * np.pi, 0.9, 1.5, 5e-7, v, 1)
        block.advance(4.0)
        hopping.append(block.side != 0)
    assert np.count_nonzero(hopping) > 4
    assert not (stops[1::2] & hopping).any()
    assert 1 < stops.sum() < 8
