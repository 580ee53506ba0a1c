"""The long run on one mesh, and meshes of growing fineness until its escape rate is known well enough."""

import dataclasses
import functools
import math
import warnings

import numpy as np

from fpk_rocking import checks
from fpk_rocking.density.acceptance import bins_tolerance, safe_difference
from fpk_rocking.density.mesh import velocity_bound
from fpk_rocking.density.resolution import ENOUGH, LADDER
from fpk_rocking.density.solver import UNRESOLVED
from fpk_rocking.horizon.extent import plane_bound
from fpk_rocking.horizon.half import HalfCycle
from fpk_rocking.horizon.modes import Powers, leading_modes

MEMORY = 8e9
"""Bytes that a finer mesh may be expected to need; every cell of it is covered."""

LEAST_EIGENVALUE = 1e-6
"""Least probability of surviving a cycle in the long run for which there is an operator to speak of."""

LEAST_RATE = 1e-15
"""Least escape rate a cycle that is looked for on ever finer meshes."""

_POLISH = 10
"""Half cycles after the iteration, which leave the tails of the density to the map itself."""


class Level:
    """The long run of a scene on one mesh.

    Parameters
    ----------
    white : Scene
        With white noise.
    resolution : Resolution
        Adapted to the scene.
    bound, beyond : float
        Velocity bound of the mesh, and that to which coarser cells continue it.
    """

    def __init__(self, white, resolution, bound, beyond):
        self._white, self._bound = white, bound
        self.half = HalfCycle(white, resolution, bound, beyond)
        self.space = self.half.space
        self._one = self.half.vector(self.half.one)

    @functools.cached_property
    def modes(self):
        """Leading modes of half a cycle, from what two cycles leave of a uniform density."""
        start, remaining = self._one, []
        for _ in range(4):
            start = self.half.matvec(start)
            remaining.append(self._one @ start / (self._one @ self._one))
        if not remaining[-1] > LEAST_EIGENVALUE**2:
            got = f"a probability of {remaining[-1]:.1e} to survive two cycles from anywhere"
            accepted = "a scene in which not everything overturns within a cycle (see solve_fpk())"
            raise ValueError(checks.refusal("scene", got, accepted))
        return leading_modes(self.half.matvec, start)

    @functools.cached_property
    def left_modes(self):
        """The same of the adjoint, from another start: their eigenvalues agree, or the modes are refused."""
        start = np.random.default_rng(1).random(len(self._one))
        modes = leading_modes(self.half.rmatvec, start)
        first, second = (found.values[0].real for found in (self.modes, modes))
        if abs(first - second) > 1e-8:
            accepted = "one whose leading mode two iterations agree upon"
            raise ValueError(checks.refusal("scene", f"eigenvalues {first:.12f} and {second:.12f}", accepted))
        return modes

    @functools.cached_property
    def _polished(self):
        density = self.half.coefficients(self.modes.basis[:, 0])
        for _ in range(_POLISH):
            density = density / self.space.masses(density).sum()
            density, gone = self.half.forward(density)
        return density / self.space.masses(density).sum(), gone

    @property
    def quasi_stationary(self):
        """Coefficients of the density that keeps its shape, of mass 1."""
        return self._polished[0]

    @property
    def leaks(self):
        """What leaves it in a cycle (3,): to the left, to the right, and lost; it leaks the same in both halves."""
        gone = self._polished[1]
        return gone + (1.0 - gone.sum()) * gone[[1, 0, 2]]

    @property
    def log_eigenvalue(self):
        """Logarithm of the leading eigenvalue of half a cycle."""
        return math.log1p(-self._polished[1].sum())

    @property
    def rate(self):
        """Escape rate per cycle."""
        return -2.0 * self.log_eigenvalue

    @property
    def negative_mass(self):
        """Negative mass of the quasi-stationary density."""
        return self.space.negative_mass(self.quasi_stationary)

    @property
    def settings(self):
        """Mesh, degree, quadrature and steps."""
        own = {"unknowns": self.space.unknowns, "velocity_bound": float(self.space.velocity_lines[-1])}
        return dataclasses.asdict(self.half.run.resolution) | own

    @functools.cached_property
    def bins(self):
        """Probabilities of equal bins in the quasi-stationary density."""
        return self.half.run.bins(self.quasi_stationary)

    def at_phase(self, phase):
        """Return the same for another forcing phase."""
        white = self._white.varied(forcing={"phase": phase})
        return Level(white, self.half.run.resolution, self._bound, plane_bound(white))

    def survival(self, departure, cycles):
        """Survival after numbers of cycles, and an estimate of what the modes leave out of it: two arrays (n,)."""
        first = self.half.run.evolve(1, departure)
        powers = self._powers(self.half.matvec, lambda: self.modes, self.half.vector(first.coefficients[1]))
        survival, left_out = np.empty(len(cycles)), np.zeros(len(cycles))
        for k in np.argsort(cycles, kind="stable"):
            if cycles[k] < 2:
                survival[k] = first.inside[cycles[k]]
            else:
                count = 2 * (int(cycles[k]) - 1)
                survival[k], left_out[k] = self._one @ powers.after(count), powers.left_out(count)
        return survival, left_out

    def backward_powers(self):
        """Powers of the adjoint, of the function 1: survival of every start."""
        return self._powers(self.half.rmatvec, lambda: self.left_modes, self._one)

    def mean_time(self):
        """Mean time until overturning, in cycles, as a vector: the sum over all half cycles to come."""
        spent = self.half.vector(self.half.time_inside())
        return self._powers(self.half.rmatvec, lambda: self.left_modes, spent).total()

    def _powers(self, apply, modes, vector):
        return Powers(apply, modes, self.half.l1, lambda: self.log_eigenvalue, vector)


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
    bound, beyond, wanted = velocity_bound(white, white.noise.diffusion), plane_bound(white), math.e * tol
    enough = ENOUGH[max(known for known in ENOUGH if known <= tol)]
    coarse, fine, differences, refinement = None, None, [], []
    for rung in range(enough - 2, len(LADDER)):
        resolution = LADDER[rung].of(white, bound)
        if rung > enough:
            run = fine.half.run
            if run.memory * resolution.work / run.resolution.work > MEMORY:
                break
        coarse, fine = fine, Level(white, resolution, bound, beyond)
        refinement.append((fine.space.unknowns, fine.rate))
        if coarse:
            known = min(fine.rate, coarse.rate) > 0.0
            differences.append(abs(math.log(fine.rate / coarse.rate)) if known else math.inf)
        if rung >= enough:
            error = max(math.expm1(safe_difference(*differences[-2:])), abs(fine.leaks[2]) / abs(fine.rate))
            bins_error = float(np.abs(fine.bins - coarse.bins).sum())
            resolved = fine.negative_mass <= UNRESOLVED
            if error <= wanted and bins_error <= bins_tolerance(tol) and resolved:
                break
            if max(abs(fine.rate), abs(coarse.rate)) < LEAST_RATE or _hopeless(fine, coarse):
                break
    _judge(fine, error, bins_error, tol)
    return fine, coarse, error, refinement


