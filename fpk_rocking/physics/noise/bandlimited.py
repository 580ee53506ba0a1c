"""Interpolation of a band-limited signal between coarse samples, to 3e-12 from 1.6 times the fewest possible.

A sum of harmonics up to the frequency b is sampled at the spacing d <= pi/(OVERSAMPLING b), after each harmonic has
been divided by the transform of a window psi; then the signal is sum_k psi((t - t_k)/d) g_k. What folds over from other
bands is suppressed like exp(-pi WIDTH sqrt(1 - 1/OVERSAMPLING)), psi being a Kaiser-Bessel window of WIDTH samples
(J. F. Kaiser, R. W. Schafer, IEEE Trans. ASSP 28, 105-107, 1980; as in nonuniform Fourier transforms, D. Potts,
G. Steidl, M. Tasche, 2001). Between two samples each piece of psi is a polynomial, and so is the interpolant.
"""

import functools
import math

import numpy as np

from fpk_rocking.base.jit import kernel
from fpk_rocking.base.types import Array
from fpk_rocking.physics.motion import TERMS

WIDTH = 16
OVERSAMPLING = 1.6

_SHAPE = math.pi * WIDTH * (1.0 - 0.5 / OVERSAMPLING)
_ORDER = 20


def pieces(spacing: float) -> Array:
    """Polynomials of the interpolant between two samples.

    Parameters
    ----------
    spacing : float
        Distance d of the samples, nondimensional.

    Returns
    -------
    ndarray, shape (WIDTH, TERMS)
        Row i belongs to sample i - WIDTH/2 + 1 (0: at the interval's begin, 1: at its end); coefficients in the time
        since the interval's middle.
    """
    return (_window_pieces() * (2.0 / np.longdouble(spacing)) ** np.arange(TERMS, dtype=np.longdouble)).astype(float)


@functools.cache
def _window_pieces():
    """Polynomials (WIDTH, TERMS) of `pieces` for samples 2 apart; not to be written to."""
    # In long double where there is one: rounding of the window is what limits the derivative otherwise.
    order = np.arange(TERMS, dtype=np.longdouble)
    angles = np.longdouble("3.14159265358979323846264") * (order + 0.5) / TERMS
    nodes = np.cos(angles)
    window = _bessel(1.0 - ((nodes - 2.0 * order[:WIDTH, None] + (WIDTH - 1.0)) / WIDTH) ** 2) / _bessel(1.0)
    rows = window @ np.cos(order * angles[:, None]) * (2.0 / TERMS)
    rows[:, 0] *= 0.5
    return np.array([np.polynomial.chebyshev.cheb2poly(row) for row in rows])


def _bessel(square):
    """Evaluate I0(_SHAPE sqrt(square)) by its power series, all terms of which are positive."""
    square = np.asarray(square, np.longdouble) * np.longdouble(0.5 * _SHAPE) ** 2
    term = total = np.ones_like(square)
    for k in range(1, 120):
        term = term * square / (k * k)
        total = total + term
    return total


@functools.cache
def compensation() -> Array:
    """Return coefficients of 1/(transform of the window), a polynomial in 2 (b d OVERSAMPLING/pi)^2 - 1.

    Not to be written to.
    """
    nodes = np.cos(np.pi * (np.arange(_ORDER) + 0.5) / _ORDER)
    argument = np.sqrt(_SHAPE**2 - 0.5 * (1.0 + nodes) * (0.5 * WIDTH * math.pi / OVERSAMPLING) ** 2)
    inverse = float(np.i0(_SHAPE)) * argument / (WIDTH * np.sinh(argument))
    return np.polynomial.chebyshev.cheb2poly(np.polynomial.chebyshev.chebfit(nodes, inverse, _ORDER - 1))


@kernel(inline="always")
def compensate(coefficients, ratio):
    """Evaluate `compensation` at frequency * spacing * OVERSAMPLING / pi."""
    square = 2.0 * ratio * ratio - 1.0
    value = coefficients[_ORDER - 1]
    for k in range(_ORDER - 2, -1, -1):
        value = value * square + coefficients[k]
    return value
