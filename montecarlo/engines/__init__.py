"""The Monte Carlo engines, which integrate the realizations of a scene.

An engine is a module with what `Engine` lists, or its own march in place of all from `begin` on. `choice` lists the
engines and chooses one for a scene; `march` makes their kernels; `running` checks the parameters of a run and yields
batches of realizations. `random`, `start` and `shinozuka` draw what they need, `grid` divides time for all of them, and
`approach` and `bounce` are parts of `white`.
"""

from typing import Protocol


class Engine(Protocol):
    """What a module of this folder has to have to be an engine.

    Attributes
    ----------
    METHOD : str
        Name by which a user asks for it.
    RENEWS : bool
        Whether a run that begins at another cycle has noise of its own, and not the same function of time.
    BLOCK : int
        Realizations that follow each other in a thread's working memory.
    """

    METHOD: str
    RENEWS: bool
    BLOCK: int

    def takes(self, scene):
        """Whether it simulates a scene."""

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
            Number of the lap at which the run begins, from the scene's start.
        problem : tuple
            From `problem_of`.
        angle, velocity : ndarray, shape (count, laps * rows + 1)
            Filled with the states at the begin and at the times wanted, up to overturning; nan before the call.
        overturn_time, overturn_side : ndarray, shape (count,)
            Filled with the time (nan: never) and the side (0: never).
        impacts : Impacts of ndarray, shapes (count,), (count, capacity) and (count, capacity)
            Filled with each realization's impacts; those beyond the capacity are counted and not kept.
        """

    def room_of(self, problem):
        """Return the working memory of a thread."""

    def draw(self, stream, problem, room):
        """Draw a start, and what is drawn of the noise before all else; return angle and velocity."""

    def begin(self, stream, x, v, side, cycle, problem, room):
        """Make the noise ready at the begin of a run; return the state at (x, v), in the engine's own variables."""

    def know(self, stream, number, j, cycle, problem, room):
        """Make the force known in interval `number` of the run, j of the lap."""

    def coast(self, state, side, number, j, problem, room):
        """Return whether nothing happens in the interval, and the state at its end if so."""

    def resolve(self, number, j, problem, room):
        """Write the force in the interval as a polynomial, before `look` and `cross`."""

    def look(self, state, side, number, j, share, problem, room):
        """Return angle and velocity after a share of the interval, nan if overturned."""

    def cross(self, state, ahead, side, number, j, cycle, problem, room, impacts):
        """Carry a block on, `ahead` from `coast`; return state, side, and time of overturning (inf: none)."""

    def seen(self, state, side, number, j, problem, room):
        """Return angle and velocity at the end of the interval."""
