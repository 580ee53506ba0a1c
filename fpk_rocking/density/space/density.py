"""A density of angle and velocity at one instant, as a function."""

import dataclasses
from collections.abc import Callable
from typing import Any, Self

import numpy as np

from fpk_rocking.base.types import Array, ArrayLike
from fpk_rocking.density.space.nonnegative import nonnegative_view
from fpk_rocking.density.space.space import Space, shapes


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class Density:
    """Joint density of angle and velocity of the blocks that stand; its integral is the survival probability.

    It is a piecewise polynomial on a mesh of the phase plane. Calling it evaluates it: ``density(angle, velocity)``.

    Parameters
    ----------
    space : Space
        Mesh and polynomial degree.
    coefficients : ndarray, shape ``space.shape``
        Coefficients of the polynomials.

    Examples
    --------
    >>> from fpk_rocking import load_scene, solve_fpk
    >>> density = solve_fpk(load_scene("main"), cycles=4, tol=1e-2).at(4)
    >>> print(density(-0.2, [0.8, 0.9, 1.0]).round(1), density.mean.round(2))
    [0.5 2.  2.4] [-0.31  0.5 ]
    >>> print(f"{density.integral(lambda angle, velocity: angle**2):.2f}")
    0.32
    """

    space: Space
    coefficients: np.ndarray

    def __repr__(self) -> str:
        cells = " x ".join(str(line.size - 1) for line in self.mesh_lines)
        mass = float(self.space.masses(self.coefficients).sum())
        return f"<Density: probability {mass:.4f} on {cells} cells of degree {self.degree}>"

    def __call__(self, angle: ArrayLike, velocity: ArrayLike) -> Array:
        """Evaluate the density at points.

        Parameters
        ----------
        angle, velocity : array_like
            Points, broadcast against each other; nondimensional.

        Returns
        -------
        ndarray
            Of the broadcast shape; 0 outside the mesh, nan where angle or velocity is nan. At angle 0, where the
            density jumps, it is the value on the positive side.
        """
        unknown = np.isnan(angle) | np.isnan(velocity)
        return np.where(unknown, np.nan, self.space.evaluate(self.coefficients, angle, velocity))

    @property
    def mesh_lines(self) -> tuple[Array, Array]:
        """Mesh lines (angle, velocity), nondimensional."""
        return self.space.angle_lines, self.space.velocity_lines

    @property
    def degree(self) -> int:
        """Polynomial degree in each direction."""
        return self.space.degree

    def cell_values(self, points: int) -> Array:
        """Density on a lattice of points in every cell; on an edge of the cell, its limit from inside.

        Parameters
        ----------
        points : int
            Number of equally spaced points along each axis, both edges included.

        Returns
        -------
        ndarray, shape (angle cells, velocity cells, points, points)
            The last two axes are angle and velocity within a cell.
        """
        lattice = np.linspace(0.0, 1.0, points)
        return self.space.cell_values(self.coefficients, lattice, lattice)

    def nonnegative(self) -> Self:
        """Return a density near this one that is nowhere negative, for pictures and sampling.

        Mass moves only within a cell of the mesh. A cell of negative mass becomes empty, and the smallest square of
        cells around it that holds enough mass makes up for it, on the same side of x = 0. The L1 distance from this
        density is at least twice its negative mass, and in practice a few times that (docs/numerics.md).

        Returns
        -------
        Density
            Of the same mass, to rounding. It is this density itself where that is non-negative already, else a density
            on a mesh with degree × degree pieces a cell.

        Raises
        ------
        ValueError
            One side of x = 0 has negative mass in total.
        """
        space, coefficients = nonnegative_view(self.space, self.coefficients)
        return self if space is self.space else Density(space, coefficients)

    def bin_probabilities(
        self, angle_edges: ArrayLike, velocity_edges: ArrayLike, *, nonnegative: bool = False
    ) -> Array:
        """Integrate the density exactly over each of some bins.

        Parameters
        ----------
        angle_edges, velocity_edges : array_like
            Ascending bin edges, nondimensional.
        nonnegative : bool
            Whether to integrate what `nonnegative` returns instead of the density as it was computed.

        Returns
        -------
        ndarray, shape (angle bins, velocity bins)

        Raises
        ------
        ValueError
            As `nonnegative`, where it is asked for.
        """
        law = self.nonnegative() if nonnegative else self
        return law.space.bin_integrals(law.coefficients, angle_edges, velocity_edges)

    def marginal_angle(self, angle: ArrayLike) -> Array:
        """Density of the angle alone: the integral over all velocities.

        Parameters
        ----------
        angle : array_like, shape (n,)
            Points, nondimensional.

        Returns
        -------
        ndarray, shape (n,)
        """
        coefficients = np.einsum("xva,v->xa", self.coefficients[..., 0], np.diff(self.space.velocity_lines))
        return self._marginal(coefficients, 0, angle)

    def marginal_velocity(self, velocity: ArrayLike) -> Array:
        """Density of the velocity alone: the integral over all angles.

        Parameters
        ----------
        velocity : array_like, shape (n,)
            Points, nondimensional.

        Returns
        -------
        ndarray, shape (n,)
        """
        coefficients = np.einsum("xvb,x->vb", self.coefficients[..., 0, :], np.diff(self.space.angle_lines))
        return self._marginal(coefficients, 1, velocity)

    def _marginal(self, coefficients, axis, points):
        lines = self.mesh_lines[axis]
        points = np.asarray(points, dtype=float)
        cell = np.clip(np.searchsorted(lines, points, side="right") - 1, 0, len(lines) - 2)
        reference = (points - lines[cell]) / np.diff(lines)[cell]
        values = np.einsum("...a,...a->...", coefficients[cell], shapes(reference, self.degree))
        return np.where(np.isnan(points), np.nan, np.where((points >= lines[0]) & (points <= lines[-1]), values, 0.0))

    def basis(self, order: int | None = None) -> Any:
        """Return the scikit-fem basis of the density, on which `vector` holds its unknowns.

        Parameters
        ----------
        order : int, optional
            Polynomial degree that its quadrature integrates exactly; by default twice the degree of the density.

        Returns
        -------
        skfem.CellBasis
        """
        return self.space.basis(order)

    @property
    def vector(self) -> Array:
        """Unknowns of the density on `basis`, shape (n,), for forms and functionals of scikit-fem."""
        return self.coefficients.ravel()

    def integral(self, function: Callable[[Array, Array], Array], order: int | None = None) -> float:
        """Integral of a function of angle and velocity times the density.

        Parameters
        ----------
        function : callable
            Takes arrays of angles and velocities and returns an array of their shape. A function that jumps within a
            cell needs a higher `order`.
        order : int, optional
            Polynomial degree up to which the product of function and density is integrated exactly; by default twice
            the degree of the density, plus 2.

        Returns
        -------
        float
            Divided by the survival probability it is the mean of the function over the blocks that stand.
        """
        from skfem import Functional

        basis = self.basis(2 * self.degree + 2 if order is None else order)
        form = Functional(lambda w: function(w.x[0], w.x[1]) * w["density"])
        return float(form.assemble(basis, density=basis.interpolate(self.vector)))

    def moment(self, angle_power: int, velocity_power: int) -> float:
        """Integral of x^m v^n times the density, exact.

        Parameters
        ----------
        angle_power, velocity_power : int
            m and n, at least 0. The moment for m = n = 0 is the survival probability.

        Returns
        -------
        float
        """
        order = self.degree + max(angle_power, velocity_power)
        return self.integral(lambda x, v: x**angle_power * v**velocity_power, order)

    @property
    def mean(self) -> Array:
        """Mean of angle and velocity of the blocks that stand, shape (2,)."""
        return np.array([self.moment(1, 0), self.moment(0, 1)]) / self.moment(0, 0)

    @property
    def covariance(self) -> Array:
        """Covariance of angle and velocity of the blocks that stand, shape (2, 2)."""
        mixed = self.moment(1, 1)
        second = np.array([[self.moment(2, 0), mixed], [mixed, self.moment(0, 2)]]) / self.moment(0, 0)
        return second - np.outer(self.mean, self.mean)
