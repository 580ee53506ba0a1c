"""The paths of one Gauss point through a step: noise carried along the path, through impacts (docs/numerics).

The transition from a point is represented by Gauss-Hermite nodes along the principal axes of its Gaussian covariance.
Each node is a whole path, not an end point: the most probable noise that leads to it is added to the forcing, and the
block is then carried by the exact flow with its own impacts, rest and overturning. Where the path without noise meets
an impact, covariance and noise are those carried through it by the saltation matrix. Unless that impact is slow, a
node's displacement at it is then carried on by an expansion about that path, with an error of third order in the
displacement; what noise acts between the node's own impact and that of the path is counted on the side of the latter.
Where no node can meet an event the nodes are the affine flight's.

Noise moves an exact block by the part cos φ of it, here taken half way along a flight. Next to x = 0 the nodes of an
exact block are carried as those of a slender one in other units (`_near_contact`); what this leaves out is taken along
the path without noise. A path with the noise in the forcing of the exact equation needs no part: that has it.
"""

import math
from typing import NamedTuple

import numpy as np

from fpk_rocking.base.jit import kernel
from fpk_rocking.physics.motion import TERMS
from fpk_rocking.physics.motion.collocation import advance_collocated
from fpk_rocking.physics.motion.equation import Body, acceleration, dispatch_on_block, force_factor, lift_off_level
from fpk_rocking.physics.motion.events import (
    Event,
    advance_through_events,
    folded_angle_bounds,
    next_event,
    surely_eventless,
)
from fpk_rocking.physics.motion.flight import flight_covariance, flight_end
from fpk_rocking.physics.motion.impact import covariance_through_impact, displacement_through_impact, linearize_impact
from fpk_rocking.physics.motion.segment import move_origin, segment_from_particular, value_and_slope
from fpk_rocking.physics.tuning import TUNING

OVERTURNED_SIDE = 2
"""A node's code is its side, times this where its path overturned there."""

CHATTER = 0.03
"""Part of a step within which chatter has to end to be summed in closed form, where noise is a jump of the velocity."""

_RESOLVED, _SMOOTH = 2.0, 5.0
"""Speed of an impact over sqrt(2 D h): above the first noise is carried by the saltation matrix, above the second also
by the expansion about the path without noise."""


class Noise(NamedTuple):
    """The noise of a step: its duration and diffusion, and the nodes that stand for it.

    `nodes`, `offsets` (n, 2): along the long and the short axis in standard deviations, and as offsets of an
    undisturbed flight. `margin`: largest offset in angle.
    """

    duration: float
    diffusion: float
    nodes: np.ndarray
    offsets: np.ndarray
    margin: float


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


@kernel(inline="always")
def _carry_slender(x, v, side, segment, end, slow, block):
    return advance_through_events(x, v, side, segment, 0.0, end, block, None, 0.0, slow)


@kernel(borrows=True)
def _carried_exact(x, v, side, segment, end, slow, block):
    low, high = segment.force_low, segment.force_high
    # A bound without sines first: on this side of the cut-off u'' is less than that angle and the force together.
    rise = block.cutoff + max(high, -low)
    most = side * (x + end * v) + 0.5 * rise * end * end
    if most >= block.cutoff:
        _, most = folded_angle_bounds(side * x, side * v, side, low, high, end, block)
    if side != 0 and most < block.cutoff:
        return advance_collocated(segment.force, end, x, v, side, 0.0, end, block, None, 0.0, slow)
    return advance_through_events(x, v, side, segment, 0.0, end, block, None, 0.0, slow)


@kernel(inline="always")
def _carry_exact(x, v, side, segment, end, slow, block):
    return _carried_exact(x, v, side, segment, end, slow, block)


_carry = dispatch_on_block(_carry_slender, _carry_exact)


