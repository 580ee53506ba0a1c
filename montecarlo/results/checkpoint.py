"""A long tally in parts: its state is kept in a file, and a later run goes on from there."""

import time
from typing import Any

import numpy as np

from fpk_rocking.base.types import File
from fpk_rocking.results import storage
from montecarlo.results.counts import Counts
from montecarlo.results.tally import LAYOUT, Tally

_BETWEEN_S = 30.0
_SHARE = 0.02


class Keeper:
    """Keeps a tally in a file: at once, so that a path that cannot be written is refused early, then now and then.

    Parameters
    ----------
    path : path or None
        None keeps nothing.
    done : int
        Realizations that the file holds already.
    """

    def __init__(self, path, done):
        self._path, self._done, self._due = path, done, 0.0

    @property
    def is_due(self) -> bool:
        """Whether enough time has passed to save again; saving takes no more than 2 % of a run."""
        return self._path is not None and time.perf_counter() >= self._due

    def keep(self, tally: Tally) -> None:
        """Save a tally, unless the file holds as many realizations already."""
        if self._path is None or tally.realizations == self._done:
            return
        began = time.perf_counter()
        tally.save(self._path)
        ended = time.perf_counter()
        self._done, self._due = tally.realizations, ended + max(_BETWEEN_S, (ended - began) / _SHARE)


def resumed(path: File, run: Any, empty: Counts) -> tuple[Counts, float]:
    """Return the counts of a checkpoint and the seconds spent on them.

    Parameters
    ----------
    path : path
    run : montecarlo.engines.Run
        What is asked for.
    empty : Counts
        Its counts of no realization.

    Returns
    -------
    counts : Counts
    spent : float

    Raises
    ------
    ValueError
        The file is not a saved tally, is damaged, is of another run, or holds more realizations than are asked for.
    """
    try:
        scene, arrays, attributes = storage.read_result(path, "tally", LAYOUT)
    except ValueError as error:
        raise ValueError(f"checkpoint: {error}") from error
    counts = Counts(**arrays)
    found = Tally(scene=scene, counts=counts, **attributes)
    if not np.array_equal(found.times, run.times):
        raise _foreign(path, _counted(found), _counted(run))
    for name in ("scene", "seed", "method", "steps_per_cycle"):
        if getattr(found, name) != getattr(run, name):
            raise _foreign(path, f"{name} {getattr(found, name)}", f"{name} {getattr(run, name)}")
    for name in ("angle_edges", "velocity_edges"):
        if not np.array_equal(getattr(counts, name), getattr(empty, name)):
            raise _foreign(path, f"other {name}", f"the {name} that are asked for")
    if found.realizations > run.realizations:
        raise _foreign(path, f"realizations {found.realizations}", f"at most {run.realizations}, as asked for")
    return counts, found.wall_s


def _counted(run):
    if run.scene.period is None:
        return f"{len(run.times) - 1} times up to {run.times[-1]:g}"
    return f"cycles {len(run.times) - 1}"


def _foreign(path, got, accepted):
    return ValueError(f"checkpoint: got {path} with {got}, accepted: {accepted}, or the name of a new file")
