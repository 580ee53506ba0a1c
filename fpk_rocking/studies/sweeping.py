"""`sweep`: a task on every scene of a list or a grid, on any workers, with rows that are kept as they come."""

import concurrent.futures
import dataclasses
import itertools
import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.base.checks import Array, File, Progress
from fpk_rocking.results.result import Result
from fpk_rocking.results.storage import write_csv
from fpk_rocking.results.trust import CAUTION, UNUSABLE, VERDICTS, Diagnostic
from fpk_rocking.scene.scene import Scene
from fpk_rocking.studies.execution import Job, run_jobs, seed_of
from fpk_rocking.studies.scenes import Grid, checked_scenes
from fpk_rocking.studies.tasks import TASKS, kernels_of


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class Sweep(Result):
    """Results of a sweep over scenes, a row for each.

    Parameters
    ----------
    rows : tuple of dict
        For each scene, in order: its number "cell", "seed", seconds "wall_s"; "values", what the task returned; and
        "reason", why it failed, else empty.
    axes : dict of str to tuple of float
        Values of the parameters of a grid by name; empty for a list of scenes.
    wall_s : float
        Seconds of the call.
    """

    rows: tuple[dict[str, Any], ...]
    axes: dict[str, tuple[float, ...]]
    wall_s: float

    @property
    def failed(self) -> tuple[dict[str, Any], ...]:
        """Rows of the scenes that failed."""
        return tuple(row for row in self.rows if row["reason"])

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of values of each parameter of a grid; (scenes,) of a list."""
        return tuple(map(len, self.axes.values())) or (len(self.rows),)

    def values(self, name: str) -> Array:
        """Return one number of every row, an array of the `shape`; nan where a scene failed.

        Parameters
        ----------
        name : str
            Name among the values of the rows, such as "survival"; if a value is a list, its last entry is taken.
        """
        names = {key for row in self.rows for key in row["values"]}
        if name not in names:
            raise ValueError(checks.refusal("name", name, ", ".join(map(repr, sorted(names))) or "none: all failed"))
        values = (row["values"].get(name, np.nan) for row in self.rows)
        return np.array([value[-1] if isinstance(value, list) else value for value in values], float).reshape(
            self.shape
        )

    def to_csv(self, path: File) -> None:
        """Write the rows as a CSV file: number, seed, parameters, values that are one number or text, reason.

        Parameters
        ----------
        path : str or pathlib.Path
        """
        columns = self._table("")
        write_csv(path, columns)

    def _table(self, missing):
        """Columns by name; `missing` stands where a row has no value of a name."""
        names = dict.fromkeys(
            key for row in self.rows for key, value in row["values"].items() if not isinstance(value, list | dict)
        )
        return {
            "cell": [row["cell"] for row in self.rows],
            "seed": [row["seed"] for row in self.rows],
            **dict(zip(self.axes, zip(*itertools.product(*self.axes.values()), strict=True), strict=True)),
            **{name: [row["values"].get(name, missing) for row in self.rows] for name in names},
            "wall_s": [row["wall_s"] for row in self.rows],
            "reason": [row["reason"] for row in self.rows],
        }

    @property
    def metadata(self) -> dict[str, Any]:
        """Number of scenes, of failed ones, and of those with each verdict; seconds."""
        return {"scenes": len(self.rows), "failed": len(self.failed)} | self._verdicts() | {"wall_s": self.wall_s}

    def _verdicts(self):
        """Number of scenes by verdict, of those verdicts that some have."""
        verdicts = [row["values"].get("trust") for row in self.rows]
        return {name: verdicts.count(name) for name in VERDICTS if name in verdicts}

    @property
    def diagnostics(self) -> list[Diagnostic]:
        """Diagnostics of scenes that failed, have no verdict, or one that is not "ok"."""
        against, count, verdicts = [], len(self.rows), self._verdicts()
        if self.failed:
            sentence = f"{len(self.failed)} of {count} scenes failed, the first one by: {self.failed[0]['reason']}"
            against.append(Diagnostic(CAUTION if len(self.failed) < count else UNUSABLE, sentence, "failed"))
        unjudged = count - len(self.failed) - sum(verdicts.values())
        if unjudged:
            sentence = f'{unjudged} of {count} scenes have no verdict: their function returned none as "trust".'
            against.append(Diagnostic(CAUTION, sentence, "unjudged"))
        for severity in (CAUTION, UNUSABLE):
            name = VERDICTS[severity]
            if name in verdicts:
                sentence = f'{verdicts[name]} of {count} scenes have the verdict "{name}".'
                against.append(Diagnostic(severity, sentence, name))
        return against

    @property
    def reason_if_ok(self) -> str:
        """Reason of the verdict "ok", as a sentence: that of the scenes."""
        count = self._verdicts().get(VERDICTS[0], 0)
        return f'{count} of {len(self.rows)} scenes have the verdict "{VERDICTS[0]}".'

    @property
    def remarks(self) -> tuple[str, ...]:
        """Sentences about scenes that failed or are not to be trusted."""
        return tuple(diagnostic.message for diagnostic in self.diagnostics)

    @property
    def title(self) -> str:
        """Number of scenes, parameters and failures, as a line of text."""
        over = " × ".join(f"{name} ({len(values)})" for name, values in self.axes.items())
        return f"{len(self.rows):,} scenes{' over ' * bool(over)}{over}, {len(self.failed):,} failed"

    def table(self) -> dict[str, Array]:
        """Return the columns of `to_csv` but the seeds, arrays (scenes,) by name; nan where a row has no such value."""
        return {name: np.array(values) for name, values in self._table(np.nan).items() if name != "seed"}

    @property
    def row_dims(self) -> tuple[str, ...]:
        """Names of the grid's axes; "cell" of a list of scenes."""
        return tuple(self.axes) or ("cell",)

    def derived(self) -> dict[str, Any]:
        """All numbers among the values: arrays over the grid's axes, or a list's scenes."""
        return {name: (self.row_dims, self.values(name)) for name in self._numbers()}

    def places(self) -> dict[str, Any]:
        """Values of the grid's axes by name; none of a list of scenes."""
        return {name: np.array(values) for name, values in self.axes.items()}

    def _numbers(self):
        """Names of the values that are numbers, or lists of numbers."""
        values = {key: value for row in self.rows for key, value in row["values"].items()}
        last = {name: value[-1] if isinstance(value, list) and value else value for name, value in values.items()}
        return [name for name, value in last.items() if isinstance(value, int | float)]

    def plot(self, name: str | None = None) -> Any:
        """Draw one of the values over the first parameter, with a line for each combination of the others.

        Parameters
        ----------
        name : str, optional
            Name of the value, as `values` takes it; by default the first.
        """
        from fpk_rocking.results.pictures import figure_of

        name = name or next(iter(self._numbers()), "")
        values = self.values(name) if name else np.full(self.shape, np.nan)
        first, *others = self.axes.items() or [("scene", range(len(self.rows)))]

        def panel(_, axes):
            lines = values.reshape(len(first[1]), -1).T
            for line, place in zip(lines, itertools.product(*(axis for _, axis in others)), strict=True):
                label = ", ".join(f"{other} {value:g}" for (other, _), value in zip(others, place, strict=True))
                axes.plot(first[1], line, marker="o", markersize=4.0, label=label or None)
            axes.set(xlabel=first[0], ylabel=name)
            if others and len(lines) <= 8:
                axes.legend(fontsize=8)

        return figure_of(panel)


