"""Tuned numbers of meshes and time steps of the density, in one table."""

from typing import NamedTuple


class Tuning(NamedTuple):
    """Tuned numbers of the folders `space` and `step`; lengths and times nondimensional.

    Parameters
    ----------
    angle_grading, velocity_grading : float
        Exponents of `graded_lines`: cells are small where impacts are slow.
    growth, tail : float
        Size of a cell over that of the one before, beyond the velocity that blocks from rest reach, and beyond the
        usual motion of a block. 1.6 in place of the second is unstable in one practical block of 24.
    deviations : float
        Standard deviations of the noise that a velocity bound leaves room for: a Gaussian has 6e-16 beyond.
    start_margin : float
        Velocity bound over the speed of the start, at least.
    search_entries : int
        Most entries of a table that finds the cell of a point; more than the finest mesh has.
    least_intensity : float
        Least g² of a diffusion D g²: no mesh resolves a density without noise.
    chatter : float
        Part of a step within which chatter has to end to be summed in closed form, where noise is two kicks of the
        velocity.
    linear_impact, smooth_impact : float
        Speed of an impact over sqrt(2 D h), above which noise is carried by the saltation matrix, and also by the
        expansion about the path without noise. Survival is then within 1.7e-5 of that by whole paths.
    narrow_nodes : int
        Gauss-Hermite nodes of a diffusion far narrower than a cell: moments up to the fifth are exact.
    narrow_part : float
        Part of the velocity's variance that `narrow_nodes` may stand for.
    chunks : int
        Parts of a mesh, each with a buffer of its own: as many threads at most. Results do not depend on it but for
        rounding.
    spare : float
        Space for the paths of later cells, over what is needed now: memory that is not written to costs nothing.
    """

    angle_grading: float = 1.5
    velocity_grading: float = 1.3
    growth: float = 1.15
    tail: float = 1.3
    deviations: float = 8.0
    start_margin: float = 1.2
    search_entries: int = 2**16
    least_intensity: float = 1e-3
    chatter: float = 0.03
    linear_impact: float = 2.0
    smooth_impact: float = 5.0
    narrow_nodes: int = 3
    narrow_part: float = 0.25
    chunks: int = 8
    spare: float = 2.0


TUNING = Tuning()
