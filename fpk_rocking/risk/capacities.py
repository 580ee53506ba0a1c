"""Capacities: the logarithm of the scale at which each motion overturns a block, and what they say of other motions.

Motions are taken as drawn from a population whose capacities are normal, N(μ, σ_r²), so that the fragility of a motion
drawn from it is lognormal. Noise adds β_n² to the variance, and blocks that are drawn for a motion σ_b² (a one-way
random effect). Of complete capacities, n motions with variance s², generalized pivotal draws

    σ*² = (n - 1) s²/χ²_{n-1},    μ* = mean + Z σ*/√n

are the posterior under the prior dμ dσ/σ, and their 95 % limits are exact for any n (S. Weerahandi, J. Am. Stat. Assoc.
88, 899-905, 1993). Capacities that are censored (by a bracket or the highest scale) or estimated from samples of noise
are latent variables of a Gibbs sampler: each sweep draws μ and σ given the capacities, then the capacities given μ and
σ (data augmentation: M. A. Tanner and W. H. Wong, J. Am. Stat. Assoc. 82, 528-540, 1987).
"""

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import scipy

from fpk_rocking.base.checks import Array, ArrayLike
from fpk_rocking.risk.lognormal import fit_rows
from fpk_rocking.risk.search import equivalent_scale, signs_of

_SWEEPS = 25
"""Sweeps of the Gibbs sampler; twice as many move limits by less than 999 draws scatter."""

_DRAWS, _IMPUTED = (999, 20_000), 1e7
"""Least and most draws by default, and how many capacities are drawn for them at most, in all sweeps."""

_STEADY = 0.3
"""Standard error of ln β above which a row has no dispersion of its own."""

_SETS, _COMPLETE_SETS = 399, 1999
"""Suites that the distribution of the test is simulated with; where all capacities are exact they cost nothing."""

DRAWS = 5_000
"""Draws of a population for limits of a rate, or of a ratio: they move one by some hundredths of its distance."""


