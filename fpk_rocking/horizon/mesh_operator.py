"""The one-cycle operator on one mesh, made of the solver's own steps, and its refinement to a tolerance.

Where the forcing is its own mirror image half a cycle later, (x, v) -> (-x, -v), and the sides of the block are equal,
the symmetry period is that half: with H the map over it and R the reflection, a cycle is R H R H = K², K = R H. Else it
is the whole cycle, K = H.
"""

import functools
import math

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.density.propagator import PeriodicPropagator
from fpk_rocking.density.refinement import SOLUTIONS, ProgressCount, refine, warn_beyond
from fpk_rocking.density.resolution import RESOLUTIONS, bins_tolerance, explore, resolutions_for
from fpk_rocking.density.space import escape_speed, exact_correction, reflected, velocity_bound
from fpk_rocking.density.tuning import TUNING
from fpk_rocking.horizon.modes import Powers, leading_modes


class MeshOperator:
    """The map K of densities over a symmetry period of a scene on one mesh, its adjoint, and its modes.

    A symmetry period is half a cycle where a reflection maps the second half to the first, else a cycle: `periods` is 2
    or 1 in a cycle. Functions are arrays of Legendre coefficients of the shape ``space.shape``, (angle cells, velocity
    cells, degree + 1, degree + 1). Every cell is active, so that nothing is truncated but beyond the velocity bound;
    coarser cells continue the mesh from `bound` to `beyond`.
    """

    def __init__(self, white, resolution, motion, bound, beyond=0.0):
        self._white, self._inputs = white, (resolution, motion, bound)
        discretization = resolution.adapted(white, bound, motion, beyond, TUNING.cell_growth)
        self.propagator = PeriodicPropagator(white, discretization, negligible=0.0)
        self.space, self.periods = self.propagator.space, self.propagator.periods_per_cycle
        self._root = np.sqrt(self.space.areas)[:, :, None, None]
        self.one = np.zeros(self.space.shape)
        self.one[:, :, 0, 0] = 1.0
        everything = np.ones(self.space.shape[:2], dtype=bool)
        for step in self.propagator.steps:
            step.activate(everything)

    def vector(self, coefficients):
        """Return the vector (unknowns,) of a function; Euclidean products of two are integrals of their product."""
        return (coefficients * self._root).ravel()

    def coefficients(self, vector):
        """Return the coefficients of the function that a real vector (unknowns,) stands for."""
        return vector.reshape(self.space.shape) / self._root

    def reflected(self, coefficients):
        """Return a function at the end of a symmetry period as the next period begins with it.

        It is (x, v) -> (-x, -v) of it where a period is half a cycle, else the same.
        """
        return reflected(coefficients) if self.periods == 2 else coefficients

    def forward(self, coefficients):
        """Return a density after a symmetry period, reflected, and its outflow (3,): left, right, truncated."""
        outflow = np.zeros(3)
        for step in self.propagator.steps:
            coefficients, masses = step.apply(coefficients)
            outflow += masses
        return self.reflected(coefficients), outflow

    def backward(self, values):
        """Return the mean of a function of the reflected state after a symmetry period, by the state before it."""
        values = self.reflected(values)
        for step in reversed(self.propagator.steps):
            values = step.apply_adjoint(values, np.zeros(3))
        return values

    def time_inside(self):
        """Return the mean time, in cycles, until overturning or the end of a symmetry period, by start.

        By the trapezoidal rule over the steps.
        """
        half_step = 0.5 / self.propagator.steps_per_cycle * self.one
        spent = np.zeros(self.space.shape)
        for step in reversed(self.propagator.steps):
            spent = half_step + step.apply_adjoint(half_step + spent, np.zeros(3))
        return spent

    def matvec(self, vector):
        """Return K times the vector of a density."""
        return self.vector(self.forward(self.coefficients(vector))[0])

    def rmatvec(self, vector):
        """Return the transpose of K times the vector of a function of the state."""
        return self.vector(self.backward(self.coefficients(vector)))

    def l1(self, vector):
        """Bound the integral of the |function| of a vector, by Schwarz in every cell."""
        squares = np.sum(vector.reshape(self.space.shape) ** 2, axis=(2, 3))
        return float(np.sqrt(squares * self.space.areas).sum())

    @functools.cached_property
    def modes(self):
        """Leading eigenvalues and real eigenvectors of the operator of a symmetry period.

        ARPACK begins two cycles after a uniform density; ValueError if next to nothing survives these.
        """
        start, unity, remaining = self.vector(self.one), self.vector(self.one), 1.0
        for _ in range(2 * self.periods):
            start = self.matvec(start)
            remaining = unity @ start / (unity @ unity)
        if not remaining > TUNING.least_eigenvalue**2:
            got = f"a probability of {remaining:.1e} to survive two cycles"
            accepted = "a scene in which not every block overturns within a cycle; solve_fpk() takes this one"
            raise ValueError(checks.refusal("scene", got, accepted))
        return leading_modes(self.matvec, start)

    @functools.cached_property
    def left_modes(self):
        """Leading modes of the adjoint, from another start; ValueError where its leading eigenvalue is not K's."""
        start = np.random.default_rng(1).random(self.space.unknowns)
        modes = leading_modes(self.rmatvec, start)
        refuse_different(self.modes, modes)
        return modes

    @functools.cached_property
    def _smoothed(self):
        """Quasi-stationary density of mass 1 after some more symmetry periods, and its outflow (3,) in one period."""
        density = self.coefficients(self.modes.basis[:, 0])
        for _ in range(TUNING.smoothing_periods):
            density = density / self.space.masses(density).sum()
            density, outflow = self.forward(density)
        return density / self.space.masses(density).sum(), outflow

    @property
    def quasi_stationary(self):
        """The density that keeps its shape, of mass 1."""
        return self._smoothed[0]

    @property
    def leaks(self):
        """Outflow (3,) of the quasi-stationary density in a cycle: left, right, truncated.

        It leaks the same in both halves of a cycle, but for the sides.
        """
        outflow = self._smoothed[1]
        return outflow if self.periods == 1 else outflow + (1.0 - outflow.sum()) * outflow[[1, 0, 2]]

    @property
    def log_eigenvalue(self):
        """Logarithm of the leading eigenvalue of K, that of a symmetry period."""
        return math.log1p(-self._smoothed[1].sum())

    @property
    def rate(self):
        """Escape rate per cycle: minus the logarithm of a cycle's leading eigenvalue."""
        return -self.periods * self.log_eigenvalue

    @property
    def settings(self):
        """Mesh, degree, quadrature and steps as a dict for JSON, with unknowns and velocity bound."""
        own = {"unknowns": self.space.unknowns, "velocity_bound": float(self.space.velocity_lines[-1])}
        return self.propagator.discretization.settings | own

    resolved = np.ones(1, dtype=bool)

    @functools.cached_property
    def quantity(self):
        """Logarithm of the escape rate, (1,): what refinement compares."""
        return np.array([math.log(self.rate) if self.rate > 0.0 else math.nan])

    @functools.cached_property
    def bins(self):
        """Probabilities (1, bins) of the quasi-stationary density in 32 x 64 equal bins."""
        lines = zip(self.space.lines, (32, 64), strict=True)
        edges = (np.linspace(x[0], x[-1], n + 1) for x, n in lines)
        return self.space.bin_integrals(self.quasi_stationary, *edges).reshape(1, -1)

    @functools.cached_property
    def negative_mass(self):
        """Negative mass of the quasi-stationary density."""
        return self.space.negative_mass(self.quasi_stationary)

    def error(self, difference, _):
        """Relative error of the rate, by the `difference` of its logarithm and what is truncated."""
        return max(math.expm1(difference), abs(self.leaks[2]) / abs(self.rate) if self.rate else math.inf)

    def at_phase(self, phase):
        """Return the operator on a mesh of the same resolution for another phase Ψ of the forcing, radians."""
        white = self._white.varied(forcing=self._white.forcing.at_phase(phase))
        return MeshOperator(white, *self._inputs, bound_for_all_starts(white, self._inputs[1]))

    def survival(self, cycles, start):
        """Return (survival, error of the modes), (n,) each, after numbers of cycles (n,) from a `Start`."""
        first = self.propagator.propagate(self._white.period * np.arange(2), start=start)
        powers, unity = self._powers(self.vector(first.coefficients[1])), self.vector(self.one)
        survival, left_out = np.empty(len(cycles)), np.zeros(len(cycles))
        for k in np.argsort(cycles, kind="stable"):
            if cycles[k] < 2:
                survival[k] = first.survival[cycles[k]]
            else:
                count = self.periods * (int(cycles[k]) - 1)
                survival[k], left_out[k] = unity @ powers.after(count), powers.left_out(count)
        return survival, left_out

    def backward_powers(self):
        """Powers of the adjoint applied to the function 1: its vectors are survival of every start."""
        return self._powers(self.vector(self.one), adjoint=True)

    def mean_time(self):
        """Mean time until overturning, in cycles, by start, as a vector: the sum over all symmetry periods to come."""
        return self._powers(self.vector(self.time_inside()), adjoint=True).total()

    def _powers(self, vector, adjoint=False):
        apply = self.rmatvec if adjoint else self.matvec
        return Powers(
            apply, lambda: self.left_modes if adjoint else self.modes, self.l1, lambda: self.log_eigenvalue, vector
        )


