"""Steps of an exact block through which nothing happens, of order 4, from three values of the force in each.

Folded, u = s x and w = s v; nondimensional. The force is that at the begin, the middle and the end of a step.
"""

from fpk_rocking.base.jit import kernel
from fpk_rocking.physics.motion.equation import acceleration, force_factor


@kernel(inline="always")
def classical(u, w, side, begin, middle, end, h, block):
    """Return angle and velocity after a step of the classical Runge-Kutta method."""
    half = 0.5 * h
    first = acceleration(u, side, begin, block)
    second = acceleration(u + half * w, side, middle, block)
    third = acceleration(u + half * (w + half * first), side, middle, block)
    fourth = acceleration(u + h * (w + half * second), side, end, block)
    return u + h * (w + h * (first + second + third) / 6.0), w + h * (first + 2.0 * (second + third) + fourth) / 6.0


@kernel(inline="always")
def nystrom(u, w, side, begin, middle, end, h, block):
    """Return angle and velocity after a step of Nyström's method, for forces without velocity, and cos φ halfway."""
    first = acceleration(u, side, begin, block)
    halfway = u + 0.5 * h * (w + 0.25 * h * first)
    second = acceleration(halfway, side, middle, block)
    third = acceleration(u + h * (w + 0.5 * h * second), side, end, block)
    u, w = u + h * (w + h * (first + 2.0 * second) / 6.0), w + h * (first + 4.0 * second + third) / 6.0
    return u, w, force_factor(halfway, block)
