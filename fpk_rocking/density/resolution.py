"""How fine a solution is: from the tolerance to resolutions, and from a resolution to mesh and steps for a scene.

Resolutions are made for the main scene. To adapt one to another scene, a few exploratory paths tell how far the motion
goes, and so where the mesh has to be fine. Nothing of these paths enters a result: the mesh they lead to is refined
like any other, and what they did not reach is resolved by cells that grow towards the cut-off and the velocity bound.
What finer resolutions gain: docs/benchmarks/density_solver_mesh_nodes_and_orders.json.
"""

import dataclasses
import math
from typing import NamedTuple

import numpy as np

from fpk_rocking.base.arrays import borrowed
from fpk_rocking.base.jit import kernel
from fpk_rocking.density.space import extended_lines, graded_lines
from fpk_rocking.density.step import Exit
from fpk_rocking.density.step.characteristics import Noise, principal_axes, trace_point
from fpk_rocking.density.step.dynamics import Dynamics
from fpk_rocking.density.step.step import Quadrature
from fpk_rocking.density.tuning import TUNING
from fpk_rocking.physics.motion import TERMS
from fpk_rocking.physics.motion.flight import flight_covariance
from fpk_rocking.scene.axes import centred_edges


def in_rest(angles, velocities):
    """Return a mask (n, m) of the pairs of angles (n,) and velocities (m,), nondimensional, that count as rest."""
    return np.outer(np.abs(angles) < TUNING.rest_angle, np.abs(velocities) < TUNING.rest_velocity)


class StateRange(NamedTuple):
    """How far a block moves before it overturns, over all times of exploratory paths; nondimensional."""

    angle: float
    velocity: float
    angles: tuple[float, float]
    velocities: tuple[float, float]
    fastest: float
    standing: float = 1.0
    """Part of the exploratory paths that do not overturn."""

    @property
    def edges(self):
        """Ascending edges in angle and in velocity, a list of two arrays, of the bins that compare solutions."""
        return [centred_edges(*ends, 20) for ends in (self.angles, self.velocities)]


def explore(white, times):
    """Follow exploratory paths of a scene, the same ones in every call, and return how far they go."""
    dynamics, random = Dynamics.of(white), np.random.default_rng(0)
    spread = np.linalg.cholesky(np.array(white.start.covariance or np.zeros((2, 2))) + 1e-300 * np.eye(2))
    states = np.array([white.start.angle, white.start.velocity]) + _normal_pairs(random) @ spread.T
    sides = np.sign(np.where(states[:, 0], states[:, 0], states[:, 1]))
    # The integers that a side is in every other kernel: of others the paths would be compiled once more.
    sides = np.where(sides, sides, np.sign(white.forcing.value(0.0)) or 1.0).astype(np.int64)
    reached = [np.array([[dynamics.block.cutoff, 1.0]])]
    for segment, duration, diffusion, axes in _exploratory_steps(white, dynamics, times):
        nodes = _normal_pairs(random)
        follow(states, sides, segment, dynamics.block, Noise(duration, diffusion, nodes, nodes @ axes, 0.0))
        reached.append(states[sides > Exit.OVERTURNED_LEFT])
    reached = np.concatenate(reached[1:] if len(reached[1]) else reached)
    if not white.repeats:
        # Before and after a motion a block may rest for long, which must not decide how far it goes.
        moving = (np.abs(reached) >= (TUNING.rest_angle, TUNING.rest_velocity)).any(axis=1)
        reached = reached[moving] if moving.any() else reached
    usual = np.quantile(np.abs(reached), 0.9, axis=0)
    fastest = float(np.abs(reached[:, 1]).max())
    ranges = np.quantile(reached, [0.5 - 0.5 * 0.998, 0.5 + 0.5 * 0.998], axis=0).T
    least = TUNING.least_angle_range, TUNING.least_velocity_range
    ranges += np.outer(np.maximum(least - np.ptp(ranges, axis=1), 0.0), [-0.5, 0.5])
    standing = float((sides > Exit.OVERTURNED_LEFT).mean())
    return StateRange(*usual.tolist(), *(tuple(ends) for ends in ranges.tolist()), fastest, standing)


