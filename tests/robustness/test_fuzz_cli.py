"""The command line with anything for arguments and scene files: a result, or one line that says what is wrong.

`mc` runs its engines on a few realizations; the density solver, which takes seconds, has a stand-in of a known law.
"""

import contextlib
import io
import json
import pathlib
import subprocess
import sys

import fakes
import fuzz
import pytest
from hypothesis import strategies as st

import fpk_rocking.density
from fpk_rocking import cli
from fpk_rocking.scene.axes import result_times, samples_in_cycle

SCENE = fuzz.scene(noise=fuzz.WhiteNoise(0.006)).to_toml()
FEW = {"mc": ["--cycles", "1", "--realizations", "3"], "fpk": ["--cycles", "1"]}
ODD = st.one_of(
    st.sampled_from(["", "0", "-1", "1.5", "nan", "inf", "1e400", "two", "--json", "-", "--", "σ", "٣", "\n"]),
    st.text(st.characters(exclude_characters="\0", exclude_categories=["Cs"]), max_size=8),
    st.integers().map(str),
    st.floats().map(str),
)
OPTIONS = [
    "--cycles", "--realizations", "--seed", "--method", "--steps-per-cycle", "--tol", "--bins-tol", "--tally",
    "--checkpoint", "--json", "--nonsense", "--help", "-h", "--out",
]  # fmt: skip


def run(*arguments):
    """Exit status, standard output and standard error of one command."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            status = cli.main([str(argument) for argument in arguments])
        except SystemExit as left:
            status = left.code
    return status, out.getvalue(), err.getvalue()


def check(status, out, err, as_json):
    """Assert what holds for whatever was asked."""
    assert status in {0, 2}, (status, err)
    if status == 2:
        assert out == ""
        assert err.count("\n") == 1, err
        assert err.startswith("fpk-rocking")
        assert len(err) > len("fpk-rocking mc: \n"), err
    elif as_json and not out.startswith("usage"):
        printed = json.loads(out)
        shares = printed["survival"][-1:] if "survival" in printed else printed["overturned"][0]
        assert all(share is None or 0.0 <= share <= 1.0 for share in shares)


def solve_fpk(
    scene,
    *,
    cycles=None,
    times=None,
    samples_per_cycle=None,
    tol=1e-3,  # noqa: ARG001
    bins_tol=None,  # noqa: ARG001
    noise_replacement="auto",  # noqa: ARG001
    progress=None,  # noqa: ARG001
):
    """Refuse what the solver refuses, and return a result of a known law."""
    fpk_rocking.density.solver.refuse_unsolvable(scene.white_equivalent())
    samples_in_cycle(scene, samples_per_cycle)
    rows = len(result_times(scene, cycles, times)) - 1 if cycles is None or cycles <= 50 else 51
    if rows > 50 or scene.period is None:
        raise ValueError("cycles: got what this stand-in does not take, accepted: up to 50 cycles")
    return fakes.FakeEvolution(scene, cycles=rows)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.setattr(fpk_rocking.density, "solve_fpk", solve_fpk)
    monkeypatch.chdir(tmp_path)
    (tmp_path / "scene.toml").write_text(SCENE, encoding="utf-8")
    return tmp_path


@fuzz.sizes(50, 2000)
def test_any_arguments_give_a_result_or_one_line(examples, folder):
    def claim(command, options):
        arguments = [command, "scene.toml", *FEW[command]]
        for name, value in options:
            arguments += [name, value] if value is not None else [name]
        check(*run(*arguments), "--json" in arguments)

    pairs = st.tuples(st.sampled_from(OPTIONS) | st.text("-abc", max_size=4), st.none() | ODD)
    small = pairs.filter(lambda pair: len(pair[1] or "") < 2 or not pair[1].isdigit() or len(pair[1]) > 30)
    fuzz.hold(examples, claim, command=st.sampled_from(["mc", "fpk"]), options=st.lists(small, max_size=3))
    assert not list(folder.rglob(".*"))


@pytest.mark.parametrize("problem", [MemoryError(), FloatingPointError("angle: not finite"), OverflowError("large")])
@pytest.mark.usefixtures("folder")
def test_what_an_engine_cannot_do_is_one_line_too(monkeypatch, problem):
    def fails(*_, **__):
        raise problem

    monkeypatch.setattr(fpk_rocking.density, "solve_fpk", fails)
    status, out, err = run("fpk", "scene.toml")
    assert (status, out) == (2, "")
    assert err == f"fpk-rocking fpk: {str(problem) or 'MemoryError'}\n"


@pytest.mark.parametrize("text", ["width", "=normal:1:0.1"])
@pytest.mark.usefixtures("folder")
def test_a_distribution_without_its_name_or_its_value_is_refused(text):
    status, out, err = run("fragility", "scene.toml", "--scales", "1", "--uncertain", text)
    assert (status, out) == (2, "")
    assert f"--uncertain: got {text!r}, accepted: NAME=DIST" in err


@pytest.mark.skipif(not pathlib.Path("/dev/full").exists(), reason="a file that takes nothing is Linux's own")
def test_a_standard_output_that_takes_nothing_is_one_line(folder):
    command = [sys.executable, "-m", "fpk_rocking", "mc", str(folder / "scene.toml"), *FEW["mc"], "--json"]
    with pathlib.Path("/dev/full").open("w") as full:
        done = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True, timeout=300, check=False)
    assert (done.returncode, done.stderr) == (2, "fpk-rocking mc: [Errno 28] No space left on device\n")
