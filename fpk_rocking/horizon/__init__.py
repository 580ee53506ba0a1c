"""The long horizon: the map of densities over one forcing cycle, its modes, and survival from every start."""

from fpk_rocking.density.density import PlaneMap
from fpk_rocking.horizon.modes import SurvivalEstimate
from fpk_rocking.horizon.operator import CycleOperator

__all__ = ["CycleOperator", "PlaneMap", "SurvivalEstimate"]
