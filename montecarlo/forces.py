"""`contact_forces`: the friction and the normal force with which the blocks of some histories rock without sliding.

Histories do not keep the force on the block: its noise is drawn again, from the same random numbers.
"""

import dataclasses
import functools
import math

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.base.checks import Array, ArrayLike, Number
from fpk_rocking.base.jit import kernel
from fpk_rocking.physics.motion import floor as forces
from fpk_rocking.scene.scene import Scene
from montecarlo.engines import filtered
from montecarlo.engines.band_noise import allocate_samples, band_of_scene, draw_start_and_noise
from montecarlo.engines.filtered import (
    bound_noise,
    bound_part,
    draw_first_states,
    draw_next_interval,
    draw_parts,
    workspace_of,
)
from montecarlo.engines.random import draw_start, open_stream, start_parameters, stream_keys
from montecarlo.results.ensemble import Histories


@dataclasses.dataclass(frozen=True, eq=False)
class ContactForces:
    """Forces of the floor on the blocks of some histories, over their weight; made by `contact_forces`.

    They are known at the times of the histories alone: more samples show more of the peaks between. The forces of
    impacts, which act for an instant, are not in them.

    Parameters
    ----------
    scene : Scene
    time : ndarray, shape (n,)
        Times τ.
    horizontal, normal : ndarray, shape (realizations, n)
        Over mg, the horizontal one positive towards x > 0; nan after overturning.
    """

    scene: Scene
    time: np.ndarray
    horizontal: np.ndarray
    normal: np.ndarray

    @functools.cached_property
    def friction(self) -> Array:
        """Friction coefficient |H|/N that a block needs, (realizations, n): inf for N <= 0, nan after overturning."""
        pressed = self.normal > 0.0
        ratio = np.abs(self.horizontal) / np.where(pressed, self.normal, 1.0)
        return np.where(pressed | np.isnan(self.normal), ratio, np.inf)

    @property
    def needed(self) -> Array:
        """Largest `friction` of each realization, (realizations,)."""
        return np.nanmax(self.friction, axis=1)

    @property
    def least(self) -> Array:
        """Least normal force over mg of each realization, (realizations,)."""
        return np.nanmin(self.normal, axis=1)

    def sliding(self, friction: ArrayLike) -> tuple[Number, Number]:
        """Probability that a block with a friction coefficient slides at one of the times, and its standard error.

        Parameters
        ----------
        friction : array_like
            Coefficients μ, at least 0, else ValueError.
        """
        values = np.asarray(friction, float)
        if not np.all(values >= 0.0):
            raise ValueError(checks.refusal("friction", friction, "numbers >= 0"))
        part = (self.needed > values[..., None]).mean(axis=-1)
        return part[()], np.sqrt(part * (1.0 - part) / len(self.needed))[()]

    @property
    def headline(self) -> str:
        """Two sentences: friction below which the block slides before it rocks, and friction that rocking needs."""
        needed, count = self.needed, len(self.needed)
        typical = f" in the worst of {count:,} paths and {np.median(needed):.3g} in the median one" if count > 1 else ""
        floor = f"the normal force falls to {self.least.min():.3g} of the weight"
        if np.isinf(needed.max()):
            floor = f"the corner leaves the floor in {np.count_nonzero(np.isinf(needed)):,} of {count:,} paths"
        return (
            f"A block with a friction coefficient below {self.scene.block.least_friction:.3g} slides before it rocks. "
            f"At the sampled times rocking needs a coefficient of {needed.max():.3g}{typical}, and {floor}."
        )

    def __str__(self):
        return self.headline


