"""Tables for the flights of an exact block over a duration, and a slender block through an interval of a grid, fast.

An exact block flies by Gauss-Legendre collocation (`collocation`), with the tables made here, of the points and of
flights over one duration.

An impact of a slender block between two grid points is met by Halley's iteration on the flight written as a polynomial,
and accepted only where a bound of the acceleration proves that it is the first event and the only one. Everything else,
slow and repeated impacts, chatter, rest, lift-off, grazing and overturning, goes to `events.advance_through_events`. A
flight is s + P(t) + grow e^t + decay e^-t. For a slender block times count from the interval's middle; `grow` and
`decay` are passed as they are at the interval's begin and returned as they are at its end.
"""

import functools
import math
from typing import NamedTuple

import numpy as np

from fpk_rocking.base.arrays import WIDTH, borrowed
from fpk_rocking.base.basis import gauss_legendre
from fpk_rocking.base.checks import Array
from fpk_rocking.base.jit import kernel
from fpk_rocking.physics.motion import TERMS
from fpk_rocking.physics.motion.equation import segment_from_particular
from fpk_rocking.physics.motion.events import (
    advance_through_events,
    chord_excludes_event,
    curvature_bounds,
    downward_root,
    record_impact,
)
from fpk_rocking.physics.motion.flight import exponential_parts, folded_angle, state_from_exponentials
from fpk_rocking.physics.motion.impact import velocity_after_impact, velocity_jump

NODES = WIDTH


def _collocation():
    """Return Gauss points c (NODES,) of [0, 1], and tables of the polynomials that are 1 at one of them, 0 at others.

    The tuple is c; the polynomials' double integrals from 0 up to the points, (NODES, NODES) [polynomial, point]; their
    coefficients on [-1, 1], lowest power first, (NODES, NODES) [polynomial, power]; and six rows (6, NODES): c, the
    double and the single integral to 1, 1/((k + 1)(k + 2)), and the unit vectors of the first and the last point.
    """
    points, weights = gauss_legendre(NODES, -1.0, 1.0)
    lagrange = np.linalg.inv(np.polynomial.legendre.legvander(points, NODES - 1)).T
    twice = np.array([np.polynomial.legendre.legint(row, 2, lbnd=-1) for row in lagrange])
    inner = 0.25 * np.polynomial.legendre.legval(points, twice.T)
    places, order, unit = 0.5 * (1.0 + points), np.arange(NODES), np.eye(NODES)
    monomials = np.array([np.polynomial.legendre.leg2poly(row) for row in lagrange])
    rows = 0.5 * weights * (1.0 - places), 0.5 * weights, 1.0 / ((order + 1.0) * (order + 2.0)), unit[0], unit[-1]
    return places, inner, monomials, np.stack([places, *rows])


PLACES, INNER, MONOMIALS, POINTS = _collocation()


class FlightTables(NamedTuple):
    """Tables for flights u'' = u - m + a over one duration: without a, and what a adds by its values at the points.

    `points` (4, NODES): cosh and sinh of the time at the Gauss points; angle and velocity at the end that a unit value
    of a at a point adds. `inner` (NODES, NODES) [j, i]: angle at point i by the value at point j. `cosh`, `sinh`: at
    the end.
    """

    points: np.ndarray
    inner: np.ndarray
    cosh: float
    sinh: float


@functools.lru_cache(maxsize=64)
def flight_tables(span: float) -> FlightTables:
    """Return the `FlightTables`, a named tuple of arrays over the Gauss points, of flights of the duration `span`.

    The duration is nondimensional. The arrays are cached, so that nothing may write to them.
    """
    points, weights = gauss_legendre(24, -1.0, 1.0)
    ends, parts = span * np.append(PLACES, 1.0), 0.5 * (1.0 + points)
    lagrange = np.array([[_lagrange(j, end / span * parts) for end in ends] for j in range(NODES)])
    left = ends[:, None] * (1.0 - parts)
    weights = 0.5 * weights * ends[:, None]
    angle = np.einsum("jip,ip->ji", lagrange, weights * np.sinh(left))
    velocity = np.einsum("jp,p->j", lagrange[:, -1], (weights * np.cosh(left))[-1])
    rows = np.stack([np.cosh(ends[:-1]), np.sinh(ends[:-1]), angle[:, -1], velocity])
    return FlightTables(rows, angle[:, :-1].copy(), math.cosh(span), math.sinh(span))


