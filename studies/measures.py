"""Intensity measures: how strong a motion is, in one number."""

import math
from typing import NamedTuple

from fpk_rocking.base import checks
from fpk_rocking.physics.forcing import Forcing, Harmonics
from fpk_rocking.scene.scene import Scene


class Intensities(NamedTuple):
    """Measures of the forcing of a scene, without its noise.

    `acceleration`: largest |f|, the peak acceleration over g θ_cr. `velocity`: largest |∫f dτ|, the peak velocity over
    g θ_cr / p. `pga`, m/s², and `pgv`, m/s: the same with units; nan for a block without dimensions.
    `relative_velocity`: p PGV / (g tan θ_cr) (E. G. Dimitrakopoulos, T. S. Paraskeva, "Dimensionless fragility curves
    for rocking response to near-fault excitations", Earthquake Eng. Struct. Dyn. 44(12), 2015-2033, 2015); without
    dimensions as of a slender block, tan θ_cr = θ_cr.
    """

    acceleration: float
    velocity: float
    pga: float
    pgv: float
    relative_velocity: float


def intensities(scene):
    """Return the `Intensities` of a scene's forcing; the velocity of a periodic one has no mean.

    Parameters
    ----------
    scene : Scene

    Returns
    -------
    Intensities
    """
    forcing, size = checks.instance("scene", scene, Scene).forcing, scene.block.dimensions
    acceleration, velocity = forcing.largest, _velocity(forcing)
    if size is None:
        return Intensities(acceleration, velocity, math.nan, math.nan, velocity)
    unit = size.gravity * size.critical_angle
    pgv = velocity * unit / size.frequency_parameter
    relative = velocity * size.critical_angle / math.tan(size.critical_angle)
    return Intensities(acceleration, velocity, acceleration * unit, pgv, relative)


def _velocity(forcing):
    """Largest |∫f dτ|: the integral of each harmonic is a harmonic, of amplitude A_k/(kΩ) and a quarter cycle late."""
    omega = forcing.frequency
    parts = [(amplitude / (k * omega), phase - 0.5 * math.pi) for k, amplitude, phase in forcing.components]
    if not any(amplitude for amplitude, _ in parts):
        return 0.0
    if isinstance(forcing, Forcing):
        return parts[0][0]
    return Harmonics(omega, *zip(*parts, strict=True)).largest
