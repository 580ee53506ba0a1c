"""The equation of motion on the side s = ±1, for slender and for exact blocks, and the force over a segment of time.

    exact      x'' = κ (-s sin φ/α + f cos φ),  φ = α (m - s x),  with the critical angle α
    slender    x'' = x - s + f,  its limit α → 0

m = κ = 1 but for a block of unequal sides: its centre of mass is over the corner of a side at the angle m, the *saddle*
of that side, and κ is (p_s/p)², by the frequency parameter p_s of the side (docs/theory).

Folded, u = s x >= 0 is the angle, w = s v the velocity and s f the force. Each function has a slender and an exact
form, and kernels are compiled for the one or the other: the slender form has no sine and cosine, and follows from the
exact one only in the limit of a division by α. Of equal sides m and κ are constants. All quantities are nondimensional.

With a particular solution P of P'' = P + f a flight of a slender block is s + P and two exponentials, and f = P'' - P.
Kinds of forcing and noise differ in the coefficients of P alone: TERMS of them, in the time since some instant.
"""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numba import types
from numba.extending import overload

from fpk_rocking.base.jit import kernel
from fpk_rocking.physics.motion import LIFT_OFF, TERMS


class UnequalSides(NamedTuple):
    """What differs by side: saddle m, scale κ of the acceleration, restitution e of an impact that leaves the side.

    Each is a pair (left, right), nondimensional. At the saddle, the folded angle m, the centre of mass is over the
    corner.
    """

    saddle: tuple[float, float]
    scale: tuple[float, float]
    restitution: tuple[float, float]


class KernelBlock(NamedTuple):
    """A block as kernels take it: restitution e, and the angle whose first passage is overturning, nondimensional.

    `critical_angle` is α, radians, for the exact equation of motion, and None for that of a slender block. `sides` are
    those of a block that is not symmetric: its `restitution` is None. Kernels are compiled for each of these kinds.
    """

    restitution: float | None
    cutoff: float
    critical_angle: float | None = None
    sides: UnequalSides | None = None

    @property
    def saddles(self) -> tuple[float, float]:
        """Saddles m, (left, right): the |x| of unstable balance of each side, nondimensional."""
        return self.sides.saddle if self.sides else (1.0, 1.0)

    @property
    def scales(self) -> tuple[float, float]:
        """Scales κ, (left, right): factors of the acceleration on each side, nondimensional."""
        return self.sides.scale if self.sides else (1.0, 1.0)


def block_of_scene(scene: Any) -> KernelBlock:
    """Return the named tuple `KernelBlock` of the block and the overturning angle of `scene`, a `Scene`.

    It has restitution, cutoff, critical angle in radians (None in place of 0), and sides.
    """
    block, cutoff = scene.block, scene.overturning.angle
    if block.symmetric:
        return KernelBlock(block.restitution, cutoff, block.critical_angle or None)
    sides = UnequalSides(block.body.saddles, block.body.acceleration_scales, block.restitution_by_side)
    return KernelBlock(None, cutoff, block.critical_angle, sides)


def dispatch_on_block(slender: Callable[..., Any], exact: Callable[..., Any]) -> Callable[..., Any]:
    """Return one function of two kernels with the same arguments, of which the last is the `KernelBlock`.

    It calls `slender` where the block's critical angle is None, else `exact`; in a compiled kernel the type decides
    that.
    """
    return _dispatch("critical_angle", slender, exact)


def dispatch_on_sides(equal: Callable[..., Any], unequal: Callable[..., Any]) -> Callable[..., Any]:
    """Return one function of two kernels with the same arguments, of which the last is the `KernelBlock`.

    It calls `equal` for a symmetric block, its `sides` being None, else `unequal`.
    """
    return _dispatch("sides", equal, unequal)


def _dispatch(field, without, with_it):
    """Return one function of two kernels with the same arguments, of which the last is the `KernelBlock`.

    It calls `without` where the block's attribute named `field` is None, else `with_it`.
    """

    def either(*arguments):
        """Return what the kernel for the `KernelBlock`, the last argument, gives, from Python."""
        return (without if getattr(arguments[-1], field) is None else with_it)(*arguments)

    @overload(either, strict=False, inline="always")
    def _(*arguments):
        kind = arguments[-1].types[KernelBlock._fields.index(field)]
        chosen: Any = without if isinstance(kind, types.NoneType) else with_it
        return chosen.py_func

    return either


# Arguments that one of two forms does not use are there for the other.
# ruff: noqa: ARG001


@kernel(forceinline=True)
def _of_side(pair, side):
    """Return the number of `side` from `pair`, (left, right): the right one for 1, the left one for -1."""
    return pair[1] if side > 0 else pair[0]


@kernel(inline="always")
def _equal_saddle(side, block):
    """Return 1.0, the folded angle at which a symmetric block balances on its corner; no argument is used."""
    return 1.0


@kernel(inline="always")
def _unequal_saddle(side, block):
    """Return m, the folded angle at which a `KernelBlock`'s centre of mass is over the corner of `side`, 1 or -1."""
    return _of_side(block.sides.saddle, side)