def refuse_different(modes, left_modes):
    """Raise ValueError where the leading eigenvalues of the operator and of its adjoint are not the same."""
    first, second = modes.values[0].real, left_modes.values[0].real
    if abs(first - second) > TUNING.mode_residual:
        accepted = "a scene for which the operator and its adjoint have the same leading eigenvalue"
        raise ValueError(checks.refusal("scene", f"eigenvalues {first:.12f} and {second:.12f}", accepted))


def refine_operator(white, tol, progress=None):
    """Refine until the estimates of the escape rate and of the quasi-stationary density are acceptable, or warn.

    The relative error of the rate is wanted to exp(1) tol: it changes survival exp(-rate k) by that times (rate k)
    exp(-rate k), at most by tol whatever k. ValueError where next to everything overturns within a cycle, or no rate
    can be told from the mesh's own errors.
    """
    meshes = ProgressCount(progress, 1)
    bound = velocity_bound(white, white.noise.diffusion)
    motion = explore(white, white.period * np.arange(TUNING.exploratory_cycles + 1))
    beyond, wanted = bound_for_all_starts(white, motion), math.e * tol

    def solve(resolution, _):
        count = meshes.start_solution()
        operator = MeshOperator(white, resolution, motion, bound, beyond)
        count()
        return operator

    def fits(coarser, resolution):
        finer = resolution.adapted(white, bound, motion, beyond, TUNING.cell_growth)
        before = coarser.propagator
        return before.memory * finer.memory / before.discretization.memory <= TUNING.finer_operator

    def is_done(refined):
        return refined.within(wanted, bins_tolerance(tol)) or is_stagnated(refined)

    refined = refine(resolutions_for(tol, before=SOLUTIONS - 1), solve, fits, is_done)
    judge(refined, tol)
    return refined


