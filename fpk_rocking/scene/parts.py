"""Block, start and overturning of a scene, each checked when it is made.

Its forcings are in `physics.forcing`, its noises in `physics.noise.kinds`.
"""

import dataclasses
import math

from fpk_rocking.base import checks
from fpk_rocking.physics.motion import lift_off
from fpk_rocking.scene.body import Body
from fpk_rocking.scene.units import BlockSize, Dimensions


@dataclasses.dataclass(frozen=True, slots=True)
class Block:
    """A rigid rocking block.

    Parameters
    ----------
    restitution : float or (float, float), optional
        Velocity after an impact over that before it, from 0 to 1 (paper eq. 3). By default it follows from the size,
        `Dimensions.restitution` or `Body.restitution`. Two numbers, of impacts that leave the left side and of those
        that leave the right, are for a body.
    dimensions : Dimensions, optional
        Size of a rectangular block, for conversions to units. A record, a default restitution and a default critical
        angle need it, or a body.
    critical_angle : float, optional
        Critical angle α of the equation of motion, radians, from 0 to π/2. By default that of the size, which a given
        one must match to 1e-3; without a size 0, the limit of a slender block (paper).
    slender : bool
        Take the equation of a slender block in spite of the size: the critical angle is 0. Refused for a body of
        unequal sides.
    body : Body, optional
        Any rigid body on two corners, in place of the dimensions.

    Examples
    --------
    >>> from fpk_rocking import Block, Dimensions
    >>> block = Block(dimensions=Dimensions(width=0.5, height=1.8))
    >>> print(f"{block.restitution:.3f} {block.critical_angle:.3f} {block.least_friction:.3f}")
    0.893 0.271 0.278
    """

    restitution: float | tuple[float, float] = None  # type: ignore[assignment]  # None until it follows from the size
    dimensions: Dimensions | None = None
    critical_angle: float = None  # type: ignore[assignment]  # likewise
    slender: bool = False
    body: Body | None = None

    def __post_init__(self):
        if self.dimensions is not None:
            checks.instance("block.dimensions", self.dimensions, Dimensions)
        if self.body is not None:
            checks.instance("block.body", self.body, Body)
            if self.dimensions is not None:
                raise ValueError(checks.refusal("block.body", self.body, "nothing beside block.dimensions"))
        if self.restitution is None:
            if self.size is None:
                raise ValueError("block.restitution: missing, required without block.dimensions or block.body")
            checks.keep(self, restitution=self.size.restitution)
        checks.keep(self, restitution=_restitution(self.restitution, self.body is not None))
        checks.instance("block.slender", self.slender, bool)
        if self.slender and not self.symmetric:
            accepted = "false for a body of unequal sides, which has no slender equation"
            raise ValueError(checks.refusal("block.slender", self.slender, accepted))
        own = 0.0 if self.size is None or self.slender else self.size.critical_angle
        critical_angle = own if self.critical_angle is None else self.critical_angle
        angle = checks.number("block.critical_angle", critical_angle, at_least=0.0, at_most=0.5 * math.pi)
        # A critical angle that was measured may differ from that of the dimensions by a thousandth of it.
        if angle != own and (self.slender or (self.size and abs(angle - own) > 1e-3 * own)):
            kind = "slender" if self.slender else "dimensions" if self.dimensions else "body"
            accepted = f"{own!r}, as block.{kind} says, or nothing"
            raise ValueError(checks.refusal("block.critical_angle", angle, accepted))
        checks.keep(self, critical_angle=angle)

    @property
    def size(self) -> BlockSize | None:
        """The dimensions or the body, which convert to units; None without either."""
        return self.dimensions or self.body

    @property
    def symmetric(self) -> bool:
        """Whether the motion to the left is the mirror image of that to the right."""
        return isinstance(self.restitution, float) and (self.body is None or self.body.symmetric)

    @property
    def largest_scale(self) -> float:
        """Largest factor κ of the acceleration of a side, 1 for equal sides; see `Body.acceleration_scales`."""
        return 1.0 if self.body is None else max(self.body.acceleration_scales)

    @property
    def restitution_by_side(self) -> tuple[float, float]:
        """Restitution of an impact that leaves the left side, and of one that leaves the right."""
        return (self.restitution, self.restitution) if isinstance(self.restitution, float) else self.restitution

    def restitution_text(self, digits: str = "g") -> str:
        """Return the restitution as a text, "left to right 0.88, right to left 0.85" where it differs.

        `digits` is the format of a number.
        """
        left, right = (format(value, digits) for value in self.restitution_by_side)
        return left if isinstance(self.restitution, float) else f"left to right {left}, right to left {right}"

    @property
    def lift_off(self) -> float:
        """Largest nondimensional force |f| under which the block stays at rest: tan(α)/α, 1 for a slender block.

        That of the easier side.
        """
        return lift_off(self.critical_angle)

    @property
    def least_friction(self) -> float | None:
        """Friction coefficient below which the block slides before it lifts off on its easier side: tan α.

        Of a rectangle it is width over height. None for a slender block without a size.
        """
        angle = self.critical_angle or (self.size.critical_angle if self.size else 0.0)
        return math.tan(angle) if angle > 0.0 else None

    def require_symmetric(self, what: str) -> None:
        """Raise ValueError where the sides differ; `what` the caller does, as in "the density", is for the message."""
        if not self.symmetric:
            size, accepted = self.body, f"equal sides and one restitution for {what}; use Monte Carlo"
            raise ValueError(checks.refusal("block.body", f"{size}, e = {self.restitution_text('.4g')}", accepted))


