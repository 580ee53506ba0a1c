"""Flights of the slender block in plain numbers and tables: the particular solution P of P'' = P + f, and what it adds.

Nothing here is compiled, so that a forcing can use it without a compiler. P is the bounded solution where it is said;
every other one differs from it by a flight without force.
"""

import math
from typing import NamedTuple

import numpy as np

from fpk_rocking.base.types import Array, Number
from fpk_rocking.physics.motion import TERMS


def dynamic_stiffness(frequency: float) -> float:
    """Return 1 + ω²: a force of this frequency is that many times its P, with the other sign."""
    return 1.0 + frequency * frequency


def particular_series(p: Number, q: Number, force: Array) -> Array:
    """Taylor coefficients (n, TERMS) of P from P and P' at n instants, (n,) each, and those of f (n, TERMS)."""
    out = np.empty((len(force), TERMS))
    out[:, 0], out[:, 1] = p, q
    for k in range(TERMS - 2):
        out[:, k + 2] = (out[:, k] + force[:, k]) / ((k + 1) * (k + 2))
    return out


def force_series(particular: Array) -> Array:
    """Taylor coefficients (n, TERMS) of f = P'' - P from those of P."""
    order = np.arange(1, TERMS - 1)
    out = -particular
    out[:, :-2] += order * (order + 1.0) * particular[:, 2:]
    return out


def particular_at(particular: Array, times: Array) -> tuple[Array, Array]:
    """P and P' (n,) each at a time since the instant of their Taylor coefficients (n, TERMS)."""
    order = np.arange(TERMS)
    return particular @ times**order, particular[:, 1:] @ (order[1:] * times ** order[:-1])


def forced_response(p0: float, q0: float, p1: float, q1: float, duration: float) -> tuple[float, float]:
    """Angle and velocity that a force adds to a flight, from P and P' at the flight's begin and end."""
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


def affine_flights(p0: float, q0: float, p1: float, q1: float, duration: float) -> AffineFlights:
    """Return the flights of both sides, from P and P' at their begin and end, as `AffineFlights`."""
    cosh, sinh = math.cosh(duration), math.sinh(duration)
    shifts = np.zeros((3, 2))
    for side in (1, -1):
        shifts[side] = side + p1 - cosh * (side + p0) - sinh * q0, q1 - sinh * (side + p0) - cosh * q0
    return AffineFlights(cosh, sinh, shifts)


def linear_force_response(duration: float) -> Array:
    """Angle and velocity (rows) that the forces 1 and t (columns), t since its begin, add to a flight."""
    cosh, sinh = math.cosh(duration), math.sinh(duration)
    return np.array([[cosh - 1.0, sinh - duration], [sinh, cosh - 1.0]])


def cosh_sinh(duration: float) -> Array:
    """Cosh and sinh (2,) of a duration: the matrix of a flight has the first on its diagonal, the second beside it."""
    return np.array([math.cosh(duration), math.sinh(duration)])


def impulse_response(left: Array) -> Array:
    """Angle and velocity, stacked, at the end of a flight, to an impulse at a time `left` before it."""
    return np.stack([np.sinh(left), np.cosh(left)])
