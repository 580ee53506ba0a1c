"""The equation of motion on the side s = ±1, for slender and for exact blocks, and the force over a segment of time.

    exact      x'' = κ (-s G sin φ/α + f cos φ),  φ = α (m - s x),  with the critical angle α
    slender    x'' = x - s + f,  its limit α → 0

m = κ = 1 but for a block of unequal sides: its centre of mass is over the corner of a side at the angle m, the *saddle*
of that side, and κ is (p_s/p)², by the frequency parameter p_s of the side (docs/theory). White noise is
sqrt(2 D) κ cos φ dW. The weight over mg, G = 1 + a_v/g, is 1 unless the base has a vertical acceleration a_v, linear
over a segment of time.

Folded, u = s x >= 0 is the angle, w = s v the velocity and s f the force. Each kernel has a slender and an exact form,
and what calls it is compiled for the one or the other: the slender form has no sine and cosine, and follows from the
exact one only in the limit of a division by α. Of equal sides m and κ are constants. A critical angle of None is a
slender block; that of a base that moves vertically is an exact one of a minute α. All quantities are nondimensional.

With P a flight of a slender block is s + P and two exponentials, and f = P'' - P. Kinds of forcing and noise differ in
the coefficients of P alone: TERMS of them, lowest power first, in the time since some instant.
"""

import functools
import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numba import types
from numba.extending import overload

from fpk_rocking.base.checks import Array, Number
from fpk_rocking.base.jit import kernel
from fpk_rocking.physics.motion import LIFT_OFF, TERMS
from fpk_rocking.physics.motion.slender import ContactLaw


class UnequalSides(NamedTuple):
    """(left, right): saddle m, scale κ of the acceleration, restitution e of an impact that leaves the side."""

    saddle: tuple[float, float]
    scale: tuple[float, float]
    restitution: tuple[float, float]


class Weight(NamedTuple):
    """Weight G over a segment of time: at its start, its slope, and a bound of |G - 1|."""

    start: float = 1.0
    slope: float = 0.0
    sway: float = 0.0


class KernelBlock(NamedTuple):
    """A block as kernels take it: restitution e, and the angle whose first passage is overturning.

    `critical_angle` is α, or None for a slender block. `sides` are those of a block that is not symmetric: its
    `restitution` is None. `weight` is None where the base does not move vertically. Kernels are compiled for each of
    these kinds.
    """

    restitution: float | None
    cutoff: float
    critical_angle: float | None = None
    sides: UnequalSides | None = None
    weight: Weight | None = None

    @property
    def saddles(self) -> tuple[float, float]:
        """Saddles m, (left, right)."""
        return self.sides.saddle if self.sides else (1.0, 1.0)

    @property
    def scales(self) -> tuple[float, float]:
        """Factors κ of the acceleration, (left, right)."""
        return self.sides.scale if self.sides else (1.0, 1.0)


def block_of_scene(scene: Any) -> KernelBlock:
    """Block and overturning angle of a scene."""
    block, cutoff = scene.block, scene.overturning.angle
    weight = None if scene.forcing.vertical is None else Weight()
    if block.symmetric:
        # The square of this angle is below rounding, so that its exact equation is that of a slender block.
        alpha = block.critical_angle or (None if weight is None else 1e-8)
        return KernelBlock(block.restitution, cutoff, alpha, None, weight)
    sides = UnequalSides(block.body.saddles, block.body.acceleration_scales, block.restitution_by_side)
    return KernelBlock(None, cutoff, block.critical_angle, sides, weight)


def _dispatch(field: str, without: Callable[..., Any], with_it: Callable[..., Any]) -> Callable[..., Any]:
    """One function of two kernels: `without` for a block, the last argument, whose `field` is None, else `with_it`."""

    def either(*arguments):
        return (without if getattr(arguments[-1], field) is None else with_it)(*arguments)

    @overload(either, strict=False, inline="always")
    def _(*arguments):
        kind = arguments[-1].types[KernelBlock._fields.index(field)]
        chosen: Any = without if isinstance(kind, types.NoneType) else with_it
        return chosen.py_func

    return either


