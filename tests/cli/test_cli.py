"""The command line: what it prints, writes, refuses and leaves behind, on coarse densities and few paths."""

import contextlib
import io
import json
import pathlib
import subprocess
import sys

import numpy as np
import pytest

from fpk_rocking import cli, load_scene, solve_fpk
from fpk_rocking.density import Evolution
from fpk_rocking.results.storage import result_kind
from montecarlo import Ensemble, simulate

MAIN = pathlib.Path(__file__).parents[2] / "cases" / "scenes" / "main.toml"
SCENE = load_scene(MAIN)
COARSE = "--cycles", 3, "--tol", 3e-2, "--bins-tol", "inf", "--noise-replacement", "white"


def run(*arguments):
    """Exit status, standard output and standard error of one command."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            status = cli.main([str(argument) for argument in arguments])
        except SystemExit as left:
            status = left.code
    return status, out.getvalue(), err.getvalue()


def said(err):
    """Lines on standard error that are no progress."""
    return [line for line in err.splitlines() if " % " not in line and not line.startswith("compiling")]


@pytest.fixture(scope="module")
def solved():
    return solve_fpk(SCENE, cycles=3, tol=3e-2, bins_tol=np.inf, noise_replacement="white")


@pytest.fixture(scope="module")
def compared(tmp_path_factory):
    """What `compare` prints as JSON, and the folder of its files."""
    folder = tmp_path_factory.mktemp("compared")
    status, out, _ = run("compare", MAIN, *COARSE, "--realizations", 500, "--json", "--out", folder)
    assert status == 0
    return json.loads(out), folder


def test_fpk_prints_one_json_object(solved, tmp_path):
    status, out, err = run("fpk", MAIN, "--json", *COARSE, "--out", tmp_path)
    values = json.loads(out)
    assert (status, said(err)) == (0, [])
    assert values["survival"] == np.asarray(solved.survival).tolist()
    assert {"wall_s", "error_estimate", "mass_defect", "negative_mass"} <= set(values)
    series = {"jpdf.pvd", *(f"jpdf_{cycle:04d}.vtu" for cycle in range(4))}
    assert {path.name for path in tmp_path.iterdir()} == series | {"result.npz", "summary.json"}
    assert np.array_equal(Evolution.load(tmp_path / "result.npz").coefficients, solved.coefficients)


def test_noise_that_was_replaced_is_sampled_beside_the_density():
    """Also by `compare`, unless its own ensemble has the noise of the scene and enough paths."""
    text = "40,000 paths under the noise of the scene (exact, seed {},"
    for words in (["fpk", MAIN], ["compare", MAIN, "--method", "white", "--realizations", 50_000]):
        status, out, _ = run(*words, *COARSE)
        assert status == 0
        assert text.format(2) in " ".join(out.split())
    _, out, _ = run("compare", MAIN, "--realizations", 40_000, "--seed", 5, "--method", "exact", *COARSE)
    assert text.format(5) in " ".join(out.split())
    _, out, _ = run("fpk", MAIN, "--no-check", *COARSE)
    assert "trust: caution. Replaced, not checked" in out


def test_mc_prints_one_json_object(tmp_path):
    asked = {"cycles": 3, "realizations": 500, "seed": 9, "method": "rk4", "steps_per_cycle": 100}
    words = [word for name, value in asked.items() for word in (f"--{name.replace('_', '-')}", value)]
    status, out, _ = run("mc", MAIN, "--json", *words, "--out", tmp_path)
    values, sample = json.loads(out), simulate(SCENE, **asked)
    assert status == 0
    assert values["survival"] == sample.survival.tolist()
    assert values["interval"] == sample.survival_interval().tolist()
    assert values["wall_s"] > 0.0
    assert {path.name for path in tmp_path.iterdir()} == {"result.npz", "summary.json"}
    assert {name: getattr(Ensemble.load(tmp_path / "result.npz"), name) for name in asked} == asked


def test_a_tally_is_made_in_place_of_an_ensemble(tmp_path):
    assert run("mc", MAIN, "--tally", "--cycles", 2, "--realizations", 300, "--out", tmp_path / "plain")[0] == 0
    state = "--checkpoint", tmp_path / "state.npz"
    few = "--realizations", 300, "--out", tmp_path / "both"
    assert run("compare", MAIN, "--tally", *state, *COARSE, *few)[0] == 0
    assert result_kind(tmp_path / "plain" / "result.npz") == "tally"
    assert result_kind(tmp_path / "both" / "ensemble.npz") == "tally"
    assert (tmp_path / "state.npz").exists()


def test_defaults(tmp_path):
    assert run("compare", MAIN, "--no-check", "--noise-replacement", "white", "--out", tmp_path)[0] == 0
    solved, sample = Evolution.load(tmp_path / "density.npz"), Ensemble.load(tmp_path / "ensemble.npz")
    assert (solved.cycles, solved.tol, solved.scene) == (40, 1e-3, SCENE)
    assert (sample.cycles, sample.realizations, sample.seed, sample.method) == (40, 10_000, 1, "exact")
    assert sample.steps_per_cycle == 200


def test_zeros_are_not_taken_for_defaults():
    """A seed may be 0; what may not is refused by the engines."""
    few = "--cycles", 2, "--realizations", 300
    assert json.loads(run("mc", MAIN, "--seed", 0, "--json", *few)[1])["seed"] == 0
    assert "cycles: got 0" in run("mc", MAIN, "--cycles", 0)[2]
    assert "tol: got 0.0" in run("fpk", MAIN, "--tol", 0, "--cycles", 1)[2]


def test_tables_go_to_standard_output(solved):
    last = solved.survival[-1]
    for command, options, text in (
        ("fpk", COARSE, f"{last:.5f}"),
        ("compare", COARSE, f"{last:.4f}"),
        ("mc", ("--cycles", 3), "1.00000"),
    ):
        status, out, err = run(command, MAIN, *options)
        assert (status, said(err)) == (0, [])
        assert text in out
        assert "inferred from its Figs" in out


def test_white_method_replaces_band_noise_and_says_so(tmp_path):
    few = "--realizations", 300, "--out", tmp_path
    status, out, _ = run("compare", MAIN, "--method", "white", *COARSE, *few, "--json")
    assert status == 0
    assert Ensemble.load(tmp_path / "ensemble.npz").scene == SCENE.white_equivalent()
    assert any("white noise, diffusion" in remark for remark in json.loads(out)["remarks"])


def test_two_saved_results_compare_as_the_live_ones(compared):
    live, folder = compared
    files = {"density.npz", "ensemble.npz", "survival.png", "summary.json"}
    assert {path.name for path in folder.iterdir()} == files
    status, saved, _ = run("compare", folder / "ensemble.npz", folder / "density.npz", "--json")
    assert status == 0
    assert json.loads(saved) == live
    assert json.loads((folder / "summary.json").read_text(encoding="utf-8")) == live


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


@pytest.mark.parametrize("command", ["probability", "fpk", "mc", "compare", "fragility", "risk", "warmup"])
def test_every_command_has_help(command):
    status, out, _ = run(command, "--help")
    assert (status, out[:5]) == (0, "usage")


def test_python_m_runs_the_same_command_line():
    asked = [sys.executable, "-m", "fpk_rocking", "fpk", "nowhere.toml"]
    done = subprocess.run(asked, check=False, capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == run("fpk", "nowhere.toml")[2]


def test_help_gives_examples():
    status, out, _ = run("--help")
    assert status == 0
    assert "fpk-rocking compare main" in out
    for command in ("fpk", "mc", "compare"):
        status, out, _ = run(command, "--help")
        assert status == 0
        assert "probability that the block has not overturned" in " ".join(out.split())


def test_a_report_of_a_risk_is_in_the_folder_of_out(capsys):
    with pytest.raises(SystemExit):
        cli.main(["risk", "rack.toml", "--report", "x.html"])
    assert "--report x.html (risk writes its report into the folder of --out)" in capsys.readouterr().err
    with pytest.raises(SystemExit):
        cli.main(["risk", "rack.toml", "--levels", "0.5"])
    assert "--out" not in capsys.readouterr().err