def sweep(
    scenes: Sequence[Scene] | Grid,
    task: str | Callable[..., dict[str, Any]] = "mc",
    *,
    workers: int | concurrent.futures.Executor = 1,
    seed: int = 1,
    store: File | None = None,
    progress: Progress | None = None,
    **options: Any,
) -> Sweep:
    """Run Monte Carlo, the density solver, or a function of your own on many scenes.

    The result is the same to the last bit for any number of workers. A scene that fails, or ends its worker process,
    has a row with the reason.

    Parameters
    ----------
    scenes : sequence of Scene, or Grid
    task : str or callable
        "mc" for `montecarlo.simulate`; "fpk" for `fpk_rocking.solve_fpk`; or a function that worker processes can
        import, called as ``task(scene, seed=seed, **options)``. It returns a dict of numbers, texts and lists; return
        only what you need, as rows are sent over the network and stored.
    workers : int or concurrent.futures.Executor
        1 runs one scene after the other, each on all processors. A larger number starts as many processes, each on one
        processor. An executor, such as that of a Dask cluster (``client.get_executor()``), runs one scene on each of
        its processors.
    seed : int
        At least 0. The random numbers of a scene depend on this and its number in the sweep.
    store : path, optional
        Text file that keeps each finished row, by custom with the suffix .jsonl. If it exists, the sweep continues from
        it: scenes may be added at the end, all else has to be the same. Failed scenes are not run again.
    progress : callable, optional
        Called as ``progress(done, total)`` after each row. An exception that it raises ends the sweep.
    **options
        Options of the task: "mc" takes `cycles` or `times`, `realizations`, `method` and `steps_per_cycle`; "fpk" takes
        `cycles` or `times`, `tol`, `bins_tol` (by default inf) and `noise_replacement`.

    Raises
    ------
    RuntimeError
        The executor ended, for example because the scheduler of a cluster was killed. The store keeps finished rows.

    Examples
    --------
    >>> from fpk_rocking import load_scene
    >>> from fpk_rocking.studies import grid, sweep
    >>> blocks = grid(load_scene("main"), {"forcing.amplitude": [4.2, 4.6]})
    >>> print(sweep(blocks, cycles=4, realizations=500).values("survival"))
    [0.974 0.834]
    """
    listed, axes = (scenes.scenes, scenes.axes) if isinstance(scenes, Grid) else (scenes, {})
    checked = checked_scenes("scenes", listed)
    seed = checks.count("seed", seed, at_least=0)
    function = TASKS.get(task, task) if isinstance(task, str) else task
    if not callable(function):
        raise ValueError(checks.refusal("task", task, f"{', '.join(map(repr, TASKS))}, or a function"))
    jobs = [Job(number, scene, seed_of(seed, number)) for number, scene in enumerate(checked)]
    started = time.perf_counter()
    rows = run_jobs(function, jobs, options, kernels_of, workers=workers, store=store, progress=progress)
    return Sweep(rows, axes, time.perf_counter() - started)
