"""Contact in its hard cases: limits of restitution and force, Zeno times, states nearly at rest."""

import math
import multiprocessing

import numpy as np
import pytest
from mpmath import fsum, mp, mpf
from numpy.polynomial import Polynomial

from fpk_rocking import Block, Body, NoNoise, Pulse, Scene
from fpk_rocking.physics.motion import TERMS
from fpk_rocking.physics.motion.equation import KernelBlock, block_of_scene, restitution_from, segment_from_particular
from fpk_rocking.physics.motion.events import advance_through_events
from fpk_rocking.physics.motion.impact import chatter_time, velocity_after_impact

CUTOFF = math.pi / 2


def under_force(force, duration):
    """Segment under a force of few polynomial coefficients: P = -(f + f'' + f'''' + ...) solves P'' = P + f."""
    f, particular = Polynomial(force), np.zeros(TERMS)
    while f.degree() > 0 or f.coef[0] != 0.0:
        particular[: f.coef.size] -= f.coef
        f = f.deriv(2)
    return segment_from_particular(particular, np.empty(TERMS), duration)


@pytest.mark.parametrize("restitution", [0.1, 0.5, 0.9, 0.99])
@pytest.mark.parametrize("force", [0.0, 0.7, -0.95])
@pytest.mark.parametrize("speed", [1e-2, 1e-4, 3e-7])
def test_bouncing_ends_at_its_zeno_time_under_a_constant_force(restitution, force, speed):
    # A bounce with speed w under the constant force lasts 2 artanh(w/g), g = 1 - s f, and returns with speed w.
    # The last 1e-6 of the chatter are summed; bounces lower than the rounding of the angle make it up to 3e-6.
    sides = [1 - force, 1 + force]
    speeds = speed * restitution ** np.arange(4000)
    gaps = np.array([sides[k % 2] for k in range(speeds.size)])
    zeno = 2.0 * np.arctanh(speeds / gaps).sum()
    segment = under_force([force], 4.0)

    def at(end):
        return advance_through_events(0.0, speed, 1, segment, 0.0, end, KernelBlock(restitution, CUTOFF))

    assert at(zeno + 1e-9) == (0.0, 0.0, 0, zeno + 1e-9)
    assert zeno < 3e-6 or at(zeno - 3e-6)[2] != 0
    parabolas = 2.0 * (speeds / gaps).sum()
    assert chatter_time(speed, 1, force, KernelBlock(restitution, CUTOFF)) == pytest.approx(parabolas, rel=1e-12)


def test_contact_at_the_limits_of_restitution_and_force():
    hopeless = (1.0, 0.5), (-1.2, 0.5), (0.0, 1.0)
    assert [chatter_time(0.1, 1, force, KernelBlock(e, CUTOFF)) for force, e in hopeless] == [math.inf] * 3
    rest = (0.0, 0.0, 0, 0.25)
    for force, uplifted in ((1.0, 0), (-1.0, 0), (1.0 + 1e-9, 1), (-1.0 - 1e-9, -1), (0.3, 0)):
        segment = under_force([force], 0.25)
        for state in ((0.0, 0.0, 0), (1e-20, -0.5, 1), (-1e-20, 0.5, -1)):
            x, v, side, time = advance_through_events(*state, segment, 0.0, 0.25, KernelBlock(0.0, CUTOFF))
            assert side == uplifted
            lift = uplifted * (abs(force) - 1.0)
            expected = (lift * (math.cosh(0.25) - 1.0), lift * math.sinh(0.25), side, 0.25) if uplifted else rest
            assert (x, v, side, time) == pytest.approx(expected, abs=1e-15)
    for side in (1, -1):
        segment = under_force([2.0 * side], 0.25)
        assert advance_through_events(0.0, -0.1 * side, -side, segment, 0.0, 0.25, KernelBlock(0.0, CUTOFF))[2] == side
    x, v, side = 0.0, 0.3, 1
    for _ in range(200):
        x, v, side, _ = advance_through_events(
            x, v, side, under_force([0.0], 0.25), 0.0, 0.25, KernelBlock(1.0, CUTOFF)
        )
        assert 0.5 * (v * v - x * x) + abs(x) == pytest.approx(0.045, abs=1e-12)


