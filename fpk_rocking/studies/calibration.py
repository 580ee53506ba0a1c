"""Calibration: what a block is, from the motions under which it overturned and those under which it stood.

Two tests of one block under nearly one motion may end differently, so a block that reproduces all outcomes does not
exist. Each test therefore has a critical angle of its own, lognormal about that of the block: its median μ and its
dispersion σ are fitted beside the frequency parameter p and the restitution e. With the share λ of outcomes that the
model has nothing to do with,

    P(overturned under motion i) = λ/2 + (1 - λ) ∫ O_i(α, p, e) N(ln α; ln μ, σ²) d ln α,

where O_i is 1 where the path of the block overturns and 0 where it stands, computed for blocks at nodes of α and at
scrambled Sobol points of (p, e). The posterior is a sum: over nodes of μ, σ and λ by quadrature, over the points by
importance weights.
"""

import dataclasses
import functools
import math
import time
from collections.abc import Mapping, Sequence
from typing import Annotated, Any, ClassVar, NamedTuple, Self

import numpy as np
import scipy

from fpk_rocking.base import checks
from fpk_rocking.base.checks import Array, ArrayLike, Progress
from fpk_rocking.physics.forcing import Record
from fpk_rocking.results.pictures import COLOURS, figure_of, reliability_panel
from fpk_rocking.results.result import Dataset, Result
from fpk_rocking.results.storage import Saved
from fpk_rocking.results.trust import CAUTION, UNUSABLE, Diagnostic
from fpk_rocking.studies.block_outcomes import SCATTERED, SHARED, block_scenes, outcomes_of
from fpk_rocking.studies.drawing import concentrated, distribution_of

PRIOR = {
    SCATTERED: "lognormal:0.09:0.3",
    SHARED: "lognormal:4.8:0.2",
    "restitution": "uniform:0.4:1",
    "scatter": "uniform:0.02:0.5",
    "stray": "beta:1:30:0:1",
}
"""Prior of a free-standing block of half a metre to a metre."""

LEVELS, NODES, FINER = 8, 25, 2
"""Values of the frequency parameter, nodes of the critical angle, and nodes of its median between two of these."""

CELLS = {"scatter": 10, "stray": 4}
"""Equally probable cells of the prior of which the posterior takes the middle."""

FEW, TOO_FEW = 8.0, 3.0
"""Effective number of draws below which there is caution, and below which a posterior is not to be used."""


def drawn_names(prior: Mapping[str, Any]) -> list[str]:
    """Return the names of the parameters of a prior that are drawn and have no nodes, in its order."""
    return [name for name in prior if name not in {SCATTERED, *CELLS}]


