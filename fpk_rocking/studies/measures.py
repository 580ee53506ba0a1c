"""Intensity measures: how strong a motion is, in one number."""

import math
from typing import NamedTuple

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.physics.forcing import Forcing, Harmonics
from fpk_rocking.scene.scene import Scene

_HALVINGS = 50


class Intensities(NamedTuple):
    """Intensity measures of the forcing of a scene, without its noise.

    Parameters
    ----------
    acceleration : float
        Largest |f|: the peak ground acceleration over g θ_cr.
    velocity : float
        Largest |∫f dτ|: the peak ground velocity over g θ_cr / p.
    pga, pgv : float
        Peak ground acceleration, m/s², and velocity, m/s; nan for a block without dimensions.
    relative_velocity : float
        p PGV / (g tan θ_cr) (E. G. Dimitrakopoulos, T. S. Paraskeva, "Dimensionless fragility curves for rocking
        response to near-fault excitations", Earthquake Eng. Struct. Dyn. 44(12), 2015-2033, 2015). A block without
        dimensions counts as slender, tan θ_cr = θ_cr.
    """

    acceleration: float
    velocity: float
    pga: float
    pgv: float
    relative_velocity: float


def intensities(scene: Scene) -> Intensities:
    """Return the intensity measures of a scene's forcing.

    The ground velocity of a periodic forcing has mean 0; that of a pulse or a record is 0 at τ = 0.

    Parameters
    ----------
    scene : Scene
        Its forcing is measured; block dimensions give the measures with units.

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
    """Largest |∫f dτ|."""
    if forcing.period is None:
        return _reached(forcing)
    # The integral of each harmonic is a harmonic, of amplitude A_k/(kΩ) and a quarter cycle late.
    omega = forcing.frequency
    parts = [(amplitude / (k * omega), phase - 0.5 * math.pi) for k, amplitude, phase in forcing.components]
    if not any(amplitude for amplitude, _ in parts):
        return 0.0
    return parts[0][0] if isinstance(forcing, Forcing) else Harmonics(omega, *zip(*parts, strict=True)).largest


def _reached(forcing):
    """Largest |∫f dτ| of a motion that ends, from polynomial pieces: at their ends, and where f changes its sign."""
    spacing = forcing.spacing(forcing.longest_piece)
    force = forcing.series(np.arange(round(forcing.duration / spacing)) * spacing)
    order = np.arange(force.shape[1])
    gain = (force * spacing ** (order + 1) / (order + 1)).sum(axis=1)
    velocity = np.concatenate([[0.0], np.cumsum(gain)])
    end = (force * spacing**order).sum(axis=1)
    turning = np.flatnonzero(force[:, 0] * end < 0.0)
    low, high = np.zeros(turning.size), np.full(turning.size, spacing)
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        before = (force[turning] * middle[:, None] ** order).sum(axis=1) * force[turning, 0] > 0.0
        low, high = np.where(before, middle, low), np.where(before, high, middle)
    turns = velocity[turning] + (force[turning] * low[:, None] ** (order + 1) / (order + 1)).sum(axis=1)
    return float(np.abs(np.concatenate([velocity, turns])).max())
