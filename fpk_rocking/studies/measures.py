"""Intensity measures: how strong a motion is, in one number."""

import math
from typing import NamedTuple

from fpk_rocking.base import checks
from fpk_rocking.scene.scene import Scene
from fpk_rocking.scene.units import STANDARD_GRAVITY


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

    def columns(self, scale: float) -> dict[str, float]:
        """Return the measures at a scale by names that say their units, for tables."""
        return {
            "acceleration": scale * self.acceleration,
            "velocity": scale * self.velocity,
            "pga_g": scale * self.pga / STANDARD_GRAVITY,
            "pgv_m_per_s": scale * self.pgv,
            "relative_velocity": scale * self.relative_velocity,
        }

    def at(self, scale: float) -> str:
        """Return peak acceleration and velocity at a scale as a text; empty for a block without dimensions."""
        found = {"PGA {:.4g} g": self.pga / STANDARD_GRAVITY, "PGV {:.4g} m/s": self.pgv}
        return ", ".join(text.format(scale * value) for text, value in found.items() if math.isfinite(value))


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
    acceleration, velocity = forcing.largest, forcing.largest_velocity
    if size is None:
        return Intensities(acceleration, velocity, math.nan, math.nan, velocity)
    unit = size.gravity * size.critical_angle
    pgv = velocity * unit / size.frequency_parameter
    relative = velocity * size.critical_angle / math.tan(size.critical_angle)
    return Intensities(acceleration, velocity, acceleration * unit, pgv, relative)
