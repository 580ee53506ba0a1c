"""Characteristics of a time step: whole paths from the Gauss points of cells, with noise, through impacts.

The transition density of a point is represented by Gauss-Hermite nodes along the principal axes of its Gaussian
covariance. Each node is a whole path, not an end point: the most probable noise that leads to it is added to the
forcing, and the block then follows the exact flow with its own impacts, rest and overturning. Where the path without
noise meets an impact, covariance and noise are carried through it by the saltation matrix. Unless that impact is slow,
a node's displacement at it is then carried on by an expansion about that path, with an error of third order in the
displacement; what noise acts between the node's own impact and that of the path is counted on the side of the latter.
Where no node can meet an event the nodes are those of affine flight.

Noise moves an exact block by the part κ cos φ of it, here taken half way along a flight. Next to x = 0 the nodes of an
exact block follow an equivalent slender one in other units (`_contact_equivalent`); what this leaves out is taken along
the path without noise. Of unequal sides they follow the block itself. A path with the noise in the forcing of the exact
equation needs no part: that has it.

The impact law is `physics.motion.impact`. It is applied here along a path by `advance_through_events` and
`advance_collocated`, and by an expansion about a path in `_through_fast_impact`. Elsewhere in the density solver only
a block that filtered noise lifts off meets impacts: `density.filtered.advance_from_rest`.
"""

import math
from typing import NamedTuple

import numpy as np

from fpk_rocking.base.arrays import borrowed
from fpk_rocking.base.jit import kernel
from fpk_rocking.density.step import Exit
from fpk_rocking.density.tuning import TUNING
from fpk_rocking.physics.motion import TERMS
from fpk_rocking.physics.motion.collocation import advance_collocated
from fpk_rocking.physics.motion.equation import (
    KernelBlock,
    acceleration,
    dispatch_on_block,
    dispatch_on_sides,
    force_factor,
    lift_off_level,
    move_origin,
    restitution_from,
    segment_from_particular,
    value_and_slope,
)
from fpk_rocking.physics.motion.events import (
    CHATTER_TIME,
    Event,
    advance_through_events,
    can_lift_off,
    folded_angle_bounds,
    next_event,
    surely_eventless,
)
from fpk_rocking.physics.motion.flight import flight_covariance, flight_end
from fpk_rocking.physics.motion.impact import covariance_through_impact, displacement_through_impact, linearize_impact


class Noise(NamedTuple):
    """The noise of a step, and the Gauss-Hermite nodes that represent it; nondimensional."""

    duration: float
    diffusion: float
    nodes: np.ndarray  # (n, 2), along the long and the short axis, in standard deviations
    offsets: np.ndarray  # (n, 2), the same as offsets in angle and velocity of an undisturbed flight
    margin: float  # largest offset in angle


@kernel
def principal_axes(xx, xv, vv):
    """Return (long x, long v, short x, short v), principal axes of a covariance, a standard deviation long."""
    mean, difference = 0.5 * (xx + vv), 0.5 * (xx - vv)
    radius = math.hypot(difference, xv)
    long = mean + radius
    short = max(xx * vv - xv * xv, 0.0) / long if long > 0.0 else 0.0
    angle = 0.5 * math.atan2(xv, difference)
    c, s = math.cos(angle), math.sin(angle)
    a, b = math.sqrt(long), math.sqrt(short)
    return a * c, a * s, -b * s, b * c


@kernel
def add_path_correction(particular, duration, dx, dv, out):
    """Write the coefficients (TERMS,) of P, `particular`, plus the cubic from rest to (dx, dv) in a duration."""
    for k in range(TERMS):
        out[k] = particular[k]
    out[2] += (3.0 * dx - duration * dv) / (duration * duration)
    out[3] += (duration * dv - 2.0 * dx) / (duration * duration * duration)


