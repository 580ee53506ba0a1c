"""The Monte Carlo engines, which integrate the realizations of a scene: `exact`, `rk4`, `white` and `filtered`.

An engine is a module with what `Engine` lists. `running` checks the parameters of a run, finds the engine that fits the
noise, and yields batches of realizations; `random`, `start` and `shinozuka` draw what they need; `events` is a part of
`exact`, `approach` and `bounce` of `white`; `grid` divides time for all of them.
"""

from typing import Protocol


class Engine(Protocol):
    """What a module of this folder has to have to be an engine; `running.ENGINES` lists those there are.

    Attributes
    ----------
    NOISES : tuple of str
        Kinds of noise that it takes.
    """

    NOISES: tuple[str, ...]

    def problem_of(self, scene, steps_per_cycle, times):
        """Return what its kernels have to know, as a tuple of numbers and arrays.

        Parameters
        ----------
        scene : Scene
        steps_per_cycle : int
            As it was asked for; an engine may take no steps.
        times : ndarray, shape (rows,)
            Times since its begin at which states are wanted in each lap (`grid`): a cycle, or all of a time that does
            not repeat.
        """

    def realize(self, keys, first, cycle, problem, angle, velocity, overturn_time, overturn_side, impacts):
        """Simulate realizations `first`, `first` + 1, ... in parallel, each from its own stream of random numbers.

        Times count from τ = 0, also where the run begins later. A realization depends on its keys and its number alone.

        Parameters
        ----------
        keys : ndarray of uint64, shape (4,)
            From `montecarlo.engines.random.stream_keys`.
        first : int
            Number of the first realization.
        cycle : int
            Number of the lap at which the run begins, from the scene's start. A realization's band noise
            or filtered noise is the same function of time for all of them; white noise is independent.
        problem : tuple
            From `problem_of`.
        angle, velocity : ndarray, shape (count, laps * rows + 1)
            Filled with the states at the begin and at the times wanted, up to overturning; nan before the call.
        overturn_time, overturn_side : ndarray, shape (count,)
            Filled with the time (nan: never) and the side (0: never).
        impacts : Impacts of ndarray, shapes (count,), (count, capacity) and (count, capacity)
            Filled with each realization's impacts; those beyond the capacity are counted and not kept.
        """
