"""A block in plain numbers, without a compiler: flights, an exact block, forces of the floor, and the separatrix.

With φ = α (1 - s x), gravity turns the block by -s sin φ/α in place of x - s, and the base by f cos φ in place of f; so
x'' = x - s + f + δ, and the *exact correction* δ = -s [sin φ/α - (1 - s x)] - f (1 - cos φ) is a function of angle and
time only. White noise is sqrt(2 D) cos φ dW. A critical angle of None or 0 is a slender block. Of unequal sides
φ = α (m - s x), with m the |x| of unstable balance and κ a factor of both accelerations; of equal sides m = κ = 1.

A flight of a slender block is a particular solution P of P'' = P + f and a flight without force. P is the bounded
solution where it is said; every other one differs from it by a flight without force.

The separatrix, the orbit from one saddle through x = 0 to the other without forcing and losses, has with the critical
angle α (docs/theory, section 10)

    tan(φ/4) = tan(α/4) e^(-|τ|),    v = (2/α) sin(φ/2),

if it meets x = 0 at τ = 0. A force changes the energy by f v cos φ, and v cos φ = v''. So the kernel of the Melnikov
process is a sum of exponentials, which converges like tan(α/4)^(2n), and is e^(-|τ|) for a slender block, α = 0:

    v cos φ = Σ c_n e^(-m_n |τ|),    m_n = 2n + 1,    c_n = (-1)^n (4/α) tan(α/4)^m_n m_n².
"""

import math
from typing import Any, NamedTuple

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.base.checks import Array, ArrayLike, Number
from fpk_rocking.physics.motion import LIFT_OFF, TERMS


def dynamic_stiffness(frequency: float) -> float:
    """Return 1 + ω²: a force cos ωτ is minus that many times its P, the bounded solution of P'' = P + f.

    `frequency` is ω, nondimensional.
    """
    return 1.0 + frequency * frequency


def particular_series(p: Number, q: Number, force: Array) -> Array:
    """Taylor coefficients (n, TERMS), lowest power first, about n instants of a solution P of P'' = P + f.

    `p` and `q` (n,) are P and P' there, and `force` (n, TERMS) are the Taylor coefficients of f. All are
    nondimensional.
    """
    out = np.empty((len(force), TERMS))
    out[:, 0], out[:, 1] = p, q
    for k in range(TERMS - 2):
        out[:, k + 2] = (out[:, k] + force[:, k]) / ((k + 1) * (k + 2))
    return out


def force_series(particular: Array) -> Array:
    """Taylor coefficients (n, TERMS) of f = P'' - P from those of P, `particular` (n, TERMS), lowest power first.

    The last two lack P'', which would need two more terms of P.
    """
    order = np.arange(1, TERMS - 1)
    out = -particular
    out[:, :-2] += order * (order + 1.0) * particular[:, 2:]
    return out


def particular_at(particular: Array, times: Array) -> tuple[Array, Array]:
    """P and P', (n,) each, from Taylor coefficients `particular` (n, TERMS) of P about n instants, lowest power first.

    `times` is the nondimensional time since each of the instants: a number, the same for all.
    """
    order = np.arange(TERMS)
    return particular @ times**order, particular[:, 1:] @ (order[1:] * times ** order[:-1])


def forced_response(p0: float, q0: float, p1: float, q1: float, duration: float) -> tuple[float, float]:
    """Angle and velocity, a tuple, that a force f adds up to the end of a slender flight x'' = x - s + f.

    With P any solution of P'' = P + f, `p0`, `q0` are P and P' at the flight's begin, and `p1`, `q1` at its end;
    numbers, or arrays of one shape, which the results have. `duration` is that of the flight; all are nondimensional.
    """
    cosh, sinh = math.cosh(duration), math.sinh(duration)
    return p1 - cosh * p0 - sinh * q0, q1 - sinh * p0 - cosh * q0


class AffineFlights(NamedTuple):
    """Flights as maps z -> F z + shift of z = (angle, velocity), nondimensional.

    `cosh` and `sinh` are those of the duration, and `shifts` (3, 2) has the shifts of angle and velocity; its first
    index is the side, 1 or -1.
    """

    cosh: float
    sinh: float
    shifts: np.ndarray

    @property
    def matrix(self) -> Array:
        """F (2, 2), [[cosh, sinh], [sinh, cosh]], which acts on (angle, velocity)."""
        return np.array([[self.cosh, self.sinh], [self.sinh, self.cosh]])


class ContactLaw(NamedTuple):
    """What a side of a block has at zero angle: u'' = -gravity + part s f (u = s x), and the part of noise on its way.

    `noise` is the mean of the factor of the force from zero angle to the saddle. All are nondimensional, 1 for a
    slender block.
    """

    gravity: float = 1.0
    part: float = 1.0
    noise: float = 1.0


SLENDER_CONTACT = {-1: ContactLaw(), 1: ContactLaw()}
"""By side."""