def _exploratory_steps(white, dynamics, times):
    """Yield (segment, duration, diffusion, axes) of each step of the exploratory paths: forcing, length and noise."""
    longest = min(TUNING.exploratory_step, white.forcing.shortest_period / 6.0)
    if white.repeats:
        steps = math.ceil(white.period / longest - 1e-9)
        cycles = min(round(times[-1] / white.period), TUNING.exploratory_cycles)
        cycle = [_exploratory_step(dynamics, k * white.period / steps, white.period / steps) for k in range(steps)]
        yield from cycle * cycles
        return
    steps = math.ceil(times[-1] / longest)
    for k in range(steps):
        yield _exploratory_step(dynamics, k * times[-1] / steps, times[-1] / steps)


def _exploratory_step(dynamics, start, duration):
    """(segment, duration, diffusion, axes) of the step from `start`: a `Segment`, two floats, an array (2, 2)."""
    diffusion = dynamics.averaged_over(start, duration).diffusion
    axes = np.reshape(principal_axes(*flight_covariance(diffusion, duration)), (2, 2))
    return dynamics.segment(start, duration), duration, diffusion, axes


def _normal_pairs(random):
    """Return normal numbers (paths, 2), drawn from `random`, a NumPy generator, in pairs of either sign."""
    half = random.standard_normal((TUNING.exploratory_paths // 2, 2))
    return np.concatenate([half, -half])


@kernel
def follow(states, sides, segment, block, noise):
    """Carry every path, in place, through a step of which one node of the noise is sampled; see `trace_point`."""
    states, segment, noise = borrowed((states, segment, noise))
    scratch, codes = np.empty((4, TERMS)), np.empty(1, np.int32)
    for n in range(len(states)):
        if sides[n] <= Exit.OVERTURNED_LEFT:
            continue
        offsets = noise.offsets[n : n + 1]
        own = borrowed(Noise(noise.duration, noise.diffusion, noise.nodes[n : n + 1], offsets, abs(offsets[0, 0])))
        trace_point(states[n, 0], states[n, 1], sides[n], segment, block, own, scratch, states[n : n + 1], codes)
        sides[n] = codes[0]


@dataclasses.dataclass(frozen=True)
class PatchSettings:
    """Fineness of the moving patches of a start-up."""

    cells: int
    reach: float
    growth: float
    early: float
    points: int


@dataclasses.dataclass(frozen=True)
class Discretization:
    """Mesh and steps that a scene is solved with: a `Resolution` that has been adapted to it."""

    angle_lines: np.ndarray
    velocity_lines: np.ndarray
    degree: int
    quadrature: Quadrature
    steps: int
    patches: PatchSettings
    contact_parts: int = 1

    @property
    def cells(self):
        """Numbers of cells of the mesh, (angle, velocity)."""
        return len(self.angle_lines) - 1, len(self.velocity_lines) - 1

    def stored(self, rows):
        """Return the bytes, an int, of the densities at a number of `rows`, the times of a result."""
        return 8 * (rows + 1) * math.prod(self.cells) * (self.degree + 1) ** 2

    @property
    def memory(self):
        """Bytes that a solution takes, about, a float, densities of all times left out."""
        points = self.quadrature.angle * self.quadrature.velocity * self.quadrature.long * self.quadrature.short
        return TUNING.bytes_per_unknown * math.prod(self.cells) * ((self.degree + 1) ** 2 * 20 + points * self.steps)

    @property
    def settings(self):
        """Cells, degree, quadrature, steps and patches as a dict for JSON, quadrature and patches as dicts in it."""
        angle_cells, velocity_cells = self.cells
        plain = {"angle_cells": angle_cells, "velocity_cells": velocity_cells, "degree": self.degree}
        plain |= {"quadrature": dataclasses.asdict(self.quadrature), "steps": self.steps}
        if self.contact_parts > 1:
            plain["contact_parts"] = self.contact_parts
        return plain | {"patches": dataclasses.asdict(self.patches)}


@dataclasses.dataclass(frozen=True)
class Resolution:
    """Fineness of a solution, for the diffusion, the motion and the cycle of the main scene."""

    angle_cells: int
    velocity_cells: int
    degree: int
    quadrature: Quadrature
    steps: int
    patches: PatchSettings

    def adapted(self, scene, bound, motion, beyond=0.0, growth=TUNING.tail_growth, filtered=False):
        """Adapt the resolution to a scene, or to one whose `filtered` noise this white noise stands for."""
        cutoff, far = scene.overturning.angle, max(motion.angle, TUNING.rest_angle)
        fast = min(max(motion.velocity, TUNING.rest_velocity), bound)
        # Where the block comes to rest x goes with v²: the lines of the angle are graded like that.
        far, grading = (far, 2.0) if far < TUNING.far_motion * cutoff else (cutoff, TUNING.angle_grading)
        period = cycle_of(scene)
        time = min(period, TUNING.main_period) / TUNING.main_period
        noise = scene.noise.diffusion / TUNING.main_diffusion
        spreads = noise * time**3 * (TUNING.main_cutoff / far) ** 2, noise * time * (TUNING.main_speed / fast) ** 2
        angle_cells, velocity_cells = (
            _even(cells * max(spread**-0.25, TUNING.coarsest))
            for cells, spread in zip((self.angle_cells, self.velocity_cells), spreads, strict=True)
        )
        angle = graded_lines(far, angle_cells, grading)
        velocity = graded_lines(fast, velocity_cells, TUNING.velocity_grading)
        growths = [
            1.0 + (growth - 1.0) * min(TUNING.tail_cells / cells, 1.0) for cells in (angle_cells, velocity_cells)
        ]
        steps = self._steps(scene, fast)
        parts = self._contact_parts(scene, period / steps) if scene.repeats and not filtered else 1
        quadrature = self.quadrature
        if parts > 1:
            points = math.ceil(TUNING.contact_angle_points * quadrature.angle)
            quadrature = dataclasses.replace(quadrature, angle=points)
        return Discretization(
            extended_lines(angle, cutoff, growths[0]),
            extended_lines(extended_lines(velocity, bound, growths[1]), beyond),
            self.degree,
            quadrature,
            steps,
            self.patches,
            parts,
        )

    def _steps(self, scene, fast):
        """Return the steps a cycle, an even int, for a scene whose blocks usually move up to a velocity `fast`."""
        # A slow motion meets impacts more often.
        moving = TUNING.moving_step * math.sqrt(min(fast, 1.0))
        rests = rests_long(scene)
        noisy = TUNING.noisy_step * fast**2 / scene.noise.diffusion
        period = cycle_of(scene)
        steps = self.steps / 16 * period / min(moving, TUNING.resting_step if rests else moving, noisy)
        fewest = TUNING.steps_per_harmonic * period / scene.forcing.shortest_period
        return _even(max(steps, self.steps, fewest))

    def _contact_parts(self, scene, duration):
        """Return the parts, an int, that slow impacts take of a step of a `duration`."""
        restitution = math.sqrt(math.prod(scene.block.restitution_by_side))
        if restitution > TUNING.low_restitution or not rests_long(scene):
            return 1
        # With the square of the steps an error of first order falls by half from one solution to the next.
        part = TUNING.contact_part * (12.0 / self.steps) ** 2
        longest = part * scene.noise.diffusion ** (1.0 / 3.0) / (1.0 - restitution**2)
        return min(math.ceil(duration / longest), TUNING.most_contact_parts)


def rests_long(scene):
    """Whether a block at rest stays there for long in each cycle of a scene, so that its impacts are slow: a bool."""
    return scene.forcing.in_units_of(scene.block.lift_off).longest_rest > TUNING.long_rest


def cycle_of(scene):
    """Return the nondimensional time in which steps are counted: a scene's cycle, or the main scene's if none."""
    return scene.period or TUNING.main_period


def periods_per_cycle(scene):
    """Return 2 where the second half of a scene's cycle is the mirror image of the first, else 1: symmetry periods."""
    return 2 if scene.forcing.half_antisymmetric and scene.block.symmetric else 1


def _even(number):
    """Return the least even int, at least 4, that is not below a `number`."""
    return 2 * max(2, math.ceil(0.5 * number - 1e-9))


RESOLUTIONS = (
    Resolution(16, 16, 3, Quadrature(5, 5, 5, 2, 9), 6, PatchSettings(10, 5.0, 0.7, 0.01, 4)),
    Resolution(22, 22, 3, Quadrature(5, 5, 5, 2, 9), 8, PatchSettings(10, 5.0, 0.7, 0.01, 4)),
    Resolution(32, 32, 3, Quadrature(5, 5, 5, 2, 9), 12, PatchSettings(16, 6.5, 0.35, 0.008, 4)),
    Resolution(44, 44, 3, Quadrature(6, 6, 5, 2, 9), 16, PatchSettings(16, 6.5, 0.35, 0.008, 4)),
    Resolution(56, 52, 4, Quadrature(8, 8, 7, 2), 20, PatchSettings(20, 8.0, 0.2, 0.005, 5)),
    Resolution(78, 72, 4, Quadrature(10, 10, 7, 2), 28, PatchSettings(28, 8.0, 0.1, 0.002, 5)),
    Resolution(108, 100, 4, Quadrature(12, 12, 9, 3), 40, PatchSettings(28, 8.0, 0.1, 0.002, 5)),
)
"""Each about 1.4 times as fine as the one before: neighbours tell the error.

Two with the same patches share a start-up, whose error the solution before them tells.
"""

USUAL = {1e-2: 2, 1e-3: 3, 1e-4: 4}
"""Number of the resolution that is usually fine enough, by tolerance; never one of the first two."""


INTERMEDIATE = Resolution(44, 42, 4, Quadrature(8, 8, 5, 2), 16, PatchSettings(20, 8.0, 0.2, 0.005, 5))
"""Between the fourth and the fifth, which differ in degree: the finer would only tell the error of the coarser."""


COARSEST = Resolution(12, 12, 3, Quadrature(5, 5, 5, 2, 9), 4, PatchSettings(10, 5.0, 0.7, 0.01, 4))
"""Before the first: blocks that hardly move are resolved by the second, and this one tells its error."""


def resolutions_for(tol, before, filtered=False, early=False):
    """Return a list of `Resolution` for a tolerance of survival, from coarse to fine.

    It begins `before` resolutions before the usual one, and one more where it is to begin `early` and that may do.
    """
    usual, chosen = USUAL[max(tolerance for tolerance in USUAL if tolerance <= tol)], list(RESOLUTIONS)
    if before and usual == 4:
        chosen[3] = INTERMEDIATE
    elif not filtered:
        chosen.insert(4, INTERMEDIATE)
    if filtered:
        # Each takes three times as long as the one before: one more costs little, and one less saves much.
        if early:
            chosen.insert(0, COARSEST)
            usual = max(usual, 3)
        elif usual == 3:
            before += 1
    elif early and usual == 3:
        # The second may be the last: it starts as the third does. The coarsest, which starts otherwise, tells by how
        # much that is off.
        patches = RESOLUTIONS[2].patches
        chosen[:2] = (COARSEST, *(dataclasses.replace(one, patches=patches) for one in RESOLUTIONS[:2]))
    return chosen[max(usual - before, 0) :]


def bins_tolerance(tol: float) -> float:
    """Return the error (L1) in the binned density that goes with an error `tol` in survival: √tol / 3."""
    return math.sqrt(tol) / 3.0
