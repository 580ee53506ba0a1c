"""Forces of the floor on a block, from its motion."""

import math
from typing import NamedTuple

import numpy as np

from fpk_rocking.base.checks import Array, Number
from fpk_rocking.physics.motion import LIFT_OFF


class SidesOfContact(NamedTuple):
    """What the forces of the floor need of each side, (left, right); by default those of a rectangle.

    `saddle` is m, the |x| of unstable balance, `scale` the factor κ of the acceleration, and `lever` is p² R_s/g with
    the distance R_s from the corner to the centre of mass.
    """

    saddle: tuple[float, float] = (1.0, 1.0)
    scale: tuple[float, float] = (1.0, 1.0)
    lever: tuple[float, float] = (0.75, 0.75)


RECTANGLE = SidesOfContact()


def contact_forces(
    angle: Array,
    velocity: Array,
    force: Array,
    critical_angle: float,
    slender: bool = False,
    sides: SidesOfContact = RECTANGLE,
    weight: Number = 1.0,
) -> Array:
    """Forces of the floor over the weight mg, (2, ...): horizontal, positive towards x > 0, and normal; nan where x is.

    With φ = α (m - s x) and the lever c = p² R/g the centre of mass has the horizontal acceleration
    c (α x'' cos φ + s α² v² sin φ) relative to the base and the vertical one c (s α x'' sin φ - α² v² cos φ), in units
    of g; the base itself has -α f. Of a rectangle m = 1 and c = 3/4. The forces of an impact are not among them. A
    block at (0, 0) rests where f cannot lift it off. `slender`: whether the motion obeys x'' = G (x - s) + f, with the
    `weight` G = 1 + a_v/g where the base has a vertical acceleration a_v too.
    """
    x, v, f = np.broadcast_arrays(angle, velocity, force)
    alpha = critical_angle
    left, right = (LIFT_OFF if slender else math.tan(m * alpha) / alpha for m in sides.saddle)
    lifted = np.where(f > weight * right, 1.0, np.where(-f > weight * left, -1.0, 0.0))
    side = np.where(x != 0.0, np.sign(x), np.where(v != 0.0, np.sign(v), lifted))
    saddle, scale, lever = (np.where(side > 0.0, pair[1], pair[0]) for pair in sides)
    phi = alpha * (saddle - side * x)
    sine, cosine = np.sin(phi), np.cos(phi)
    turning = alpha * (weight * (x - side) + f if slender else scale * (f * cosine - side * weight * sine / alpha))
    square = (alpha * v) ** 2
    moving = side != 0.0
    horizontal = np.where(moving, lever * (turning * cosine + side * square * sine), 0.0) - alpha * f
    normal = weight + np.where(moving, lever * (side * turning * sine - square * cosine), 0.0)
    return np.where(np.isnan(x), np.nan, np.stack([horizontal, normal]))
