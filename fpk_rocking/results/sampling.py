"""What paths tell: sampling intervals and distances of probabilities, a density's error by replaced noise, and returns.

Bins hold sub-probabilities: their sum is the survival, not one. A sample size is the number of realizations behind the
bins, ``math.inf`` for bins that come from a density and carry no sampling error.

`measured` compares a density with paths under the noise of the scene. This is the one place that defines the measured
replacement and the total error of a printed probability.

`return_diagnostics` is for blocks that count as overturned and yet come back. The default angle of overturning, π/2
critical angles, is passed before a block falls, and strong shaking can bring it back from there. Monte Carlo follows
some of the paths that pass it on to the fall, which is 90 degrees, where the block lies flat.
"""

import dataclasses
import math
import statistics
from collections.abc import Iterator
from typing import Annotated, Any

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.base.checks import Array, ArrayLike
from fpk_rocking.physics.noise import equivalence
from fpk_rocking.results.storage import plain
from fpk_rocking.results.trust import CAUTION, REPLACED, Diagnostic
from fpk_rocking.scene.parts import Overturning
from fpk_rocking.scene.scene import Scene


def wilson_interval(successes: ArrayLike, trials: int | Array, level: float = 0.95) -> Array:
    """Return confidence limits of a probability from a count (E. B. Wilson, J. Am. Stat. Assoc. 22, 209-212, 1927).

    Parameters
    ----------
    successes : array_like of int, shape (...)
        Counts.
    trials : int or ndarray, shape (...)
        Size of the sample, or of each.
    level : float
        Confidence of each interval, in (0, 1).

    Returns
    -------
    ndarray, shape (..., 2)
        Lower and upper limits, within [0, 1] also where the count is 0 or `trials`.

    Raises
    ------
    TypeError, ValueError
        The level is not a number above 0 and below 1.
    """
    z = statistics.NormalDist().inv_cdf(0.5 + 0.5 * checks.part("level", level))
    share = np.asarray(successes) / trials
    scale = 1.0 / (1.0 + z * z / trials)
    centre = scale * (share + 0.5 * z * z / trials)
    half = scale * z * np.sqrt(share * (1.0 - share) / trials + 0.25 * (z / trials) ** 2)
    return np.stack([np.where(share == 0.0, 0.0, centre - half), np.where(share == 1.0, 1.0, centre + half)], axis=-1)


def l1(first: ArrayLike, second: ArrayLike) -> float:
    """Return the sum of absolute differences of two arrays of bin probabilities, of one shape: from 0 to 2."""
    return float(np.abs(np.asarray(first) - np.asarray(second)).sum())


def hellinger(first: Array, second: Array) -> float:
    """Return the Hellinger distance ``sqrt(1/2 sum (sqrt p - sqrt q)^2)`` of two arrays of bin probabilities, 0 to 1.

    They have one shape. A negative bin, the undershoot of a density, counts as zero here; `l1` takes it as it is.
    """
    roots = [np.sqrt(np.maximum(values, 0.0)) for values in (first, second)]
    return float(np.sqrt(0.5 * np.square(roots[0] - roots[1]).sum()))


def pooled(first: ArrayLike, second: ArrayLike, first_size: float, second_size: float) -> np.ndarray:
    """Return the best estimate of probabilities that two results share: the exact ones, or means by sample size.

    Parameters
    ----------
    first, second : array_like
        Probabilities of equal shape.
    first_size, second_size : float
        Sample sizes, ``math.inf`` where there is no sampling error.

    Returns
    -------
    ndarray
        Probabilities within [0, 1], of that shape. Two exact results are averaged.
    """
    if math.isinf(first_size) or math.isinf(second_size):
        weight = float(math.isinf(first_size)) / (math.isinf(first_size) + math.isinf(second_size))
    else:
        weight = first_size / (first_size + second_size)
    return np.clip(weight * np.asarray(first) + (1.0 - weight) * np.asarray(second), 0.0, 1.0)


def l1_floor(probabilities: ArrayLike, first_size: float, second_size: float) -> float:
    """Return the expected `l1` of two samples drawn from one law.

    A bin's difference is nearly normal with variance ``p (1 - p) (1/n1 + 1/n2)``, so its expected absolute value is
    ``sqrt(2/pi)`` times the square root of that. Where less than about one sample is expected in a bin the difference
    is not normal, and the bound ``2 p`` that always holds is the smaller and the better value.

    Parameters
    ----------
    probabilities : array_like
        The common bin probabilities, see `pooled`.
    first_size, second_size : float
        Sample sizes, ``math.inf`` where there is no sampling error.

    Returns
    -------
    float
        The sampling floor: a distance near it is explained by sampling alone.
    """
    p = np.asarray(probabilities, dtype=float)
    variance = p * (1.0 - p) * (1.0 / first_size + 1.0 / second_size)
    return float(np.minimum(np.sqrt(2.0 / math.pi * variance), 2.0 * p).sum())


