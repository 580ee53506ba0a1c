"""The many-digit reference held against a general integrator, closed forms, more digits and nearly missed events."""

import math

import numpy as np
import pytest
from mp_motion import Signal, UndecidedError
from mp_oracle import follow
from mp_scenes import compare, follow_scene, random_scenes
from mpmath import mp, mpf
from oracle import Block

from montecarlo import histories

CUTOFF = math.pi / 2


def test_paths_agree_with_a_general_integrator():
    rng, compared = np.random.default_rng(5), 0
    for trial in range(20):
        amplitude, frequency, phase = rng.uniform([0.5, 1.0, 0.0], [6.0, 6.0, 6.3])
        restitution = float(rng.choice([0.0, 1.0, rng.uniform()], p=[0.1, 0.1, 0.8]))
        x, v = rng.uniform(-1.0, 1.0, 2) if trial % 2 else (0.0, 0.0)
        block = Block(amplitude, frequency, phase, restitution, CUTOFF, x, v, int(np.sign(x)))
        signal, times = Signal([frequency], [phase], [-amplitude]), np.linspace(0.0, 4.0, 9)
        path = follow(signal, restitution, CUTOFF, x, v, times)
        for state in path.states:
            block.advance(float(state.time))
            if block.bound > 1e-9:
                break
            compared += 1
            errors = abs(block.x - float(state.angle)), abs(block.v - float(state.velocity))
            assert max(errors) <= block.bound
            assert not block.overturned
        else:
            block.advance(4.0)
            assert block.overturned == path.overturned
            if path.overturned:
                assert block.t == pytest.approx(float(path.events[-1].time), abs=block.bound)
    assert compared > 100


# What each flight and impact may add to the error in angle and velocity.
@pytest.mark.parametrize(("method", "rounding"), [("rk4", 2e-11), ("exact", 1e-12)])
def test_realizations_are_those_of_the_engines(method, rounding):
    compared = []
    for number, scene in enumerate(random_scenes(16)):
        run = histories(scene, cycles=4, realizations=2, seed=5, method=method, steps_per_cycle=2000)
        mine = run.impact_realization == 1
        path = follow_scene(scene, 5, 1, 4, rounding=rounding)
        compared.append(compare(path, run.impact_time[mine], run.impact_velocity[mine]))
        assert path.overturned == bool(run.overturn_side[1]), number
    late, error, off, velocity_error = np.concatenate(compared).T
    assert late.size > 60
    assert (error <= late).all()
    assert (velocity_error <= off).all()


def test_seventy_digits_tell_the_same():
    impacts, worst = 0, 0
    for scene in random_scenes(12, seed=2):
        path, longer = (follow_scene(scene, 3, 0, 4, digits=digits) for digits in (50, 70))
        assert [event.kind for event in path.events] == [event.kind for event in longer.events]
        impacts += sum(event.kind == "impact" for event in path.events)
        with mp.workdps(90):
            pairs = zip(path.events, longer.events, strict=True)
            worst = max([worst, *(max(abs(a.time - b.time), abs(a.velocity - b.velocity)) for a, b in pairs)])
    assert impacts > 100
    assert 0 < worst < mpf("1e-35")


@pytest.mark.parametrize("digits", [3, 12, 20, 27])
@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize(("amplitude", "level", "sign"), [(-3, 0.0, -1), (2, CUTOFF, 1)])
def test_touches_are_told_from_misses(side, amplitude, level, sign, digits):
    # At the time 0.1 the folded angle has the extreme value level + sign * depth; its acceleration there is known.
    with mp.workdps(65):
        signal = Signal([2], [mpf("-0.2")], [-side * amplitude])
        lean = mpf(side * amplitude) / 5
        acceleration = abs(level - 1 - amplitude)
        for depth in (mpf(10) ** -digits, -(mpf(10) ** -digits)):
            y = side * (mpf(level) + sign * depth) - side - lean
            back = mp.cosh(mpf("0.1")) * y, -mp.sinh(mpf("0.1")) * y
            x = side + lean * mp.cos(mpf("0.2")) + back[0]
            v = lean * 2 * mp.sin(mpf("0.2")) + back[1]
            path = follow(signal, 0.5, CUTOFF, x, v, [0, mpf("0.2")])
            if depth < 0:
                assert path.events == []
                continue
            early = mp.sqrt(2 * depth / acceleration)
            assert path.events[0].kind == ("overturning" if level else "impact")
            assert abs(path.events[0].time - (mpf("0.1") - early)) < early**2 + mpf("1e-20")
            assert abs(side * sign * path.events[0].velocity / (acceleration * early) - 1) < early


def test_a_touch_beyond_all_digits_is_not_decided():
    with mp.workdps(65):
        signal = Signal([2], [0], [3])
        lean = -mpf(3) / 5
        x, v = 1 + lean * mp.cos(1) - mp.cosh(mpf("0.5")) * (1 + lean), mp.sinh(mpf("0.5")) * (1 + lean)
        with pytest.raises(UndecidedError, match="a touch at -"):
            follow(signal, 0.5, CUTOFF, x, v - 2 * lean * mp.sin(-1), [-0.5, 0.5])


def test_a_low_cutoff_that_is_crossed_early():
    # In the middle of the first interval that is tried the block is nearer to 0, at its end beyond the cut-off.
    path = follow(Signal([0], [0], [2]), 0.5, 0.00125, 1e-6, 0.012, [0, 5])
    with mp.workdps(65):
        time = path.events[0].time
        assert abs((1 + mpf(1e-6)) * mp.cosh(time) + mpf(0.012) * mp.sinh(time) - 1 - mpf(0.00125)) < mpf("1e-50")
    assert [event.kind for event in path.events] == ["overturning"]
    assert time < 0.05


def test_uplift_by_a_force_that_barely_reaches_one():
    with mp.workdps(65):
        for excess in (mpf("1e-3"), mpf("1e-12")):
            lifted, kept = (follow(Signal([2], [0.5], [-1 - s * excess]), 0.5, CUTOFF, 0, 0, [0, 2]) for s in (1, -1))
            assert [event.kind for event in kept.events] == ["rest"]
            assert [event.kind for event in lifted.events[:3]] == ["rest", "uplift", "impact"]
            assert [event.kind for event in lifted.events[-2:]] == ["impact", "rest"]
            assert abs(2 * lifted.events[1].time + 0.5 - mp.acos(-1 / (1 + excess))) < mpf("1e-40")


@pytest.mark.parametrize(("restitution", "force"), [(0.5, 0.25), (0.9, -0.9375)])
def test_bouncing_under_a_constant_force_ends_at_its_zeno_time(restitution, force):
    path = follow(Signal([0], [0], [force]), restitution, CUTOFF, 0.0, 0.0625, [0, 40])
    with mp.workdps(65):
        gaps = 1 - mpf(force), 1 + mpf(force)
        zeno = mp.fsum(2 * mp.atanh(mpf(restitution) ** k / 16 / gaps[k % 2]) for k in range(1400))
        assert [event.kind for event in path.events[-2:]] == ["impact", "rest"]
        assert abs(path.events[-1].time - zeno) < mpf("1e-38")
        assert all(event.kind == "impact" for event in path.events[:-1])
        assert path.states[-1].side == 0
