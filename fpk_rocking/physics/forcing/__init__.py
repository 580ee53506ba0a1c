"""Forcing: the base acceleration f(τ) that drives a block, in polynomial pieces, and its properties as a whole.

The engines do not depend on what a forcing is made of. On an interval that is short enough it is a polynomial piece,
given by the coefficients of the bounded particular solution P of P'' = P + f in the time since some instant; from those
follow the force f = P'' - P itself, its slope, and the flight of a block under it (`fpk_rocking.physics.motion`). The
rest are properties of the forcing as a whole: its period (None where it does not repeat), its symmetry, how large it
gets, and when it lifts a block off. `periodic` has sums of harmonics, `transient` and `record` what ends.

All quantities are nondimensional. This package makes values; it is not compiled.
"""

from fpk_rocking.physics.forcing.periodic import Forcing, Harmonics, PeriodicForcing
from fpk_rocking.physics.forcing.record import Record
from fpk_rocking.physics.forcing.transient import Pulse, TransientForcing, refuse_transient

__all__ = [
    "FORCINGS",
    "Forcing",
    "Harmonics",
    "PeriodicForcing",
    "Pulse",
    "Record",
    "TransientForcing",
    "refuse_transient",
]

FORCINGS = {cls.kind: cls for cls in (Forcing, Harmonics, Pulse, Record)}
"""Forcings by their kind; the first is the default of a scene file."""
