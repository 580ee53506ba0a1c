"""The problem as a frozen value: its parts, its TOML form, its units, and the range that the engines accept."""

from fpk_rocking.physics.forcing import Forcing, Harmonic, Harmonics, Pulse, Record
from fpk_rocking.scene.parts import BandNoise, Block, FilteredNoise, NoNoise, Overturning, Start, WhiteNoise
from fpk_rocking.scene.scene import Scene, load_scene
from fpk_rocking.scene.units import Dimensions

__all__ = [
    "BandNoise",
    "Block",
    "Dimensions",
    "FilteredNoise",
    "Forcing",
    "Harmonic",
    "Harmonics",
    "NoNoise",
    "Overturning",
    "Pulse",
    "Record",
    "Scene",
    "Start",
    "WhiteNoise",
    "load_scene",
]
