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
    """Saddle m, scale κ of the acceleration, and restitution e of an impact that leaves a side: (left, right) each."""

    saddle: tuple[float, float]
    scale: tuple[float, float]
    restitution: tuple[float, float]


class KernelBlock(NamedTuple):
    """A block as kernels take it: restitution e, and the angle whose first passage is overturning.

    `critical_angle` is α, radians, for the exact equation of motion, and None for that of a slender block. `sides` are
    those of a block that is not symmetric: its `restitution` is None. Kernels are compiled for each of these kinds.
    """

    restitution: float | None
    cutoff: float
    critical_angle: float | None = None
    sides: UnequalSides | None = None

    @property
    def saddles(self) -> tuple[float, float]:
        """Saddles m, (left, right)."""
        return self.sides.saddle if self.sides else (1.0, 1.0)

    @property
    def scales(self) -> tuple[float, float]:
        """Scales κ of the acceleration, (left, right)."""
        return self.sides.scale if self.sides else (1.0, 1.0)


def block_of_scene(scene: Any) -> KernelBlock:
    """Return the `KernelBlock` of a scene's block and overturning angle; a critical angle of 0 becomes None."""
    block, cutoff = scene.block, scene.overturning.angle
    if block.symmetric:
        return KernelBlock(block.restitution, cutoff, block.critical_angle or None)
    sides = UnequalSides(block.body.saddles, block.body.acceleration_scales, block.restitution_by_side)
    return KernelBlock(None, cutoff, block.critical_angle, sides)


def dispatch_on_block(slender: Callable[..., Any], exact: Callable[..., Any]) -> Callable[..., Any]:
    """Return one function of two kernels with the same arguments, of which the last is the `KernelBlock`.

    It calls `slender` where the body's critical angle is None, else `exact`; in a compiled kernel the type decides
    that.
    """
    return _dispatch("critical_angle", slender, exact)


def dispatch_on_sides(equal: Callable[..., Any], unequal: Callable[..., Any]) -> Callable[..., Any]:
    """Return one function of two kernels as `dispatch_on_block` does: `unequal` for a block of unequal sides."""
    return _dispatch("sides", equal, unequal)


def _dispatch(field, without, with_it):
    """Return one function of two kernels, the last argument a `KernelBlock`: `without` where its `field` is None."""

    def either(*arguments):
        """Call the kernel for the `KernelBlock`, the last argument, from Python."""
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
    """Return the number of the side s from a `pair`, (left, right)."""
    return pair[1] if side > 0 else pair[0]


@kernel(inline="always")
def _equal_saddle(side, block):
    """Folded angle at which the centre of mass of a symmetric block is over its corner: 1; no argument is used."""
    return 1.0


@kernel(inline="always")
def _unequal_saddle(side, block):
    """Folded angle m at which the centre of mass of a `KernelBlock` is over the corner of the side s."""
    return _of_side(block.sides.saddle, side)


@kernel(inline="always")
def _equal_scale(side, block):
    """Factor κ of the acceleration of a symmetric block: 1; no argument is used."""
    return 1.0


@kernel(inline="always")
def _unequal_scale(side, block):
    """Factor κ of the acceleration of a `KernelBlock` on the side s."""
    return _of_side(block.sides.scale, side)


@kernel(inline="always")
def _equal_restitution(side, block):
    """Restitution of a symmetric `KernelBlock`; `side` is not used."""
    return block.restitution


@kernel(inline="always")
def _unequal_restitution(side, block):
    """Restitution of a `KernelBlock` at an impact that leaves the side s."""
    return _of_side(block.sides.restitution, side)


saddle = dispatch_on_sides(_equal_saddle, _unequal_saddle)
acceleration_scale = dispatch_on_sides(_equal_scale, _unequal_scale)
restitution_from = dispatch_on_sides(_equal_restitution, _unequal_restitution)


@kernel(inline="always")
def slender_acceleration(u, side, force, block):
    """Folded acceleration u'' = u - 1 + s f, at the folded angle u under the force f; `block` is not used."""
    return u - 1.0 + side * force


@kernel(inline="always")
def _exact_acceleration(u, side, force, block):
    """Folded acceleration u'' = κ (-sin φ/α + s f cos φ) of a `KernelBlock`, at folded angle u under the force f."""
    phi = block.critical_angle * (saddle(side, block) - u)
    pull = side * force * math.cos(phi) - math.sin(phi) / block.critical_angle
    return acceleration_scale(side, block) * pull


@kernel(inline="always")
def _slender_force_factor(u, side, block):
    """Factor of the force, and of noise, in u'': 1; no argument is used."""
    return 1.0


@kernel(inline="always")
def _exact_force_factor(u, side, block):
    """Factor of the force, and of noise, in u'' of a `KernelBlock` at the folded angle u on the side s: κ cos φ."""
    return acceleration_scale(side, block) * math.cos(block.critical_angle * (saddle(side, block) - u))