def _hopeless(fine, coarse):
    """Whether the negative mass is far too large, and finer meshes hardly lessen it."""
    return fine.negative_mass > max(2.0 * UNRESOLVED, 0.7 * coarse.negative_mass)


def _judge(level, error, bins_error, tol):
    rate = f"an escape rate of {level.rate:.2e} a cycle"
    if level.negative_mass > UNRESOLVED:
        accepted = f"at most {UNRESOLVED}: the noise is too weak, or the block rattles at rest (use simulate())"
        raise ValueError(checks.refusal("scene", f"negative mass {level.negative_mass:.1e}", accepted))
    if not error < 1.0:
        accepted = "one that can be told from the errors of the finest mesh: nothing overturns as far as one can see"
        raise ValueError(checks.refusal("scene", rate, f"{accepted} (more noise, or montecarlo.split())"))
    if error > math.e * tol or bins_error > bins_tolerance(tol):
        warnings.warn(
            f"not within the tolerance: {rate} with an estimated relative error of {error:.1e} (wanted: "
            f"{math.e * tol:.1e}) and {bins_error:.1e} in the binned quasi-stationary density "
            f"({bins_tolerance(tol):.1e}), on the finest mesh for this scene; take a larger tol",
            RuntimeWarning,
            stacklevel=4,
        )
