"""The discontinuous Galerkin space on a tensor mesh of the phase plane: its mesh lines, and integrals over it.

Coefficients are stored as (angle cells, velocity cells, angle degree + 1, velocity degree + 1), which is scikit-fem's
own numbering of the unknowns, cell by cell with the velocity fastest: raveled they are a vector on `Space.basis`. Hot
paths use that a tensor mesh and its shape functions are products; all else is scikit-fem's.
"""

import dataclasses
import functools
import math
from typing import NamedTuple

import numpy as np

from fpk_rocking.base.basis import find_cells, gauss_legendre, legendre_basis, locate
from fpk_rocking.density.tuning import TUNING
from fpk_rocking.physics.motion.equation import block_of_scene, largest_correction


def graded_lines(half_width, cells, exponent):
    """Symmetric mesh lines on [-half_width, half_width] at half_width (j/n)^exponent, with 0 among them."""
    half = half_width * (np.arange(cells // 2 + 1) / (cells // 2)) ** exponent
    return np.concatenate([-half[:0:-1], half])


def extended_lines(lines, half_width, growth=TUNING.cell_growth):
    """Symmetric mesh lines continued to a wider interval by cells that grow, each by the factor `growth` or so."""
    gap, size = half_width - lines[-1], lines[-1] - lines[-2]
    if gap <= 0.0:
        return lines
    count = math.ceil(math.log1p(gap / size * (growth - 1.0) / growth) / math.log(growth) - 1e-9)
    places = np.cumsum(growth ** np.arange(count))
    beyond = lines[-1] + gap * places / places[-1]
    beyond[-1] = half_width
    return np.concatenate([-beyond[::-1], lines, beyond])


def patch_lines(low, high, cells):
    """Return mesh lines (n + 1,) of about `cells` equal cells that cover [low, high], nondimensional."""
    size = (high - low) / cells
    if low > size or high < -size:
        return np.linspace(low, high, cells + 1)
    first, last = math.floor(min(low, 0.0) / size + 1e-9), math.ceil(max(high, 0.0) / size - 1e-9)
    return size * np.arange(first, last + 1)


def exact_correction(scene):
    """Return a bound of how far a block's acceleration exceeds the slender block's, x - s m + f, nondimensional."""
    block = block_of_scene(scene)
    sides = zip(block.saddles, block.scales, strict=True)
    return max(largest_correction(scene.forcing.largest, block.critical_angle, *side) for side in sides)


def escape_speed(scene, diffusion):
    """Return the speed outward, nondimensional, above which a block of a scene surely overturns."""
    noise = TUNING.deviations * math.sqrt(diffusion)
    farthest = max(*block_of_scene(scene).saddles, scene.overturning.angle - 1.0)
    return farthest + scene.forcing.swing + exact_correction(scene) + noise


def velocity_bound(scene, diffusion):
    """Bound of |v| for the mesh of a scene, one number, nondimensional: the largest of those outward and inward."""
    forcing, start, exact = scene.forcing, scene.start, exact_correction(scene)
    bound = escape_speed(scene, diffusion)
    (xx, xv), (_, vv) = start.covariance or ((0.0, 0.0), (0.0, 0.0))
    outward = abs(start.velocity) + TUNING.deviations * math.sqrt(vv)
    position, slope = forcing.particular(0.0)
    now = position - slope
    spread = TUNING.deviations * math.sqrt(max(xx + vv - 2.0 * xv, 0.0))
    excess = max(side * (start.angle - start.velocity - now) for side in (1.0, -1.0)) - 1.0 + exact + spread
    falls = start.angle * start.velocity < 0.0 or start.covariance is not None
    return max(bound + (max(excess, 0.0) if falls else 0.0), TUNING.start_margin * outward)


class CellSearch(NamedTuple):
    """Tables that find the cell of a point in mesh lines, see `step.scatter.locate_point`."""

    lines: np.ndarray  # (cells + 1,)
    scales: np.ndarray  # (cells,)
    table: np.ndarray  # (entries,)
    density: float

    @classmethod
    def of(cls, lines):
        """Return the `CellSearch`, tables that find a point's cell, of mesh lines (cells + 1,), ascending."""
        sizes = np.diff(lines)
        count = int(min(np.ceil((lines[-1] - lines[0]) / sizes.min() * (1.0 + 1e-9)) + 1, TUNING.search_entries))
        density = count / (lines[-1] - lines[0])
        cells = find_cells(lines, lines[0] + np.arange(count + 1) / density)
        return cls(lines, 2.0 / sizes, cells.astype(np.int32), density)


@dataclasses.dataclass(frozen=True, eq=False)
class Space:
    """Mesh of rectangles in the phase plane with a polynomial on each of them (discontinuous Galerkin).

    ``space.shape`` is the shape of a density's coefficients: (angle cells, velocity cells, degree + 1, degree + 1).

    Parameters
    ----------
    angle_lines, velocity_lines : ndarray
        Ascending mesh lines, nondimensional. Angle 0 is a mesh line where it lies inside the mesh.
    degree : int
        Polynomial degree in each direction.

    Examples
    --------
    >>> from fpk_rocking import load_scene, solve_fpk
    >>> density = solve_fpk(load_scene("main"), cycles=4, tol=1e-2)
    >>> print(density.space.degree, density.coefficients.shape == (5, *density.space.shape))
    3 True
    """

    angle_lines: np.ndarray
    velocity_lines: np.ndarray
    degree: int

    @property
    def lines(self):
        """Mesh lines (angle, velocity), arrays (angle cells + 1,) and (velocity cells + 1,), nondimensional."""
        return self.angle_lines, self.velocity_lines

    @property
    def shape(self):
        """Shape of the coefficients of one density: (angle cells, velocity cells, degree + 1, degree + 1)."""
        return len(self.angle_lines) - 1, len(self.velocity_lines) - 1, self.degree + 1, self.degree + 1

    @property
    def unknowns(self):
        """Number of coefficients of one density, an int."""
        return int(np.prod(self.shape))

    @functools.cached_property
    def areas(self):
        """Areas of the cells, (angle cells, velocity cells), nondimensional."""
        return np.outer(np.diff(self.angle_lines), np.diff(self.velocity_lines))

    @functools.cached_property
    def first_positive(self):
        """Index, an int, of the first angle cell on the side x > 0."""
        return int(np.searchsorted(self.angle_lines, 0.0, side="left"))

    @functools.cached_property
    def cell_searches(self):
        """The tables `CellSearch` that find the cell of an angle, and that of a velocity: a tuple of two."""
        return tuple(map(CellSearch.of, self.lines))

    def basis(self, order=None):
        """Return the scikit-fem basis, on whose unknowns ``coefficients.ravel()`` is a vector."""
        from skfem import Basis, MeshQuad

        mesh = MeshQuad.init_tensor(self.angle_lines, self.velocity_lines)
        return Basis(mesh, legendre_element(self.degree), intorder=2 * self.degree if order is None else order)

    def project(self, density, points):
        """Coefficients (angle cells, velocity cells, degree + 1, degree + 1) of a function's L2 projection."""
        nodes, weights = gauss_legendre(points)
        table = legendre_basis(nodes, self.degree) * weights[:, None]
        angle = self.angle_lines[:-1, None] + np.diff(self.angle_lines)[:, None] * nodes
        velocity = self.velocity_lines[:-1, None] + np.diff(self.velocity_lines)[:, None] * nodes
        values = density(angle[:, None, :, None], velocity[None, :, None, :])
        return np.ascontiguousarray(np.einsum("xvij,ia,jb->xvab", values, table, table, optimize=True))

    def transfer(self, coefficients, source):
        """Return coefficients, of this space's shape, of a density in another one, by exact L2 projection."""
        angle = _overlap_integrals(self.angle_lines, self.degree, source.angle_lines, source.degree)
        velocity = _overlap_integrals(self.velocity_lines, self.degree, source.velocity_lines, source.degree)
        return np.einsum("xayb,ybwd,vcwd->xvac", angle, coefficients.transpose(0, 2, 1, 3), velocity, optimize=True)

    def masses(self, coefficients):
        """Return the mass in each cell, (angle cells, velocity cells), by `coefficients` of the space's shape."""
        return coefficients[:, :, 0, 0] * self.areas

    def evaluate(self, coefficients, angle, velocity):
        """Return the density at points `angle`, `velocity`, an array of their broadcast shape; 0 outside the mesh."""
        angle, velocity = np.broadcast_arrays(np.asarray(angle, dtype=float), np.asarray(velocity, dtype=float))
        (i, xi), (j, eta) = locate(self.angle_lines, angle), locate(self.velocity_lines, velocity)
        along, across = legendre_basis(xi, self.degree), legendre_basis(eta, self.degree)
        values = np.einsum("...ab,...a,...b->...", coefficients[i, j], along, across)
        inside = (angle >= self.angle_lines[0]) & (angle <= self.angle_lines[-1])
        return np.where(
            inside & (velocity >= self.velocity_lines[0]) & (velocity <= self.velocity_lines[-1]), values, 0.0
        )

    def cell_values(self, coefficients, angle_points, velocity_points):
        """Density on a lattice of reference points in every cell: (angle cells, velocity cells, n, m)."""
        along, across = legendre_basis(angle_points, self.degree), legendre_basis(velocity_points, self.degree)
        return along @ coefficients @ across.T

    def bin_integrals(self, coefficients, angle_edges, velocity_edges):
        """Return exact integrals of densities over the rectangles between edges, (..., angle bins, velocity bins)."""
        left = _interval_integrals(self.angle_lines, angle_edges, self.degree)
        right = _interval_integrals(self.velocity_lines, velocity_edges, self.degree)
        return np.einsum("mxa,...xvab,nvb->...mn", left, coefficients, right, optimize=True)

    def negative_mass(self, coefficients, points=8):
        """Return the integral of max(-p, 0) by quadrature with `points` Gauss points an axis in every cell."""
        nodes, weights = gauss_legendre(points)
        values = np.maximum(-self.cell_values(coefficients, nodes, nodes), 0.0)
        return float(np.einsum("xvij,xv,i,j->", values, self.areas, weights, weights, optimize=True))

    def absolute_mass(self, coefficients):
        """Return the integral of |p|, a float, by Gauss quadrature; `coefficients` of p have the space's shape."""
        return float(self.masses(coefficients).sum()) + 2.0 * self.negative_mass(coefficients)


def reflected(coefficients):
    """Return the coefficients of densities reflected by (x, v) -> (-x, -v)."""
    signs = (-1.0) ** np.arange(coefficients.shape[-1])
    return np.ascontiguousarray(coefficients[..., ::-1, ::-1, :, :]) * np.outer(signs, signs)


def _overlap_integrals(lines, degree, source_lines, source_degree):
    """Return integrals of products of two sets of shape functions, (cells, modes, source cells, source modes)."""
    nodes, weights = gauss_legendre((degree + source_degree) // 2 + 1)
    breaks = np.union1d(lines, source_lines)
    low, sizes = breaks[:-1], np.diff(breaks)
    points = low[:, None] + sizes[:, None] * nodes
    out = np.zeros((len(lines) - 1, degree + 1, len(source_lines) - 1, source_degree + 1))
    both = []
    for edges, order in ((lines, degree), (source_lines, source_degree)):
        cell = find_cells(edges, low + 0.5 * sizes)
        both.append((cell, legendre_basis((points - edges[cell, None]) / np.diff(edges)[cell, None], order)))
    (target, left), (origin, right) = both
    parts = np.einsum("p,q,pqa,pqb->pab", sizes, weights, left, right) / np.diff(lines)[target, None, None]
    np.add.at(out, (target, slice(None), origin), parts)
    return out


def _interval_integrals(lines, edges, degree):
    """Integrals of all cells' shape functions over the intervals between edges, (intervals, cells, degree + 1)."""
    edges = np.asarray(edges, dtype=float)
    sizes = np.diff(lines)
    nodes, weights = gauss_legendre(degree // 2 + 1)
    low = np.clip((edges[:-1, None] - lines[:-1]) / sizes, 0.0, 1.0)
    high = np.clip((edges[1:, None] - lines[:-1]) / sizes, 0.0, 1.0)
    values = legendre_basis(low[..., None] + (high - low)[..., None] * nodes, degree)
    return np.einsum("mcq,mcqa->mca", (high - low)[..., None] * weights * sizes[:, None], values)


@functools.cache
def legendre_element(degree):
    """Return a scikit-fem element, an `ElementH1`, of products of orthonormal Legendre polynomials up to a `degree`."""
    from skfem.element import ElementH1
    from skfem.refdom import RefQuad

    shapes = [np.polynomial.Legendre.basis(k, domain=[0.0, 1.0]) * np.sqrt(2.0 * k + 1.0) for k in range(degree + 1)]

    class ElementQuadLegendre(ElementH1):
        """Element of scikit-fem whose shape functions are products of the polynomials on a quadrilateral."""

        refdom = RefQuad
        maxdeg = 2 * degree
        interior_dofs = (degree + 1) ** 2
        dofnames = ["u"] * (degree + 1) ** 2
        doflocs = np.full(((degree + 1) ** 2, 2), 0.5)

        def lbasis(self, X, i):
            a, b = divmod(i, degree + 1)
            velocity, angle = shapes[b], shapes[a]
            values = velocity(X[0]), angle(X[1])
            gradient = np.array([velocity.deriv()(X[0]) * values[1], values[0] * angle.deriv()(X[1])])
            return values[0] * values[1], gradient

    return ElementQuadLegendre()
