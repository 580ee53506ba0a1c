"""The result of the density solver: survival, overturning and the density after every cycle, with its own errors."""

import dataclasses
from typing import Any, ClassVar

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.base.types import Array, ArrayLike, known
from fpk_rocking.density.pilot import REST
from fpk_rocking.density.refinement import bins_tolerance
from fpk_rocking.density.space.density import Density
from fpk_rocking.density.space.space import Space
from fpk_rocking.results.binning import ascending_edges
from fpk_rocking.results.layout import Layout
from fpk_rocking.results.replacement import ARRAYS, Replacement
from fpk_rocking.results.result import DensityResult
from fpk_rocking.results.storage import Saved
from fpk_rocking.scene.parts import Start
from fpk_rocking.scene.scene import Scene

_FLOATS = (
    "diffusion", "tol", "error_estimate", "bins_error_estimate", "rest_error_estimate", "mass_defect", "negative_mass",
    "moving_negative_mass", "wall_s",
)  # fmt: skip
_OWN_ERRORS = (
    "error_estimate", "bins_error_estimate", "rest_error_estimate", "mass_defect", "negative_mass",
    "moving_negative_mass",
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
    {"closure": str, "settings": dict, "atom": bool} | dict.fromkeys(_FLOATS, float),
)
_CHECKED = Layout(_LAYOUT.arrays | ARRAYS, _LAYOUT.attributes | {"check": dict})


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class Evolution(Saved, DensityResult):
    """The joint density of angle and velocity over time, as `solve_fpk` found it; all quantities are nondimensional.

    Row k of an array is for the time kT after k forcing cycles. Where the forcing does not repeat there are no cycles:
    row k is then for ``times[k]``, and a parameter ``cycle`` is such a number k.

    Attributes
    ----------
    scene : Scene
        The scene that was given to `solve_fpk`.
    diffusion : float
        D of the white noise that was solved for, or that has the Melnikov variance of the filtered noise.
    closure : str
        Which noise replaced the band noise, as a sentence; empty where none was replaced.
    tol : float
        The tolerance that was asked for.
    times : ndarray, shape (cycles + 1,)
        Times τ from 0 on.
    survival : ndarray, shape (cycles + 1,)
        Probability of not having overturned.
    overturned : ndarray, shape (cycles + 1, 2)
        Probability of having overturned to the left and to the right.
    lost : ndarray, shape (cycles + 1,)
        Probability that the mesh lost: blocks faster than its largest velocity, or in cells that it does not follow.
    at_rest : ndarray, shape (cycles + 1,)
        Probability of being at rest, a part of survival. Under filtered noise blocks rest at x = v = 0 exactly, and
        this is their probability, which the density does not contain. Under white noise no block rests: this is the
        part of the density within |x| < .005 and |v| < .1, where blocks rattle. The mesh resolves only the
        probability of this region as a whole, and `bins_error_estimate` counts it as one bin.
    error_estimate : float
        Estimate of the largest error of survival, from three solutions of the scene.
    bins_error_estimate : float
        Estimate of the largest error of the binned density, L1 over 32 x 64 bins: the difference of two solutions. It
        leaves out the rows of ``settings["unresolved"]``, see `unjudged`; 0 where these are all.
    rest_error_estimate : float
        Estimate of the largest error of `at_rest` under filtered noise, where it converges slowly (docs/numerics.md);
        0 under white noise.
    mass_defect : float
        Largest |survival + overturned + lost - 1|: 0 but for rounding.
    negative_mass : float
        Largest integral of max(-p, 0) after 1 cycle or more: how far the density p is below 0 in places.
    moving_negative_mass : float
        The same without the blocks at rest (|x| < .005 and |v| < .1), whose rattling the mesh does not resolve. The
        solver refuses a scene by this figure, and the verdict is on it.
    wall_s : float
        Seconds that the call took.
    settings : dict
        Mesh, polynomial degree, quadrature and time steps.
    coefficients : ndarray, shape (cycles + 1, angle cells, velocity cells, degree + 1, degree + 1)
        Coefficients of the densities that `at` returns; zero in row 0 where the start is a point.
    space : Space
        Mesh and polynomials that the coefficients belong to.
    atom : bool
        Whether `at_rest` is a probability that the density does not contain, as under filtered noise.
    replacement : Replacement, optional
        What the replacement of the noise changes, as `checked` measured it; None where it did not.

    Examples
    --------
    >>> from fpk_rocking import load_scene, solve_fpk
    >>> density = solve_fpk(load_scene("main"), cycles=4, tol=1e-2)
    >>> print(density.survival.round(2), density.overturned[4].round(2))
    [1.   1.   1.   0.96 0.86] [0.02 0.12]
    >>> print(density.bin_probabilities(4, [-1.0, 0.0, 1.0], [-2.0, 0.0, 2.0]).round(2))
    [[0.01 0.56]
     [0.08 0.08]]
    """

    _kind: ClassVar = "evolution"
    _layouts: ClassVar = (_LAYOUT, _CHECKED)
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
    moving_negative_mass: float
    wall_s: float
    settings: dict
    coefficients: np.ndarray
    space: Space
    atom: bool
    replacement: Replacement | None = None

    @property
    def unresolved(self) -> str:
        """What is not resolved, as sentences: `at_rest` where its error is above √tol / 3, a density that never is."""
        never = self.unjudged if len(self.settings.get("unresolved", ())) == len(self.times) - 1 else ""
        return " ".join(filter(None, [self.unresolved_beyond(bins_tolerance(self.tol)), never]))

    def unresolved_beyond(self, wanted: float) -> str:
        """Warning that `at_rest` is not resolved to a wanted error, as a sentence; empty where it is.

        Parameters
        ----------
        wanted : float
            Largest estimated error of `at_rest` that needs no warning.

        Returns
        -------
        str
        """
        if self.rest_error_estimate <= wanted:
            return ""
        return (
            f"The probability of being at rest is not resolved: its estimated error is {self.rest_error_estimate:.2g}. "
            f"Survival is not affected (estimated error {self.error_estimate:.1e}). For the probability of being at "
            "rest use Monte Carlo with the method 'filtered'."
        )

    @property
    def unjudged(self) -> str:
        """At how many times survival alone is judged, as a sentence; empty where at none, or where bins are not judged.

        The density is too narrow for the mesh while a start or a release is followed beside it, and once the noise has
        faded; ``settings["unresolved"]`` has the rows.
        """
        rows, whole = len(self.settings.get("unresolved", ())), len(self.times) - 1
        if not rows or "bins_tol" not in self.facts:
            return ""
        where = "every time" if rows == whole else f"{rows} of {whole} times"
        return (
            f"The density of angle and velocity is too narrow for the mesh at {where}: only survival is judged there."
        )

    @property
    def facts(self) -> dict[str, Any]:
        """Error figures, tolerances and diffusion, as plain values by name."""
        own = {name: float(getattr(self, name)) for name in _OWN_ERRORS}
        lists = {"lost": self.lost.tolist(), "at_rest": self.at_rest.tolist()}
        wanted = {name: self.settings[name] for name in ["bins_tol"] if np.isfinite(self.settings.get(name, np.inf))}
        return (
            own | lists | {"diffusion": float(self.diffusion), "tol": float(self.tol)} | wanted | self.replacement_facts
        )

    def columns(self) -> dict[str, Array]:
        """Table of survival, overturned to either side, lost and at rest, a row a time: arrays by column name.

        Where the replacement of the noise was checked: also what it changes in survival, the sampling error of that,
        and the total error of survival.
        """
        found = super().columns() | {"lost": self.lost, "at_rest": self.at_rest}
        if (check := self.replacement) is None:
            return found
        added = check.difference, check.sampling_error, known(self.total_error)
        names = "survival_replacement", "survival_replacement_error", "survival_total_error"
        return found | {name: values[:, 0] for name, values in zip(names, added, strict=True)}

    def at(self, cycle: int) -> Density:
        """Return the density after a number of cycles.

        Under filtered noise it is the density of the blocks that move; `at_rest` has the others.

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

    def bin_probabilities(self, cycle: int, angle_edges: ArrayLike, velocity_edges: ArrayLike) -> Array:
        """Probability of standing, with angle and velocity in each of some bins.

        Parameters
        ----------
        cycle : int
            From 0 to ``cycles``.
        angle_edges, velocity_edges : array_like
            Ascending bin edges, nondimensional; the bins are those of `numpy.histogram2d`.

        Returns
        -------
        ndarray, shape (angle bins, velocity bins)
            Sums to the survival where the bins cover the plane. Blocks at rest are in the bin that contains (0, 0).
            A bin can be slightly below 0 where the mesh does not resolve the density.

        Raises
        ------
        TypeError, ValueError
            There is no such cycle, or the edges do not ascend.
        """
        self._check(cycle)
        named = ("angle_edges", angle_edges), ("velocity_edges", velocity_edges)
        edges = [ascending_edges(*given, finite=False) for given in named]
        start = self.scene.start
        if cycle == 0 and start.covariance is None:
            return np.histogram2d([start.angle], [start.velocity], bins=edges)[0]
        found = Density(self.space, self.coefficients[cycle]).bin_probabilities(*edges)
        return found + self.at_rest[cycle] * np.histogram2d([0.0], [0.0], bins=edges)[0] if self.atom else found

    def _check(self, cycle):
        if isinstance(cycle, bool) or not isinstance(cycle, int | np.integer) or not 0 <= cycle < len(self.times):
            raise ValueError(checks.refusal("cycle", cycle, f"a whole number from 0 to {len(self.times) - 1}"))

    def _stored(self):
        names = ("times", "survival", "overturned", "lost", "at_rest", "coefficients")
        arrays = {name: getattr(self, name) for name in names}
        arrays |= {"angle_lines": self.space.angle_lines, "velocity_lines": self.space.velocity_lines}
        attributes = {name: getattr(self, name) for name in _LAYOUT.attributes}
        if self.replacement is not None:
            values, said = self.replacement.stored()
            arrays, attributes = arrays | values, attributes | said
        return self.scene, arrays, attributes

    @classmethod
    def _restored(cls, scene, arrays, attributes):
        if "replacement" in arrays:
            attributes["replacement"] = Replacement.restored(arrays.pop("replacement"), attributes.pop("check"))
        coefficients = arrays.pop("coefficients")
        space = Space(arrays.pop("angle_lines"), arrays.pop("velocity_lines"), coefficients.shape[-1] - 1)
        return cls(scene=scene, coefficients=coefficients, space=space, **arrays, **attributes)


def near_rest(space: Space, coefficients: Array, start: Start) -> Array:
    """Mass (cycles + 1,) within `REST`, of the densities after every cycle; of a point start 0 or 1 at first."""
    found = space.bin_integrals(coefficients, *([-size, size] for size in REST))[:, 0, 0]
    if start.covariance is None:
        found[0] = abs(start.angle) < REST[0] and abs(start.velocity) < REST[1]
    return found
