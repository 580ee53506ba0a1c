"""The probability of overturning against an intensity of the ground motion, from the fragility of one scene or many."""

import dataclasses
import math
from typing import Self

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.base.types import Number
from fpk_rocking.results.result import Dataset
from fpk_rocking.results.sampling import wilson_interval
from fpk_rocking.scene.scene import Scene
from fpk_rocking.studies.drawing import Draws
from fpk_rocking.studies.lognormal import LognormalFit, dispersions, fit_lognormal, refitted
from fpk_rocking.studies.result import Fragility
from fpk_rocking.studies.scenes import intensity_of, measure_of, scaled

FEWEST_RECORDS = 5
"""Least number of records for a bootstrap over them."""


def at_intensity(scene: Scene, measure: str = "PGV", value: float = 1.0, *, noise: bool = True) -> Scene:
    """Return a scene whose forcing is scaled to an intensity.

    With the default value, the scales of `fpk_rocking.studies.fragility` of such scenes are the intensity itself: all
    records of a suite are then compared at equal intensities (stripes).

    Parameters
    ----------
    scene : Scene
        Of a block with dimensions.
    measure : str
        "PGA" (in g) or "PGV" (in m/s), of the forcing without the noise.
    value : float
        Intensity, in its unit, above 0.
    noise : bool
        Whether the noise is scaled too.

    Returns
    -------
    Scene

    Raises
    ------
    ValueError
        The measure is unknown, the block has no dimensions, or the forcing is 0.

    Examples
    --------
    >>> from fpk_rocking import Scene
    >>> from fpk_rocking.risk import at_intensity
    >>> from fpk_rocking.studies import intensities
    >>> rack = Scene.from_block(0.5, 1.8, "0.3 g", "1.5 Hz")
    >>> print(f"{intensities(at_intensity(rack, 'PGV', 0.5)).pgv:.2f} m/s")
    0.50 m/s
    """
    value = checks.number("value", value, above=0.0)
    return scaled(scene, value / intensity_of(scene, measure), noise=noise)