def affine_flights(
    p0: float, q0: float, p1: float, q1: float, duration: float, contact: dict[int, ContactLaw] = SLENDER_CONTACT
) -> AffineFlights:
    """Return the maps of (angle, velocity) by flights u'' = u - gravity + part s f of both sides over a duration.

    They are the named tuple `AffineFlights`: cosh and sinh of the duration, and shifts (3, 2) by side, 1 or -1. With P
    a solution of P'' = P + f, `p0`, `q0` are P and P' at the flights' begin, and `p1`, `q1` at their end. `contact` has
    for each side, -1 and 1, a `ContactLaw` with gravity and part. All are nondimensional.
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

    `duration` is that of the slender flight; all are nondimensional.
    """
    cosh, sinh = math.cosh(duration), math.sinh(duration)
    return np.array([[cosh - 1.0, sinh - duration], [sinh, cosh - 1.0]])


def cosh_sinh(duration: float) -> Array:
    """Return the array [cosh, sinh] of a nondimensional `duration`.

    The matrix of a slender flight has the first on its diagonal, and the second beside it.
    """
    return np.array([math.cosh(duration), math.sinh(duration)])


def impulse_response(left: Array) -> Array:
    """Angle and velocity, an array (2, ...), at the end of a slender flight, that a unit impulse has caused.

    `left` (...) is the nondimensional time from the impulse to the end; the two are its sinh and cosh.
    """
    return np.stack([np.sinh(left), np.cosh(left)])


def gravity_at_contact(critical_angle: float | None, saddle: float = 1.0, scale: float = 1.0) -> float:
    """Return -u'' of the folded angle u = s x at zero angle without a force, nondimensional: κ sin(α m)/α.

    `critical_angle` is α, radians; None or 0, a slender block, has 1. `saddle` m, the u of unstable balance, and
    `scale` κ, a factor of the acceleration, are those of the side, 1 of equal sides: then it is also the mean of cos φ
    from there to the saddle.
    """
    return scale * math.sin(critical_angle * saddle) / critical_angle if critical_angle else 1.0


def contact_laws(block: Any) -> dict[int, ContactLaw]:
    """Return a dict of the named tuple `ContactLaw` (gravity, part, noise) of a `KernelBlock` by side, -1 and 1."""
    alpha, laws = block.critical_angle or 0.0, {}
    for side, saddle, scale in zip((-1, 1), block.saddles, block.scales, strict=True):
        gravity = gravity_at_contact(alpha, saddle, scale)
        laws[side] = ContactLaw(gravity, scale * math.cos(alpha * saddle), gravity / saddle)
    return laws


def tilt_angle(angles: Array, critical_angle: float, saddle: Number = 1.0) -> Array:
    """Angle φ (n, ...), radians, between the vertical and the line from the corner to the centre of mass: α (m - |x|).

    `angles` (n, ...) are x, nondimensional, `critical_angle` is α, radians. `saddle` is m, the |x| of unstable balance,
    1 of equal sides, a number or an array. φ is negative beyond it.
    """
    return critical_angle * (saddle - np.abs(angles))


def force_factors(angles: Array, critical_angle: float, saddle: Number = 1.0, scale: Number = 1.0) -> Array:
    """Factor κ cos φ (n, ...) with which the base's acceleration turns the block, at angles x (n, ...), nondimensional.

    `critical_angle` is α in radians, and φ = α (m - |x|). `saddle` m and `scale` κ are numbers or arrays, 1 of equal
    sides.
    """
    return scale * np.cos(tilt_angle(angles, critical_angle, saddle))


def largest_correction(force: float, critical_angle: float | None, saddle: float = 1.0, scale: float = 1.0) -> float:
    """Bound, a float, of what the exact acceleration adds to x - s m + f, from zero angle to twice the saddle's.

    `force` is the largest |f|, nondimensional as the bound is; `critical_angle` is α, radians, and None or 0 gives 0.
    Of a side, `saddle` m is the |x| of unstable balance and `scale` κ the factor of its acceleration.
    """
    if not critical_angle:
        return 0.0
    bent = saddle - gravity_at_contact(critical_angle, saddle) + force * (1.0 - math.cos(critical_angle * saddle))
    return bent + abs(scale - 1.0) * (saddle + force)


def saddle_speed(force: float, critical_angle: float | None, saddle: float = 1.0, scale: float = 1.0) -> float:
    """Nondimensional speed at zero angle from which a block just reaches the saddle, under a constant force.

    `force` is s f, up to that of lift-off, nondimensional; `critical_angle` is α, radians (None or 0: slender). Of the
    side, `saddle` m is the |x| of unstable balance and `scale` κ the factor of the acceleration. The speed is max(1 - s
    f, 0) for a slender block, and of equal sides 2 sin(α/2)/α without a force (the integral of u'' over the angle).
    """
    if not critical_angle:
        return max(1.0 - force, 0.0)
    alpha = critical_angle
    square = math.hypot(1.0, alpha * force) - math.cos(alpha * saddle) - alpha * force * math.sin(alpha * saddle)
    return math.sqrt(2.0 * scale * max(square, 0.0)) / alpha


