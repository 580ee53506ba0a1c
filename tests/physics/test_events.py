"""The kernels of motion against an independent integrator, dense sampling and quadrature."""

import math
from collections import Counter

import numpy as np
import pytest
from numpy.polynomial import Polynomial
from oracle import Block
from scipy.linalg import expm
from scipy.optimize import brentq

from fpk_rocking.physics.forcing import Harmonic
from fpk_rocking.physics.motion import TERMS
from fpk_rocking.physics.motion.equation import KernelBlock, least_closing_time, segment_from_particular
from fpk_rocking.physics.motion.events import Event, advance_through_events, next_event
from fpk_rocking.physics.motion.flight import SERIES, flight_covariance, flight_end, flight_series

CUTOFF = math.pi / 2


def harmonic(start, amplitude, frequency, phase, duration):
    """Segment of A cos(Ω t + Ψ)/(1 + Ω²), of any sign."""
    piece = Harmonic(abs(amplitude), frequency, phase).pieces([start])[0]
    return segment_from_particular(math.copysign(1.0, amplitude) * piece, np.empty(TERMS), duration)


def random_scene(rng, kind):
    """(A, Omega, Psi, e) and (x, v, side): anywhere, at rest, or in slow chatter under a weak force."""
    restitution = rng.choice([0.0, 1.0, rng.uniform(), rng.uniform(0.2, 0.8)], p=[0.1, 0.1, 0.4, 0.4])
    scene = [rng.uniform(0, 8), rng.uniform(0.5, 8), rng.uniform(0, 2 * math.pi), float(restitution)]
    x, v = rng.uniform(-1.4, 1.4), rng.uniform(-2, 2)
    if kind == "rest":
        scene[0], x, v = rng.uniform(0.8, 4), 0.0, 0.0
    elif kind == "chatter":
        scene[0], scene[3], x, v = rng.uniform(0, 1.3), rng.uniform(0, 0.8), 0.2 * x, 0.2 * v
    return scene, (x, v, int(np.sign(x)))


def test_how_long_a_gap_stays_open():
    """Until the root of gap + slope t - curvature t²/2; for ever where it has none, of a gap of 0 too."""
    safe = least_closing_time.py_func
    assert [safe(1.0, 0.0, 2.0), safe(1.0, -1.0, 0.0), safe(1.0, 1.0, 4.0)] == [1.0, 1.0, 1.0]
    assert safe(0.0, 0.0, 0.0) == safe(1.0, 0.0, 0.0) == safe(1.0, 1.0, 0.0) == safe(1.0, -1.0, -1.0) == math.inf


@pytest.mark.parametrize("side", [1, -1])
def test_a_block_in_contact_that_is_pressed_down_has_an_impact_at_once_and_no_speed(side):
    """A little faster it flies: for 2 w under the pull 1."""
    segment, block = harmonic(0.0, 0.0, 2.0, 0.0, 0.25), KernelBlock(0.9, CUTOFF)
    for speed in (0.0, 0.9e-9):
        assert next_event(0.0, side * speed, side, segment, 0.1, 0.25, block) == (Event.IMPACT, 0.1, 0.0, 0.0)
    event, time, x, v = next_event(0.0, side * 1e-5, side, segment, 0.1, 0.25, block)
    assert (event, x) == (Event.IMPACT, 0.0)
    assert (time - 0.1, v) == (pytest.approx(2e-5, rel=1e-6), pytest.approx(-side * 1e-5, rel=1e-6))


def test_the_series_of_an_exact_flight_solve_its_equation_and_keep_to_the_circle():
    """(sin φ)² + (cos φ)² = 1, (sin φ)' = φ' cos φ and u'' = s f cos φ - sin φ/α, by products of series."""
    work, alpha, orders = np.zeros(SERIES), 0.7, np.arange(TERMS)
    force = np.random.default_rng(6).normal(size=TERMS) / 2.0**orders
    assert flight_series.py_func(0.4, 0.9, -1, force, 0.1, 9.0, KernelBlock(0.8, 1.5, alpha), work) > 0.1
    angle, sine, cosine, push = (Polynomial(row) for row in work)

    def low(series):
        return np.resize(np.pad(series.coef, (0, TERMS)), TERMS - 3)

    assert low(sine * sine + cosine * cosine) == pytest.approx(np.eye(1, TERMS - 3)[0], abs=1e-14)
    assert low(sine.deriv()) == pytest.approx(low(-alpha * angle.deriv() * cosine), abs=1e-14)
    assert low(angle.deriv(2)) == pytest.approx(low(-push * cosine - sine / alpha), abs=1e-13)


@pytest.mark.parametrize("rounds", [8, pytest.param(100, marks=pytest.mark.slow)])
def test_paths_of_random_scenes_agree_with_a_general_integrator(rounds):
    # Compared at every segment's end up to tau = 4 while chaos, by the oracle's own bound, keeps the error below 1e-9.
    rng, events, compared = np.random.default_rng(20), Counter(), 0
    for kind in ["anywhere", "rest", "chatter", "anywhere"] * rounds:
        scene, (x, v, side) = random_scene(rng, kind)
        oracle = Block(*scene, CUTOFF, x, v, side)
        count = math.ceil(4.0 * max(4.0, scene[1] / 0.79))
        h = 4.0 / count
        for k in range(count):
            x, v, side, time = advance_through_events(
                x, v, side, harmonic(k * h, *scene[:3], h), 0.0, h, KernelBlock(scene[3], CUTOFF)
            )
            oracle.advance((k + 1) * h)
            if oracle.bound > 1e-9:
                continue
            compared += 1
            assert side == oracle.side
            assert (time < h) == oracle.overturned
            errors = abs(x - oracle.x), abs(v - oracle.v), abs(k * h + time - oracle.t)
            assert max(errors) <= oracle.bound, (scene, k, errors)
            if oracle.overturned:
                break
        events.update(name for _, name in oracle.events)
    assert compared > 40 * rounds
    assert events["impact"] > 20 * rounds
    assert min(events["rest"], events["uplift"], events["overturning"]) > 0.8 * rounds


