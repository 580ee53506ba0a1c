"""Runs that are interrupted, terminated or killed: what was said to be saved is there, and goes on to the same bits."""

import json
import os
import pathlib
import random
import signal
import subprocess
import sys
import time

import pytest
from killed import ASKED, SCENE

from fpk_rocking import cli
from montecarlo import Tally, tally

HERE = pathlib.Path(__file__).parent
COMMAND = [sys.executable, "-m", "fpk_rocking"]
pytestmark = pytest.mark.usefixtures("interruptible")


def counts(result):
    return [array.tobytes() for array in result.counts]


def killed_at(path, realizations, instant):
    """Start a run, kill it some seconds after it has saved once, return what it last reported as saved."""
    command = [sys.executable, str(HERE / "killed.py"), str(path), str(realizations)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as run:
        reported = run.stdout.readline()
        time.sleep(instant)
        run.send_signal(signal.SIGKILL)
        lines = [reported, *run.stdout.read().splitlines(keepends=True)]
    return max(int(line) for line in lines if line.endswith("\n"))


@pytest.mark.parametrize("kills", [pytest.param(1, id="few"), pytest.param(100, marks=pytest.mark.slow, id="many")])
def test_killed_runs_lose_nothing_that_they_reported(kills, tmp_path):
    """One checkpoint through run after run, each killed at a random instant; the last goes on to an undisturbed one."""
    path, target, instants = tmp_path / "state.npz", 2_000_000, random.Random(7)
    before = 0
    for _ in range(kills):
        reported = killed_at(path, target, instants.uniform(0.0, 0.3))
        saved = Tally.load(path)
        assert before < reported <= saved.realizations
        assert saved.realizations < target, "ended before it was killed"
        before = saved.realizations
    assert counts(tally(SCENE, **ASKED, realizations=before, checkpoint=path)) == counts(
        tally(SCENE, **ASKED, realizations=before)
    )
    # A file that was being written when its run was killed stays behind under its temporary name, and is never read.
    unfinished = [file for file in tmp_path.iterdir() if file != path]
    assert all(file.name.startswith(".state-") for file in unfinished)
    assert kills < 10 or len(unfinished) > kills // 10, "hardly a run was killed while it saved"


def start(*arguments, command=COMMAND, **environment):
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    return subprocess.Popen([*command, *map(str, arguments)], env=os.environ | environment, **pipes)


BEGUN = """
import contextlib, pathlib, sys
from fpk_rocking import cli, console

said = console.plain_warnings

@contextlib.contextmanager
def begun(command):
    with said(command):
        pathlib.Path(__file__).with_name("begun").touch()
        yield

console.plain_warnings = begun
sys.exit(cli.main())
"""
"""The command line, which makes a file beside this text once a signal ends it plainly."""


def started(folder, *arguments, **environment):
    """Start a command, and return once it has begun; before, a signal ends Python itself."""
    (folder / "begins.py").write_text(BEGUN, encoding="utf-8")
    path = {"PYTHONPATH": os.pathsep.join([str(folder), *sys.path])}
    run = start(*arguments, command=[sys.executable, "-m", "begins"], **path | environment)
    while not (folder / "begun").exists() and run.poll() is None:
        time.sleep(0.01)
    return run


def stopped(run, sign, ready, limit=200.0):
    """Stop a command once something is there; return its exit status and its output."""
    end = time.monotonic() + limit
    while not ready() and run.poll() is None and time.monotonic() < end:
        time.sleep(0.02)
    assert run.poll() is None, run.communicate()
    run.send_signal(sign)
    out, err = run.communicate(timeout=limit)
    return run.returncode, out, err


def test_a_stopped_tally_ends_plainly_and_goes_on(tmp_path, capsys):
    scene, path, out = tmp_path / "scene.toml", tmp_path / "state.npz", tmp_path / "out"
    scene.write_text(SCENE.to_toml(), encoding="utf-8")
    asked = ["mc", scene, "--cycles", 2, "--tally", "--checkpoint", path, "--json"]
    run = start(*asked, "--realizations", 2**31 - 1, "--out", out)
    status, printed, said = stopped(run, signal.SIGTERM, path.exists)
    assert (status, printed) == (143, "")
    assert said.splitlines()[-1] == f"fpk-rocking: terminated; the same command goes on from {path}"
    assert [file.name for file in tmp_path.iterdir() if file.is_dir() or file.name.startswith(".")] == []
    done = Tally.load(path).realizations
    assert cli.main([*map(str, asked), "--realizations", str(done + 500)]) == 0
    values = json.loads(capsys.readouterr().out)
    assert values["survival"] == tally(SCENE, cycles=2, realizations=done + 500).survival.tolist()


def test_an_interrupted_solver_ends_plainly_and_leaves_no_files(tmp_path):
    """Two seconds after Python runs the command: while it loads libraries, compiles kernels, or works."""
    scene, out, own = tmp_path / "scene.toml", tmp_path / "out", tmp_path / "own"
    own.mkdir()
    scene.write_text(SCENE.to_toml(), encoding="utf-8")
    run = started(own, "fpk", scene, "--cycles", 200, "--tol", 1e-4, "--out", out)
    instant = time.monotonic() + 2.0
    status, printed, said = stopped(run, signal.SIGINT, lambda: time.monotonic() > instant)
    assert (status, printed) == (130, "")
    assert said.splitlines()[-1] == "fpk-rocking: interrupted; no result was written"
    assert "Traceback" not in said
    assert {file.name for file in tmp_path.iterdir()} == {"scene.toml", "own"}


TEXT = """
import signal, sys
from fpk_rocking import cli
cli._warmup = lambda _: exec("signal.raise_signal(signal.SIGINT)")
sys.exit(cli.main(["warmup"]))
"""


def test_an_interruption_of_code_that_is_run_from_text_has_its_exit_status(tmp_path):
    """Libraries run such code while they are imported, and numba does; `python -m` ended by the signal itself."""
    (tmp_path / "stopped.py").write_text(TEXT, encoding="utf-8")
    path = {"PYTHONPATH": os.pathsep.join([str(tmp_path), *sys.path])}
    command = [sys.executable, "-m", "stopped"]
    run = subprocess.run(command, env=os.environ | path, capture_output=True, text=True, check=False, timeout=60)
    assert (run.returncode, run.stderr) == (130, "fpk-rocking: interrupted; no result was written\n")
