"""One step of the density in time, and its adjoint: `step` puts together free flight, characteristics and scatter."""

import enum


class Exit(enum.IntEnum):
    """Ways out of the mesh within a step.

    An exit flags the end of a path in place of its side, -1 or 1, and all exits are below these. It stands in place of
    a target cell too. `OVERTURNED_LEFT - exit` is its place among the absorbed masses.
    """

    OVERTURNED_LEFT = -2
    OVERTURNED_RIGHT = -3
    TRUNCATED = -4
    REST = -5
