"""Every public entry point, with one argument after another that it does not take: refused by that argument's name."""

import math
import pathlib

import fuzz
import numpy as np
import pytest
from hypothesis import strategies as st

from fpk_rocking import Record, load_scene, solve_fpk
from fpk_rocking.density import Evolution
from fpk_rocking.risk import fragility
from fpk_rocking.studies import grid, sweep
from montecarlo import histories, overturning_rate, simulate, split, tally

BAND = fuzz.scene(noise=fuzz.BandNoise(0.04, (0.0, 10.0), 3))
WHITE = fuzz.scene(noise=fuzz.WhiteNoise(0.006))
SMALL = {"cycles": 1, "realizations": 3}
ENSEMBLE = simulate(WHITE, cycles=2, realizations=40)
TALLY = tally(WHITE, cycles=2, realizations=40)
EDGES = np.linspace(-1.6, 1.6, 5)
LINES = np.linspace(-2.0, 2.0, 5)
EVOLUTION = Evolution(
    WHITE, 0.006, "", 1e-2, WHITE.period * np.arange(3), np.ones(3), np.zeros((3, 2)), np.zeros(3), np.zeros(3), 1e-3,
    1e-3, 0.0, 0.0, 0.0, 0.0, 0.1, {}, np.ones((3, 4, 4, 2, 2)), LINES, LINES, False,
)  # fmt: skip

TOO_MANY = st.integers(2**33, 10**30)
WRONG_SCENES = st.one_of(fuzz.NOT_NUMBERS, fuzz.NUMBERS, st.just(BAND.to_toml()), st.just(BAND.forcing))
WRONG_SEEDS = st.one_of(fuzz.NOT_NUMBERS, st.floats(), st.integers(max_value=-1), st.integers(min_value=2**64))
GIVEN = fuzz.NOT_NUMBERS.filter(lambda x: x is not None)
WRONG_METHODS = st.one_of(GIVEN, fuzz.NUMBERS, st.sampled_from(["RK4", "white "]))
WRONG_STEPS = st.one_of(fuzz.NOT_COUNTS, st.integers(max_value=7), st.integers(min_value=10**6 + 1))
WRONG_PROGRESS = st.one_of(GIVEN.filter(lambda x: x is not int), fuzz.NUMBERS)
WRONG_LEVELS = st.one_of(fuzz.NOT_NUMBERS, fuzz.NOT_FINITE, st.floats(max_value=0.0), st.floats(min_value=1.0))
WRONG_EDGES = st.one_of(
    fuzz.NOT_NUMBERS.filter(lambda x: x is not int and not isinstance(x, list)), fuzz.NOT_FINITE, fuzz.NUMBERS,
    st.lists(st.floats(), max_size=1), st.lists(st.just(0.5), min_size=2, max_size=4),
    st.lists(st.floats(allow_infinity=False), min_size=2).map(lambda x: [*x, math.nan]),
    st.lists(st.floats(-2, 2), min_size=2).map(lambda x: [*sorted(x), -3.0]),
    st.sampled_from([["0", "1"], [[0.0, 1.0]], [[0.0, 1.0], [2.0]], [0j, 1], [math.inf, math.inf], [math.inf, 0.0]]),
)  # fmt: skip
WRONG_CYCLES = st.one_of(fuzz.NOT_NUMBERS, fuzz.NOT_FINITE, st.floats(), st.integers(max_value=-1), st.just(3))
WRONG_PATHS = st.one_of(fuzz.NOT_NUMBERS.filter(lambda x: not isinstance(x, str)), fuzz.NUMBERS, st.just("a\0b"))
FINITE_EDGES = WRONG_EDGES | st.sampled_from([[0.0, math.inf], [-math.inf, 0.0, 1.0]])
SAMPLES = (fuzz.NOT_COUNTS | TOO_MANY).filter(lambda x: x is not None)
OTHER_EDGES, OTHER_PATHS = (bad.filter(lambda x: x is not None) for bad in (FINITE_EDGES, WRONG_PATHS))
RUN = {
    "scene": WRONG_SCENES, "cycles": fuzz.NOT_COUNTS | TOO_MANY, "realizations": fuzz.NOT_COUNTS | TOO_MANY,
    "seed": WRONG_SEEDS, "method": WRONG_METHODS, "steps_per_cycle": WRONG_STEPS, "progress": WRONG_PROGRESS,
}  # fmt: skip
SOLVE = {
    "scene": WRONG_SCENES, "cycles": fuzz.NOT_COUNTS | TOO_MANY, "progress": WRONG_PROGRESS,
    "tol": st.one_of(GIVEN, fuzz.NOT_FINITE, st.floats(max_value=9e-5)),
}  # fmt: skip
STUDY = {
    "workers": fuzz.NOT_COUNTS, "store": OTHER_PATHS, "progress": WRONG_PROGRESS,
    "seed": WRONG_SEEDS.filter(lambda x: not isinstance(x, int) or x < 2**64),
}  # fmt: skip
BINS = {"cycle": WRONG_CYCLES, "angle_edges": WRONG_EDGES, "velocity_edges": WRONG_EDGES}
BINNED = {"cycle": 1, "angle_edges": EDGES, "velocity_edges": EDGES}
KEPT = {"cycle": 1, "angle_edges": TALLY.counts.angle_edges, "velocity_edges": TALLY.counts.velocity_edges}
WRONG_ENSEMBLES = st.one_of(fuzz.NOT_NUMBERS, st.just(WHITE), st.just(EVOLUTION))

