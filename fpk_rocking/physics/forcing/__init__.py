"""Forcing: the acceleration of the base f(τ) that drives a block.

Engines do not depend on what a forcing is made of. On an interval that is short enough it is a polynomial piece, given
by Taylor coefficients of the bounded solution P of P'' = P + f, from which the force f = P'' - P and the flight of a
block follow (`fpk_rocking.physics.motion`). `base` says what a forcing is; `periodic` has sums of harmonics,
`transient` what all that ends has, `pulse` and `record` the kinds of it. All is nondimensional, nothing is compiled.
"""

from fpk_rocking.physics.forcing.base import Forcing, refuse_transient, refuse_vertical
from fpk_rocking.physics.forcing.periodic import Harmonic, Harmonics, PeriodicForcing, periodic
from fpk_rocking.physics.forcing.pulse import Chirp, Pulse
from fpk_rocking.physics.forcing.record import Record
from fpk_rocking.physics.forcing.samples import Drift
from fpk_rocking.physics.forcing.transient import TransientForcing

__all__ = [
    "FORCINGS",
    "Chirp",
    "Drift",
    "Forcing",
    "Harmonic",
    "Harmonics",
    "PeriodicForcing",
    "Pulse",
    "Record",
    "TransientForcing",
    "periodic",
    "refuse_transient",
    "refuse_vertical",
]

FORCINGS = {cls.kind: cls for cls in (Harmonic, Harmonics, Pulse, Chirp, Record)}
"""Forcings by their kind; the first is the default of a scene file."""