def contact_forces(histories: Histories) -> ContactForces:
    """Compute horizontal and normal forces at the corner, over the weight, along histories.

    Parameters
    ----------
    histories : Histories
        Of a block with a size or a critical angle above 0, by any method but "white", under which forces are unbounded.

    Examples
    --------
    >>> from fpk_rocking import Scene
    >>> from montecarlo import contact_forces, histories
    >>> rack = Scene.from_block(0.5, 1.8, "0.4 g", "1.5 Hz")
    >>> print(contact_forces(histories(rack, cycles=2)).needed.round(2))
    [0.31]
    """
    scene = checks.instance("histories", histories, Histories).scene
    if scene.block.least_friction is None:
        accepted = "an angle above 0, or block.dimensions, for contact forces"
        raise ValueError(checks.refusal("block.critical_angle", scene.block.critical_angle, accepted))
    if scene.noise.kind == "white":
        accepted = "'band', 'filtered' or 'none' for contact forces"
        raise ValueError(checks.refusal("noise.kind", scene.noise.kind, accepted))
    count = 1 if scene.deterministic else histories.realizations
    force = _total_force(scene, histories.seed, count, histories.steps_per_cycle, histories.time)
    slender = scene.block.critical_angle == 0.0
    alpha = math.atan(scene.block.least_friction)
    body, sides = scene.block.body, forces.SidesOfContact()
    if body is not None:
        sides = forces.SidesOfContact(body.saddles, body.acceleration_scales, body.levers)
    weight = scene.forcing.weight(histories.time)
    pair = forces.contact_forces(histories.angle, histories.velocity, force, alpha, slender, sides, weight)
    return ContactForces(scene, histories.time, *pair)


def _total_force(scene, seed, count, steps_per_cycle, times):
    """Return forcing plus noise (count, n) on the first realizations at ascending `times` τ (n,)."""
    noise = scene.noise
    force = np.tile([scene.forcing.value(time) for time in times.tolist()], (count, 1))
    if noise.kind == "none":
        return force
    if noise.kind == "band":
        drawn = _band_noise(scene, seed, count, times)
    else:
        drawn = _filtered_noise(scene, seed, count, steps_per_cycle, times)
    return force + (1.0 if noise.envelope is None else noise.envelope.value(times)) * drawn


def _band_noise(scene, seed, count, times):
    """Return band noise (count, n) without its envelope: the sum of its harmonics."""
    keys, values, band = stream_keys(seed), np.empty((count, times.size)), band_of_scene(scene, 2.0 * math.pi)
    for number in range(count):
        drawn = allocate_samples(band.harmonics).harmonics
        draw_start_and_noise(open_stream(keys, number), start_parameters(scene.start), band, drawn)
        values[number] = np.cos(np.outer(times, drawn.ratios) + 2.0 * math.pi * drawn.phases) @ drawn.weights
    return values


def _filtered_noise(scene, seed, count, steps_per_cycle, times):
    """Return filtered noise (count, n) without its envelope, by its polynomials in the intervals of the run."""
    parameters = filtered.parameters_of(scene, steps_per_cycle, None if scene.repeats else times[1:])
    values = np.empty((count, times.size))
    _write_filtered_noise(stream_keys(seed), parameters, times / parameters.grid.spacing, values)
    return values


@kernel
def _write_filtered_noise(keys, parameters, places, values):
    """Write the noise at `places`, in intervals since τ = 0, to `values` (count, n): by its parts where it has some."""
    noise, tables = workspace_of(parameters).noise, parameters.noise
    for realization in range(values.shape[0]):
        stream, drawn = open_stream(keys, realization), -1
        draw_start(stream, parameters.start)
        draw_first_states(stream, tables, noise)
        for k in range(places.size):
            number = int(places[k])
            while drawn < number:
                draw_next_interval(stream, tables, noise)
                drawn += 1
            share, row = places[k] - number, noise.bernstein
            parts, j = noise.parts.shape[0], number % parameters.grid.count
            if parts > 0:
                draw_parts(tables.parts, noise)
                part = min(int(parts * share), parts - 1)
                share = parts * share - part
                bound_part(j, part, tables.parts.law, parameters.envelope, noise)
            else:
                bound_noise(j, tables.law, parameters.envelope, noise, 0.0)
            for last in range(row.size - 1, 0, -1):
                for i in range(last):
                    row[i] += share * (row[i + 1] - row[i])
            values[realization, k] = row[0]