NO_LISTS = GIVEN.filter(lambda x: not isinstance(x, list | tuple | np.ndarray))
WRONG_HEIGHTS = st.one_of(
    NO_LISTS, fuzz.NOT_FINITE, fuzz.NUMBERS, st.lists(st.floats(max_value=0.0) | st.just("1"), min_size=1, max_size=3)
)
WRONG_SCALES = WRONG_HEIGHTS | st.sampled_from([[], [1.0, 1.0], [math.nan], [1.0, math.inf]])
WRONG_OVER = st.one_of(
    GIVEN.filter(lambda x: x != {}), fuzz.NUMBERS, st.dictionaries(st.text(max_size=4), st.just([1.0]), min_size=1),
    st.sampled_from([{}, {"size": [1.0]}, {"noise.kind": [1.0]}, {"forcing.phase": []}]),
)  # fmt: skip

ENTRIES = {
    "simulate": (simulate, {"scene": BAND} | SMALL, RUN),
    "tally": (
        tally,
        {"scene": WHITE} | SMALL,
        RUN | {"angle_edges": OTHER_EDGES, "velocity_edges": OTHER_EDGES, "checkpoint": OTHER_PATHS},
    ),
    "histories": (histories, {"scene": BAND} | SMALL, RUN | {"samples_per_cycle": SAMPLES}),
    "split": (
        split,
        {"scene": WHITE, "cycles": 1, "walkers": 10, "repeats": 2},
        {name: RUN[name] for name in RUN if name not in {"realizations", "method"}}
        | {"walkers": RUN["realizations"] | st.integers(1, 9), "repeats": RUN["realizations"] | st.just(1)},
    ),
    "overturning_rate": (
        overturning_rate,
        {"ensemble": ENSEMBLE, "after": 1},
        {"ensemble": WRONG_ENSEMBLES, "after": fuzz.NOT_COUNTS | st.integers(min_value=2), "level": WRONG_LEVELS,
         "side": GIVEN | st.just(0) | st.integers(2) | st.floats(-3.0, 3.0)},
    ),
    "Ensemble.survival_interval": (ENSEMBLE.survival_interval, {}, {"level": WRONG_LEVELS}),
    "Ensemble.bin_probabilities": (ENSEMBLE.bin_probabilities, BINNED, BINS),
    "Tally.bin_probabilities": (TALLY.bin_probabilities, KEPT, BINS),
    "Evolution.bin_probabilities": (EVOLUTION.bin_probabilities, BINNED, BINS),
    # One function saves all kinds of result, and one loads them.
    "Evolution.save": (EVOLUTION.save, {}, {"path": WRONG_PATHS}),
    "Evolution.load": (Evolution.load, {}, {"path": WRONG_PATHS}),
    "Evolution.at": (EVOLUTION.at, {"cycle": 1}, {"cycle": WRONG_CYCLES}),
    "solve_fpk": (solve_fpk, {"scene": WHITE, "cycles": 1, "tol": 1e-2}, SOLVE),
    "load_scene": (load_scene, {}, {"path": WRONG_PATHS}),
    "Record.from_file": (Record.from_file, {"units": "g"}, {"path": WRONG_PATHS}),
    "fragility": (
        fragility,
        {"scale": [0.5, 1.0]} | SMALL | {"scene": BAND},
        STUDY | {"scene": WRONG_SCENES, "scale": WRONG_SCALES, "cycles": fuzz.NOT_COUNTS, "engine": WRONG_METHODS,
         "realizations": fuzz.NOT_COUNTS, "levels": WRONG_HEIGHTS, "over": WRONG_OVER | st.just({"scale": [1.0]}),
         "times": GIVEN | fuzz.NUMBERS},
    ),
    "sweep": (
        sweep,
        {"scenes": [BAND]} | SMALL,
        STUDY | {"scenes": WRONG_SCENES, "task": WRONG_METHODS.filter(lambda x: not callable(x))},
    ),
    "grid": (grid, {"scene": BAND, "axes": {"forcing.phase": [1.0]}}, {"scene": WRONG_SCENES, "axes": WRONG_OVER}),
}  # fmt: skip
ALSO = {
    "over": ("axes", "parameter", "forcing.", "noise."),
    "axes": ("parameter", "forcing.", "noise."),
    "path": ("forcing.file",),
    "cycles": ("realizations", "walkers"),
    "samples_per_cycle": ("realizations",),
    "repeats": ("realizations",),
}
"""Other names that a refusal may bear: a product of two is too large."""


@pytest.mark.parametrize(("entry", "name"), [(entry, name) for entry, (_, _, bad) in ENTRIES.items() for name in bad])
@fuzz.sizes(4, 150)
def test_a_bad_argument_is_refused_by_name(examples, entry, name, tmp_path, monkeypatch):
    call, good, bad = ENTRIES[entry]
    monkeypatch.chdir(tmp_path)

    def claim(value):
        assert fuzz.refused(lambda: call(**good | {name: value}), name, *ALSO.get(name, ()))

    fuzz.hold(examples, claim, value=bad[name])
    assert list(pathlib.Path().iterdir()) == []
