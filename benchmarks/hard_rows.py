"""The rows of the table of hard cases: the main scene with white noise and one thing changed, and their references."""

import dataclasses
import math
from typing import NamedTuple

import numpy as np
from report import ROOT

from fpk_rocking import load_scene
from fpk_rocking.results import storage
from fpk_rocking.scene import Block, Harmonic, NoNoise, Overturning, Scene, Start, WhiteNoise
from fpk_rocking.scene.axes import joint_edges
from montecarlo import tally

MAIN = load_scene(ROOT / "cases" / "scenes" / "main.toml").white_equivalent()
REFERENCES = ROOT / "tests" / "data" / "hard_cases.npz"
SEED = 11


class Row(NamedTuple):
    """A scene of the table, and how much of a reference it gets.

    `name` says what differs from the main scene and is the key of the reference. `paths` are the realizations of the
    reference, 0 for a scene that is to be refused; it ends after `sampled` of the `cycles` that the solver evolves, and
    keeps the bins after those in `binned`.
    """

    name: str
    scene: Scene
    paths: int = 500_000
    cycles: int = 10
    sampled: int = 10
    binned: tuple = (2, 10)

    @property
    def steps_per_cycle(self):
        """Steps a cycle of the reference, which are no longer than those of the main scene."""
        return math.ceil(200 * max(1.0, self.scene.period / MAIN.period))


def rows():
    """Return every row, in the order of the table.

    More than one thing is changed where the plain change leaves no block standing, or none overturning.
    """

    def row(name, paths=500_000, cycles=10, sampled=None, binned=(2, 10), **parts):
        """Return the `Row` of the main scene with other parts, by their names in a `Scene`."""
        return Row(name, dataclasses.replace(MAIN, **parts), paths, cycles, sampled or cycles, binned)

    def forced(amplitude=MAIN.forcing.amplitude, frequency=MAIN.forcing.frequency, phase=MAIN.forcing.phase):
        """Return the forcing of the main scene with other parameters."""
        return Harmonic(amplitude, frequency, phase)

    weak, strong = WhiteNoise(2.5e-4), WhiteNoise(0.05)
    # Without noise z = 0 is the separatrix (docs/theory.md, section 7): angle and velocity add up to this on it.
    swing = MAIN.forcing.amplitude / math.hypot(1.0, MAIN.forcing.frequency)
    separatrix = 1.0 + swing * math.cos(MAIN.forcing.phase + math.atan(MAIN.forcing.frequency))
    return [
        row("main scene"),
        row("D = 2.5e-5", noise=WhiteNoise(2.5e-5)),
        row("D = 2.5e-4", noise=weak),
        row("D = 0.05", noise=strong),
        row("D = 0.5", noise=WhiteNoise(0.5)),
        *(row(f"e = {e:g}", block=Block(e)) for e in (1.0, 0.9, 0.3, 0.17)),
        *(row(f"e = {e:g}", 0, block=Block(e)) for e in (0.1, 0.0)),
        row("A = 0", 20_000, forcing=forced(0.0)),
        row("A = 0, D = 0.05", 100_000, forcing=forced(0.0), noise=strong),
        row("A = 0.7", 20_000, forcing=forced(0.7)),
        row("A = 0.7, D = 0.05", 100_000, forcing=forced(0.7), noise=strong),
        row("Ω = 0.5", 100_000, cycles=2, binned=(1, 2), forcing=forced(frequency=0.5)),
        row("Ω = 0.5, A = 1.1", 100_000, cycles=3, binned=(1, 2), forcing=forced(1.1, 0.5)),
        row("Ω = 8", forcing=forced(frequency=8.0)),
        row("Ω = 8, A = 35", 2_000_000, forcing=forced(35.0, 8.0)),
        row("start on the separatrix", start=Start(0.3, separatrix - 0.3)),
        row("start at angle 1.5, falling back", start=Start(1.5, -1.4)),
        row("start at rest, f(0) = 0.5, A = 3", 2_000_000, forcing=forced(3.0, phase=math.acos(-0.5 / 3.0))),
        row("start wide", start=Start(0.0, 0.0, ((0.25, 0.05), (0.05, 0.5)))),
        row("500 cycles", cycles=500, sampled=40, binned=(20, 40)),
        row("100 cycles, D = 2.5e-4", 100_000, cycles=100, binned=(20, 100), noise=weak),
        Row("σ = 0", dataclasses.replace(MAIN, noise=NoNoise()), 0),
        row("cut-off 1.4", 2_000_000, overturning=Overturning(1.4)),
        row("cut-off 6", overturning=Overturning(6.0)),
    ]


class Reference(NamedTuple):
    """White-noise Monte Carlo of a row: counts over independent paths.

    `scene` (TOML text), `seed` and `steps_per_cycle`: what was simulated. `standing` (sampled + 1,): paths that have
    not overturned after each cycle, of `paths`. `counts` (2, n_angle, n_velocity): those in each bin after the cycles
    `binned`.
    """

    scene: np.ndarray
    paths: np.ndarray
    seed: np.ndarray
    steps_per_cycle: np.ndarray
    standing: np.ndarray
    binned: np.ndarray
    angle_edges: np.ndarray
    velocity_edges: np.ndarray
    counts: np.ndarray

    def is_of(self, row):
        """Whether this is the reference that a row asks for."""
        return (
            Scene.from_toml(str(self.scene)) == row.scene
            and (int(self.paths), int(self.seed), int(self.steps_per_cycle)) == (row.paths, SEED, row.steps_per_cycle)
            and self.standing.size == row.sampled + 1
            and tuple(self.binned) == row.binned
        )


def simulated(row):
    """Make the reference of a row."""
    edges = joint_edges(row.scene)
    run = tally(
        row.scene,
        cycles=row.sampled,
        realizations=row.paths,
        seed=SEED,
        method="white",
        steps_per_cycle=row.steps_per_cycle,
        angle_edges=edges[0],
        velocity_edges=edges[1],
    )
    settings = row.scene.to_toml(), row.paths, SEED, row.steps_per_cycle
    histogram = run.counts.histogram[list(row.binned)]
    return Reference(*map(np.array, settings), run.survivors, np.array(row.binned), *edges, histogram)


def load():
    """Return the references by the names of their rows; none where there is no file."""
    if not REFERENCES.exists():
        return {}
    with np.load(REFERENCES) as file:
        names = {key.rsplit("/", 1)[0] for key in file}
        return {name: Reference(*(file[f"{name}/{field}"] for field in Reference._fields)) for name in names}


def save(references):
    """Write the file of references, whole or not at all."""
    arrays = {
        f"{name}/{field}": value
        for name, reference in references.items()
        for field, value in reference._asdict().items()
    }
    with storage.replaced_atomically(REFERENCES) as temporary:
        np.savez_compressed(temporary, **arrays)
