"""The kinds of block that kernels are compiled for, and small scenes of each, which compile them."""

import dataclasses

from fpk_rocking.physics.forcing import Harmonic, Record
from fpk_rocking.physics.noise.envelope import Trapezoid
from fpk_rocking.physics.noise.kinds import BandNoise, FilteredNoise, Noise, WhiteNoise
from fpk_rocking.scene.parts import Block, Body
from fpk_rocking.scene.scene import Scene
from fpk_rocking.scene.units import Dimensions

_BLOCKS = {
    "slender": Block(0.5),
    "exact": Block(0.5, critical_angle=0.3),
    "unequal": Block((0.5, 0.6), body=Body(1.0, 0.3, 0.32, 0.6)),
}
KINDS = tuple(_BLOCKS)


def kind_of(block: Block) -> str:
    """Return the kind of a block: "slender", "exact", or "unequal", which has unequal sides."""
    if not block.symmetric:
        return "unequal"
    return "exact" if block.critical_angle > 0.0 else "slender"


def least_scenes(kind: str) -> dict[str, Scene]:
    """Return scenes with a kind of block by their noise: "band", "enveloped" (a band), "white", "filtered"."""
    band = BandNoise(0.04, (0.0, 10.0), 4)
    noises: dict[str, Noise] = {
        "band": band,
        "enveloped": dataclasses.replace(band, envelope=Trapezoid(1.0, 1.0, 1.0)),
        "white": WhiteNoise(0.05),
        "filtered": FilteredNoise("low-pass", 0.04, 9.0, 0.7),
    }
    return {name: Scene(_BLOCKS[kind], Harmonic(4.6, 2.7, 0.0), noise) for name, noise in noises.items()}


def least_scene_with_vertical(kind: str) -> Scene:
    """Return a scene under band noise with a kind of block on a base that moves vertically too."""
    record = Record(0.05, (0.0, 4.0, 0.0), "m/s2", vertical=Record(0.05, (0.0, 1.0, 0.0), "m/s2"))
    block = _BLOCKS[kind] if kind == "unequal" else Block(0.5, Dimensions(0.3, 1.0), slender=kind == "slender")
    return Scene(block, record, BandNoise(0.04, (0.0, 10.0), 4))