@dataclasses.dataclass(frozen=True, eq=False)
class IntensityCurve:
    """The probability of a limit state against an intensity of the ground motion.

    Parameters
    ----------
    name : str
        The limit state, "overturned" or an angle that is reached.
    measure : str
        "PGA" or "PGV".
    intensity : ndarray, shape (n,)
        Intensities, ascending: in g or m/s.
    probability : ndarray, shape (n,)
        Mean over the records.
    interval : ndarray, shape (n, 2)
        95 % limits: of a suite by bootstrap over its records, and Wilson's for as many records where less than one of
        them overturns a block, or all but less than one; of one scene those of its sample or solution.
    fit : LognormalFit
        Lognormal curve through all records; its intervals are those of `replicates`.
    replicates : ndarray, shape (b, 2)
        Median and dispersion of curves that other samples, or other records, would have given (bootstrap).
    records : int
        Number of records.
    within : float
        Dispersion β_N that the noise alone gives: root mean square of those of the records by themselves; nan where
        none of these has a fit.
    between : float
        Dispersion β_R from record to record, what the other sources leave of β: √(β² - β_N² - Σβ_j²), 0 where that is
        negative; nan for one scene, or draws of one.
    redrawn : ndarray, shape (b, n)
        Mean over records drawn with replacement; (0, n) for one scene.
    blocks : dict of str to float
        Dispersion β_j that each uncertain value of the block gives, by name (`fpk_rocking.studies.drawing.drawn`).
    jumps : ndarray, shape (r, b, k)
        Without noise: intensities, ascending, from which record r overturns block b (the first, third, ...) or lets it
        stand (the second, ...), nan behind the last. They do not depend on `intensity`, and the rate is by them. (0, 0,
        0) with noise.

    Examples
    --------
    >>> from fpk_rocking import Scene
    >>> from fpk_rocking.risk import IntensityCurve, at_intensity
    >>> from fpk_rocking.studies import fragility
    >>> rack = Scene.from_block(0.5, 1.8, "0.3 g", "1.5 Hz",
    ...                         noise_rms_acceleration=0.5, noise_band_hz=(0, 5))
    >>> found = fragility(at_intensity(rack, "PGV"), scale=[0.5, 0.6, 0.7, 0.8], cycles=4, realizations=500)
    >>> curve = IntensityCurve.of(found, "PGV")
    >>> print(curve.probability.round(2), f"median {curve.fit.median:.2f} {curve.unit}")
    [0.11 0.32 0.55 0.68] median 0.69 m/s
    """

    name: str
    measure: str
    intensity: np.ndarray
    probability: np.ndarray
    interval: np.ndarray
    fit: LognormalFit
    replicates: np.ndarray
    records: int
    within: float
    between: float
    redrawn: np.ndarray = dataclasses.field(default_factory=lambda: np.empty((0, 0)))
    blocks: dict[str, float] = dataclasses.field(default_factory=dict)
    jumps: np.ndarray = dataclasses.field(default_factory=lambda: np.empty((0, 0, 0)))

    @property
    def sources(self) -> dict[str, float]:
        """Dispersion that each source gives, by name: noise, each uncertain value, records; those that are not nan."""
        sources = {"noise": self.within, **self.blocks, "record to record": self.between}
        return {name: value for name, value in sources.items() if math.isfinite(value)}

    @property
    def unit(self) -> str:
        """Unit of the intensity."""
        return measure_of(self.measure).unit

    @property
    def fitted(self) -> bool:
        """Whether there is a lognormal fit that the data do not reject: it is then what a call evaluates."""
        return not (self.fit.reason or self.fit.rejected)

    def __call__(self, intensity: Number) -> Number:
        """Return the probability at intensities: of the lognormal curve where it fits, else between the points.

        Between the points the probability is linear in the logarithm of the intensity; below the lowest it is 0, above
        the highest that of the highest.
        """
        if self.fitted:
            return self.fit(intensity)
        return np.interp(np.log(intensity), np.log(self.intensity), np.maximum.accumulate(self.probability), left=0.0)

    def dataset(self) -> Dataset:
        """Probability with its limits, and that of the lognormal fit, over the intensity in its unit."""
        dim = f"{self.measure}_{self.unit.replace('/', '_per_')}"
        fit = np.full(self.intensity.shape, math.nan) if self.fit.reason else self.fit(self.intensity)
        low, high = self.interval.T
        columns = {"probability": self.probability, "low": low, "high": high, "lognormal": fit}
        return Dataset({name: (dim, values) for name, values in columns.items()}, {dim: self.intensity}, (dim,))

    def describe(self) -> str:
        """Return limit state, measure, number of records, lognormal fit and sources of its dispersion as sentences."""
        of = f"{self.records} records" if self.records > 1 else "one scene"
        text = f"Probability of '{self.name}' of a rocking block against {self.measure} ({self.unit}), from {of}."
        fit = self.fit
        if fit.reason:
            return f"{text} No lognormal fit: {fit.reason}."
        text += f" Lognormal fit: median {fit.median:.4g} {self.unit}, dispersion {fit.dispersion:.3g}"
        if self.records > 1 or self.blocks:
            text += f" ({', '.join(f'{name} {value:.3g}' for name, value in self.sources.items())})"
        return f"{text}{', rejected by the data' if fit.rejected else ''}, largest misfit {fit.misfit:.2g}."

    @classmethod
    def of(
        cls,
        fragility: Fragility,
        measure: str = "PGV",
        which: int = 0,
        *,
        draws: Draws | None = None,
        samples: int = 999,
        seed: int = 1,
    ) -> Self:
        """Return the curve of a fragility: of its scene, or the mean over its records.

        Parameters
        ----------
        fragility : Fragility
            Of one scene, or of several that have the same intensity at each scale: see `at_intensity`.
        measure : str
            "PGA" (in g) or "PGV" (in m/s).
        which : int
            Index of the probability: 0 overturning, 1, 2, ... the levels.
        draws : Draws, optional
            Where the scenes are `fpk_rocking.studies.drawing.drawn` blocks.
        samples : int
            Number of replicates: of counts drawn from the curve for one scene, of records drawn with replacement for a
            suite, or of blocks where there is one record.
        seed : int
            Seed of these draws.

        Returns
        -------
        IntensityCurve

        Raises
        ------
        ValueError
            The scenes are no suite (``over`` a parameter, or a mean), have unequal intensities, or a probability is
            missing.
        """
        several = len(fragility.place) > 1
        if fragility.mixture or (several and fragility.axis != "scene"):
            accepted = "a fragility of one scene, or of a list of scenes before `pooled`"
            raise ValueError(checks.refusal("fragility", fragility.title, accepted))
        at_one = np.array([intensity_of(scene, measure) for scene in fragility.scenes])
        if np.ptp(at_one) > 1e-6 * at_one.max():
            accepted = "equal ones: make each scene with `at_intensity`"
            texts = [f"{intensity:.4g}" for intensity in at_one]
            raise ValueError(checks.refusal(f"{measure} of the scenes at scale 1", texts, accepted))
        shares = fragility.probability[:, which]
        if not np.isfinite(shares).all():
            raise ValueError(
                f"fragility: got no probability at {(~np.isfinite(shares)).sum()} points, accepted: one at each"
            )
        intensity, rng = at_one[0] * fragility.scale, np.random.default_rng(seed)
        spreads = refitted(intensity, shares[~fragility.deterministic])[:, 1]
        within = math.sqrt(np.mean(spreads**2)) if spreads.size else math.nan
        common = {"name": fragility.names[which], "measure": measure, "intensity": intensity, "within": within}
        origin = range(len(shares)) if draws is None else draws.origin
        if fragility.motions is not None:
            rows = at_one[0] * fragility.motions.jumps[:, which]
            records = np.unique(origin)
            common["jumps"] = np.stack([rows[np.asarray(origin) == record] for record in records])
            if len(records) == 1:  # blocks that are drawn for one record stand for themselves
                common["jumps"] = common["jumps"].swapaxes(0, 1)
        if several:
            own = {} if draws is None else dispersions(intensity, shares, draws.values)
            return cls(**common, blocks=own, **_of_suite(intensity, shares, (within, own), origin, rng, samples))
        return cls(**common, **_of_one(fragility, intensity, which, rng, samples))