@kernel
def trace(x, v, side, segment, block, noise, scratch, states, codes):
    """Carry all nodes of one point through a step.

    Parameters
    ----------
    x, v, side : float, float, int
        The point.
    segment : Segment
        The forcing over the step.
    block : Body
    noise : Noise
    scratch : ndarray, shape (4, TERMS)
        Overwritten.
    states : ndarray, shape (n, 2)
        Receives angle and velocity at the end.
    codes : ndarray, shape (n,)
        Receives the side at the end, +-2 where the node's path overturned there, and 0 where it rests, which only a
        path without noise (D = 0) does.
    """
    duration, nodes, offsets, cutoff = noise.duration, noise.nodes, noise.offsets, block.cutoff
    low, high = segment.force_low, segment.force_high
    kind, time, end, speed = next_event(x, v, side, segment, 0.0, duration, block)
    quiet = noise.diffusion == 0.0 or surely_eventless(
        side * x, side * end, side, low, high, duration, block, noise.margin
    )
    if kind == Event.NONE and quiet:
        part = force_factor(0.5 * side * (x + end), block)
        for n in range(len(nodes)):
            states[n, 0], states[n, 1] = end + part * offsets[n, 0], speed + part * offsets[n, 1]
            codes[n] = side
        return
    if (
        kind == Event.OVERTURNING
        and side * flight_end(x, v, side, segment, 0.0, duration, block)[0] > cutoff + noise.margin
    ):
        codes[:] = OVERTURNED_SIDE * side
        return
    spread = math.sqrt(2.0 * noise.diffusion * duration)
    still, inside = spread == 0.0, min(time, duration - time) > 1e-6 * duration
    if kind == Event.IMPACT and inside and not still and abs(speed) > _RESOLVED * spread:
        smooth = abs(speed) > _SMOOTH * spread
        _fast_nodes(x, v, (time, speed, side, smooth), segment, block, noise, scratch, states, codes)
        return
    if still or (kind == Event.IMPACT and abs(value_and_slope(segment.force, time)[0]) < lift_off_level(block)):
        _jolt(x, v, side, math.sqrt(noise.diffusion * duration), still, segment, block, noise, states, codes)
        return
    _near_nodes(x, v, (end, time, side), segment, block, noise, scratch, states, codes)


@kernel
def _near_nodes(x, v, undisturbed, segment, block, noise, scratch, states, codes):
    """Carry the nodes of a point next to x = 0 or the cut-off; see `trace`.

    `undisturbed` is the angle and the time of the end of the path without noise, and its side.
    """
    end, time, side = undisturbed
    duration, offsets = noise.duration, noise.offsets
    unit, near, particular = _near_contact(x, end, time, side, segment, duration, scratch[2], block)
    part = force_factor(0.5 * side * (x + end), block) / unit
    for n in range(len(offsets)):
        bend(particular, duration, part * offsets[n, 0], part * offsets[n, 1], scratch[0])
        path = segment_from_particular(scratch[0], scratch[1], duration)
        xn, vn, sn, _ = advance_through_events(x / unit, v / unit, side, path, 0.0, duration, near)
        _put(n, xn, vn, sn, side, near.cutoff, states, codes)
        states[n, 0] *= unit
        states[n, 1] *= unit


@kernel(inline="always")
def _near_contact_slender(x, end, time, side, segment, duration, out, block):  # noqa: ARG001
    return 1.0, block, segment.particular


@kernel(inline="always")
def _near_contact_exact(x, end, time, side, segment, duration, out, block):
    alpha = block.critical_angle
    unit, level = math.sin(alpha) / alpha, lift_off_level(block)
    first = _beyond_contact(x, side, segment.force[0], unit, block)
    last = _beyond_contact(end, side, value_and_slope(segment.force, time)[0], unit, block)
    for k in range(TERMS):
        out[k] = segment.particular[k] / level
    out[0] -= first / unit
    out[1] -= (last - first) / (unit * duration)
    return unit, Body(block.restitution, block.cutoff / unit, None), out


_near_contact = dispatch_on_block(_near_contact_slender, _near_contact_exact)
"""Unit of angle and velocity, the slender block that moves as a block does next to x = 0, and its particular solution.

At x = 0 an exact block is pulled back by (sin α/α)(1 - s f/F) under the lift-off force F: it is a slender one under
f/F, in units of sin α/α. What acceleration it has beyond that elsewhere is taken as linear in time along the path
without noise, from its begin to its `end` at a `time`.
"""


@kernel(inline="always")
def _beyond_contact(x, side, force, unit, block):
    """Acceleration beyond that of a block next to x = 0."""
    return side * acceleration(side * x, side, force, block) - (
        x - side * unit + force * math.cos(block.critical_angle)
    )


