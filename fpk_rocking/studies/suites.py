"""Synthetic suites of ground motions: white noise with an envelope, through soil. No recorded data are needed."""

import math

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.physics.forcing import Record
from fpk_rocking.physics.noise.envelope import Envelope, Trapezoid
from fpk_rocking.physics.noise.filters import FILTERS

_MOST = 10_000
_RISE, _HOLD, _DECAY = 0.1, 0.3, 0.4
"""Parts of the duration of the envelope; after it the ground comes to rest."""


def synthetic_records(
    count: int,
    *,
    duration: float = 25.0,
    interval: float = 0.01,
    frequency_hz: float = 2.4,
    damping: float = 0.6,
    low_frequency_hz: float = 0.24,
    low_damping: float = 0.6,
    spread: float = 0.4,
    envelope: Envelope | None = None,
    rms: float = 1.0,
    seed: int = 1,
) -> tuple[Record, ...]:
    """Make ground motions: nonstationary Kanai-Tajimi noise without its lowest frequencies (Clough-Penzien).

    White noise is multiplied by the envelope and then passes the soil and a high-pass filter, so that the velocity of
    the ground ends at 0. The default frequencies and dampings are those of firm ground.

    Parameters
    ----------
    count : int
        Number of motions.
    duration, interval : float
        Of each, and between samples, seconds.
    frequency_hz, damping : float
        Of the soil (Kanai-Tajimi).
    low_frequency_hz, low_damping : float
        Of the filter that takes out the lowest frequencies (Clough-Penzien).
    spread : float
        Dispersion of ``frequency_hz`` from motion to motion, lognormal; 0 for the same soil under all.
    envelope : Envelope, optional
        In seconds, see `fpk_rocking.envelopes`; by default a trapezoid that rises in a tenth of the duration, holds for
        three and decays in four tenths.
    rms : float
        Root mean square of the acceleration above the soil where the envelope is 1, m/s², before the lowest frequencies
        are taken out.
    seed : int

    Returns
    -------
    tuple of Record

    Raises
    ------
    TypeError, ValueError
        A parameter is refused.
    """
    count, seed = checks.count("count", count, at_most=_MOST), checks.count("seed", seed, at_least=0)
    interval = checks.number("interval", interval, above=0.0)
    duration = checks.number("duration", duration, above=2.0 * interval)
    spread, rms = checks.number("spread", spread, at_least=0.0), checks.number("rms", rms, above=0.0)
    frequency = checks.number("frequency_hz", frequency_hz, above=0.0)
    damping, low_damping = (
        checks.number(name, value, above=0.0) for name, value in (("damping", damping), ("low_damping", low_damping))
    )
    low = 2.0 * math.pi * checks.number("low_frequency_hz", low_frequency_hz, above=0.0)
    envelope = envelope or Trapezoid(_RISE * duration, _HOLD * duration, _DECAY * duration)
    times = interval * np.arange(round(duration / interval) + 1)
    strength = checks.instance("envelope", envelope, Envelope).value(times[:-1] + 0.5 * interval)
    made = []
    for number in range(count):
        rng = np.random.default_rng([seed, number])
        own = 2.0 * math.pi * frequency * math.exp(spread * rng.standard_normal())
        soil = rms * _filtered(FILTERS["kanai-tajimi"].space(own, damping), interval, strength, rng)
        samples = _without_lowest(soil, interval, low, low_damping)
        source = f"synthetic motion {number + 1} of seed {seed}, {own / (2.0 * math.pi):.3g} Hz"
        made.append(Record(interval, tuple(samples.tolist()), "m/s2", source=source))
    return tuple(made)


def _filtered(space, interval, strength, rng):
    """Return samples (n + 1,) of the output of a filter, at rest at first, for white noise of a strength (n,)."""
    from scipy.linalg import expm

    move = expm(space.drift * interval)
    # What the noise of an interval adds to the states, where its strength is constant.
    covariance = space.correlation - move @ space.correlation @ move.T
    values, axes = np.linalg.eigh(0.5 * (covariance + covariance.T))
    kicks = (rng.standard_normal((strength.size, space.order)) * strength[:, None]) @ (
        axes * np.sqrt(np.maximum(values, 0.0))
    ).T
    states, found = np.zeros(space.order), np.zeros(strength.size + 1)
    for k, kick in enumerate(kicks):
        states = move @ states + kick
        found[k + 1] = space.output @ states
    return found


def _without_lowest(samples, interval, frequency, damping):
    """Return y'' of y'' + 2 ζ ω y' + ω² y = u for samples (n,) between which u is linear, as a record is."""
    from scipy import signal

    system = [1.0, 0.0, 0.0], [1.0, 2.0 * damping * frequency, frequency**2]
    upper, lower, _ = signal.cont2discrete(system, interval, method="foh")
    return signal.lfilter(np.ravel(upper), lower, samples)
