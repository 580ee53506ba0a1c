"""Tallies in parts: the same bits for any threads, any batches and any stops, in little memory; foreign checkpoints."""

import contextlib
import dataclasses
import gc
import io
import json
import math
import tracemalloc

import pytest

from fpk_rocking import cli
from fpk_rocking.base.jit import at_most
from fpk_rocking.scene import BandNoise, Block, Harmonic, Scene, WhiteNoise
from montecarlo import Tally, simulate, simulation, tally
from montecarlo.results.tally import Checkpoint

MAIN = Scene(Block(0.5), Harmonic(4.6, 2.7, math.pi), WhiteNoise(0.002 * math.pi))
# Of so many rows the first batch has 64 realizations, and a later one at most four times as many as that before it.
SIZE = {"cycles": 64, "realizations": 3000}


def content(result):
    return [array.tobytes() for array in result.counts]


@pytest.fixture(scope="module")
def undisturbed():
    return tally(MAIN, **SIZE)


def test_same_counts_for_any_threads_and_any_batches(undisturbed, tmp_path):
    with at_most(1):
        assert content(tally(MAIN, **SIZE)) == content(undisturbed)
    for size in (1, 101, 700, 3000):
        parts = tally(MAIN, **SIZE | {"realizations": size}, checkpoint=tmp_path / "state.npz")
    assert content(parts) == content(undisturbed)


def test_memory_does_not_grow_with_the_ensemble(undisturbed, monkeypatch):
    """Not even where the engine is so fast that a batch could hold all: 0.8 MB of states for the largest."""
    monkeypatch.setattr(simulation, "TUNING", simulation.TUNING._replace(tally_states=3 * 300))

    def peak(realizations):
        tracemalloc.start()
        tally(MAIN, cycles=2, realizations=realizations, progress=lambda *_: gc.collect())
        allocated = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return allocated

    # What a first run and other threads allocate comes on top of a peak, so the least of three is that of the run.
    small, large = (min(peak(realizations) for _ in range(3)) for realizations in (1000, 16_000))
    assert large < small + 100_000
    reports = []
    assert content(tally(MAIN, **SIZE, progress=lambda *counts: reports.append(counts))) == content(undisturbed)
    assert reports[-1] == (3000, 3000)
    assert {total for _, total in reports} == {3000}


class Stop:
    """A progress that stops a run after some batches."""

    def __init__(self, error, batches):
        self.error, self.left, self.done = error, batches, 0

    def __call__(self, done, _):
        self.left, self.done = self.left - 1, done
        if self.left == 0:
            raise self.error


@pytest.mark.parametrize("error", [KeyboardInterrupt, RuntimeError])
def test_a_stopped_run_goes_on_to_the_same_bits(undisturbed, tmp_path, error):
    path = tmp_path / "deeper" / "state.npz"
    for batches in (1, 2):
        stop = Stop(error, batches)
        with pytest.raises(error):
            tally(MAIN, **SIZE, checkpoint=path, progress=stop)
    part = Tally.load(path)
    assert 128 < part.realizations == stop.done < 3000
    dataclasses.replace(part, wall_s=1000.0).save(path)
    reports = []
    resumed = tally(MAIN, **SIZE, checkpoint=path, progress=lambda *counts: reports.append(counts))
    assert reports[0] == (part.realizations + 64, 3000)
    assert content(resumed) == content(undisturbed)
    assert content(Tally.load(path)) == content(undisturbed)
    assert 1000.0 < resumed.wall_s < 1100.0
    assert list(path.parent.iterdir()) == [path]


def test_a_finished_run_goes_on_with_more_realizations(undisturbed, tmp_path):
    path = tmp_path / "state.npz"
    tally(MAIN, **SIZE | {"realizations": 1000}, checkpoint=path)
    assert content(tally(MAIN, **SIZE, checkpoint=path)) == content(undisturbed)
    before = path.read_bytes()
    assert content(tally(MAIN, **SIZE, checkpoint=path)) == content(undisturbed)
    assert path.read_bytes() == before


