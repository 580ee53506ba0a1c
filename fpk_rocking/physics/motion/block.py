"""A block in plain numbers, without a compiler: flights of a slender one, and what an exact one adds to its equation.

With φ = α (1 - s x), gravity turns the block by -s sin φ/α in place of x - s, and the base by f cos φ in place of f; so
x'' = x - s + f + δ, and the *exact correction* δ = -s [sin φ/α - (1 - s x)] - f (1 - cos φ) is a function of angle and
time only. White noise is sqrt(2 D) cos φ dW. A critical angle of None or 0 is a slender block.

A flight of a slender block is a particular solution P of P'' = P + f and a flight without force. P is the bounded
solution where it is said; every other one differs from it by a flight without force.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from fpk_rocking.base.checks import Array, Number
from fpk_rocking.physics.motion import LIFT_OFF, TERMS


def dynamic_stiffness(frequency: float) -> float:
    """Return 1 + ω²: a force of the nondimensional frequency ω is that many times its P, with the other sign."""
    return 1.0 + frequency * frequency


def particular_series(p: Number, q: Number, force: Array) -> Array:
    """Taylor coefficients (n, TERMS) of P about n instants.

    `p` and `q` (n,) are P and P' there, and `force` (n, TERMS) are the Taylor coefficients of f.
    """
    out = np.empty((len(force), TERMS))
    out[:, 0], out[:, 1] = p, q
    for k in range(TERMS - 2):
        out[:, k + 2] = (out[:, k] + force[:, k]) / ((k + 1) * (k + 2))
    return out


def force_series(particular: Array) -> Array:
    """Taylor coefficients (n, TERMS) of f = P'' - P from those of P, `particular` (n, TERMS)."""
    order = np.arange(1, TERMS - 1)
    out = -particular
    out[:, :-2] += order * (order + 1.0) * particular[:, 2:]
    return out


def particular_at(particular: Array, times: Array) -> tuple[Array, Array]:
    """P and P', (n,) each, from Taylor coefficients `particular` (n, TERMS) about n instants.

    `times` is the time since each of the instants, one number.
    """
    order = np.arange(TERMS)
    return particular @ times**order, particular[:, 1:] @ (order[1:] * times ** order[:-1])


def forced_response(p0: float, q0: float, p1: float, q1: float, duration: float) -> tuple[float, float]:
    """Angle and velocity that a force adds at the end of a slender flight of a duration, all nondimensional.

    `p0`, `q0` are P and P' at the flight's begin, and `p1`, `q1` at its end; numbers, or arrays of one shape.
    """
    cosh, sinh = math.cosh(duration), math.sinh(duration)
    return p1 - cosh * p0 - sinh * q0, q1 - sinh * p0 - cosh * q0


class AffineFlights(NamedTuple):
    """Flights as maps z -> F z + shift: cosh and sinh of their time, and shifts (3, 2) with the side as first index."""

    cosh: float
    sinh: float
    shifts: np.ndarray

    @property
    def matrix(self) -> Array:
        """F, shape (2, 2)."""
        return np.array([[self.cosh, self.sinh], [self.sinh, self.cosh]])


class ContactLaw(NamedTuple):
    """What a side of a block has at zero angle: u'' = -gravity + part s f, and the part of noise on its way.

    `noise` is the mean of the factor of the force from zero angle to the saddle.
    """

    gravity: float = 1.0
    part: float = 1.0
    noise: float = 1.0


SLENDER_CONTACT = {-1: ContactLaw(), 1: ContactLaw()}
"""By side."""


def affine_flights(
    p0: float, q0: float, p1: float, q1: float, duration: float, contact: dict[int, ContactLaw] = SLENDER_CONTACT
) -> AffineFlights:
    """Return the `AffineFlights` of both sides over a duration, nondimensional: u'' = u - gravity + part s f.

    `p0`, `q0` are P and P' at their begin, and `p1`, `q1` at their end. `contact` is a `ContactLaw` by side.
    """
    cosh, sinh = math.cosh(duration), math.sinh(duration)
    shifts, ends = np.zeros((3, 2)), (p0, q0, p1, q1)
    for side in (1, -1):
        balanced = side * contact[side].gravity
        p0, q0, p1, q1 = (contact[side].part * value for value in ends)
        shifts[side] = balanced + p1 - cosh * (balanced + p0) - sinh * q0, q1 - sinh * (balanced + p0) - cosh * q0
    return AffineFlights(cosh, sinh, shifts)


def linear_force_response(duration: float) -> Array:
    """Angle and velocity (rows) that the forces 1 and t (columns), t since its begin, add to a flight: an array (2, 2).

    `duration` is that of the flight, nondimensional.
    """
    cosh, sinh = math.cosh(duration), math.sinh(duration)
    return np.array([[cosh - 1.0, sinh - duration], [sinh, cosh - 1.0]])


def cosh_sinh(duration: float) -> Array:
    """Cosh and sinh (2,) of a duration: the matrix of a flight has the first on its diagonal, the second beside it."""
    return np.array([math.cosh(duration), math.sinh(duration)])


def impulse_response(left: Array) -> Array:
    """Angle and velocity (2, ...) at the end of a slender flight, to a unit impulse at a time `left` (...) before."""
    return np.stack([np.sinh(left), np.cosh(left)])


def gravity_at_contact(critical_angle: float | None, saddle: float = 1.0, scale: float = 1.0) -> float:
    """Return -u'' at zero angle without a force: κ sin(α m)/α.

    `critical_angle` is α, radians; `saddle` m and `scale` κ are those of the side, 1 of equal sides: then it is also
    the mean of cos φ from there to the saddle.
    """
    return scale * math.sin(critical_angle * saddle) / critical_angle if critical_angle else 1.0


def contact_laws(block: Any) -> dict[int, ContactLaw]:
    """Return the `ContactLaw` of each side of a `KernelBlock`, by side."""
    alpha, laws = block.critical_angle or 0.0, {}
    for side, saddle, scale in zip((-1, 1), block.saddles, block.scales, strict=True):
        gravity = gravity_at_contact(alpha, saddle, scale)
        laws[side] = ContactLaw(gravity, scale * math.cos(alpha * saddle), gravity / saddle)
    return laws


def tilt_angle(angles: Array, critical_angle: float, saddle: Number = 1.0) -> Array:
    """Angle φ (n, ...), radians, between the vertical and the line from the corner to the centre of mass.

    `angles` (n, ...) are x, nondimensional, `critical_angle` is α, radians. `saddle` is m, the |x| of
    unstable balance, 1 of equal sides, a number or an array. φ is negative beyond it.
    """
    return critical_angle * (saddle - np.abs(angles))


def force_factors(angles: Array, critical_angle: float, saddle: Number = 1.0, scale: Number = 1.0) -> Array:
    """Part of the base's acceleration that turns the block, κ cos φ (n, ...), at angles x (n, ...), for α in radians.

    `saddle` m and `scale` κ are numbers or arrays, 1 of equal sides.
    """
    return scale * np.cos(tilt_angle(angles, critical_angle, saddle))


def gravity_correction(angles: Array, sides: Array, critical_angle: float) -> Array:
    """Gravity's part of the exact correction δ (n, ...), nondimensional, at angles x (n, ...) and for α > 0 in radians.

    `sides` (n, ...) are +1 or -1.
    """
    phi = tilt_angle(angles, critical_angle)
    return -sides * (np.sin(phi) - phi) / critical_angle


def largest_correction(force: float, critical_angle: float | None, saddle: float = 1.0, scale: float = 1.0) -> float:
    """Bound of the exact correction |δ| from zero angle to twice the saddle's, nondimensional.

    `force` is the largest |f|, nondimensional; `critical_angle` is α, radians. Of a side with the `saddle` m and the
    `scale` κ, the correction is to x'' = x - s m + f.
    """
    if not critical_angle:
        return 0.0
    bent = saddle - gravity_at_contact(critical_angle, saddle) + force * (1.0 - math.cos(critical_angle * saddle))
    return bent + abs(scale - 1.0) * (saddle + force)


def saddle_speed(force: float, critical_angle: float | None, saddle: float = 1.0, scale: float = 1.0) -> float:
    """Speed at zero angle from which a block just reaches the saddle, under a constant force s f up to lift-off.

    `force` is s f, `critical_angle` α, radians, and `saddle` m and `scale` κ are those of the side. It is 1 - s f for a
    slender block, and of equal sides 2 sin(α/2)/α without a force (the integral of u'' over the angle).
    """
    if not critical_angle:
        return max(1.0 - force, 0.0)
    alpha = critical_angle
    square = math.hypot(1.0, alpha * force) - math.cos(alpha * saddle) - alpha * force * math.sin(alpha * saddle)
    return math.sqrt(2.0 * scale * max(square, 0.0)) / alpha


class SidesOfContact(NamedTuple):
    """What the forces of the floor need of each side, (left, right): its saddle m, its scale κ, and p² R_s/g.

    By default those of a rectangle.
    """

    saddle: tuple[float, float] = (1.0, 1.0)
    scale: tuple[float, float] = (1.0, 1.0)
    lever: tuple[float, float] = (0.75, 0.75)


RECTANGLE = SidesOfContact()


def contact_forces(
    angle: Array,
    velocity: Array,
    force: Array,
    critical_angle: float,
    slender: bool = False,
    sides: SidesOfContact = RECTANGLE,
) -> Array:
    """Return the forces of the floor on a block, over its weight mg.

    With φ = α (m - s x) and the lever c = p² R/g the centre of mass has the horizontal acceleration
    c (α x'' cos φ + s α² v² sin φ) relative to the base and the vertical one c (s α x'' sin φ - α² v² cos φ), in units
    of g; the base itself has -α f. Of a rectangle m = 1 and c = 3/4. The forces of an impact are not among them.

    Parameters
    ----------
    angle, velocity, force : ndarray
        x, v and f at some times, nondimensional, of shapes that broadcast. A block at (0, 0) rests where f cannot lift
        it off.
    critical_angle : float
        α of the block's size, above 0, radians.
    slender : bool
        Whether the motion obeys x'' = x - s + f in place of the exact equation.
    sides : SidesOfContact
        Of a body that is no rectangle.

    Returns
    -------
    ndarray, shape (2, ...)
        The horizontal force, positive towards x > 0, and the normal force. nan where the angle is.
    """
    x, v, f = np.broadcast_arrays(angle, velocity, force)
    alpha = critical_angle
    left, right = (LIFT_OFF if slender else math.tan(m * alpha) / alpha for m in sides.saddle)
    lifted = np.where(f > right, 1.0, np.where(-f > left, -1.0, 0.0))
    side = np.where(x != 0.0, np.sign(x), np.where(v != 0.0, np.sign(v), lifted))
    saddle, scale, lever = (np.where(side > 0.0, pair[1], pair[0]) for pair in sides)
    phi = alpha * (saddle - side * x)
    sine, cosine = np.sin(phi), np.cos(phi)
    turning = alpha * (x - side + f if slender else scale * (f * cosine - side * sine / alpha))
    square = (alpha * v) ** 2
    moving = side != 0.0
    horizontal = np.where(moving, lever * (turning * cosine + side * square * sine), 0.0) - alpha * f
    normal = 1.0 + np.where(moving, lever * (side * turning * sine - square * cosine), 0.0)
    return np.where(np.isnan(x), np.nan, np.stack([horizontal, normal]))


def add_cosine(row: Array, instant: float, amplitude: float, frequency: float, phase: float) -> None:
    """Add to `row` (TERMS,) the Taylor coefficients about an instant of A cos(Ωτ + Ψ) over its stiffness, 1 + Ω².

    `amplitude` is A, `frequency` Ω, and `phase` Ψ, radians.
    """
    angle = frequency * instant + phase
    scale = amplitude / dynamic_stiffness(frequency)
    even, odd = scale * math.cos(angle), -scale * math.sin(angle)
    for k in range(0, TERMS, 2):
        row[k] += even
        even *= -frequency * frequency / ((k + 1) * (k + 2))
    for k in range(1, TERMS, 2):
        row[k] += odd * frequency
        odd *= -frequency * frequency / ((k + 1) * (k + 2))
