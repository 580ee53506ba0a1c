"""The rules of contact: impact at zero angle, rest, and the side on which a block moves (paper 3).

The side is +1 where the angle is positive, -1 where it is negative and 0 for a block at rest. On the side s the
acceleration is x - s + f; all quantities are nondimensional.
"""

import math

from fpk_rocking.base.jit import kernel

CRITICAL_RESTITUTION = math.exp(-math.pi / math.sqrt(3.0))
"""Below it white noise gives infinitely many impacts in finite time (Cornell, Swift, Bray 1998, cond-mat/9804229)."""


@kernel(inline="always")
def impact(velocity, restitution):
    """Velocity just after an impact: the block passes through zero angle with the fraction e of its velocity."""
    return restitution * velocity


@kernel
def side_at_zero(velocity, force):
    """Side of a block at zero angle: that of its velocity, else that of a force able to uplift it, else 0 for rest."""
    if velocity > 0.0:
        return 1
    if velocity < 0.0:
        return -1
    if force > 1.0:
        return 1
    if force < -1.0:
        return -1
    return 0


@kernel
def chatter_time(speed, force, restitution):
    """Time in which ever smaller bounces bring a block to rest, under a force held constant (a geometric sum).

    A bounce that starts at speed w on the side s lasts 2 w / (1 - s f); the next one starts at e w on the other side.

    Parameters
    ----------
    speed : float
        Speed just after an impact, nondimensional.
    force : float
        s f: the forcing seen from the side that the impact leads to.
    restitution : float
        Velocity ratio e.

    Returns
    -------
    float
        The time to rest; inf where |f| >= 1 or e = 1 allows no rest.
    """
    if abs(force) >= 1.0 or restitution >= 1.0:
        return float("inf")
    return 2.0 * speed * (1.0 / (1.0 - force) + restitution / (1.0 + force)) / (1.0 - restitution * restitution)
