"""The impact law v⁺ = e v⁻ at zero angle (paper eq. 3), its derivative, and the chatter that ends in rest.

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
    """The block passes through zero angle with e times its velocity."""
    return restitution * velocity


@kernel(inline="always")
def velocity_jump(velocity, restitution):
    """Velocity after an impact less that before."""
    return (restitution - 1.0) * velocity


@kernel
def side_of_start(x, v):
    """Side of (x, v): the sign of x, or of v if x is 0; 0, at rest, if both are 0."""
    if x == 0.0:
        return 0 if v == 0.0 else (1 if v > 0.0 else -1)
    return 1 if x > 0.0 else -1


@kernel
def chatter_time(speed, side, force, block):
    """Time in which ever smaller bounces bring a block to rest under a constant force; inf where none comes.

    It is a geometric sum: a bounce that starts at speed w lasts 2 w over -u'' at zero angle, and the next one starts at
    e w on the other side. `side` is that to which the last impact leads, `speed` that just after it.
    """
    near, far = -acceleration(0.0, side, force, block), -acceleration(0.0, -side, force, block)
    leaving, returning = restitution_from(side, block), restitution_from(-side, block)
    if near <= 0.0 or far <= 0.0 or leaving * returning >= 1.0:
        return math.inf
    return 2.0 * speed * (1.0 / near + leaving / far) / (1.0 - leaving * returning)


class LinearizedImpact(NamedTuple):
    """Velocities, accelerations and their derivatives just before and just after an impact of a reference path.

    `speed`, `leaving`: velocity before and after; `pull`, `far_pull`: acceleration before and after; `stiff`,
    `far_stiff`: its derivatives by the angle; `jerk`: its rate of change by the forcing. All are of the angle x itself,
    not folded. Displacements from the path are carried through the impact by these.
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
    """`LinearizedImpact` of a path that comes from `side` with the velocity `speed`, under f and its slope."""
    return LinearizedImpact(
        speed, velocity_after_impact(speed, restitution_from(side, block)),
        side * acceleration(0.0, side, force, block), -side * acceleration(0.0, -side, force, block),
        acceleration_gradient(0.0, side, force, block), acceleration_gradient(0.0, -side, force, block),
        slope * force_factor(0.0, side, block),
    )  # fmt: skip


@kernel
def covariance_through_impact(diffusions, before, after, impact, restitution):
    """(final, early, map) of a flight with one impact under white noise, by the saltation matrix.

    `diffusions` are D before and after the impact, `before` and `after` the durations. `final` (xx, xv, vv) is the
    covariance at the end, `early` the part gathered before the impact, at it; `map` (b11, b12, b21, b22) carries a
    displacement from just before the impact to the end.
    """
    # The saltation matrix is [[e, 0], [jump, e]]: a displaced path meets x = 0 earlier or later, and has the other
    # side's acceleration meanwhile.
    jump = (impact.far_pull - restitution * impact.pull) / impact.speed
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
    """(x, v, inside): a displacement at the time of a fast impact carried through it and to the end of the step.

    The step lasts `time` before and `rest` after the undisturbed impact; `inside`: whether the impact comes within it.
    The flights before and after are Taylor polynomials about the undisturbed impact: the error is of third order in the
    displacement (derived in docs/theory, "Noise in a flight and through an impact").
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
