"""The time that an engine's tables cover, a *lap*: a cycle, or all that is wanted of a forcing without cycles."""

from typing import NamedTuple

import numpy as np

from fpk_rocking.base import checks

_MOST = 2**22
_NEAR = 1e-9


class Grid(NamedTuple):
    """A lap in intervals.

    `count`: intervals in a lap; `spacing`: duration of one; `marks` (rows,): times since a lap's begin at which states
    are wanted, in intervals, ascending, above 0 and at most `count`; one within rounding of a whole number is it.
    """

    count: int
    spacing: float
    marks: np.ndarray

    @property
    def duration(self):
        """Of a lap."""
        return self.count * self.spacing


def grid_of(scene, longest, times=None):
    """Return the `Grid` of a scene.

    Parameters
    ----------
    scene : Scene
    longest : float
        Longest interval, nondimensional.
    times : ndarray, shape (rows,), optional
        Times since a lap's begin at which states are wanted, by default that of its end. The last one ends the lap
        where the scene does not repeat.

    Raises
    ------
    ValueError
        There would be more than 2^22 intervals.
    """
    times = np.array([scene.period]) if times is None else times
    spacing = scene.forcing.spacing(longest)
    end = scene.period if scene.repeats else times[-1]
    count = int(np.ceil(end / spacing - _NEAR))
    if count > _MOST:
        accepted = f"at most {_MOST} intervals of {spacing:.3g}, which this forcing and noise need"
        raise ValueError(checks.refusal("scene" if scene.repeats else "times", f"a duration of {end:g}", accepted))
    marks = times / spacing
    whole = np.rint(marks)
    return Grid(count, spacing, np.where(np.abs(marks - whole) < _NEAR, whole, marks))
