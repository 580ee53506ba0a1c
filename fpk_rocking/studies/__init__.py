"""Studies over many scenes, by either engine: sweeps, and fragility curves. And both engines on one scene.

``sweep`` runs Monte Carlo, the density solver or a function of your own on every scene of a list or a grid, on one
machine or on a cluster. ``fragility`` computes the probability of overturning as a function of the scale of the
shaking, with a lognormal fit. ``critical_intensities`` searches for the intensities at which each motion overturns a
block without noise. ``drawn`` makes scenes of blocks whose values are drawn from distributions, and ``IntensityCurve``
is the curve for others of their kind. ``synthetic_records`` makes ground motions, ``intensities`` measures how strong a
motion is, and ``ranked`` orders these measures. ``calibrated`` fits a block to tests in which it overturned or stood.
``checked`` measures by sampling what the replacement of noise changes of a density,
and ``slenderness_cost`` what it changes to take a block as slender.
"""

from fpk_rocking.studies.calibration import calibrated
from fpk_rocking.studies.critical import CriticalIntensities, critical_intensities
from fpk_rocking.studies.curves import fragility
from fpk_rocking.studies.drawing import Draws, drawn, synthetic_records
from fpk_rocking.studies.lognormal import Ranking, ranked
from fpk_rocking.studies.motions import Intensities, intensities
from fpk_rocking.studies.pooled import IntensityCurve
from fpk_rocking.studies.posterior import Calibration
from fpk_rocking.studies.result import Fragility
from fpk_rocking.studies.scenes import Grid, grid, resized, scaled
from fpk_rocking.studies.sweeping import Sweep, sweep
from fpk_rocking.studies.tasks import SlendernessCost, checked, slenderness_cost

__all__ = [
    "Calibration",
    "CriticalIntensities",
    "Draws",
    "Fragility",
    "Grid",
    "Intensities",
    "IntensityCurve",
    "Ranking",
    "SlendernessCost",
    "Sweep",
    "calibrated",
    "checked",
    "critical_intensities",
    "drawn",
    "fragility",
    "grid",
    "intensities",
    "ranked",
    "resized",
    "scaled",
    "slenderness_cost",
    "sweep",
    "synthetic_records",
]
