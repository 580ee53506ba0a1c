"""`solve_fpk`: the Fokker-Planck equation of a scene, from its start over whole forcing cycles."""

import dataclasses
import math
import time
import warnings
from typing import NamedTuple

import numpy as np
from scipy.ndimage import binary_dilation

from fpk_rocking import checks
from fpk_rocking.density.evolution import Evolution
from fpk_rocking.density.mesh import ANGLE_GRADING, VELOCITY_GRADING, graded_lines, velocity_bound
from fpk_rocking.density.space import Space
from fpk_rocking.density.start import Launch, initial_density
from fpk_rocking.density.step import Dynamics, Quadrature, Step, Trace
from fpk_rocking.physics.contact import CRITICAL_RESTITUTION
from fpk_rocking.scene import Scene


@dataclasses.dataclass(frozen=True)
class Resolution:
    """Fineness of a solution, for the diffusion, the strip and the cycle of the main scene; `of` adapts it to others.

    Parameters
    ----------
    angle_cells, velocity_cells, degree : int
        Mesh and polynomial degree.
    quadrature : Quadrature
        Sampling of a step.
    steps : int
        Steps a cycle, even.
    """

    angle_cells: int
    velocity_cells: int
    degree: int
    quadrature: Quadrature
    steps: int

    def of(self, scene, bound):
        """Return the resolution for a scene: cells in proportion to the extents and to D^(-1/4), steps to the cycle."""
        finer = (0.00628 / scene.noise.diffusion) ** 0.25
        angle = self.angle_cells * max(finer, 0.5) * scene.overturning.angle / (math.pi / 2)
        velocity = self.velocity_cells * max(finer, 0.5) * bound / 3.24
        steps = max(self.steps * scene.period / 2.33, 0.5 * self.steps)
        even = (2 * math.ceil(0.5 * value - 1e-9) for value in (angle, velocity, steps))
        angle, velocity, steps = even
        return dataclasses.replace(self, angle_cells=angle, velocity_cells=velocity, steps=steps)

    def coarser(self):
        """Return the resolution of the solution that the error is estimated against."""
        return dataclasses.replace(
            self,
            angle_cells=2 * round(0.35 * self.angle_cells),
            velocity_cells=2 * round(0.35 * self.velocity_cells),
            steps=2 * math.ceil(0.375 * self.steps),
        )


UNRESOLVED = 0.05
"""Negative mass above which a density counts as not resolved."""

PRESETS = {
    1e-2: Resolution(32, 56, 3, Quadrature(5, 5, 5, 2), 12),
    1e-3: Resolution(44, 80, 3, Quadrature(6, 6, 5, 2), 16),
    1e-4: Resolution(60, 100, 4, Quadrature(10, 10, 7, 2), 20),
}
"""Resolution by tolerance: the loosest entry that is not looser than what was asked for is used."""


def solve_fpk(scene, *, cycles, tol=1e-3, progress=None):
    """Evolve the joint density of angle and velocity of a rocking block.

    Band noise is replaced by white noise of equal Melnikov variance, and the result's `closure` says so.

    Parameters
    ----------
    scene : Scene
        With white or band noise.
    cycles : int
        Forcing cycles to evolve.
    tol : float
        Wanted error in survival, from 1e-4 up; it chooses among three resolutions (docs/numerics.md).
    progress : callable, optional
        Called as ``progress(done, total)`` after each cycle of the solution and of its error estimate.

    Returns
    -------
    Evolution

    Warns
    -----
    RuntimeWarning
        The mesh does not resolve the density: the negative mass is above `UNRESOLVED`, or the error estimate is above
        ten times `tol`.

    Raises
    ------
    TypeError, ValueError
        A parameter is not acceptable; no noise, and a restitution below `CRITICAL_RESTITUTION`, are refused.
    """
    begin = time.perf_counter()
    checks.instance("scene", scene, Scene)
    cycles = checks.count("cycles", cycles)
    tol = checks.number("tol", tol, at_least=min(PRESETS))
    white = scene.white_equivalent()
    _refuse_unsolvable(white)
    bound = velocity_bound(white, white.noise.diffusion)
    resolution = PRESETS[max(preset for preset in PRESETS if preset <= tol)].of(white, bound)
    total = 2 * cycles
    run, coarser = _Run(white, resolution, bound), resolution.coarser()
    launch = run.launch()
    shared = _common_step(launch.step, run.steps, coarser.steps)
    fine = run.evolve(cycles, launch, shared, progress and (lambda done: progress(done, total)))
    coarse = _Run(white, coarser, bound)
    start = coarse.launch() if fine.shared is None else coarse.taken_over(fine.shared, run, shared)
    second = coarse.evolve(cycles, start, None, progress and (lambda done: progress(cycles + done, total)))
    space, overturned = run.space, fine.gone[:, :2]
    lost = fine.gone[:, 2]
    result = Evolution(
        scene=scene,
        diffusion=white.noise.diffusion,
        closure=_closure(scene, white),
        tol=tol,
        survival=fine.inside,
        overturned=overturned,
        lost=lost,
        error_estimate=float(np.abs(fine.inside - second.inside).max()),
        mass_defect=float(np.abs(fine.inside + fine.gone.sum(axis=1) - 1.0).max()),
        negative_mass=max(space.negative_mass(density) for density in fine.coefficients[1:]),
        wall_s=time.perf_counter() - begin,
        settings=dataclasses.asdict(resolution) | {"unknowns": space.unknowns, "velocity_bound": bound},
        coefficients=fine.coefficients,
        space=space,
    )
    _warn_unresolved(result)
    return result


