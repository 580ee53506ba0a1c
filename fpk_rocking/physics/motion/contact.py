"""The rules of contact: impact at zero angle, rest, and the side on which a block moves (paper 3).

The side is +1 where the angle is positive, -1 where it is negative and 0 for a block at rest. On the side s the
acceleration at x = 0 pulls back while |f| is below `stays_below`; all quantities are nondimensional.
"""

import math

from fpk_rocking.base.jit import kernel
from fpk_rocking.physics.motion.equation import lift

CRITICAL_RESTITUTION = math.exp(-math.pi / math.sqrt(3.0))
"""Below it white noise gives infinitely many impacts in finite time (Cornell, Swift, Bray 1998, cond-mat/9804229)."""


@kernel(inline="always")
def impact(velocity, restitution):
    """Velocity just after an impact: the block passes through zero angle with the fraction e of its velocity."""
    return restitution * velocity


@kernel
def side_of(x, v):
    """Side at a start: that of the angle, else of the velocity, else 0 for rest, which may end at once."""
    if x == 0.0:
        return 0 if v == 0.0 else (1 if v > 0.0 else -1)
    return 1 if x > 0.0 else -1


@kernel
def chatter_time(speed, force, block):
    """Time in which ever smaller bounces bring a block to rest, under a force held constant (a geometric sum).

    A bounce that starts at speed w lasts 2 w over the folded acceleration -u'' at zero angle, which is 1 - s f
    for a slender block; the next one starts at e w on the other side.

    Parameters
    ----------
    speed : float
        Speed just after an impact, nondimensional.
    force : float
        s f: the forcing seen from the side that the impact leads to.
    block : Body

    Returns
    -------
    float
        The time to rest; inf where the force or e = 1 allows no rest.
    """
    near, far, restitution = -lift(0.0, 1, force, block), -lift(0.0, 1, -force, block), block.restitution
    if near <= 0.0 or far <= 0.0 or restitution >= 1.0:
        return float("inf")
    return 2.0 * speed * (1.0 / near + restitution / far) / (1.0 - restitution * restitution)