class Capacities(NamedTuple):
    """Logarithms of the scales that overturn m rows, each a block under a motion.

    Parameters
    ----------
    low, high : ndarray, shape (m,)
        Limits of each; infinite where the row stands, or overturns, at all scales.
    middle, error : ndarray, shape (m,)
        Estimate from samples of noise, and its standard error: inf where only the limits are known.
    motion : ndarray of int, shape (m,)
        Number of the motion of each, from 0.
    noise, noise_error : float
        Dispersion β_n by noise, or by several intervals of overturning (root mean square over motions or rows), and its
        relative standard error.

    Examples
    --------
    >>> import numpy as np
    >>> from fpk_rocking.risk.capacities import Capacities
    >>> bracketed = Capacities.of(np.array([1.0, 2.0, 4.0]), np.array([[0.0, 1.0, 1.0], [0.0, 0.0, 1.0]]), 1, [0, 1])
    >>> print(np.exp(bracketed.low), np.exp(bracketed.high))
    [1. 2.] [2. 4.]
    """

    low: Array
    high: Array
    middle: Array
    error: Array
    motion: Array
    noise: float = 0.0
    noise_error: float = 0.0

    @classmethod
    def exact(cls, critical: ArrayLike, highest: ArrayLike = math.inf, motion: ArrayLike | None = None) -> "Capacities":
        """Capacities without noise, from critical scales.

        Parameters
        ----------
        critical : array_like, shape (m,)
            Scale at which each row overturns; inf where it stands up to the highest.
        highest : float or array_like, shape (m,)
            Highest scale of the search.
        motion : array_like of int, shape (m,), optional
            Motion of each; by default each has its own.
        """
        logs = np.log(np.asarray(critical, float))
        stands = np.isinf(logs)
        low = np.where(stands, np.log(highest), logs)
        motion = np.arange(logs.size) if motion is None else np.unique(motion, return_inverse=True)[1]
        return cls(low, logs, np.where(stands, 0.0, logs), np.where(stands, math.inf, 0.0), motion)

    @classmethod
    def of_jumps(cls, jumps: Array, highest: Array, motion: ArrayLike) -> "Capacities":
        """Capacities without noise, from all scales at which outcomes change.

        A row that overturns in several intervals counts as overturning at the highest scales, over the same range of
        the logarithm, so that its mean probability stays. The lowest scale would fall as the search gets finer. What
        the intervals add to the variance of the logarithm is `noise`: the lognormal curve has the first two moments of
        the share of the motions.

        Parameters
        ----------
        jumps : ndarray, shape (m, k)
            Ascending scales from which a row alternately overturns and stands, nan after the last.
        highest : ndarray, shape (m,)
            Highest scale of the search.
        motion : array_like of int, shape (m,)
            Motion of each row.
        """
        found = cls.exact(equivalent_scale(jumps), highest, motion)
        away = np.log(jumps) - found.low[:, None]
        own = np.nansum(signs_of(jumps) * away**2, axis=1)[np.isfinite(found.high)]
        variance = float(own.mean()) if own.size else 0.0
        if variance < 1e-12:
            return found
        error = own.std(ddof=1) / math.sqrt(own.size) / (2.0 * variance) if own.size > 1 else 0.0
        return found._replace(noise=math.sqrt(variance), noise_error=float(error))

    @classmethod
    def of(cls, scale: Array, shares: Array, trials: int, motion: ArrayLike) -> "Capacities":
        """Capacities from probabilities at several scales.

        Parameters
        ----------
        scale : ndarray, shape (n,)
            Ascending.
        shares : ndarray, shape (m, n)
            Probabilities of overturning; a row of zeros and ones is taken in ascending order.
        trials : int
            Size of the samples; 0 for probabilities that are not sampled.
        motion : array_like of int, shape (m,)
            Motion of each row.
        """
        logs, motion = np.log(scale), np.unique(np.asarray(motion), return_inverse=True)[1]
        size = trials or 1e18
        first = logs.size - (shares > 0.5).sum(axis=1)
        ends = np.concatenate([[-math.inf], logs, [math.inf]])
        low, high = ends[first], ends[first + 1]
        middle, error = np.zeros(len(shares)), np.full(len(shares), math.inf)
        random = ((shares > 0.0) & (shares < 1.0)).any(axis=1)
        rows, medians, spreads, errors = fit_rows(logs, shares, np.flatnonzero(random))
        errors /= math.sqrt(size)
        steady = errors[:, 1] < _STEADY
        if not steady.any():
            return cls(low, high, middle, error, motion)
        rows, medians, spreads, errors = rows[steady], medians[steady], spreads[steady], errors[steady]
        own = np.array([np.mean(spreads[motion[rows] == number] ** 2) for number in np.unique(motion[rows])])
        noise = math.sqrt(own.mean())
        scatter = own.std(ddof=1) / math.sqrt(own.size) if own.size > 1 else 2.0 * own[0] * errors[0, 1]
        # Of a row too poor for a dispersion of its own each sample says where the middle is, given the common one.
        p = np.clip(shares, 1e-9, 1.0 - 1e-9)
        z = scipy.special.ndtri(p)
        weight = np.exp(-z * z) / (p * (1.0 - p)) * ((shares > 0.0) & (shares < 1.0))
        total = np.where(random, weight.sum(axis=1), 1.0)
        middle = np.where(random, (weight * (logs - noise * z)).sum(axis=1) / total, middle)
        error = np.where(random, noise * np.sqrt(2.0 * math.pi / (size * total)), error)
        middle[rows], error[rows] = medians, errors[:, 0]
        # At this distance from a scale all of a sample come to one thing as often as not.
        reach = -noise * scipy.special.ndtri(-math.expm1(-math.log(2.0) / size))
        low, high = low + reach, high - reach
        between = ~random & (low > high)
        middle[between], error[between] = 0.5 * (low + high)[between], noise / math.sqrt(size)
        free = np.isfinite(error)
        low, high = np.where(free, -math.inf, low), np.where(free, math.inf, high)
        return cls(low, high, middle, error, motion, noise, scatter / (2.0 * noise**2))

    @property
    def located(self) -> Array:
        """Numbers of the motions whose capacity lies within the scales, ascending."""
        return np.unique(self.motion[np.isfinite(self.error) | (np.isfinite(self.low) & np.isfinite(self.high))])

    @property
    def usual_draws(self) -> int:
        """Number of draws by default: 20,000, or fewer where each takes long."""
        least, most = _DRAWS
        drawn = 0.0 if not self.error.any() else _SWEEPS * self.motion.size
        return int(np.clip(_IMPUTED / drawn, least, most)) if drawn else most

    def draws(self, samples: int, rng: np.random.Generator) -> tuple[Array, Array]:
        """Draw from the posterior of the population, by Gibbs sampling where capacities are not exact.

        Parameters
        ----------
        samples : int
            Number of draws.
        rng : numpy.random.Generator

        Returns
        -------
        population : ndarray, shape (samples, 4)
            μ, σ_r between motions, σ_b between blocks, β_n by noise.
        capacity : ndarray, shape (samples, m)
            Logarithms of the capacities of the rows.
        """
        counts = np.bincount(self.motion)
        motions, rows, size = counts.size, self.motion.size, 1.0 / np.mean(1.0 / counts)
        mean_of = self.mean_of
        free = np.isfinite(self.error)
        low, high = (
            np.where(np.isfinite(self.low), self.low, self.high),
            np.where(np.isfinite(self.high), self.high, self.low),
        )
        guess = 0.5 * (np.where(free, self.middle, low) + np.where(free, self.middle, high))
        exact, precision = self.error == 0.0, np.where(self.error > 0.0, self.error, 1.0) ** -2.0
        values = np.broadcast_to(guess, (samples, rows))
        wide = max(float(np.std(guess)), 1e-3)
        own = np.full((samples, 1), 0.0)
        for sweep in range(1 if exact.all() else _SWEEPS):
            means = values @ mean_of
            if rows > motions:
                within = ((values - means[:, self.motion]) ** 2).sum(axis=1, keepdims=True)
                own = within / rng.chisquare(rows - motions, (samples, 1))
            middle = means.mean(axis=1, keepdims=True)
            spread = ((means - middle) ** 2).sum(axis=1, keepdims=True) / rng.chisquare(motions - 1, (samples, 1))
            if not sweep and not exact.all():
                spread = np.maximum(spread, wide**2)
            mu = middle + np.sqrt(spread / motions) * rng.standard_normal((samples, 1))
            between = np.maximum(spread - own / size, 0.0)
            if exact.all():
                break
            at, variance = mu, between
            if rows > motions:
                share = between * counts / (between * counts + own)
                noise = np.sqrt(share * own / counts) * rng.standard_normal(means.shape)
                at, variance = (mu + share * (means - mu) + noise)[:, self.motion], own
            # Variances of logarithms have no unit: 1e-12 is a dispersion of 1e-6.
            values = self._imputed(at, np.maximum(variance, 1e-12), exact, precision, rng)
        scale = self.noise * np.exp(self.noise_error * rng.standard_normal((samples, 1)))
        return np.concatenate([mu, np.sqrt(between), np.sqrt(own), scale], axis=1), values

    def moments(self, population: Array) -> tuple[float, float]:
        """Return median, in the unit of the intensity, and dispersion of the capacities.

        The dispersion of the logarithms is the total one: between motions, between blocks, and by noise.

        Parameters
        ----------
        population : ndarray, shape (samples, 4)
            Draws, as of `draws`: their medians count unless all capacities are exact.
        """
        if self.error.any():
            return tuple(np.median(self.lognormal(population), axis=0).tolist())
        middle, between, own = self._analysis(self.middle)
        return math.exp(middle), math.hypot(between, own, self.noise)

    @staticmethod
    def lognormal(population: Array) -> Array:
        """Return medians and total dispersions (samples, 2) of draws of the population.

        Parameters
        ----------
        population : ndarray, shape (samples, 4)
            As of `draws`.
        """
        # Where two of several motions overturn a block, medians beyond the largest number agree with that too.
        with np.errstate(over="ignore"):
            return np.stack([np.exp(population[:, 0]), np.linalg.norm(population[:, 1:], axis=1)], axis=-1)

    def _analysis(self, logs):
        """Mean, and dispersions between and within motions, each (...,), of logarithms (..., m) of capacities."""
        means, counts = logs @ self.mean_of, np.bincount(self.motion)
        within = ((logs - means[..., self.motion]) ** 2).sum(axis=-1) / max(self.motion.size - counts.size, 1)
        between = np.maximum(means.var(axis=-1, ddof=1) - within * np.mean(1.0 / counts), 0.0)
        return means.mean(axis=-1), np.sqrt(between), np.sqrt(within)

    def lilliefors(self, rng: np.random.Generator, misfit: float | None = None) -> float:
        """p-value of Lilliefors' test that exact capacities are lognormal.

        The statistic is the largest distance of the fitted curve from the share of the motions that overturn the block;
        its distribution is simulated, as both parameters are estimated (H. W. Lilliefors, J. Am. Stat. Assoc. 62,
        399-402, 1967).

        Parameters
        ----------
        rng : numpy.random.Generator
        misfit : float, optional
            The statistic, if it comes from all scales at which outcomes change, not from the capacities.
        """
        _, between, own = self._analysis(self.middle)
        logs = own * rng.standard_normal((_COMPLETE_SETS, self.motion.size))
        logs += (between * rng.standard_normal((_COMPLETE_SETS, self.motion.max() + 1)))[:, self.motion]
        off = self._misfits(self.middle[None])[0] if misfit is None else misfit
        return float((1 + (self._misfits(logs) >= off - 1e-12).sum()) / (1 + _COMPLETE_SETS))

    def p_value(self, logs: Array, shares: Array, trials: int, rng: np.random.Generator) -> float:
        """p-value of the same test where not all capacities are exact; nan where the outcomes determine no curve.

        Parameters
        ----------
        logs : ndarray, shape (n,)
            Logarithms of the scales.
        shares : ndarray, shape (n,)
            Mean over the motions at these.
        trials : int
            Size of the samples of noise; 0 where there are none.
        rng : numpy.random.Generator
        """
        mean_of = self.mean_of
        mu, between, own, noise = np.median(self.draws(_SETS, rng)[0], axis=0)
        middle = mu + between * rng.standard_normal((_SETS, mean_of.shape[1]))[:, self.motion]
        away = logs - (middle + own * rng.standard_normal((_SETS, self.motion.size)))[..., None]
        drawn = scipy.special.ndtr(away / noise) if noise > 0.0 else (away > 0.0).astype(float)
        drawn = rng.binomial(trials, drawn) / trials if trials and noise > 0.0 else drawn
        means = np.concatenate([shares[None], np.einsum("sin,ir->srn", drawn, mean_of).mean(axis=1)])
        rows, middles, spreads, _ = fit_rows(logs, means)
        off = np.abs(scipy.special.ndtr((logs - middles[:, None]) / spreads[:, None]) - means[rows]).max(axis=1)
        return float((1 + (off[1:] >= off[0] - 1e-12).sum()) / off.size) if rows.size and not rows[0] else math.nan

    def _misfits(self, logs):
        """Largest distance (s,) of the share of motions with lower capacities from the fit, of logarithms (s, m)."""
        middle, between, own = self._analysis(logs)
        order = np.argsort(logs, axis=1)
        weights = (self.mean_of.max(axis=1) / self.mean_of.shape[1])[order]
        share = np.cumsum(weights, axis=1)
        away = (np.take_along_axis(logs, order, axis=1) - middle[:, None]) / np.hypot(between, own)[:, None]
        curve = scipy.special.ndtr(away)
        return np.maximum(np.abs(share - curve), np.abs(share - weights - curve)).max(axis=1)

    @property
    def mean_of(self) -> Array:
        """Weights (m, r): an array (..., m) of the m rows @ these is the mean (..., r) over the rows of each motion."""
        return (self.motion[:, None] == np.arange(self.motion.max() + 1)) / np.bincount(self.motion)

    def parts(self, capacity: Array, drawn: Mapping[str, ArrayLike]) -> dict[str, tuple[float, float]]:
        """Return the dispersion that each drawn value causes, and its standard error, by name.

        By linear regression on normal scores of the values, within each motion if it has enough blocks.

        Parameters
        ----------
        capacity : ndarray, shape (samples, m)
            Logarithms, as `draws` returns them.
        drawn : dict of str to array_like, (m,)
            Values of the rows.
        """
        from scipy import stats

        rows, motions = self.mean_of.shape
        scores = np.array([scipy.special.ndtri((stats.rankdata(column) - 0.5) / rows) for column in drawn.values()])
        free = rows - motions - len(scores)
        if free > 0:
            capacity, scores = (values - (values @ self.mean_of)[:, self.motion] for values in (capacity, scores))
        else:
            free = rows - 1 - len(scores)
            capacity, scores = (values - values.mean(axis=1, keepdims=True) for values in (capacity, scores))
        inverse = np.linalg.pinv(scores @ scores.T)
        slopes = capacity @ scores.T @ inverse
        variance = ((capacity - slopes @ scores) ** 2).sum(axis=1).mean() / max(free, 1)
        errors = np.sqrt(variance * np.diag(inverse) + slopes.var(axis=0)) if free > 0 else [math.nan] * len(scores)
        return {
            name: (abs(float(slope)), float(error))
            for name, slope, error in zip(drawn, slopes.mean(axis=0), errors, strict=True)
        }

    def _imputed(self, at, variance, exact, precision, rng):
        """Gibbs step: draws (samples, m) of the log-capacities, given the population and what is measured."""
        estimated = np.isfinite(self.error)
        gain = np.where(estimated, precision * variance / (1.0 + precision * variance), 0.0)
        middle, width = at + gain * (self.middle - at), np.sqrt(variance * (1.0 - gain))
        # Where nothing is bounded, the distribution function at the bounds is 0 and 1.
        free = ~exact & np.isinf(self.low) & np.isinf(self.high)
        bounded = ~exact & ~free
        values, share = np.where(exact, self.middle, middle), rng.random(middle.shape)
        values[:, free] += width[:, free] * np.maximum(scipy.special.ndtri(share[:, free]), -37.0)
        middle, width, share = middle[:, bounded], width[:, bounded], share[:, bounded]
        low, high = (self.low[bounded] - middle) / width, (self.high[bounded] - middle) / width
        # Tails are drawn on the side where the normal distribution has its digits.
        turned = low > 0.0
        low, high = np.where(turned, -high, low), np.where(turned, -low, high)
        lowest, highest = scipy.special.ndtr(low), scipy.special.ndtr(high)
        drawn = scipy.special.ndtri(lowest + share * (highest - lowest))
        drawn = np.clip(drawn, np.maximum(low, -37.0), np.maximum(high, -37.0))
        values[:, bounded] += width * np.where(turned, -drawn, drawn)
        return values


