"""The probability of a limit state of a motion drawn from a population, from the outcomes under several."""

import dataclasses
import functools
import math
from collections.abc import Mapping, Sequence
from typing import Any, Self

import numpy as np
import scipy

from fpk_rocking.base import checks
from fpk_rocking.base.checks import Array, Number
from fpk_rocking.results.pictures import figure_of
from fpk_rocking.results.remarks import baseline_remark
from fpk_rocking.results.result import Result
from fpk_rocking.results.trust import CAUTION, UNASKED, Diagnostic
from fpk_rocking.risk.anchor import lift_off_g
from fpk_rocking.risk.capacities import Capacities
from fpk_rocking.risk.floors import FloorMotion
from fpk_rocking.risk.inputs import Draws
from fpk_rocking.risk.lognormal import REJECTED, LognormalFit, fit_lognormal, fit_rows
from fpk_rocking.risk.motions import intensity_of, measure_of, same_event
from fpk_rocking.risk.search import farthest_scale, first_scale, last_scale, signs_of
from fpk_rocking.scene.scene import Scene

_USUAL = 0.5
"""Dispersion below the lowest point of a curve without a fit: that of FEMA P-58 for contents that overturn."""


_TESTED = np.linspace(-2.5, 2.5, 41)
"""Where a fit to outcomes without noise is tested if some motions stand in the end, in dispersions from its median."""


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class IntensityCurve(Result):
    """The probability of a limit state against an intensity of the ground motion, or the scale of the shaking.

    Parameters
    ----------
    name : str
        The limit state, "overturned" or an angle that is reached.
    measure : str
        As for `at_intensity`, or "scale".
    intensity : ndarray, shape (n,)
        Intensities, ascending: in g, m/s, or nondimensional.
    probability : ndarray, shape (n,)
        Mean over the motions.
    interval : ndarray, shape (n, 2)
        95 % limits for a motion of the population: of the lognormal curve where it fits, else `point_limits`.
    fit : LognormalFit
        Lognormal curve through the mean; its intervals are those of `replicates`.
    replicates : ndarray, shape (b, 2)
        Draws of median and dispersion (`fpk_rocking.risk.capacities`); for one scene those of other samples.
    records : int
        Number of motions, or of events.
    sources, source_errors : dict of str to float
        Parts of the dispersion by name, with their standard errors: "noise" or, without it, "intervals" (the block
        stands again under stronger shaking), each uncertain value of the block, and "record to record", which is the
        rest of the dispersion, or 0 if that is negative.
    units : int
        Number of independent outcomes: of motions, or of drawn blocks where there is one motion.
    scenes : tuple of Scene
    jumps : ndarray, shape (r, b, k)
        Without noise: intensities, ascending, from which record r overturns block b (the first, third, ...) or lets it
        stand (the second, ...), nan after the last. They do not depend on `intensity`, and the rate is computed from
        them. (0, 0, 0) with noise.
    model : tuple of Diagnostic
        Diagnostics that speak against scenes, noise and engine.
    by_points : bool
        Whether the intensities were chosen so that a rate by the points, joined by lines, does not depend on them
        (`fpk_rocking.risk.study`). The rate is then by the points, even if there is a fit, which depends on them.
    reach : float
        Without noise: intensity up to which all records that do not overturn a block for good were searched; inf if
        there are none.
    capacities : Capacities or None
        Capacities from which the replicates are drawn; None for one scene.
    shares : ndarray, shape (r, n)
        Probability under each motion, or event; (0, 0) for one scene.
    """

    name: str
    measure: str
    intensity: np.ndarray
    probability: np.ndarray
    interval: np.ndarray
    fit: LognormalFit
    replicates: np.ndarray
    records: int
    sources: dict[str, float] = dataclasses.field(default_factory=dict)
    source_errors: dict[str, float] = dataclasses.field(default_factory=dict)
    units: int = 1
    scenes: tuple[Scene, ...] = ()
    jumps: np.ndarray = dataclasses.field(default_factory=lambda: np.empty((0, 0, 0)))
    model: tuple[Diagnostic, ...] = ()
    by_points: bool = False
    reach: float = math.inf
    capacities: Capacities | None = None
    shares: np.ndarray = dataclasses.field(default_factory=lambda: np.empty((0, 0)))

    @property
    def unit(self) -> str:
        """Unit of the intensity, "g" or "m/s"; empty for the scale."""
        return "" if self.measure == "scale" else measure_of(self.measure).unit

    @property
    def fitted(self) -> bool:
        """Whether there is a lognormal fit that the data do not reject: a call then evaluates it."""
        return not (self.fit.reason or self.fit.rejected)

    def unless_rejected(self, capacities: Capacities) -> Capacities | None:
        """Return capacities of these motions unless a test rejects that they are lognormal.

        Where some are not exact, the test is that of the fit.

        Parameters
        ----------
        capacities : Capacities
        """
        if capacities.error.any():
            return capacities if self.fitted else None
        return None if capacities.lilliefors(np.random.default_rng(1)) < REJECTED else capacities

    @property
    def tail(self) -> float:
        """Dispersion of the curve below its lowest point: that of the fit, .5 (FEMA P-58) where there is none."""
        return _USUAL if self.fit.reason else self.fit.dispersion

    def __call__(self, intensity: Number) -> Number:
        """Return the probability at an intensity, or array of them: of the lognormal curve if it fits, else `along`."""
        return self.fit(intensity) if self.fitted else self.along(self.probability, intensity)

    def along(self, points: Array, intensity: Number) -> Number:
        """Interpolate probabilities linearly in the logarithm of the intensity.

        Below the points it continues as a lognormal curve of dispersion `tail`, above them it is constant.

        Parameters
        ----------
        points : ndarray, shape (n,)
            Probabilities at the intensities of this curve.
        intensity : float or ndarray
            Above 0.
        """
        return self._joined(self.intensity, points, intensity)

    def _joined(self, places, points, intensity):
        """Return `along` for points (n,) at other intensities, `places` (n,)."""
        away = np.log(np.asarray(intensity) / places[0])
        lowest = scipy.special.ndtri(min(points[0], 1.0 - 0.5 / max(self.units, 2)))
        joined = np.interp(away, np.log(places / places[0]), points)
        return np.where(away < 0.0, scipy.special.ndtr(lowest + away / self.tail), joined)

    @functools.cached_property
    def log_lift_off(self) -> float:
        """Logarithm of the intensity up to which nothing lifts blocks off; -inf where noise or motions decide it."""
        on_floor = any(isinstance(scene.forcing, FloorMotion) for scene in self.scenes)
        resting = all(scene.start.at_rest for scene in self.scenes)
        level = all(scene.forcing.vertical is None for scene in self.scenes)
        if len(self.jumps) and self.measure in ("PFA", "PGA")[: 2 - on_floor] and resting and level:
            return math.log(min(lift_off_g(scene.block) for scene in self.scenes))
        return -math.inf

    @functools.cached_property
    def outcomes(self) -> tuple[Array, Array, Array]:
        """Intensities (k,) at which outcomes are known, the share (k,) that overturns there, and its limits (k, 2).

        Without noise they are those at which an outcome changes, before and after, or else the last one searched; with
        noise the points of the curve.
        """
        if not len(self.jumps):
            return self.intensity, self.probability, self.interval
        places, share = outcome_steps(self.jumps)
        if not places.size:
            places, share = np.array([self.reach]), np.zeros(1)
        if self.units == 1:
            return places, share, np.stack([share, share], axis=-1)
        return places, share, binomial_limits(share, self.units)

    def limits(self, intensity: Array) -> tuple[Array, Array]:
        """Return 95 % limits of the probability by the outcomes, fit or no fit.

        They follow those of the `outcomes` from where the first motion overturns the block (with noise in half of the
        paths), else from the last; below, each goes on as a lognormal curve of dispersion `tail`.

        Parameters
        ----------
        intensity : ndarray, shape (k,)
            Above 0.

        Returns
        -------
        low, high : ndarray, shape (k,)
        """
        places, share, interval = self.outcomes
        begun = share * self.units >= 0.5 if self.units > 1 else share > 0.0
        if self.jumps.size:
            begun &= places >= first_scale(self.jumps.reshape(-1, self.jumps.shape[-1])).min()
        first = int(begun.argmax()) if begun.any() else places.size - 1
        low, high = (self._joined(places[first:], side[first:], intensity) for side in interval.T)
        share = self._joined(places, share, intensity)
        if self.jumps.size:
            share = np.where(intensity < places[0], 0.0, share)
        lifted = np.log(intensity) > self.log_lift_off
        return lifted * np.minimum(low, share), lifted * np.maximum(high, share)

    @property
    def title(self) -> str:
        """Limit state, number of motions and fit, as a line of text."""
        text = f"probability of '{self.name}' {self.against}"
        return text + f", median {self.fit.median:.3g}, dispersion {self.fit.dispersion:.2g}" * self.fitted

    @property
    def against(self) -> str:
        """Measure, and number of motions or blocks, as text: "against PGV (m/s), from 5 motions"."""
        of = f"{self.records} motions" if self.records > 1 else f"{self.units} blocks" if self.units > 1 else self._one
        return f"against {self.measure}{f' ({self.unit})' * bool(self.unit)}, from {of}"

    @property
    def _one(self):
        """What a curve is of that is not of several motions or blocks."""
        return "one event" if self.units == 1 < len(self.scenes) else "one scene"

    @property
    def diagnostics(self) -> list[Diagnostic]:
        """A list of `Diagnostic`: of the scenes, of the fit, and of the uncertainty by the number of motions."""
        half = float(0.5 * np.diff(self.point_limits).max())
        what = "motions" if self.records > 1 else "blocks" if self.units > 1 else self._one.removeprefix("one ")
        sentence = f"From {self.units} {what}, the probabilities for others of {'its' if self.units == 1 else 'their'} "
        sentence += f"kind are known to ±{half:.2g} at worst (95 %)."
        few = [] if math.isnan(half) else [Diagnostic(CAUTION * (half > UNASKED), sentence, "few motions", half)]
        return [*self.model, *self.fit_diagnostics, *few]

    @property
    def fit_diagnostics(self) -> list[Diagnostic]:
        """A list with a `Diagnostic` where the data reject the lognormal fit."""
        sentence = (
            f"The lognormal fit is rejected ({self.fit.rejected}): it is off by up to {self.fit.misfit:.2g}. Use "
        )
        return [Diagnostic(CAUTION, f"{sentence}the probabilities themselves.", "fit")] * bool(self.fit.rejected)

    @property
    def remarks(self) -> tuple[str, ...]:
        """Sentences on the scenes, the noise and the model."""
        of = (*(scene.noise.remark for scene in self.scenes), baseline_remark(scene.forcing for scene in self.scenes))
        return tuple(dict.fromkeys(filter(None, (*of, *(diagnostic.message for diagnostic in self.model)))))

    @property
    def metadata(self) -> dict[str, Any]:
        """Plain values by name: limit state, measure, counts, the fit's, parts of the dispersion, error figures."""
        fit = {name: value for name, value in self.fit._asdict().items() if name != "level"}
        return (
            super().metadata
            | fit
            | {"intensity": self.intensity, "sources": self.sources, "source_errors": self.source_errors}
        )

    @property
    def row_dims(self) -> tuple[str, ...]:
        """A row of the table is an intensity, in its unit."""
        return (self.measure + f"_{self.unit.replace('/', '_per_')}" * bool(self.unit),)

    def places(self) -> dict[str, Any]:
        """Intensities of the points."""
        return {self.row_dims[0]: self.intensity}

    @property
    def point_limits(self) -> Array:
        """95 % limits (n, 2) of each probability by its own outcomes: Clopper's and Pearson's, 0 up to lift-off.

        For one scene they are those of its paths, and nan without noise: one outcome has none.
        """
        if self.units > 1:
            lifted = np.log(self.intensity) > self.log_lift_off
            return lifted[:, None] * binomial_limits(self.probability, self.units)
        return np.full_like(self.interval, math.nan) if len(self.jumps) else self.interval

    def derived(self) -> dict[str, Any]:
        """Probability with its own limits, and the lognormal fit with those of the curve; nan without a fit."""
        nothing = np.full(self.intensity.shape, math.nan)
        fit = nothing if self.fit.reason else np.asarray(self.fit(self.intensity))
        low, high = self.interval.T if self.fitted and self.units > 1 else (nothing, nothing)
        columns = {"probability": self.probability, "low": self.point_limits[:, 0], "high": self.point_limits[:, 1]}
        columns |= {"lognormal": fit, "lognormal_low": low, "lognormal_high": high}
        return {name: (self.row_dims, values) for name, values in columns.items()}

    def plot(self) -> Any:
        """Draw the curve with its limits; returns a matplotlib figure."""
        from fpk_rocking.risk.picture import draw_curve

        return figure_of(lambda _, axes: draw_curve(axes, self))

    def describe(self) -> str:
        """Return limit state, measure, number of records, lognormal fit and sources of its dispersion as sentences."""
        of = f"{self.records} records" if self.records > 1 else self._one
        unit = f" ({self.unit})" * bool(self.unit)
        text = f"Probability of '{self.name}' of a rocking block against {self.measure}{unit}, from {of}."
        fit = self.fit
        if fit.reason:
            return f"{text} No lognormal fit: {fit.reason}."
        median = f"{fit.median:.4g} {self.unit}".rstrip()
        text += f" Lognormal fit: median {median}, dispersion {fit.dispersion:.3g}"
        text += f" ({self.parts})" * bool(self.parts)
        return f"{text}{', rejected by the data' if fit.rejected else ''}, largest misfit {fit.misfit:.2g}."

    @property
    def parts(self) -> str:
        """Parts of the dispersion with their standard errors, as a text."""
        errors = self.source_errors
        return ", ".join(
            f"{name} {value:.3g} ± {errors.get(name, math.nan):.2g}" for name, value in self.sources.items()
        )

    @classmethod
    def of(
        cls,
        fragility: Any,
        measure: str = "PGV",
        which: int = 0,
        *,
        draws: Draws | None = None,
        events: Sequence[Any] | None = None,
        samples: int | None = None,
        seed: int = 1,
    ) -> Self:
        """Return the curve of a fragility: for its scene, or for a motion drawn from the population of its motions.

        Parameters
        ----------
        fragility : Fragility
            For one scene, or several that have the same intensity at each scale: see `at_intensity`. Scales at which
            an answer is missing are left out.
        measure : str
            As for `at_intensity`, or "scale".
        which : int
            Index of the probability: 0 overturning, 1, 2, ... the levels.
        draws : Draws, optional
            Where the scenes are `fpk_rocking.risk.inputs.drawn` blocks: blocks under one motion are not independent
            of each other.
        events : sequence, optional
            A label for the motion of each scene, or of each that blocks were drawn for. Motions of one label, as the
            two components of one record, are not independent either: an event counts as one motion, with the mean of
            their probabilities. By default two motions whose files say the same event and station have one label.
        samples : int, optional
            Number of replicates; by default 999 for one scene, for several `Capacities.usual_draws`.
        seed : int
            Seed of their random numbers.

        Returns
        -------
        IntensityCurve

        Raises
        ------
        ValueError
            The scenes differ in a parameter (``over``), have unequal intensities, or there is no probability.
        """
        shares = fragility.probability[:, which]
        if len(shares) > 1 and fragility.axis != "scene":
            accepted = "a fragility of one scene, or of a list of scenes"
            raise ValueError(checks.refusal("fragility", fragility.title, accepted))
        at_one = np.array([1.0 if measure == "scale" else intensity_of(scene, measure) for scene in fragility.scenes])
        if np.ptp(at_one) > 1e-6 * at_one.max():
            accepted = "equal ones: make each scene with `at_intensity`"
            texts = [f"{intensity:.4g}" for intensity in at_one]
            raise ValueError(checks.refusal(f"{measure} of the scenes at scale 1", texts, accepted))
        answered = np.isfinite(shares).all(axis=0)
        if not answered.any():
            raise ValueError("fragility: got no scale at which all scenes have a probability, accepted: at least one")
        intensity, shares, rng = at_one[0] * fragility.scale[answered], shares[:, answered], np.random.default_rng(seed)
        trials = fragility.realizations
        common = {
            "name": fragility.names[which], "intensity": intensity, "scenes": fragility.scenes,
            "measure": measure if measure == "scale" else measure_of(measure).name,
            "model": tuple(fragility.scene_diagnostics()),
        }  # fmt: skip
        origin = np.arange(len(shares)) if draws is None else np.array(draws.origin)
        labels = same_event([fragility.scenes[n] for n in np.unique(origin, return_index=True)[1]])
        origin = np.unique(labels if events is None else events, return_inverse=True)[1][origin]
        records = np.unique(origin)
        # Blocks that are drawn for one record stand for themselves.
        motion = origin if draws is None or records.size > 1 else np.arange(len(shares))
        if fragility.motions is not None:
            rows = at_one[0] * fragility.motions.jumps[:, which]
            common["jumps"] = _by_event(rows, motion)
            ends = np.full(len(rows), fragility.scale[-1])
            if "farthest" in fragility.options:
                ends = np.array([farthest_scale(scene) for scene in fragility.scenes])
            ends = at_one[0] * ends
            common["reach"] = float(ends[np.isinf(last_scale(rows))].min(initial=math.inf))
        if len(shares) > 1:
            steps = None
            if fragility.motions is None:
                capacities = Capacities.of(intensity, shares, trials, motion)
            else:
                capacities = Capacities.of_jumps(rows, ends, motion)
                places, share = outcome_steps(common["jumps"])
                known = places <= common["reach"]
                steps = places[known], share[known], common["reach"]
            common["capacities"], values = capacities, {} if draws is None else draws.values
            suite = suite_fields(capacities, intensity, shares, trials, values, samples, rng, steps)
            return cls(**common, shares=capacities.mean_of.T @ shares, **suite | name_sources(suite, records.size))
        fit, replicates = fragility.fits[0][which], np.empty((0, 2))
        if trials and not fit.reason and not fragility.deterministic[0]:
            drawn = rng.binomial(trials, fit(fragility.scale[answered]), (samples or 999, intensity.size)) / trials
            _, middle, spread, _ = fit_rows(np.log(intensity), drawn)
            replicates = np.stack([np.exp(middle), spread], axis=-1)
        limits = fragility.interval()[0, which, answered]
        fit = with_intervals(fit._replace(median=fit.median * at_one[0]), replicates)
        noise, error = {}, {}
        if not fit.reason:
            noise, error = {"noise": fit.dispersion}, {"noise": replicates[:, 1].std() if len(replicates) else math.nan}
        return cls(
            **common, probability=shares[0], interval=limits, fit=fit, replicates=replicates, records=1, sources=noise,
            source_errors=error,
        )  # fmt: skip


