"""The one-cycle operator on one mesh, and its refinement until the escape rate is known to the tolerance."""

import functools
import math

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.density.pilot import CYCLES, motion_of
from fpk_rocking.density.refinement import UNRESOLVED, bins_tolerance, candidates_for, refine
from fpk_rocking.density.refusals import warn_beyond
from fpk_rocking.density.space.mesh import velocity_bound
from fpk_rocking.density.space.tuning import TUNING
from fpk_rocking.horizon.extent import plane_bound
from fpk_rocking.horizon.leg import CycleLeg
from fpk_rocking.horizon.modes import Powers, leading_modes

OPERATOR_MEMORY = 8e9
"""Bytes that a finer mesh may be expected to need; every cell of it is active."""

LEAST_EIGENVALUE = 1e-6
"""Least probability of surviving a cycle in the long run for which there is an operator to speak of."""

LEAST_RATE = 1e-15
"""Least escape rate a cycle that is looked for on ever finer meshes."""

_BINS = 32, 64
"""Bins (angle, velocity) between the bounds, in which two densities are compared; of about 0.1 in the main scene."""

_POLISH = 10
"""Legs after the iteration, which leave the tails of the density to the map itself."""

_AGREED = 1e-8
"""Most by which the leading eigenvalues of the map and of its adjoint may differ."""

_LESSENS = 0.7
"""Negative mass over that on the mesh before, above which finer meshes do not help."""


class Level:
    """The one-cycle operator of a scene on one mesh, with its modes.

    Parameters
    ----------
    white : Scene
        With white noise.
    resolution : Resolution
    motion : Motion
        Where the mesh has to be fine.
    bound, beyond : float
        Velocity bound of the mesh, and that to which coarser cells continue it.
    """

    def __init__(self, white, resolution, motion, bound, beyond):
        self._white, self._given = white, (resolution, motion, bound)
        self.leg = CycleLeg(white, resolution.of(white, bound, motion, beyond, TUNING.growth))
        self.space = self.leg.space
        self._one = self.leg.vector(self.leg.one)

    @functools.cached_property
    def modes(self):
        """Leading modes of a leg, from what two cycles leave of a uniform density."""
        start, remaining = self._one, []
        for _ in range(2 * self.leg.count):
            start = self.leg.matvec(start)
            remaining.append(self._one @ start / (self._one @ self._one))
        if not remaining[-1] > LEAST_EIGENVALUE**2:
            got = f"a probability of {remaining[-1]:.1e} to survive two cycles"
            accepted = "a scene in which not every block overturns within a cycle; solve_fpk() takes this one"
            raise ValueError(checks.refusal("scene", got, accepted))
        return leading_modes(self.leg.matvec, start)

    @functools.cached_property
    def left_modes(self):
        """The same of the adjoint, from another start: their eigenvalues agree, or the modes are refused."""
        start = np.random.default_rng(1).random(len(self._one))
        modes = leading_modes(self.leg.rmatvec, start)
        first, second = (found.values[0].real for found in (self.modes, modes))
        if abs(first - second) > _AGREED:
            accepted = "a scene for which the operator and its adjoint have the same leading eigenvalue"
            raise ValueError(checks.refusal("scene", f"eigenvalues {first:.12f} and {second:.12f}", accepted))
        return modes

    @functools.cached_property
    def _polished(self):
        density = self.leg.coefficients(self.modes.basis[:, 0])
        for _ in range(_POLISH):
            density = density / self.space.masses(density).sum()
            density, gone = self.leg.forward(density)
        return density / self.space.masses(density).sum(), gone

    @property
    def quasi_stationary(self):
        """Coefficients of the density that keeps its shape, of mass 1."""
        return self._polished[0]

    @property
    def leaks(self):
        """What leaves it in a cycle (3,): to the left, to the right, and lost; it leaks the same in both halves."""
        gone = self._polished[1]
        return gone if self.leg.count == 1 else gone + (1.0 - gone.sum()) * gone[[1, 0, 2]]

    @property
    def log_eigenvalue(self):
        """Logarithm of the leading eigenvalue of a leg."""
        return math.log1p(-self._polished[1].sum())

    @property
    def rate(self):
        """Escape rate per cycle."""
        return -self.leg.count * self.log_eigenvalue

    @functools.cached_property
    def negative_mass(self):
        """Negative mass of the quasi-stationary density."""
        return self.space.negative_mass(self.quasi_stationary)

    @property
    def memory(self):
        """Bytes that its run holds."""
        return self.leg.run.memory

    def differences(self, coarser):
        """Differences of the logarithm of the rate, and of the binned quasi-stationary density."""
        known = min(self.rate, coarser.rate) > 0.0
        difference = abs(math.log(self.rate / coarser.rate)) if known else math.inf
        return difference, float(np.abs(self.bins - coarser.bins).sum())

    def error(self, difference, bins):  # noqa: ARG002  (as of other levels)
        """Relative error of the rate, not less than what is lost."""
        return max(math.expm1(difference), abs(self.leaks[2]) / abs(self.rate))

    def release(self):
        """Keep everything: maps of the starts compare the last two levels."""

    @property
    def settings(self):
        """Mesh, degree, quadrature and steps."""
        own = {"unknowns": self.space.unknowns, "velocity_bound": float(self.space.velocity_lines[-1])}
        return self.leg.run.grid.settings | own

    @functools.cached_property
    def bins(self):
        """Probabilities of equal bins in the quasi-stationary density."""
        edges = (np.linspace(line[0], line[-1], count + 1) for line, count in zip(self.space.lines, _BINS, strict=True))
        return self.space.bin_integrals(self.quasi_stationary, *edges)

    def at_phase(self, phase):
        """Return the same for another forcing phase."""
        white = self._white.varied(forcing=self._white.forcing.at_phase(phase))
        return Level(white, *self._given, plane_bound(white, self._given[1]))

    def survival(self, cycles, start):
        """Survival of a start after numbers of cycles, and an estimate of what the modes leave out: two arrays (n,)."""
        first = self.leg.run.evolve(self._white.period * np.arange(2), start=start)
        powers = self._powers(self.leg.matvec, lambda: self.modes, self.leg.vector(first.coefficients[1]))
        survival, left_out = np.empty(len(cycles)), np.zeros(len(cycles))
        for k in np.argsort(cycles, kind="stable"):
            if cycles[k] < 2:
                survival[k] = first.inside[cycles[k]]
            else:
                count = self.leg.count * (int(cycles[k]) - 1)
                survival[k], left_out[k] = self._one @ powers.after(count), powers.left_out(count)
        return survival, left_out

    def backward_powers(self):
        """Powers of the adjoint, of the function 1: survival of every start."""
        return self._powers(self.leg.rmatvec, lambda: self.left_modes, self._one)

    def mean_time(self):
        """Mean time until overturning, in cycles, as a vector: the sum over all legs to come."""
        spent = self.leg.vector(self.leg.time_inside())
        return self._powers(self.leg.rmatvec, lambda: self.left_modes, spent).total()

    def _powers(self, apply, modes, vector):
        return Powers(apply, modes, self.leg.l1, lambda: self.log_eigenvalue, vector)


