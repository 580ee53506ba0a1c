"""The problem as a frozen value: its parts, its TOML form, its units, and the range that the engines accept."""

from fpk_rocking.physics.forcing import Forcing, Harmonic, Harmonics, Pulse, Record
from fpk_rocking.physics.noise.filters import CloughPenzien, Filter, LinearFilter
from fpk_rocking.physics.noise.kinds import BandNoise, FilteredNoise, NoNoise, WhiteNoise
from fpk_rocking.physics.noise.state_space import StateSpace
from fpk_rocking.scene.parts import Block, Body, Overturning, Start
from fpk_rocking.scene.scene import Scene, load_scene
from fpk_rocking.scene.units import Dimensions

__all__ = [
    "BandNoise",
    "Block",
    "Body",
    "CloughPenzien",
    "Dimensions",
    "Filter",
    "FilteredNoise",
    "Forcing",
    "Harmonic",
    "Harmonics",
    "LinearFilter",
    "NoNoise",
    "Overturning",
    "Pulse",
    "Record",
    "Scene",
    "Start",
    "StateSpace",
    "WhiteNoise",
    "load_scene",
]
