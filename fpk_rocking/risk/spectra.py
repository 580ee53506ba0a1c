"""Response of an oscillator to a motion that is linear between its samples, exact at them: spectra and filters."""

import math

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.base.checks import Array, ArrayLike
from fpk_rocking.physics.forcing import Record
from fpk_rocking.physics.forcing.readers.terms import UNITS
from fpk_rocking.physics.forcing.samples import Samples

_PER_PERIOD = 200
"""Points in a period at which the largest response is looked for: between them it may be 1.2e-4 larger."""

PERIODS = 0.01, 20.0
"""Shortest and longest period of a spectrum, seconds."""


def oscillator(numerator: list[float], samples: Array, interval: float, frequency: float, damping: float) -> Array:
    """Return samples (n,) of `numerator` / (s² + 2 ζ ω s + ω²) of an input that is linear between its samples (n,).

    Exact: a first-order hold is such an input. It rises from 0 to its first sample within one interval.
    """
    from scipy import signal

    system = numerator, [1.0, 2.0 * damping * frequency, frequency**2]
    upper, lower, _ = signal.cont2discrete(system, interval, method="foh")
    return signal.lfilter(np.ravel(upper), lower, samples)


def finer(samples: Array, interval: float, longest: float, tail: float) -> tuple[Array, float]:
    """Return (samples, interval) on the same lines, at most `longest` apart, from 0 to the first and 0 for a `tail`."""
    parts = math.ceil(interval / longest - 1e-9)
    points = np.concatenate([[0.0], samples, np.zeros(math.ceil(tail / interval))])
    places = np.arange((len(points) - 1) * parts + 1) / parts
    return np.interp(places, np.arange(len(points)), points), interval / parts


def response_spectrum(record: Record, period: ArrayLike, damping: float = 0.05) -> Array:
    """Return the pseudo-acceleration response spectrum ω² max |u| of a record, free vibration after it included.

    Parameters
    ----------
    record : Record
        The record after its baseline correction, linear between its samples.
    period : array_like, shape (n,)
        Seconds, .01 to 20.
    damping : float
        Damping ratio of the oscillator, below 1.

    Returns
    -------
    ndarray, shape (n,)
        m/s².

    Examples
    --------
    >>> from fpk_rocking.risk import response_spectrum, synthetic_records
    >>> motion = synthetic_records(1, duration=5.0)[0]
    >>> print(response_spectrum(motion, [0.2, 1.0]).round(2))
    [3.77 1.31]
    """
    checks.instance("record", record, Record)
    damping = checks.part("damping", damping)
    periods = checks.several("period", period, most=10_000, at_least=PERIODS[0], at_most=PERIODS[1])
    return np.array([_pseudo_acceleration(record, seconds, damping) for seconds in periods])


def _pseudo_acceleration(record, period, damping):
    """Pseudo-acceleration of a `Record`, m/s²; kept with its samples, which all its scales share."""
    frequency = 2.0 * math.pi / period

    def compute():
        samples, interval = finer(record.corrected_samples, record.interval, period / _PER_PERIOD, period)
        return float(np.abs(oscillator([frequency**2], samples, interval, frequency, damping)).max())

    key = "response", period, damping, record.interval, record.baseline, record.corner_hz
    return abs(record.scale) * UNITS[record.units] * Samples.of(record.samples).once(key, compute)


def narrowness(record: Record) -> float:
    """Return the largest share of the energy of a record that lies within 18 % of one frequency, .1 to 20 Hz."""

    def compute():
        samples = record.corrected_samples
        energy = np.cumsum(np.abs(np.fft.rfft(samples, 2 * len(samples))) ** 2)
        hertz, centre = np.fft.rfftfreq(2 * len(samples), record.interval), np.geomspace(0.1, 20.0, 300)
        inside = np.interp(1.18 * centre, hertz, energy) - np.interp(centre / 1.18, hertz, energy)
        return float(inside.max() / (energy[-1] or 1.0))

    return Samples.of(record.samples).once(("narrowness", record.interval, record.baseline, record.corner_hz), compute)
