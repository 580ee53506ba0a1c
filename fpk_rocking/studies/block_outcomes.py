"""Outcomes of many blocks under many motions: whether each overturns, from one set of tables a motion and size."""

import dataclasses
import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.base.checks import Array, ArrayLike, Progress
from fpk_rocking.base.jit import map_threads
from fpk_rocking.physics.forcing import Record
from fpk_rocking.physics.motion.equation import block_of_scene
from fpk_rocking.scene import NoNoise
from fpk_rocking.scene.parts import Block, Body, Overturning
from fpk_rocking.scene.scene import Scene
from fpk_rocking.scene.units import STANDARD_GRAVITY, Dimensions
from montecarlo.engines import engine_of
from montecarlo.engines.band_noise import scaled_parameters
from montecarlo.engines.batches import checked_run, simulate_batches

SCATTERED, SHARED = "critical_angle", "frequency_parameter"
"""Parameter that differs from test to test, and the one whose equal values share the tables of a motion."""

LASTS = 10.0
"""Nondimensional time after a motion within which a block that overturns does so."""


def outcomes_as_bool(name: str, values: ArrayLike, count: int) -> Array:
    """Return outcomes, an array_like of True or False, as an array of bool (count,); ValueError for anything else.

    `name` is that of the parameter, for the message.
    """
    out = np.asarray(values)
    if out.shape != (count,) or not np.isin(out, [0, 1]).all():
        raise ValueError(checks.refusal(name, values, f"{count} outcomes, True or False, one for each motion"))
    return out.astype(bool)


def block_scene(motion: Record, overturning: float = 0.5 * math.pi, **values: float) -> Scene:
    """Return the `Scene` of a block under a motion, without noise: here it is said what the parameters of a prior mean.

    Parameters
    ----------
    motion : Record
    overturning : float
        Angle of overturning, in critical angles, of the harder side where the sides differ.
    **values : float
        `critical_angle` α, radians, and `frequency_parameter` p, rad/s, of the easier side: as those of a homogeneous
        rectangle, whose half diagonal is 3 g/(4 p²). `restitution`, by default Housner's. `offset` d of the centre of
        mass, by default 0: it is (1 - d) half widths from the left corner and (1 + d) from the right one.
    """
    if not {SCATTERED, SHARED} <= values.keys() <= {SCATTERED, SHARED, "restitution", "offset"}:
        accepted = f"{SCATTERED}, {SHARED}, and restitution and offset or not"
        raise ValueError(checks.refusal("prior", sorted(values), accepted))
    alpha, radius = values[SCATTERED], 0.75 * STANDARD_GRAVITY / values[SHARED] ** 2
    easier, height = radius * math.sin(alpha), radius * math.cos(alpha)
    restitution: Any = values.get("restitution")
    if "offset" not in values:
        block = Block(restitution, Dimensions(2.0 * easier, 2.0 * height))
        return Scene(block, motion, NoNoise(), overturning=Overturning(overturning))
    offset = checks.number("offset", values["offset"], at_least=-0.9, at_most=0.9)
    harder = easier * (1.0 + abs(offset)) / (1.0 - abs(offset))
    right, left = (harder, easier) if offset > 0.0 else (easier, harder)
    body = Body(height, right, left, radius / math.sqrt(3.0))
    # Beyond the saddle of the harder side, not of the easier one, a block does not come back by itself.
    criterion = Overturning(overturning * max(body.saddles))
    return Scene(Block(restitution, body=body), motion, NoNoise(), overturning=criterion)


def block_scenes(
    names: Sequence[str], values: Array, angles: Array, overturning: float, motions: Sequence[Record]
) -> list[list[Scene]]:
    """Return lists (k) of lists (j) of scenes of blocks under the first of `motions`.

    `values` (k, d) are those of the parameters `names` (d), as of `block_scene`; `angles` (j,): critical angles,
    radians; `overturning`: angle of overturning, in critical angles.
    """
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
    """Return whether blocks overturn under n motions, as an array of bool (n, k, j).

    `blocks`: lists (k) of lists (j) of scenes, whose critical angles ascend along j. `progress`: called as
    ``progress(done, total)`` after each motion.

    At every other critical angle the path is followed; between two at which the block comes to different things too.

    Returns
    -------
    ndarray of bool, shape (n, k, j)
    """
    out, done = np.zeros((len(motions), len(blocks), len(blocks[0])), bool), []
    sizes: Any = [[scene.block.size for scene in row] for row in blocks]
    groups: dict[float, list[int]] = {}
    for number, row in enumerate(sizes):
        groups.setdefault(round(row[0].frequency_parameter, 9), []).append(number)

    def follow(number):
        """Follow all blocks under the motion of a `number` and write to `out[number]` (k, j) which overturn.

        Those of equal frequency parameter share its tables.
        """
        for rows in groups.values():
            overturns = _follower(blocks[rows[0]][0], motions[number])
            for place in range(0, out.shape[2], 2):
                for row in rows:
                    out[number, row, place] = overturns(blocks[row][place])
            for place in range(1, out.shape[2] - 1, 2):
                for row in rows:
                    before, after = out[number, row, place - 1], out[number, row, place + 1]
                    out[number, row, place] = overturns(blocks[row][place]) if before != after else before
        done.append(number)
        if progress is not None:
            progress(len(done), len(motions))

    map_threads(follow, range(len(motions)))
    return out


def _follower(first, motion):
    """Return a function of a `Scene` that says (bool) whether its block overturns under a `motion`, a `Record`.

    The blocks have the frequency parameter of that of the scene `first`.
    """
    first = dataclasses.replace(first, forcing=motion.for_size(first.block.size))
    run = checked_run(first, None, None, 1, "exact", 200, times=[first.forcing.duration + LASTS])
    tables = engine_of(first, "exact").parameters_of(first, 200, run.times[1:])
    latest: dict[Any, Any] = {}

    def overturns(scene):
        """Whether the block of a `scene` overturns under the motion (bool)."""
        size, block = scene.block.size, block_of_scene(scene)
        factor = size.amplitude(1.0) / first.block.size.amplitude(1.0)
        if factor * first.forcing.largest <= scene.block.lift_off:
            return False
        if size not in latest:
            latest.clear()
            latest[size] = scaled_parameters(tables._replace(block=block), factor)
        (path,) = simulate_batches(run, parameters=latest[size]._replace(block=block))
        return bool(path.overturn_side[0])

    return overturns