def climb(white, tol):
    """Refine until the estimates of the escape rate and of the quasi-stationary density are acceptable.

    Parameters
    ----------
    white : Scene
        With white noise.
    tol : float
        The relative error of the rate is wanted to exp(1) tol: it changes survival exp(-rate k) by that times
        (rate k) exp(-rate k), at most by tol whatever k.

    Returns
    -------
    fine, coarse : Level
        The last two.
    error : float
        Estimated relative error of the rate.
    refinement : list of (int, float)
        Unknowns and escape rate of every mesh.

    Warns
    -----
    RuntimeWarning
        The tolerance is not met.

    Raises
    ------
    ValueError
        Next to everything overturns within a cycle, or no rate can be told from the mesh's own errors.
    """
    bound, motion, wanted = (
        velocity_bound(white, white.noise.diffusion),
        motion_of(white, white.period * np.arange(CYCLES + 1)),
        math.e * tol,
    )
    beyond = plane_bound(white, motion)
    refinement = []

    def solved(resolution, _):
        refinement.append(Level(white, resolution, motion, bound, beyond))
        return refinement[-1]

    def fits(level, resolution):
        finer = resolution.of(white, bound, motion, beyond, TUNING.growth)
        return level.memory * finer.memory / level.leg.run.grid.memory <= OPERATOR_MEMORY

    def done(found):
        return found.within(wanted, bins_tolerance(tol)) or _hopeless(found.fine, found.coarse)

    found = refine(candidates_for(tol), solved, fits, done)
    _judge(found, tol)
    return found.fine, found.coarse, found.error, [(level.space.unknowns, level.rate) for level in refinement]


def _hopeless(fine, coarse):
    """Whether nothing leaks, or the negative mass is far too large and finer meshes hardly lessen it."""
    still = max(abs(fine.rate), abs(coarse.rate)) < LEAST_RATE
    return still or fine.negative_mass > max(2.0 * UNRESOLVED, _LESSENS * coarse.negative_mass)


def _judge(found, tol):
    if found.fine.negative_mass > UNRESOLVED:
        raise ValueError(
            "scene: got a quasi-stationary density that the finest mesh does not resolve (negative mass "
            f"{found.fine.negative_mass:.1e}), accepted: up to {UNRESOLVED}; the noise is too weak: use Monte Carlo"
        )
    if not found.error < 1.0:
        raise ValueError(
            f"scene: got an escape rate of {found.fine.rate:.2e} a cycle, accepted: one above the error of the finest "
            "mesh; blocks overturn too rarely: use montecarlo.split(), or more noise"
        )
    what = f"the escape rate, {found.fine.rate:.2e} a cycle, relative"
    wanted = math.e * tol, bins_tolerance(tol)
    warn_beyond(what, found, *wanted, "use montecarlo.split()", stacklevel=5, names=("tol", "tol"))