class SidesOfContact(NamedTuple):
    """What the forces of the floor need of each side, (left, right), nondimensional; by default those of a rectangle.

    `saddle` is m, the |x| of unstable balance, `scale` the factor κ of the acceleration, and `lever` is p² R_s/g with
    the distance R_s from the corner to the centre of mass.
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
    """Add the Taylor coefficients about an instant of A cos(Ωτ + Ψ)/(1 + Ω²) to `row` (TERMS,), lowest power first.

    `instant` is τ there, `amplitude` A and `frequency` Ω are nondimensional, `phase` is Ψ, radians.
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


def checked_angle(critical_angle: float) -> float:
    """Return `critical_angle` α as a float from 0 to π/2, radians, or raise TypeError or ValueError."""
    return checks.number("critical_angle", critical_angle, at_least=0.0, at_most=0.5 * math.pi)


def separatrix_orbit(times: ArrayLike, critical_angle: float) -> tuple[Number, Number]:
    """Angle sgn(τ)(1 - φ/α) and velocity on the orbit from x = -1 to x = 1 that meets x = 0 at the time 0.

    There φ(τ) is the tilt with tan(φ/4) = tan(α/4) e^(-|τ|). Angle and velocity are nondimensional.

    Parameters
    ----------
    times : array_like
        Times τ of either sign, nondimensional.
    critical_angle : float
        α, from 0 to π/2, radians.

    Returns
    -------
    angle, velocity : ndarray or float
        Of the shape of `times`.
    """
    tau, (scale, ratio) = np.asarray(times, float), _scales(critical_angle)
    fall, risen = np.exp(-np.abs(tau)), -np.expm1(-np.abs(tau))
    turned = ratio * risen / (1.0 + ratio**2 * fall)
    part = np.arctan(turned) / ratio if ratio > 0.0 else risen
    return (np.sign(tau) * scale * part)[()], (scale * fall / (1.0 + (ratio * fall) ** 2))[()]


def separatrix_speed(critical_angle: float) -> float:
    """Return the nondimensional speed v₀ = (2/α) sin(α/2) at which the orbit between the saddles passes x = 0.

    An impulse of this size overturns a block at rest. `critical_angle` is α, radians, 0 to π/2; for 0, v₀ is 1.
    """
    return float(np.sinc(checked_angle(critical_angle) / (2.0 * math.pi)))


def melnikov_kernel(critical_angle: float) -> tuple[Array, Array]:
    """Weights c_n and rates m_n, each (terms,), of the kernel Σ c_n e^(-m_n |τ|) by which the orbit sees a force.

    The kernel is v cos φ along the orbit between the saddles. `critical_angle` is α, radians; for α = 0 both are [1].
    """
    scale, ratio = _scales(critical_angle)
    order = np.arange(25)  # enough for α = π/2, where tan(α/4)² is 0.17
    rates = 2.0 * order + 1.0
    weights = scale * (-(ratio**2)) ** order * rates**2
    resolved = np.abs(weights) > 1e-18
    return weights[resolved], rates[resolved]


def kernel_halves(frequency: ArrayLike, critical_angle: float) -> tuple[Number, Number]:
    """Integrals over τ > 0 of the Melnikov kernel Σ c_n e^(-m_n τ) times cos ωτ and times sin ωτ.

    Parameters
    ----------
    frequency : array_like
        Angular frequency ω, nondimensional.
    critical_angle : float
        α, from 0 to π/2, radians.

    Returns
    -------
    cosine, sine : ndarray or float
        Σ c_n m_n/(m_n² + ω²) and Σ c_n ω/(m_n² + ω²), of the shape of `frequency`.
    """
    omega, cosine, sine = np.asarray(frequency, float), 0.0, 0.0
    for weight, rate in zip(*melnikov_kernel(critical_angle), strict=True):
        part = weight / (rate * rate + omega**2)
        cosine, sine = cosine + rate * part, sine + omega * part
    return cosine, sine


def white_gain(critical_angle: float) -> float:
    """Integral, a float, of the squared Melnikov kernel over all times; white noise has 2D times it.

    2D times it is the variance of the Melnikov process. It is (8/α²) ∫ (2c² - 1)² dc from c = cos(α/2) to 1, and 1 for
    a slender block; `critical_angle` is α, radians.
    """
    alpha = checked_angle(critical_angle)
    rise = 2.0 * math.sin(0.25 * alpha) ** 2
    terms = 1.0 - rise * (4.0 - rise * (20.0 / 3.0 - rise * (4.0 - 0.8 * rise)))
    return float(np.sinc(alpha / (4.0 * math.pi))) ** 2 * terms


def _scales(critical_angle):
    """Return the tuple ((4/α) tan(α/4), tan(α/4)) for `critical_angle` α in radians, (1, 0) for α = 0."""
    alpha = checked_angle(critical_angle)
    ratio = math.tan(0.25 * alpha)
    return (4.0 * ratio / alpha if alpha > 0.0 else 1.0), ratio