dispatch_on_block = functools.partial(_dispatch, "critical_angle")
"""One function of the kernels for a slender and for an exact block; in a compiled kernel the block's type decides."""
dispatch_on_sides = functools.partial(_dispatch, "sides")
"""One function of the kernels for a symmetric block and for one of unequal sides."""
dispatch_on_weight = functools.partial(_dispatch, "weight")
"""One function of the kernels for a base that does not move vertically and for one that does."""


# Arguments with an underscore are there for the other form.


@kernel(forceinline=True)
def _of_side(pair, side):
    # A branch in the forms below, which numba inlines itself, would make it warn.
    return pair[1] if side > 0 else pair[0]


@kernel(inline="always")
def _equal_saddle(_side, _block):
    return 1.0


@kernel(inline="always")
def _unequal_saddle(side, block):
    return _of_side(block.sides.saddle, side)


@kernel(inline="always")
def _equal_scale(_side, _block):
    return 1.0


@kernel(inline="always")
def _unequal_scale(side, block):
    return _of_side(block.sides.scale, side)


@kernel(inline="always")
def _equal_restitution(_side, block):
    return block.restitution


@kernel(inline="always")
def _unequal_restitution(side, block):
    return _of_side(block.sides.restitution, side)


saddle = dispatch_on_sides(_equal_saddle, _unequal_saddle)
"""m of a side."""
acceleration_scale = dispatch_on_sides(_equal_scale, _unequal_scale)
"""κ of a side."""
restitution_from = dispatch_on_sides(_equal_restitution, _unequal_restitution)
"""e of an impact that leaves a side."""


@kernel(inline="always")
def _still_weight(_block):
    return Weight(1.0, 0.0, 0.0)


@kernel(inline="always")
def _moving_weight(block):
    return block.weight


@kernel(inline="always")
def _same_block(_time, block):
    return block


@kernel(inline="always")
def _later_block(time, block):
    weight = block.weight
    later = Weight(weight.start + time * weight.slope, weight.slope, weight.sway)
    return KernelBlock(block.restitution, block.cutoff, block.critical_angle, block.sides, later)


@kernel(inline="always")
def _block_of_row(weights, j, block):
    weight = Weight(weights[j, 0], weights[j, 1], weights[j, 2])
    return KernelBlock(block.restitution, block.cutoff, block.critical_angle, block.sides, weight)


@kernel(inline="always")
def _block_of_all(_weights, _j, block):
    return block


weight_of = dispatch_on_weight(_still_weight, _moving_weight)
"""`Weight` of a block: constants where the base does not move vertically, so that they cost nothing."""
inlined_block_at = dispatch_on_weight(_same_block, _later_block)
"""`block_at` in line as text: paths of rk4 are faster by 3 % with it."""
inlined_block_in = dispatch_on_weight(_block_of_all, _block_of_row)
"""`block_in` in line as text."""


# Not in line as text: within another kernel that is so, numba 0.68 then loses the noise of `engines.exact_block`.
@kernel(forceinline=True)
def block_at(time, block):
    """The block whose `weight` starts at a time of the segment."""
    return inlined_block_at(time, block)


@kernel(forceinline=True)
def block_in(weights, j, block):
    """The block with the weight of segment j, by an array (m, 3) of the fields of `Weight`."""
    return inlined_block_in(weights, j, block)


@kernel(inline="always")
def slender_acceleration(u, side, force, _block):
    return u - 1.0 + side * force


@kernel(inline="always")
def _exact_acceleration(u, side, force, block):
    phi = block.critical_angle * (saddle(side, block) - u)
    pull = side * force * math.cos(phi) - weight_of(block).start * math.sin(phi) / block.critical_angle
    return acceleration_scale(side, block) * pull


@kernel(inline="always")
def _slender_force_factor(_u, _side, _block):
    return 1.0


@kernel(inline="always")
def _exact_force_factor(u, side, block):
    return acceleration_scale(side, block) * math.cos(block.critical_angle * (saddle(side, block) - u))


@kernel(inline="always")
def _slender_acceleration_gradient(_u, _side, _force, _block):
    return 1.0


@kernel(inline="always")
def _exact_acceleration_gradient(u, side, force, block):
    phi = block.critical_angle * (saddle(side, block) - u)
    gradient = weight_of(block).start * math.cos(phi) + side * force * block.critical_angle * math.sin(phi)
    return acceleration_scale(side, block) * gradient


@kernel(inline="always")
def _slender_lift_off_level(_side, _block):
    return LIFT_OFF


