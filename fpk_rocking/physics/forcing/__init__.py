"""Forcing: the base acceleration f(τ) that drives a block, in polynomial pieces, and its properties as a whole.

The engines do not depend on what a forcing is made of. On an interval that is short enough it is a polynomial piece,
given by the coefficients of the bounded particular solution P of P'' = P + f in the time since some instant; from those
follow the force f = P'' - P itself, its slope, and the flight of a block under it (`fpk_rocking.physics.motion`). The
rest are properties of the forcing as a whole: its period (None where it does not repeat), its symmetry, how large it
gets, and when it lifts a block off. `base` says what a forcing is; `periodic` has sums of harmonics, `transient` what
all that ends has, and `pulse` and `record` the kinds of it.

All quantities are nondimensional. This package makes values; it is not compiled.
"""

from fpk_rocking.physics.forcing.base import Force, Forcing, refuse_transient
from fpk_rocking.physics.forcing.periodic import Harmonic, Harmonics, PeriodicForcing, periodic
from fpk_rocking.physics.forcing.pulse import Chirp, Pulse
from fpk_rocking.physics.forcing.record import Record
from fpk_rocking.physics.forcing.samples import Drift
from fpk_rocking.physics.forcing.transient import TransientForcing

__all__ = [
    "FORCINGS",
    "Chirp",
    "Drift",
    "Force",
    "Forcing",
    "Harmonic",
    "Harmonics",
    "PeriodicForcing",
    "Pulse",
    "Record",
    "TransientForcing",
    "periodic",
    "refuse_transient",
]

FORCINGS = {cls.kind: cls for cls in (Harmonic, Harmonics, Pulse, Chirp, Record)}
"""Forcings by their kind; the first is the default of a scene file."""
