"""Every option of the command line acts: the numbers are those of the call with it, and others than without it."""

import contextlib
import io
import json
import math

import numpy as np
import pytest

from fpk_rocking import cli, options, probability, solve_fpk
from fpk_rocking.compare import compare
from fpk_rocking.density.evolution import Evolution
from fpk_rocking.risk import Fragility, fragility
from fpk_rocking.scene import BandNoise, Block, Harmonic, Pulse, Scene, WhiteNoise
from fpk_rocking.studies.probability import Probability
from montecarlo import Ensemble, Tally, simulate

PERIODIC = Scene(Block(0.5), Harmonic(5.2, 2.7, math.pi), BandNoise(0.09, (0.0, 10.0), 100))
ENDING = Scene(Block(0.8), Pulse("one-sine", 2.0, 2.5), WhiteNoise(0.03))
SAMPLED = {"cycles": 2, "realizations": 200, "seed": 1, "method": "rk4", "steps_per_cycle": 40}
SOLVED = {"cycles": 1, "tol": 0.03, "bins_tol": math.inf}
WHITE = SOLVED | {"noise_replacement": "white"}
SCALED = {"scales": "0.9,1.1", "cycles": 3, "realizations": 200, "seed": 1}
ELSEWHERE = {"help", "version", "out", "report", "json", "checkpoint"}
"""Options that test_cli.py, test_report.py and test_checkpoint.py try."""

OF_RISK = {
    "baseline",
    "corner_hz",
    "records",
    "synthetic",
    "units",
    "interval",
    "component",
    "hazard",
    "site",
    "intensities",
    "measure",
    "name",
    "uncertain",
    "blocks",
    "set",
    "vertical",
    "ground",
    "building",
    "azimuth",
    "depth",
    "events",
    "mass",
    "friction",
}
"""Options that tests/risk, test_drawing.py and test_cli_records.py try."""


def asked(options):
    """Words of the command line for options by name; True stands for one without a value."""
    for name, value in options.items():
        yield f"--{name.replace('_', '-')}"
        if value is not True:
            yield from map(str, value if isinstance(value, list) else [value])


@pytest.fixture
def run(tmp_path):
    """What a command prints as JSON, and what it saves, by its words and options."""

    def command(name, scene, **options):
        (tmp_path / "scene.toml").write_text(scene.to_toml(), encoding="utf-8")
        words = name, str(tmp_path / "scene.toml"), *asked(options), "--json", "--out", str(tmp_path / "out")
        out, err = io.StringIO(), io.StringIO()
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            status = cli.main(list(words))
        assert status == 0, err.getvalue()
        return json.loads(out.getvalue()), tmp_path / "out" / "result.npz"

    return command


def test_no_option_is_left_out():
    """A new one belongs into a test below."""
    commands = next(action for action in cli.command_line()._actions if action.dest == "command").choices
    names = {action.dest for parser in commands.values() for action in parser._actions if action.option_strings}
    tried = {option for option, *_ in (*OF_SAMPLES, *OF_CURVES)}
    tried |= {"tol", "bins_tol"}
    others = {"times", "tally", "noise_replacement", "scales", "pga", "pgv", "workers", "no_check", "rtol", "limit"}
    others |= {"samples_per_cycle", "movie"}  # tests/results/test_movie.py
    assert names - ELSEWHERE - OF_RISK == tried | others


def test_options_of_probability(run):
    options = {"set": "noise.variance=0.05", "cycles": 3, "tol": 0.02, "rtol": 0.3, "seed": 4, "limit": 60}
    values, file = run("probability", PERIODIC, **options)
    answer = Probability.load(file)
    assert (values["tol"], values["rtol"], values["seed"]) == (0.02, 0.3, 4)
    same = probability(PERIODIC.varied(noise={"variance": 0.05}), cycles=3, tol=0.02, rtol=0.3, seed=4)
    assert answer.overturned == same.overturned == values["overturned"] > 0.0
    rows = (file.parent / "probability.csv").read_text().splitlines()
    assert len(rows) == 5
    with pytest.raises(AssertionError, match="limit_s"):
        run("probability", PERIODIC, cycles=3, tol=1e-6, limit=0.1)


