"""Studies over many scenes, by either engine: sweeps, and fragility curves.

``sweep`` runs Monte Carlo, the density solver or a function of your own on every scene of a list or a grid, on one
machine or on a cluster. ``fragility`` computes the probability of overturning as a function of the scale of the
shaking, with a lognormal fit. ``intensities`` are the usual measures of how strong a motion is.
"""

from studies.curves import fragility
from studies.measures import Intensities, intensities
from studies.result import Fragility
from studies.scenes import Grid, grid, resized, scaled
from studies.sweeping import Sweep, sweep

__all__ = [
    "Fragility",
    "Grid",
    "Intensities",
    "Sweep",
    "fragility",
    "grid",
    "intensities",
    "resized",
    "scaled",
    "sweep",
]
