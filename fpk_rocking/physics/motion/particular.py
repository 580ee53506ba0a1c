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


def affine_flights(
    p0: float, q0: float, p1: float, q1: float, duration: float, saddle: float = 1.0
) -> AffineFlights:
    """Return the `AffineFlights` of both sides over a duration, nondimensional: x'' = x - s m + f, with the `saddle` m.

    `p0`, `q0` are P and P' at their begin, and `p1`, `q1` at their end.
    """
    cosh, sinh = math.cosh(duration), math.sinh(duration)
    shifts = np.zeros((3, 2))
    for side in (1, -1):
        balanced = side * saddle
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