@kernel(inline="always")
def _equal_scale(side, block):
    """Return 1.0, the factor κ of the acceleration of a symmetric block; no argument is used."""
    return 1.0


@kernel(inline="always")
def _unequal_scale(side, block):
    """Return κ, the factor of the acceleration of a `KernelBlock` on `side`, 1 or -1."""
    return _of_side(block.sides.scale, side)


@kernel(inline="always")
def _equal_restitution(side, block):
    """Return the restitution e, 0 to 1, of a symmetric `KernelBlock`; `side` is not used."""
    return block.restitution


@kernel(inline="always")
def _unequal_restitution(side, block):
    """Return the restitution e, 0 to 1, of a `KernelBlock` at an impact that leaves `side`, 1 or -1."""
    return _of_side(block.sides.restitution, side)


saddle = dispatch_on_sides(_equal_saddle, _unequal_saddle)
acceleration_scale = dispatch_on_sides(_equal_scale, _unequal_scale)
restitution_from = dispatch_on_sides(_equal_restitution, _unequal_restitution)


@kernel(inline="always")
def slender_acceleration(u, side, force, block):
    """Return the folded acceleration u'' = u - 1 + s f at the folded angle u = s x, a float, nondimensional.

    `side` is s, +1 or -1, and `force` is f; `block` is not used.
    """
    return u - 1.0 + side * force


@kernel(inline="always")
def _exact_acceleration(u, side, force, block):
    """Return the folded acceleration u'' = κ (-sin φ/α + s f cos φ) at the folded angle u = s x, nondimensional.

    `side` is s, +1 or -1, and `force` is f; `block` is a `KernelBlock` with α, and φ = α (m - u).
    """
    phi = block.critical_angle * (saddle(side, block) - u)
    pull = side * force * math.cos(phi) - math.sin(phi) / block.critical_angle
    return acceleration_scale(side, block) * pull


@kernel(inline="always")
def _slender_force_factor(u, side, block):
    """Return 1.0, the factor of the force, and of noise, in u'' of a slender block; no argument is used."""
    return 1.0


@kernel(inline="always")
def _exact_force_factor(u, side, block):
    """Return κ cos φ, the factor of the force, and of noise, in u'' at the folded angle u = s x; nondimensional.

    `side` is s, +1 or -1; `block` is a `KernelBlock` with α, and φ = α (m - u).
    """
    return acceleration_scale(side, block) * math.cos(block.critical_angle * (saddle(side, block) - u))


@kernel(inline="always")
def _slender_acceleration_gradient(u, side, force, block):
    """Return 1.0, the derivative of u'' by the folded angle u of a slender block; no argument is used."""
    return 1.0


@kernel(inline="always")
def _exact_acceleration_gradient(u, side, force, block):
    """Return the derivative of u'' by the folded angle u = s x: κ (cos φ + s f α sin φ), a float, nondimensional.

    `side` is s, +1 or -1, and `force` is f; `block` is a `KernelBlock` with α, and φ = α (m - u).
    """
    phi = block.critical_angle * (saddle(side, block) - u)
    gradient = math.cos(phi) + side * force * block.critical_angle * math.sin(phi)
    return acceleration_scale(side, block) * gradient


@kernel(inline="always")
def _slender_lift_off_level(side, block):
    """Return 1.0, the largest s f under which a slender block at rest stays; no argument is used."""
    return LIFT_OFF


@kernel(inline="always")
def _exact_lift_off_level(side, block):
    """Return the largest s f under which a `KernelBlock` at rest does not lift off to `side`, s = ±1: tan(m α)/α."""
    return math.tan(block.critical_angle * saddle(side, block)) / block.critical_angle


@kernel(inline="always")
def slender_acceleration_bounds(side, low, high, block):
    """Return (fall, rise), bounds of -u'' and of u'' of a slender block, from x = 0 to the cut-off; nondimensional.

    u = s x is the folded angle on `side`, s = ±1; `low` and `high` bound f; `block` is the `KernelBlock`.
    """
    if side > 0:
        return 1.0 - low, block.cutoff - 1.0 + high
    return 1.0 + high, block.cutoff - 1.0 - low


@kernel(inline="always")
def _exact_acceleration_bounds(side, low, high, block):
    """Return (fall, rise), bounds of -u'' and of u'' of an exact block, from x = 0 to the cut-off; nondimensional.

    u = s x is the folded angle on `side`, s = ±1; `low` and `high` bound f; `block` is the `KernelBlock`.
    """
    alpha, middle, scale = block.critical_angle, saddle(side, block), acceleration_scale(side, block)
    begin, over = alpha * middle, alpha * (block.cutoff - middle)
    least = min(math.cos(begin), math.cos(over))
    if side < 0:
        low, high = -high, -low
    weakest, strongest = min(low, low * least), max(high, high * least)
    return scale * (math.sin(begin) / alpha - weakest), scale * (math.sin(over) / alpha + strongest)


