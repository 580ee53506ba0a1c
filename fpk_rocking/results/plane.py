"""The plane of angle and velocity as a reader sees it: in degrees where the size of the block is known."""

import math
from typing import NamedTuple

from fpk_rocking.scene.scene import Scene


class PlaneUnits(NamedTuple):
    """What an angle and a velocity of 1 are on the axes of a picture, and the names of the axes."""

    angle: float = 1.0
    velocity: float = 1.0
    names: tuple[str, str] = ("angle Θ", "velocity dΘ/dτ")


NONDIMENSIONAL = PlaneUnits()


def plane_units(scene: Scene) -> PlaneUnits:
    """Return degrees and degrees a second for a block with dimensions; else nondimensional units."""
    size = scene.block.dimensions
    if size is None:
        return NONDIMENSIONAL
    angle = math.degrees(size.critical_angle)
    return PlaneUnits(angle, angle * size.frequency_parameter, ("angle θ, degrees", "velocity, degrees/s"))
