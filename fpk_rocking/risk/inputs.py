"""Random inputs of a study: scenes with values drawn from distributions, and synthetic ground motions."""

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.base.checks import Array
from fpk_rocking.physics.forcing import Record
from fpk_rocking.physics.noise.envelope import Envelope, Trapezoid
from fpk_rocking.physics.noise.filters import FILTERS
from fpk_rocking.risk.spectra import oscillator
from fpk_rocking.scene.parts import LENGTHS
from fpk_rocking.scene.scene import Scene
from fpk_rocking.studies.scenes import meant, varied


class Draws(NamedTuple):
    """Scenes with values drawn from distributions, as `drawn` returns them.

    Parameters
    ----------
    scenes : tuple of Scene, (n,)
        All copies of the first scene, then those of the next.
    values : dict of str to tuple of float, (n,)
        The drawn values, by the names of the parameters.
    origin : tuple of int, (n,)
        Number, from 0, of the scene that each is a copy of.
    """

    scenes: tuple[Scene, ...]
    values: dict[str, tuple[float, ...]]
    origin: tuple[int, ...]


def drawn(scene: Scene | Sequence[Scene], uncertain: Mapping[str, Any], count: int = 20, seed: int = 1) -> Draws:
    """Return copies of scenes with values of the block, or of anything else, drawn from distributions.

    Latin hypercube sampling: each parameter has one value in each of n equally probable ranges. Sweeps and fragility
    take the scenes.

    Parameters
    ----------
    scene : Scene, or sequence of Scene
        Each is copied `count` times.
    uncertain : dict of str
        Distributions by the names of `fpk_rocking.studies.scenes.varied`, or such a name with "_factor" for a factor of
        the scene's own value: ``{"size_factor": "lognormal:1:0.05", "block.restitution_factor": "uniform:0.93:1"}``.
        Set in this order. A distribution is "uniform:LOW:HIGH", "normal:MEAN:DEVIATION", "lognormal:MEDIAN:DISPERSION",
        "beta:A:B:LOW:HIGH", or an object with a method ``ppf`` (`scipy.stats`). Without "_factor" the scene's own value
        has to lie within 4 normal deviations of the middle of the distribution.
    count : int
        Copies of each scene.
    seed : int
        Seed of the random numbers.

    Returns
    -------
    Draws
        With `scenes` and the values that were drawn.

    Raises
    ------
    TypeError, ValueError
        A parameter or a drawn value is refused.

    Examples
    --------
    >>> from fpk_rocking import Scene
    >>> from fpk_rocking.risk import drawn
    >>> rack = Scene.from_block(0.5, 1.8, "0.3 g", "1.5 Hz")
    >>> blocks = drawn(rack, {"block.restitution_factor": "uniform:0.93:1"}, count=3)
    >>> print([round(value, 3) for value in blocks.values["block.restitution_factor"]])
    [0.96, 0.996, 0.938]
    """
    from scipy.stats import qmc

    scenes = (scene,) if isinstance(scene, Scene) else checks.sequence("scene", scene, "a scene or several")
    if not isinstance(uncertain, Mapping) or not uncertain:
        raise TypeError(checks.refusal("uncertain", uncertain, 'a dict such as {"size_factor": "lognormal:1:0.05"}'))
    count, seed = checks.count("count", count, at_most=100_000), checks.count("seed", seed, at_least=0)
    points = qmc.LatinHypercube(len(uncertain), seed=np.random.default_rng(seed)).random(count * len(scenes))
    values = {
        name: tuple(np.asarray(distribution_of(name, law).ppf(column), float).tolist())
        for (name, law), column in zip(uncertain.items(), points.T, strict=True)
    }
    origin = tuple(int(place) for place in np.repeat(np.arange(len(scenes)), count))
    for name, law in uncertain.items():
        _refuse_far(scenes, name, law)
    copies = []
    for number, place in enumerate(origin):
        copy = scenes[place]
        for name, column in values.items():
            copy = _with_value(copy, name, column[number], uncertain[name])
        copies.append(copy)
    return Draws(tuple(copies), values, origin)


