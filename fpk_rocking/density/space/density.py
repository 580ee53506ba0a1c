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
    """Joint density of the blocks that have not overturned; it integrates to their probability.

    Parameters
    ----------
    space : Space
        Mesh and polynomial degree.
    coefficients : ndarray, shape ``space.shape``
    """

    space: Space
    coefficients: np.ndarray

    def __repr__(self) -> str:
        cells = " x ".join(str(line.size - 1) for line in self.mesh_lines)
        mass = float(self.space.masses(self.coefficients).sum())
        return f"<Density: probability {mass:.4f} on {cells} cells of degree {self.degree}>"

    def __call__(self, angle: ArrayLike, velocity: ArrayLike) -> Array:
        """Density at points.

        Parameters
        ----------
        angle, velocity : array_like
            Points, broadcast against each other; nondimensional.

        Returns
        -------
        ndarray
            Of the broadcast shape; 0 outside the mesh, nan where a point has one. At angle 0 it is the value on the
            positive side.
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
        """Density on a lattice in every cell, one-sided at its edges.

        Parameters
        ----------
        points : int
            Equispaced points an axis, both edges included.

        Returns
        -------
        ndarray, shape (angle cells, velocity cells, points, points)
            Angle before velocity.
        """
        lattice = np.linspace(0.0, 1.0, points)
        return self.space.cell_values(self.coefficients, lattice, lattice)

    def nonnegative(self) -> Self:
        """View of this density that is nowhere negative, for pictures and sampling; the density stays as it is.

        Mass moves within a cell of the mesh only, and the mass of a cell stays. A cell of negative mass becomes empty
        at the cost of the smallest square of cells around it that can pay, on its side of x = 0. The L1 distance is at
        least twice the negative mass, as for every non-negative density of the same mass, and in practice a few times
        that (docs/numerics.md).

        Returns
        -------
        Density
            Of the same mass, to rounding, and non-negative wherever it is evaluated or integrated. This density itself
            where it is non-negative already; else on the mesh cut into degree × degree pieces a cell, continuous
            within the cells of this one.

        Raises
        ------
        ValueError
            The mass on one side of x = 0 is negative in total: the view moves none across.
        """
        space, coefficients = nonnegative_view(self.space, self.coefficients)
        return self if space is self.space else Density(space, coefficients)

    def bin_probabilities(
        self, angle_edges: ArrayLike, velocity_edges: ArrayLike, *, nonnegative: bool = False
    ) -> Array:
        """Exact integrals over bins.

        Parameters
        ----------
        angle_edges, velocity_edges : array_like
            Ascending bin edges, nondimensional.
        nonnegative : bool
            Whether to integrate the view `nonnegative` instead of the density as it was computed.

        Returns
        -------
        ndarray, shape (angle bins, velocity bins)

        Raises
        ------
        ValueError
            There is no such view.
        """
        law = self.nonnegative() if nonnegative else self
        return law.space.bin_integrals(law.coefficients, angle_edges, velocity_edges)

    def marginal_angle(self, angle: ArrayLike) -> Array:
        """Density of the angle alone at points (n,): the integral over all velocities."""
        coefficients = np.einsum("xva,v->xa", self.coefficients[..., 0], np.diff(self.space.velocity_lines))
        return self._marginal(coefficients, 0, angle)

    def marginal_velocity(self, velocity: ArrayLike) -> Array:
        """Density of the velocity alone at points (n,): the integral over all angles."""
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
        """Return the scikit-fem basis of the density; ``vector`` holds its unknowns. See `Space.basis`."""
        return self.space.basis(order)

    @property
    def vector(self) -> Array:
        """Unknowns (n,) of the density on `basis`, for forms and functionals of scikit-fem."""
        return self.coefficients.ravel()

    def integral(self, function: Callable[[Array, Array], Array], order: int | None = None) -> float:
        """Integral of a function of angle and velocity times the density.

        Parameters
        ----------
        function : callable
            Takes arrays of angles and velocities, returns an array of their shape. Where it jumps within a cell the
            quadrature is as good as its points are many.
        order : int, optional
            Polynomial degree up to which function times density is integrated exactly; by default twice the density's
            degree and 2 more.

        Returns
        -------
        float
            Over the blocks that have not overturned: divide by ``integral`` of 1 for their mean.
        """
        from skfem import Functional

        basis = self.basis(2 * self.degree + 2 if order is None else order)
        form = Functional(lambda w: function(w.x[0], w.x[1]) * w["density"])
        return float(form.assemble(basis, density=basis.interpolate(self.vector)))

    def moment(self, angle_power: int, velocity_power: int) -> float:
        """Integral of x^m v^n times the density, exact; m = n = 0 is the probability of not having overturned."""
        order = self.degree + max(angle_power, velocity_power)
        return self.integral(lambda x, v: x**angle_power * v**velocity_power, order)

    @property
    def mean(self) -> Array:
        """Mean (2,) of angle and velocity of the blocks that have not overturned."""
        return np.array([self.moment(1, 0), self.moment(0, 1)]) / self.moment(0, 0)

    @property
    def covariance(self) -> Array:
        """Covariance (2, 2) of angle and velocity of the blocks that have not overturned."""
        mixed = self.moment(1, 1)
        second = np.array([[self.moment(2, 0), mixed], [mixed, self.moment(0, 2)]]) / self.moment(0, 0)
        return second - np.outer(self.mean, self.mean)