@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize("depth", [1e-3, 1e-6, 1e-9, 1e-12, -1e-12, -1e-9, -1e-6, -1e-3])
def test_grazing_is_met_exactly_and_stepped_over_never(side, depth):
    # At the time 0.1 the angle folded to u = s x has the minimum -depth under a force that lifts, and, under one that
    # presses down, the maximum cut-off + depth: above zero depth there are two crossings, the first of which counts.
    for amplitude, level, sign, kind in ((-3.0, 0.0, -1, Event.IMPACT), (2.0, CUTOFF, 1, Event.OVERTURNING)):
        segment = harmonic(0.0, side * amplitude, 2.0, -0.2, 0.25)
        acceleration = level - 1.0 - amplitude
        x, v = flight_end(side * (level + sign * depth), 0.0, side, segment, 0.1, 0.0, KernelBlock(1.0, CUTOFF))
        event, time, x, v = next_event(x, v, side, segment, 0.0, 0.25, KernelBlock(1.0, CUTOFF))
        if depth < 0.0:
            assert event == Event.NONE
            continue
        early = math.sqrt(2.0 * depth / abs(acceleration))
        assert event == kind
        assert time == pytest.approx(0.1 - early, abs=0.2 * early**2 + 3e-15 / early)
        assert x == side * level
        assert v == pytest.approx(side * sign * abs(acceleration) * early, rel=0.2 * early, abs=2e-14 / early)


def first_event(x, v, side, particular, duration):
    """Sample a flight densely and refine the first crossing; also the nearest approach to either barrier before it."""
    p, q = Polynomial(particular), Polynomial(particular).deriv()
    y, z = x - side - p(0.0), v - q(0.0)

    def u(t):
        return side * (side + p(t) + y * np.cosh(t) + z * np.sinh(t))

    t = np.linspace(0.0, duration, 2001)
    margins = np.minimum(u(t), CUTOFF - u(t))
    crossing = np.flatnonzero(margins[1:] <= 0.0)
    turns = margins[1:-1][(margins[1:-1] <= margins[:-2]) & (margins[1:-1] <= margins[2:])]
    if not crossing.size:
        return Event.NONE, duration, turns.min(initial=1.0)
    k = crossing[0]
    kind, level = (Event.IMPACT, 0.0) if u(t[k + 1]) < 0.5 else (Event.OVERTURNING, CUTOFF)
    return kind, brentq(lambda s: u(s) - level, t[k], t[k + 1], xtol=1e-15), np.abs(turns).min(initial=1.0)


def test_first_event_for_any_polynomial_against_dense_sampling():
    rng, kinds = np.random.default_rng(3), Counter()
    for trial in range(1500):
        segment = harmonic(0.0, rng.uniform(0, 8), rng.uniform(0.1, 3), rng.uniform(0, 6.3), 0.25)
        particular = segment.particular
        if trial % 5 == 0:
            particular[:] = np.r_[rng.uniform(-2, 2), np.zeros(TERMS - 1)]
        else:
            particular[:4] += rng.normal(size=4) * [0.3, 1.0, 5.0, 40.0]
        segment = segment_from_particular(particular, np.empty(TERMS), 0.25)
        side, u, w = int(rng.choice([-1, 1])), rng.uniform(0, 0.3) ** 2, rng.uniform(-2, 2)
        if trial % 3 == 0:
            u = CUTOFF - u
        if trial % 7 == 0:
            u, w = rng.choice([(0.0, abs(w)), (CUTOFF, -abs(w))])
        kind, time, clearance = first_event(side * u, side * w, side, particular, 0.25)
        if clearance < 1e-5:
            continue
        event, at, x, v = next_event(side * u, side * w, side, segment, 0.0, 0.25, KernelBlock(1.0, CUTOFF))
        kinds[kind] += 1
        assert (event, at) == (kind, pytest.approx(time, abs=1e-11))
        there = flight_end(side * u, side * w, side, segment, 0.0, at, KernelBlock(1.0, CUTOFF))
        assert (x, v) == (pytest.approx(there[0], abs=1e-13), pytest.approx(there[1], abs=1e-13))
    assert min(kinds[kind] for kind in (Event.NONE, Event.IMPACT, Event.OVERTURNING)) > 200


@pytest.mark.parametrize("duration", [1e-6, 1e-3, 0.0101, 0.0999, 0.1, 0.1001, 0.5, 1.0, 5.0])
def test_flight_covariance_against_quadrature_and_matrix_exponential(duration):
    nodes, weights = np.polynomial.legendre.leggauss(60)
    t, w = 0.5 * duration * (nodes + 1.0), 0.5 * duration * weights
    response = np.array([np.sinh(t), np.cosh(t)])
    expected = 2.0 * 0.3 * (response * w) @ response.T
    xx, xv, vv = flight_covariance(0.3, duration)
    assert (xx, xv, vv) == pytest.approx((expected[0, 0], expected[0, 1], expected[1, 1]), rel=1e-12, abs=0.0)
    drift, intensity = np.array([[0.0, 1.0], [1.0, 0.0]]), np.diag([0.0, 0.6])
    blocks = expm(duration * np.block([[-drift, intensity], [np.zeros((2, 2)), drift.T]]))
    van_loan = blocks[2:, 2:].T @ blocks[:2, 2:]
    assert np.allclose([[xx, xv], [xv, vv]], van_loan, rtol=1e-12, atol=1e-15 * np.exp(2 * duration))