def concentrated(points: Array, weights: Array, count: int, seed: int) -> tuple[Array, Array]:
    """Draw further points of the unit cube from where weighted points are; return them and new weights of all."""
    from scipy import stats

    mean = weights @ points
    covariance = 2.0 * np.atleast_2d(np.cov(points.T, aweights=weights, ddof=0)) + 0.07**2 * np.eye(mean.size)
    tried = stats.qmc.MultivariateNormalQMC(mean, covariance, rng=seed).random(2 ** math.ceil(math.log2(16 * count)))
    inside = ((tried > 0.0) & (tried < 1.0)).all(axis=1)
    new = tried[inside][:count]
    density = stats.multivariate_normal(mean, covariance).pdf(np.concatenate([points, new])) / inside.mean()
    share = len(new) / (len(points) + len(new))
    return new, 1.0 / (1.0 - share + share * density)


def _with_value(scene, name, value, law):
    """Return a copy of a scene with the parameter `name` set to a `value` drawn from `law`, or multiplied by it."""
    parameter = name.removesuffix("_factor")
    own = _value(scene, parameter)
    if own is None and parameter != name:
        accepted = "the name of a value of the scene followed by '_factor', such as 'width_factor'"
        raise ValueError(checks.refusal("uncertain", name, accepted + meant(scene, parameter, "_factor")))
    if own is None:
        return varied(scene, parameter, value)
    if parameter == "block.restitution" and isinstance(own, tuple) and parameter != name:
        changed = tuple(value * side for side in own)
    else:
        changed = value if parameter == name else value * checks.number(f"uncertain[{name!r}] of", own)
    try:
        return varied(scene, parameter, changed)
    except ValueError as error:
        accepted = "a distribution that ends within these limits, such as 'uniform:LOW:HIGH' or 'beta:A:B:LOW:HIGH'"
        accepted += f": it drew {value:.4g} ({error})"
        raise ValueError(checks.refusal(f"uncertain[{name!r}]", law, accepted)) from None


def _refuse_far(scenes, name, law):
    """Raise ValueError where the own value of one of `scenes` lies outside 4 normal deviations of a distribution."""
    from scipy import special

    if name.endswith("_factor") or name == "scale":
        return
    low, high = np.asarray(distribution_of(name, law).ppf(special.ndtr([-4.0, 4.0])), float)
    # A uniform distribution ends a little beyond.
    room = 1e-4 * (high - low)
    for own in (_value(scene, name) for scene in scenes):
        if isinstance(own, int | float) and own != 0.0 and not low - room <= own <= high + room:
            accepted = (
                f"a distribution around the scene's own value, {own:.4g}, or {name + '_factor'!r} for multiples of it"
            )
            raise ValueError(checks.refusal(f"uncertain[{name!r}]", law, accepted))


def _value(scene, name):
    """Return the value of the parameter `name`, as of `varied`, of a scene; None where the scene does not have it."""
    size, (part, _, field) = scene.block.dimensions, name.partition(".")
    if name == "scale":
        return 1.0
    if size is not None and name in {"width", "height"}:
        return getattr(size, name)
    if scene.block.body is not None and name in LENGTHS:
        return getattr(scene.block.body, name)
    if size is not None and name in {"size", "slenderness"}:
        return size.half_diagonal if name == "size" else size.height / size.width
    return getattr(getattr(scene, part, None), field, None) if field else None


