"""The long horizon: the map of densities over one forcing cycle, its modes, and survival from every start."""

from fpk_rocking.horizon.operator import CycleOperator
from fpk_rocking.horizon.plane import PlaneMap, SurvivalEstimate

__all__ = ["CycleOperator", "PlaneMap", "SurvivalEstimate"]