@kernel
def _advance(x, v, side, segment, end, slow, block, critical_angle, start=0.0):
    """Return (x, v, side, time) at an `end` within a forcing, or where the path overturns, through impacts and rest.

    It begins at (x, v) on a side (±1, 0 at rest) at `start`; chatter of a time up to `slow` is summed. An exact block
    is followed by collocation where it cannot overturn.
    """
    if critical_angle is not None:  # numba leaves the branch out for an argument of type None
        low, high, duration = segment.force_low, segment.force_high, end - start
        # A bound without sines first: on this side of the cut-off u'' is less than that angle and the force together.
        rise = block.cutoff + max(high, -low)
        most = side * (x + duration * v) + 0.5 * rise * duration * duration
        if most >= block.cutoff:
            _, most = folded_angle_bounds(side * x, side * v, side, low, high, duration, block)
        if side != 0 and most < block.cutoff:
            return advance_collocated(segment.force, end, x, v, side, start, end, block, None, 0.0, slow)
    return advance_through_events(x, v, side, segment, start, end, block, None, 0.0, slow)


@kernel
def trace_point(x, v, side, segment, block, noise, scratch, ends, flags):
    """Write the ends of the characteristics of a point (x, v) on a side to `ends` (n, 2), for n nodes of the noise.

    `flags` (n,) receive the side at the end, or the `Exit` of a path that overturned, or that rests without noise;
    `scratch` (4, TERMS) is overwritten.
    """
    duration, nodes, offsets, cutoff = noise.duration, noise.nodes, noise.offsets, block.cutoff
    low, high = segment.force_low, segment.force_high
    kind, time, end, speed = next_event(x, v, side, segment, 0.0, duration, block)
    quiet = noise.diffusion == 0.0 or surely_eventless(
        side * x, side * end, side, low, high, duration, block, noise.margin
    )
    if kind == Event.NONE and quiet:
        part = force_factor(0.5 * side * (x + end), side, block)
        for n in range(len(nodes)):
            ends[n, 0], ends[n, 1] = end + part * offsets[n, 0], speed + part * offsets[n, 1]
            flags[n] = side
        return
    if (
        kind == Event.OVERTURNING
        and side * flight_end(x, v, side, segment, 0.0, duration, block)[0] > cutoff + noise.margin
    ):
        flags[:] = _overturned(side)
        return
    spread = math.sqrt(2.0 * noise.diffusion * duration)
    still, inside = spread == 0.0, min(time, duration - time) > 1e-6 * duration
    if kind == Event.IMPACT and inside and not still and abs(speed) > TUNING.linear_impact * spread:
        smooth = abs(speed) > TUNING.smooth_impact * spread
        _through_fast_impact(x, v, (time, speed, side, smooth), segment, block, noise, scratch, ends, flags)
        return
    if kind == Event.IMPACT and noise.diffusion >= TUNING.strong_diffusion:
        _kicks_within(x, v, side, segment, block, noise, ends, flags)
        return
    force = value_and_slope(segment.force, time)[0]
    if still or (kind == Event.IMPACT and not can_lift_off(force, force, block)):
        _split_kicks(x, v, side, math.sqrt(noise.diffusion * duration), still, segment, block, noise, ends, flags)
        return
    _near_contact(x, v, (end, time, side), segment, noise, scratch, ends, flags, block)


@kernel(inline="always")
def _near_contact_of_equal_sides(x, v, undisturbed, segment, noise, scratch, ends, flags, block):
    """Write the ends of the nodes of a point (x, v) of a block of equal sides next to x = 0 or the cut-off.

    `undisturbed` is (angle, time, side): angle and time of the end of the path without noise, and its side before.
    """
    end, time, side = undisturbed
    duration, offsets = noise.duration, noise.offsets
    unit, near, particular = _contact_equivalent(x, end, time, side, segment, duration, scratch[2], block)
    part = force_factor(0.5 * side * (x + end), side, block) / unit
    for n in range(len(offsets)):
        add_path_correction(particular, duration, part * offsets[n, 0], part * offsets[n, 1], scratch[0])
        path = borrowed(segment_from_particular(scratch[0], scratch[1], duration))
        xn, vn, sn, _ = advance_through_events(
            x / unit, v / unit, side, path, 0.0, duration, near, None, 0.0, CHATTER_TIME
        )
        write_end(n, xn, vn, sn, side, near.cutoff, ends, flags)
        ends[n, 0] *= unit
        ends[n, 1] *= unit