def hellinger_floor(probabilities: ArrayLike, first_size: float, second_size: float) -> float:
    """Return the root mean square `hellinger` of two samples drawn from one law.

    Of two independent samples ``E (sqrt p1 - sqrt p2)^2 = 2 p - 2 E sqrt p1 E sqrt p2``, where p1 and p2 are a bin's
    observed frequencies and p is their mean; summed and halved this is the mean square distance. ``E sqrt p1`` is taken
    from the Poisson distribution of the bin's count, its deficit below ``sqrt p`` scaled by the binomial ``1 - p``, so
    bins with few or no samples are counted right. In bins with many samples the sum tends to
    ``(1 - p)/8 (1/n1 + 1/n2)`` a bin, hence about ``sqrt(bins/8 (1/n1 + 1/n2))`` for the distance.

    Parameters
    ----------
    probabilities : array_like
        The common bin probabilities, see `pooled`.
    first_size, second_size : float
        Sample sizes, ``math.inf`` where there is no sampling error.

    Returns
    -------
    float
        The sampling floor: a distance near it is explained by sampling alone.
    """
    p = np.asarray(probabilities, dtype=float).ravel()
    roots = [_mean_root(p, size) for size in (first_size, second_size)]
    return math.sqrt(max(float((p - roots[0] * roots[1]).sum()), 0.0))


def _mean_root(p, size) -> np.ndarray:
    """Return E sqrt(count/size) (n,) of bins of probability p (n,), for a sample `size`, which may be ``math.inf``."""
    if math.isinf(size):
        return np.sqrt(p)
    return np.sqrt(p) - (1.0 - p) * _root_deficit(p * size) / math.sqrt(size)


def _root_deficit(mean) -> np.ndarray:
    """Return sqrt(mean) - E sqrt(count), (n,), of Poisson counts with the means `mean` (n,).

    It is summed up to a mean of 30, and follows from its asymptotic series above.
    """
    from scipy.special import gammaln

    series_from = 30.0  # the counts up to 159 hold all but 1e-60 of a Poisson distribution of this mean
    large = np.maximum(mean, series_from)
    asymptotic = (1.0 / 8.0 + (7.0 / 128.0 + 75.0 / (1024.0 * large)) / large) / np.sqrt(large)
    small = np.clip(mean, 1e-300, series_from)[:, None]
    count = np.arange(1, 160)
    weights = np.exp(count * np.log(small) - small - gammaln(count + 1.0))
    summed = np.sqrt(small[:, 0]) - weights @ np.sqrt(count)
    return np.where(mean > series_from, asymptotic, summed)


@dataclasses.dataclass(frozen=True, eq=False)
class Replacement:
    """Probabilities by paths under the noise of the scene, less those by a density with another noise in its place.

    Row k is that of the density. Its three columns are survival, overturned to the left and overturned to the right.

    Attributes
    ----------
    difference : ndarray, shape (cycles + 1, 3)
        Probability by the paths less that by the density.
    sampling_error : ndarray, shape (cycles + 1, 3)
        Sampling error of the difference, 95 %: from the share of the paths to the farther end of Wilson's interval.
    method : str
        Engine of the paths, as in "exact".
    realizations : int
        Number of paths.
    seed : int
        Of the paths.
    wall_s : float
        Seconds that the paths took.

    Examples
    --------
    >>> from fpk_rocking import load_scene, solve_fpk
    >>> from fpk_rocking.studies import checked
    >>> density = checked(solve_fpk(load_scene("main"), cycles=4, tol=1e-2), realizations=1000)
    >>> print(density.replacement.difference[4].round(2), density.replacement.sampling_error[4].round(2))
    [ 0.01  0.   -0.01] [0.02 0.01 0.02]
    """

    difference: Annotated[Array, "f8 time 3"]
    sampling_error: Annotated[Array, "f8 time 3"]
    method: str
    realizations: int
    seed: int
    wall_s: float

    def total(self, numerics: float) -> Array:
        """Return total errors of the density's probabilities: numerics + |difference| + sampling error.

        Parameters
        ----------
        numerics : float
            The solver's own estimate of its error.

        Returns
        -------
        ndarray, shape (cycles + 1, 3)
            The density's probability ± this contains Wilson's 95 % interval of the paths, so it contains the
            probability under the noise of the scene in at least 95 % of all cases, in each row.
        """
        return numerics + np.abs(self.difference) + self.sampling_error

    @property
    def plain(self) -> dict[str, Any]:
        """A dict of all fields by name as plain values, for JSON, and "columns", the names of the columns."""
        values = {field.name: getattr(self, field.name) for field in dataclasses.fields(self)}
        return plain(values | {"columns": ["survival", "overturned left", "overturned right"]})


