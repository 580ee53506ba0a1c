"""The impact law v⁺ = e v⁻ at zero angle (paper 3), its derivative, and the chatter that ends in rest.

The side is a number s, by which angles and forces are multiplied: +1 where the angle is positive, -1 where it is
negative and 0 for a block at rest. The law itself stands in `velocity_after_impact`; `velocity_jump`, the saltation
matrix and `chatter_time` restate its e, so a law of another form changes them too. The law's derivative carries a
displacement from a path, or its covariance, through an impact; in flight a displacement grows as that of a slender
block, which for an exact one is right to second order in the time (derived in docs/theory). All quantities are
nondimensional.
"""

import math
from typing import NamedTuple

from fpk_rocking.base.jit import kernel
from fpk_rocking.physics.motion.equation import acceleration, acceleration_gradient, force_factor, restitution_from
from fpk_rocking.physics.motion.flight import flight_covariance, homogeneous_flight


@kernel(inline="always")
def velocity_after_impact(velocity, restitution):
    """Return the velocity just after an impact, e times that before it, a float: the block passes through zero angle.

    `velocity` is that just before it, with its sign, nondimensional, and `restitution` is e, 0 to 1.
    """
    return restitution * velocity


@kernel(inline="always")
def velocity_jump(velocity, restitution):
    """Return the change of the velocity at an impact, after less before, a float: (e - 1) `velocity`.

    `velocity` is that before it, with its sign, nondimensional, and `restitution` is e.
    """
    return (restitution - 1.0) * velocity


@kernel(inline="always")
def impact_jump(pull, far_pull, speed, restitution):
    """Return the entry of the saltation matrix [[e, 0], [jump, e]] by which a displaced angle changes the velocity.

    A displaced path meets x = 0 earlier or later, and has the other side's acceleration meanwhile. `pull` is the
    acceleration before and `far_pull` that after the impact, `speed` the velocity before it, all with their signs,
    nondimensional; `restitution` is e. The matrix acts on (angle, velocity).
    """
    return (far_pull - restitution * pull) / speed


@kernel
def side_of_start(x, v):
    """Return the side at a start (x, v): 1 or -1, the sign of x, or of v if x is 0; 0, at rest, if both are 0.

    Rest may end at once. `x` and `v` are angle and velocity, nondimensional.
    """
    if x == 0.0:
        return 0 if v == 0.0 else (1 if v > 0.0 else -1)
    return 1 if x > 0.0 else -1


@kernel
def chatter_time(speed, side, force, block):
    """Time in which ever smaller bounces bring a block to rest, under a force held constant (a geometric sum).

    A bounce that starts at speed w lasts 2 w over the folded acceleration -u'' (u = s x) at zero angle, which is 1 - s
    f for a slender block; the next one starts at e w on the other side.

    Parameters
    ----------
    speed : float
        Speed just after an impact, nondimensional.
    side : int
        The side s, +1 or -1, that the impact leads to.
    force : float
        The forcing f, nondimensional.
    block : KernelBlock

    Returns
    -------
    float
        The nondimensional time to rest; inf where the force or e = 1 allows no rest.
    """
    near, far = -acceleration(0.0, side, force, block), -acceleration(0.0, -side, force, block)
    leaving, returning = restitution_from(side, block), restitution_from(-side, block)
    if near <= 0.0 or far <= 0.0 or leaving * returning >= 1.0:
        return float("inf")
    return 2.0 * speed * (1.0 / near + leaving / far) / (1.0 - leaving * returning)


class LinearizedImpact(NamedTuple):
    """An impact of an undisturbed path, and its motion next to it, by which displacements are carried through.

    All are those of x = angle, with their signs, nondimensional.

    Parameters
    ----------
    speed, leaving : float
        Velocity just before and just after it.
    pull, far_pull : float
        Acceleration just before and just after it.
    stiff, far_stiff : float
        Derivative of the acceleration by the angle, before and after.
    jerk : float
        Rate at which the forcing changes the acceleration.
    """

    speed: float
    leaving: float
    pull: float
    far_pull: float
    stiff: float
    far_stiff: float
    jerk: float


