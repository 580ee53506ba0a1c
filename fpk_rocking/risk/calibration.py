"""Calibration: what a block is, from the motions under which it overturned and those under which it stood.

Two tests of one block under nearly one motion may end differently, so a block that reproduces all outcomes does not
exist. Each test therefore has a block of its own. Its critical angle is lognormal about that of the tested block: its
median μ and its dispersion σ are fitted. Its frequency parameter p, restitution e and, where it has one, offset of the
centre of mass scatter about those of the tested block: measured by their quantiles (0 to 1) in their priors, they are
normal, with one standard deviation. With the share λ of outcomes that the model has nothing to do with,

    P(overturned under motion i) = λ/2 + (1 - λ) ∫∫ O_i(α, p', e') N(ln α; ln μ, σ²) k(p', e' | p, e) d ln α d(p', e'),

where O_i is 1 where the path of a block overturns and 0 where it stands, computed for blocks at nodes of α and at
scrambled Sobol points of (p, e). The posterior is a sum: over nodes of μ, σ and λ by quadrature, over the points by
importance weights. Without k the likelihood jumps from point to point, as single paths do, and few points bear it.

Many blocks under one motion are followed from one set of tables a motion and size (`outcomes_of`); `block_scene` says
what scene the parameters of a block stand for.
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
from fpk_rocking.base.jit import map_threads
from fpk_rocking.physics.forcing import Record
from fpk_rocking.physics.motion.equation import block_of_scene
from fpk_rocking.results.pictures import COLOURS, figure_of
from fpk_rocking.results.result import Result
from fpk_rocking.results.trust import CAUTION, UNUSABLE, Diagnostic
from fpk_rocking.risk.inputs import concentrated, distribution_of
from fpk_rocking.scene import NoNoise
from fpk_rocking.scene.axes import SETTLING
from fpk_rocking.scene.parts import Block, Body, Overturning
from fpk_rocking.scene.scene import Scene
from fpk_rocking.scene.units import STANDARD_GRAVITY, Dimensions
from montecarlo.engines import engine_of
from montecarlo.engines.batches import checked_run, simulate_batches
from montecarlo.engines.scaled_paths import scaled_parameters

SCATTERED, SHARED = "critical_angle", "frequency_parameter"
"""Parameter that differs from test to test, and the one whose equal values share the tables of a motion."""

LEVELS, FINER = 8, 2
"""Values of the frequency parameter, and nodes of the median critical angle from one of a block to the next."""

CELLS = {"scatter": 10, "stray": 4}
"""Equally probable cells of the prior of which the posterior takes the middle."""

FEW, TOO_FEW = 8.0, 3.0
"""Effective number of draws below which there is caution, and below which a posterior is not to be used."""

PRIOR = {
    SCATTERED: "lognormal:0.09:0.3",
    SHARED: "lognormal:4.8:0.2",
    "restitution": "uniform:0.4:1",
    "scatter": "uniform:0.02:0.5",
    "stray": "beta:1:30:0:1",
}
"""Prior of a free-standing block of half a metre to a metre."""

NODES = 25
"""Critical angles at which blocks are followed."""


def drawn_names(prior: Mapping[str, Any]) -> list[str]:
    """Return a list of the names of the d parameters of a prior that are drawn and have no nodes, in its order."""
    return [name for name in prior if name not in {SCATTERED, *CELLS}]


def values_at(points: Array, prior: Mapping[str, Any]) -> Array:
    """Return values (k, d) of the parameters that are drawn, at quantiles `points` (k, d) of their priors."""
    names, points = drawn_names(prior), points.copy()
    if SHARED in names:
        column = points[:, names.index(SHARED)]
        column[:] = (np.floor(column * LEVELS) + 0.5) / LEVELS
    laws = [distribution_of(name, prior[name]) for name in names]
    return np.column_stack([law.ppf(column) for law, column in zip(laws, points.T, strict=True)])


class Prediction(NamedTuple):
    """Probability of overturning under n motions, with the uncertainty that the tests leave.

    Parameters
    ----------
    probability, low, high : ndarray, shape (n,)
        Mean over the posterior, and 95 % limits.
    """

    probability: Array
    low: Array
    high: Array


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class Calibration(Result):
    """A block inferred from the outcomes of n tests: a posterior on k draws of it and on nodes of the other values.

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
        Density of the prior divided by that of the draws, at each draw.
    overturns : ndarray of bool, shape (n, k, j)
        Whether a block overturns under a motion.
    observed : ndarray of bool, shape (n,)
        Whether the tested block overturned.
    counted : ndarray of bool, shape (n,)
        Tests that the posterior takes into account.
    spread : float
        Standard deviation from test to test of each drawn parameter, measured by its quantile (0 to 1) in its prior.
    overturning : float
        Angle of overturning, in critical angles.
    wall_s : float
        Seconds that the paths took.
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
    spread: float
    overturning: float
    wall_s: float

    row_dims = ("motion",)

    def counting(self, tests: ArrayLike, observed: ArrayLike | None = None) -> Self:
        """Return the calibration from some of the tests, or from other outcomes, by the same paths.

        Parameters
        ----------
        tests : array_like of bool, shape (n,)
            Which tests count.
        observed : array_like of bool, shape (n,), optional
            Other outcomes: whether the block overturned.
        """
        counted = outcomes_as_bool("tests", tests, len(self.motion))
        if observed is not None:
            outcomes = outcomes_as_bool("observed", observed, len(self.motion))
            return dataclasses.replace(self, counted=counted, observed=outcomes)
        part = dataclasses.replace(self, counted=counted)
        vars(part)["_evidence"] = self._evidence
        return part

    @functools.cached_property
    def axes(self) -> dict[str, Array]:
        """Nodes, an array each, of "critical_angle" (median, radians), "scatter" and "stray" (share), by name."""
        medians = np.geomspace(self.angles[0], self.angles[-1], FINER * (self.angles.size - 1) + 1)
        return {SCATTERED: medians} | {name: self._middles(name) for name in CELLS}

    def _middles(self, name):
        """Return the nodes (n,) of `name`, "scatter" or "stray": [0] where the prior has none."""
        if name not in self.prior:
            return np.zeros(1)
        return np.asarray(distribution_of(name, self.prior[name]).ppf((np.arange(CELLS[name]) + 0.5) / CELLS[name]))

    @functools.cached_property
    def _shares(self):
        """Probability (medians * scatters, j) that the critical angle of a test is nearest to each of `angles` (j,)."""
        logs, medians = np.log(self.angles), np.log(self.axes[SCATTERED])
        edges = np.concatenate([[-math.inf], 0.5 * (logs[1:] + logs[:-1]), [math.inf]])
        away = edges - medians[:, None, None]
        spread = np.maximum(self.axes["scatter"], 1e-9)[:, None]
        return np.diff(scipy.special.ndtr(away / spread), axis=-1).reshape(-1, logs.size).astype(np.float32)

    @property
    def _quantiles(self):
        """Quantiles (k, d), in [0, 1], of the priors at which the draws are."""
        laws = [distribution_of(name, self.prior[name]) for name in drawn_names(self.prior)]
        return np.column_stack([law.cdf(column) for law, column in zip(laws, self.draws.T, strict=True)])

    @functools.cached_property
    def _neighbours(self):
        """Probabilities (k, k), [i, q]: if the tested block is draw i, that of its own block of a test being draw q."""
        places = self._quantiles
        away = np.square((places[:, None] - places) / max(self.spread, 1e-9)).sum(axis=-1)
        near = np.exp(-0.5 * away) * self.importance
        return (near / near.sum(axis=1, keepdims=True)).astype(np.float32)

    @functools.cached_property
    def _shares_overturned(self):
        """Shares (n, k, j) that overturn under n motions, of blocks about each of k draws, at each critical angle."""
        return np.einsum("kq,nqj->nkj", self._neighbours, self.overturns.astype(np.float32), optimize=True)

    def _with_stray(self, shares):
        """Return probabilities (..., l) of overturning with each of l shares of stray outcomes, from those without."""
        return shares[..., None] + self.axes["stray"] * (0.5 - shares[..., None])

    @functools.cached_property
    def _evidence(self):
        """Log-likelihood (n, h) of each of n outcomes at the h nodes of the posterior, `weights` in one row."""
        parts, outcome = [], self.observed[:, None, None]
        for overturned in self._shares_overturned.swapaxes(0, 1):
            p = self._with_stray(overturned @ self._shares.T)
            parts.append(np.log(np.maximum(np.where(outcome, p, 1.0 - p), 1e-12)).reshape(len(p), -1))
        return np.concatenate(parts, axis=1, dtype=np.float32)

    @functools.cached_property
    def weights(self) -> Array:
        """Posterior weights (k, medians, scatters, strays) of the k draws and the nodes in `axes`, of sum 1."""
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
    def _masses(self):
        """Weights (k, j), of sum 1: of each draw of the tested block with each critical angle of a test."""
        masses = (self.weights @ (1.0 - self.axes["stray"])).reshape(len(self.draws), -1) @ self._shares
        return masses / masses.sum()

    @property
    def population(self) -> Array:
        """Weights (k, j), of sum 1, by which the blocks represent the tested one in a single test.

        The probability of overturning under any motion is `stray_mean`/2 plus (1 - `stray_mean`) times their mean.
        """
        return self._neighbours.T @ self._masses

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
        """`Prediction` under the motions of the tests: probabilities with their intervals over the posterior."""
        return self._predict(self._shares_overturned, np.arange(len(self.draws)))

    @functools.cached_property
    def error_estimate(self) -> float:
        """Largest standard error of `predicted` from the number of draws, as if these were independent."""
        own = self._masses.sum(axis=1)
        means = np.einsum("nkj,kj->kn", self._shares_overturned, self._masses) / np.maximum(own, 1e-300)[:, None]
        return float(np.sqrt((own**2) @ (means - own @ means) ** 2).max())

    def _predict(self, shares, draws):
        """Return the `Prediction` under n motions from `shares` (n, k, j) that overturn, of blocks about some draws."""
        weights = self.weights[draws].ravel()
        keep = weights > 1e-5 * weights.max()
        used = weights[keep] / weights[keep].sum()
        rows = []
        for overturned in shares:
            p = self._with_stray(overturned @ self._shares.T).ravel()[keep]
            rows.append([float(p @ used), *_limits(p, used)[1:]])
        return Prediction(*np.array(rows, float).T)

    def predict(self, motions: Sequence[Record], progress: Progress | None = None) -> Prediction:
        """Return the `Prediction`, probabilities of overturning, under motions that were not among the tests.

        Parameters
        ----------
        motions : sequence of Record, (n,)
        progress : callable, optional
            Called as ``progress(done, total)`` after each motion.
        """
        draws, blocks = (
            np.flatnonzero(mass > 1e-3 * mass.max()) for mass in (self._masses.sum(axis=1), self.population.sum(axis=1))
        )
        near = self._neighbours[np.ix_(draws, blocks)]
        scenes = block_scenes(drawn_names(self.prior), self.draws[blocks], self.angles, self.overturning, motions)
        overturns = outcomes_of(scenes, motions, progress).astype(np.float32)
        shares = np.einsum("kq,nqj->nkj", near / near.sum(axis=1, keepdims=True), overturns, optimize=True)
        return self._predict(shares, draws)

    def refined(
        self, motions: Sequence[Record], draws: int = 64, seed: int = 2, progress: Progress | None = None
    ) -> Self:
        """Return the calibration with further draws of the block, where the posterior is large.

        Each of the old and new draws has as weight the prior divided by the density of the mixture of both.

        Parameters
        ----------
        motions : sequence of Record, (n,)
            Motions of the tests.
        draws, seed : int
            Further draws, and the seed of their scrambled Sobol points.
        progress : callable, optional
            Called as ``progress(done, total)`` after each motion.
        """
        if (self.importance != 1.0).any():
            raise ValueError("refined: got a calibration that is refined, accepted: one of `calibrated`")
        new, importance = concentrated(self._quantiles, self.weights.sum(axis=(1, 2, 3)), draws, seed)
        values = values_at(new, self.prior)
        scenes = block_scenes(drawn_names(self.prior), values, self.angles, self.overturning, motions)
        return dataclasses.replace(
            self,
            draws=np.concatenate([self.draws, values]),
            importance=importance,
            overturns=np.concatenate([self.overturns, outcomes_of(scenes, motions, progress)], axis=1),
        )

    @property
    def posterior(self) -> dict[str, tuple[float, float, float]]:
        """(median, low, high), the last two 95 % limits, of each parameter, by name."""
        of_draws = self.weights.sum(axis=(1, 2, 3))
        pairs = {name: (column, of_draws) for name, column in zip(drawn_names(self.prior), self.draws.T, strict=True)}
        for place, (name, axis) in enumerate(self.axes.items(), 1):
            others = tuple({0, 1, 2, 3} - {place})
            pairs[name] = axis, self.weights.sum(axis=others)
        return {name: _limits(*pairs[name]) for name in self.prior}

    @property
    def metadata(self) -> dict[str, Any]:
        """Plain values by name: settings, error figures, and the posterior's median of each parameter."""
        return super().metadata | {name: row[0] for name, row in self.posterior.items()}

    def model_diagnostics(self) -> list[Diagnostic]:
        """Return a list of `Diagnostic`: whether enough of the draws count, and the posterior lies within the nodes."""
        number = self.effective_draws
        severity = UNUSABLE if number < TOO_FEW else CAUTION if number < FEW else 0
        text = f"{number:.3g} of {len(self.draws)} draws of the block count effectively, {FEW:g} are enough"
        more = ": take more draws, or a narrower prior." if severity else "."
        out = [Diagnostic(severity, text + more, "draws", number)]
        ends = self.weights.sum(axis=(0, 2, 3))[[0, -1]].sum()
        if ends > 0.01:
            text = f"{ends:.2g} of the posterior lies at the ends of the prior of {SCATTERED}."
            out.append(Diagnostic(CAUTION, text, "ends of the prior"))
        return out

    @property
    def remarks(self) -> tuple[str, ...]:
        """Messages of the diagnostics that speak against the result."""
        return tuple(diagnostic.message for diagnostic in self.diagnostics if diagnostic.severity)

    @property
    def title(self) -> str:
        """Number of tests, and the posterior's median of each parameter, as a line of text."""
        tests, over = int(self.counted.sum()), int(self.observed[self.counted].sum())
        texts = [f"{name.replace('_', ' ')} {row[0]:.3g}" for name, row in self.posterior.items() if name != "stray"]
        return f"{tests} tests, {over} overturned: {', '.join(texts)}"

    def places(self) -> dict[str, Any]:
        """Names of the motions."""
        return {"motion": self.motion}

    def derived(self) -> dict[str, Any]:
        """Predicted probability of each motion with its limits, the outcome, and whether the posterior counts it."""
        columns = self.predicted._asdict() | {"observed": self.observed, "counted": self.counted}
        return {name: ("motion", values) for name, values in columns.items()}

    def plot(self) -> Any:
        """Draw prior and posterior of the critical angle, and outcomes over probability; return a matplotlib figure."""

        def angle(_, axes):
            medians, mass = self.axes[SCATTERED], self.weights.sum(axis=(0, 2, 3))
            axes.fill_between(medians, mass / np.gradient(medians), color=COLOURS[0], alpha=0.4, label="posterior")
            axes.plot(medians, distribution_of(SCATTERED, self.prior[SCATTERED]).pdf(medians), "k:", label="prior")
            axes.set(xlabel="median critical angle, rad", ylabel="density")
            axes.legend(fontsize=8)

        return figure_of(angle, lambda _, axes: reliability_panel(axes, self.probability, self.observed))


