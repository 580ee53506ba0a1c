"""Comparison of two results of one problem: survival, leakage and joint densities, beside what sampling explains.

The results may come from any engine, live or loaded from disk: a density, a Monte Carlo ensemble, or two of a kind.
"""

import dataclasses
import functools
import math
import operator
from collections.abc import Sequence
from typing import Any

import numpy as np

from fpk_rocking.analytics import melnikov
from fpk_rocking.base import checks
from fpk_rocking.base.checks import Array
from fpk_rocking.density.tuning import TUNING
from fpk_rocking.results import sampling
from fpk_rocking.results.remarks import noise_text, remarks
from fpk_rocking.results.result import Result
from fpk_rocking.results.storage import plain
from fpk_rocking.results.survival import SurvivalResult
from fpk_rocking.results.trust import CAUTION, UNUSABLE, USELESS, VERDICTS, Diagnostic
from fpk_rocking.scene.axes import joint_edges

__all__ = ["Comparison", "compare", "joint_edges", "shown_cycles"]

_DEVIATIONS, _DISTANCES = 4.0, ("l1", "l1_floor", "hellinger", "hellinger_floor")

_NEAR = 0.1
"""L1 distance up to which joint densities count as the same: beside blocks at rest bins are finer than meshes."""

_BINS_OVER_SURVIVAL = 10.0
"""L1 distance accepted for an error of survival by other noise: white for band noise makes 4.7 in the main scene."""


