"""One cell of a sweep, a scene with a seed of its own, and the row of plain values that is made of it."""

import hashlib
import json
import time
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from fpk_rocking.console import line
from fpk_rocking.scene.scene import Scene


class Cell(NamedTuple):
    """A scene of a sweep, with its number from 0 and the seed of its random numbers."""

    number: int
    scene: Scene
    seed: int

    @property
    def digest(self) -> str:
        """Letters that tell this cell's scene and seed from any other's."""
        return hashlib.sha256(f"{self.seed}\n{self.scene.to_toml()}".encode()).hexdigest()[:16]


def seed_of(seed: int, number: int) -> int:
    """Seed from 0 to 2**64 - 1 of a cell of a sweep: it depends on the sweep's seed and the cell's number alone."""
    return int(np.random.SeedSequence([seed, number]).generate_state(1, np.uint64)[0])


def perform(verb: Callable[..., Any], cell: Cell, options: dict[str, Any]) -> dict[str, Any]:
    """Run a verb on a cell.

    Parameters
    ----------
    verb : callable
        Called as ``verb(scene, seed=seed, **options)``; returns a dict of what JSON holds.
    cell : Cell
    options : dict

    Returns
    -------
    dict
        A row: "cell", "seed", "digest", "wall_s", "values" (empty where it failed) and "reason" (empty where not).
    """
    started, values, reason = time.perf_counter(), {}, ""
    try:
        values = json.loads(json.dumps(dict(verb(cell.scene, seed=cell.seed, **options)), allow_nan=False))
    except Exception as error:  # noqa: BLE001  (whatever it is: a row says so, and the sweep goes on)
        reason = f"{type(error).__name__}: {line(error)}"
    return row_of(cell, time.perf_counter() - started, values, reason)


def perform_alone(verb: Callable[..., Any], cells: Sequence[Cell], options: dict[str, Any]) -> list[dict[str, Any]]:
    """Run a verb on cells, with one thread of the compiled kernels: each worker is one processor; return the rows."""
    import numba

    threads = numba.get_num_threads()
    numba.set_num_threads(1)
    try:
        return [perform(verb, cell, options) for cell in cells]
    finally:
        numba.set_num_threads(threads)


def row_of(cell: Cell, wall_s: float, values: dict[str, Any], reason: str) -> dict[str, Any]:
    """Return the row of a cell."""
    return {
        "cell": cell.number,
        "seed": cell.seed,
        "digest": cell.digest,
        "wall_s": wall_s,
        "values": values,
        "reason": reason,
    }