@kernel
def _jolt(x, v, side, half, rests, segment, block, noise, states, codes):
    """Carry the nodes without noise but for a jump of the velocity by `half` of a node at the begin and at the end.

    The last one sets a block off from rest unless it `rests`. Nodes that begin alike follow each other.
    """
    nodes, duration = noise.nodes, noise.duration
    xn, vn, sn, part = x, v, side, force_factor(side * x, block)
    for n in range(len(nodes)):
        if n == 0 or nodes[n, 0] != nodes[n - 1, 0]:
            first = half * nodes[n, 0] * part
            xn, vn, sn, _ = _carry(x, v + first, side, segment, duration, CHATTER * duration, block)
        vl, sl = vn, sn
        if abs(xn) < block.cutoff:
            vl += half * nodes[n, 1] * force_factor(abs(xn), block)
            if xn == 0.0 and not rests:
                sl = 1 if vl > 0.0 else -1
        _put(n, xn, vl, sl, 0 if rests else side, block.cutoff, states, codes)


@kernel
def _put(n, x, v, side, before, cutoff, states, codes):
    states[n, 0], states[n, 1] = x, v
    codes[n] = before if side == 0 else side
    if abs(x) >= cutoff:
        codes[n] = OVERTURNED_SIDE * side


@kernel
def _fast_nodes(x, v, undisturbed, segment, block, noise, scratch, states, codes):
    """Carry the nodes of a point whose path without noise meets a fast impact; see `trace`.

    `undisturbed` is its time, velocity before and side before it, and whether it is so fast that what noise changes is
    smooth: then one expansion serves all nodes that arrive within the step.
    """
    time, speed, side, smooth = undisturbed
    duration, cutoff = noise.duration, block.cutoff
    late, rest = scratch[2], duration - time
    force, slope = value_and_slope(segment.force, time)
    met = linearize_impact(speed, side, force, slope, block)
    kind, _, far_x, far_v = next_event(0.0, met.leaving, -side, segment, time, duration, block)
    before, after = force_factor(0.5 * side * x, block), force_factor(0.5 * abs(far_x), block)
    diffusions = noise.diffusion * before * before, noise.diffusion * after * after
    final, early, (b11, b12, b21, b22) = covariance_through_impact(diffusions, time, rest, met, block.restitution)
    move_origin(segment.particular, time, late)
    after_xx, after_xv, after_vv = flight_covariance(diffusions[1], rest)
    long_x, long_v, short_x, short_v = principal_axes(*final)
    long, short = long_x * long_x + long_v * long_v, short_x * short_x + short_v * short_v
    long_x, long_v = long_x / long, long_v / long
    short_x, short_v = (short_x / short, short_v / short) if short > 0.0 else (0.0, 0.0)
    smooth = smooth and kind == Event.NONE
    for n in range(len(noise.nodes)):
        a, b = noise.nodes[n]
        p, q = a * long_x + b * short_x, a * long_v + b * short_v
        g, h = b11 * p + b21 * q, b12 * p + b22 * q
        early_x, early_v = early[0] * g + early[1] * h, early[1] * g + early[2] * h
        late_x, late_v = after_xx * p + after_xv * q, after_xv * p + after_vv * q
        if smooth:
            dx, dv, inside = displacement_through_impact(early_x, early_v, time, rest, met, block)
            xn = far_x + dx + late_x
            if inside and 0.0 < -side * xn < cutoff:
                _put(n, xn, far_v + dv + late_v, -side, -side, cutoff, states, codes)
                continue
        bend(segment.particular, time, early_x / before, early_v / before, scratch[0])
        path = segment_from_particular(scratch[0], scratch[1], time)
        xn, vn, sn, end = _carry(x, v, side, path, time, TUNING.chatter_time, block)
        if end == time:
            bend(late, rest, late_x / after, late_v / after, scratch[3])
            path = segment_from_particular(scratch[3], scratch[1], rest)
            xn, vn, sn, _ = _carry(xn, vn, sn, path, rest, TUNING.chatter_time, block)
        _put(n, xn, vn, sn, side, cutoff, states, codes)
