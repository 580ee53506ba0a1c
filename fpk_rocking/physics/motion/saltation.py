"""A displacement from a path, or its covariance, carried through an impact (derived in docs/theory).

In flight a displacement grows as that of a slender block, which for an exact one is right to second order in the time.
"""

import math
from typing import NamedTuple

from fpk_rocking.base.jit import kernel
from fpk_rocking.physics.motion.body import by_body
from fpk_rocking.physics.motion.equation import cosine, lift, steepness
from fpk_rocking.physics.motion.gaussian import flight_covariance
from fpk_rocking.physics.motion.slender import hyperbolic_turn


class Encounter(NamedTuple):
    """An impact, and the motion next to it: what a displacement needs to know to be carried through.

    Parameters
    ----------
    speed, leaving : float
        Velocity just before and just after it.
    side : int
        Side before it.
    force : float
        Forcing.
    pull, far_pull : float
        Acceleration just before and just after it.
    stiff, far_stiff : float
        Derivative of the acceleration by the angle, before and after.
    jerk : float
        Rate at which the forcing changes the acceleration.
    """

    speed: float
    leaving: float
    side: int
    force: float
    pull: float
    far_pull: float
    stiff: float
    far_stiff: float
    jerk: float


@kernel
def encounter(speed, side, force, slope, block):
    """Return the `Encounter` of a velocity before an impact, the side before it, and the forcing and its slope."""
    return Encounter(
        speed, block.restitution * speed, side, force,
        side * lift(0.0, side, force, block), -side * lift(0.0, -side, force, block),
        steepness(0.0, side, force, block), steepness(0.0, -side, force, block), slope * cosine(0.0, block),
    )  # fmt: skip


@kernel
def through_impact(diffusions, before, after, impact, restitution):
    """Carry the covariance through an impact by the saltation matrix (derived in docs/theory).

    Parameters
    ----------
    diffusions : tuple (float, float)
        D, as it moves the block before the impact and after it.
    before, after : float
        The times before and after the impact.
    impact : Encounter
    restitution : float
        Velocity ratio e.

    Returns
    -------
    final, early : tuple (xx, xv, vv)
        Covariance at the end, and the part gathered before the impact, taken at it.
    map : tuple (b11, b12, b21, b22)
        Carries a displacement from the impact time to the end.
    """
    jump = (impact.far_pull - restitution * impact.pull) / impact.speed
    c, s = math.cosh(after), math.sinh(after)
    b11, b12, b21, b22 = c * restitution + s * jump, s * restitution, s * restitution + c * jump, c * restitution
    xx, xv, vv = flight_covariance(diffusions[0], before)
    final_xx, final_xv, final_vv = flight_covariance(diffusions[1], after)
    final_xx += b11 * b11 * xx + 2.0 * b11 * b12 * xv + b12 * b12 * vv
    final_xv += b11 * b21 * xx + (b11 * b22 + b12 * b21) * xv + b12 * b22 * vv
    final_vv += b21 * b21 * xx + 2.0 * b21 * b22 * xv + b22 * b22 * vv
    return (final_xx, final_xv, final_vv), (xx, xv, vv), (b11, b12, b21, b22)


@kernel(inline="always")
def _pull_slender(x, impact, block):  # noqa: ARG001
    return x - impact.side + impact.force


@kernel(inline="always")
def _pull_exact(x, impact, block):  # noqa: ARG001
    return impact.pull + impact.stiff * x


_pull = by_body(_pull_slender, _pull_exact)
"""Acceleration at a small angle, before the impact."""


@kernel(borrows=True)
def through_impact_expanded(x, v, time, rest, impact, block):
    """Carry a displacement at the time of a fast impact through it and on to the step's end, without further noise.

    The flight before the impact, and that after it, are Taylor polynomials about the undisturbed impact: the error is
    of third order in the displacement (derived in docs/theory, "Noise in a flight and through an impact").

    Parameters
    ----------
    x, v : float
        Displacement from the path without noise, at the time of its impact.
    time, rest : float
        The step's time before and after that impact.
    impact : Encounter
        The undisturbed one.
    block : Body

    Returns
    -------
    x, v, inside : float, float, bool
        Displacement at the end of the step, and whether the impact came within the step.
    """
    leaving, onset = impact.leaving, impact.speed + v
    pull, jerk = _pull(x, impact, block), impact.stiff * onset + impact.jerk
    late = -x / onset
    for _ in range(2):
        height = x + late * (onset + late * (0.5 * pull + late * jerk / 6.0))
        late -= height / (onset + late * (pull + 0.5 * late * jerk))
    arrival = onset + late * (pull + 0.5 * late * jerk)
    pull, jerk = impact.far_pull, impact.far_stiff * leaving + impact.jerk
    x = -late * (leaving + late * (0.5 * pull + late * jerk / 6.0))
    v = block.restitution * arrival - leaving - late * (pull + 0.5 * late * jerk)
    grow = math.exp(rest - late)
    decay = 1.0 / grow
    x, v = hyperbolic_turn(x, v, 0.5 * (grow + decay), 0.5 * (grow - decay))
    return x, v, -time < late < rest