def paired_draws(first: Capacities, second: Capacities, samples: int, rng: np.random.Generator) -> Array:
    """Draw from the joint posterior of the populations of two blocks under the same motions.

    Logarithms of the capacities of a motion are binormal. With the sums of squares S of the pairs (second - first,
    first), Σ* = L L', where L is S's Cholesky factor times the inverse of a lower triangle of χ_{n-1}, χ_{n-2} on its
    diagonal and a normal number: the posterior of the right-Haar prior, in which the limits of the mean difference are
    exact (J. O. Berger and D. Sun, Ann. Stat. 36(2), 963-982, 2008).

    Parameters
    ----------
    first, second : Capacities
        Of rows with the same motions.
    samples : int
        Number of draws.
    rng : numpy.random.Generator

    Returns
    -------
    ndarray, shape (samples, 2, 2)
        Median and dispersion of the first and of the second.
    """
    known = not (first.error.any() or second.error.any())
    one, two = (part.draws(1 if known else samples, rng)[1] for part in (first, second))
    rows, weights, counts = np.stack([two - one, one], axis=-1), first.mean_of, np.bincount(first.motion)
    means = np.einsum("smi,mr->sri", rows, weights)
    middle, motions = means.mean(axis=1), counts.size
    root = _drawn_roots(means - middle[:, None], motions - 1, samples, rng)
    place = middle + (root @ rng.standard_normal((samples, 2, 1)))[..., 0] / math.sqrt(motions)
    between, own = root @ root.swapaxes(1, 2), np.zeros((samples, 2, 2))
    if counts.sum() > motions:
        inner = _drawn_roots(rows - means[:, first.motion], int(counts.sum()) - motions, samples, rng)
        own = inner @ inner.swapaxes(1, 2)
    both = np.array([[0.0, 1.0], [1.0, 1.0]])  # the logarithms of the first and of the second, of what was drawn
    logs = place @ both.T
    spread, inside = (np.einsum("ik,skl,il->si", both, part, both) for part in (between, own))
    noise = [part.noise * np.exp(part.noise_error * rng.standard_normal(samples)) for part in (first, second)]
    rest = np.maximum(spread - inside * np.mean(1.0 / counts), 0.0)
    return np.stack([np.exp(logs), np.sqrt(rest + inside + np.array(noise).T ** 2)], axis=-1)


def _drawn_roots(away, free, samples, rng):
    """Draw factors L (samples, 2, 2) of covariances from deviations (s, m, 2) of `free` degrees of freedom."""
    # Variances of logarithms have no unit: 1e-12 is a dispersion of 1e-6.
    lower = np.linalg.cholesky(away.swapaxes(1, 2) @ away + 1e-12 * np.eye(2))
    triangle = np.zeros((samples, 2, 2))
    for place in (0, 1):
        triangle[:, place, place] = np.sqrt(rng.chisquare(max(free - place, 1), samples))
    triangle[:, 1, 0] = rng.standard_normal(samples)
    return lower @ np.linalg.inv(triangle)
