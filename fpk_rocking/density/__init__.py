"""The density solver: the joint density of angle and velocity, evolved by finite elements on the phase plane."""

from fpk_rocking.density.evolution import Evolution
from fpk_rocking.density.solver import solve_fpk

__all__ = ["Evolution", "solve_fpk"]
