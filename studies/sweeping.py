"""`sweep`: a verb on every scene of a list or a grid, on any workers, kept as it comes."""

import concurrent.futures
import contextlib
import csv
import dataclasses
import importlib.metadata
import io
import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from fpk_rocking.base import ahead, checks
from fpk_rocking.base.types import Array, File, Progress
from fpk_rocking.results.storage import write_text
from fpk_rocking.scene.scene import Scene
from studies.execution.cells import Cell, seed_of
from studies.execution.store import Store
from studies.execution.workers import rows_of
from studies.scenes import Grid
from studies.verbs import VERBS, tasks_of


@dataclasses.dataclass(frozen=True, eq=False)
class Sweep:
    """Rows of a sweep.

    Parameters
    ----------
    rows : tuple of dict
        A row for each scene, in their order: "cell", its number; "seed", that of its random numbers; "digest" of scene
        and seed; "wall_s"; "values", what the verb returned; and "reason", why it failed, empty where it did not.
    axes : dict of str to tuple of float
        Values of the parameters of a grid by name; empty of a list.
    wall_s : float
        Seconds that it took, without the rows that were there.
    """

    rows: tuple[dict[str, Any], ...]
    axes: dict[str, tuple[float, ...]]
    wall_s: float

    @property
    def failed(self) -> tuple[dict[str, Any], ...]:
        """Rows of the scenes that have no values."""
        return tuple(row for row in self.rows if row["reason"])

    @property
    def shape(self) -> tuple[int, ...]:
        """Lengths of the axes of a grid; the number of scenes of a list."""
        return tuple(map(len, self.axes.values())) or (len(self.rows),)

    def values(self, name: str) -> Array:
        """Return one number of each row.

        Parameters
        ----------
        name : str
            Of the verb's values; of a list, such as "survival" after each cycle, the last entry is taken.

        Returns
        -------
        ndarray, shape of the grid or (scenes,)
            nan where a scene failed.

        Raises
        ------
        ValueError
            No row has such a value.
        """
        known = {key for row in self.rows for key in row["values"]}
        if name not in known:
            raise ValueError(checks.refusal("name", name, ", ".join(map(repr, sorted(known))) or "none: all failed"))
        found = (row["values"].get(name, np.nan) for row in self.rows)
        return np.array([one[-1] if isinstance(one, list) else one for one in found], float).reshape(self.shape)

    def to_csv(self, path: File) -> None:
        """Write a table: cell, seed, the parameters of a grid, all values that are one number or text, reason."""
        names = dict.fromkeys(
            key for row in self.rows for key, value in row["values"].items() if not isinstance(value, list | dict)
        )
        text = io.StringIO()
        table = csv.writer(text, lineterminator="\n")
        table.writerow(["cell", "seed", *self.axes, *names, "wall_s", "reason"])
        for row in self.rows:
            parameters = Grid((), self.axes).parameters(row["cell"]).values() if self.axes else ()
            own = (row["values"].get(name, "") for name in names)
            table.writerow([row["cell"], row["seed"], *parameters, *own, row["wall_s"], row["reason"]])
        write_text(path, text.getvalue())


def sweep(
    scenes: Sequence[Scene] | Grid,
    verb: str | Callable[..., dict[str, Any]] = "mc",
    *,
    workers: int | concurrent.futures.Executor = 1,
    seed: int = 1,
    store: File | None = None,
    progress: Progress | None = None,
    **options: Any,
) -> Sweep:
    """Run a verb on many scenes.

    The result is the same to the last bit for any workers: the random numbers of a scene depend on `seed` and on its
    number in the sweep alone.

    Parameters
    ----------
    scenes : sequence of Scene, or Grid
        What `studies.grid` makes, or any scenes.
    verb : str or callable
        "mc", `montecarlo.simulate`; "fpk", `fpk_rocking.solve_fpk`; or a function that is called as ``verb(scene,
        seed=seed, **options)`` and returns a dict of numbers, texts and lists. A row crosses the network and is kept:
        return what is wanted of a result, not the result. For processes and clusters the function has to be one that
        they can import.
    workers : int or concurrent.futures.Executor
        1: one scene after the other, each on all processors. More: as many processes, each on one processor. An
        executor, such as that of a Dask cluster (``client.get_executor()``): whatever it has, one scene on one
        processor each. Kernels of "mc" and "fpk" are compiled before workers start.
    seed : int
        At least 0.
    store : path, optional
        A text file that keeps the rows as they come, by custom with the suffix .jsonl. Where it exists, the sweep goes
        on from it; scenes may have been added at the end, all else has to be the same. A scene that failed is not
        tried again.
    progress : callable, optional
        Called as ``progress(done, total)`` after each row; may raise.
    **options
        Of the verb: "mc" takes `cycles` or `times`, `realizations`, `method` and `steps_per_cycle`; "fpk" takes
        `cycles` or `times`, `tol`, `bins_tol` and `closure`.

    Returns
    -------
    Sweep
        A scene that fails, or that no worker survives, is a row with its reason.

    Raises
    ------
    TypeError, ValueError
        A parameter is refused, or the store belongs to another sweep.
    """
    scenes, axes = (scenes.scenes, scenes.axes) if isinstance(scenes, Grid) else (scenes, {})
    scenes = checked_scenes("scenes", scenes)
    seed = checks.count("seed", seed, at_least=0)
    function = VERBS.get(verb, verb) if isinstance(verb, str) else verb
    if not callable(function):
        raise ValueError(checks.refusal("verb", verb, f"{', '.join(map(repr, VERBS))}, or a function"))
    cells = [Cell(number, scene, seed_of(seed, number)) for number, scene in enumerate(scenes)]
    started = time.perf_counter()
    rows = run(function, cells, options, workers=workers, store=store, progress=progress)
    return Sweep(rows, axes, time.perf_counter() - started)


def checked_scenes(name, scenes):
    """Return a tuple of scenes, at least one."""
    accepted = "one or more scenes"
    if isinstance(scenes, str | bytes) or not hasattr(scenes, "__iter__"):
        raise TypeError(checks.refusal(name, scenes, accepted))
    scenes = tuple(scenes)
    if not scenes:
        raise ValueError(checks.refusal(name, scenes, accepted))
    return tuple(checks.instance(f"{name}[{number}]", scene, Scene) for number, scene in enumerate(scenes))


def run(verb, cells, options, *, workers, store=None, progress=None):
    """Run a verb on cells, or take their rows from a store; parameters as in `sweep`.

    Returns
    -------
    tuple of dict
        Rows in the order of the cells.
    """
    if not isinstance(workers, concurrent.futures.Executor):
        workers = checks.count("workers", workers)
    checks.report(progress)
    about = {
        "verb": f"{verb.__module__}.{getattr(verb, '__qualname__', type(verb).__qualname__)}",
        "options": options,
        "version": importlib.metadata.version("fpk-rocking"),
    }
    kept = Store(store, about, cells)
    left = [cell for cell in cells if cell.number not in kept.rows]
    if progress is not None:
        progress(len(kept.rows), len(cells))
    if left and workers != 1:
        for task in tasks_of(verb, left, options):
            ahead.ready(task)
    with kept.appending() as add, contextlib.closing(rows_of(verb, left, options, workers)) as rows:
        for row in rows:
            add(row)
            if progress is not None:
                progress(len(kept.rows), len(cells))
    return tuple(kept.rows[cell.number] for cell in cells)
