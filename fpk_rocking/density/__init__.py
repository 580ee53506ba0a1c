"""The density solver: the joint density of angle and velocity, evolved by finite elements on the phase plane.

In the order of reading: `space` (mesh and polynomials), `step` (one time step and its adjoint), `resolution` (from the
tolerance to mesh and steps), `startup` with `patches` (from the start to the mesh), `propagator` with `periodic`,
`transient` with `sticking`, and `filtered` with `filter_nodes` and `filtered_start` (the loop over steps, for each kind
of scene), `refinement` (from differences to error estimates), `solver` (all of it), `evolution` (the result). Beside
them are `notices` (refusals, warnings, estimated time) and `tuning` (tuned numbers; those of steps are in `space`).
"""

from fpk_rocking.density.evolution import Evolution
from fpk_rocking.density.solver import solve_fpk

__all__ = ["Evolution", "solve_fpk"]
