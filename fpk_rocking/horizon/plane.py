"""What the one-cycle operator answers: survival from the start of the scene, and by the adjoint from every start."""

import dataclasses
from typing import Any, NamedTuple

import numpy as np

from fpk_rocking.base.checks import Array, ArrayLike
from fpk_rocking.density.space import Space


class SurvivalEstimate(NamedTuple):
    """Survival from the scene's start after given numbers of cycles, with error estimates.

    Parameters
    ----------
    cycles : ndarray of int, shape (n,)
        The numbers of cycles.
    survival : ndarray, shape (n,)
        Probability of not having overturned.
    left_out : ndarray, shape (n,)
        Estimated error from representing the density by its leading modes, where that is done.
    error_estimate : ndarray, shape (n,)
        Estimated error of survival: from the next coarser mesh and from the error of the escape rate, plus `left_out`.

    Examples
    --------
    >>> from fpk_rocking import CycleOperator, WhiteNoise, load_scene
    >>> operator = CycleOperator(load_scene("main").varied(noise=WhiteNoise(0.04)), tol=1e-2)
    >>> estimate = operator.estimate_survival([2, 4])
    >>> print(estimate.survival.round(2), estimate.error_estimate < 1e-2)
    [0.84 0.5 ] [ True  True]
    """

    cycles: np.ndarray
    survival: np.ndarray
    left_out: np.ndarray
    error_estimate: np.ndarray


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class PlaneMap:
    """A probability, or a mean time, as a function of the state from which a block starts.

    Calling it evaluates it: ``survival_map(angle, velocity)``.

    Parameters
    ----------
    space : Space
        Mesh and polynomial degree.
    coefficients : ndarray, shape ``space.shape``
        Coefficients of the polynomials.
    phase : float
        Forcing phase Ψ at the start, radians.
    error_estimate : float
        Relative difference (L1) from the next coarser mesh.
    starts : tuple of (float, float, float)
        Angle, velocity and value of single starts that were solved forward in time, such as rest. There they replace
        the function on the mesh, which does not resolve how noise sets off a block at rest.

    Examples
    --------
    >>> from fpk_rocking import CycleOperator, WhiteNoise, load_scene
    >>> operator = CycleOperator(load_scene("main").varied(noise=WhiteNoise(0.04)), tol=1e-2)
    >>> survival = operator.survival_map(2)
    >>> print(survival(0.0, [-1.0, 0.0, 1.0]).round(2))
    [0.47 0.84 0.  ]
    """

    space: Space
    coefficients: np.ndarray
    phase: float
    error_estimate: float
    starts: tuple[tuple[float, float, float], ...] = ()

    def __repr__(self) -> str:
        cells = " x ".join(str(line.size - 1) for line in self.mesh_lines)
        return f"<PlaneMap: integral {self.integral:.4g} on {cells} cells, estimated error {self.error_estimate:.1g}>"

    def plot(self) -> Any:
        """Draw the values over the phase plane; returns a matplotlib Figure."""
        from fpk_rocking.results.pictures import figure_of, function_panel

        def values(figure, axes):
            """Draw the values over the phase plane on matplotlib's `axes`, with a colour bar in `figure`."""
            function_panel(figure, axes, self, self.mesh_lines, f"value of the start, Ψ = {self.phase:.4g}", 1.0)

        return figure_of(values)

    def __call__(self, angle: ArrayLike, velocity: ArrayLike) -> Array:
        """Evaluate the function at points.

        Parameters
        ----------
        angle, velocity : array_like
            Points, broadcast against each other; nondimensional.

        Returns
        -------
        ndarray
            Of the broadcast shape; 0 outside the mesh, where a block has overturned. Where the function is steep it
            may be slightly below 0 or, a probability, above 1. On a mesh line it is the value on the upper side.
        """
        values = self.space.evaluate(self.coefficients, angle, velocity)
        for x, v, value in self.starts:
            values = np.where((np.asarray(angle) == x) & (np.asarray(velocity) == v), value, values)
        return values

    @property
    def mesh_lines(self) -> tuple[Array, Array]:
        """Mesh lines (angle, velocity), arrays (angle cells + 1,) and (velocity cells + 1,), nondimensional."""
        return self.space.lines

    @property
    def degree(self) -> int:
        """Polynomial degree in each direction, an int."""
        return self.space.degree

    def cell_values(self, points: int) -> Array:
        """Values on a lattice of points in every cell; on an edge of the cell, the limit from inside.

        Parameters
        ----------
        points : int
            Number of equally spaced points along each axis, both edges included.

        Returns
        -------
        ndarray, shape (angle cells, velocity cells, points, points)
        """
        lattice = np.linspace(0.0, 1.0, points)
        return self.space.cell_values(self.coefficients, lattice, lattice)

    @property
    def integral(self) -> float:
        """Integral over the phase plane, nondimensional; for a survival probability this is the safe area."""
        return float(self.space.masses(self.coefficients).sum())
