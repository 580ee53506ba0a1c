"""Blocks whose values are uncertain: scenes with values drawn from distributions, and what each of them scatters."""

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.base.types import Array, ArrayLike
from fpk_rocking.scene.scene import Scene
from fpk_rocking.studies.lognormal import maximize
from fpk_rocking.studies.scenes import varied

_FACTOR = "_factor"
_MOST = 100_000
_KINDS = {"uniform": "LOW:HIGH", "normal": "MEAN:DEVIATION", "lognormal": "MEDIAN:DISPERSION"}
_STEEPEST = 1e3

_FAR, _ENDS = 4.0, 1e-4
"""Normal deviations from the middle of a distribution at which a scene's own value may lie, and the part of the span
between these that is added at the ends."""


class Draws(NamedTuple):
    """Scenes with values that were drawn; made by `drawn`.

    Parameters
    ----------
    scenes : tuple of Scene, (n,)
        Those of the first given scene first.
    values : dict of str to tuple of float, (n,)
        What was drawn, by the names of the parameters.
    origin : tuple of int, (n,)
        Number of the given scene that each was made of.

    Examples
    --------
    >>> from fpk_rocking import Scene
    >>> from fpk_rocking.studies import drawn
    >>> rack = Scene.from_block(0.5, 1.8, "0.3 g", "1.5 Hz")
    >>> blocks = drawn(rack, {"size_factor": "lognormal:1:0.05"}, count=3)
    >>> print([f"{scene.block.dimensions.height:.2f} m" for scene in blocks.scenes])
    ['1.79 m', '1.95 m', '1.70 m']
    """

    scenes: tuple[Scene, ...]
    values: dict[str, tuple[float, ...]]
    origin: tuple[int, ...]


def drawn(scene: Scene | Sequence[Scene], uncertain: Mapping[str, Any], count: int = 20, seed: int = 1) -> Draws:
    """Draw blocks, or anything else of a scene, from distributions.

    Latin hypercube sampling: each parameter has one value in each of n equally probable ranges. Sweeps and fragility
    take the scenes.

    Parameters
    ----------
    scene : Scene, or sequence of Scene
        Of each as many scenes are made.
    uncertain : dict of str
        Distributions by the names of `fpk_rocking.studies.scenes.varied`, or such a name with "_factor" for a factor of
        the scene's own value: ``{"size_factor": "lognormal:1:0.05", "block.restitution_factor": "uniform:0.93:1"}``.
        They are set in this order. A distribution is a text, "uniform:LOW:HIGH", "normal:MEAN:DEVIATION" or
        "lognormal:MEDIAN:DISPERSION", or an object with a method ``ppf``, as those of `scipy.stats`. Without "_factor"
        the scene's own value has to be within 4 normal deviations of its middle.
    count : int
        Scenes of each.
    seed : int
        Seed of the random numbers.

    Returns
    -------
    Draws

    Raises
    ------
    TypeError, ValueError
        A parameter is refused, or a value that was drawn.

    Examples
    --------
    >>> from fpk_rocking import Scene
    >>> from fpk_rocking.studies import drawn
    >>> rack = Scene.from_block(0.5, 1.8, "0.3 g", "1.5 Hz")
    >>> blocks = drawn(rack, {"block.restitution_factor": "uniform:0.93:1"}, count=3)
    >>> print([round(value, 3) for value in blocks.values["block.restitution_factor"]])
    [0.96, 0.996, 0.938]
    """
    from scipy.stats import qmc

    scenes = (scene,) if isinstance(scene, Scene) else checks.sequence("scene", scene, "a scene or several")
    if not isinstance(uncertain, Mapping) or not uncertain:
        raise TypeError(checks.refusal("uncertain", uncertain, 'a dict such as {"size_factor": "lognormal:1:0.05"}'))
    count, seed = checks.count("count", count, at_most=_MOST), checks.count("seed", seed, at_least=0)
    points = qmc.LatinHypercube(len(uncertain), seed=np.random.default_rng(seed)).random(count * len(scenes))
    values = {
        name: tuple(np.asarray(_distribution(name, given).ppf(column), float).tolist())
        for (name, given), column in zip(uncertain.items(), points.T, strict=True)
    }
    origin = tuple(int(place) for place in np.repeat(np.arange(len(scenes)), count))
    for name, given in uncertain.items():
        _check_own(scenes, name, given)
    made = []
    for number, place in enumerate(origin):
        one = scenes[place]
        for name, column in values.items():
            one = _set(one, name, column[number])
        made.append(one)
    return Draws(tuple(made), values, origin)


