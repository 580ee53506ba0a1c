"""Sizes and accelerations that are possible but hardly meant: metres for millimetres, m/s² for g."""

import math

from fpk_rocking.scene.scene import Scene
from fpk_rocking.scene.units import STANDARD_GRAVITY

_SHORTEST, _LONGEST = 0.005, 100.0
"""Sides of a block, m, beyond which it is doubted."""

_STRONGEST = 5.0 * STANDARD_GRAVITY
"""Acceleration of the base, m/s², above which it is doubted; the strongest recorded ones are below 4.5 g."""

_WEAKEST = 0.1 * STANDARD_GRAVITY
"""Acceleration, m/s², below which one that moves nothing may have been meant in g."""

_DEVIATIONS = 3.0


def implausible(scene: Scene, least: float = 1.0, most: float = 1.0) -> list[str]:
    """Name the sizes and accelerations of a scene that were hardly meant.

    Parameters
    ----------
    scene : Scene
        Nothing is said of a block without dimensions.
    least, most : float
        Smallest and largest factor by which its shaking is multiplied.

    Returns
    -------
    list of str
        Sentences.
    """
    size = scene.block.dimensions
    if size is None:
        return []
    told = []
    for name in ("width", "height"):
        value = getattr(size, name)
        if not _SHORTEST <= value <= _LONGEST:
            other = f"{1e3 * value:g} m" if value < _SHORTEST else f"{1e-3 * value:g} m"
            told.append(f"block.dimensions.{name} is {value:g} m; was {other} meant?")
    unit = size.gravity * size.critical_angle
    noise = _rms(scene.noise) * unit
    for name, value in (
        ("peak acceleration of the forcing", scene.forcing.largest * unit),
        ("rms of the noise", noise),
    ):
        if _STRONGEST < least * value < math.inf:
            told.append(f"The {name} is {_both(least * value)}; was {1e-2 * least * value:.4g} m/s² meant (cm/s²)?")
    peak, needed = most * scene.forcing.largest * unit, scene.block.lift_off * unit
    still = scene.start.angle == scene.start.velocity == 0.0 and scene.start.covariance is None
    if still and 0.0 < peak < _WEAKEST and peak + _DEVIATIONS * most * noise < needed:
        told.append(
            f"The peak acceleration of the forcing is {_both(peak)}, and this block lifts off above {_both(needed)}: "
            f"it does not move. Was {peak:.4g} g meant?"
        )
    return told


def _rms(noise):
    """Root mean square of a noise, nondimensional; inf for white noise."""
    if noise.kind == "white":
        return math.inf if noise.diffusion > 0.0 else 0.0
    return math.sqrt(noise.variance)


def _both(acceleration):
    return f"{acceleration:.4g} m/s² ({acceleration / STANDARD_GRAVITY:.2g} g)"