acceleration = dispatch_on_block(slender_acceleration, _exact_acceleration)
force_factor = dispatch_on_block(_slender_force_factor, _exact_force_factor)
acceleration_gradient = dispatch_on_block(_slender_acceleration_gradient, _exact_acceleration_gradient)
lift_off_level = dispatch_on_block(_slender_lift_off_level, _exact_lift_off_level)
acceleration_bounds = dispatch_on_block(slender_acceleration_bounds, _exact_acceleration_bounds)


class Segment(NamedTuple):
    """Forcing over one segment of time, as a flight of a block needs it; nondimensional.

    `particular` and `force` are coefficients (TERMS,) of P and of f = P'' - P in the time since the segment's start,
    lowest power first; `force_low`, `force_high` bound f and `force_curvature` bounds |f''| over the segment.
    """

    particular: np.ndarray
    force: np.ndarray
    force_low: float
    force_high: float
    force_curvature: float


@kernel
def force_bounds_over(force, duration):
    """Return (low, high, curvature), bounds of f and of |f''|, for times from -`duration` to `duration`.

    `force` (TERMS,) are the coefficients of f, a polynomial of time, lowest power first.
    """
    spread, curvature, power = 0.0, 0.0, 1.0
    for k in range(1, TERMS):
        if k >= 2:
            curvature += k * (k - 1) * abs(force[k]) * power / duration
        power *= duration
        spread += abs(force[k]) * power
    return force[0] - spread, force[0] + spread, curvature


@kernel
def force_from_particular(particular, duration, force):
    """Write the coefficients of f = P'' - P to `force` (TERMS,); return (low, high, curvature), bounds of f and |f''|.

    `particular` (TERMS,) are the coefficients of P, lowest power first; the bounds hold for times from -`duration` to
    `duration`.
    """
    for k in range(TERMS):
        force[k] = -particular[k]
        if k + 2 < TERMS:
            force[k] += (k + 2) * (k + 1) * particular[k + 2]
    return force_bounds_over(force, duration)


@kernel
def force_bounds(particular, duration, low, high):
    """Write bounds of n forces f = P'' - P below, to `low` (n,), and above, to `high` (n,).

    `particular` (n, TERMS) are the coefficients of P of each, lowest power first; the bounds hold for times from
    -`duration` to `duration`.
    """
    scratch = np.empty(TERMS)
    for i in range(low.size):
        low[i], high[i], _ = force_from_particular(particular[i], duration, scratch)


@kernel(inline="always")
def segment_from_force(force, duration):
    """Return the named tuple `Segment` (coefficients, bounds of f and |f''|) of a force alone, for an exact block.

    `force` (TERMS,) are the coefficients of f, lowest power first; they stand in the place of P too, which an exact
    block does not use. The bounds hold for times from -`duration` to `duration`.
    """
    return Segment(force, force, *force_bounds_over(force, duration))


@kernel(inline="always")
def segment_from_particular(particular, force, duration):
    """Return the named tuple `Segment` (coefficients of P and f, bounds of f and |f''|) of f = P'' - P.

    `particular` (TERMS,) are the coefficients of P, lowest power first. Those of f are written to `force` (TERMS,),
    which the segment keeps. The bounds hold for times from -`duration` to `duration`. The segment hands on arrays, so
    this is made a part of every kernel that calls it: some count references, some borrow.
    """
    return Segment(particular, force, *force_from_particular(particular, duration, force))


@kernel
def particular_from_rest(force, particular):
    """Write to `particular` (TERMS,) the coefficients of the solution of P'' = P + f with P = P' = 0 at the time 0.

    `force` (TERMS,) are those of f, a polynomial of time; lowest power first.
    """
    particular[0], particular[1] = 0.0, 0.0
    for k in range(TERMS - 2):
        particular[k + 2] = (particular[k] + force[k]) / ((k + 1) * (k + 2))


@kernel
def move_origin(coefficients, t, out):
    """Write to `out` (TERMS,) the coefficients of a polynomial in the time since t; lowest power first.

    `coefficients` (TERMS,) are those of the same polynomial in the time since 0.
    """
    for k in range(TERMS):
        out[k] = coefficients[k]
    for k in range(TERMS - 1 if t != 0.0 else 0):
        for i in range(TERMS - 2, k - 1, -1):
            out[i] += t * out[i + 1]


@kernel(fastmath={"contract"})
def value_and_slope(coefficients, t):
    """Return (value, derivative) at t of the polynomial with `coefficients` (TERMS,), lowest power first.

    Even and odd powers are summed apart, for speed.
    """
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
    """Return the least time in which a gap >= 0 can close, a float, or inf; all nondimensional.

    `gap` is its size, `slope` its derivative at the begin; -`curvature` bounds its second derivative from below.
    """
    discriminant = slope * slope + 2.0 * curvature * gap
    if discriminant < 0.0:
        return math.inf
    root = math.sqrt(discriminant)
    if slope < 0.0:
        return 2.0 * gap / (root - slope)
    if curvature <= 0.0:
        return math.inf
    return (slope + root) / curvature