@kernel(inline="always")
def _near_contact_of_unequal_sides(x, v, undisturbed, segment, noise, scratch, ends, flags, block):
    """Write the same ends for a block of unequal sides."""
    # No slender block has two units: each node is a path of the block itself with the noise in its forcing.
    side, duration, offsets = undisturbed[2], noise.duration, noise.offsets
    for n in range(len(offsets)):
        add_path_correction(segment.particular, duration, offsets[n, 0], offsets[n, 1], scratch[0])
        path = borrowed(segment_from_particular(scratch[0], scratch[1], duration))
        xn, vn, sn, _ = _advance(x, v, side, path, duration, CHATTER_TIME, block, block.critical_angle)
        write_end(n, xn, vn, sn, side, block.cutoff, ends, flags)


_near_contact = dispatch_on_sides(_near_contact_of_equal_sides, _near_contact_of_unequal_sides)
"""Write the ends of the nodes of a point next to x = 0 or the cut-off."""


@kernel(inline="always")
def _contact_equivalent_slender(_x, _end, _time, _side, segment, _duration, _out, block):
    """Return (unit, block, particular) of a slender block: itself."""
    return 1.0, block, segment.particular


@kernel(inline="always")
def _contact_equivalent_exact(x, end, time, side, segment, duration, out, block):
    """Return (unit, block, particular) of a slender block that moves as an exact one, see below; P goes to `out`."""
    alpha = block.critical_angle
    unit, level = math.sin(alpha) / alpha, lift_off_level(side, block)
    first = _excess_acceleration(x, side, segment.force[0], unit, block)
    last = _excess_acceleration(end, side, value_and_slope(segment.force, time)[0], unit, block)
    for k in range(TERMS):
        out[k] = segment.particular[k] / level
    out[0] -= first / unit
    out[1] -= (last - first) / (unit * duration)
    return unit, KernelBlock(block.restitution, block.cutoff / unit, None, None, None), out


_contact_equivalent = dispatch_on_block(_contact_equivalent_slender, _contact_equivalent_exact)
"""Unit of angle and velocity, the slender block that moves as a block does next to x = 0, and its particular solution.

At x = 0 an exact block is pulled back by (sin α/α)(1 - s f/F) under the lift-off force F: it is a slender one under
f/F, in units of sin α/α. What acceleration it has beyond that elsewhere is taken as linear in time along the path
without noise, from its begin to its `end` at a `time`.
"""


@kernel(inline="always")
def _excess_acceleration(x, side, force, unit, block):
    """Return the acceleration of an exact block at angle x less that of its slender equivalent next to x = 0."""
    return side * acceleration(side * x, side, force, block) - (
        x - side * unit + force * math.cos(block.critical_angle)
    )


@kernel
def _split_kicks(x, v, side, half, rests, segment, block, noise, ends, flags):
    """Write the ends of paths from (x, v) whose noise is two kicks of the velocity, first and last.

    A kick is a node times `half`, sqrt(D duration), and the flight between is without noise. The last kick sets a block
    off from rest unless it `rests`. Nodes of the same first kick follow each other.
    """
    nodes, duration = noise.nodes, noise.duration
    xn, vn, sn, part = x, v, side, force_factor(side * x, side, block)
    for n in range(len(nodes)):
        if n == 0 or nodes[n, 0] != nodes[n - 1, 0]:
            first = half * nodes[n, 0] * part
            xn, vn, sn, _ = _advance(
                x, v + first, side, segment, duration, TUNING.chatter * duration, block, block.critical_angle
            )
        vl, sl = vn, sn
        if abs(xn) < block.cutoff:
            kicked = sn if sn != 0 else (1 if nodes[n, 1] > 0.0 else -1)
            vl += half * nodes[n, 1] * force_factor(abs(xn), kicked, block)
            if xn == 0.0 and not rests:
                sl = 1 if vl > 0.0 else -1
        write_end(n, xn, vl, sl, Exit.REST if rests else side, block.cutoff, ends, flags)


