"""Body, block, start and overturning of a scene, each checked when it is made.

A `Body` is rigid, of any shape, and rocks about two corners (derived in docs/theory). Its plane of motion is a plane of
symmetry. With the centre of mass G at the height h, at the distance b_s from the corner of the side s, and the radius
of gyration r about G, the side has R_s² = h² + b_s², the critical angle α_s = atan(b_s/h), and p_s² = g R_s / (r² +
R_s²). The mass cancels. The units of the scene are those of the *easier* side, the one with the smaller α_s: α and p.
"""

import dataclasses
import math

from fpk_rocking.base import checks
from fpk_rocking.physics.motion import lift_off
from fpk_rocking.scene.units import STANDARD_GRAVITY, BlockSize, Dimensions, keep_sizes

LENGTHS = "height_of_centre", "right", "left", "radius_of_gyration"
"""Names of the lengths of a `Body`."""


@dataclasses.dataclass(frozen=True, slots=True)
class Body(BlockSize):
    """A rigid body of any shape on two corners: where its centre of mass is, and how its mass is spread.

    Parameters
    ----------
    height_of_centre : float
        Height of the centre of mass above the base, metres, or a text with a unit ("90 cm").
    right, left : float
        Horizontal distances of the centre of mass from the right and from the left corner, metres.
    radius_of_gyration : float
        r = √(I/m), metres, of the mass m and the moment of inertia I about the centre of mass in the plane of motion.
    gravity : float
        Acceleration of gravity, m/s².

    Raises
    ------
    TypeError, ValueError
        A value is not a positive number from 1e-100 to 1e100.

    Examples
    --------
    >>> from fpk_rocking import Body
    >>> statue = Body(height_of_centre=1.1, right=0.30, left=0.38, radius_of_gyration=0.62)
    >>> print(f"p = {statue.frequency_parameter:.2f} rad/s, {statue.radians(1.0):.3f} rad")
    p = 2.58 rad/s, 0.266 rad
    >>> print("e = {:.3f} from the left, {:.3f} from the right".format(*statue.restitution))
    e = 0.879 from the left, 0.851 from the right
    """

    height_of_centre: float
    right: float
    left: float
    radius_of_gyration: float
    gravity: float = STANDARD_GRAVITY

    def __post_init__(self):
        keep_sizes(self, "block.body", *LENGTHS)

    @property
    def symmetric(self) -> bool:
        """Whether the centre of mass is in the middle."""
        return self.right == self.left

    @property
    def critical_angles(self) -> tuple[float, float]:
        """Critical angles α_s, radians: (left, right)."""
        return math.atan2(self.left, self.height_of_centre), math.atan2(self.right, self.height_of_centre)

    @property
    def critical_angle(self) -> float:
        """Critical angle α, radians, the smaller one of both sides: tilted by it, the body balances on that corner."""
        return min(self.critical_angles)

    @property
    def frequency_parameters(self) -> tuple[float, float]:
        """Frequency parameters p_s, rad/s: (left, right)."""
        radii = (math.hypot(self.height_of_centre, distance) for distance in (self.left, self.right))
        left, right = (math.sqrt(self.gravity * radius / (self.radius_of_gyration**2 + radius**2)) for radius in radii)
        return left, right

    @property
    def frequency_parameter(self) -> float:
        """Frequency parameter p, rad/s, of the side with the smaller α: nondimensional time is τ = pt."""
        return self.frequency_parameters[0 if self.left < self.right else 1]

    @property
    def saddles(self) -> tuple[float, float]:
        """Angles α_s/α, nondimensional, at which the body is balanced on a corner: (left, right)."""
        left, right = (angle / self.critical_angle for angle in self.critical_angles)
        return left, right

    @property
    def acceleration_scales(self) -> tuple[float, float]:
        """Factors κ_s = (p_s/p)² of the acceleration, nondimensional: (left, right)."""
        left, right = ((rate / self.frequency_parameter) ** 2 for rate in self.frequency_parameters)
        return left, right

    @property
    def levers(self) -> tuple[float, float]:
        """Distances R_s of the centre of mass from the corners, in units of g/p²: (left, right)."""
        unit = self.frequency_parameter**2 / self.gravity
        left, right = (unit * math.hypot(self.height_of_centre, distance) for distance in (self.left, self.right))
        return left, right

    @property
    def restitution(self) -> float | tuple[float, float]:
        """Velocity ratio of an impact without bounce or slip, by the angular momentum about the new corner.

        One number where both sides are equal, else two: for impacts that leave the left side, and the right one. It is
        (r² + h² - b_r b_l) / (r² + R²): h and b are the height and distances of the centre of mass, R is its distance
        from the new corner. For a rectangle this is Housner's value.

        Raises
        ------
        ValueError
            The body is so squat that the ratio would be negative: it stops at the first impact.
        """
        square = self.radius_of_gyration**2 + self.height_of_centre**2
        kept = square - self.right * self.left
        if kept < 0.0:
            raise ValueError(
                f"block.body: got right * left = {self.right * self.left:.6g} m², accepted: at most "
                f"radius_of_gyration² + height_of_centre² = {square:.6g} m², as the restitution is negative here; for "
                "so squat a body give block.restitution"
            )
        from_left, from_right = kept / (square + self.right**2), kept / (square + self.left**2)
        return from_left if self.symmetric else (from_left, from_right)

    @property
    def label(self) -> str:
        """Height of the centre, and its distances from the corners, as a short text."""
        return f"{self.height_of_centre:.3g} m high, {self.left:.3g} m | {self.right:.3g} m"

    def __str__(self):
        return (
            f"body with its centre {self.height_of_centre:.3g} m high, {self.left:.3g} m from the left corner and "
            f"{self.right:.3g} m from the right"
        )


