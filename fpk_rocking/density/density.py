"""Functions on the phase plane, on a mesh: a density at one instant, and a probability or time by the start."""

import dataclasses
from collections.abc import Callable
from typing import Any

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.base.basis import legendre_basis, locate
from fpk_rocking.base.checks import Array, ArrayLike
from fpk_rocking.density.space import Space


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class PlaneFunction:
    """A function of angle and velocity that is a polynomial on each cell of a mesh of the phase plane."""

    space: Space
    coefficients: np.ndarray

    def __call__(self, angle: ArrayLike, velocity: ArrayLike) -> Array:
        """Evaluate the function at points: 0 outside the mesh, nan where angle or velocity is nan.

        On a mesh line, such as angle 0, where a density jumps, it is the value on the upper side. Where the function is
        steep it may be slightly below 0, and a probability slightly above 1.

        Parameters
        ----------
        angle, velocity : array_like
            Broadcast against each other; nondimensional.
        """
        unknown = np.isnan(angle) | np.isnan(velocity)
        return np.where(unknown, np.nan, self.space.evaluate(self.coefficients, angle, velocity))

    @property
    def mesh_lines(self) -> tuple[Array, Array]:
        """Mesh lines (angle, velocity), arrays (angle cells + 1,) and (velocity cells + 1,), nondimensional."""
        return self.space.lines

    @property
    def degree(self) -> int:
        """Polynomial degree in each direction."""
        return self.space.degree

    def cell_values(self, points: int) -> Array:
        """Values on a lattice in every cell, shape (angle cells, velocity cells, points, points); on edges from inside.

        Parameters
        ----------
        points : int
            Number of equally spaced points along each axis, both edges included.
        """
        lattice = np.linspace(0.0, 1.0, points)
        return self.space.cell_values(self.coefficients, lattice, lattice)

    @property
    def _cells_text(self) -> str:
        """Numbers of cells along angle and velocity, as "44 x 52 cells"."""
        return " x ".join(str(line.size - 1) for line in self.mesh_lines) + " cells"


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class Density(PlaneFunction):
    """Joint density of angle and velocity of the blocks that stand; its integral is the survival probability.

    Calling it evaluates it: ``density(angle, velocity)``.

    Parameters
    ----------
    space : Space
        Mesh and polynomial degree.
    coefficients : ndarray, shape ``space.shape``

    Examples
    --------
    >>> from fpk_rocking import load_scene, solve_fpk
    >>> density = solve_fpk(load_scene("main"), cycles=4, tol=1e-2).at(4)
    >>> print(density(-0.2, [0.8, 0.9, 1.0]).round(1), density.mean.round(2))
    [0.5 2.1 2.6] [-0.29  0.5 ]
    >>> print(f"{density.integral(lambda angle, velocity: angle**2):.2f}")
    0.31
    """

    def __repr__(self) -> str:
        mass = float(self.space.masses(self.coefficients).sum())
        return f"<Density: probability {mass:.4f} on {self._cells_text} of degree {self.degree}>"

    def bin_probabilities(self, angle_edges: ArrayLike, velocity_edges: ArrayLike) -> Array:
        """Integrate the density exactly over each of some bins: probabilities, shape (angle bins, velocity bins).

        Parameters
        ----------
        angle_edges, velocity_edges : array_like
            Ascending, nondimensional.
        """
        return self.space.bin_integrals(self.coefficients, angle_edges, velocity_edges)

    def marginal_angle(self, angle: ArrayLike) -> Array:
        """Density of the angle alone, shape (n,): the integral over all velocities; 0 outside the mesh, nan at nan.

        Parameters
        ----------
        angle : array_like, shape (n,)
            Nondimensional.
        """
        coefficients = np.einsum("xva,v->xa", self.coefficients[..., 0], np.diff(self.space.velocity_lines))
        return self._marginal(coefficients, 0, angle)

    def marginal_velocity(self, velocity: ArrayLike) -> Array:
        """Density of the velocity alone, shape (n,): the integral over all angles; 0 outside the mesh, nan at nan.

        Parameters
        ----------
        velocity : array_like, shape (n,)
            Nondimensional.
        """
        coefficients = np.einsum("xvb,x->vb", self.coefficients[..., 0, :], np.diff(self.space.angle_lines))
        return self._marginal(coefficients, 1, velocity)

    def _marginal(self, coefficients, axis, points):
        """Return the values (n,) at `points` (n,) of a piecewise polynomial of `coefficients` (cells, degree + 1)."""
        lines = self.mesh_lines[axis]
        points = np.asarray(points, dtype=float)
        cells, reference = locate(lines, points)
        values = np.einsum("...a,...a->...", coefficients[cells], legendre_basis(reference, self.degree))
        return np.where(np.isnan(points), np.nan, np.where((points >= lines[0]) & (points <= lines[-1]), values, 0.0))

    def basis(self, order: int | None = None) -> Any:
        """Return the `skfem.CellBasis` on which `vector` holds the unknowns: products of Legendre polynomials.

        Parameters
        ----------
        order : int, optional
            Polynomial degree that its quadrature integrates exactly; by default twice the degree of the density.
        """
        return self.space.basis(order)

    @property
    def vector(self) -> Array:
        """Unknowns of the density on `basis`, shape (n,), for forms and functionals of scikit-fem.

        `CycleOperator.matvec` takes other vectors: ``operator.vector(density.coefficients)``.
        """
        return self.coefficients.ravel()

    def integral(self, function: Callable[[Array, Array], Array], order: int | None = None) -> float:
        """Integral of a function of angle and velocity times the density.

        Divided by the survival probability it is the mean of the function over the blocks that stand.

        Parameters
        ----------
        function : callable
            Takes arrays of angles and velocities and returns an array of their shape.
        order : int, optional
            Polynomial degree up to which the product is integrated exactly; by default twice the degree of the density,
            plus 2. A function that jumps within a cell needs more.
        """
        from skfem import Functional

        basis = self.basis(2 * self.degree + 2 if order is None else order)
        form = Functional(lambda w: function(w.x[0], w.x[1]) * w["density"])
        return float(form.assemble(basis, density=basis.interpolate(self.vector)))

    def moment(self, angle_power: int, velocity_power: int) -> float:
        """Integral of x^m v^n times the density, exact, nondimensional; not divided by the survival probability.

        Parameters
        ----------
        angle_power, velocity_power : int
            m and n, at least 0.
        """
        for name, power in {"angle_power": angle_power, "velocity_power": velocity_power}.items():
            checks.count(name, power, at_least=0)
        order = self.degree + max(angle_power, velocity_power)
        return self.integral(lambda x, v: x**angle_power * v**velocity_power, order)

    @property
    def mean(self) -> Array:
        """Mean of angle and velocity of the blocks that stand, shape (2,), nondimensional."""
        return np.array([self.moment(1, 0), self.moment(0, 1)]) / self.moment(0, 0)

    @property
    def covariance(self) -> Array:
        """Covariance of angle and velocity of the blocks that stand, shape (2, 2), nondimensional."""
        mixed = self.moment(1, 1)
        second = np.array([[self.moment(2, 0), mixed], [mixed, self.moment(0, 2)]]) / self.moment(0, 0)
        return second - np.outer(self.mean, self.mean)


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class PlaneMap(PlaneFunction):
    """A probability, or a mean time, as a function of the state from which a block starts.

    Calling it evaluates it: ``survival_map(angle, velocity)``.

    Parameters
    ----------
    space : Space
        Mesh and polynomial degree.
    coefficients : ndarray, shape ``space.shape``
    phase : float
        Forcing phase Ψ at the start, radians.
    error_estimate : float
        Relative difference (L1) from the next coarser mesh.
    starts : tuple of (float, float, float)
        Angle, velocity and value of single starts that were solved forward in time, such as rest: the mesh does not
        resolve how noise sets off a block at rest.

    Examples
    --------
    >>> from fpk_rocking import CycleOperator, WhiteNoise, load_scene
    >>> operator = CycleOperator(load_scene("main").varied(noise=WhiteNoise(0.04)), tol=1e-2)
    >>> survival = operator.survival_map(2)
    >>> print(survival(0.0, [-1.0, 0.0, 1.0]).round(2))
    [0.47 0.84 0.  ]
    """

    phase: float
    error_estimate: float
    starts: tuple[tuple[float, float, float], ...] = ()

    def __repr__(self) -> str:
        return (
            f"<PlaneMap: integral {self.integral:.4g} on {self._cells_text}, estimated error {self.error_estimate:.1g}>"
        )

    def plot(self) -> Any:
        """Draw the values over the phase plane; returns a matplotlib Figure."""
        from fpk_rocking.results.pictures import figure_of, function_panel

        def values(figure, axes):
            function_panel(figure, axes, self, self.mesh_lines, f"value of the start, Ψ = {self.phase:.4g}", 1.0)

        return figure_of(values)

    def __call__(self, angle: ArrayLike, velocity: ArrayLike) -> Array:
        """Evaluate the function at points, as `PlaneFunction`; single `starts` have their own values."""
        values = super().__call__(angle, velocity)
        for x, v, value in self.starts:
            values = np.where((np.asarray(angle) == x) & (np.asarray(velocity) == v), value, values)
        return values

    @property
    def integral(self) -> float:
        """Integral over the phase plane, nondimensional; for a survival probability this is the safe area."""
        return float(self.space.masses(self.coefficients).sum())
