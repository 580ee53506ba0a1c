"""The paths of one Gauss point through a step: noise carried along the path, through impacts (docs/numerics).

The transition from a point is represented by Gauss-Hermite nodes along the principal axes of its Gaussian covariance.
Each node is a whole path, not an end point: the most probable noise that leads to it is added to the forcing, and the
block is then carried by the exact flow with its own impacts, rest and overturning. Where the path without noise meets
an impact, covariance and noise are those carried through it by the saltation matrix. Unless that impact is slow, a
node's displacement at it is then carried on by an expansion about that path, with an error of third order in the
displacement; what noise acts between the node's own impact and that of the path is counted on the side of the latter.
Where no node can meet an event the nodes are the affine flight's.
"""

import functools
import math

import numpy as np

from fpk_rocking.base.jit import kernel
from fpk_rocking.physics.motion import TERMS
from fpk_rocking.physics.motion.contact import impact
from fpk_rocking.physics.motion.events import IMPACT, NOTHING, OVERTURNING, next_event
from fpk_rocking.physics.motion.gaussian import flight_covariance
from fpk_rocking.physics.motion.polynomial import move_origin, polynomial
from fpk_rocking.physics.motion.slender import flight, segment_of
from fpk_rocking.physics.motion.transition import advance

OVERTURNED_SIDE = 2
"""A node's code is its side, times this where its path overturned there."""

CHATTER = 0.03
"""Part of a step within which chatter has to end to be summed in closed form, where noise is a jump of the velocity."""

_RESOLVED, _SMOOTH = 2.0, 5.0
"""Speed of an impact over sqrt(2 D h): above the first noise is carried by the saltation matrix, above the second also
by the expansion about the path without noise."""


@functools.cache
def hermite_nodes(long, short):
    """Gauss-Hermite nodes (n, 2) along the long and the short axis in standard deviations, and weights (n,)."""
    (x, u), (y, w) = np.polynomial.hermite_e.hermegauss(long), np.polynomial.hermite_e.hermegauss(short)
    nodes = np.array([(a, b) for a in x for b in y])
    weights = np.outer(u, w).ravel()
    return nodes, weights / weights.sum()


@kernel
def principal_axes(xx, xv, vv):
    """Principal axes of a covariance, scaled by their standard deviations: long (x, v), short (x, v)."""
    mean, difference = 0.5 * (xx + vv), 0.5 * (xx - vv)
    radius = math.hypot(difference, xv)
    long = mean + radius
    short = max(xx * vv - xv * xv, 0.0) / long if long > 0.0 else 0.0
    angle = 0.5 * math.atan2(xv, difference)
    c, s = math.cos(angle), math.sin(angle)
    a, b = math.sqrt(long), math.sqrt(short)
    return a * c, a * s, -b * s, b * c


@kernel
def bend(particular, duration, dx, dv, out):
    """Copy a particular solution, with the cubic added that starts from rest and reaches (dx, dv) after `duration`."""
    for k in range(TERMS):
        out[k] = particular[k]
    out[2] += (3.0 * dx - duration * dv) / (duration * duration)
    out[3] += (duration * dv - 2.0 * dx) / (duration * duration * duration)


@kernel
def through_impact(diffusion, before, after, v, force, side, restitution):
    """Carry the covariance through an impact by the saltation matrix (derived in docs/theory).

    Parameters
    ----------
    diffusion, before, after : float
        D, and the times before and after the impact.
    v, force, side : float, float, int
        Velocity and forcing just before the impact, and the side before it.
    restitution : float
        Velocity ratio e.

    Returns
    -------
    final, early : tuple (xx, xv, vv)
        Covariance at the end, and the part gathered before the impact, taken at it.
    map : tuple (b11, b12, b21, b22)
        Carries a displacement from the impact time to the end.
    """
    jump = ((side + force) - restitution * (force - side)) / v
    c, s = math.cosh(after), math.sinh(after)
    b11, b12, b21, b22 = c * restitution + s * jump, s * restitution, s * restitution + c * jump, c * restitution
    xx, xv, vv = flight_covariance(diffusion, before)
    final_xx, final_xv, final_vv = flight_covariance(diffusion, after)
    final_xx += b11 * b11 * xx + 2.0 * b11 * b12 * xv + b12 * b12 * vv
    final_xv += b11 * b21 * xx + (b11 * b22 + b12 * b21) * xv + b12 * b22 * vv
    final_vv += b21 * b21 * xx + 2.0 * b21 * b22 * xv + b22 * b22 * vv
    return (final_xx, final_xv, final_vv), (xx, xv, vv), (b11, b12, b21, b22)


