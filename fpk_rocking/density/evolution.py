"""The result of the density solver: survival, overturning and the density after every cycle, with its own errors."""

import dataclasses

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.density.pilot import REST
from fpk_rocking.density.refinement import bins_tolerance
from fpk_rocking.density.space.density import Density
from fpk_rocking.density.space.space import Space
from fpk_rocking.results.binning import ascending_edges
from fpk_rocking.results.layout import Layout
from fpk_rocking.results.result import DensityResult
from fpk_rocking.results.storage import read_result, write_result
from fpk_rocking.scene.scene import Scene

_KIND = "evolution"
_FLOATS = (
    "diffusion", "tol", "error_estimate", "bins_error_estimate", "rest_error_estimate", "mass_defect", "negative_mass",
    "wall_s",
)  # fmt: skip
_LAYOUT = Layout(
    {
        "times": "f8 k+1",
        "survival": "f8 k+1",
        "overturned": "f8 k+1 2",
        "lost": "f8 k+1",
        "at_rest": "f8 k+1",
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
        D of the white noise that was solved for; of filtered noise, that of equal Melnikov variance.
    closure : str
        How band noise was replaced; empty where it was not.
    tol : float
        The tolerance asked for.
    times : ndarray, shape (cycles + 1,)
        Times τ from 0 on: kT, whole cycles, where the forcing repeats. Where it does not, there are no cycles, and rows
        and what is said of a cycle count these times.
    survival : ndarray, shape (cycles + 1,)
        Probability of not having overturned by kT, at rest or not: the mass inside.
    overturned : ndarray, shape (cycles + 1, 2)
        Probability of having overturned by kT to the left and to the right, summed from what overturned.
    lost : ndarray, shape (cycles + 1,)
        Mass that left through the velocity bound by kT, or came to cells that hold next to nothing and are not active.
    at_rest : ndarray, shape (cycles + 1,)
        Probability of not having overturned by kT and being at rest. Under filtered noise blocks rest, at x = v = 0
        exactly: a mass beside the density. White noise lets none rest: there it is the part of the density within
        |x| < .005 and |v| < .1, where a block rattles. How it does is not resolved; within these bounds only the
        probability of the whole is to be trusted, and `bins_error_estimate` counts them as one bin.
    error_estimate : float
        Estimate of the largest error in survival, from the differences of three solutions of the same scene.
    bins_error_estimate : float
        The same of the binned density: the largest difference of the last two, L1 over 32 x 64 bins between the bounds.
    rest_error_estimate : float
        The same of `at_rest` under filtered noise, not less than what moves next to rest; 0 under white noise. Not
        refined for: it converges slowly (docs/numerics.md). See `unresolved`.
    mass_defect : float
        Largest |inside + overturned + lost - 1| over time.
    negative_mass : float
        Largest integral of max(-p, 0) after 1 cycle or more.
    wall_s : float
        Seconds of the whole call.
    settings : dict
        Mesh, degree, quadrature and steps used.
    coefficients : ndarray, shape (cycles + 1, angle cells, velocity cells, degree + 1, degree + 1)
        Of the density of angle and velocity after each cycle, of blocks that are not an atom at rest; those at 0 are
        zero for a point start.
    space : Space
        What they are coefficients of.
    """

    scene: Scene
    diffusion: float
    closure: str
    tol: float
    times: np.ndarray
    survival: np.ndarray
    overturned: np.ndarray
    lost: np.ndarray
    at_rest: np.ndarray
    error_estimate: float
    bins_error_estimate: float
    rest_error_estimate: float
    mass_defect: float
    negative_mass: float
    wall_s: float
    settings: dict
    coefficients: np.ndarray
    space: Space

    @property
    def atom(self):
        """Whether `at_rest` is a mass beside the density: under filtered noise, where `settings` has ``nodes``."""
        return "nodes" in self.settings

    @property
    def unresolved(self):
        """That `at_rest` is not resolved, as a sentence; empty where its error is within the bins' usual tolerance."""
        return self.unresolved_beyond(bins_tolerance(self.tol))

    def unresolved_beyond(self, wanted):
        """Like `unresolved`, where the estimated error of `at_rest` is larger than wanted."""
        if self.rest_error_estimate <= wanted:
            return ""
        return (
            f"Not resolved: the probability at rest, whose estimated error is {self.rest_error_estimate:.2g}, and with "
            f"it the density at the origin; survival is estimated to {self.error_estimate:.1e}. For what is at rest "
            'take Monte Carlo, simulate(method="filtered").'
        )

    @property
    def facts(self):
        """What it says of its own errors, as plain values."""
        names = ("error_estimate", "rest_error_estimate", "mass_defect", "negative_mass")
        own = {name: float(getattr(self, name)) for name in names}
        lists = {"lost": self.lost.tolist(), "at_rest": self.at_rest.tolist()}
        return own | lists | {"diffusion": float(self.diffusion)}

    def at(self, cycle):
        """Return the density after a number of cycles, of blocks that are not an atom at rest.

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

    def bin_probabilities(self, cycle, angle_edges, velocity_edges, *, nonnegative=False):
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
            Sums to the survival where the bins cover the plane. Blocks at rest are in the bin that has (0, 0).

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
        found = Density(self.space, self.coefficients[cycle]).bin_probabilities(*edges, nonnegative=nonnegative)
        return found + self.at_rest[cycle] * np.histogram2d([0.0], [0.0], bins=edges)[0] if self.atom else found

    def _check(self, cycle):
        if isinstance(cycle, bool) or not isinstance(cycle, int | np.integer) or not 0 <= cycle < len(self.times):
            raise ValueError(checks.refusal("cycle", cycle, f"a whole number from 0 to {len(self.times) - 1}"))

    def save(self, path):
        """Write the result to a file (.npz), whole or not at all."""
        names = ("times", "survival", "overturned", "lost", "at_rest", "coefficients")
        arrays = {name: getattr(self, name) for name in names}
        arrays |= {"angle_lines": self.space.angle_lines, "velocity_lines": self.space.velocity_lines}
        write_result(path, _KIND, self.scene, arrays, {name: getattr(self, name) for name in _LAYOUT.attributes})

    @classmethod
    def load(cls, path):
        """Read a saved result; raises as `fpk_rocking.results.storage.read_result`."""
        scene, arrays, attributes = read_result(path, _KIND, _LAYOUT)
        coefficients = arrays.pop("coefficients")
        space = Space(arrays.pop("angle_lines"), arrays.pop("velocity_lines"), coefficients.shape[-1] - 1)
        return cls(scene=scene, coefficients=coefficients, space=space, **arrays, **attributes)


def near_rest(space, coefficients, start):
    """Mass (cycles + 1,) within `REST`, of the densities after every cycle; of a point start 0 or 1 at first."""
    found = space.bin_integrals(coefficients, *([-size, size] for size in REST))[:, 0, 0]
    if start.covariance is None:
        found[0] = abs(start.angle) < REST[0] and abs(start.velocity) < REST[1]
    return found
