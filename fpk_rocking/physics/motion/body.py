"""A block in the numbers that kernels need, which decide as it is compiled what its equation of motion is."""

from collections.abc import Callable
from typing import Any, NamedTuple

from numba.core import types
from numba.extending import overload

from fpk_rocking.base.jit import kernel


class Body(NamedTuple):
    """A block in numbers: restitution e, and the angle whose first passage is overturning.

    `critical_angle` is α, radians, for the exact equation of motion, and None for that of a slender block. Kernels are
    compiled for the one or the other.
    """

    restitution: float
    cutoff: float
    critical_angle: float | None = None


def body_of(scene: Any) -> Body:
    """Return what the kernels have to know of a scene's block."""
    return Body(scene.block.restitution, scene.overturning.angle, scene.block.critical_angle or None)


@kernel(inline="always")
def body_in(problem):
    """Return the block of something that has its numbers among others."""
    return Body(problem.restitution, problem.cutoff, problem.critical_angle)


def by_body(slender: Callable[..., Any], exact: Callable[..., Any]) -> Callable[..., Any]:
    """Make one function of two kernels, for slender and for exact blocks; its last argument is the `Body`."""

    def either(*arguments):
        return (slender if arguments[-1].critical_angle is None else exact)(*arguments)

    @overload(either, strict=False, inline="always")
    def _(*arguments):
        angle = arguments[-1].types[Body._fields.index("critical_angle")]
        chosen: Any = slender if isinstance(angle, types.NoneType) else exact
        return chosen.py_func

    return either
