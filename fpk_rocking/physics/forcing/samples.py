"""Samples of a record: checked once, and the correction of their baseline, an offset and a drift of the velocity.

A study has many copies of a record, one for each scale. They share their samples, and what follows from these whatever
the scale and the block.

An offset of .004 g, which no plot of the acceleration shows, integrates to 1.6 m/s in 40 s. Padding as in D. M. Boore,
"On pads and filters: processing strong-motion data", Bull. Seism. Soc. Am. 95(2), 745-750, 2005; the corrections are
compared in D. M. Boore, J. J. Bommer, "Processing of strong-motion accelerograms: needs, options and consequences",
Soil Dyn. Earthquake Eng. 25(2), 93-115, 2005.
"""

import functools
from collections.abc import Callable
from typing import Any, NamedTuple, Self

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.base.checks import Array
from fpk_rocking.physics.forcing.readers.components import MOST

BASELINES = ("none", "mean", "linear", "high-pass")
"""Corrections of a baseline."""

CORNER_HZ = 0.1
"""Corner of the high-pass filter where none is given, one that processed accelerograms often have."""

_ORDER = 4
"""Order of the high-pass filter, forwards and backwards together: |H| = 1 / (1 + (corner / f)^4)."""

_MOST_PADDING = 2**21
"""Most zeros on either side."""


class Samples(tuple[float, ...]):
    """Accelerations, 2 to 2^20 finite floats, in any unit: a tuple that keeps what is computed of it."""

    @classmethod
    def of(cls, value: Any) -> Self:
        """The samples in any sequence of numbers; else TypeError or ValueError."""
        if isinstance(value, cls):
            return value
        accepted = f"a list of 2 to {MOST} finite numbers"
        array = checks.array("forcing.samples", value, accepted)
        if array.ndim != 1 or not 2 <= array.size <= MOST:
            raise ValueError(checks.refusal("forcing.samples", f"an array of shape {array.shape}", accepted))
        wild = np.flatnonzero(~np.isfinite(array))
        if wild.size:
            raise ValueError(checks.refusal(f"forcing.samples[{wild[0]}]", float(array[wild[0]]), accepted))
        return cls(array.tolist())

    def __reduce__(self):
        return Samples, (tuple(self),)

    @functools.cached_property
    def array(self) -> Array:
        """The samples (n,); not written to."""
        return np.array(self)

    @functools.cached_property
    def toml(self) -> str:
        """The samples as a TOML list; Python's shortest exact form of a float is TOML too."""
        return f"[{', '.join(map(repr, self))}]"

    @functools.cached_property
    def _kept(self) -> dict[Any, Any]:
        return {}

    def once(self, key: Any, compute: Callable[[], Any]) -> Any:
        """What `compute` returns; it is called the first time that these samples are asked for a `key`."""
        if key not in self._kept:
            self._kept[key] = compute()
        return self._kept[key]


class Drift(NamedTuple):
    """Peak velocity and acceleration of a record before and after its baseline is corrected, and what is removed.

    Parameters
    ----------
    pgv, pga, end_velocity : float
        Peak velocity, m/s, peak acceleration, m/s², and last velocity, m/s, of the samples before the correction; the
        velocity is their integral from 0.
    removed_velocity : float
        Largest velocity that the correction removes, m/s.
    corrected_pgv, corrected_pga : float
        Peaks of the corrected samples.
    offset, slope : float
        Line of least squares through the samples: its value at the middle of the record, m/s², and its slope, m/s³.

    Examples
    --------
    >>> from fpk_rocking import Record
    >>> drift = Record(0.01, [0.04] * 4001, "m/s2").drift
    >>> print(f"{drift.pgv:.1f} m/s, {drift.corrected_pgv:.1f} m/s without an offset of {drift.offset:.2f} m/s²")
    1.6 m/s, 0.0 m/s without an offset of 0.04 m/s²
    """

    pgv: float
    pga: float
    end_velocity: float
    removed_velocity: float
    corrected_pgv: float
    corrected_pga: float
    offset: float
    slope: float

    @property
    def drifts(self) -> bool:
        """Whether the velocity is that of a drift: the correction removes more than .24 of `corrected_pgv`.

        In measured motions without drift, to which an offset of .004 g was added, the part removed is at least .245; in
        99 % of synthetic motions without drift it is at most .24 (docs/benchmarks/records_that_drift.json).
        """
        return self.removed_velocity > 0.24 * self.corrected_pgv


def corners(interval: float) -> tuple[float, float]:
    """(lowest, highest) corner of the high-pass filter, Hz, for samples at `interval` seconds."""
    return 1.5 * _ORDER / (_MOST_PADDING * interval), 0.499 / interval


def corrected(samples: Array, interval: float, baseline: str, corner_hz: float = CORNER_HZ) -> Array:
    """Samples (n,) less what the `baseline` correction removes, see `Record`.

    The filter is Butterworth's of order 2, run forwards and backwards: phases are kept. Before, 1.5 · 4 / corner
    seconds of zeros are added on either side, and cut off again.
    """
    if baseline == "none":
        return samples
    if baseline == "mean":
        return samples - samples.mean()
    offset, slope, steps = _line(samples)
    straight = samples - (offset + slope * steps)
    if baseline == "linear":
        return straight
    # scipy.signal takes a fifth of a second to import.
    from scipy import signal

    padding = int(np.ceil(1.5 * _ORDER / (corner_hz * interval)))
    sections = signal.butter(_ORDER // 2, corner_hz, "highpass", fs=1.0 / interval, output="sos")
    return signal.sosfiltfilt(sections, np.pad(straight, padding), padtype=None)[padding : padding + len(samples)]


def drift_of(samples: Array, after: Array, interval: float) -> Drift:
    """`Drift` of accelerations (n,), m/s², `samples` before and `after` a correction."""
    speed, corrected_speed = _velocity(samples, interval), _velocity(after, interval)
    offset, slope, _ = _line(samples)
    return Drift(
        pgv=float(np.abs(speed).max()),
        pga=float(np.abs(samples).max()),
        end_velocity=float(speed[-1]),
        removed_velocity=float(np.abs(speed - corrected_speed).max()),
        corrected_pgv=float(np.abs(corrected_speed).max()),
        corrected_pga=float(np.abs(after).max()),
        offset=offset,
        slope=slope / interval,
    )


def _velocity(samples, interval):
    """Velocity (n,) at samples (n,) of accelerations that are linear between them, 0 at the first."""
    return interval * np.concatenate([[0.0], np.cumsum(0.5 * (samples[1:] + samples[:-1]))])


def _line(samples):
    """(middle, slope, steps): line of least squares; its slope is per sample, the steps (n,) count from the middle."""
    steps = np.arange(len(samples)) - 0.5 * (len(samples) - 1)
    return float(samples.mean()), float(samples @ steps / (steps @ steps)), steps