@kernel
def _unreached(u, end, side, segment, duration, cutoff, margin):
    """Whether a flight between two folded angles keeps a distance from x = 0 and the cut-off: its chord less bounds."""
    low, high = (segment.force_low, segment.force_high) if side > 0 else (-segment.force_high, -segment.force_low)
    sag = 0.125 * duration * duration
    least = min(u, end) - sag * max(cutoff - 1.0 + high, 0.0)
    most = max(u, end) + sag * max(1.0 - low, 0.0)
    return least > margin and most < cutoff - margin


@kernel(borrows=True)
def _through(x, v, time, rest, restitution, speed, side, force, slope):
    """Carry a displacement at the time of a fast impact through it and on to the step's end, without further noise.

    The flight before the impact, and that after it, are Taylor polynomials about the undisturbed impact: the error is
    of third order in the displacement (derived in docs/theory, "Noise in a flight and through an impact").

    Parameters
    ----------
    x, v : float
        Displacement from the path without noise, at the time of its impact.
    time, rest : float
        The step's time before and after that impact.
    restitution, speed : float
        Velocity ratio e, and the velocity of the undisturbed impact just before it.
    side : int
        The side before it.
    force, slope : float
        Forcing at that impact, and its derivative.

    Returns
    -------
    x, v, inside : float, float, bool
        Displacement at the end of the step, and whether the impact came within the step.
    """
    onset, pull, jerk = speed + v, x - side + force, speed + v + slope
    late = -x / onset
    for _ in range(2):
        height = x + late * (onset + late * (0.5 * pull + late * jerk / 6.0))
        late -= height / (onset + late * (pull + 0.5 * late * jerk))
    arrival = onset + late * (pull + 0.5 * late * jerk)
    leaving = restitution * speed
    pull, jerk = side + force, leaving + slope
    x = -late * (leaving + late * (0.5 * pull + late * jerk / 6.0))
    v = restitution * arrival - leaving - late * (pull + 0.5 * late * jerk)
    c, s = math.cosh(rest - late), math.sinh(rest - late)
    return c * x + s * v, s * x + c * v, -time < late < rest


@kernel
def trace(
    x, v, side, segment, duration, diffusion, restitution, cutoff, nodes, offsets, margin, scratch, states, codes
):
    """Carry all nodes of one point through a step.

    Parameters
    ----------
    x, v, side : float, float, int
        The point.
    segment : Segment
        The forcing over the step.
    duration : float
        Of the step, nondimensional.
    diffusion, restitution, cutoff : float
        D, e and the angle of overturning.
    nodes, offsets : ndarray, shape (n, 2)
        Nodes along the long and the short axis in standard deviations, and as offsets of an undisturbed flight.
    margin : float
        Largest offset in angle.
    scratch : ndarray, shape (4, TERMS)
        Overwritten.
    states : ndarray, shape (n, 2)
        Receives angle and velocity at the end.
    codes : ndarray, shape (n,)
        Receives the side at the end, +-2 where the node's path overturned there, and 0 where it rests, which only a
        path without noise (D = 0) does.
    """
    kind, time, end, speed = next_event(x, v, side, segment, 0.0, duration, cutoff)
    if kind == NOTHING and _unreached(side * x, side * end, side, segment, duration, cutoff, margin):
        for n in range(len(nodes)):
            states[n, 0], states[n, 1] = end + offsets[n, 0], speed + offsets[n, 1]
            codes[n] = side
        return
    if kind == OVERTURNING and side * flight(x, v, side, segment, 0.0, duration)[0] > cutoff + margin:
        codes[:] = OVERTURNED_SIDE * side
        return
    spread = math.sqrt(2.0 * diffusion * duration)
    if spread == 0.0:
        for n in range(len(nodes)):
            _jolted(n, x, v, side, 0.0, True, segment, duration, restitution, cutoff, states, codes)
        return
    if kind == IMPACT and abs(speed) > _RESOLVED * spread and min(time, duration - time) > 1e-6 * duration:
        smooth = abs(speed) > _SMOOTH * spread
        impact_at = time, speed, side, smooth
        _fast_nodes(x, v, impact_at, segment, duration, diffusion, restitution, cutoff, nodes, scratch, states, codes)
        return
    if kind == IMPACT and abs(polynomial(segment.force, time)[0]) < 1.0:
        half = math.sqrt(diffusion * duration)
        for n in range(len(nodes)):
            _jolted(
                n,
                x,
                v + half * nodes[n, 0],
                side,
                half * nodes[n, 1],
                False,
                segment,
                duration,
                restitution,
                cutoff,
                states,
                codes,
            )
        return
    for n in range(len(nodes)):
        bend(segment.particular, duration, offsets[n, 0], offsets[n, 1], scratch[0])
        path = segment_of(scratch[0], scratch[1], duration)
        xn, vn, sn, _ = advance(x, v, side, path, 0.0, duration, restitution, cutoff)
        _put(n, xn, vn, sn, side, cutoff, states, codes)


