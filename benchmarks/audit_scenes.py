"""Scenes of all kinds that the package accepts, drawn at random for `audit.py` without regard to any engine."""

import math
from typing import Any, NamedTuple

import numpy as np

from fpk_rocking.envelopes import Exponential, Table, Trapezoid
from fpk_rocking.forcings import Chirp
from fpk_rocking.physics.forcing.pulse import SHAPES
from fpk_rocking.scene import (
    BandNoise,
    Block,
    Body,
    Dimensions,
    FilteredNoise,
    Forcing,
    Harmonic,
    Harmonics,
    NoNoise,
    Overturning,
    Pulse,
    Record,
    Scene,
    Start,
    WhiteNoise,
)

KINDS = {
    "calm": "`probability` and `simulate` without noise",
    "band": "`probability` under band noise",
    "filtered": "`probability` under filtered noise",
    "white": "`probability` under white noise",
    "density": "`solve_fpk`, white noise, periodic forcing",
    "passing density": "`solve_fpk`, white noise, a pulse, a record or an envelope",
    "filtered density": "`solve_fpk`, filtered noise",
    "operator": "`CycleOperator`",
    "splitting": "`split`",
}
"""What is asked, by kind of row."""
_PERIODIC = "density", "filtered density", "operator", "splitting"
_NOISES = {"calm": "none", "band": "band", "filtered": "filtered", "filtered density": "filtered"}
_LEAST = 0.1
"""Smallest restitution, below the least that white noise takes."""