def _limits(values, weights):
    """Return (median, low, high), floats: of values (n,) with weights (n,) of sum 1, the last two 95 % limits."""
    order = np.argsort(values)
    shares = np.cumsum(weights[order]) - 0.5 * weights[order]
    middle, low, high = np.interp([0.5, 0.025, 0.975], shares, values[order])
    return float(middle), float(low), float(high)


def calibrated(
    motions: Sequence[Record],
    outcomes: ArrayLike,
    prior: Mapping[str, Any] | None = None,
    *,
    draws: int = 32,
    spread: float = 0.1,
    overturning: float = 0.5 * math.pi,
    seed: int = 1,
    progress: Progress | None = None,
) -> Calibration:
    """Fit a block to tests: in which of them it overturned.

    Each motion shakes `draws` blocks at up to 25 critical angles. If an angle lies between two that have the same
    outcome, its outcome is not computed but taken as theirs.

    Parameters
    ----------
    motions : sequence of Record, (n,)
        Accelerations of the base as measured.
    outcomes : array_like of bool, (n,)
        Whether the block overturned in each test.
    prior : dict of str, optional
        Distributions by name, as texts of `drawn`. For the block: "critical_angle" (its median, radians),
        "frequency_parameter" (rad/s), "restitution" (by default Housner's) and "offset" of the centre of mass (half
        widths; by default 0). "scatter" is the dispersion of the critical angle from test to test, "stray" the share of
        outcomes that the model does not explain; both are 0 if left out. By default `PRIOR`.
    draws : int
        Number of blocks that differ in frequency parameter and restitution, a power of 2.
    spread : float
        Standard deviation from test to test of these two and of the offset, each measured by its quantile (0 to 1) in
        its prior.
    overturning : float
        Angle of overturning, in critical angles.
    seed : int
        Seed of the scrambled Sobol points.
    progress : callable, optional
        Called as ``progress(done, total)`` after each motion.

    Returns
    -------
    Calibration
        With `posterior` of the parameters, `predicted` for the tests, and `predict` for other motions.

    Raises
    ------
    TypeError, ValueError
        A parameter is refused.

    Examples
    --------
    >>> from fpk_rocking.risk import calibrated, synthetic_records
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
    observed = outcomes_as_bool("outcomes", outcomes, len(motions))
    if SCATTERED not in prior or not {"scatter", "stray"} & prior.keys():
        accepted = f"{SCATTERED}, with scatter or stray or both, as no block explains all outcomes"
        raise ValueError(checks.refusal("prior", sorted(prior), accepted))
    draws = checks.count("draws", draws, at_most=4096)
    if draws & (draws - 1):
        raise ValueError(checks.refusal("draws", draws, "a power of 2"))
    spread = checks.number("spread", spread, at_least=0.0)
    for name, law in prior.items():
        distribution_of(name, law)
    names = drawn_names(prior)
    points = scipy.stats.qmc.Sobol(len(names), rng=checks.count("seed", seed, at_least=0)).random(draws)
    values = values_at(points, prior)
    low, high = distribution_of(SCATTERED, prior[SCATTERED]).ppf([0.001, 0.999])
    angles = np.geomspace(low, high, NODES)
    overturns = outcomes_of(block_scenes(names, values, angles, overturning, motions), motions, progress)
    own, wall_s = [motion.source for motion in motions], time.perf_counter() - started
    counted, importance = np.ones(len(own), bool), np.ones(draws)
    settings = spread, overturning, wall_s
    return Calibration(own, prior, angles, values, importance, overturns, observed, counted, *settings)


def reliability_panel(axes: Any, probability: Array, observed: Array, groups: int = 8, **style: Any) -> None:
    """Draw observed shares of overturning (n,) over predicted probabilities (n,), in groups of equal size.

    The intervals are Wilson's, 95 %; `style` are options of ``axes.plot``.
    """
    look = {"color": COLOURS[0]} | style
    for part in np.array_split(np.argsort(probability, kind="stable"), groups):
        mean, over = probability[part].mean(), int(observed[part].sum())
        axes.plot(
            [mean] * 2, scipy.stats.binomtest(over, len(part)).proportion_ci(method="wilson"), color=look["color"]
        )
        axes.plot(mean, over / len(part), "o", **look)
    axes.plot([0, 1], [0, 1], "k:")
    axes.set(xlabel="predicted probability of overturning", ylabel="share that overturned")


def outcomes_as_bool(name: str, values: ArrayLike, count: int) -> Array:
    """Return outcomes, an array_like of True or False, as an array of bool (count,); ValueError for anything else."""
    out = np.asarray(values)
    if out.shape != (count,) or not np.isin(out, [0, 1]).all():
        raise ValueError(checks.refusal(name, values, f"{count} outcomes, True or False, one for each motion"))
    return out.astype(bool)


def block_scene(motion: Record, overturning: float = 0.5 * math.pi, **values: float) -> Scene:
    """`Scene` of a block under a motion, without noise: here it is said what the parameters of a prior mean."""
    if not {SCATTERED, SHARED} <= values.keys() <= {SCATTERED, SHARED, "restitution", "offset"}:
        accepted = f"{SCATTERED}, {SHARED}, and optionally restitution and offset"
        raise ValueError(checks.refusal("prior", sorted(values), accepted))
    alpha, radius = values[SCATTERED], 0.75 * STANDARD_GRAVITY / values[SHARED] ** 2
    easier, height = radius * math.sin(alpha), radius * math.cos(alpha)
    restitution: Any = values.get("restitution")
    if "offset" not in values:
        block = Block(restitution, Dimensions(2.0 * easier, 2.0 * height))
        return Scene(block, motion, NoNoise(), overturning=Overturning(overturning))
    offset = checks.number("offset", values["offset"], at_least=-0.9, at_most=0.9)
    harder = easier * (1.0 + abs(offset)) / (1.0 - abs(offset))
    right, left = (harder, easier) if offset > 0.0 else (easier, harder)
    body = Body(height, right, left, radius / math.sqrt(3.0))
    # Beyond the saddle of the harder side, not of the easier one, a block does not come back by itself.
    criterion = Overturning(overturning * max(body.saddles))
    return Scene(Block(restitution, body=body), motion, NoNoise(), overturning=criterion)


def block_scenes(
    names: Sequence[str], values: Array, angles: Array, overturning: float, motions: Sequence[Record]
) -> list[list[Scene]]:
    """Return lists (k) of lists (j) of scenes of blocks under the first of `motions`."""
    return [
        [
            block_scene(motions[0], overturning, **{SCATTERED: angle}, **dict(zip(names, row, strict=True)))
            for angle in angles
        ]
        for row in values.tolist()
    ]


def outcomes_of(
    blocks: Sequence[Sequence[Scene]], motions: Sequence[Record], progress: Progress | None = None
) -> Array:
    """Return whether blocks overturn under n motions, as an array of bool (n, k, j)."""
    out, done = np.zeros((len(motions), len(blocks), len(blocks[0])), bool), []
    sizes: Any = [[scene.block.size for scene in row] for row in blocks]
    groups: dict[float, list[int]] = {}
    for number, row in enumerate(sizes):
        groups.setdefault(round(row[0].frequency_parameter, 9), []).append(number)

    def follow(number):
        for rows in groups.values():
            overturns = _follower(blocks[rows[0]][0], motions[number])
            for place in range(0, out.shape[2], 2):
                for row in rows:
                    out[number, row, place] = overturns(blocks[row][place])
            for place in range(1, out.shape[2] - 1, 2):
                for row in rows:
                    before, after = out[number, row, place - 1], out[number, row, place + 1]
                    out[number, row, place] = overturns(blocks[row][place]) if before != after else before
        done.append(number)
        if progress is not None:
            progress(len(done), len(motions))

    map_threads(follow, range(len(motions)))
    return out


def _follower(first, motion):
    """Return a function of a `Scene` that says (bool) whether its block overturns under a `motion`, a `Record`."""
    first = dataclasses.replace(first, forcing=motion.for_size(first.block.size))
    run = checked_run(first, None, None, 1, "exact", 200, times=[first.forcing.duration + SETTLING])
    tables = engine_of(first, "exact").parameters_of(first, 200, run.times[1:])
    latest: dict[Any, Any] = {}

    def overturns(scene):
        size, block = scene.block.size, block_of_scene(dataclasses.replace(scene, forcing=first.forcing))
        factor = size.amplitude(1.0) / first.block.size.amplitude(1.0)
        if block.weight is None and factor * first.forcing.largest <= scene.block.lift_off:
            return False
        if size not in latest:
            latest.clear()
            # Other angles are units of the force, and not of the weight.
            latest[size] = scaled_parameters(tables._replace(block=block), factor, 1.0)
        (path,) = simulate_batches(run, parameters=latest[size]._replace(block=block))
        return bool(path.overturn_side[0])

    return overturns