def _set(scene, name, value):
    """Return a scene with one parameter at a value, or multiplied by a factor."""
    if not name.endswith(_FACTOR):
        return varied(scene, name, value)
    parameter = name.removesuffix(_FACTOR)
    return varied(scene, parameter, value * checks.number(f"uncertain[{name!r}] of", _value(scene, parameter)))


def _check_own(scenes, name, given):
    """Refuse a distribution of a value far from that of a scene, such as one of factors."""
    from scipy import special

    if name.endswith(_FACTOR) or name == "scale":
        return
    low, high = np.asarray(_distribution(name, given).ppf(special.ndtr([-_FAR, _FAR])), float)
    # A uniform distribution ends a little beyond.
    room = _ENDS * (high - low)
    for own in (_value(scene, name) for scene in scenes):
        if isinstance(own, int | float) and own != 0.0 and not low - room <= own <= high + room:
            accepted = (
                f"a distribution around the scene's own value, {own:.4g}, or {name + _FACTOR!r} for multiples of it"
            )
            raise ValueError(checks.refusal(f"uncertain[{name!r}]", given, accepted))


def _value(scene, name):
    """Return the value of a parameter of a scene; None of what it does not have."""
    size, (part, _, field) = scene.block.dimensions, name.partition(".")
    if name == "scale":
        return 1.0
    if size is not None and name in {"width", "height"}:
        return getattr(size, name)
    if size is not None and name in {"size", "slenderness"}:
        return size.half_diagonal if name == "size" else size.height / size.width
    return getattr(getattr(scene, part, None), field, None) if field else None


def _distribution(name, given):
    """Return a distribution, or refuse what is none."""
    from scipy import stats

    if hasattr(given, "ppf"):
        return given
    accepted = ", ".join(f"'{kind}:{form}'" for kind, form in _KINDS.items())
    refusal = checks.refusal(
        f"uncertain[{name!r}]", given, f"{accepted} with numbers, or a distribution of scipy.stats"
    )
    if not isinstance(given, str):
        raise TypeError(refusal)
    kind, *numbers = given.split(":")
    try:
        first, second = map(float, numbers)
    except ValueError:
        raise ValueError(refusal) from None
    fits = {"uniform": second > first, "normal": second > 0.0, "lognormal": first > 0.0 and second > 0.0}
    if not (math.isfinite(first) and math.isfinite(second) and fits.get(kind, False)):
        raise ValueError(refusal)
    if kind == "uniform":
        return stats.uniform(first, second - first)
    return stats.norm(first, second) if kind == "normal" else stats.lognorm(second, scale=first)


def dispersions(scale: ArrayLike, shares: Array, values: Mapping[str, ArrayLike]) -> dict[str, float]:
    """Return the dispersion of the capacity, the scale that a block withstands, that each drawn parameter causes.

    Probit regression over all scenes: P = N(b₀ + b₁ ln s + Σ c_j x_j) with the normal scores x_j of the drawn values.
    A change of x_j by 1, a standard deviation, moves the capacity by c_j/b₁ in the logarithm, which is the dispersion.
    What else differs between the scenes flattens the curve, b₁ and c_j by the same factor.

    Parameters
    ----------
    scale : array_like, shape (n,)
        Scales or intensities, above 0.
    shares : ndarray, shape (m, n)
        Probabilities of each scene.
    values : dict of str to array_like, (m,)
        What was drawn for it.

    Returns
    -------
    dict of str to float
        |c_j/b₁| by name; nan where the probabilities do not determine it.

    Examples
    --------
    >>> import numpy as np
    >>> from scipy.stats import norm
    >>> from fpk_rocking.studies import dispersions
    >>> scale, values = np.geomspace(0.5, 2.0, 5), np.array([0.9, 1.0, 1.1, 1.2])
    >>> shares = norm.cdf(np.log(scale / values[:, None]) / 0.3)
    >>> print({name: round(beta, 2) for name, beta in dispersions(scale, shares, {"size": values}).items()})
    {'size': 0.13}
    """
    from scipy import special, stats

    logs, (scenes, points) = np.log(np.asarray(scale, float)), np.shape(shares)
    scores = [special.ndtri((stats.rankdata(column) - 0.5) / scenes) for column in values.values()]
    design = np.stack([np.ones(scenes * points), np.tile(logs, scenes), *(np.repeat(one, points) for one in scores)])
    share = np.clip(np.ravel(shares), 0.0, 1.0)
    if not 0.0 < share.mean() < 1.0:
        return dict.fromkeys(values, math.nan)
    curve = maximize(design, share[None], np.ones(share.size))[0][0]
    known = 0.0 < curve[1] < _STEEPEST
    return {
        name: abs(float(term / curve[1])) if known else math.nan for name, term in zip(values, curve[2:], strict=True)
    }