def _lagrange(j, places):
    """Return values (n,), at `places` (n,) of [0, 1], of the polynomial that is 1 at `PLACES[j]`, 0 at the others."""
    others = np.delete(PLACES, j)
    return np.prod((places[:, None] - others) / (PLACES[j] - others), axis=1)


def _economized(start):
    """Return 9 polynomial coefficients, a tuple, lowest power of φ² first, of sin φ/φ (`start` 1) or cos φ (`start` 0).

    They are right to 1e-16 for |φ| <= π/2.
    """
    terms, most = 9, (0.5 * math.pi) ** 2
    angles = np.sqrt(0.5 * most * (1.0 + np.cos(np.pi * (np.arange(terms) + 0.5) / terms)))
    values = np.sin(angles) / angles if start else np.cos(angles)
    fit = np.polynomial.Chebyshev.fit(angles**2, values, terms - 1, domain=[0.0, most])
    return tuple(float(c) for c in fit.convert(kind=np.polynomial.Polynomial).coef)


SINE, COSINE = _economized(1), _economized(0)


class Tuning(NamedTuple):
    """Tuned numbers of the iteration for the accelerations of an exact flight; nondimensional."""

    collocation_change: float = 1e-24
    """Square of an acceleration, times the duration, that the next round may still change."""
    collocation_turn: float = 1e-5
    """Largest sum of squares of the turns from the first guess for which a series has their sine and cosine."""


TUNING = Tuning()


class Interval(NamedTuple):
    """One interval: `particular` (TERMS,) is P, a polynomial of the time since its middle, lowest power first.

    `force`, `folded` (TERMS,) are scratch. `exponentials` (2, TERMS): Taylor coefficients of e^t and e^-t. `bend`
    (TERMS,): k (k-1) half^(k-2) for k > 2. `half`: half of the interval's duration; `factor`: its exponential.
    """

    particular: np.ndarray
    force: np.ndarray
    folded: np.ndarray
    exponentials: np.ndarray
    bend: np.ndarray
    half: float
    factor: float


def interval_tables(half: float) -> tuple[Array, Array]:
    """Return the fields (exponentials, bend) of an `Interval`, arrays (2, TERMS) and (TERMS,), by power.

    They are the Taylor coefficients of e^t and e^-t, and k (k-1) half^(k-2) for powers k > 2, else 0. `half` is half of
    the interval's duration, nondimensional.
    """
    order = np.arange(TERMS)
    inverse = np.array([1.0 / math.factorial(k) for k in order])
    bend = np.where(order > 2, order * (order - 1.0) * half ** np.maximum(order - 2.0, 0.0), 0.0)
    return np.stack([inverse, inverse * (-1.0) ** order]), bend


@kernel(fastmath={"contract"}, forceinline=True)
def _fold(interval, grow, decay, sign):
    """Write the coefficients of the angle u = s x of a flight to `interval.folded` (TERMS,) of an `Interval`.

    They are those of a polynomial in the time since the middle, lowest power first. `grow` and `decay` are the flight's
    exponentials (x - s - P is their sum) at the middle, and `sign` is s as a float.
    """
    particular, folded, exponentials = interval.particular, interval.folded, interval.exponentials
    grow, decay = sign * grow, sign * decay
    for k in range(particular.size):
        folded[k] = sign * particular[k] + (grow * exponentials[0, k] + decay * exponentials[1, k])
    folded[0] += 1.0


@kernel
def _through_events(particular, scratch, half, x, v, side, begin, end, block, impacts, origin):
    """Return (x, v, side, time) of a block carried from `begin` to `end`, as `advance_through_events` does.

    Times, up to `half` in size, count from the interval's middle; that returned is `end` unless the block overturned.
    `x`, `v` are angle and velocity and `side` is +1, -1 or 0 at rest. `particular` (TERMS,) are the coefficients of P,
    lowest power first, `scratch` (TERMS,) is written to, `block` is a `KernelBlock`, `impacts` an `ImpactRecord` or
    None, and `origin` the time of the middle. All are nondimensional.
    """
    segment = borrowed(segment_from_particular(particular, scratch, half))
    return advance_through_events(x, v, side, segment, begin, end, block, impacts, origin)


