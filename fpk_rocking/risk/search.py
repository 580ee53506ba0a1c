"""Outcomes without noise: the scales of a motion at which a block begins or ceases to overturn.

What one path comes to is a function of the scale that jumps between standing and overturning. The jumps are bracketed
by a scan in the logarithm of the scale and then halved. The scan is coarse where the block hardly rocks, and fine where
it overturns or comes within sight of it.

The function is a fractal: of the intervals that a scan five times as fine shows under 238 motions of a shake table,
four in five are narrower than `FINE`, and two in five of all are missed. They change the mean of the probability by
.001, for those of overturning and those of standing balance. But the lowest scale at which a motion overturns falls on
and on as the scan gets finer; taken for the capacity it makes a rate 1.8 to 2 times as large. So the critical scale is
that from which the block overturns over a part of `FINE` at least (1.2 times; benchmarks/critical_search.py), at all
scales of a scan in steps of `SOLID`.
"""

import math
from collections.abc import Callable, Iterable, Sequence
from typing import Annotated, Any, NamedTuple

import numpy as np

from fpk_rocking.base.checks import Array, ArrayLike
from fpk_rocking.base.precompilation import Compilation
from fpk_rocking.risk.motions import intensity_of
from fpk_rocking.scene.scene import Scene
from montecarlo.engines import engine_of
from montecarlo.engines.batches import compilation_of
from montecarlo.engines.scaled_paths import Outcomes, ScaledPaths

COARSE, FINE, EDGE = 0.04, 0.01, 1e-3
"""Steps of the scan in the logarithm of the scale, and the width to which a jump is bracketed. FINE is COARSE halved
twice. Intervals wider than FINE are met but for 7 and 11 in 1,000, for two blocks: what CALM hides, and rounding."""


SOLID = FINE / 4.0
"""Step of the scan up to the critical scale: no interval of standing as wide as this counts as one of overturning."""


SETTLED, FARTHEST = 2.0, 1000.0
"""A search without an end of its own goes on until a block overturns at all scales of the coarse scan over a factor of
SETTLED, and no farther than FARTHEST times the scale that lifts it off."""


CALM = 0.125
"""Part of the angle of overturning below which a path counts as far from it: the coarse scan does there."""


def jumps(paths: ScaledPaths, low: float, high: float, settled: float = math.inf, at: Iterable[float] = ()) -> Array:
    """Return the scales at which the outcome of a path changes, ascending: the first, third, ... to overturning.

    They agree with the outcomes at the scales `at`, on which the scan does not depend.
    """
    scales = np.append(low * np.exp(COARSE * np.arange(math.ceil(math.log(high / low) / COARSE))), high)
    asked = np.array([scale for scale in at if low < scale < high])
    own = paths(asked)
    scales, outcomes = _until_settled(paths, scales, settled, asked[~own.overturned].max(initial=low))
    scales, outcomes = _split(paths, scales, outcomes, FINE)
    scales, outcomes = _scan_to_critical(paths, scales, outcomes)
    asked, places = np.unique(asked, return_index=True)
    # Beyond the scan all overturn, as these do.
    new = (asked < scales[-1]) & ~np.isin(asked, scales)
    scales, outcomes = _inserted(scales, outcomes, asked[new], Outcomes(*(column[places[new]] for column in own)))
    return _changes(*_split(paths, scales, outcomes, math.inf))


def _changes(scales, outcomes):
    """Return the scales at which outcomes change, ascending: the first, third, ... to overturning."""
    over = outcomes.overturned
    middles = np.sqrt(scales[1:] * scales[:-1])[over[1:] != over[:-1]]
    return np.append(scales[0], middles) if over[0] else middles


def _scan_to_critical(paths, scales, outcomes):
    """Return scales and outcomes with others between them, SOLID apart from the first jump to where FINE overturns.

    Two scales of the scan may lie in slivers of overturning, with others of standing between them.
    """
    while True:
        scales, outcomes = _split(paths, scales, outcomes, math.inf)
        changes = _changes(scales, outcomes)
        end = first_scale(changes[None])[0] * math.exp(FINE)
        inside = (scales[1:] > changes.min(initial=math.inf)) & (scales[:-1] < end)
        split = inside & (np.diff(np.log(scales)) > SOLID * (1.0 + 1e-9))
        if math.isinf(end) or not split.any():
            return scales, outcomes
        middles = np.sqrt(scales[1:] * scales[:-1])[split]
        scales, outcomes = _inserted(scales, outcomes, middles, paths(middles))


def _split(paths, scales, outcomes, finest):
    """Return scales and outcomes with others between them: jumps to EDGE, and what is not calm to a step `finest`."""
    while True:
        over, gap = outcomes.overturned, np.diff(np.log(scales))
        jump, calm = over[1:] != over[:-1], np.maximum(outcomes.peak[1:], outcomes.peak[:-1]) < CALM * paths.cutoff
        split = np.where(jump, gap > EDGE, ~calm & (gap > finest * (1.0 + 1e-9)))
        if not split.any():
            return scales, outcomes
        middles = np.sqrt(scales[1:] * scales[:-1])[split]
        scales, outcomes = _inserted(scales, outcomes, middles, paths(middles))


def _inserted(scales, outcomes, more, of_more):
    """Return ascending scales with `more` of them among them, and the `Outcomes` of all."""
    places = np.searchsorted(scales, more)
    columns = zip(outcomes, of_more, strict=True)
    return np.insert(scales, places, more), Outcomes(*(np.insert(old, places, new) for old, new in columns))