def carry_nasty_states():
    """Advance 24,000 states that are nearly at rest under forces nearly 1, or nearly at the cut-off; run in a child."""
    rng = np.random.default_rng(7)

    def tiny(low, high):
        return rng.choice([-1.0, 1.0]) * 10.0 ** rng.uniform(low, high)

    for trial in range(24_000):
        h = rng.choice([0.25, 0.1, 1e-3, 1e-6])
        force = [rng.choice([-1, 1]) * (1.0 + rng.choice([0, 1]) * tiny(-16, -6))]
        force += [rng.choice([0, 1]) * tiny(-16, 1) for _ in range(3)]
        side = int(rng.choice([-1, 1]))
        u, w = [(0, 0), (0, abs(tiny(-16, 0))), (abs(tiny(-18, -6)), tiny(-16, -3)), (CUTOFF, 0)][trial % 4]
        if trial % 8 == 0:
            side = 0
        if trial % 8 == 3:
            u, w = CUTOFF - abs(tiny(-16, -6)), tiny(-16, 0)
        restitution = rng.choice([0.0, 0.1, 0.5, 0.9, 0.99, 1.0 if w > 1e-4 else 0.999])
        x, v, side, time = advance_through_events(
            side * u, side * w, side, under_force(force, h), 0.0, h, KernelBlock(restitution, CUTOFF)
        )
        assert math.isfinite(v), trial
        assert 0.0 <= time <= h, trial
        assert -1e-14 <= side * x <= CUTOFF, trial


@pytest.mark.slow
def test_states_nearly_at_rest_under_forces_nearly_one_come_to_an_end():
    child = multiprocessing.get_context("spawn").Process(target=carry_nasty_states)
    child.start()
    child.join(60.0)
    running = child.is_alive()
    child.kill()
    assert not running
    assert child.exitcode == 0


def turning_after_impact(body, side):
    """Angular velocity of a body after an impact that leaves a side, over that before it, as an mpmath number.

    Four point masses have the centre and the moment of inertia of the body; their angular momentum about the other
    corner is that before the impact. No formula of a restitution enters.
    """
    reach, height = mpf(body.radius_of_gyration), mpf(body.height_of_centre)
    masses = [(reach, height), (-reach, height), (mpf(0), height + reach), (mpf(0), height - reach)]
    corners = {-1: -mpf(body.left), 1: mpf(body.right)}
    old, new = corners[side], corners[-side]
    # At rate 1 about the corner at a distance, clockwise, a mass at (x, y) moves by (y, -(x - corner)).
    before = fsum(y * y + (x - new) * (x - old) for x, y in masses)
    return before / fsum(y * y + (x - new) ** 2 for x, y in masses)


def test_impacts_of_bodies_keep_the_angular_momentum_about_the_new_corner():
    """200 drawn bodies, of which one in ten has its centre in the middle, in 40 digits."""
    rng, drawn = np.random.default_rng(40), 0
    while drawn < 200:
        height = rng.uniform(0.3, 2.0)
        right, left = height * rng.uniform(0.06, 0.9, 2)
        body = Body(height, right, right if drawn % 10 == 0 else left, height * rng.uniform(0.1, 1.2))
        if body.right * body.left > body.radius_of_gyration**2 + height**2:
            continue
        drawn += 1
        block = block_of_scene(Scene(Block(body=body), Pulse("one-sine", 2.0, 3.0), NoNoise()))
        for side in (-1, 1):
            speed = -side * rng.uniform(0.1, 3.0)
            after = velocity_after_impact(speed, restitution_from(side, block))
            with mp.workdps(40):
                expected = speed * turning_after_impact(body, side)
                assert abs(after - expected) <= 4.5e-16 * abs(speed)
