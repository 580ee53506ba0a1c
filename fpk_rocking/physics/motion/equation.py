"""The equation of motion on the side s = ±1, for slender and for exact blocks: accelerations and their bounds.

    exact      x'' = κ (-s sin φ/α + f cos φ),  φ = α (m - s x),  with the critical angle α
    slender    x'' = x - s + f,  its limit α → 0

m = κ = 1 but for a block of unequal sides: its centre of mass is over the corner of a side at the angle m, the *saddle*
of that side, and κ is (p_s/p)², by the frequency parameter p_s of the side (docs/theory).

Folded, u = s x >= 0 is the angle, w = s v the velocity and s f the force. Each function has a slender and an exact
form, and kernels are compiled for the one or the other: the slender form has no sine and cosine, and follows from the
exact one only in the limit of a division by α. Of equal sides m and κ are constants of the compiled kernel, which cost
nothing. All quantities are nondimensional.
"""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

from numba import types
from numba.extending import overload

from fpk_rocking.base.jit import kernel
from fpk_rocking.physics.motion import LIFT_OFF


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


saddle = _dispatch("sides", _equal_saddle, _unequal_saddle)
acceleration_scale = _dispatch("sides", _equal_scale, _unequal_scale)
restitution_from = _dispatch("sides", _equal_restitution, _unequal_restitution)


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