@kernel
def state_at_begin(particular, half, grow, decay, side):
    """Return (x, v), angle and velocity at the interval's begin, at -half from its middle, or zeros at rest.

    `particular` (TERMS,) are the coefficients of P, lowest power first, in the time since the middle; `grow` and
    `decay` are the flight's exponentials (x - s - P is their sum) at the begin; `side` is s, +1 or -1, or 0 at rest.
    All are nondimensional.
    """
    if side == 0:
        return 0.0, 0.0
    return state_from_exponentials(grow, decay, side, particular, -half)


@kernel(forceinline=True)
def cross_interval(interval, node, grow, decay, u, end, side, block, impacts, origin):
    """Carry a slender block through an interval in which it may have an event; all nondimensional.

    Parameters
    ----------
    interval : Interval
    node : float
        P at the interval's end.
    grow, decay : float
        The flight's exponentials at the interval's begin (x - s - P is their sum); not used at rest.
    u, end : float
        Folded angle s x at the interval's begin, and at its end if nothing happens.
    side : int
        The side s: +1, -1, or 0 at rest.
    block : KernelBlock
    impacts : ImpactRecord
        Records the impacts.
    origin : float
        Time of the interval's middle.

    Returns
    -------
    grow, decay, u, side, time : float, float, float, int, float
        At the interval's end; `time` is that of overturning within the interval, or inf.
    """
    half, factor, cutoff = interval.half, interval.factor, block.cutoff
    x, v, begin = 0.0, 0.0, -half
    if side != 0:
        middle_grow, middle_decay = grow * factor, decay / factor
        _fold(interval, middle_grow, middle_decay, float(side))
        fall, rise = curvature_bounds(interval.folded, interval.bend)
        if end > 0.0 and u > 0.0 and chord_excludes_event(u, end, 4.0 * half * half, rise, fall, cutoff):
            return middle_grow * factor, middle_decay / factor, end, side, math.inf
        time, slope = downward_root(interval.folded, half) if u > 0.0 >= end else (0.0, 0.0)
        speed, square = -velocity_after_impact(slope, block.restitution), (time + half) ** 2
        # Slower impacts go to the search for events, which decides about chatter.
        if speed > 1e-4 and u >= rise * square and u + 0.25 * fall * square < cutoff:
            v = side * slope
            record_impact(impacts, origin + time, v)
            shift, shrink = 0.5 * velocity_jump(v, block.restitution), math.exp(-time)
            middle_grow += (side + shift) * shrink
            middle_decay += (side - shift) / shrink
            side = -side
            grow, decay = middle_grow * factor, middle_decay / factor
            old, end = end, folded_angle(side, node, grow, decay)
            # Seen from the new side, u'' is that of the old flight turned round, plus the sum of both angles less 2.
            rise, fall = max(1.01 * fall + 0.5 * cutoff - 1.0, 0.0), 1.01 * rise + 1.0 - 0.5 * old
            if end > 0.0 and chord_excludes_event(0.0, end, (half - time) ** 2, rise, fall, cutoff):
                return grow, decay, end, side, math.inf
            v, begin = velocity_after_impact(v, block.restitution), time
        else:
            x, v = state_at_begin(interval.particular, half, grow, decay, side)
    particular = interval.particular
    x, v, side, time = _through_events(
        particular, interval.force, half, x, v, side, begin, half, block, impacts, origin
    )
    if abs(x) >= cutoff:
        return 0.0, 0.0, cutoff, side, origin + time
    if side == 0:
        return 0.0, 0.0, 0.0, 0, math.inf
    grow, decay = exponential_parts(x, v, side, particular, half)
    return grow, decay, side * x, side, math.inf


@kernel(forceinline=True)
def state_in_interval(interval, grow, decay, side, time, block, impacts):
    """Return (x, v) at `time`, counted from the middle of `interval`; (nan, nan) if overturned by then.

    x, v are angle and velocity. The other arguments are as for `cross_interval`: `grow`, `decay` the flight's
    exponentials and `side` that at the interval's begin, `block` a `KernelBlock`, and `impacts` an `ImpactRecord`,
    which gets times that count from the middle too. All are nondimensional.
    """
    x, v = state_at_begin(interval.particular, interval.half, grow, decay, side)
    begin = -interval.half
    x, v, _, _ = _through_events(
        interval.particular, interval.force, interval.half, x, v, side, begin, time, block, impacts, 0.0
    )
    if abs(x) >= block.cutoff:
        return math.nan, math.nan
    return x, v
