"""Forces at the corner on which a rectangular block turns (derived in docs/theory, "Contact forces")."""

import numpy as np

from fpk_rocking.base.types import Array
from fpk_rocking.physics.motion import LIFT_OFF, lift_off


def contact_forces(angle: Array, velocity: Array, force: Array, critical_angle: float, slender: bool = False) -> Array:
    """Return the forces of the floor on a block, over its weight mg.

    With φ = α (1 - s x) the centre of mass has the horizontal acceleration ¾ (α x'' cos φ + s α² v² sin φ) relative to
    the base and the vertical one ¾ (s α x'' sin φ - α² v² cos φ), in units of g; the base itself has -α f. The forces
    of an impact are not among them.

    Parameters
    ----------
    angle, velocity, force : ndarray
        x, v and f at some times, nondimensional, of shapes that broadcast. A block at (0, 0) rests where f cannot lift
        it off.
    critical_angle : float
        α of the block's dimensions, above 0, radians.
    slender : bool
        Whether the motion obeys x'' = x - s + f in place of the exact equation.

    Returns
    -------
    ndarray, shape (2, ...)
        The horizontal force, positive towards x > 0, and the normal force. nan where the angle is.
    """
    x, v, f = np.broadcast_arrays(angle, velocity, force)
    alpha, level = critical_angle, LIFT_OFF if slender else lift_off(critical_angle)
    lifted = np.where(np.abs(f) > level, np.sign(f), 0.0)
    side = np.where(x != 0.0, np.sign(x), np.where(v != 0.0, np.sign(v), lifted))
    phi = alpha * (1.0 - side * x)
    sine, cosine = np.sin(phi), np.cos(phi)
    turning = alpha * (x - side + f if slender else f * cosine - side * sine / alpha)
    square = (alpha * v) ** 2
    moving = side != 0.0
    horizontal = np.where(moving, 0.75 * (turning * cosine + side * square * sine), 0.0) - alpha * f
    normal = 1.0 + np.where(moving, 0.75 * (side * turning * sine - square * cosine), 0.0)
    return np.where(np.isnan(x), np.nan, np.stack([horizontal, normal]))
