"""Outcomes of many blocks under many motions: whether each overturns, from one set of tables a motion and size."""

import dataclasses
import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.base.checks import Array, Progress
from fpk_rocking.base.jit import map_threads
from fpk_rocking.physics.forcing import Record
from fpk_rocking.physics.motion import lift_off
from fpk_rocking.physics.motion.equation import block_of_scene
from fpk_rocking.scene import NoNoise
from fpk_rocking.scene.parts import Block, Overturning
from fpk_rocking.scene.scene import Scene
from fpk_rocking.scene.units import STANDARD_GRAVITY, Dimensions
from montecarlo.engines import engine_of
from montecarlo.engines.band_noise import scaled_parameters
from montecarlo.engines.batches import checked_run, simulate_batches

SCATTERED, SHARED = "critical_angle", "frequency_parameter"
"""Parameter that differs from test to test, and the one whose equal values share the tables of a motion."""

LASTS = 10.0
"""Nondimensional time after a motion within which a block that overturns does so."""


def block_scene(motion: Record, overturning: float = 0.5 * math.pi, **values: float) -> Scene:
    """Return the scene of a block under a motion: the one place that knows what the parameters of a prior mean.

    Parameters
    ----------
    motion : Record
    overturning : float
        Angle of overturning, in critical angles.
    **values : float
        `critical_angle` α, radians, and `frequency_parameter` p, rad/s, of a homogeneous rectangle: its half diagonal
        is 3 g/(4 p²). `restitution`, by default Housner's.
    """
    names = {SCATTERED, SHARED, "restitution"}
    if not {SCATTERED, SHARED} <= values.keys() <= names:
        accepted = f"{SCATTERED}, {SHARED}, and restitution or not"
        raise ValueError(checks.refusal("prior", sorted(values), accepted))
    alpha, diagonal = values[SCATTERED], 1.5 * STANDARD_GRAVITY / values[SHARED] ** 2
    size = Dimensions(diagonal * math.sin(alpha), diagonal * math.cos(alpha))
    block = Block(values.get("restitution"), size)  # type: ignore[arg-type]  # None: Housner's
    return Scene(block, motion, NoNoise(), overturning=Overturning(overturning))


def block_scenes(
    names: Sequence[str], values: Array, angles: Array, overturning: float, motions: Sequence[Record]
) -> list[list[Scene]]:
    """Return scenes (k, j) of blocks under the first motion, for values (k, d) of `names` and critical angles (j,)."""
    return [
        [
            block_scene(motions[0], overturning, **{SCATTERED: angle}, **dict(zip(names, row, strict=True)))
            for angle in angles
        ]
        for row in values.tolist()
    ]


def outcomes_of(
    blocks: Sequence[Sequence[Scene]], motions: Sequence[Record], progress: Progress | None = None
) -> Array:
    """Return whether blocks, scenes (k, j) with critical angles that ascend along j, overturn under n motions.

    At every other critical angle the path is followed; between two at which the block comes to different things too.

    Returns
    -------
    ndarray of bool, shape (n, k, j)
    """
    out, done = np.zeros((len(motions), len(blocks), len(blocks[0])), bool), []
    sizes: Any = [[scene.block.dimensions for scene in row] for row in blocks]
    groups: dict[float, list[int]] = {}
    for number, row in enumerate(sizes):
        groups.setdefault(round(row[0].frequency_parameter, 9), []).append(number)

    def follow(number):
        """Follow all blocks under one motion; those of equal frequency parameter share its tables."""
        for rows in groups.values():
            first = dataclasses.replace(blocks[rows[0]][0], forcing=motions[number].for_size(sizes[rows[0]][0]))
            run = checked_run(first, None, None, 1, "exact", 200, times=[first.forcing.duration + LASTS])
            tables = engine_of(first, "exact").parameters_of(first, 200, run.times[1:])
            for row in rows:
                scenes, unit = blocks[row], sizes[rows[0]][0].amplitude(1.0)

                def overturns(place, scenes=scenes, row=row, unit=unit, tables=tables, run=run):
                    """Whether the block of a critical angle, by its place, overturns."""
                    factor = sizes[row][place].amplitude(1.0) / unit
                    if factor * run.scene.forcing.largest <= lift_off(scenes[place].block.critical_angle):
                        return False
                    own = scaled_parameters(tables._replace(block=block_of_scene(scenes[place])), factor)
                    (path,) = simulate_batches(run, parameters=own)
                    return bool(path.overturn_side[0])

                out[number, row, ::2] = [overturns(place) for place in range(0, len(scenes), 2)]
                for place in range(1, len(scenes) - 1, 2):
                    before, after = out[number, row, place - 1], out[number, row, place + 1]
                    out[number, row, place] = overturns(place) if before != after else before
        done.append(number)
        if progress is not None:
            progress(len(done), len(motions))

    map_threads(follow, range(len(motions)))
    return out
