"""The command line: what it prints, writes, refuses and leaves behind, with engines of a known law in place."""

import contextlib
import ctypes
import io
import json
import math
import os
import pathlib
import signal
import sys
import time
import types

import fakes
import pytest

import fpk_rocking.density
from fpk_rocking import cli, load_scene
from fpk_rocking.output import vtk
from fpk_rocking.studies import tasks

MAIN = pathlib.Path(__file__).parents[2] / "cases" / "scenes" / "main.toml"


class Engines:
    """Stand-ins that keep what they were called with."""

    def __init__(self):
        self.calls, self.checks = [], []

    def solve_fpk(self, scene, *, cycles, tol=1e-3, bins_tol=None, noise_replacement="white", progress=None):
        self.calls.append(
            {"scene": scene, "cycles": cycles, "tol": tol, "bins_tol": bins_tol, "noise_replacement": noise_replacement}
        )
        progress(1, 1)
        return fakes.FakeEvolution(scene, cycles=cycles)

    def simulate(self, scene, *, cycles, realizations, seed=1, method=None, steps_per_cycle=200, progress=None):
        own = {"realizations": realizations, "seed": seed, "method": method, "steps_per_cycle": steps_per_cycle}
        self.calls.append({"scene": scene, "cycles": cycles} | own)
        progress(1, 1)
        kind = method or ("white" if scene.noise.kind == "white" else "rk4")
        return fakes.FakeEnsemble(scene, cycles=cycles, **own | {"method": kind})

    def tally(self, scene, *, checkpoint=None, **asked):
        result = self.simulate(scene, **asked)
        self.calls[-1]["checkpoint"] = checkpoint
        return result

    def check(self, scene, *, cycles, realizations, seed, progress):
        self.checks.append({"scene": scene, "cycles": cycles, "realizations": realizations, "seed": seed})
        progress(1, 1)
        return fakes.FakeEnsemble(scene, cycles=cycles, realizations=realizations, seed=seed, method="exact")


@pytest.fixture(autouse=True)
def engines(monkeypatch):
    stands = Engines()
    monkeypatch.setattr(fpk_rocking.density, "solve_fpk", stands.solve_fpk, raising=False)
    monkeypatch.setattr(fpk_rocking.density, "Evolution", fakes.FakeEvolution, raising=False)
    package = types.SimpleNamespace(simulate=stands.simulate, tally=stands.tally)
    package.Ensemble = package.Tally = fakes.FakeEnsemble
    monkeypatch.setitem(sys.modules, "montecarlo", package)
    monkeypatch.setattr(tasks, "simulate", stands.check)
    return stands