@kernel
def linearize_impact(speed, side, force, slope, block):
    """Return the named tuple `LinearizedImpact`: velocities, accelerations and their gradients on either side of one.

    `speed` is the velocity before the impact, with its sign, `side` (+1 or -1) the side that it leaves, `force` and
    `slope` are f and df/dτ then, all nondimensional; `block` is a `KernelBlock`.
    """
    return LinearizedImpact(
        speed, velocity_after_impact(speed, restitution_from(side, block)),
        side * acceleration(0.0, side, force, block), -side * acceleration(0.0, -side, force, block),
        acceleration_gradient(0.0, side, force, block), acceleration_gradient(0.0, -side, force, block),
        slope * force_factor(0.0, side, block),
    )  # fmt: skip


@kernel
def covariance_through_impact(diffusions, before, after, impact, restitution):
    """Covariance of angle and velocity that white noise gathers in a flight with one impact, by the saltation matrix.

    Parameters
    ----------
    diffusions : tuple (float, float)
        D, as it moves the block before the impact and after it; nondimensional, as all here.
    before, after : float
        Duration of the flight before the impact and of that after it.
    impact : LinearizedImpact
    restitution : float
        Velocity ratio e.

    Returns
    -------
    final, early : tuple (xx, xv, vv)
        Covariance at the end, and the part gathered before the impact, taken at it.
    map : tuple (b11, b12, b21, b22)
        Rows of the matrix that carries a displacement (angle, velocity) from just before the impact to the end.
    """
    jump = impact_jump(impact.pull, impact.far_pull, impact.speed, restitution)
    c, s = math.cosh(after), math.sinh(after)
    b11, b12, b21, b22 = c * restitution + s * jump, s * restitution, s * restitution + c * jump, c * restitution
    xx, xv, vv = flight_covariance(diffusions[0], before)
    final_xx, final_xv, final_vv = flight_covariance(diffusions[1], after)
    final_xx += b11 * b11 * xx + 2.0 * b11 * b12 * xv + b12 * b12 * vv
    final_xv += b11 * b21 * xx + (b11 * b22 + b12 * b21) * xv + b12 * b22 * vv
    final_vv += b21 * b21 * xx + 2.0 * b21 * b22 * xv + b22 * b22 * vv
    return (final_xx, final_xv, final_vv), (xx, xv, vv), (b11, b12, b21, b22)


@kernel
def displacement_through_impact(x, v, time, rest, impact, restitution):
    """Carry a displacement at the time of a fast impact through it and on to the step's end, without further noise.

    The flight before the impact, and that after it, are Taylor polynomials about the undisturbed impact: the error is
    of third order in the displacement (derived in docs/theory, "Noise in a flight and through an impact").

    Parameters
    ----------
    x, v : float
        Displacement in angle and velocity from the path without noise, just before its impact; nondimensional.
    time, rest : float
        The step's duration before and after that impact.
    impact : LinearizedImpact
        The undisturbed one.
    restitution : float
        Velocity ratio e.

    Returns
    -------
    x, v, inside : float, float, bool
        Displacement at the end of the step, and whether the impact came within the step.
    """
    leaving, onset = impact.leaving, impact.speed + v
    pull, jerk = impact.pull + impact.stiff * x, impact.stiff * onset + impact.jerk
    late = -x / onset
    for _ in range(2):
        height = x + late * (onset + late * (0.5 * pull + late * jerk / 6.0))
        late -= height / (onset + late * (pull + 0.5 * late * jerk))
    arrival = onset + late * (pull + 0.5 * late * jerk)
    pull, jerk = impact.far_pull, impact.far_stiff * leaving + impact.jerk
    x = -late * (leaving + late * (0.5 * pull + late * jerk / 6.0))
    v = velocity_after_impact(arrival, restitution) - leaving - late * (pull + 0.5 * late * jerk)
    grow = math.exp(rest - late)
    decay = 1.0 / grow
    x, v = homogeneous_flight(x, v, 0.5 * (grow + decay), 0.5 * (grow - decay))
    return x, v, -time < late < rest
