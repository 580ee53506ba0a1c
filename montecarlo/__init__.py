"""Ensembles of rocking blocks: Monte Carlo engines, independent of the density solver.

``simulate`` turns a scene into an ``Ensemble``.
"""

from montecarlo.ensemble import Ensemble
from montecarlo.simulation import simulate

__all__ = ["Ensemble", "simulate"]