def _by_event(rows, motion):
    """Return rows (m, k) as (r, b, k), by the event or motion of each; those of one that has fewer are repeated."""
    each = math.lcm(*np.bincount(motion).tolist())
    return np.stack([np.resize(rows[motion == number], (each, rows.shape[1])) for number in np.unique(motion)])


def suite_fields(
    capacities: Any,
    intensity: Array,
    shares: Array,
    trials: int,
    drawn: Mapping[str, Any],
    samples: int | None,
    rng: np.random.Generator,
    steps: tuple[Array, Array, float] | None,
) -> dict[str, Any]:
    """Return fields of an `IntensityCurve`, a dict, for a motion drawn from the population of those of m rows."""
    # Sums of weights may pass 1 by rounding.
    mean, units = np.minimum(capacities.mean_of.T.dot(shares).mean(axis=0), 1.0), capacities.mean_of.shape[1]
    fields = {
        "probability": mean,
        "units": units,
        "replicates": np.empty((0, 2)),
        "interval": binomial_limits(mean, units),
    }
    places, share, reach = (intensity, mean, math.inf) if steps is None else steps
    fit = fit_lognormal(intensity, mean) if steps is None else LognormalFit()
    if not fit.reason and capacities.located.size < 2:
        where = "within these intensities" if steps is None else "for good"
        fit = LognormalFit(reason=f"fewer than two motions overturn a block {where}")
    if fit.reason:
        return fields | {"fit": fit}
    population, values = capacities.draws(samples or capacities.usual_draws, rng)
    fields["replicates"] = capacities.lognormal(population)
    if steps is not None:
        fit = LognormalFit(*capacities.moments(population))
        fit = fit._replace(misfit=float(np.abs(fit(places) - share).max(initial=0.0)))
        # Apart from the jumps: those of simulated suites lie elsewhere, and a distance is largest at a jump.
        places, known = fit.median * np.exp(fit.dispersion * _TESTED), places
        places = places[places <= reach] if (places <= reach).any() else np.array([reach])
        share = np.append(0.0, share)[np.searchsorted(known, places, side="right")]
    if capacities.error.any():
        p_value = capacities.p_value(np.log(places), share, trials, rng)
    else:
        p_value = capacities.lilliefors(rng, None if steps is None else fit.misfit)
    fit = with_intervals(fit._replace(p_value=p_value), fields["replicates"])
    if not fit.rejected:
        points = scipy.special.ndtr((np.log(intensity) - population[:, :1]) / fields["replicates"][:, 1:])
        fields["interval"] = np.quantile(points, [0.025, 0.975], axis=0).T
    sources = {"noise" if steps is None else "intervals": (capacities.noise, capacities.noise * capacities.noise_error)}
    parts = capacities.parts(values, drawn) if drawn else {}
    sources = (sources if capacities.noise else {}) | parts
    rest = math.sqrt(max(fit.dispersion**2 - sum(value**2 for value, _ in sources.values()), 0.0))
    # Motions of one event differ, too: a part between events may be 0 in most draws.
    draws = np.square(population[:, 1:3]).sum(axis=1) - sum(value**2 for value, _ in parts.values())
    error = float(np.diff(np.quantile(np.sqrt(np.maximum(draws, 0.0)), [0.16, 0.84]))[0]) / 2.0
    sources["record to record"] = rest, error
    return fields | {"fit": fit, "sources": sources}