@kernel
def _kicks_within(x, v, side, segment, block, noise, ends, flags):
    """Write the ends of paths from (x, v) whose noise is two kicks of the velocity, at the Gauss points of the step.

    A kick is a node times sqrt(D duration): the covariance of a flight is that of the noise to order 5 in the duration.
    Nodes of the same first kick follow each other.
    """
    nodes, duration = noise.nodes, noise.duration
    size, early = math.sqrt(noise.diffusion * duration), duration * (0.5 - math.sqrt(1.0 / 12.0))
    late, angle = duration - early, block.critical_angle
    x1, v1, s1, _ = _advance(x, v, side, segment, early, CHATTER_TIME, block, angle)
    x2, v2, s2 = x1, v1, s1
    for n in range(len(nodes)):
        if abs(x1) < block.cutoff and (n == 0 or nodes[n, 0] != nodes[n - 1, 0]):
            kicked, s2 = _kick(x1, v1, s1, size * nodes[n, 0], block)
            x2, v2, s2, _ = _advance(x1, kicked, s2, segment, late, CHATTER_TIME, block, angle, early)
        xn, vn, sn = x2, v2, s2
        if abs(x2) < block.cutoff:
            kicked, sn = _kick(x2, v2, s2, size * nodes[n, 1], block)
            xn, vn, sn, _ = _advance(x2, kicked, sn, segment, duration, CHATTER_TIME, block, angle, late)
        write_end(n, xn, vn, sn, side, block.cutoff, ends, flags)


@kernel(inline="always")
def _kick(x, v, side, kick, block):
    """Return (v, side) after a kick of the velocity; at x = 0 the block leaves to the side of its velocity."""
    toward = side if side != 0 else (1 if kick > 0.0 else -1)
    v += kick * force_factor(abs(x), toward, block)
    return v, (1 if v > 0.0 else -1) if x == 0.0 else side


@kernel
def _overturned(side):
    """Return the `Exit` of a path that overturns to a side."""
    return Exit.OVERTURNED_LEFT if side < 0 else Exit.OVERTURNED_RIGHT


@kernel
def write_end(n, x, v, side, if_rest, cutoff, ends, flags):
    """Write row n of `ends` (nodes, 2) and of `flags` (nodes,), side or `Exit`; `if_rest` is that of side 0."""
    ends[n, 0], ends[n, 1] = x, v
    flags[n] = if_rest if side == 0 else side
    if abs(x) >= cutoff:
        flags[n] = _overturned(side)


@kernel
def _through_fast_impact(x, v, undisturbed, segment, block, noise, scratch, ends, flags):
    """Write the ends of the nodes of a point (x, v) whose path without noise meets a fast impact.

    `undisturbed` is (time, velocity, side, smooth): those of the impact, before it, and whether it is so fast that what
    noise changes is smooth: then one expansion serves all nodes that arrive within the step.
    """
    time, speed, side, smooth = undisturbed
    duration, cutoff = noise.duration, block.cutoff
    late, rest = scratch[2], duration - time
    force, slope = value_and_slope(segment.force, time)
    met = linearize_impact(speed, side, force, slope, block)
    kind, _, far_x, far_v = next_event(0.0, met.leaving, -side, segment, time, duration, block)
    restitution = restitution_from(side, block)
    before, after = force_factor(0.5 * side * x, side, block), force_factor(0.5 * abs(far_x), -side, block)
    diffusions = noise.diffusion * before * before, noise.diffusion * after * after
    final, early, (b11, b12, b21, b22) = covariance_through_impact(diffusions, time, rest, met, restitution)
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
            dx, dv, inside = displacement_through_impact(early_x, early_v, time, rest, met, restitution)
            xn = far_x + dx + late_x
            if inside and 0.0 < -side * xn < cutoff:
                write_end(n, xn, far_v + dv + late_v, -side, -side, cutoff, ends, flags)
                continue
        add_path_correction(segment.particular, time, early_x / before, early_v / before, scratch[0])
        path = borrowed(segment_from_particular(scratch[0], scratch[1], time))
        xn, vn, sn, end = _advance(x, v, side, path, time, CHATTER_TIME, block, block.critical_angle)
        if end == time:
            add_path_correction(late, rest, late_x / after, late_v / after, scratch[3])
            path = borrowed(segment_from_particular(scratch[3], scratch[1], rest))
            xn, vn, sn, _ = _advance(xn, vn, sn, path, rest, CHATTER_TIME, block, block.critical_angle)
        write_end(n, xn, vn, sn, side, cutoff, ends, flags)