def is_stagnated(refined):
    """Whether nothing leaks, or the negative mass is far too large and finer meshes hardly lessen it."""
    coarse, fine = refined.solutions[-2:]
    still = max(abs(fine.rate), abs(coarse.rate)) < TUNING.least_rate
    most = max(2.0 * TUNING.unresolved_negative_mass, TUNING.operator_negative_ratio * coarse.negative_mass)
    return still or fine.negative_mass > most


def judge(refined, tol):
    """Raise ValueError where density or rate are not resolved; warn where their errors are larger than wanted."""
    fine, limit = refined.solutions[-1], TUNING.unresolved_negative_mass
    if fine.negative_mass > limit:
        raise ValueError(
            "scene: got a quasi-stationary density that the finest mesh does not resolve (negative mass "
            f"{fine.negative_mass:.1e}), accepted: a mass up to {limit}; the noise is too weak: use Monte Carlo"
        )
    if not refined.error < 1.0:
        raise ValueError(
            f"scene: got an escape rate of {fine.rate:.2e} a cycle, accepted: one above the error of the "
            "finest mesh; blocks overturn too rarely: use montecarlo.split(), or more noise"
        )
    what = f"the escape rate, {fine.rate:.2e} a cycle, relative"
    wanted = math.e * tol, bins_tolerance(tol)
    warn_beyond(what, refined, *wanted, "use montecarlo.split()", stacklevel=5, names=("tol", "tol"))


def bound_for_all_starts(white, motion):
    """Velocity bound for starts all over the plane: a faster block, at the scene's phase, overturns in a cycle.

    A block that starts inward far faster than one from rest ever moves may lose so much at its impact that it stands.
    How fast that can be follows in closed form for the worst phase, and for the scene's own phase from a coarse mesh up
    to that bound: the cells that are reached from a start that stands for the cycle, before they overturn.
    """
    own, wide = velocity_bound(white, white.noise.diffusion), bound_for_all_phases(white)
    coarse = MeshOperator(white, RESOLUTIONS[0], motion, wide)
    survival = [coarse.one]
    for _ in range(coarse.periods):
        survival.append(coarse.reflected(survival.pop()))
        for step in reversed(coarse.propagator.steps):
            survival.append(step.apply_adjoint(survival[-1], np.zeros(3)))
    part = TUNING.reached_part
    reached, used = np.where(_largest(survival[-1]) > part, 1.0, 0.0), np.zeros(coarse.space.shape[1], dtype=bool)
    density = coarse.one * reached[:, :, None, None]
    for _ in range(coarse.periods):
        for step in coarse.propagator.steps:
            both = _largest(density) * _largest(survival.pop())
            used |= (both > part * both.max()).any(axis=0)
            density, _ = step.apply(density)
        density = coarse.reflected(density)
    lines = coarse.space.velocity_lines
    fastest = max(-lines[:-1][used].min(initial=0.0), lines[1:][used].max(initial=0.0))
    return max(own, float(fastest))


def bound_for_all_phases(white):
    """Bound of |v| for starts at every phase: a faster block overturns.

    To stand after an impact at v, e v must be below the speed of a sure escape. What is lost on the way to the impact
    is bounded by the cut-off, the swing of the forcing and eight standard deviations of the noise.
    """
    noise = TUNING.deviations * math.sqrt(white.noise.diffusion)
    least, escape = min(white.block.restitution_by_side), escape_speed(white, white.noise.diffusion)
    return escape / least + white.overturning.angle + 2.0 * white.forcing.swing + exact_correction(white) + noise


def _largest(coefficients):
    """Return the largest absolute coefficient in each cell, (angle cells, velocity cells)."""
    return np.abs(coefficients).max(axis=(2, 3))
