"""The times that results are for: whole forcing cycles, or times of their own where the forcing does not repeat."""

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.base.types import Array, ArrayLike
from fpk_rocking.scene.scene import Scene

SETTLING = 10.0
"""Time for which a block is followed after a motion unless `times` tell otherwise.

A free block whose unstable coordinate is off the separatrix by δ has decided after log(1/δ): of blocks that are spread
over the plane a part exp(-10) has not.
"""

PARTS = 20
"""Parts of a motion's duration after each of which a result is for, unless `times` tell otherwise."""


def result_times(scene: Scene, cycles: int | None = None, times: ArrayLike | None = None) -> Array:
    """Return the times (n + 1,) of a result, the first 0.

    Parameters
    ----------
    scene : Scene
    cycles : int, optional
        Forcing cycles, at least 1; given exactly where the forcing repeats.
    times : array_like, optional
        Ascending times τ, 0 or later, for a forcing that does not repeat. By default `PARTS` equal parts of its
        duration and, `SETTLING` later, when free blocks have settled or overturned.

    Returns
    -------
    ndarray, shape (n + 1,)

    Raises
    ------
    TypeError, ValueError
        Cycles where there are none, times where there are cycles, or one that is refused.
    """
    if scene.period is not None:
        if times is not None:
            accepted = "nothing, as this forcing repeats; use cycles"
            raise ValueError(checks.refusal("times", times, accepted))
        return scene.period * np.arange(checks.count("cycles", cycles, at_most=2**24) + 1)
    if cycles is not None:
        raise ValueError(
            checks.refusal("cycles", cycles, f"nothing, as a {scene.forcing.kind} has no cycles; use times")
        )
    duration = scene.forcing.duration
    if times is None:
        return np.append(duration * np.arange(PARTS + 1) / PARTS, duration + SETTLING)
    accepted = "1 to 100,000 finite numbers from 0 on, ascending, the last above 0"
    rows = checks.array("times", times, accepted)
    rising = rows.ndim == 1 and 1 <= rows.size <= 100_000 and (rows[1:] > rows[:-1]).all()
    if not rising or not rows[0] >= 0.0 or not 0.0 < rows[-1] < np.inf:
        raise ValueError(checks.refusal("times", times, accepted))
    return rows if rows[0] == 0.0 else np.append(0.0, rows)