class Prediction(NamedTuple):
    """Probability of overturning under n motions, and what the tests leave open of it.

    Parameters
    ----------
    probability, low, high : ndarray, shape (n,)
        Mean over the posterior, and 95 % limits.

    Examples
    --------
    >>> from fpk_rocking.studies import calibrated, synthetic_records
    >>> motions = synthetic_records(6, duration=4.0, rms=2.5)
    >>> block = calibrated(motions, [True, True, False, True, False, False], draws=8)
    >>> prediction = block.predict(synthetic_records(1, duration=4.0, rms=2.5, seed=9))
    >>> print(prediction.probability.round(2), prediction.low.round(2), prediction.high.round(2))
    [0.88] [0.55] [0.98]
    """

    probability: Array
    low: Array
    high: Array


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class Calibration(Saved, Result):
    """What a block is, from the outcomes of n tests: a posterior on k draws of the block and nodes of the other values.

    Parameters
    ----------
    motion : list of str
        Names of the motions.
    prior : dict
        Distributions by name, as of `calibrated`.
    angles : ndarray, shape (j,)
        Critical angles of the blocks, radians.
    draws : ndarray, shape (k, d)
        Values of the other parameters of the block, in the order of the prior.
    importance : ndarray, shape (k,)
        Density of the prior over that of the draws, at each.
    overturns : ndarray of bool, shape (n, k, j)
        Whether a block overturns under a motion.
    observed : ndarray of bool, shape (n,)
        Whether the tested block overturned.
    counted : ndarray of bool, shape (n,)
        Tests that the posterior takes into account.
    overturning : float
        Angle of overturning, in critical angles.
    wall_s : float
        Seconds that the paths took.

    Examples
    --------
    >>> from fpk_rocking.studies import calibrated, synthetic_records
    >>> motions = synthetic_records(6, duration=4.0, rms=2.5)
    >>> block = calibrated(motions, [True, True, False, True, False, False], draws=8)
    >>> print(block.overturns.shape[:2], block.trust.verdict)
    (6, 8) caution
    """

    kind: ClassVar = "calibration"
    motion: list[str]
    prior: dict[str, Any]
    angles: Annotated[Array, "f8 j"]
    draws: Annotated[Array, "f8 k d"]
    importance: Annotated[Array, "f8 k"]
    overturns: Annotated[Array, "b1 n k j"]
    observed: Annotated[Array, "b1 n"]
    counted: Annotated[Array, "b1 n"]
    overturning: float
    wall_s: float

    def counting(self, tests: ArrayLike, observed: ArrayLike | None = None) -> Self:
        """Return the calibration by some of the tests, or by other outcomes, from the same paths.

        Parameters
        ----------
        tests : array_like of bool, shape (n,)
            Those that count.
        observed : array_like of bool, shape (n,), optional
            Other outcomes.
        """
        counted = _outcomes("tests", tests, len(self.motion))
        if observed is not None:
            return dataclasses.replace(
                self, counted=counted, observed=_outcomes("observed", observed, len(self.motion))
            )
        part = dataclasses.replace(self, counted=counted)
        vars(part)["_evidence"] = self._evidence
        return part

    @functools.cached_property
    def axes(self) -> dict[str, Array]:
        """Nodes of the median critical angle, the scatter and the share of stray outcomes, by name."""
        medians = np.geomspace(self.angles[0], self.angles[-1], FINER * (self.angles.size - 1) + 1)
        return {SCATTERED: medians} | {name: self._middles(name) for name in CELLS}

    def _middles(self, name):
        """Return the nodes of the scatter or of the share of stray outcomes: 0 alone where the prior has none."""
        if name not in self.prior:
            return np.zeros(1)
        return np.asarray(distribution_of(name, self.prior[name]).ppf((np.arange(CELLS[name]) + 0.5) / CELLS[name]))

    @functools.cached_property
    def _shares(self):
        """Probability (medians * scatters, j) that the critical angle of a test is nearest to each node."""
        logs, medians = np.log(self.angles), np.log(self.axes[SCATTERED])
        edges = np.concatenate([[-math.inf], 0.5 * (logs[1:] + logs[:-1]), [math.inf]])
        away = edges - medians[:, None, None]
        spread = np.maximum(self.axes["scatter"], 1e-9)[:, None]
        return np.diff(scipy.special.ndtr(away / spread), axis=-1).reshape(-1, logs.size).astype(np.float32)

    def _probabilities(self, overturns):
        """Return P without stray outcomes, (n, medians * scatters), of outcomes (n, j) of one draw of the block."""
        return overturns.astype(np.float32) @ self._shares.T

    def _with_stray(self, shares):
        """Return P (..., l) with each share of stray outcomes, of P without (...)."""
        return shares[..., None] + self.axes["stray"] * (0.5 - shares[..., None])

    @functools.cached_property
    def _evidence(self):
        """Log-likelihood (n, h) of each outcome at the h nodes of the posterior, in the order of `weights`."""
        parts, outcome = [], self.observed[:, None, None]
        for blocks in self.overturns.swapaxes(0, 1):
            p = self._with_stray(self._probabilities(blocks))
            parts.append(np.log(np.maximum(np.where(outcome, p, 1.0 - p), 1e-12)).reshape(len(p), -1))
        return np.concatenate(parts, axis=1, dtype=np.float32)

    @functools.cached_property
    def weights(self) -> Array:
        """Posterior weights (k, medians, scatters, strays), of sum 1."""
        logs = self.counted.astype(np.float32) @ self._evidence
        medians = np.log(self.axes[SCATTERED])
        ends = np.concatenate([[-math.inf], np.exp(0.5 * (medians[1:] + medians[:-1])), [math.inf]])
        prior = np.diff(distribution_of(SCATTERED, self.prior[SCATTERED]).cdf(ends))
        weights = np.exp((logs - logs.max()).astype(float)).reshape(-1, *map(len, self.axes.values()))
        weights *= self.importance[:, None, None, None] * prior[:, None, None]
        return weights / weights.sum()

    @property
    def effective_draws(self) -> float:
        """Effective number of the draws of the block, 1/Σw² of their weights."""
        return float(1.0 / (self.weights.sum(axis=(1, 2, 3)) ** 2).sum())

    @functools.cached_property
    def population(self) -> Array:
        """Weights (k, j) of the blocks, of sum 1, by which they stand for the tested one in a test of its own.

        The probability of overturning under any motion is `stray_mean`/2 and the rest of 1 times their mean.
        """
        weights = (self.weights @ (1.0 - self.axes["stray"])).reshape(len(self.draws), -1) @ self._shares
        return weights / weights.sum()

    @property
    def stray_mean(self) -> float:
        """Posterior mean of the share of stray outcomes."""
        return float((self.weights @ self.axes["stray"]).sum())

    @property
    def probability(self) -> Array:
        """Probabilities of overturning (n,) under the motions of the tests, counted or not."""
        means = np.einsum("nkj,kj->n", self.overturns, self.population)
        return 0.5 * self.stray_mean + (1.0 - self.stray_mean) * means

    @functools.cached_property
    def predicted(self) -> Prediction:
        """Probabilities under the motions of the tests, with their intervals over the posterior."""
        return self._predict(self.overturns, np.arange(len(self.draws)))

    @functools.cached_property
    def error_estimate(self) -> float:
        """Largest standard error of `predicted` by the number of draws, as if these were independent."""
        own = self.population.sum(axis=1)
        means = np.einsum("nkj,kj->kn", self.overturns, self.population) / np.maximum(own, 1e-300)[:, None]
        return float(np.sqrt((own**2) @ (means - own @ means) ** 2).max())

    def _predict(self, overturns, draws):
        """Return the `Prediction` of outcomes (n, k, j) of some of the draws, numbers (k,)."""
        weights = self.weights[draws].ravel()
        keep = weights > 1e-5 * weights.max()
        used = weights[keep] / weights[keep].sum()
        rows = []
        for blocks in overturns:
            p = self._with_stray(self._probabilities(blocks)).ravel()[keep]
            order = np.argsort(p)
            ends = np.interp([0.025, 0.975], np.cumsum(used[order]) - 0.5 * used[order], p[order])
            rows.append([float(p @ used), *ends])
        return Prediction(*np.array(rows, float).T)

    def predict(self, motions: Sequence[Record], progress: Progress | None = None) -> Prediction:
        """Return the probability of overturning under motions that were not among the tests.

        Parameters
        ----------
        motions : sequence of Record, (n,)
        progress : callable, optional
            Called as ``progress(done, total)`` after each motion.
        """
        own = self.weights.sum(axis=(1, 2, 3))
        draws = np.flatnonzero(own > 1e-3 * own.max())
        blocks = block_scenes(drawn_names(self.prior), self.draws[draws], self.angles, self.overturning, motions)
        return self._predict(outcomes_of(blocks, motions, progress), draws)

    def refined(
        self, motions: Sequence[Record], draws: int = 16, seed: int = 2, progress: Progress | None = None
    ) -> Self:
        """Return the calibration with further draws of the block, from where the posterior is.

        Of old and new draws together each has the weight of the prior over the density of the mixture.

        Parameters
        ----------
        motions : sequence of Record, (n,)
            Those of the tests.
        draws, seed : int
            Further draws, and the seed of their scrambled Sobol points.
        progress : callable, optional
            Called as ``progress(done, total)`` after each motion.
        """
        if (self.importance != 1.0).any():
            raise ValueError("refined: got a calibration that is refined, accepted: one of `calibrated`")
        laws = [distribution_of(name, self.prior[name]) for name in drawn_names(self.prior)]
        old = np.column_stack([law.cdf(column) for law, column in zip(laws, self.draws.T, strict=True)])
        new, importance = concentrated(old, self.weights.sum(axis=(1, 2, 3)), draws, seed)
        values = np.column_stack([law.ppf(column) for law, column in zip(laws, new.T, strict=True)])
        scenes = block_scenes(drawn_names(self.prior), values, self.angles, self.overturning, motions)
        return dataclasses.replace(
            self,
            draws=np.concatenate([self.draws, values]),
            importance=importance,
            overturns=np.concatenate([self.overturns, outcomes_of(scenes, motions, progress)], axis=1),
        )

    @property
    def posterior(self) -> dict[str, tuple[float, float, float]]:
        """Median and 95 % limits of each parameter, by name."""
        of_draws = self.weights.sum(axis=(1, 2, 3))
        pairs = {name: (column, of_draws) for name, column in zip(drawn_names(self.prior), self.draws.T, strict=True)}
        for place, (name, axis) in enumerate(self.axes.items(), 1):
            others = tuple(one for one in range(4) if one != place)
            pairs[name] = axis, self.weights.sum(axis=others)
        return {name: _quantiles(*pairs[name]) for name in self.prior}

    @property
    def metadata(self) -> dict[str, Any]:
        """Settings, error figures, and the posterior's median of each parameter."""
        return super().metadata | {name: row[0] for name, row in self.posterior.items()}

    def model_diagnostics(self) -> list[Diagnostic]:
        """Whether enough of the draws count, and whether the posterior lies within the nodes."""
        number = self.effective_draws
        severity = UNUSABLE if number < TOO_FEW else CAUTION if number < FEW else 0
        text = f"{number:.3g} of {len(self.draws)} draws of the block count effectively, {FEW:g} are enough"
        out = [Diagnostic(severity, text + (": take more, or a narrower prior." if severity else "."), "draws", number)]
        ends = self.weights.sum(axis=(0, 2, 3))[[0, -1]].sum()
        if ends > 0.01:
            text = f"{ends:.2g} of the posterior lies at the ends of the prior of {SCATTERED}."
            out.append(Diagnostic(CAUTION, text))
        return out

    @property
    def remarks(self) -> tuple[str, ...]:
        """Diagnostics that speak against the result."""
        return tuple(one.message for one in self.diagnostics if one.severity)

    @property
    def title(self) -> str:
        """Number of tests, and what the block is."""
        tests, over = int(self.counted.sum()), int(self.observed[self.counted].sum())
        texts = [f"{name.replace('_', ' ')} {row[0]:.3g}" for name, row in self.posterior.items() if name != "stray"]
        return f"{tests} tests, {over} overturned: {', '.join(texts)}"

    def dataset(self) -> Dataset:
        """Return a row for each motion: predicted probability with its limits, the outcome, and whether it counted.

        An outcome counts where the posterior takes the test into account.
        """
        return Dataset(
            {
                "probability": ("motion", self.predicted.probability),
                "low": ("motion", self.predicted.low),
                "high": ("motion", self.predicted.high),
                "observed": ("motion", self.observed),
                "counted": ("motion", self.counted),
            },
            {"motion": self.motion},
            rows=("motion",),
        )

    def plot(self) -> Any:
        """Draw prior and posterior of the critical angle, and outcomes over predicted probability."""

        def angle(_, axes):
            """Draw the densities of the median critical angle."""
            medians, mass = self.axes[SCATTERED], self.weights.sum(axis=(0, 2, 3))
            axes.fill_between(medians, mass / np.gradient(medians), color=COLOURS[0], alpha=0.4, label="posterior")
            axes.plot(medians, distribution_of(SCATTERED, self.prior[SCATTERED]).pdf(medians), "k:", label="prior")
            axes.set(xlabel="median critical angle, rad", ylabel="density")
            axes.legend(fontsize=8)

        return figure_of(angle, lambda _, axes: reliability_panel(axes, self.probability, self.observed))


