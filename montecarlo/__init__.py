"""Ensembles of rocking blocks: Monte Carlo engines, independent of the density solver.

`simulate` keeps every realization of a scene, `tally` keeps only counts, `histories` keeps time histories with their
impacts; `split` estimates small probabilities of overturning. The other functions are statistics of realizations.
"""

from montecarlo.forces import ContactForces, contact_forces
from montecarlo.poincare import correlation_dimension, mean_poincare_map, restarted_poincare_map
from montecarlo.results.ensemble import Ensemble, Histories
from montecarlo.results.statistics import bin_errors, first_passage, impact_speeds, overturning_rate
from montecarlo.results.tally import Tally
from montecarlo.simulation import histories, simulate, tally
from montecarlo.splitting import Splitting, split

__all__ = [
    "ContactForces",
    "Ensemble",
    "Histories",
    "Splitting",
    "Tally",
    "bin_errors",
    "contact_forces",
    "correlation_dimension",
    "first_passage",
    "histories",
    "impact_speeds",
    "mean_poincare_map",
    "overturning_rate",
    "restarted_poincare_map",
    "simulate",
    "split",
    "tally",
]
