"""Functions of the start, by the adjoint: a probability or a mean time for every state of the phase plane at once."""

import dataclasses
from typing import Any

import numpy as np

from fpk_rocking.base.types import Array, ArrayLike
from fpk_rocking.density.space.space import Space


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class PlaneMap:
    """A function of the state (angle, velocity) from which a block starts, 0 for one that has overturned.

    Parameters
    ----------
    space : Space
        Mesh and polynomial degree.
    coefficients : ndarray, shape ``space.shape``
    phase : float
        Forcing phase Psi at the start.
    error_estimate : float
        Integral of the absolute difference from the next coarser mesh, over the integral of the function.
    starts : tuple of (float, float, float)
        Angle, velocity and value of single starts that were followed forward, as by `solve_fpk`: no mesh resolves how a
        block at rest is set off by noise.
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
        """Draw its values over the plane; returns a matplotlib figure."""
        from fpk_rocking.results.pictures import figure_of, function_panel

        def values(figure, axes):
            function_panel(figure, axes, self, self.mesh_lines, f"value of the start, Ψ = {self.phase:.4g}", 1.0)

        return figure_of(values)

    def __call__(self, angle: ArrayLike, velocity: ArrayLike) -> Array:
        """Values at points.

        Parameters
        ----------
        angle, velocity : array_like
            Points, broadcast against each other; nondimensional.

        Returns
        -------
        ndarray
            Of the broadcast shape; 0 outside the mesh. As it was computed: where the function is steep it may pass its
            bounds a little. On a mesh line, x = 0 among them, it is the value on the upper side. At `starts` it is
            theirs.
        """
        values = self.space.evaluate(self.coefficients, angle, velocity)
        for x, v, value in self.starts:
            values = np.where((np.asarray(angle) == x) & (np.asarray(velocity) == v), value, values)
        return values

    @property
    def mesh_lines(self) -> tuple[Array, Array]:
        """Mesh lines (angle, velocity), nondimensional."""
        return self.space.lines

    @property
    def degree(self) -> int:
        """Polynomial degree in each direction."""
        return self.space.degree

    def cell_values(self, points: int) -> Array:
        """Values on a lattice in every cell, one-sided at its edges: (angle cells, velocity cells, points, points)."""
        lattice = np.linspace(0.0, 1.0, points)
        return self.space.cell_values(self.coefficients, lattice, lattice)

    @property
    def integral(self) -> float:
        """Integral over the phase plane; of a survival probability this is the safe area, nondimensional."""
        return float(self.space.masses(self.coefficients).sum())
