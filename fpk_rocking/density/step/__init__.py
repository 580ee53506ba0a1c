"""One step of the density in time, and its adjoint: `step` puts together free flight, characteristics and scatter."""

import enum


class Exit(enum.IntEnum):
    """Ways out of the mesh within a step."""

    OVERTURNED_LEFT = -2
    OVERTURNED_RIGHT = -3
    TRUNCATED = -4
    REST = -5