def name_sources(suite: Mapping[str, Any], records: int) -> dict[str, Any]:
    """Return a dict of fields of an `IntensityCurve`: "records", "sources" and "source_errors" (float by name)."""
    sources = {
        name: part for name, part in suite.get("sources", {}).items() if records > 1 or name != "record to record"
    }
    values, errors = ({name: part[place] for name, part in sources.items()} for place in (0, 1))
    return {"records": records, "sources": values, "source_errors": errors}


def outcome_steps(jumps: Array) -> tuple[Array, Array]:
    """Intensities (k,), just before each of the jumps (r, b, k) and at it, and the share that overturns there."""
    signs = np.broadcast_to(signs_of(jumps), jumps.shape)
    finite = np.isfinite(jumps)
    places, number = np.unique(jumps[finite], return_inverse=True)
    rises = np.bincount(number, signs[finite], places.size) / (jumps.shape[0] * jumps.shape[1])
    share = np.cumsum(rises)
    pairs = np.stack([(1.0 - 1e-9) * places, places], axis=-1), np.stack([share - rises, share], axis=-1)
    return tuple(np.clip(values.ravel()[1:], 0.0, np.inf) for values in pairs)


def binomial_limits(mean: Array, count: int) -> Array:
    """Return Clopper's and Pearson's 95 % limits (n, 2) of a `mean` (n,) over `count` independent outcomes."""
    happened = mean * count
    low = scipy.special.betaincinv(np.maximum(happened, 1e-300), count - happened + 1.0, 0.025)
    high = scipy.special.betaincinv(happened + 1.0, np.maximum(count - happened, 1e-300), 0.975)
    return np.stack([np.where(happened > 0.0, low, 0.0), np.where(happened < count, high, 1.0)], axis=-1)


def with_intervals(fit: LognormalFit, replicates: Array) -> LognormalFit:
    """Return a `LognormalFit` with the 95 % intervals of `replicates` (b, 2), medians and dispersions; nan without."""
    if not len(replicates) or fit.reason:
        return fit._replace(median_interval=(math.nan, math.nan), dispersion_interval=(math.nan, math.nan))
    (low, narrow), (high, wide) = np.quantile(replicates, [0.025, 0.975], axis=0).tolist()
    return fit._replace(median_interval=(low, high), dispersion_interval=(narrow, wide))