def calibrated(
    motions: Sequence[Record],
    outcomes: ArrayLike,
    prior: Mapping[str, Any] | None = None,
    *,
    draws: int = 32,
    overturning: float = 0.5 * math.pi,
    seed: int = 1,
    progress: Progress | None = None,
) -> Calibration:
    """Fit a block to tests: in which of them it overturned.

    Each motion is followed for `draws` blocks at up to 25 critical angles, on all threads: 1 ms a path. Where a block
    comes to the same thing at the neighbours of an angle, it is taken to do so there.

    Parameters
    ----------
    motions : sequence of Record, (n,)
        Accelerations of the base as measured.
    outcomes : array_like of bool, (n,)
        Whether the block overturned in each test.
    prior : dict of str, optional
        Distributions by name, as texts of `drawn`. Of the block: "critical_angle" (radians; of its median),
        "frequency_parameter" (rad/s) and "restitution" (without it Housner's). "scatter" is the dispersion of the
        critical angle from test to test and "stray" the share of outcomes that the model has nothing to do with;
        without them there is none. By default `PRIOR`.
    draws : int
        Blocks that differ in frequency parameter and restitution, a power of 2.
    overturning : float
        Angle of overturning, in critical angles.
    seed : int
        Seed of the scrambled Sobol points.
    progress : callable, optional
        Called as ``progress(done, total)`` after each motion.

    Returns
    -------
    Calibration

    Raises
    ------
    TypeError, ValueError
        A parameter is refused.

    Examples
    --------
    >>> from fpk_rocking.studies import calibrated, synthetic_records
    >>> motions = synthetic_records(6, duration=4.0, rms=2.5)
    >>> block = calibrated(motions, [True, True, False, True, False, False], draws=8)
    >>> print(len(block.predicted.probability), block.prior["restitution"])
    6 uniform:0.4:1
    """
    started = time.perf_counter()
    prior = dict(PRIOR if prior is None else prior)
    motions = checks.sequence("motions", motions, "records, one for each test")
    for number, motion in enumerate(motions):
        checks.instance(f"motions[{number}]", motion, Record)
    observed = _outcomes("outcomes", outcomes, len(motions))
    if SCATTERED not in prior or not {"scatter", "stray"} & prior.keys():
        accepted = f"{SCATTERED}, with scatter or stray or both: no block explains all outcomes"
        raise ValueError(checks.refusal("prior", sorted(prior), accepted))
    draws = checks.count("draws", draws, at_most=4096)
    if draws & (draws - 1):
        raise ValueError(checks.refusal("draws", draws, "a power of 2"))
    laws = {name: distribution_of(name, law) for name, law in prior.items()}
    names = drawn_names(prior)
    points = scipy.stats.qmc.Sobol(len(names), rng=checks.count("seed", seed, at_least=0)).random(draws)
    if SHARED in names:
        column = points[:, names.index(SHARED)]
        column[:] = (np.floor(column * LEVELS) + 0.5) / LEVELS
    values = np.column_stack([laws[name].ppf(column) for name, column in zip(names, points.T, strict=True)])
    low, high = laws[SCATTERED].ppf([0.001, 0.999])
    angles = np.geomspace(low, high, NODES)
    overturns = outcomes_of(block_scenes(names, values, angles, overturning, motions), motions, progress)
    own, wall_s = [motion.source for motion in motions], time.perf_counter() - started
    counted, importance = np.ones(len(own), bool), np.ones(draws)
    return Calibration(own, prior, angles, values, importance, overturns, observed, counted, overturning, wall_s)


def _outcomes(name, values, count):
    """Return outcomes as an array of bool (count,), or refuse them; `name` is for the message."""
    out = np.asarray(values)
    if out.shape != (count,) or not np.isin(out, [0, 1]).all():
        raise ValueError(checks.refusal(name, values, f"{count} outcomes, True or False, one for each motion"))
    return out.astype(bool)


def _quantiles(values, weights):
    """Return median and 95 % limits of values (n,) with weights (n,)."""
    order = np.argsort(values)
    shares = np.cumsum(weights[order]) - 0.5 * weights[order]
    middle, low, high = np.interp([0.5, 0.025, 0.975], shares, values[order])
    return float(middle), float(low), float(high)