def _restitution(value, directed):
    """Return a restitution that was checked: a float, or where impacts may be `directed` a tuple of two that differ."""
    name = "block.restitution"
    if directed and not isinstance(value, str | bytes) and hasattr(value, "__iter__"):
        accepted = "a number, or [from the left, from the right], each from 0 to 1"
        left, right = checks.vector(name, value, accepted)
        if not (0.0 <= left <= 1.0 and 0.0 <= right <= 1.0):
            raise ValueError(checks.refusal(name, value, accepted))
        return left if left == right else (left, right)
    return checks.number(name, value, at_least=0.0, at_most=1.0)


@dataclasses.dataclass(frozen=True, slots=True)
class Start:
    """State at τ = 0: a point, or a Gaussian around it.

    Parameters
    ----------
    angle, velocity : float
        The point, or the mean of the Gaussian: angle in units of the critical angle, velocity per nondimensional time.
    covariance : ((float, float), (float, float)), optional
        Covariance [[xx, xv], [xv, vv]] of the Gaussian, symmetric and positive definite; None for a point.

    Examples
    --------
    >>> from fpk_rocking import Start, load_scene
    >>> from montecarlo import simulate
    >>> scene = load_scene("main").varied(start=Start(angle=0.2, covariance=((1e-2, 0.0), (0.0, 1e-2))))
    >>> print(simulate(scene, cycles=4, realizations=1000).survival.round(2))
    [1.   0.98 0.94 0.88 0.78]
    """

    angle: float = 0.0
    velocity: float = 0.0
    covariance: tuple[tuple[float, float], tuple[float, float]] | None = None

    def __post_init__(self):
        checks.keep_numbers(self, "start", "angle", "velocity")
        if self.covariance is not None:
            checks.keep(self, covariance=_covariance(self.covariance))


def _covariance(value):
    """Return a covariance, a sequence of two rows of two numbers, as tuples of floats, or refuse what is none."""
    name = "start.covariance"
    accepted = "[[xx, xv], [xv, vv]], symmetric and positive definite (leave it out to start from a point)"
    sequence = checks.sequence(name, value, accepted)
    rows = tuple(checks.vector(f"{name}[{i}]", row, "a row of two numbers") for i, row in enumerate(sequence))
    if len(rows) != 2:
        raise ValueError(checks.refusal(name, value, accepted))
    (xx, xv), (vx, vv) = rows
    # A correlation within rounding of 1 has no Cholesky factor, so it counts as singular.
    if xv != vx or xx <= 0.0 or vv <= 0.0 or abs(xv) >= (1.0 - 1e-12) * math.sqrt(xx) * math.sqrt(vv):
        raise ValueError(checks.refusal(name, value, accepted))
    return rows


@dataclasses.dataclass(frozen=True, slots=True)
class Overturning:
    """Criterion of overturning: the block has overturned once the absolute value of its angle reaches this one.

    Parameters
    ----------
    angle : float
        In units of the critical angle, above 0. π/2 is the paper's value. The shaking can still turn back a block
        beyond the critical angle, 1.

    Examples
    --------
    >>> from fpk_rocking import Overturning, load_scene
    >>> from montecarlo import simulate
    >>> scene = load_scene("main").varied(overturning=Overturning(angle=1.4))
    >>> print(simulate(scene, cycles=4, realizations=1000).survival.round(2))
    [1.   1.   0.98 0.88 0.76]
    """

    angle: float = math.pi / 2

    def __post_init__(self):
        checks.keep_numbers(self, "overturning", "angle", above=0.0)