@dataclasses.dataclass(frozen=True, slots=True)
class Block:
    """A rigid rocking block.

    Parameters
    ----------
    restitution : float or (float, float), optional
        Velocity after an impact over that before it, from 0 to 1 (paper eq. 3). By default it follows from the size,
        `Dimensions.restitution` or `Body.restitution`. A body may have two numbers: for impacts that leave the left
        side and for those that leave the right.
    dimensions : Dimensions, optional
        Size of a rectangular block, for conversions to units. A record needs it, or a body; so do the defaults of
        `restitution` and `critical_angle`.
    critical_angle : float, optional
        Critical angle α of the equation of motion, radians, from 0 to π/2. By default that of the size; another value
        may differ from it by .1 %. Without a size the default is 0, the limit of a slender block (paper).
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
        """Restitution of an impact that leaves the left side, and of one that leaves the right: (left, right)."""
        return (self.restitution, self.restitution) if isinstance(self.restitution, float) else self.restitution

    def restitution_text(self, digits: str = "g") -> str:
        """Return the restitution as a text, "0.88", or "left to right 0.88, right to left 0.85" where it differs."""
        left, right = (format(value, digits) for value in self.restitution_by_side)
        return left if isinstance(self.restitution, float) else f"left to right {left}, right to left {right}"

    @property
    def lift_off(self) -> float:
        """Largest nondimensional force |f| under which the block stays at rest: tan(α)/α at its smaller α."""
        return lift_off(self.critical_angle)

    @property
    def least_friction(self) -> float | None:
        """Friction coefficient below which the block slides before it lifts off: tan α at its smaller α.

        For a rectangle it is width over height. None for a slender block without a size.
        """
        angle = self.critical_angle or (self.size.critical_angle if self.size else 0.0)
        return math.tan(angle) if angle > 0.0 else None

    def require_symmetric(self, what: str, instead: str) -> None:
        """Raise ValueError where the sides differ; it says `what` needs equal ones, and what to do `instead`."""
        if not self.symmetric:
            size, accepted = self.body, f"equal sides and one restitution for {what}; {instead}"
            raise ValueError(checks.refusal("block.body", f"{size}, e = {self.restitution_text('.4g')}", accepted))


def _restitution(value, directed):
    """Return a restitution after a check: a float or, where impacts may be `directed`, a pair that differs."""
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

    @property
    def at_rest(self) -> bool:
        """Whether the block is at rest at τ = 0: a point at angle and velocity 0."""
        return self.angle == self.velocity == 0.0 and self.covariance is None


def _covariance(value):
    """Return a covariance as a tuple ((xx, xv), (xv, vv)) after a check that it is symmetric and positive definite."""
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


def check_cutoff(cutoff: float, critical_angle: float) -> None:
    """Raise ValueError for a cut-off, in critical angles, at which gravity turns a block back."""
    if critical_angle * (cutoff - 1.0) > 0.5 * math.pi:
        most = f"at most 1 + π/(2α) = {1.0 + 0.5 * math.pi / critical_angle:.6g} critical angles of this block"
        raise ValueError(checks.refusal("overturning.angle", cutoff, most))
