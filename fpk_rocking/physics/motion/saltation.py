"""A displacement from a path, or its covariance, carried through an impact (derived in docs/theory).

In flight a displacement grows as that of a slender block, which for an exact one is right to second order in the time.
"""

import math

from fpk_rocking.base.jit import kernel
from fpk_rocking.physics.motion.equation import cosine, lift, steepness
from fpk_rocking.physics.motion.gaussian import flight_covariance
from fpk_rocking.physics.motion.slender import hyperbolic_turn


@kernel
def through_impact(diffusions, before, after, v, force, side, block):
    """Carry the covariance through an impact by the saltation matrix (derived in docs/theory).

    Parameters
    ----------
    diffusions : tuple (float, float)
        D, as it moves the block before the impact and after it.
    before, after : float
        The times before and after the impact.
    v, force, side : float, float, int
        Velocity and forcing just before the impact, and the side before it.
    block : Body

    Returns
    -------
    final, early : tuple (xx, xv, vv)
        Covariance at the end, and the part gathered before the impact, taken at it.
    map : tuple (b11, b12, b21, b22)
        Carries a displacement from the impact time to the end.
    """
    restitution = block.restitution
    arriving, leaving = side * lift(0.0, side, force, block), -side * lift(0.0, -side, force, block)
    jump = (leaving - restitution * arriving) / v
    c, s = math.cosh(after), math.sinh(after)
    b11, b12, b21, b22 = c * restitution + s * jump, s * restitution, s * restitution + c * jump, c * restitution
    xx, xv, vv = flight_covariance(diffusions[0], before)
    final_xx, final_xv, final_vv = flight_covariance(diffusions[1], after)
    final_xx += b11 * b11 * xx + 2.0 * b11 * b12 * xv + b12 * b12 * vv
    final_xv += b11 * b21 * xx + (b11 * b22 + b12 * b21) * xv + b12 * b22 * vv
    final_vv += b21 * b21 * xx + 2.0 * b21 * b22 * xv + b22 * b22 * vv
    return (final_xx, final_xv, final_vv), (xx, xv, vv), (b11, b12, b21, b22)


@kernel(borrows=True)
def through_impact_expanded(x, v, time, rest, speed, side, force, slope, block):
    """Carry a displacement at the time of a fast impact through it and on to the step's end, without further noise.

    The flight before the impact, and that after it, are Taylor polynomials about the undisturbed impact: the error is
    of third order in the displacement (derived in docs/theory, "Noise in a flight and through an impact").

    Parameters
    ----------
    x, v : float
        Displacement from the path without noise, at the time of its impact.
    time, rest : float
        The step's time before and after that impact.
    speed : float
        Velocity of the undisturbed impact just before it.
    side : int
        The side before it.
    force, slope : float
        Forcing at that impact, and its derivative.
    block : Body

    Returns
    -------
    x, v, inside : float, float, bool
        Displacement at the end of the step, and whether the impact came within the step.
    """
    restitution, growth = block.restitution, slope * cosine(0.0, block)
    onset, pull = speed + v, side * lift(side * x, side, force, block)
    jerk = steepness(0.0, side, force, block) * onset + growth
    late = -x / onset
    for _ in range(2):
        height = x + late * (onset + late * (0.5 * pull + late * jerk / 6.0))
        late -= height / (onset + late * (pull + 0.5 * late * jerk))
    arrival = onset + late * (pull + 0.5 * late * jerk)
    leaving = restitution * speed
    pull, jerk = -side * lift(0.0, -side, force, block), steepness(0.0, -side, force, block) * leaving + growth
    x = -late * (leaving + late * (0.5 * pull + late * jerk / 6.0))
    v = restitution * arrival - leaving - late * (pull + 0.5 * late * jerk)
    x, v = hyperbolic_turn(x, v, math.cosh(rest - late), math.sinh(rest - late))
    return x, v, -time < late < rest
