"""A rigid body of any shape that rocks about two corners, against the nondimensional scene (derived in docs/theory).

Its plane of motion is a plane of symmetry. With the centre of mass G at the height h, at the distance b_s from the
corner of the side s, and the radius of gyration r about G, the side has R_s² = h² + b_s², the critical angle
α_s = atan(b_s/h), and p_s² = g R_s / (r² + R_s²). The mass cancels. The units of the scene are those of the *easier*
side, the one with the smaller α_s: α and p.
"""

import dataclasses
import math

from fpk_rocking.base import checks
from fpk_rocking.scene.units import STANDARD_GRAVITY, BlockSize, in_units

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
        Horizontal distances of the centre of mass from the corner on the right and from that on the left.
    radius_of_gyration : float
        r = √(I/m) about the centre of mass, from the moment of inertia I of the motion in the plane and the mass m.
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
        for name in (*LENGTHS, "gravity"):
            kind = "length" if name in LENGTHS else "acceleration"
            value = in_units(f"block.body.{name}", getattr(self, name), kind)
            value = checks.number(f"block.body.{name}", value, above=0.0)
            # Beyond, a conversion of units divides by 0 or overflows.
            checks.keep(self, **{name: checks.number(f"block.body.{name}", value, at_least=1e-100, at_most=1e100)})

    @property
    def symmetric(self) -> bool:
        """Whether the centre of mass is in the middle."""
        return self.right == self.left

    @property
    def critical_angles(self) -> tuple[float, float]:
        """Critical angles α_s of the left and of the right side, radians."""
        return math.atan2(self.left, self.height_of_centre), math.atan2(self.right, self.height_of_centre)

    @property
    def critical_angle(self) -> float:
        """Critical angle α of the easier side, radians: tilted by it, the body is balanced on that corner."""
        return min(self.critical_angles)

    @property
    def frequency_parameters(self) -> tuple[float, float]:
        """Frequency parameters p_s of the left and of the right side, rad/s."""
        radii = (math.hypot(self.height_of_centre, distance) for distance in (self.left, self.right))
        left, right = (math.sqrt(self.gravity * radius / (self.radius_of_gyration**2 + radius**2)) for radius in radii)
        return left, right

    @property
    def frequency_parameter(self) -> float:
        """Frequency parameter p of the easier side, rad/s: nondimensional time is τ = pt."""
        return self.frequency_parameters[0 if self.left < self.right else 1]

    @property
    def saddles(self) -> tuple[float, float]:
        """Angles α_s/α, in critical angles, at which the body is balanced on its left and on its right corner."""
        left, right = (angle / self.critical_angle for angle in self.critical_angles)
        return left, right

    @property
    def acceleration_scales(self) -> tuple[float, float]:
        """Factors κ_s = (p_s/p)² of the acceleration on the left and on the right side."""
        left, right = ((rate / self.frequency_parameter) ** 2 for rate in self.frequency_parameters)
        return left, right

    @property
    def levers(self) -> tuple[float, float]:
        """Distances R_s of the centre of mass from the left and from the right corner, in units of g/p²."""
        unit = self.frequency_parameter**2 / self.gravity
        left, right = (unit * math.hypot(self.height_of_centre, distance) for distance in (self.left, self.right))
        return left, right

    @property
    def restitution(self) -> float | tuple[float, float]:
        """Velocity ratio of an impact without bounce or slip, by the angular momentum about the new corner.

        One number for a body in the middle, else two: of an impact that leaves the left side, and one that leaves the
        right. It is (r² + h² - b_r b_l) / (r² + R²) with the R of the new corner; Housner's for a rectangle.

        Raises
        ------
        ValueError
            The body is so squat that it would be negative: it stops at the first impact.
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