@kernel
def _jolted(n, x, v, side, last, rests, segment, duration, restitution, cutoff, states, codes):
    """Carry a node without noise but for a last jump of its velocity, which sets it off from rest unless it `rests`."""
    xn, vn, sn, _ = advance(x, v, side, segment, 0.0, duration, restitution, cutoff, None, 0.0, CHATTER * duration)
    if abs(xn) < cutoff:
        vn += last
        if xn == 0.0 and not rests:
            sn = 1 if vn > 0.0 else -1
    _put(n, xn, vn, sn, 0 if rests else side, cutoff, states, codes)


@kernel
def _put(n, x, v, side, before, cutoff, states, codes):
    states[n, 0], states[n, 1] = x, v
    codes[n] = before if side == 0 else side
    if abs(x) >= cutoff:
        codes[n] = OVERTURNED_SIDE * side


@kernel
def _fast_nodes(x, v, undisturbed, segment, duration, diffusion, restitution, cutoff, nodes, scratch, states, codes):
    """Carry the nodes of a point whose path without noise meets a fast impact; see `trace`.

    `undisturbed` is its time, velocity before and side before it, and whether it is so fast that what noise changes is
    smooth: then one expansion serves all nodes that arrive within the step.
    """
    time, speed, side, smooth = undisturbed
    late, rest = scratch[2], duration - time
    force, slope = polynomial(segment.force, time)
    final, early, (b11, b12, b21, b22) = through_impact(diffusion, time, rest, speed, force, side, restitution)
    move_origin(segment.particular, time, late)
    after_xx, after_xv, after_vv = flight_covariance(diffusion, rest)
    long_x, long_v, short_x, short_v = principal_axes(*final)
    long, short = long_x * long_x + long_v * long_v, short_x * short_x + short_v * short_v
    kind, _, far_x, far_v = next_event(0.0, impact(speed, restitution), -side, segment, time, duration, cutoff)
    smooth = smooth and kind == NOTHING
    impact_there = restitution, speed, side, force, slope
    for n in range(len(nodes)):
        a, b = nodes[n]
        p = a * long_x / long + (b * short_x / short if b != 0.0 else 0.0)
        q = a * long_v / long + (b * short_v / short if b != 0.0 else 0.0)
        g, h = b11 * p + b21 * q, b12 * p + b22 * q
        early_x, early_v = early[0] * g + early[1] * h, early[1] * g + early[2] * h
        late_x, late_v = after_xx * p + after_xv * q, after_xv * p + after_vv * q
        if smooth:
            dx, dv, inside = _through(early_x, early_v, time, rest, *impact_there)
            xn = far_x + dx + late_x
            if inside and 0.0 < -side * xn < cutoff:
                _put(n, xn, far_v + dv + late_v, -side, -side, cutoff, states, codes)
                continue
        bend(segment.particular, time, early_x, early_v, scratch[0])
        path = segment_of(scratch[0], scratch[1], time)
        xn, vn, sn, end = advance(x, v, side, path, 0.0, time, restitution, cutoff)
        if end == time:
            bend(late, rest, late_x, late_v, scratch[3])
            path = segment_of(scratch[3], scratch[1], rest)
            xn, vn, sn, _ = advance(xn, vn, sn, path, 0.0, rest, restitution, cutoff)
        _put(n, xn, vn, sn, side, cutoff, states, codes)
