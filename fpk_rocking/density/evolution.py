"""The result of the density solver: survival, overturning and the density after every cycle, with its own errors."""

import dataclasses
from typing import Any, Self

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.base.types import Array, ArrayLike, File
from fpk_rocking.density.pilot import REST
from fpk_rocking.density.space.density import Density
from fpk_rocking.density.space.space import Space
from fpk_rocking.results.binning import ascending_edges
from fpk_rocking.results.layout import Layout
from fpk_rocking.results.result import DensityResult
from fpk_rocking.results.storage import read_result, write_result
from fpk_rocking.scene.scene import Scene

_KIND = "evolution"
_FLOATS = ("diffusion", "tol", "error_estimate", "bins_error_estimate", "mass_defect", "negative_mass", "wall_s")
_LAYOUT = Layout(
    {
        "survival": "f8 k+1",
        "overturned": "f8 k+1 2",
        "lost": "f8 k+1",
        "coefficients": "f8 k+1 x v d d",
        "angle_lines": "f8 x+1",
        "velocity_lines": "f8 v+1",
    },
    {"closure": str, "settings": dict} | dict.fromkeys(_FLOATS, float),
)


@dataclasses.dataclass(frozen=True, eq=False)
class Evolution(DensityResult):
    """Evolution of the joint density of angle and velocity over whole forcing cycles.

    Attributes
    ----------
    scene : Scene
        As it was asked for.
    diffusion : float
        D of the white noise that was solved for.
    closure : str
        How band noise became white noise; empty where the scene's noise is white.
    tol : float
        The tolerance asked for.
    survival : ndarray, shape (cycles + 1,)
        Probability of not having overturned by kT: the mass inside.
    overturned : ndarray, shape (cycles + 1, 2)
        Probability of having overturned by kT to the left and to the right, summed from what overturned.
    lost : ndarray, shape (cycles + 1,)
        Mass that left through the velocity bound by kT, or came to cells that hold next to nothing and are not active.
    error_estimate : float
        Estimate of the largest error in survival, from the differences of three solutions of the same scene.
    bins_error_estimate : float
        The same of the binned density: the largest difference of the last two, L1 over 32 x 64 bins between the bounds.
    mass_defect : float
        Largest |inside + overturned + lost - 1| over time.
    negative_mass : float
        Largest integral of max(-p, 0) after 1 cycle or more.
    wall_s : float
        Seconds of the whole call.
    settings : dict
        Mesh, degree, quadrature and steps used.
    coefficients : ndarray, shape (cycles + 1, angle cells, velocity cells, degree + 1, degree + 1)
        Of the density after each cycle; those at 0 are zero for a point start.
    space : Space
        What they are coefficients of.
    """

    scene: Scene
    diffusion: float
    closure: str
    tol: float
    survival: np.ndarray
    overturned: np.ndarray
    lost: np.ndarray
    error_estimate: float
    bins_error_estimate: float
    mass_defect: float
    negative_mass: float
    wall_s: float
    settings: dict
    coefficients: np.ndarray
    space: Space

    @property
    def cycles(self) -> int:
        """Number of forcing cycles."""
        return len(self.survival) - 1

    @property
    def at_rest(self) -> Array:
        """Probability, (cycles + 1,), of not having overturned by kT and being at rest: |x| < .005 and |v| < .1.

        Under white noise a block at rest rattles, and how it does is not resolved: within these bounds only the
        probability of the whole is to be trusted. `bins_error_estimate` counts them as one bin.
        """
        edges = ([-size, size] for size in REST)
        found = self.space.bin_integrals(self.coefficients, *edges)[:, 0, 0]
        start = self.scene.start
        if start.covariance is None:
            found[0] = abs(start.angle) < REST[0] and abs(start.velocity) < REST[1]
        return found

    @property
    def facts(self) -> dict[str, Any]:
        """What it says of its own errors, as plain values."""
        own = {name: float(getattr(self, name)) for name in ("error_estimate", "mass_defect", "negative_mass")}
        lists = {"lost": self.lost.tolist(), "at_rest": self.at_rest.tolist()}
        return own | lists | {"diffusion": float(self.diffusion)}

    def at(self, cycle: int) -> Density:
        """Return the density after a number of cycles.

        Parameters
        ----------
        cycle : int
            From 0 to ``cycles``.

        Returns
        -------
        Density

        Raises
        ------
        ValueError
            There is no such cycle, or it is 0 and the start is a point, which has no density.
        """
        self._check(cycle)
        if cycle == 0 and self.scene.start.covariance is None:
            raise ValueError("cycle: got 0, accepted: 1 or later; this start is a point, which has no density")
        return Density(self.space, self.coefficients[cycle])

    def bin_probabilities(
        self, cycle: int, angle_edges: ArrayLike, velocity_edges: ArrayLike, *, nonnegative: bool = False
    ) -> Array:
        """Probability of not having overturned and being in each bin.

        Parameters
        ----------
        cycle : int
            From 0 to ``cycles``.
        angle_edges, velocity_edges : array_like
            Ascending bin edges, nondimensional; the bins are those of `numpy.histogram2d`.
        nonnegative : bool
            Whether to return those of the view `Density.nonnegative` instead of the density as it was computed, in
            whose bins the negative parts show. ``negative_mass`` is that of the density either way.

        Returns
        -------
        ndarray, shape (angle bins, velocity bins)
            Sums to the survival where the bins cover the plane.

        Raises
        ------
        TypeError, ValueError
            There is no such cycle, the edges do not ascend, or the density has no non-negative view.
        """
        self._check(cycle)
        named = ("angle_edges", angle_edges), ("velocity_edges", velocity_edges)
        edges = [ascending_edges(*given, finite=False) for given in named]
        start = self.scene.start
        if cycle == 0 and start.covariance is None:
            return np.histogram2d([start.angle], [start.velocity], bins=edges)[0]
        return Density(self.space, self.coefficients[cycle]).bin_probabilities(*edges, nonnegative=nonnegative)

    def _check(self, cycle):
        if isinstance(cycle, bool) or not isinstance(cycle, int | np.integer) or not 0 <= cycle <= self.cycles:
            raise ValueError(checks.refusal("cycle", cycle, f"a whole number from 0 to {self.cycles}"))

    def save(self, path: File) -> None:
        """Write the result to a file (.npz), whole or not at all."""
        arrays = {name: getattr(self, name) for name in ("survival", "overturned", "lost", "coefficients")}
        arrays |= {"angle_lines": self.space.angle_lines, "velocity_lines": self.space.velocity_lines}
        write_result(path, _KIND, self.scene, arrays, {name: getattr(self, name) for name in _LAYOUT.attributes})

    @classmethod
    def load(cls, path: File) -> Self:
        """Read a saved result; raises as `fpk_rocking.results.storage.read_result`."""
        scene, arrays, attributes = read_result(path, _KIND, _LAYOUT)
        coefficients = arrays.pop("coefficients")
        space = Space(arrays.pop("angle_lines"), arrays.pop("velocity_lines"), coefficients.shape[-1] - 1)
        return cls(scene=scene, coefficients=coefficients, space=space, **arrays, **attributes)