def distribution_of(name: str, law: Any) -> Any:
    """Return the distribution that a text names, a frozen one of `scipy.stats` with `ppf`, `pdf` and `cdf`."""
    from scipy import stats

    if hasattr(law, "ppf"):
        return law
    laws = "uniform:LOW:HIGH", "normal:MEAN:DEVIATION", "lognormal:MEDIAN:DISPERSION", "beta:A:B:LOW:HIGH"
    accepted = f"{', '.join(map(repr, laws))}, with LOW below HIGH, and A, B, MEDIAN, DEVIATION and DISPERSION above 0"
    refusal = checks.refusal(f"uncertain[{name!r}]", law, f"{accepted}, or a distribution of scipy.stats")
    if not isinstance(law, str):
        raise TypeError(refusal)
    kind, *texts = law.split(":")
    try:
        numbers = [float(text) for text in texts]
    except ValueError:
        raise ValueError(refusal) from None
    match kind, numbers if all(map(math.isfinite, numbers)) else ():
        case "uniform", [low, high] if low < high:
            return stats.uniform(low, high - low)
        case "normal", [mean, deviation] if deviation > 0.0:
            return stats.norm(mean, deviation)
        case "lognormal", [median, dispersion] if min(median, dispersion) > 0.0:
            return stats.lognorm(dispersion, scale=median)
        case "beta", [a, b, low, high] if min(a, b) > 0.0 and low < high:
            return stats.beta(a, b, low, high - low)
    raise ValueError(refusal)


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
    """Return synthetic motions: nonstationary Kanai-Tajimi noise without its lowest frequencies (Clough-Penzien).

    White noise is multiplied by the envelope and then passes the soil and a high-pass filter, so that the velocity of
    the ground ends at 0. The default frequencies and dampings are those of firm ground.

    Parameters
    ----------
    count : int
        Number of motions.
    duration, interval : float
        Duration of each motion, and time between samples, seconds.
    frequency_hz, damping : float
        Of the soil (Kanai-Tajimi).
    low_frequency_hz, low_damping : float
        Of the filter that takes out the lowest frequencies (Clough-Penzien).
    spread : float
        Lognormal dispersion of ``frequency_hz`` from motion to motion; 0 for the same soil under all.
    envelope : Envelope, optional
        In seconds, see `fpk_rocking.envelopes`; by default a trapezoid: a tenth of the duration to rise, three tenths
        to hold, four tenths to decay.
    rms : float
        Root mean square acceleration above the soil where the envelope is 1, m/s², before the high-pass filter.
    seed : int
        Seed of the random numbers.

    Returns
    -------
    tuple of Record

    Raises
    ------
    TypeError, ValueError
        A parameter is refused.

    Examples
    --------
    >>> from fpk_rocking import Scene
    >>> from fpk_rocking.risk import intensities, synthetic_records
    >>> for motion in synthetic_records(2, duration=5.0):
    ...     print(f"PGV {intensities(Scene.from_block(0.5, 1.8, record=motion)).pgv:.2f} m/s")
    PGV 0.33 m/s
    PGV 0.23 m/s
    """
    count, seed = checks.count("count", count, at_most=10_000), checks.count("seed", seed, at_least=0)
    interval = checks.number("interval", interval, above=0.0)
    duration = checks.number("duration", duration, above=2.0 * interval)
    spread, rms = checks.number("spread", spread, at_least=0.0), checks.number("rms", rms, above=0.0)
    frequency = checks.number("frequency_hz", frequency_hz, above=0.0)
    damping, low_damping = (
        checks.number(name, value, above=0.0) for name, value in (("damping", damping), ("low_damping", low_damping))
    )
    low = 2.0 * math.pi * checks.number("low_frequency_hz", low_frequency_hz, above=0.0)
    envelope = envelope or Trapezoid(0.1 * duration, 0.3 * duration, 0.4 * duration)
    times = interval * np.arange(round(duration / interval) + 1)
    strength = checks.instance("envelope", envelope, Envelope).value(times[:-1] + 0.5 * interval)
    records = []
    for number in range(count):
        rng = np.random.default_rng([seed, number])
        own = 2.0 * math.pi * frequency * math.exp(spread * rng.standard_normal())
        soil = rms * _filtered_noise(FILTERS["kanai-tajimi"].space(own, damping), interval, strength, rng)
        # y'' of y'' + 2 ζ ω y' + ω² y = u
        samples = oscillator([1.0, 0.0, 0.0], soil, interval, low, low_damping)
        source = f"synthetic motion {number + 1} of seed {seed}, {own / (2.0 * math.pi):.3g} Hz"
        records.append(Record(interval, tuple(samples.tolist()), "m/s2", source=source))
    return tuple(records)


def _filtered_noise(space, interval, strength, rng):
    """Return samples (n + 1,) of the output of a filter that starts at rest, for white noise of a `strength` (n,)."""
    from scipy.linalg import expm

    move = expm(space.drift * interval)
    # What the noise of an interval adds to the states, where its strength is constant.
    covariance = space.correlation - move @ space.correlation @ move.T
    values, axes = np.linalg.eigh(0.5 * (covariance + covariance.T))
    kicks = (rng.standard_normal((strength.size, space.order)) * strength[:, None]) @ (
        axes * np.sqrt(np.maximum(values, 0.0))
    ).T
    states, samples = np.zeros(space.order), np.zeros(strength.size + 1)
    for k, kick in enumerate(kicks):
        states = move @ states + kick
        samples[k + 1] = space.output @ states
    return samples