@dataclasses.dataclass(frozen=True, repr=False)
class Comparison(Result):
    """Two results side by side: survival, leakage and joint densities, with their errors.

    An array's axis of length 2 for the results is (first, second). Figures of the Melnikov process are None where the
    forcing does not repeat.

    Attributes
    ----------
    results : tuple of SurvivalResult
    cycles, times : ndarray, shape (n+1,)
        Numbers of the rows, from 0 to the last that both results have, and their nondimensional times.
    periodic : bool
        Whether the forcing repeats.
    survival : ndarray, shape (n+1, 2)
        Probability of not having overturned.
    interval : ndarray, shape (n+1, 2, 2)
        95 % confidence limits, indexed [cycle, result, limit]; nan for a result that is not a sample.
    error_estimate : ndarray, shape (2,)
        Estimated error of survival of a density, with that of a replacement of its noise where it is estimated; nan for
        a sample.
    difference, standard_error, z : ndarray, shape (n+1,)
        Survival of the first result minus that of the second; its standard error if both had the same distribution; and
        z, the difference over its standard error. If neither is a sample, the standard error is 0 and z is nan.
    leakage : ndarray, shape (n, 2, 2)
        Probability of overturning during the cycle, indexed [cycle, result, side], sides (left, right).
    joint_cycles : ndarray, shape (m,)
        Cycles at which the joint densities are compared.
    l1, l1_floor, hellinger, hellinger_floor : ndarray, shape (m,)
        Distances of the binned joint densities; a floor is the distance that sampling noise alone gives.
    outside : ndarray, shape (m, 2)
        Probability of standing outside all bins.
    melnikov_amplitude, melnikov_loss : float or None
        Amplitude D_m of the periodic part of the Melnikov process, and the loss M that it has to exceed without noise.
    melnikov_deviation, melnikov_margin : ndarray, shape (2,)
        Standard deviation σ_M of the process, and the margin √(D_m² + σ_M²) - M, positive where the criterion is met
        (paper eq. 14).
    phase_flux : ndarray, shape (2,)
        Phase flux Φ, see `fpk_rocking.melnikov.phase_flux`.
    """

    results: tuple[SurvivalResult, SurvivalResult]
    cycles: np.ndarray
    times: np.ndarray
    periodic: bool
    survival: np.ndarray
    interval: np.ndarray
    error_estimate: np.ndarray
    difference: np.ndarray
    standard_error: np.ndarray
    z: np.ndarray
    leakage: np.ndarray
    joint_cycles: np.ndarray
    l1: np.ndarray
    l1_floor: np.ndarray
    hellinger: np.ndarray
    hellinger_floor: np.ndarray
    outside: np.ndarray
    melnikov_amplitude: float | None
    melnikov_loss: float | None
    melnikov_deviation: np.ndarray
    melnikov_margin: np.ndarray
    phase_flux: np.ndarray

    row_dims = ("cycle",)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the engines, (first, second)."""
        return tuple(result.engine for result in self.results)

    @property
    def realizations(self) -> tuple[int | None, ...]:
        """Numbers of realizations, (first, second); None for a density and for one path."""
        return tuple(map(_sample_size, self.results))

    @property
    def title(self) -> str:
        """The engines and the largest difference of survival, as a line of text."""
        most = np.argmax(np.abs(self.difference))
        at = f"cycle {self.cycles[most]}" if self.periodic else f"τ = {self.times[most]:.4g}"
        return f"{self.names[0]} against {self.names[1]}, survival differs by up to {self.difference[most]:+.2g} ({at})"

    @property
    def row_values(self) -> Array:
        """Rows as the `row_label` of the first result counts them, (n+1,)."""
        return self.cycles if self.periodic else self.results[0].row_values[: self.cycles.size]

    @property
    def metadata(self) -> dict[str, Any]:
        """Plain values by name: "largest difference of survival", "largest l1", "realizations of the first", ..."""
        figures = {"largest difference of survival": float(np.abs(self.difference).max())}
        if self.joint_cycles.size:
            figures["largest l1"] = float(np.nanmax(self.l1))
        sizes = zip(("first", "second"), self.realizations, strict=True)
        return figures | {f"realizations of the {name}": size for name, size in sizes if size}

    @property
    def diagnostics(self) -> list[Diagnostic]:
        """Diagnostics of either result, of a seed that both share, and of differences beyond their errors.

        Survival, both sides, and the joint densities are judged.
        """
        diagnostics = [
            Diagnostic(VERDICTS.index(result.trust.verdict), f"{result.engine}: {reason}")
            for result in self.results
            for reason in result.trust.reasons
            if result.trust.verdict != VERDICTS[0]
        ]
        diagnostics += [Diagnostic(CAUTION, sentence, "shared seed") for sentence in _shared_seed(self.results)]
        found = [self._difference(), self._difference_of_side(0), self._difference_of_side(1)]
        for beyond, sentence, rule in found:
            if beyond > 0.0:
                diagnostics.append(Diagnostic(_severity(beyond), f"{sentence}, more than the {rule}.", "difference"))
        beyond, sentence, rule = self._difference_of_bins
        if beyond > 0.0:
            diagnostics.append(Diagnostic(_severity(beyond), f"{sentence}, more than the {rule}.", "bins"))
        return diagnostics

    @property
    def reason_if_ok(self) -> str:
        """Reason of the verdict "ok", as sentences: that the results agree."""
        return "Neither result is in doubt. {1}, within the {2}.".format(*self._difference())

    def _difference(self):
        """(excess, difference, accepted): how far survival differs beyond the stated errors, and texts.

        The excess is negative where the errors explain the difference.
        """
        return self._beyond("Survival", self.difference, self.standard_error)

    def _difference_of_side(self, side):
        """Return the same of the probability of having overturned to a `side`, 0 or 1."""
        first, second = np.vstack([np.zeros(2), np.cumsum(self.leakage[:, :, side], axis=0)]).T
        sizes = [float(size or math.inf) for size in self.realizations]
        name = f"P(overturned to the {('left', 'right')[side]})"
        return self._beyond(name, first - second, _standard_error(first, second, sizes))

    @functools.cached_property
    def _difference_of_bins(self):
        """Return the same of the joint densities, by half of their L1 distance, as far as its error is known."""
        numerics = [getattr(result, "bins_error_estimate", 0.0) for result in self.results]
        rests = [getattr(result, "rest_error_estimate", 0.0) for result in self.results]
        known = sum(numerics) + 2.0 * float(np.nansum(rests))
        if not self.joint_cycles.size or not math.isfinite(known) or not (known or self.l1_floor.any()):
            return -math.inf, "", ""
        sizes, edges = [float(size or math.inf) for size in self.realizations], joint_edges(self.results[0].scene)
        apart = np.array([_distances_but_at_rest(self.results, sizes, cycle, edges) for cycle in self.joint_cycles])
        # What a replaced noise neglects is estimated of survival alone.
        stated = known + _BINS_OVER_SURVIVAL * float(np.nansum(self.error_estimate))
        accepted = np.maximum(_DEVIATIONS * apart[:, 1] + stated, _NEAR)
        row = int(np.argmax(apart[:, 0] - accepted))
        rule = f"{accepted[row]:.2g} accepted there: {_DEVIATIONS:g} times the distance by sampling alone"
        rule += f" plus {stated:.2g} for the estimated errors of the densities" * bool(stated) + f", {_NEAR:g} at least"
        when = self._when(int(self.joint_cycles[row]))
        sentence = f"The joint densities are {apart[row, 0]:.2g} apart (L1, at most 2) {when}"
        return 0.5 * float((apart[:, 0] - accepted).max()), sentence, rule

    def _when(self, row):
        """Return when a row of the comparison is, as a text "after 3 cycles" or "at τ = 2"."""
        first = self.results[0]
        return f"{'' if self.periodic else 'at '}{first.when(first.row_of(row))}"

    def _beyond(self, name, difference, standard_error):
        """Return (excess, difference, accepted) of a probability with a `name` for two results (n+1,)."""
        stated = float(np.nansum(self.error_estimate))
        apart, accepted = np.abs(difference), _DEVIATIONS * standard_error + stated
        # Where most of what is accepted is used up: both may be 0, as at the start.
        row = int(np.argmax(np.divide(apart, accepted, out=np.where(apart > 0.0, np.inf, 0.0), where=accepted > 0.0)))
        allowances = [f"{_DEVIATIONS:g} standard errors of the difference"] * bool(standard_error.any())
        allowances += [f"the estimated errors of the densities, {stated:.2g}"] * bool(stated)
        rule = f"{accepted[row]:.2g} accepted there: {' plus '.join(allowances) or 'no error is stated'}"
        sentence = f"{name} differs by {apart[row]:.2g} {self._when(row)}"
        if standard_error[row] > 0.0:
            sentence += f" ({apart[row] / standard_error[row]:.1f} standard errors)"
        return float((apart - accepted).max()), sentence, rule

    @property
    def remarks(self) -> tuple[str, ...]:
        """Sentences that a reader needs: those of both results, and how their noise differs."""
        sentences = list(remarks(*self.results))
        first, second = (result.scene.noise for result in self.results)
        if first != second:
            sentences.append(f"The noise differs: {noise_text(first)}, against {noise_text(second)}.")
        return (*sentences, *_shared_seed(self.results))

    def places(self) -> dict[str, Any]:
        """Cycles, times, and the cycles during which there is leakage."""
        return {"cycle": self.cycles, "time": ("cycle", self.times), "during": self.cycles[1:]}

    def derived(self) -> dict[str, Any]:
        """Survival of both results, its difference, leakage, and distances of bins, nan but at `joint_cycles`."""
        distance = {name: np.full(self.cycles.size, math.nan) for name in _DISTANCES}
        for name, values in distance.items():
            values[self.joint_cycles] = getattr(self, name)
        return {
            "survival": ("cycle result", self.survival),
            "survival_interval": ("cycle result limit", self.interval),
            "difference": ("cycle", self.difference),
            "standard_error": ("cycle", self.standard_error),
            "z": ("cycle", self.z),
            **{name: ("cycle", values) for name, values in distance.items()},
            "leakage": ("during result side", self.leakage),
        }

    def plot(self) -> Any:
        """Draw survival of both results, and their difference with 95 % intervals; returns a matplotlib figure."""
        from fpk_rocking.results.pictures import figure_of, survival_panel

        times = self.row_values

        def difference(_, axes):
            axes.axhline(0.0, color="black", linewidth=0.8)
            axes.errorbar(times, self.difference, 1.96 * self.standard_error, marker="o", markersize=3.0)
            axes.set(xlabel=self.results[0].row_label, ylabel="first less second, 95 % interval")

        return figure_of(lambda _, axes: survival_panel(axes, *self.results), difference)

    def summary(self) -> dict[str, Any]:
        """Return a dict for JSON: all arrays and figures by name, engines, sizes, seconds, verdict and remarks."""
        names = [field.name for field in dataclasses.fields(self) if field.name != "results"]
        values = {name: getattr(self, name) for name in ("names", "realizations", *names, "remarks")}
        return plain(values | {"wall_s": [result.wall_s for result in self.results], "trust": self.trust.plain})


def compare(first: SurvivalResult, second: SurvivalResult, joint_cycles: Sequence[int] | None = None) -> Comparison:
    """Compare two results on one scene, of any engines.

    Parameters
    ----------
    first, second : SurvivalResult
        Their scenes may differ in the noise alone. Whole cycles that both have are compared.
    joint_cycles : sequence of int, optional
        For the joint densities; by default those of `shown_cycles`: 1, 2, 4, 10, 20, 40, 60, 100, 200 and the last.

    Raises
    ------
    TypeError, ValueError
        One is not a result of survival; the scenes differ in restitution, forcing, start or overturning, or one result
        has no such cycle.

    Examples
    --------
    >>> from fpk_rocking import load_scene, solve_fpk
    >>> from fpk_rocking.compare import compare
    >>> from montecarlo import simulate
    >>> scene = load_scene("main")
    >>> both = compare(solve_fpk(scene, cycles=4, tol=1e-2), simulate(scene, cycles=4, realizations=1000))
    >>> print(f"{both.difference[4]:.3f} ± {both.standard_error[4]:.3f}")
    0.007 ± 0.011
    """
    for name, result in (("first", first), ("second", second)):
        checks.instance(name, result, SurvivalResult)
    results = first, second
    cycles = min((len(result.times) - 1) // result.samples_per_cycle for result in results)
    _refuse_other_scenes(first.scene, second.scene)

    def rows(result, values):
        return np.asarray(values)[:: result.samples_per_cycle][: cycles + 1]

    # Of whole cycles the fewer are a part of the more.
    times = rows(first, first.times)
    if not np.allclose(times, rows(second, second.times), rtol=1e-12, atol=0.0):
        raise ValueError("times: got other times in the second result, accepted: two results for the same times")
    if joint_cycles is None:
        joint_cycles = shown_cycles(cycles)
    else:
        joint_cycles = [checks.count("joint_cycles", cycle, at_least=0, at_most=cycles) for cycle in joint_cycles]
    sizes = [float(_sample_size(result) or math.inf) for result in results]
    survival = np.stack([rows(result, result.survival) for result in results], axis=-1)
    difference = survival[:, 0] - survival[:, 1]
    standard_error = _standard_error(survival[:, 0], survival[:, 1], sizes)
    with np.errstate(divide="ignore", invalid="ignore"):
        z = np.where(difference == 0.0, 0.0, difference / standard_error)
    if all(map(math.isinf, sizes)):
        z = np.full(difference.shape, math.nan)
    unknown = np.full((cycles + 1, 2), math.nan)
    leakage = np.stack([np.diff(rows(result, result.overturned), axis=0) for result in results], axis=1)
    edges = joint_edges(first.scene)
    joint = [_bin_distances(results, sizes, cycle, edges) for cycle in joint_cycles]
    columns = np.array(joint, dtype=float).reshape(len(joint), 6)
    return Comparison(
        results=results,
        cycles=np.arange(cycles + 1),
        times=times,
        periodic=first.cycles is not None,
        survival=survival,
        interval=np.stack(
            [unknown if result.interval is None else rows(result, result.interval) for result in results], 1
        ),
        error_estimate=np.array([_stated_error(result) for result in results]),
        difference=difference,
        standard_error=standard_error,
        z=z,
        leakage=leakage,
        joint_cycles=np.array(joint_cycles, dtype=int),
        l1=columns[:, 0],
        l1_floor=columns[:, 1],
        hellinger=columns[:, 2],
        hellinger_floor=columns[:, 3],
        outside=columns[:, 4:],
        **_melnikov(results),
    )


def _severity(beyond):
    """Return how much a difference of probabilities `beyond` what is accepted speaks against two results."""
    return CAUTION if beyond <= USELESS else UNUSABLE


def _standard_error(first, second, sizes):
    """Return the standard errors (n,) of differences of probabilities that two results of some `sizes` share."""
    common = sampling.pooled(first, second, *sizes)
    return np.sqrt(common * (1.0 - common) * sum(1.0 / size for size in sizes))


def _sample_size(result: SurvivalResult) -> int | None:
    """Number of realizations; None for a density and for the one path of a deterministic scene."""
    return None if result.deterministic else result.realizations


def shown_cycles(cycles: int) -> list[int]:
    """Return the cycles that tables show, ascending: 1, 2, 4, 10, 20, 40, 60, 100, 200 and the last, `cycles`."""
    return sorted({*(cycle for cycle in (1, 2, 4, 10, 20, 40, 60, 100, 200) if cycle <= cycles), cycles})


def _refuse_other_scenes(first, second):
    """Raise ValueError for two scenes, `first` and `second`, that differ in more than the noise."""
    for name in ("block.restitution", "block.critical_angle", "forcing", "start", "overturning"):
        in_first, in_second = map(operator.attrgetter(name), (first, second))
        if in_first != in_second:
            raise ValueError(
                f"{name}: got {in_first} in the first result and {in_second} in the second, "
                "accepted: two results whose scenes differ in the noise alone"
            )


def _stated_error(result):
    """Estimated error of survival of a density, nan of a sample."""
    return float(getattr(result, "error_estimate", math.nan)) + (getattr(result, "neglected_error", None) or 0.0)


def _bin_distances(results, sizes, cycle, edges):
    """L1 of bins, its floor, Hellinger, its floor, and what stands outside of each result; `sizes` of the samples."""
    bins = [np.asarray(result.bin_probabilities(cycle, *edges)) for result in results]
    common = sampling.pooled(bins[0], bins[1], *sizes)
    return (
        sampling.l1(*bins),
        sampling.l1_floor(common, *sizes),
        sampling.hellinger(*bins),
        sampling.hellinger_floor(common, *sizes),
        *(result.survival[result.row_of(cycle)] - part.sum() for result, part in zip(results, bins, strict=True)),
    )


def _distances_but_at_rest(results, sizes, cycle, edges):
    """L1 of bins and its floor, where all bins with states that count as rest are one: no mesh resolves these."""
    rest = np.outer(*(
        (lines[:-1] < most) & (lines[1:] > -most)
        for lines, most in zip(edges, (TUNING.rest_angle, TUNING.rest_velocity), strict=True)
    ))  # fmt: skip
    parts = (np.asarray(result.bin_probabilities(cycle, *edges)) for result in results)
    first, second = (np.append(part[~rest], part[rest].sum()) for part in parts)
    return sampling.l1(first, second), sampling.l1_floor(sampling.pooled(first, second, *sizes), *sizes)


def _melnikov(results) -> dict:
    """Figures of the Melnikov process by the names of fields; None without a period, or with unequal sides."""
    forcing, block = results[0].scene.forcing, results[0].scene.block
    restitution, angle = block.restitution, block.critical_angle
    if forcing.period is None or not block.symmetric:
        names = "melnikov_amplitude", "melnikov_loss", "melnikov_deviation", "melnikov_margin", "phase_flux"
        return dict.fromkeys(names)
    noises = [result.scene.noise for result in results]
    return {
        "melnikov_amplitude": float(melnikov.harmonic_amplitude(forcing, critical_angle=angle)),
        "melnikov_loss": float(melnikov.impact_loss(restitution, critical_angle=angle)),
        "melnikov_deviation": np.sqrt([melnikov.noise_variance(noise, critical_angle=angle) for noise in noises]),
        "melnikov_margin": melnikov.margin(forcing, restitution, noises, critical_angle=angle),
        "phase_flux": melnikov.phase_flux(forcing, restitution, noises, critical_angle=angle),
    }


def _shared_seed(results) -> list[str]:
    """Sentence that two samples share their random numbers, in a list; empty where they do not."""
    seeds = [(getattr(result, "seed", None), result.engine) for result in results]
    if seeds[0] != seeds[1] or seeds[0][0] is None or any(result.deterministic for result in results):
        return []
    return [f"Both samples use seed {seeds[0][0]} and share random numbers, so z and the floors do not apply."]