def _warn_unresolved(result):
    if result.negative_mass > UNRESOLVED or result.error_estimate > 10.0 * result.tol:
        warnings.warn(
            f"the mesh does not resolve this density (negative mass {result.negative_mass:.1e}, error estimate "
            f"{result.error_estimate:.1e} for tol {result.tol:g}): the noise is weak, or it rattles at rest; try a "
            "smaller tol, or simulate()",
            RuntimeWarning,
            stacklevel=3,
        )


def _refuse_unsolvable(white):
    if white.noise.diffusion == 0.0:
        accepted = "noise: without it there is no density to evolve (simulate() follows single trajectories)"
        raise ValueError(checks.refusal("noise", "none, or of size 0", accepted))
    if white.block.restitution <= CRITICAL_RESTITUTION:
        accepted = (
            f"above {CRITICAL_RESTITUTION:.5f} with white noise: below it there are infinitely many impacts in finite "
            "time, and what follows is not defined (band noise can be sampled with simulate())"
        )
        raise ValueError(checks.refusal("block.restitution", white.block.restitution, accepted))


def _closure(scene, white):
    if scene.noise.kind == "white":
        return ""
    low, high = scene.noise.band
    return (
        f"Band noise (variance {scene.noise.variance:g} on [{low:g}, {high:g}]) is solved as white noise of equal "
        f"Melnikov variance, D = {white.noise.diffusion:.6g}: a closure, to be judged by Monte Carlo."
    )


class _Start(NamedTuple):
    """A density to go on from: coefficients at a step, and the masses (3,) that had left by then."""

    coefficients: np.ndarray
    step: int
    sinks: np.ndarray


class _Solution(NamedTuple):
    """Survival (cycles + 1,), masses gone (cycles + 1, 3), coefficients after each cycle, and the shared `_Start`."""

    inside: np.ndarray
    gone: np.ndarray
    coefficients: np.ndarray
    shared: _Start | None


class _Run:
    """One resolution: its space, and the steps of half a cycle."""

    def __init__(self, white, resolution, bound):
        self.scene, self.dynamics, self.steps = white, Dynamics.of(white), resolution.steps
        self.space = Space(
            graded_lines(white.overturning.angle, resolution.angle_cells, ANGLE_GRADING),
            graded_lines(bound, resolution.velocity_cells, VELOCITY_GRADING),
            resolution.degree,
        )
        self.duration = white.period / self.steps
        nothing = np.zeros(self.space.shape[:2], dtype=bool)
        self.half = [
            Step(
                Trace(self.space, k * self.duration, self.duration, self.dynamics, resolution.quadrature, nothing),
                self.space,
            )
            for k in range(self.steps // 2)
        ]
        self.negligible = 1e-11

    def launch(self):
        """Carry the start to the first step at which the mesh resolves it."""
        launch = Launch(self.dynamics, self.scene.start, self.space, self.duration, self.steps)
        return _Start(launch.coefficients, launch.step, launch.sinks)

    def taken_over(self, start, other, step):
        """Project what another run has reached at one of its steps."""
        coefficients = self.space.transfer(start.coefficients, other.space)
        return _Start(coefficients, step * self.steps // other.steps, start.sinks)

    def evolve(self, cycles, start, watched, progress):
        """Evolve over whole cycles; `watched` is a step whose state is handed on."""
        steps, scene = self.steps, self.scene
        inside, out, shared = np.ones(cycles + 1), np.zeros((cycles + 1, 3)), None
        coefficients = np.zeros((cycles + 1, *self.space.shape))
        coefficients[0], out[0, :2] = initial_density(scene.start, self.space, scene.overturning.angle)
        inside[0] -= out[0].sum()
        now, gone = start.coefficients, start.sinks.copy()
        # The second half of a cycle is the mirror image of the first: the density is turned about the origin instead.
        turned = False
        for k in range(start.step, cycles * steps + 1):
            if k == watched:
                shared = _Start(_turn(now) if turned else now, k, gone.copy())
            if k % steps == 0:
                current, cycle = _turn(now) if turned else now, k // steps
                inside[cycle], out[cycle], coefficients[cycle] = self.space.masses(current).sum(), gone, current
                if progress:
                    progress(cycle)
            if k == cycles * steps:
                break
            if (k % steps >= steps // 2) != turned:
                now, turned = _turn(now), not turned
            step = self.half[k % (steps // 2)]
            occupied = np.abs(now).max(axis=(2, 3)) * self.space.areas > self.negligible
            if np.any(occupied & ~step.trace.covered):
                self.rebuilds = getattr(self, "rebuilds", 0) + 1
                step.cover(binary_dilation(occupied, iterations=2))
            now, sinks = step.apply(now)
            gone += sinks[[1, 0, 2]] if turned else sinks
        return _Solution(inside, out, coefficients, shared)


def _common_step(first, steps, others):
    """First step from `first` on that is a step of the other run as well, in the first half cycle; else None."""
    every = steps // math.gcd(steps, others)
    step = every * -(-first // every)
    return step if 2 * step <= steps else None


def _turn(coefficients):
    """Turn a density about the origin, (x, v) -> (-x, -v), on a mesh that is symmetric about it."""
    signs = (-1.0) ** np.arange(coefficients.shape[-1])
    return np.ascontiguousarray(coefficients[::-1, ::-1]) * np.outer(signs, signs)
