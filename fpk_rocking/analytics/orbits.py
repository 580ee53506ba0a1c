"""Symmetric periodic orbits of the forced slender block without noise, in closed form (derived in docs/theory).

A symmetric orbit has the forcing's period 2h = 2π/Ω and one impact in each half of it; the second half is the first one
seen from the other side. A flight that joins two such impacts obeys four linear equations; that the forcing has a
given amplitude leaves a quadratic for the speed of the impact (cf. S. J. Hogan, Proc. R. Soc. Lond. A 425, 441-476,
1989). A root is an orbit only if its flight meets neither x = 0 nor the cut-off in between.
"""

import dataclasses
import math

import numpy as np

from fpk_rocking.analytics.process import refuse_exact
from fpk_rocking.base import checks
from fpk_rocking.base.checks import Array, ArrayLike, Number

__all__ = ["SymmetricOrbit", "symmetric_orbits"]


@dataclasses.dataclass(frozen=True, slots=True)
class SymmetricOrbit:
    """A symmetric orbit with one impact in each half cycle, nondimensional; made by `symmetric_orbits`.

    Parameters
    ----------
    amplitude, frequency : float
        A and Ω of the forcing -A cos(Ωτ + Ψ).
    restitution : float
        Restitution e.
    impact_speed : float
        Speed W just before an impact, above 0; after it the speed is eW.
    impact_phase : float
        Phase Ωτ + Ψ of the forcing, in [0, 2π), at the impacts after which x > 0. At the others it is larger by π.
    """

    amplitude: float
    frequency: float
    restitution: float
    impact_speed: float
    impact_phase: float

    def state(self, phase: ArrayLike) -> tuple[Number, Number]:
        """State at a phase of the forcing; at an impact, the state just after it.

        Parameters
        ----------
        phase : array_like
            Phase Ωτ + Ψ, radians. At ``scene.forcing.phase`` it is the orbit's point of the Poincaré section τ = kT.

        Returns
        -------
        angle, velocity : ndarray or float
        """
        turned = np.mod(np.asarray(phase, float) - self.impact_phase, 2.0 * math.pi)
        # The remainder of a small negative number is rounded up to the modulus.
        turned = np.where(turned < 2.0 * math.pi, turned, 0.0)
        side = np.where(turned < math.pi, 1.0, -1.0)
        u, w = _flight(self, np.mod(turned, math.pi) / self.frequency)
        return (side * u)[()], (side * w)[()]

    @property
    def multipliers(self) -> Array:
        """Floquet multipliers of half a cycle, shape (2,), ascending in modulus; their product is e².

        The map takes (angle, velocity) just after an impact of the orbit to the state half a cycle later, mirrored, so
        that the orbit is its fixed point. These are the eigenvalues of its derivative.
        """
        # From trace and determinant, which cancel less than the entries of the derivative do.
        e, half, omega = self.restitution, math.pi / self.frequency, self.frequency
        cosh, sinh = math.cosh(half), math.sinh(half)
        growth = 2.0 * e * cosh + 0.5 * (cosh - 1.0) * (1.0 - e) ** 2 * (1.0 + omega * omega)
        trace = sinh * (1.0 + e) / self.impact_speed - growth
        root = np.sqrt(complex(0.25 * trace * trace - e * e))
        large = 0.5 * trace + (root if trace >= 0.0 else -root)
        return np.array([e * e / large if large else 0.0, large])

    @property
    def stable(self) -> bool:
        """Whether the orbit is asymptotically stable: both multipliers have a modulus below 1. At e = 1 none is."""
        return self.restitution < 1.0 and bool(np.abs(self.multipliers).max() < 1.0)


def symmetric_orbits(
    amplitude: float,
    frequency: float,
    restitution: float,
    cutoff: float = math.pi / 2,
    *,
    critical_angle: float = 0.0,
) -> tuple[SymmetricOrbit, ...]:
    """Find all symmetric orbits of a slender block with one impact in each half cycle, without noise.

    There are none, one or two. Of two, the one with the slower impact comes first and is always unstable. Derived in
    docs/theory, "Symmetric orbits".

    Parameters
    ----------
    amplitude : float
        A of the forcing -A cos(Ωτ + Ψ), nondimensional, above 0.
    frequency : float
        Ω, nondimensional, at least 0.01: the multipliers grow like exp(π/Ω).
    restitution : float
        Restitution e, from 0 to 1.
    cutoff : float
        Angle that counts as overturning, in units of the critical angle, above 0. Orbits that reach it are left out.
    critical_angle : float
        α of the block, 0: a block with another is refused.

    Examples
    --------
    >>> from fpk_rocking.analytics.orbits import symmetric_orbits
    >>> orbits = symmetric_orbits(amplitude=4.6, frequency=2.7, restitution=0.5)
    >>> print([f"{orbit.impact_speed:.3f}" for orbit in orbits])
    ['2.358']
    """
    refuse_exact(critical_angle, "symmetric orbits")
    a = checks.number("amplitude", amplitude, above=0.0)
    omega = checks.number("frequency", frequency, at_least=0.01)
    e = checks.number("restitution", restitution, at_least=0.0, at_most=1.0)
    limit = checks.number("cutoff", cutoff, above=0.0)
    orbits = [_orbit(a, omega, e, speed) for speed in _speeds(a, omega, e)]
    return tuple(orbit for orbit in orbits if _admissible(orbit, limit))