OF_SAMPLES = [("cycles", 3), ("realizations", 250), ("seed", 2), ("steps_per_cycle", 60), ("method", "exact")]


@pytest.mark.parametrize(("option", "value"), OF_SAMPLES)
def test_options_of_samples(run, option, value):
    loaded = Ensemble.load(run("mc", PERIODIC, **SAMPLED | {option: value})[1])
    direct, plain = simulate(PERIODIC, **SAMPLED | {option: value}), simulate(PERIODIC, **SAMPLED)
    assert np.array_equal(loaded.angle, direct.angle, equal_nan=True)
    assert not np.array_equal(loaded.angle, plain.angle, equal_nan=True)


@pytest.mark.parametrize("method", ["white", "filtered"])
def test_methods_that_replace_the_noise(run, method, tmp_path):
    loaded = Ensemble.load(run("mc", PERIODIC, **SAMPLED | {"method": method})[1])
    told = io.StringIO()
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(told):
        cli.main(["mc", str(tmp_path / "scene.toml"), *asked(SAMPLED | {"method": method})])
    assert "was replaced by" in " ".join(told.getvalue().split())
    direct = simulate(getattr(PERIODIC, f"{method}_equivalent")(), **SAMPLED | {"method": method})
    assert np.array_equal(loaded.angle, direct.angle, equal_nan=True)


def test_times_and_tallies(run):
    own = {"realizations": 200, "times": [0.7, 3.1, 4.0]}
    loaded = Ensemble.load(run("mc", ENDING, **own)[1])
    assert loaded.times.tolist() == [0.0, 0.7, 3.1, 4.0]
    assert np.array_equal(loaded.angle, simulate(ENDING, **own).angle, equal_nan=True)
    values, path = run("mc", ENDING, **own, tally=True)
    assert Tally.load(path).counts.times.tolist() == [0.0, 0.7, 3.1, 4.0]
    assert values["survival"] == loaded.survival.tolist()


@pytest.fixture(scope="module")
def solved():
    return solve_fpk(PERIODIC, **WHITE)


def test_the_check_of_replaced_noise_can_be_left_out(run, solved):
    """The density that is saved is that of the call, whose tolerances and cycles test_cli.py follows."""
    (checked, _), (plain, file) = (run("fpk", PERIODIC, **WHITE, **option) for option in ({}, {"no_check": True}))
    assert np.array_equal(Evolution.load(file).coefficients, solved.coefficients)
    assert checked["survival"] == plain["survival"]
    assert checked["replacement"]["difference"][1][0] != 0.0
    assert "replacement" not in plain
    assert plain["trust"]["reasons"][0].startswith("Replaced, not checked")
    assert not checked["trust"]["reasons"][0].startswith("Replaced, not checked")


def test_the_noise_replacement_reaches_the_solver(run, solved):
    loaded = Evolution.load(run("fpk", PERIODIC, **SOLVED, noise_replacement="filtered", no_check=True)[1])
    assert "filtered" in loaded.noise_replacement or "low-pass" in loaded.noise_replacement
    assert not np.array_equal(loaded.survival, solved.survival)
    chosen = Evolution.load(run("fpk", PERIODIC, **SOLVED, no_check=True)[1]).settings["replacement"]
    assert "the fastest within 0.03" in chosen["choice"]


def test_times_reach_the_solver(run):
    loaded = Evolution.load(run("fpk", ENDING, times=[0.5, 2.5], tol=0.05)[1])
    assert loaded.times.tolist() == [0.0, 0.5, 2.5]


def test_options_of_both_engines(run, solved):
    """Each engine gets its own, and both get the cycles."""
    both = {"cycles": 1, "seed": 7}
    values, _ = run("compare", PERIODIC, **SAMPLED | WHITE | both)
    direct = compare(simulate(PERIODIC, **SAMPLED | both), solved)
    assert values["survival"] == direct.survival.tolist()
    assert values["l1"] == direct.l1.tolist()


