"""How fine a solution under filtered noise is: a mesh of the plane, nodes of the filter's states, steps."""

import dataclasses
import math

from fpk_rocking.physics import filters


@dataclasses.dataclass(frozen=True)
class NodeGrid:
    """What a solution of one scene is made with.

    Parameters
    ----------
    plane : Grid
        Mesh and degree for angle and velocity, made for white noise of equal Melnikov variance.
    nodes : tuple of int
        Gauss-Hermite nodes in each state of the filter.
    points : int
        Gauss points of a cell in both axes.
    steps : int
        Steps a cycle, even.
    """

    plane: object
    nodes: tuple
    points: int
    steps: int
