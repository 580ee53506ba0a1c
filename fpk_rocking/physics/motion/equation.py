"""The equation of motion on the side s = ±1, for slender and for exact blocks: accelerations and their bounds.

    exact      x'' = -s sin φ/α + f cos φ,  φ = α (1 - s x),  with the critical angle α
    slender    x'' = x - s + f,  its limit α → 0

Folded, u = s x >= 0 is the angle, w = s v the velocity and s f the force. Each function has a slender and an exact
form, and kernels are compiled for the one or the other: the slender form has no sine and cosine, and follows from the
exact one only in the limit of a division by α. All quantities are nondimensional.
"""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

from numba import types
from numba.extending import overload

from fpk_rocking.base.jit import kernel
from fpk_rocking.physics.motion import LIFT_OFF


class Body(NamedTuple):
    """A block as kernels take it: restitution e, and the angle whose first passage is overturning.

    `critical_angle` is α, radians, for the exact equation of motion, and None for that of a slender block. Kernels are
    compiled for the one or the other.
    """

    restitution: float
    cutoff: float
    critical_angle: float | None = None


def block_of_scene(scene: Any) -> Body:
    """Return the `Body` of a scene's block and overturning angle; a critical angle of 0 becomes None."""
    return Body(scene.block.restitution, scene.overturning.angle, scene.block.critical_angle or None)


def dispatch_on_block(slender: Callable[..., Any], exact: Callable[..., Any]) -> Callable[..., Any]:
    """Return one function of two kernels with the same arguments, of which the last is the `Body`.

    It calls `slender` where the body's critical angle is None, else `exact`; in a compiled kernel the type decides
    that.
    """

    def either(*arguments):
        """Call the kernel for the `Body`, the last argument, from Python."""
        return (slender if arguments[-1].critical_angle is None else exact)(*arguments)

    @overload(either, strict=False, inline="always")
    def _(*arguments):
        angle = arguments[-1].types[Body._fields.index("critical_angle")]
        chosen: Any = slender if isinstance(angle, types.NoneType) else exact
        return chosen.py_func

    return either


# Arguments that one of two forms does not use are there for the other.
# ruff: noqa: ARG001


@kernel(inline="always")
def slender_acceleration(u, side, force, block):
    """Folded acceleration u'' = u - 1 + s f, at the folded angle u under the force f; `block` is not used."""
    return u - 1.0 + side * force


@kernel(inline="always")
def _exact_acceleration(u, side, force, block):
    """Folded acceleration u'' = -sin φ/α + s f cos φ of a `Body`, at the folded angle u under the force f."""
    phi = block.critical_angle * (1.0 - u)
    return side * force * math.cos(phi) - math.sin(phi) / block.critical_angle


@kernel(inline="always")
def _slender_force_factor(u, block):
    """Factor of the force, and of noise, in u'': 1; neither argument is used."""
    return 1.0


@kernel(inline="always")
def _exact_force_factor(u, block):
    """Factor of the force, and of noise, in u'' of a `Body` at the folded angle u: cos φ."""
    return math.cos(block.critical_angle * (1.0 - u))


@kernel(inline="always")
def _slender_acceleration_gradient(u, side, force, block):
    """Change of u'' with u: 1; no argument is used."""
    return 1.0


@kernel(inline="always")
def _exact_acceleration_gradient(u, side, force, block):
    """Change of u'' of a `Body` with u, at the folded angle u under the force f: cos φ + s f α sin φ."""
    phi = block.critical_angle * (1.0 - u)
    return math.cos(phi) + side * force * block.critical_angle * math.sin(phi)


@kernel(inline="always")
def _slender_lift_off_level(block):
    """Largest |f| under which a slender block at rest stays; `block` is not used."""
    return LIFT_OFF


@kernel(inline="always")
def _exact_lift_off_level(block):
    """Largest |f| under which a `Body` at rest stays: tan(α)/α."""
    return math.tan(block.critical_angle) / block.critical_angle


@kernel(inline="always")
def slender_acceleration_bounds(side, low, high, block):
    """Bounds of -u'' and of u'' on the side s, from x = 0 to the cut-off of a `Body`.

    `low` and `high` bound f.
    """
    if side > 0:
        return 1.0 - low, block.cutoff - 1.0 + high
    return 1.0 + high, block.cutoff - 1.0 - low


@kernel(inline="always")
def _exact_acceleration_bounds(side, low, high, block):
    """Bounds of -u'' and of u'' on the side s, from x = 0 to the cut-off of a `Body`.

    `low` and `high` bound f.
    """
    alpha, over = block.critical_angle, block.critical_angle * (block.cutoff - 1.0)
    least = min(math.cos(alpha), math.cos(over))
    if side < 0:
        low, high = -high, -low
    weakest, strongest = min(low, low * least), max(high, high * least)
    return math.sin(alpha) / alpha - weakest, math.sin(over) / alpha + strongest


acceleration = dispatch_on_block(slender_acceleration, _exact_acceleration)
force_factor = dispatch_on_block(_slender_force_factor, _exact_force_factor)
acceleration_gradient = dispatch_on_block(_slender_acceleration_gradient, _exact_acceleration_gradient)
lift_off_level = dispatch_on_block(_slender_lift_off_level, _exact_lift_off_level)
acceleration_bounds = dispatch_on_block(slender_acceleration_bounds, _exact_acceleration_bounds)
