"""The result of the density solver: survival, overturning and the density after every cycle, with its own errors."""

import dataclasses
import functools
import math
import warnings
from typing import Annotated, Any, ClassVar, Self

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.base.checks import Array, not_none
from fpk_rocking.density.density import Density
from fpk_rocking.density.resolution import bins_tolerance
from fpk_rocking.density.space import Space
from fpk_rocking.density.tuning import TUNING
from fpk_rocking.results.remarks import scene_diagnostics
from fpk_rocking.results.replacement import Replacement, check_remarks, measured
from fpk_rocking.results.survival import SurvivalResult
from fpk_rocking.results.trust import Diagnostic
from fpk_rocking.scene.parts import Start
from fpk_rocking.scene.scene import Scene

PARTED = 0.25
"""Error (L1) of bins that part the region of rest, over the mass in it: .22 is the largest of 24 random scenes."""


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class Evolution(SurvivalResult):
    """The joint density of angle and velocity over time, the result of `solve_fpk`; all quantities are nondimensional.

    Rows and the parameter ``cycle`` are those of `SurvivalResult`.

    Attributes
    ----------
    scene : Scene
    diffusion : float
        D of the white noise that was solved for, or that has the Melnikov variance of the filtered noise.
    noise_replacement : str
        Which noise replaced the band noise, as a sentence; empty where none was replaced.
    tol, wall_s : float
        Error of survival that the solver aimed at, see `solve_fpk`, and seconds of the call.
    times, survival : ndarray, shape (rows,)
        Times from 0 on, and probability of not having overturned.
    overturned : ndarray, shape (rows, 2)
        Probability of having overturned to the left and to the right.
    truncated : ndarray, shape (rows,)
        Probability truncated by the mesh, ``1 - survival`` minus the sum of `overturned`: blocks faster than its
        largest velocity, or in cells that it does not follow. `error_estimate` is at least as large.
    at_rest : ndarray, shape (rows,)
        Probability of being at rest, a part of survival. Under filtered noise blocks rest at x = v = 0 exactly, and
        the density does not contain them. Under white noise they rattle, and this is the density's part within
        |x| < .005 and |v| < .1. The mesh resolves that region as a whole; `bins_error_estimate` counts it as one bin.
    error_estimate : float
        Estimate of the largest error of survival and of `overturned`, from three solutions of the scene.
    bins_error_estimate : float
        That of the binned density, L1 over bins a twentieth of the range of motion. Rows of ``settings["unresolved"]``
        do not count (`unjudged`); 0 if no other row is left.
    rest_error_estimate : float
        That of `at_rest` under filtered noise, where it converges slowly (docs/numerics.md); 0 under white noise.
    mass_defect : float
        Largest |survival + overturned + truncated - 1|: 0 but for rounding.
    negative_mass, moving_negative_mass : float
        Largest integral of max(-p, 0) of the density p, once the mesh resolves it: the first on the plane, the second
        without the region of rest (`at_rest`). Solver and verdict judge by the second.
    settings : dict
        Mesh, polynomial degree, quadrature and time steps.
    coefficients : ndarray, shape (rows, angle cells, velocity cells, degree + 1, degree + 1)
        Of the densities that `at` returns; zero in row 0 where the start is a point.
    angle_lines, velocity_lines : ndarray
        Lines of their mesh.
    rests_exactly : bool
        Whether the density does not contain `at_rest`, as under filtered noise.
    replacement : Replacement, optional
        What the replacement of the noise changes, if `checked` measured it.
    """

    kind: ClassVar = "evolution"
    scene: Scene
    diffusion: float
    noise_replacement: str
    tol: float
    times: Annotated[Array, "f8 time"]
    survival: Annotated[Array, "f8 time"]
    overturned: Annotated[Array, "f8 time side"]
    truncated: Annotated[Array, "f8 time"]
    at_rest: Annotated[Array, "f8 time"]
    error_estimate: float
    bins_error_estimate: float
    rest_error_estimate: float
    mass_defect: float
    negative_mass: float
    moving_negative_mass: float
    wall_s: float
    settings: dict
    coefficients: Annotated[Array, "f8 time x v d d"]
    angle_lines: Annotated[Array, "f8 x+1"]
    velocity_lines: Annotated[Array, "f8 v+1"]
    rests_exactly: bool
    replacement: Replacement | None = None

    engine = "Fokker-Planck density"
    shown_bins = 64
    realizations = None
    deterministic = False

    def __post_init__(self) -> None:
        """Leave the arrays writable: compiled functions that take them are compiled for such."""

    @functools.cached_property
    def space(self) -> Space:
        """Mesh and polynomial degree of the coefficients."""
        return Space(self.angle_lines, self.velocity_lines, self.coefficients.shape[-1] - 1)

    @property
    def bins_tol(self) -> float:
        """Error (L1) of the binned density that was asked for; inf if any error is accepted."""
        return self.settings.get("bins_tol", math.inf)

    def checked(self, paths: Any) -> Self:
        """Return this result with its replacement of noise measured by paths under the noise of the scene.

        Parameters
        ----------
        paths : Ensemble or Tally
            Of the scene as it is, at the times of this result or more; `fpk_rocking.studies.checked` samples them.

        Raises
        ------
        TypeError, ValueError
            The paths are no sample, are of another scene or of other times, or no noise was replaced.
        """
        if not isinstance(paths, SurvivalResult) or paths.realizations is None:
            raise TypeError(checks.refusal("paths", type(paths).__name__, "an Ensemble or a Tally"))
        return dataclasses.replace(self, replacement=measured(self, paths))

    @property
    def total_error(self) -> Array | None:
        """Total errors of survival, overturned left and right, shape (cycles + 1, 3).

        If the noise was not replaced, the solver's estimate. If it was, `Replacement.total` of a result that was
        `checked`; else the solver's estimate plus that of a replacement chosen by "auto"; else None.
        """
        if self.replacement is not None:
            return self.replacement.total(self.error_estimate)
        neglected = self.neglected_error
        return None if neglected is None else np.full((len(self.times), 3), self.error_estimate + neglected)

    @property
    def neglected_error(self) -> float | None:
        """Estimated error by the replacement of the noise: 0.0 where none was replaced, None where it is not known."""
        return self.settings.get("replacement", {}).get("error") if self.noise_replacement else 0.0

    @property
    def title(self) -> str:
        """The engine, and the last probability with its error, as a line of text."""
        if not self.noise_replacement:
            return super().title
        until = self.when(len(self.times) - 1).removeprefix("after ")
        return f"{self.engine}, {self.overturning_text()}, after {until}"

    def overturning_text(self) -> str:
        """Probability of overturning at the last time, its numerical and its total error, as a text."""
        text = f"P(overturned) = {1.0 - self.survival[-1]:z.4f} ± {self.error_estimate:.1g} (numerics)"
        if not self.noise_replacement:
            return text
        if self.replacement is None:
            if self.neglected_error is None:
                return f"{text}, replacement of the noise: not checked"
            total = not_none(self.total_error)[-1, 0]
            return f"{text}, ± {self.neglected_error:.1g} (replacement of the noise, estimated), total ± {total:.1g}"
        change, error = -self.replacement.difference[-1, 0], self.replacement.sampling_error[-1, 0]
        total = not_none(self.total_error)[-1, 0]
        return f"{text}, replacement of the noise: {change:+z.4f} ± {error:#.2g}, total ± {total:#.2g}"

    def model_diagnostics(self) -> list[Diagnostic]:
        """Return the diagnostics beside those of errors: of the model, unchecked noise, unresolved rest."""
        known = self.replacement or self.neglected_error is not None
        return scene_diagnostics(self.scene, "" if known else self.noise_replacement, self.unresolved)

    @property
    def error_figures(self) -> dict[str, Any]:
        """Error figures by name, with the total error where noise was replaced and that was checked or estimated."""
        figures = super().error_figures
        if self.noise_replacement and self.total_error is not None:
            return figures
        return {name: figures[name] for name in figures if name != "total_error"}

    @property
    def remarks(self) -> tuple[str, ...]:
        """Sentences: about the scene, the noise and its check, and what is not to be trusted."""
        check = check_remarks(self) if self.replacement else filter(None, [self._choice_text])
        own = self.unjudged, self.parted, self.below_zero
        return tuple(dict.fromkeys(filter(None, (*super().remarks, *own, *check))))

    @property
    def parted(self) -> str:
        """Error of bins whose edges divide the region of rest, as a sentence; empty within the error of the bins."""
        off = PARTED * float(self.at_rest[1:].max(initial=0.0))
        if self.rests_exactly or math.isinf(self.bins_tol) or off <= self.bins_error_estimate:
            return ""
        return (
            f"Bins with an edge at angle 0 or velocity 0 may be off by {off:.2g} in all (L1): the mesh does not "
            "resolve on which side, and in which direction, a block at rest rattles. Bins that contain the region of "
            "rest as a whole are not affected."
        )

    @property
    def _choice_text(self):
        """Why the replacement of the noise was chosen, as sentences; empty where it was asked for by name."""
        chosen = self.settings.get("replacement", {})
        if not chosen:
            return ""
        choice, scatter = chosen["choice"], chosen.get("scatter")
        few = f" Realizations differ in strength by {scatter:.2g}; the density includes this." if scatter else ""
        return f"{choice[0].upper()}{choice[1:]}.{few}"

    @property
    def below_zero(self) -> str:
        """By how much a probability of overturning is below 0, as a sentence; empty up to 1e-8.

        Where the mesh does not resolve the density, it has small negative parts, and some of them overturn.
        """
        below = -min(float((1.0 - self.survival).min()), float(self.overturned.min()))
        if below <= 1e-8:
            return ""
        error = f"{self.error_estimate:.1g}"
        return f"A probability of overturning is {-below:.1g}: take it as 0, within the error {error}."

    @property
    def unresolved(self) -> str:
        """What is not resolved, as sentences: `at_rest` with an error above √tol / 3, or a density."""
        never = self.unjudged if len(self.settings.get("unresolved", ())) == len(self.times) - 1 else ""
        return " ".join(filter(None, [self.unresolved_beyond(bins_tolerance(self.tol)), never]))

    def unresolved_beyond(self, wanted: float) -> str:
        """Warning that `at_rest` is not resolved to a wanted error, as a sentence; empty where it is.

        Parameters
        ----------
        wanted : float
            Largest estimated error of `at_rest` that needs no warning.
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
        """At how many times only survival is judged, as a sentence; empty if at none, or if no bins are judged.

        The density is too narrow for the mesh after a start or a release, and once the noise has faded.
        """
        rows, count = len(self.settings.get("unresolved", ())), len(self.times) - 1
        if not rows or math.isinf(self.bins_tol):
            return ""
        where = "every time" if rows == count else f"{rows} of {count} times"
        return (
            f"The density of angle and velocity is too narrow for the mesh at {where}: only survival is judged there."
        )

    @property
    def metadata(self) -> dict[str, Any]:
        """Settings, error figures, tolerances, and the measured replacement: plain values by name."""
        own = {} if math.isinf(self.bins_tol) else {"bins_tol": self.bins_tol}
        return super().metadata | own | ({"replacement": self.replacement.plain} if self.replacement else {})

    def derived(self) -> dict[str, Any]:
        """Bins, and, where the replacement of the noise was checked, what it changes in survival, with errors."""
        if (check := self.replacement) is None:
            return super().derived()
        added = check.difference, check.sampling_error, not_none(self.total_error)
        names = "survival_replacement", "survival_replacement_error", "survival_total_error"
        return super().derived() | {name: ("time", values[:, 0]) for name, values in zip(names, added, strict=True)}

    def at(self, cycle: float) -> Density:
        """Return the density after a number of cycles; under filtered noise, that of the blocks that move.

        Parameters
        ----------
        cycle : int or float
            From 0 to ``cycles``.

        Raises
        ------
        TypeError, ValueError
            There is no such cycle, or it is 0 and the start is a point, which has no density.
        """
        row = self.row_of(cycle)
        if row == 0 and self.scene.start.covariance is None:
            later = f"{self.cycle_of(1):.6g} or later"
            raise ValueError(f"cycle: got 0, accepted: {later}; this start is a point, which has no density")
        return Density(self.space, self.coefficients[row])

    def _binned(self, row, edges):
        """Return probabilities (angle bins, velocity bins) at a row: of a point start, or of density and rest."""
        start = self.scene.start
        if row == 0 and start.covariance is None:
            return np.histogram2d([start.angle], [start.velocity], bins=edges)[0]
        moving = self.space.bin_integrals(self.coefficients[row], *edges)
        at_origin = np.histogram2d([0.0], [0.0], bins=edges)[0]
        return moving + self.at_rest[row] * at_origin if self.rests_exactly else moving


def near_rest(space: Space, coefficients: Array, start: Start) -> Array:
    """Return the masses (cycles + 1,) of densities that count as at rest; in row 0 of a point `start` 0 or 1."""
    angle, velocity = TUNING.rest_angle, TUNING.rest_velocity
    masses = space.bin_integrals(coefficients, [-angle, angle], [-velocity, velocity])[:, 0, 0]
    if start.covariance is None:
        masses[0] = abs(start.angle) < angle and abs(start.velocity) < velocity
    return masses


def refuse_broken(result: Evolution) -> None:
    """Raise FloatingPointError where an `Evolution` has a number that is not finite."""
    parts = (
        "survival",
        "overturned",
        "truncated",
        "coefficients",
        "error_estimate",
        "bins_error_estimate",
        "negative_mass",
    )
    for name in parts:
        if not np.all(np.isfinite(getattr(result, name))):
            raise FloatingPointError(
                f"{name}: got a number that is not finite, an error of the solver in {result.scene}"
            )


def warn_unresolved(result: Evolution, wanted: float, stacklevel: int) -> None:
    """Warn where the estimated error of the probability at rest is larger than `wanted`."""
    sentence = result.unresolved_beyond(wanted)
    if sentence:
        warnings.warn(sentence, RuntimeWarning, stacklevel=stacklevel)