def _until_settled(paths, scales, settled, standing):
    """Return the scales (n,) of a scan, up to those that settle it beyond one that is `standing`; their `Outcomes`."""
    count = scales.size if math.isinf(settled) else math.ceil(math.log(settled) / COARSE)
    outcomes = paths(scales[:count])
    while (size := outcomes.peak.size) < scales.size and not (
        outcomes.overturned[-count:].all() and scales[size - 1] > standing
    ):
        more = paths(scales[outcomes.peak.size : outcomes.peak.size + count])
        outcomes = Outcomes(*map(np.append, outcomes, more))
    return scales[: outcomes.peak.size], outcomes


def farthest_scale(scene: Scene) -> float:
    """Scale at which a search without an end of its own gives up."""
    lifting = scene.forcing.lifting(scene.block.lift_off)
    return FARTHEST / lifting if lifting > 0.0 else 1.0


def overturns(jumps: Array, scales: ArrayLike) -> Array:
    """Return whether each of m blocks overturns at each of `scales` (n,), an array of bool (m, n)."""
    return (jumps[:, None, :] <= np.asarray(scales, float)[:, None]).sum(axis=-1) % 2 == 1


def first_scale(jumps: Array) -> Array:
    """Return the lowest scale (m,) of each of m blocks from which it overturns over 1 % (`FINE`) at least."""
    begins = jumps[:, ::2]
    ends = np.full(begins.shape, math.inf)
    ends[:, : jumps.shape[1] // 2] = np.nan_to_num(jumps[:, 1::2], nan=math.inf)
    with np.errstate(invalid="ignore"):
        wide = ends >= math.exp(FINE) * begins
    return np.where(wide, begins, math.inf).min(axis=1, initial=math.inf)


def last_scale(jumps: Array) -> Array:
    """Highest scales (m,) at which blocks begin to overturn for good; inf where they stand in the end."""
    count = np.isfinite(jumps).sum(axis=1)
    last = np.nanmax(jumps, axis=1, initial=-math.inf)
    return np.where(count % 2 == 1, last, math.inf)


def signs_of(jumps: Array) -> Array:
    """Signs (k,) of scales (..., k) at which outcomes change: 1 from which on a block overturns, -1 where it stands."""
    return 1.0 - 2.0 * (np.arange(jumps.shape[-1]) % 2)


def equivalent_scale(jumps: Array) -> Array:
    """Scales (m,) above which overturning at all scales covers as much of the logarithm as these do."""
    logs = np.nansum(signs_of(jumps) * np.log(jumps), axis=1)
    return np.where(np.isfinite(last_scale(jumps)), np.exp(logs), math.inf)


class MotionOutcomes(NamedTuple):
    """What s scenes without noise come to over their scales, and at their own."""

    jumps: Annotated[Array, "f8 s l+1 k"]  # (s, l + 1, k)
    peak: Annotated[Array, "f8 s"]  # (s,)
    overturn_time: Annotated[Array, "f8 s"]  # (s,)
    overturn_side: Annotated[Array, "i1 s"]  # (s,)

    @property
    def critical(self) -> Array:
        """Lowest scale (s,) from which each scene overturns over 1 % at least; inf for one that does not."""
        return first_scale(self.jumps[:, 0])

    @classmethod
    def of(cls, values: Sequence[dict[str, Any]], curves: int = 1) -> "MotionOutcomes":
        """Return the `MotionOutcomes` of a list of what `search` has returned."""
        own = values[::curves]
        rows = _padded([row.get("jumps", ()) for row in values])
        return cls(
            rows.reshape(len(own), curves, rows.shape[1]),
            np.array([row.get("peak") for row in own], float),
            np.array([row.get("overturn_time") for row in own], float),
            np.array([row.get("overturn_side", 0) for row in own], np.int8),
        )


def search(
    scene: Scene,
    *,
    seed: int,  # noqa: ARG001  (a task has one)
    measure: str,
    highest: float | None,
    at: Sequence[float] = (),
    **lasting: Any,
) -> dict[str, Any]:
    """Follow a scene without noise over its scales; return a dict: jumps, outcomes at its own scale and `at` others.

    The jumps agree with the outcomes at its own scale, and for a record as it was recorded, but not with those `at`
    others: what follows from the jumps does not depend on these.
    """
    paths = ScaledPaths(scene, **lasting)
    (overturn_time,), (side,), (peak,) = paths([1.0])
    own = 1.0 if measure == "scale" else intensity_of(scene, measure)
    high = farthest_scale(scene) if highest is None else highest / own
    low = paths.least_scale or 1e-3 * high
    settled = SETTLED if highest is None else math.inf
    recorded = 1.0 / (abs(getattr(scene.forcing, "scale", 1.0)) or 1.0)
    return {
        "jumps": jumps(paths, low, high, settled, (1.0, recorded)).tolist() if low < high else [],
        "at": paths(at).overturned.tolist(),
        "peak": float(peak),
        "overturn_time": None if math.isnan(overturn_time) else float(overturn_time),
        "overturn_side": int(side),
    }


def kernels_of(
    task: Callable[..., Any],  # noqa: ARG001  (as `tasks.kernels_of`)
    scenes: Iterable[Scene],
    options: dict[str, Any],  # noqa: ARG001
) -> list[Compilation]:
    """Return a sorted list of the compilations that the paths of some scenes need."""
    return sorted({compilation_of(engine_of(scene, "exact"), scene) for scene in scenes})


def _padded(rows: Sequence[Array]) -> Array:
    """Return rows of numbers as one array (m, k), with nan behind the last number of a shorter row."""
    out = np.full((len(rows), max(map(len, rows), default=0)), math.nan)
    for row, values in zip(out, rows, strict=True):
        row[: len(values)] = values
    return out