def measured(density: Any, paths: Any) -> Replacement:
    """Return the `Replacement` of a density: probabilities by paths under the noise of the scene, less its own.

    Parameters
    ----------
    density : Evolution
        Its noise was replaced (``noise_replacement``).
    paths : Ensemble or Tally
        Of the same scene, at the same times or more.

    Returns
    -------
    Replacement
        `difference` and `sampling_error`, (rows, 3) of survival, overturned to the left and to the right, and the size
        of the sample.

    Raises
    ------
    ValueError
        The paths are of another scene or of other times, or no noise was replaced.
    """
    if not density.noise_replacement:
        raise ValueError("density: got one whose noise was solved as it is, accepted: one whose noise was replaced")
    if paths.scene != density.scene:
        raise ValueError("paths: got those of another scene, accepted: paths of the density's own scene and noise")
    rows = len(density.times)
    if len(paths.times) < rows or not np.allclose(paths.times[:rows], density.times, rtol=1e-12, atol=0.0):
        raise ValueError("paths: got other times, accepted: all times of the density")
    sampled, solved = (_probabilities(result)[:rows] for result in (paths, density))
    limits = wilson_interval(np.round(sampled * paths.realizations), paths.realizations)
    error = np.abs(limits - sampled[..., None]).max(axis=-1)
    return Replacement(sampled - solved, error, paths.method, paths.realizations, paths.seed, float(paths.wall_s))


def check_remarks(density: Any) -> Iterator[str]:
    """Yield sentences about a measured replacement: how it was measured and, where its error is large, what helps.

    Parameters
    ----------
    density : Evolution
        Whose noise was replaced and whose replacement was measured (`measured`).

    Yields
    ------
    str
    """
    check, total = density.replacement, density.total_error
    yield (
        f"{density.overturning_text()}. Replacement: {check.realizations:,} paths under the noise of the scene "
        f"({check.method}, seed {check.seed}, {check.wall_s:.1f} s) less the density, with its 95 % sampling error. "
        "Total: numerics + |replacement| + sampling error."
    )
    if total.max() <= max(REPLACED, density.tol):
        return
    worst = np.unravel_index(total.argmax(), total.shape)
    if check.sampling_error[worst] > abs(check.difference[worst]):
        yield "Most of the total error is the sampling error of the check: more paths make it smaller."
        return
    alone = 1.0 - density.survival[-1] - check.difference[-1, 0]
    yield (
        f"Better here are the paths alone: P(overturned) = {alone:.4f} ± {check.sampling_error[-1, 0]:#.2g} in the end."
    )
    noise, block = density.scene.noise, density.scene.block
    part = equivalence.relative_variance(noise, block.critical_angle)
    spread = ""
    if noise.frequencies == "independent":
        strength = equivalence.realized_spread(noise, block.restitution, block.critical_angle)
        spread = f"; realizations of {noise.harmonics} harmonics differ in strength by {100.0 * strength:.0f} %"
    rest = (
        f"; the forcing alone reaches {density.scene.forcing.largest:.3g}, a block at rest lifts off above "
        f"{block.lift_off:.4g}, and under white noise none rests"
    )
    yield (
        f"What may explain it: the band [{noise.band[0]:g}, {noise.band[1]:g}] covers {100.0 * part:.0f} % of the "
        f"Melnikov variance of equally strong white noise{spread}{'' if density.rests_exactly else rest}."
    )


def _probabilities(result):
    """Return an array (rows, 3) of a `SurvivalResult`: columns survival, overturned to the left and to the right."""
    return np.column_stack([result.survival, result.overturned])


def angle_of_fall(scene: Scene) -> float | None:
    """Return the angle at which the block of a scene lies flat, 90 degrees, nondimensional (in critical angles).

    None where the critical angle is unknown, or where overturning is at another angle than the default, or not before
    the fall.
    """
    alpha, cutoff = scene.block.critical_angle, scene.overturning.angle
    before = cutoff == Overturning().angle and 0.0 < alpha * cutoff < 0.5 * math.pi
    return 0.5 * math.pi / alpha if before else None


def return_diagnostics(scene: Scene, overturned: float, error: float, returns: Array) -> list[Diagnostic]:
    """Return a list with a `Diagnostic` if blocks that come back change a probability by more than its error.

    Parameters
    ----------
    scene : Scene
    overturned, error : float
        Probability of having overturned by the last time, and its error.
    returns : ndarray of int, shape (2,)
        How many paths that overturned were followed on to the fall, and how many of them came back.

    Returns
    -------
    list of Diagnostic
        Empty where the lower limit (95 %) of what comes back is within the error.
    """
    followed, back = (int(count) for count in returns)
    if followed == 0:
        return []
    low, high = wilson_interval(back, followed).tolist()
    if overturned * low <= error:
        return []
    degrees = math.degrees(scene.block.critical_angle * scene.overturning.angle)
    limits = (
        "" if scene.deterministic else f" (95 %: {overturned * (1.0 - high):.2f} to {overturned * (1.0 - low):.2f})"
    )
    paths = "the path" if followed == 1 else f"{followed} such paths"
    sentence = (
        f"A block counts as overturned here from {degrees:.0f}° on (π/2 critical angles, the default), but the shaking "
        f"brings blocks back from there: of {paths} followed on, {back} did not fall. P(overturned) would be about "
        f"{overturned * (1.0 - back / followed):.2f}{limits} in place of {overturned:.2f} if the fall itself counted: "
        'overturning_angle = "90 deg" (in a scene file overturning.angle_deg = 90).'
    )
    return [Diagnostic(CAUTION, sentence, "returns")]