class Draw(NamedTuple):
    """A scene and until when it is asked for: `cycles`, or the nondimensional time `end` where there are none."""

    scene: Scene
    cycles: int | None
    end: float

    @property
    def rows(self) -> dict[str, Any]:
        """Arguments of the functions that solve a scene."""
        return {"times": [0.5 * self.end, self.end]} if self.cycles is None else {"cycles": self.cycles}

    @property
    def looked_at(self) -> list[int]:
        """Numbers of the rows that are compared: one in the middle, and the last."""
        last = 2 if self.cycles is None else self.cycles
        return sorted({(last + 1) // 2, last})

    def times(self, rows: list[int]) -> np.ndarray:
        """Nondimensional times of some rows."""
        unit = 0.5 * self.end if self.cycles is None else self.scene.forcing.period
        return unit * np.asarray(rows, dtype=float)


def drawn(kind: str, seed: int, number: int) -> Draw:
    """Return the scene of a kind with a number: the same whatever else is drawn."""
    rng = np.random.default_rng([seed, list(KINDS).index(kind), number])
    while True:
        try:
            return _draw(kind, rng)
        except ValueError:  # parts that do not fit, such as a start beyond overturning
            continue


def _draw(kind, rng):
    """Draw the parts of a scene, and for how long it is asked for."""
    envelope = None
    passes = kind not in _PERIODIC and rng.random() < 0.4
    if kind == "passing density":
        passes = rng.random() < 0.6
        envelope = _envelope(rng) if not passes or rng.random() < 0.3 else None
    elif kind not in _PERIODIC and rng.random() < 0.3:
        envelope = _envelope(rng)
    block = _block(rng)
    if kind == "filtered density" and not block.symmetric:
        block = Block(rng.uniform(_LEAST, 0.98))
    forcing = _passing(rng, block) if passes else _periodic(rng)
    noise = _noise(_NOISES.get(kind, "white"), envelope, rng)
    overturning = Overturning(rng.uniform(1.1, 3.0)) if rng.random() < 0.2 else Overturning()
    scene = Scene(block, forcing, noise, _start(rng), overturning)
    if passes:
        return Draw(scene, None, scene.forcing.duration * rng.uniform(0.6, 1.0) + rng.uniform(0.0, 6.0))
    return Draw(scene, int(rng.integers(1, 11)), 0.0)


def _logarithmic(rng, low, high):
    """Draw a number uniformly in its logarithm."""
    return math.exp(rng.uniform(math.log(low), math.log(high)))


def _block(rng) -> Block:
    """Draw a block: slender, exact by its critical angle, a rectangle in metres, or a body of unequal sides."""
    restitution, sort = rng.uniform(_LEAST, 0.98), rng.random()
    if sort < 0.35:
        return Block(restitution)
    if sort < 0.55:
        return Block(restitution, critical_angle=rng.uniform(0.05, 0.6))
    if sort < 0.8:
        width = rng.uniform(0.3, 1.2)
        return Block(None if rng.random() < 0.5 else restitution, Dimensions(width, width * rng.uniform(1.8, 6.0)))
    height, right, left = rng.uniform(0.5, 1.5), *rng.uniform(0.2, 0.5, 2)
    return Block(
        None if rng.random() < 0.5 else (restitution, rng.uniform(0.3, 0.98)),
        body=Body(height, right, left, height * rng.uniform(0.5, 0.7)),
    )


def _periodic(rng) -> Forcing:
    """Draw a forcing that repeats, from none at all to one that overturns at once."""
    frequency, phase, sort = _logarithmic(rng, 0.7, 7.0), rng.uniform(0.0, 2.0 * math.pi), rng.random()
    amplitude = rng.uniform(0.2, 1.5) * math.hypot(1.0, frequency)
    if sort < 0.1:
        return Harmonic(0.0, frequency)
    if sort < 0.8:
        return Harmonic(amplitude, frequency, phase)
    count = int(rng.integers(2, 4))
    parts = amplitude * rng.dirichlet(np.ones(count))
    return Harmonics(frequency, tuple(parts.tolist()), tuple(rng.uniform(0.0, 2.0 * math.pi, count).tolist()))


def _passing(rng, block) -> Forcing:
    """Draw a pulse, a chirp, or a record where the block has a size."""
    frequency, sort = _logarithmic(rng, 0.5, 4.0), rng.random()
    amplitude = rng.uniform(0.8, 1.3) * math.hypot(1.0, frequency)
    if sort < 0.3 and block.size is not None:
        return _record(rng)
    if sort < 0.45:
        return Chirp(amplitude, frequency, _logarithmic(rng, 0.5, 4.0), rng.uniform(5.0, 15.0))
    shape = str(rng.choice(list(SHAPES)))
    return Pulse(shape, amplitude, frequency, int(rng.integers(2, 5)) if shape == "n-sine" else None)


def _record(rng):
    """Draw a table of accelerations: a few sines of random frequency under a hump, with kinks between the samples."""
    interval, count = 0.04, 100
    time = interval * np.arange(count)
    waves = sum(
        rng.normal() * np.sin(2.0 * math.pi * rng.uniform(0.5, 4.0) * time + rng.uniform(0.0, 6.3)) for _ in range(5)
    )
    samples = waves * np.sin(math.pi * time / time[-1])
    samples *= rng.uniform(0.2, 1.2) / np.abs(samples).max()
    return Record(interval, tuple(samples.round(5).tolist()), "g")


def _noise(kind, envelope, rng):
    """Draw a noise of a kind, weak or strong."""
    if kind == "none":
        return NoNoise()
    if kind == "white":
        return WhiteNoise(_logarithmic(rng, 2e-4, 0.3), envelope)
    variance = _logarithmic(rng, 2e-3, 1.0)
    if kind == "band":
        low = rng.uniform(0.0, 2.0) if rng.random() < 0.3 else 0.0
        frequencies = "stratified" if rng.random() < 0.5 else "independent"
        return BandNoise(variance, (low, low + rng.uniform(2.0, 12.0)), 100, "", envelope, frequencies)
    name = str(rng.choice(["exponential", "low-pass", "kanai-tajimi"]))
    damping = None if name == "exponential" else rng.uniform(0.3, 1.0)
    return FilteredNoise(name, variance, _logarithmic(rng, 1.0, 12.0), damping, envelope)


def _envelope(rng):
    """Draw an envelope; tables may be weak throughout a part of the time."""
    sort = rng.random()
    if sort < 0.35:
        return Trapezoid(*rng.uniform(0.5, 6.0, 3).tolist())
    if sort < 0.65:
        return Exponential(rng.uniform(0.5, 6.0))
    values = np.where(rng.random(4) < 0.25, _logarithmic(rng, 2e-3, 0.05), rng.uniform(0.2, 1.5, 4))
    return Table(tuple(np.cumsum(rng.uniform(0.5, 4.0, 4)).tolist()), tuple(values.tolist()))


def _start(rng) -> Start:
    """Draw a start: at rest, a point off rest, or a Gaussian about a point."""
    sort, point = rng.random(), rng.uniform(-0.7, 0.7, 2).tolist()
    if sort < 0.45:
        return Start()
    if sort < 0.75:
        return Start(*point)
    spread, correlation = _logarithmic(rng, 0.03, 0.3), rng.uniform(-0.8, 0.8)
    second = _logarithmic(rng, 0.03, 0.3)
    mixed = correlation * spread * second
    return Start(*(point if rng.random() < 0.7 else (0.0, 0.0)), ((spread**2, mixed), (mixed, second**2)))