def _speeds(a, omega, e):
    """Positive roots W of ((1-e)² t² Ω² + (1+e)²) W² - 4 (1+e) t W + 4 (t² - B² Ω²) = 0, ascending: a list."""
    t = math.tanh(0.5 * math.pi / omega)
    push = a * omega / (1.0 + omega * omega)
    square = ((1.0 - e) * t * omega) ** 2 + (1.0 + e) ** 2
    # A quarter of the discriminant, in which t² (1+e)² has been cancelled by hand.
    quarter = 4.0 * (push * push * square - ((1.0 - e) * t * t * omega) ** 2)
    if quarter < 0.0:
        return []
    large = (2.0 * (1.0 + e) * t + math.sqrt(quarter)) / square
    small = 4.0 * (t - push) * (t + push) / (square * large)
    return sorted({speed for speed in (small, large) if speed > 0.0})


def _orbit(a, omega, e, speed):
    """Return the `SymmetricOrbit` with the impact speed `speed`, nondimensional, its phase being computed from that."""
    t = math.tanh(0.5 * math.pi / omega)
    cosine = -0.5 * (1.0 - e) * t * speed * omega
    sine = t - 0.5 * (1.0 + e) * speed
    return SymmetricOrbit(a, omega, e, speed, math.atan2(sine, cosine) % (2.0 * math.pi))


def _flight(orbit, time):
    """Return (u, w), folded angle and velocity, of a `SymmetricOrbit` at times after an impact, nondimensional."""
    half, omega = math.pi / orbit.frequency, orbit.frequency
    scale = orbit.amplitude / (1.0 + omega * omega)
    angle = omega * time + orbit.impact_phase
    p = scale * math.cos(orbit.impact_phase)
    first, last, full = np.exp(-time), np.exp(time - half), -math.expm1(-2.0 * half)
    rise, fall = -np.expm1(-2.0 * time) * last / full, -np.expm1(2.0 * (time - half)) * first / full
    u = 1.0 + scale * np.cos(angle) - (1.0 + p) * fall - (1.0 - p) * rise
    rise, fall = (1.0 + np.exp(-2.0 * time)) * last / full, -(1.0 + np.exp(2.0 * (time - half))) * first / full
    w = -scale * omega * np.sin(angle) - (1.0 + p) * fall - (1.0 - p) * rise
    return u, w


def _admissible(orbit, cutoff):
    """Whether |x| stays between 0 and `cutoff`, nondimensional, within the flight of a `SymmetricOrbit`: a bool."""
    half, omega = math.pi / orbit.frequency, orbit.frequency
    scale = orbit.amplitude / (1.0 + omega * omega)
    p = scale * math.cos(orbit.impact_phase)
    # |y| is largest at an end, |y'| at most coth(h/2) times that.
    ends = 1.0 + abs(p)
    bend = ends + scale * omega**2
    jerk = ends / math.tanh(0.5 * half) + scale * omega**3
    # u starts with eW or, at e = 0, with its acceleration; the ends are left by half of what Taylor's bounds allow.
    pull = -(1.0 + omega * omega) * p - 1.0
    start = max(orbit.restitution * orbit.impact_speed / bend, 1.5 * pull / jerk)
    if start <= 0.0:
        return False
    lows, highs = np.array([start]), np.array([half - orbit.impact_speed / bend])
    while lows.size:
        reach, middle = 0.5 * (highs - lows), 0.5 * (highs + lows)
        u, w = _flight(orbit, middle)
        room = np.minimum(u, cutoff - u)
        undecided = room - np.abs(w) * reach - 0.5 * bend * reach**2 <= 1e-14 * (1.0 + scale)
        if room.min() <= 0.0 or (undecided & (reach < 1e-9)).any():
            return False
        lows, middle, highs = lows[undecided], middle[undecided], highs[undecided]
        lows, highs = np.concatenate([lows, middle]), np.concatenate([middle, highs])
    return True