def _of_suite(intensity, shares, sources, origin, rng, samples):
    """Return fields of the curve of the mean over records (r, n), with a bootstrap over them.

    Blocks that were drawn for one record are drawn together again; where all are of one record, each by itself.
    `sources` are the dispersion of the noise and those of the uncertain values.
    """
    records = np.unique(origin)
    if len(records) > 1:
        shares = np.array([shares[np.asarray(origin) == record].mean(axis=0) for record in records])
    if len(shares) < FEWEST_RECORDS:
        raise ValueError(checks.refusal("records", len(shares), f"at least {FEWEST_RECORDS}, or one scene"))
    mean = shares.mean(axis=0)
    # A stripe says as much as its records do, however many paths each of them has.
    fit = fit_lognormal(intensity, mean, None)
    drawn = shares[rng.integers(0, len(shares), (samples, len(shares)))].mean(axis=1)
    replicates = refitted(intensity, drawn)
    return {
        "probability": mean,
        "interval": _limits(mean, drawn, len(shares)),
        "redrawn": drawn,
        "fit": _with_intervals(fit, replicates),
        "replicates": replicates,
        "records": len(records),
        "between": _remaining(fit.dispersion, *sources) if len(records) > 1 else math.nan,
    }


def _limits(mean, drawn, count):
    """Return limits (n, 2) of means over records from those over records drawn with replacement."""
    few = np.minimum(mean, 1.0 - mean) * count < 1.0
    # Records of which none overturns a block are all alike, and what is drawn from them never differs.
    return np.where(few[:, None], wilson_interval(mean * count, count), np.quantile(drawn, [0.025, 0.975], axis=0).T)


def _remaining(dispersion, within, own):
    """Return the part of a dispersion that is neither of the noise nor of the uncertain values of blocks."""
    sources = np.nan_to_num([within, *own.values()])
    return math.sqrt(max(dispersion**2 - float(sources @ sources), 0.0))


def _of_one(fragility, intensity, which, rng, samples):
    """Return fields of the curve of one scene, with counts drawn from its lognormal curve."""
    fit, trials = fragility.fits[0][which], fragility.realizations
    by_intensity = fit._replace(median=fit.median * intensity[0] / fragility.scale[0])
    replicates = np.empty((0, 2))
    if trials and not fit.reason and not fragility.deterministic[0]:
        drawn = rng.binomial(trials, fit(fragility.scale), (samples, intensity.size)) / trials
        replicates = refitted(intensity, drawn)
    return {
        "probability": fragility.probability[0, which],
        "interval": fragility.interval()[0, which],
        "fit": _with_intervals(by_intensity, replicates),
        "replicates": replicates,
        "records": 1,
        "between": math.nan,
    }


def _with_intervals(fit, replicates):
    """Return a fit with the 95 % intervals of replicates (b, 2), nan where there are none."""
    if not len(replicates) or fit.reason:
        return fit._replace(median_interval=(math.nan, math.nan), dispersion_interval=(math.nan, math.nan))
    (low, narrow), (high, wide) = np.quantile(replicates, [0.025, 0.975], axis=0).tolist()
    return fit._replace(median_interval=(low, high), dispersion_interval=(narrow, wide))
