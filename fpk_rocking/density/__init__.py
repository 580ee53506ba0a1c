"""The density solver: the joint density of angle and velocity, evolved by finite elements on the phase plane.

In the order of reading: `space` (mesh and polynomials), `step` (one time step and its adjoint), `resolution` (from the
tolerance to mesh and steps), `startup` with `patches` (from the start to the mesh), `propagator` (the loop over steps,
and scenes that repeat), `transient` (scenes that do not), `filtered` with `filter_nodes` (filtered noise), `refinement`
(from differences to error estimates; refusals, warnings and estimated time), `solver` (all of it), `evolution` (the
result) and `density` (its density at one time). Every tuned number is in `tuning`.
"""

from fpk_rocking.density.evolution import Evolution
from fpk_rocking.density.solver import solve_fpk

__all__ = ["Evolution", "solve_fpk"]