@pytest.mark.parametrize("always", [False, True])
def test_the_state_is_saved_at_once_at_the_end_and_now_and_then(tmp_path, monkeypatch, always):
    if always:
        monkeypatch.setattr(Checkpoint, "least_s", 0.0)
        monkeypatch.setattr(Checkpoint, "share", math.inf)
    path, done, saved = tmp_path / "state.npz", [], []

    def watch(count, _):
        done.append(count)
        saved.append(Tally.load(path).realizations)

    tally(MAIN, **SIZE, checkpoint=path, progress=watch)
    assert len(done) >= 3
    assert saved == (done if always else [64] * len(done))
    assert Tally.load(path).realizations == done[-1] == 3000


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"seed": 2}, "seed 1, accepted: seed 2"),
        ({"cycles": 3}, "cycles 2, accepted: cycles 3"),
        ({"steps_per_cycle": 100}, "steps_per_cycle 200, accepted: steps_per_cycle 100"),
        ({"scene": dataclasses.replace(MAIN, block=Block(0.6))}, r"scene .*0\.5.*, accepted: scene .*0\.6"),
        ({"angle_edges": [-1.0, 1.0]}, "other angle_edges, accepted: the angle_edges that are asked for"),
        ({"velocity_edges": [-1.0, 1.0]}, "other velocity_edges"),
        ({"realizations": 99}, "realizations 100, accepted: at most 99"),
    ],
)
def test_a_checkpoint_of_another_run_is_refused_and_kept(tmp_path, changed, message):
    path, asked = tmp_path / "state.npz", {"scene": MAIN, "cycles": 2, "realizations": 100}
    tally(**asked, checkpoint=path)
    before = path.read_bytes()
    with pytest.raises(ValueError, match=rf"checkpoint: got .*state\.npz with {message}"):
        tally(**asked | changed, checkpoint=path)
    assert path.read_bytes() == before


def test_a_checkpoint_of_another_method_is_refused_and_kept(tmp_path):
    """Counts of one engine are not to be mixed with those of another."""
    path, asked = tmp_path / "state.npz", {"cycles": 1, "realizations": 100, "checkpoint": tmp_path / "state.npz"}
    scene = dataclasses.replace(MAIN, noise=BandNoise(0.04, (0.0, 10.0), 20))
    tally(scene, method="rk4", **asked)
    before = path.read_bytes()
    for other in ("exact", None):
        with pytest.raises(ValueError, match=r"checkpoint: got .*state\.npz with method rk4, accepted: method exact"):
            tally(scene, method=other, **asked | {"realizations": 200})
    assert path.read_bytes() == before


@pytest.mark.parametrize("damage", ["truncated", "flipped", "text", "ensemble"])
def test_a_damaged_checkpoint_is_refused_and_kept(tmp_path, damage):
    path, asked = tmp_path / "state.npz", {"cycles": 2, "realizations": 100}
    tally(MAIN, **asked, checkpoint=path)
    content = bytearray(path.read_bytes())
    if damage == "truncated":
        path.write_bytes(content[: len(content) // 2])
    elif damage == "flipped":
        content[len(content) // 2] ^= 1
        path.write_bytes(content)
    elif damage == "text":
        path.write_text("notes\n")
    else:
        simulate(MAIN, **asked).save(path)
    before = path.read_bytes()
    with pytest.raises(ValueError, match=r"checkpoint: .*state\.npz: "):
        tally(MAIN, **asked, checkpoint=path)
    assert path.read_bytes() == before


def test_a_checkpoint_that_cannot_be_written_is_refused_early(tmp_path):
    (tmp_path / "file").write_text("in the way\n")
    reports = []
    with pytest.raises(OSError, match="file"):
        tally(MAIN, **SIZE, checkpoint=tmp_path / "file" / "state.npz", progress=lambda *counts: reports.append(counts))
    assert reports == []


def run(*arguments):
    out = io.StringIO()
    with contextlib.redirect_stdout(out):
        status = cli.main([str(argument) for argument in arguments])
    return status, out.getvalue()


def test_the_command_line_tallies_and_goes_on(tmp_path):
    scene, state = tmp_path / "scene.toml", tmp_path / "state.npz"
    scene.write_text(MAIN.to_toml(), encoding="utf-8")
    command = ["mc", scene, "--cycles", 2, "--tally", "--checkpoint", state, "--json"]
    run(*command, "--realizations", 150)
    status, out = run(*command, "--realizations", 200, "--out", tmp_path)
    values = json.loads(out)
    assert status == 0
    assert values["survival"] == simulate(MAIN, cycles=2, realizations=200).survival.tolist()
    assert {"interval", "wall_s", "realizations"} <= set(values)
    assert content(Tally.load(state)) == content(Tally.load(tmp_path / "result.npz"))
    status, out = run("compare", state, tmp_path / "result.npz", "--json")
    assert (status, json.loads(out)["l1"]) == (0, [0.0, 0.0])


def test_a_checkpoint_is_due_at_first_and_not_again_at_once(tmp_path):
    """Without a file it is never due."""
    keeper, small = Checkpoint(tmp_path / "state.npz", 0), tally(MAIN, cycles=1, realizations=3)
    assert keeper.is_due
    keeper.save(small)
    assert not keeper.is_due
    assert not Checkpoint(None, 0).is_due
