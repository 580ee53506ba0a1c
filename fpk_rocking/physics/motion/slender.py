"""Flights of a slender block in closed form, x'' = x - s + f, in plain numbers and tables: no compiler.

A flight is a particular solution P of P'' = P + f and a flight without force. P is the bounded solution where that is
said; any other differs from it by a flight without force.
"""

import math
from typing import NamedTuple

import numpy as np

from fpk_rocking.base.checks import Array, Number
from fpk_rocking.physics.motion import TERMS


def particular_series(p: Number, q: Number, force: Array) -> Array:
    """Coefficients (n, TERMS) of a solution P of P'' = P + f about n instants, from P, P' there and those of f."""
    out = np.empty((len(force), TERMS))
    out[:, 0], out[:, 1] = p, q
    for k in range(TERMS - 2):
        out[:, k + 2] = (out[:, k] + force[:, k]) / ((k + 1) * (k + 2))
    return out


def force_series(particular: Array) -> Array:
    """Coefficients (n, TERMS) of f = P'' - P from those of P.

    The last two lack P'', which would need two more terms of P.
    """
    order = np.arange(1, TERMS - 1)
    out = -particular
    out[:, :-2] += order * (order + 1.0) * particular[:, 2:]
    return out


def particular_at(particular: Array, times: Array) -> tuple[Array, Array]:
    """P and P' (n,) from coefficients (n, TERMS) of P about n instants, at a time since each."""
    order = np.arange(TERMS)
    return particular @ times**order, particular[:, 1:] @ (order[1:] * times ** order[:-1])


def forced_response(p0: float, q0: float, p1: float, q1: float, duration: float) -> tuple[float, float]:
    """(angle, velocity) that a force adds up to the end of a flight, from any P and P' at its start and its end."""
    cosh, sinh = math.cosh(duration), math.sinh(duration)
    return p1 - cosh * p0 - sinh * q0, q1 - sinh * p0 - cosh * q0


def linear_force_response(duration: float) -> Array:
    """Angle and velocity (rows) that the forces 1 and t (columns), t since its start, add to a flight."""
    cosh, sinh = math.cosh(duration), math.sinh(duration)
    return np.array([[cosh - 1.0, sinh - duration], [sinh, cosh - 1.0]])


class AffineFlights(NamedTuple):
    """Flights as maps z -> F z + shift of z = (angle, velocity); `shifts` (3, 2) by side, 1 or -1."""

    cosh: float
    sinh: float
    shifts: np.ndarray

    @property
    def matrix(self) -> Array:
        """F (2, 2)."""
        return np.array([[self.cosh, self.sinh], [self.sinh, self.cosh]])


class ContactLaw(NamedTuple):
    """What a side of a block has at zero angle: u'' = -gravity + part s f, u = s x; 1 if slender.

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
    """Flights u'' = u - gravity + part s f of both sides, from any P and P' at their start and their end."""
    cosh, sinh = math.cosh(duration), math.sinh(duration)
    shifts, ends = np.zeros((3, 2)), (p0, q0, p1, q1)
    for side in (1, -1):
        balanced = side * contact[side].gravity
        p0, q0, p1, q1 = (contact[side].part * value for value in ends)
        shifts[side] = balanced + p1 - cosh * (balanced + p0) - sinh * q0, q1 - sinh * (balanced + p0) - cosh * q0
    return AffineFlights(cosh, sinh, shifts)


def accumulated_covariance(weights: Array, left: Array) -> tuple[Array, Array, Array]:
    """Covariance (xx, xv, vv) that noise of strengths 2 D dt, at times `left` before the end, gathers in a flight."""
    sinh, cosh = np.sinh(left), np.cosh(left)
    return weights @ sinh**2, weights @ (sinh * cosh), weights @ cosh**2


def flight_shears(duration: float) -> tuple[float, float]:
    """(tanh(t/2), sinh t): the shears of which a flight is made, in the order 1, 2, 1.

    The first adds tanh(t/2) v to x - s, the second sinh t (x - s) to v.
    """
    return math.tanh(0.5 * duration), math.sinh(duration)


def shear_diffusion_variances(diffusion: float, duration: float) -> tuple[float, float]:
    """(velocity's, angle's): variances by which noise spreads each between the shears of a flight (docs/theory).

    The velocity is spread once, the angle twice.
    """
    shear, sinh = flight_shears(duration)
    if duration < 0.1:
        square = duration * duration
        deficit = square / 6.0 * (1.0 - square * (7.0 / 60.0) * (1.0 - square * (31.0 / 294.0)))
    else:
        deficit = 1.0 - duration / sinh
    return diffusion * (sinh + duration * math.cosh(duration)), diffusion * shear * deficit
