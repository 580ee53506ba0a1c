"""From fragility curves to an annual frequency: probability against an intensity of the ground motion, hazard, files.

`at_intensity` scales a scene to an intensity, so that the scales of `fpk_rocking.studies.fragility` are that
intensity. `IntensityCurve.of` reads the curve, over all records of a suite. `annual_frequency` weighs it with a
`Hazard`. `to_nrml` and `to_pelicun` hand it to other programs.
"""

from fpk_rocking.risk.export import to_nrml, to_pelicun
from fpk_rocking.risk.hazard import Hazard
from fpk_rocking.risk.rate import Risk, annual_frequency
from fpk_rocking.risk.study import Study, study
from fpk_rocking.studies.motions import at_intensity
from fpk_rocking.studies.pooled import IntensityCurve

__all__ = [
    "Hazard",
    "IntensityCurve",
    "Risk",
    "Study",
    "annual_frequency",
    "at_intensity",
    "study",
    "to_nrml",
    "to_pelicun",
]