@kernel(inline="always")
def _exact_lift_off_level(side, block):
    return math.tan(block.critical_angle * saddle(side, block)) / block.critical_angle


@kernel(inline="always")
def slender_acceleration_bounds(side, low, high, block):
    if side > 0:
        return 1.0 - low, block.cutoff - 1.0 + high
    return 1.0 + high, block.cutoff - 1.0 - low


@kernel(inline="always")
def _exact_acceleration_bounds(side, low, high, block):
    alpha, middle, scale = block.critical_angle, saddle(side, block), acceleration_scale(side, block)
    begin, over = alpha * middle, alpha * (block.cutoff - middle)
    least = min(math.cos(begin), math.cos(over))
    if side < 0:
        low, high = -high, -low
    weakest, strongest = min(low, low * least), max(high, high * least)
    sway = weight_of(block).sway
    if sway != 0.0:
        change = sway * max(math.sin(begin), abs(math.sin(over))) / alpha
        weakest, strongest = weakest - change, strongest + change
    return scale * (math.sin(begin) / alpha - weakest), scale * (math.sin(over) / alpha + strongest)


acceleration = dispatch_on_block(slender_acceleration, _exact_acceleration)
"""u'' at the folded angle u under the force f."""
force_factor = dispatch_on_block(_slender_force_factor, _exact_force_factor)
"""Factor of s f, and of noise, in u''."""
acceleration_gradient = dispatch_on_block(_slender_acceleration_gradient, _exact_acceleration_gradient)
"""Derivative of u'' by u."""
lift_off_level = dispatch_on_block(_slender_lift_off_level, _exact_lift_off_level)
"""Largest s f, over the weight, under which a block at rest stays."""
acceleration_bounds = dispatch_on_block(slender_acceleration_bounds, _exact_acceleration_bounds)
"""(fall, rise): bounds of -u'' and of u'' from x = 0 to the cut-off, for a force from `low` to `high`."""


def gravity_at_contact(critical_angle: float | None, saddle: float = 1.0, scale: float = 1.0) -> float:
    """-u'' at zero angle without a force: κ sin(α m)/α, 1 of a slender block (None or 0)."""
    return scale * math.sin(critical_angle * saddle) / critical_angle if critical_angle else 1.0


def contact_laws(block: KernelBlock) -> dict[int, ContactLaw]:
    """`ContactLaw` by side, -1 and 1."""
    alpha, laws = block.critical_angle or 0.0, {}
    for side, saddle, scale in zip((-1, 1), block.saddles, block.scales, strict=True):
        gravity = gravity_at_contact(alpha, saddle, scale)
        laws[side] = ContactLaw(gravity, scale * math.cos(alpha * saddle), gravity / saddle)
    return laws


def tilt_angle(angles: Array, critical_angle: float, saddle: Number = 1.0) -> Array:
    """φ = α (m - |x|), of the line from the corner to the centre of mass against the vertical."""
    return critical_angle * (saddle - np.abs(angles))


def force_factors(angles: Array, critical_angle: float, saddle: Number = 1.0, scale: Number = 1.0) -> Array:
    """κ cos φ at angles x: the factor with which the base's acceleration, and noise, turn the block."""
    return scale * np.cos(tilt_angle(angles, critical_angle, saddle))


def largest_correction(force: float, critical_angle: float | None, saddle: float = 1.0, scale: float = 1.0) -> float:
    """Bound of what the exact acceleration adds to x - s m + f under |f| <= `force`, up to twice the saddle's angle."""
    if not critical_angle:
        return 0.0
    bent = saddle - gravity_at_contact(critical_angle, saddle) + force * (1.0 - math.cos(critical_angle * saddle))
    return bent + abs(scale - 1.0) * (saddle + force)


def saddle_speed(force: float, critical_angle: float | None, saddle: float = 1.0, scale: float = 1.0) -> float:
    """Speed at zero angle from which a block just reaches the saddle, under a constant `force` s f up to lift-off.

    It is max(1 - s f, 0) for a slender block, and without a force 2 sin(α/2)/α of equal sides: the integral of u'' over
    the angle.
    """
    if not critical_angle:
        return max(1.0 - force, 0.0)
    alpha = critical_angle
    square = math.hypot(1.0, alpha * force) - math.cos(alpha * saddle) - alpha * force * math.sin(alpha * saddle)
    return math.sqrt(2.0 * scale * max(square, 0.0)) / alpha


