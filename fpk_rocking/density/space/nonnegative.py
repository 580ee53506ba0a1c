"""A non-negative view of a density with small negative parts, which keeps the mass and moves it as little as it can.

Every cell is written in Bernstein polynomials on equal pieces of it, as many a side as the degree. These are positive
and sum to 1, so the density lies above the least of its coefficients, and their average is its mean. Where one is
negative, those of the cell are cut off at zero and scaled back to the cell's mass. A cell whose mass itself is negative
is emptied at the cost of the cells around it. Derived in docs/numerics.md.
"""

import math

import numpy as np

from fpk_rocking.density.space.space import gauss, shapes

# What is evaluated or integrated is rounded by some 1e-13 of the largest coefficient of a cell at most. Coefficients
# above this share of it are therefore non-negative in floating point too, and taken as they are the next time.
_MARGIN = 1e-12
# Means below this are taken for zero: the margin above must not meet the smallest numbers there are.
_EMPTY = 1e-290
_ROUNDING = 1e-14


def nonnegative_view(space, coefficients):
    """Non-negative density with the same mass in every cell, except for cells of negative mass and those around them.

    Parameters
    ----------
    space : Space
    coefficients : ndarray, shape ``space.shape``

    Returns
    -------
    space : Space
        The given one where the density is non-negative already, else that of the pieces.
    coefficients : ndarray, shape ``space.shape``
        Those given, or those of the view.

    Raises
    ------
    ValueError
        The mass on one side of x = 0 is negative in total: the view moves none across.
    """
    mean, masses = coefficients[:, :, 0, 0], space.masses(coefficients)
    allowed = _redistributed(masses, space.first_positive)
    kept = np.divide(allowed, masses, out=np.zeros_like(masses), where=mean >= _EMPTY)
    scaled = coefficients * kept[:, :, None, None]
    pieces = max(space.degree, 1)
    inward, outward = _tables(space.degree, pieces)
    # Many small products: a library's threads only get in each other's way.
    control = inward @ scaled @ inward.T
    high = control.max(axis=(2, 3))
    cut = control.min(axis=(2, 3)) < _MARGIN * high
    if np.array_equal(scaled, coefficients) and not cut.any():
        return space, coefficients
    above = np.maximum(control[cut], 2.0 * _MARGIN * high[cut, None, None])
    control[cut] = above * (scaled[cut, 0, 0] / above.mean(axis=(1, 2)))[:, None, None]
    fine = space.refined(pieces)
    parts = (outward.T @ control @ outward).reshape(*masses.shape, pieces, space.degree + 1, pieces, -1)
    parts = parts.transpose(0, 2, 1, 4, 3, 5).reshape(fine.shape)
    parts[parts[:, :, 0, 0] < _EMPTY] = 0.0
    return fine, parts


def _tables(degree, pieces):
    """Legendre coefficients of a cell to the Bernstein coefficients of its pieces, and these to Legendre ones."""
    nodes, weights = gauss(degree + 1)
    values = _bernstein(nodes, degree)
    within = shapes((np.arange(pieces)[:, None] + nodes) / pieces, degree)
    inward = np.linalg.solve(values, within).reshape(-1, degree + 1)
    return inward, np.kron(np.eye(pieces), (values.T * weights) @ shapes(nodes, degree))


def _bernstein(points, degree):
    """Bernstein polynomials on [0, 1]: values (n, degree + 1) at points (n,)."""
    k = np.arange(degree + 1)
    return np.array([math.comb(degree, i) for i in k]) * points[:, None] ** k * (1.0 - points[:, None]) ** k[::-1]


def _redistributed(masses, first_positive):
    """Masses of the cells, none negative: each side of x = 0 settles its own."""
    out = np.empty_like(masses)
    rounding = _ROUNDING * np.abs(masses).sum()
    for name, side in (("angle < 0", slice(None, first_positive)), ("angle > 0", slice(first_positive, None))):
        total = masses[side].sum()
        if total < -rounding:
            raise ValueError(
                f"density: got the mass {total:.1e} on the side {name}, accepted: 0 or more; the mesh does not resolve "
                "this density: try a smaller tol"
            )
        out[side] = _settled(masses[side]) if total > 0.0 else 0.0
    return out


def _settled(masses):
    """Masses with every negative one paid for by the smallest square of cells around it that can pay.

    In rounds of growing squares, all at once, so that no order of the cells matters: a cell asks the positive cells of
    its square in proportion to their masses; one that is asked for more than it has gives all, in proportion to what it
    is asked for. Every pass settles all that ask, or empties a cell: the rounds end.
    """
    given, owed = np.maximum(masses, 0.0), np.maximum(-masses, 0.0)
    for reach in range(1, max(masses.shape)):
        while owed.any():
            around = _square_sums(given, reach)
            asking = (owed > 0.0) & (around >= owed)
            if not asking.any():
                break
            share = np.divide(owed, around, out=np.zeros_like(owed), where=asking)
            asked = _square_sums(share, reach)
            paid = share * _square_sums(given / np.maximum(asked, 1.0), reach)
            short = _square_sums(np.where((asked > 1.0) & (given > 0.0), 1.0, 0.0), reach) > 0.0
            owed = np.where(asking & ~short, 0.0, np.maximum(owed - paid, 0.0))
            given = given * np.maximum(1.0 - asked, 0.0)
    # Rounding may leave something owed where the total is about zero.
    return given * (1.0 - owed.sum() / max(given.sum(), owed.sum())) if owed.any() else given


def _square_sums(values, reach):
    """Return sums over the squares of cells that reach so far to all sides, each added up by itself: none cancels."""
    from scipy.ndimage import convolve1d

    window = np.ones(2 * reach + 1)
    return convolve1d(convolve1d(values, window, axis=0, mode="constant"), window, axis=1, mode="constant")