def curve(scales=(0.9, 1.1), **options):
    return fragility(PERIODIC, scale=scales, **options)


OF_CURVES = [
    ("cycles", 4, {"cycles": 4}),
    ("realizations", 300, {"realizations": 300}),
    ("seed", 2, {"seed": 2}),
    ("engine", "white", {"engine": "white"}),
    ("levels", "0.8,1.2", {"levels": (0.8, 1.2)}),
    ("over", "noise.variance=0.01,0.2", {"over": {"noise.variance": (0.01, 0.2)}}),
    ("keep_noise", True, {"scale_noise": False}),
    ("tol", 0.03, {"tol": 0.03}),
    ("store", "rows.jsonl", {}),
]
UNSCALED = {name: value for name, value in SCALED.items() if name != "scales"}


@pytest.mark.parametrize(("option", "value", "meant"), OF_CURVES)
def test_options_of_curves(run, tmp_path, option, value, meant):
    base, own = (SCALED, UNSCALED)
    if option == "tol":
        own = {"cycles": 1, "engine": "density", "scales": (1.1,)}
        base = own | {"scales": "1.1"}
    value = tmp_path / value if option == "store" else value
    loaded = Fragility.load(run("fragility", PERIODIC, **base | {option: value})[1])
    assert np.array_equal(loaded.probability, curve(**own | meant).probability)
    if option == "store":
        assert len((tmp_path / "rows.jsonl").read_text(encoding="utf-8").splitlines()) == 3
    else:
        assert not np.array_equal(loaded.probability, curve(**own).probability)


def test_scales_and_times_of_curves(run):
    """LOW:HIGH:COUNT is spaced evenly in the logarithm; a block that falls after the last time does not count."""
    loaded = Fragility.load(run("fragility", PERIODIC, **SCALED | {"scales": "0.5:2:3"})[1])
    assert loaded.scale == pytest.approx([0.5, 1.0, 2.0])
    early, late = (
        Fragility.load(run("fragility", ENDING, scales="1", realizations=200, times=times)[1]).probability
        for times in ([2.5], [9.0])
    )
    direct = [fragility(ENDING, scale=[1.0], realizations=200, times=times).probability for times in ([2.5], [9.0])]
    assert [early, late] == direct
    assert early < late


def test_peaks_in_g_take_the_place_of_scales(run):
    """Of two racks with other shaking each has the peaks; noise that is kept stays as it was."""
    rack = Scene.from_block(0.5, 1.8, "0.3 g", 1.5, noise_rms_acceleration=0.5, noise_band_hz=(0, 5))
    loaded = Fragility.load(run("fragility", rack, pga="0.4:0.9:2", cycles=2, realizations=300)[1])
    assert loaded.scale.tolist() == [0.4, 0.9]
    direct = fragility(rack, scale=[0.4 / 0.3, 3.0], cycles=2, realizations=300).probability
    assert loaded.probability == pytest.approx(direct, abs=1e-9)
    assert 0.0 < direct.max() < 1.0
    assert [measure.columns(1.0)["pga_g"] for measure in loaded.intensities] == pytest.approx([1.0])
    kept = Fragility.load(run("fragility", rack, pga="0.9", cycles=2, realizations=300, keep_noise=True)[1])
    assert kept.scenes[0].noise == rack.noise
    with pytest.raises(AssertionError, match="accepted: factors, or --pga, --pgv or --intensities in its place"):
        run("fragility", rack, cycles=2)


def test_workers_reach_the_sweep(run):
    with pytest.raises(AssertionError, match="workers: got 0, accepted: a whole number >= 1"):
        run("fragility", PERIODIC, **SCALED, workers=0)


@pytest.mark.parametrize(
    ("text", "value"), [(".1", 0.1), ("-.25", -0.25), (" .5", 0.5), ("0.4 g", "0.4 g"), (".5 g", ".5 g")]
)
def test_a_number_of_set_may_begin_with_a_point(text, value):
    assert options._setting(f"block.restitution={text}") == ("block.restitution", value)