class Segment(NamedTuple):
    """Forcing over one segment of time, as a flight of a block needs it.

    `particular` and `force` are coefficients (TERMS,) of P and of f in the time since the segment's start;
    `force_low`, `force_high` bound f and `force_curvature` bounds |f''| over the segment.
    """

    particular: np.ndarray
    force: np.ndarray
    force_low: float
    force_high: float
    force_curvature: float


@kernel
def force_bounds_over(force, duration):
    """(low, high, curvature): bounds of f and of |f''| for |t| <= `duration`, by the coefficients (TERMS,) of f."""
    spread, curvature, power = 0.0, 0.0, 1.0
    for k in range(1, TERMS):
        if k >= 2:
            curvature += k * (k - 1) * abs(force[k]) * power / duration
        power *= duration
        spread += abs(force[k]) * power
    return force[0] - spread, force[0] + spread, curvature


@kernel
def force_from_particular(particular, duration, force):
    """Write the coefficients of f = P'' - P to `force` (TERMS,); return what `force_bounds_over` does."""
    for k in range(TERMS):
        force[k] = -particular[k]
        if k + 2 < TERMS:
            force[k] += (k + 2) * (k + 1) * particular[k + 2]
    return force_bounds_over(force, duration)


@kernel
def force_bounds(particular, duration, low, high):
    """Write bounds (n,) of n forces for |t| <= `duration`, by the coefficients (n, TERMS) of P."""
    scratch = np.empty(TERMS)
    for i in range(low.size):
        low[i], high[i], _ = force_from_particular(particular[i], duration, scratch)


@kernel(inline="always")
def segment_from_force(force, duration):
    """`Segment` of an exact block, which does not use P: the coefficients (TERMS,) of f stand in its place."""
    return Segment(force, force, *force_bounds_over(force, duration))


@kernel(inline="always")
def segment_from_particular(particular, force, duration):
    """`Segment` of f = P'' - P, whose coefficients are written to `force` (TERMS,), which the segment keeps.

    It hands on arrays, so it is made a part of every kernel that calls it: some count references, some borrow.
    """
    return Segment(particular, force, *force_from_particular(particular, duration, force))


@kernel
def particular_from_rest(force, particular):
    """Write the coefficients (TERMS,) of the solution of P'' = P + f with P = P' = 0 at the time 0."""
    particular[0], particular[1] = 0.0, 0.0
    for k in range(TERMS - 2):
        particular[k + 2] = (particular[k] + force[k]) / ((k + 1) * (k + 2))


@kernel
def move_origin(coefficients, t, out):
    """Write to `out` (TERMS,) the coefficients in the time since t of a polynomial in the time since 0."""
    for k in range(TERMS):
        out[k] = coefficients[k]
    for k in range(TERMS - 1 if t != 0.0 else 0):
        for i in range(TERMS - 2, k - 1, -1):
            out[i] += t * out[i + 1]


@kernel(fastmath={"contract"})
def value_and_slope(coefficients, t):
    """(value, derivative) of a polynomial (TERMS,); even and odd powers are summed apart, for speed."""
    if t == 0.0:
        return coefficients[0], coefficients[1]
    square = t * t
    even, odd = coefficients[TERMS - 2], coefficients[TERMS - 1]
    even_slope, odd_slope = 0.0, 0.0
    for k in range(TERMS - 4, -1, -2):
        even_slope = even_slope * square + even
        odd_slope = odd_slope * square + odd
        even = even * square + coefficients[k]
        odd = odd * square + coefficients[k + 1]
    return even + t * odd, odd + 2.0 * t * (even_slope + t * odd_slope)


@kernel
def least_closing_time(gap, slope, curvature):
    """Least time, or inf, in which a gap >= 0 closes: `slope` is its derivative, -`curvature` bounds its second one."""
    discriminant = slope * slope + 2.0 * curvature * gap
    if discriminant < 0.0:
        return math.inf
    root = math.sqrt(discriminant)
    if slope < 0.0:
        return 2.0 * gap / (root - slope)
    if curvature <= 0.0:
        return math.inf
    return (slope + root) / curvature