@kernel(inline="always")
def _slender_acceleration_gradient(u, side, force, block):
    """Change of u'' with u: 1; no argument is used."""
    return 1.0


@kernel(inline="always")
def _exact_acceleration_gradient(u, side, force, block):
    """Change of u'' of a `KernelBlock` with u, at the folded angle u under the force f: κ (cos φ + s f α sin φ)."""
    phi = block.critical_angle * (saddle(side, block) - u)
    gradient = math.cos(phi) + side * force * block.critical_angle * math.sin(phi)
    return acceleration_scale(side, block) * gradient


@kernel(inline="always")
def _slender_lift_off_level(side, block):
    """Largest s f under which a slender block at rest does not lift off to the side s; no argument is used."""
    return LIFT_OFF


@kernel(inline="always")
def _exact_lift_off_level(side, block):
    """Largest s f under which a `KernelBlock` at rest does not lift off to the side s: tan(m α)/α."""
    return math.tan(block.critical_angle * saddle(side, block)) / block.critical_angle


@kernel(inline="always")
def slender_acceleration_bounds(side, low, high, block):
    """Bounds of -u'' and of u'' on the side s, from x = 0 to the cut-off of a `KernelBlock`.

    `low` and `high` bound f.
    """
    if side > 0:
        return 1.0 - low, block.cutoff - 1.0 + high
    return 1.0 + high, block.cutoff - 1.0 - low


@kernel(inline="always")
def _exact_acceleration_bounds(side, low, high, block):
    """Bounds of -u'' and of u'' on the side s, from x = 0 to the cut-off of a `KernelBlock`.

    `low` and `high` bound f.
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
    """Forcing over one segment of time, as a flight of a block needs it.

    `particular` and `force` are coefficients (TERMS,) of P and of f = P'' - P in the time since the segment's start;
    `force_low`, `force_high` bound f and `force_curvature` bounds |f''| over the segment.
    """

    particular: np.ndarray
    force: np.ndarray
    force_low: float
    force_high: float
    force_curvature: float


@kernel
def force_bounds_over(force, duration):
    """Return bounds of f below and above, and a bound of |f''|, for times up to `duration` on both sides of 0.

    `force` (TERMS,) are the coefficients of f.
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
    """Write the coefficients of f = P'' - P to `force` (TERMS,); return its bounds, as `force_bounds_over` does.

    `particular` (TERMS,) are the coefficients of P; the bounds hold for times up to `duration` on both sides of 0.
    """
    for k in range(TERMS):
        force[k] = -particular[k]
        if k + 2 < TERMS:
            force[k] += (k + 2) * (k + 1) * particular[k + 2]
    return force_bounds_over(force, duration)


@kernel
def force_bounds(particular, duration, low, high):
    """Write bounds of n forces below, to `low` (n,), and above, to `high` (n,).

    `particular` (n, TERMS) are the coefficients of P of each; the bounds hold for times up to `duration` on both sides
    of 0.
    """
    scratch = np.empty(TERMS)
    for i in range(low.size):
        low[i], high[i], _ = force_from_particular(particular[i], duration, scratch)


@kernel(inline="always")
def segment_from_force(force, duration):
    """Return the `Segment` of a force alone, for an exact block.

    `force` (TERMS,) are the coefficients of f; they stand in the place of P too, which an exact block does not use. The
    bounds hold for times up to `duration` on both sides of 0.
    """
    return Segment(force, force, *force_bounds_over(force, duration))


@kernel(inline="always")
def segment_from_particular(particular, force, duration):
    """Return the `Segment` of P, `particular` (TERMS,), with bounds of f for times up to `duration` on both sides of 0.

    The coefficients of f are written to `force` (TERMS,), which the segment keeps. It hands on arrays, so it is made a
    part of every kernel that calls it: some count references, some borrow.
    """
    return Segment(particular, force, *force_from_particular(particular, duration, force))


@kernel
def particular_from_rest(force, particular):
    """Write to `particular` (TERMS,) the P with P = P' = 0 at the time 0, for a force.

    `force` (TERMS,) are the coefficients of f.
    """
    particular[0], particular[1] = 0.0, 0.0
    for k in range(TERMS - 2):
        particular[k + 2] = (particular[k] + force[k]) / ((k + 1) * (k + 2))


@kernel
def move_origin(coefficients, t, out):
    """Write to `out` (TERMS,) the coefficients, in the time since t, of the polynomial with `coefficients` (TERMS,)."""
    for k in range(TERMS):
        out[k] = coefficients[k]
    for k in range(TERMS - 1 if t != 0.0 else 0):
        for i in range(TERMS - 2, k - 1, -1):
            out[i] += t * out[i + 1]


@kernel(fastmath={"contract"})
def value_and_slope(coefficients, t):
    """Value and derivative at t of the polynomial with coefficients (TERMS,); even and odd powers apart, for speed."""
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
    """Least time in which a gap >= 0 can close, or inf; all nondimensional.

    `slope` is the gap's derivative at the begin; `-curvature` bounds its second derivative from below.
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
