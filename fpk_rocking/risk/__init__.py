"""From ground motions to an annual frequency: intensities, fragility curves, populations of motions, hazard, files.

``fragility`` computes the probability of overturning as a function of the scale of the shaking, with a lognormal fit.
``critical_intensities`` searches for the intensities at which each motion overturns a block without noise.
``at_intensity`` scales a scene to an intensity; ``intensities`` measures how strong a motion is, and ``ranked`` orders
these measures. ``drawn`` makes scenes of blocks whose values are drawn from distributions, ``synthetic_records`` makes
ground motions, and ``IntensityCurve`` is the curve for their population. ``study`` does it all for a suite of
records, also on an upper floor (``Building``, ``FloorMotion``), ``Designs`` compares several blocks, ``in_plane``
turns two components into a block's plane;
``annual_frequency`` weighs a curve with a ``Hazard``; ``to_nrml`` and ``to_pelicun`` hand it to other
programs. ``calibrated`` fits a block to tests in which it overturned or stood.
"""

from fpk_rocking.risk.anchor import Hold, hold
from fpk_rocking.risk.calibration import Calibration, calibrated
from fpk_rocking.risk.critical import CriticalIntensities, critical_intensities
from fpk_rocking.risk.curves import Fragility, fragility
from fpk_rocking.risk.designs import Designs
from fpk_rocking.risk.export import to_nrml, to_pelicun
from fpk_rocking.risk.floors import Building, FloorMotion
from fpk_rocking.risk.hazard import Hazard
from fpk_rocking.risk.inputs import Draws, drawn, synthetic_records
from fpk_rocking.risk.lognormal import Ranking, ranked
from fpk_rocking.risk.motions import Intensities, at_intensity, intensities
from fpk_rocking.risk.planes import in_plane
from fpk_rocking.risk.population import IntensityCurve
from fpk_rocking.risk.rate import Risk, annual_frequency
from fpk_rocking.risk.spectra import response_spectrum
from fpk_rocking.risk.study import Study, study

__all__ = [
    "Building",
    "Calibration",
    "CriticalIntensities",
    "Designs",
    "Draws",
    "FloorMotion",
    "Fragility",
    "Hazard",
    "Hold",
    "Intensities",
    "IntensityCurve",
    "Ranking",
    "Risk",
    "Study",
    "annual_frequency",
    "at_intensity",
    "calibrated",
    "critical_intensities",
    "drawn",
    "fragility",
    "hold",
    "in_plane",
    "intensities",
    "ranked",
    "response_spectrum",
    "study",
    "synthetic_records",
    "to_nrml",
    "to_pelicun",
]
