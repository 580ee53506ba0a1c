"""Studies of many scenes by either engine: sweeps; of one scene, checks of a density and of slenderness.

``sweep`` runs Monte Carlo, the density solver or a function of your own on every scene of a list or a grid, on one
machine or on a cluster. ``checked`` measures by sampling what the replacement of noise changes of a density, and
``slenderness_cost`` what it changes to take a block as slender.
"""

from fpk_rocking.studies.scenes import Grid, grid, resized, scaled
from fpk_rocking.studies.sweeping import Sweep, sweep
from fpk_rocking.studies.tasks import SlendernessCost, checked, slenderness_cost

__all__ = ["Grid", "SlendernessCost", "Sweep", "checked", "grid", "resized", "scaled", "slenderness_cost", "sweep"]
