"""What the exact block has beyond the slender one, x'' = x - s + f + δ, in plain numbers and tables.

With φ = α (1 - s x), gravity turns the block by -s sin φ/α in place of x - s, and the base by f cos φ in place of f; so
δ = -s [sin φ/α - (1 - s x)] - f (1 - cos φ), a function of angle and time only. White noise is sqrt(2 D) cos φ dW.
A critical angle of None or 0 is a slender block.
"""

import math

import numpy as np

from fpk_rocking.base.types import Array


def contact_pull(critical_angle: float | None) -> float:
    """Return -u'' at zero angle without a force: sin α/α, which is also the mean of cos φ from there to the saddle."""
    return math.sin(critical_angle) / critical_angle if critical_angle else 1.0


def tilt(angles: Array, critical_angle: float) -> Array:
    """Angle φ (n, ...) between the vertical and the line from the corner to the centre of mass, radians."""
    return critical_angle * (1.0 - np.abs(angles))


def cosine(angles: Array, critical_angle: float) -> Array:
    """Part of the base's acceleration that turns the block (n, ...): cos φ."""
    return np.cos(tilt(angles, critical_angle))


def gravity(angles: Array, sides: Array, critical_angle: float) -> Array:
    """Gravity's part of δ (n, ...) at angles on sides (+1, -1): x - s less than what it is, -s sin φ/α."""
    phi = tilt(angles, critical_angle)
    return -sides * (np.sin(phi) - phi) / critical_angle


def saddle_speed(force: float, critical_angle: float | None) -> float:
    """Speed at zero angle from which a block just reaches the saddle, under a constant force s f up to lift-off.

    It is 1 - s f for a slender block, and 2 sin(α/2)/α without a force (the integral of u'' over the angle).
    """
    if not critical_angle:
        return max(1.0 - force, 0.0)
    alpha = critical_angle
    square = math.hypot(1.0, alpha * force) - math.cos(alpha) - alpha * force * math.sin(alpha)
    return math.sqrt(2.0 * max(square, 0.0)) / alpha


def largest(force: float, critical_angle: float | None) -> float:
    """Bound of |δ| from zero angle to twice the critical one, under |f| up to a force."""
    if not critical_angle:
        return 0.0
    return 1.0 - contact_pull(critical_angle) + force * (1.0 - math.cos(critical_angle))
