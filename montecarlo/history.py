"""`histories`: whole time histories of realizations, with their impacts."""

import dataclasses
import time

import numpy as np

from fpk_rocking import checks, storage
from fpk_rocking.layout import Layout
from fpk_rocking.scene import Scene
from montecarlo import engines

_LAYOUT = Layout(
    {
        "time": "f8 k",
        "angle": "f8 n k",
        "velocity": "f8 n k",
        "overturn_time": "f8 n",
        "overturn_side": "i1 n",
        "impact_realization": "i8 i",
        "impact_time": "f8 i",
        "impact_velocity": "f8 i",
    },
    {"method": str, "seed": int, "steps_per_cycle": int, "samples_per_cycle": int, "wall_s": float},
)
_ROOM_PER_CYCLE = 16


@dataclasses.dataclass(frozen=True, eq=False)
class Histories:
    """Time histories of independent realizations; all quantities are nondimensional, n = cycles * samples + 1.

    Parameters
    ----------
    scene : Scene
        As it was asked for.
    method : str
        Name of the engine.
    seed : int
        With a realization's number, all that its random numbers depend on.
    steps_per_cycle, samples_per_cycle : int
        As they were asked for.
    wall_s : float
        Seconds that the simulation took, compilation included.
    time : ndarray, shape (n,)
        Times τ of the states, equally spaced from 0.
    angle, velocity : ndarray, shape (realizations, n)
        States; nan after overturning.
    overturn_time : ndarray, shape (realizations,)
        Time τ of overturning, nan where it never came.
    overturn_side : ndarray of int8, shape (realizations,)
        -1 overturned to the left, +1 to the right, 0 not at all.
    impact_realization : ndarray of int, shape (n_impacts,)
        Realization of each impact, ascending; its impacts are in the order of time.
    impact_time, impact_velocity : ndarray, shape (n_impacts,)
        Time τ of each impact, and the velocity just before it. Impacts that a method sums as chatter are not listed.
    """

    scene: Scene
    method: str
    seed: int
    steps_per_cycle: int
    samples_per_cycle: int
    wall_s: float
    time: np.ndarray
    angle: np.ndarray
    velocity: np.ndarray
    overturn_time: np.ndarray
    overturn_side: np.ndarray
    impact_realization: np.ndarray
    impact_time: np.ndarray
    impact_velocity: np.ndarray

    def __post_init__(self):
        for name in _LAYOUT.arrays:
            getattr(self, name).flags.writeable = False

    @property
    def realizations(self):
        """Number of realizations."""
        return self.angle.shape[0]

    @property
    def cycles(self):
        """Number of forcing cycles."""
        return (self.time.size - 1) // self.samples_per_cycle

    @property
    def impacts(self):
        """Number of impacts of each realization, shape (realizations,)."""
        return np.bincount(self.impact_realization, minlength=self.realizations)

    def poincare(self):
        """Return angle and velocity at τ = kT, each of shape (realizations, cycles + 1); nan after overturning."""
        return self.angle[:, :: self.samples_per_cycle], self.velocity[:, :: self.samples_per_cycle]

    def save(self, path):
        """Save the histories, whole or not at all; `path` by custom ends in .npz."""
        storage.write_result(path, "histories", self.scene, *_LAYOUT.of(self))

    @classmethod
    def load(cls, path):
        """Load saved histories; raises as `fpk_rocking.storage.read_result`."""
        scene, arrays, attributes = storage.read_result(path, "histories", _LAYOUT)
        return cls(scene=scene, **arrays, **attributes)


def histories(
    scene, *, cycles, realizations=1, seed=1, method=None, steps_per_cycle=200, samples_per_cycle=100, progress=None
):
    """Simulate realizations and keep their time histories and every impact.

    Realization r is that of `montecarlo.simulate` with the same seed, method and steps. One exception: where the
    intervals of "white", 32 in a cycle of the main scene, are no multiple of `samples_per_cycle`, it takes other
    intervals and so finds another path of the same law.

    Parameters
    ----------
    scene : Scene
        Block, forcing, noise, start and overturning.
    cycles, realizations, seed, method, steps_per_cycle, progress
        As for `montecarlo.simulate`.
    samples_per_cycle : int
        States that are kept of each cycle, at least 1.

    Returns
    -------
    Histories

    Raises
    ------
    TypeError, ValueError
        A parameter is refused, as by `montecarlo.simulate`.
    """
    started = time.perf_counter()
    run = engines.checked(scene, cycles, realizations, seed, method, steps_per_cycle, progress)
    samples = checks.count("samples_per_cycle", samples_per_cycle)
    engines.refuse_large(run, samples + _ROOM_PER_CYCLE)
    parts = [(batch, _listed(batch)) for batch in _complete(run, samples, progress)]
    columns = [np.concatenate(column) for column in zip(*(batch[1:5] for batch, _ in parts), strict=True)]
    impacts = [np.concatenate(column) for column in zip(*(listed for _, listed in parts), strict=True)]
    return Histories(
        scene,
        run.method,
        run.seed,
        run.steps_per_cycle,
        samples,
        time.perf_counter() - started,
        scene.period * (np.arange(run.cycles * samples + 1) / samples),
        *columns,
        *impacts,
    )


def _complete(run, samples, progress):
    """Yield batches that hold all their impacts: one that has more than its room is simulated again with enough."""
    room = _ROOM_PER_CYCLE * run.cycles
    for batch in engines.batches(run, samples=samples, capacity=room, progress=progress):
        needed = int(batch.impacts.count.max())
        if needed <= room:
            yield batch
        else:
            again = run._replace(realizations=batch.first + batch.angle.shape[0])
            engines.refuse_large(again._replace(realizations=batch.angle.shape[0], cycles=1), needed)
            yield from engines.batches(again, first=batch.first, samples=samples, capacity=needed)


def _listed(batch):
    """Return realization, time and velocity of each impact of a batch, shape (n_impacts,)."""
    kept = np.arange(batch.impacts.time.shape[1]) < batch.impacts.count[:, None]
    return batch.first + np.nonzero(kept)[0], batch.impacts.time[kept], batch.impacts.velocity[kept]