def run(*arguments):
    """Exit status, standard output and standard error of one command."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            status = cli.main([str(argument) for argument in arguments])
        except SystemExit as left:
            status = left.code
    return status, out.getvalue(), err.getvalue()


def test_fpk_prints_one_json_object(engines):
    status, out, err = run("fpk", MAIN, "--json", "--cycles", 3, "--tol", 1e-2, "--bins-tol", "inf")
    values = json.loads(out)
    assert (status, err) == (0, "")
    assert values["survival"] == pytest.approx([0.9**k for k in range(4)])
    assert {"wall_s", "error_estimate", "mass_defect", "negative_mass"} <= set(values)
    asked = {"cycles": 3, "tol": 1e-2, "bins_tol": math.inf, "noise_replacement": "white"}
    assert engines.calls == [{"scene": load_scene(MAIN)} | asked]


def test_noise_that_was_replaced_is_sampled_beside_the_density(engines):
    """Also by `compare`, unless its own ensemble has the noise of the scene and enough paths."""
    asked = {"scene": load_scene(MAIN), "cycles": 3, "realizations": 40_000, "seed": 2}
    for words in (["fpk", MAIN], ["compare", MAIN], ["compare", MAIN, "--method", "white", "--realizations", 50_000]):
        status, out, _ = run(*words, "--cycles", 3)
        assert (status, engines.checks.pop()) == (0, asked)
        assert "40,000 paths under the noise of the scene (exact, seed 2," in " ".join(out.split())
    _, out, _ = run("compare", MAIN, "--realizations", 40_000, "--seed", 5, "--method", "exact", "--cycles", 3)
    assert "40,000 paths under the noise of the scene (exact, seed 5," in " ".join(out.split())
    _, out, _ = run("fpk", MAIN, "--no-check", "--cycles", 3)
    assert "trust: caution. Replaced, not checked" in out
    assert engines.checks == []


def test_mc_prints_one_json_object(engines):
    options = {"--cycles": 3, "--realizations": 500, "--seed": 9, "--method": "rk4", "--steps-per-cycle": 100}
    status, out, _ = run("mc", MAIN, "--json", *(part for pair in options.items() for part in pair))
    values = json.loads(out)
    assert status == 0
    assert len(values["interval"]) == 4
    assert values["wall_s"] == 2.5
    asked = {"realizations": 500, "seed": 9, "method": "rk4", "steps_per_cycle": 100}
    assert engines.calls == [{"scene": load_scene(MAIN), "cycles": 3} | asked]


def test_a_tally_is_asked_for_in_place_of_an_ensemble(engines, tmp_path):
    run("mc", MAIN, "--tally", "--cycles", 2)
    run("compare", MAIN, "--tally", "--checkpoint", tmp_path / "state.npz", "--cycles", 2)
    assert [call.get("checkpoint", "none") for call in engines.calls] == [None, "none", tmp_path / "state.npz"]


def test_defaults(engines):
    run("compare", MAIN)
    solved, simulated = engines.calls
    assert (solved["cycles"], solved["tol"], solved["bins_tol"]) == (40, 1e-3, None)
    assert (simulated["cycles"], simulated["realizations"], simulated["seed"]) == (40, 10_000, 1)
    assert (simulated["method"], simulated["steps_per_cycle"]) == (None, 200)


def test_zeros_are_not_taken_for_defaults(engines):
    """A seed may be 0; what may not is refused by the engines."""
    run("mc", MAIN, "--seed", 0, "--cycles", 0)
    run("fpk", MAIN, "--tol", 0, "--cycles", 0)
    simulated, solved = engines.calls
    assert (simulated["seed"], simulated["cycles"]) == (0, 0)
    assert (solved["tol"], solved["cycles"]) == (0.0, 0)


def test_tables_go_to_standard_output():
    for command in ("fpk", "mc", "compare"):
        status, out, err = run(command, MAIN, "--cycles", 2)
        assert (status, err) == (0, "")
        assert "0.81" in out
        assert "inferred from its Figs" in out


def test_white_method_replaces_band_noise_and_says_so(engines):
    status, out, _ = run("compare", MAIN, "--method", "white", "--cycles", 2, "--json")
    assert status == 0
    assert engines.calls[1]["scene"] == load_scene(MAIN).white_equivalent()
    assert any("white noise, diffusion" in remark for remark in json.loads(out)["remarks"])


def test_files_of_each_command(tmp_path):
    run("fpk", MAIN, "--cycles", 4, "--out", tmp_path / "fpk")
    series = {"jpdf.pvd", *(f"jpdf_{cycle:04d}.vtu" for cycle in (0, 1, 2, 4))}
    assert {path.name for path in (tmp_path / "fpk").iterdir()} == series | {"result.npz", "summary.json"}
    run("mc", MAIN, "--cycles", 4, "--out", tmp_path / "mc")
    assert {path.name for path in (tmp_path / "mc").iterdir()} == {"result.npz", "summary.json"}
    run("compare", MAIN, "--cycles", 4, "--out", tmp_path / "both")
    files = {"density.npz", "ensemble.npz", "survival.png", "summary.json"}
    assert {path.name for path in (tmp_path / "both").iterdir()} == files


def test_two_saved_results_compare_as_the_live_ones(tmp_path):
    _, live, _ = run("compare", MAIN, "--cycles", 4, "--json", "--out", tmp_path)
    status, saved, _ = run("compare", tmp_path / "ensemble.npz", tmp_path / "density.npz", "--json")
    assert status == 0
    assert json.loads(saved) == json.loads(live)
    assert json.loads((tmp_path / "summary.json").read_text(encoding="utf-8")) == json.loads(live)


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (["fpk", "missing.toml"], "missing.toml"),
        (["fpk", MAIN, "--cycles", "two"], "--cycles"),
        (["fpk", "saved.npz"], "SCENE"),
        (["mc", MAIN, "--nonsense"], "--nonsense"),
        (["compare", MAIN, MAIN, MAIN], "inputs"),
        (["compare", MAIN, MAIN], "main.toml"),
        (["compare", "a.npz", "b.npz", "--tol", "1e-3"], "--tol"),
        (["compare", "a.npz", "b.npz", "--tally"], "--tally"),
        (["compare", "a.npz", "b.npz", "--no-check"], "--no-check"),
        (["compare", "a.npz", "b.npz"], "a.npz"),
        (["mc", MAIN, "--checkpoint", "state.npz"], "--checkpoint: got 'state.npz', accepted: together with --tally"),
        (["fpk", MAIN, "--out", __file__], "--out"),
        ([], "COMMAND"),
    ],
)
def test_bad_input_is_one_line_that_names_it(arguments, named):
    status, out, err = run(*arguments)
    assert status == 2
    assert out == ""
    assert err.count("\n") == 1
    assert named in err


def test_bad_scene_is_named(tmp_path):
    path = tmp_path / "bad.toml"
    path.write_text(MAIN.read_text(encoding="utf-8").replace("variance = 0.04", "variance = -1.0"), encoding="utf-8")
    status, out, err = run("mc", path)
    assert (status, out) == (2, "")
    assert "noise.variance: got -1.0" in err
    assert err.count("\n") == 1


def test_interrupted_engine_leaves_nothing(tmp_path, monkeypatch):
    def interrupted(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr(fpk_rocking.density, "solve_fpk", interrupted, raising=False)
    status, out, err = run("fpk", MAIN, "--out", tmp_path / "out")
    assert (status, out) == (130, "")
    assert "interrupted" in err
    assert not (tmp_path / "out").exists()


@ctypes.CFUNCTYPE(None, ctypes.c_int)
def swallowing(sign):
    """A callback from C, as LLVM calls one when a kernel is compiled: no exception passes it."""
    signal.raise_signal(sign)


@pytest.mark.usefixtures("interruptible")
@pytest.mark.parametrize("then", ["computes", "returns", "fails"])
@pytest.mark.parametrize(
    ("sign", "code", "word"), [(signal.SIGINT, 130, "interrupted"), (signal.SIGTERM, 143, "terminated")]
)
def test_a_signal_that_a_callback_swallows_ends_the_command(sign, code, word, then, tmp_path, monkeypatch):
    """Once or twice in callbacks; what comes next is the signal, raised anew, whatever the engine does meanwhile."""

    def solve_fpk(scene, **_):
        swallowing(sign)
        if then != "fails":
            swallowing(sign)
        end = time.monotonic() + 10.0
        while then == "computes" and time.monotonic() < end:
            pass
        if then == "fails":
            raise RuntimeError("no compiled object yet")
        return fakes.FakeEvolution(scene, cycles=4)

    monkeypatch.setattr(fpk_rocking.density, "solve_fpk", solve_fpk)
    monkeypatch.setattr("fpk_rocking.console._AGAIN_S", 0.02 if then == "computes" else 60.0)
    status, out, err = run("fpk", MAIN, "--json", "--out", tmp_path / "out")
    assert (status, bool(out)) == (code, then == "returns")
    files = f"whole files in {tmp_path / 'out'}: jpdf.pvd"
    assert err.startswith(f"fpk-rocking: {word}; {files if then == 'returns' else 'no result was written'}")
    assert (tmp_path / "out").exists() == (then == "returns")


@pytest.mark.usefixtures("interruptible")
def test_other_exceptions_that_nobody_takes_are_shown(monkeypatch):
    """In a callback as anywhere; and after a command everything is as it was."""

    @ctypes.CFUNCTYPE(None)
    def failing():
        raise ValueError("said")

    shown, signs = [], (signal.SIGINT, signal.SIGTERM)
    hook, handlers = shown.append, [signal.getsignal(sign) for sign in signs]
    monkeypatch.setattr(sys, "unraisablehook", hook)
    monkeypatch.setattr(fpk_rocking.density, "solve_fpk", lambda scene, **_: failing() or fakes.FakeEvolution(scene))
    assert run("fpk", MAIN)[0] == 0
    assert [type(problem.exc_value) for problem in shown] == [ValueError]
    assert sys.unraisablehook is hook
    assert [signal.getsignal(sign) for sign in signs] == handlers


def test_interrupted_writing_leaves_whole_files(tmp_path, monkeypatch):
    def interrupted(fields):
        if fields["cycle"] == 2:
            raise KeyboardInterrupt
        return ""

    monkeypatch.setattr(vtk, "_field_data", interrupted)
    (tmp_path / "older").touch()
    os.utime(tmp_path / "older", (1.0, 1.0))
    status, _, err = run("fpk", MAIN, "--cycles", 4, "--out", tmp_path)
    assert (status, err.split(": ")[1:]) == (
        130,
        [f"interrupted; whole files in {tmp_path}", "jpdf_0000.vtu, jpdf_0001.vtu, result.npz\n"],
    )
    (tmp_path / "older").unlink()
    assert {path.name for path in tmp_path.iterdir()} == {"result.npz", "jpdf_0000.vtu", "jpdf_0001.vtu"}


@pytest.mark.parametrize("command", ["probability", "fpk", "mc", "compare", "fragility", "risk", "warmup"])
def test_every_command_has_help(command):
    status, out, _ = run(command, "--help")
    assert (status, out[:5]) == (0, "usage")


def test_help_gives_examples():
    status, out, _ = run("--help")
    assert status == 0
    assert "fpk-rocking compare main" in out
    for command in ("fpk", "mc", "compare"):
        status, out, _ = run(command, "--help")
        assert status == 0
        assert "probability that the block has not overturned" in " ".join(out.split())
