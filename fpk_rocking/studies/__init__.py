"""Studies over many scenes, by either engine: sweeps, and fragility curves. And both engines on one scene.

``sweep`` runs Monte Carlo, the density solver or a function of your own on every scene of a list or a grid, on one
machine or on a cluster. ``fragility`` computes the probability of overturning as a function of the scale of the
shaking, with a lognormal fit. ``drawn`` makes scenes of blocks whose values are drawn from distributions, and
``dispersions`` says what each value scatters. ``synthetic_records`` makes ground motions, ``intensities`` measures how
strong a motion is, and ``ranked`` orders these measures. ``solve_checked`` solves for the density of a scene and
measures by sampling what the replacement of its noise changes, and ``slenderness_cost`` what it changes to take a block
as slender.
"""

from fpk_rocking.studies.checking import checked, solve_checked
from fpk_rocking.studies.curves import fragility
from fpk_rocking.studies.drawing import Draws, dispersions, drawn
from fpk_rocking.studies.measures import Intensities, intensities
from fpk_rocking.studies.ranking import Ranking, ranked
from fpk_rocking.studies.result import Fragility
from fpk_rocking.studies.scenes import Grid, grid, resized, scaled
from fpk_rocking.studies.slenderness import SlendernessCost, slenderness_cost
from fpk_rocking.studies.suites import synthetic_records
from fpk_rocking.studies.sweeping import Sweep, sweep

__all__ = [
    "Draws",
    "Fragility",
    "Grid",
    "Intensities",
    "Ranking",
    "SlendernessCost",
    "Sweep",
    "checked",
    "dispersions",
    "drawn",
    "fragility",
    "grid",
    "intensities",
    "ranked",
    "resized",
    "scaled",
    "slenderness_cost",
    "solve_checked",
    "sweep",
    "synthetic_records",
]
