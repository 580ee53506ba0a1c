"""Sweeps: the same rows from any workers, a row for what fails, and a store from which a stopped sweep goes on."""

import concurrent.futures
import csv
import json
import subprocess
import sys
import time

import numpy as np
import pytest
import study_tasks
from study_tasks import AMPLITUDES, GRID, SCENE

from fpk_rocking.base import precompilation
from fpk_rocking.envelopes import Trapezoid
from fpk_rocking.scene import BandNoise, FilteredNoise, WhiteNoise
from fpk_rocking.studies import grid, sweep
from fpk_rocking.studies.execution import seed_of
from fpk_rocking.studies.tasks import TASKS, kernels_of
from montecarlo import simulate
from montecarlo.engines import engine_of
from montecarlo.engines.batches import compilation_of


def rows_without_seconds(rows):
    """Rows without what a clock says."""
    return [{name: value for name, value in row.items() if name != "wall_s"} for row in rows]


@pytest.fixture(scope="module")
def alone():
    return sweep(GRID, study_tasks.amplitude, seed=7)


def test_rows_in_the_order_of_the_scenes(alone):
    assert [row["cell"] for row in alone.rows] == [0, 1, 2, 3, 4]
    assert np.array_equal(alone.values("amplitude"), AMPLITUDES)
    assert np.array_equal(alone.values("series"), 2.0 * np.array(AMPLITUDES))
    assert alone.failed == ()
    with pytest.raises(ValueError, match=r"name: got 'angle', accepted: 'amplitude', 'seed', 'series'"):
        alone.values("angle")


def test_seeds_depend_on_seed_and_number_alone(alone):
    assert sweep(GRID, study_tasks.amplitude, seed=0).rows[1]["seed"] == seed_of(0, 1)
    seeds = [row["values"]["seed"] for row in alone.rows]
    assert seeds == [row["seed"] for row in alone.rows] == [seed_of(7, number) for number in range(5)]
    more = [seed_of(seed, number) for seed in range(10) for number in range(1000)]
    assert len(set(more)) == len(more)
    assert 0 <= min(more) <= max(more) < 2**64


@pytest.mark.parametrize("workers", [2, "threads"])
def test_same_rows_from_any_workers(workers):
    """One of them is of a scene that the task refuses."""
    asked = {"scenes": (*GRID.scenes, SCENE.varied(forcing={"phase": -1.0})), "task": study_tasks.amplitude, "seed": 7}
    with concurrent.futures.ThreadPoolExecutor(3) as pool:
        sweep_result = sweep(**asked, workers=pool if workers == "threads" else workers)
    assert rows_without_seconds(sweep_result.rows) == rows_without_seconds(sweep(**asked).rows)
    assert [row["cell"] for row in sweep_result.failed] == [5]


def test_monte_carlo_and_density_by_name():
    noisy = SCENE.varied(noise=SCENE.white_equivalent().noise)
    noisy = grid(noisy, {"noise.diffusion": (0.01, 0.02)})
    two = sweep(noisy, "mc", workers=2, cycles=2, realizations=300)
    sample = simulate(noisy.scenes[1], cycles=2, realizations=300, seed=seed_of(1, 1))
    assert two.rows[1]["values"]["survival"] == sample.survival.tolist()
    assert rows_without_seconds(two.rows) == rows_without_seconds(sweep(noisy, "mc", cycles=2, realizations=300).rows)
    density = sweep(noisy.scenes[1:], "fpk", cycles=2, tol=1e-2)
    near = 4.0 * np.sqrt(0.25 / 300) + density.values("error_estimate")
    assert np.all(np.abs(density.values("survival") - two.values("survival")[1:]) < near)


def test_kernels_are_compiled_before_workers_start(monkeypatch):
    """Those of the engines that the scenes ask for; not for this process alone."""
    compiled, asked = [], {"scenes": [SCENE, SCENE.varied(noise=WhiteNoise(0.01))], "cycles": 1, "realizations": 1}
    monkeypatch.setattr(precompilation, "ensure_compiled", compiled.append)

    class Pool(concurrent.futures.ThreadPoolExecutor):
        def submit(self, *job):
            self.before = list(compiled)
            return super().submit(*job)

    assert sweep(**asked).failed == ()
    assert compiled == []
    with Pool(1) as pool:
        assert sweep(**asked, workers=pool).failed == ()
    assert pool.before == [compilation_of(engine_of(scene), scene) for scene in asked["scenes"]]


def test_kernels_are_those_of_the_engines_that_will_run():
    """Noise with an envelope has an engine of its own, and a density with filter states needs more kernels."""
    white, band = SCENE.varied(noise=WhiteNoise(0.01)), SCENE.varied(noise=BandNoise(0.04, (0.0, 10.0), 4))
    filtered = SCENE.varied(noise=FilteredNoise("low-pass", 0.04, 9.0, 0.7))
    faded = SCENE.varied(noise=BandNoise(0.04, (0.0, 10.0), 4, envelope=Trapezoid(1.0, 1.0, 1.0)))

    def kernels(task, *scenes, **options):
        names = (
            found.name.replace("compile_engine:", "").split(":")[1]
            for found in kernels_of(TASKS[task], scenes, options)
        )
        return sorted(name.removeprefix("compile_") for name in names)

    assert kernels("mc", SCENE, white, filtered) == ["exact_slender", "filtered", "white"]
    assert kernels("mc", faded) == ["exact_enveloped"]
    assert kernels("mc", faded, SCENE, method="rk4") == ["rk4"]
    assert kernels("mc", white, method="rk4") == []
    assert kernels("fpk", white) == ["density"]
    assert kernels("fpk", filtered) == ["density", "rest"]
    assert kernels("fpk", band) == ["density", "rest"]
    assert kernels("fpk", band, noise_replacement="white") == ["density"]


def test_grid_has_its_last_axis_fastest():
    cells = grid(SCENE, {"forcing.amplitude": (1.0, 2.0), "block.restitution": (0.3, 0.6, 0.9)})
    assert cells.shape == (2, 3)
    assert cells.parameters(4) == {"forcing.amplitude": 2.0, "block.restitution": 0.6}
    assert (cells.scenes[4].forcing.amplitude, cells.scenes[4].block.restitution) == (2.0, 0.6)
    assert sweep(cells, study_tasks.amplitude).values("amplitude").tolist() == [[1.0] * 3, [2.0] * 3]


@pytest.mark.parametrize(
    ("task", "reason"),
    [
        (study_tasks.amplitude, "ValueError: forcing.phase: got -1.0, accepted: a number >= 0"),
        (study_tasks.unwritable, "TypeError: Object of type Scene is not JSON serializable"),
        (study_tasks.infinite, "ValueError: Out of range float values are not JSON compliant"),
    ],
)
def test_what_fails_is_a_row_with_its_reason(tmp_path, task, reason):
    scenes = [SCENE.varied(forcing={"phase": -1.0}), SCENE]
    sweep_result = sweep(scenes, task)
    assert sweep_result.rows[0]["reason"].startswith(reason)
    assert sweep_result.rows[0]["values"] == {}
    if task is study_tasks.amplitude:
        assert [row["cell"] for row in sweep_result.failed] == [0]
        assert np.isnan(sweep_result.values("amplitude")).tolist() == [True, False]
        sweep_result.to_csv(tmp_path / "rows.csv")
        first, second = csv.DictReader((tmp_path / "rows.csv").read_text().splitlines())
        assert (first["amplitude"], first["reason"]) == ("", reason)
        assert (float(second["amplitude"]), second["reason"]) == (4.6, "")


def test_a_killed_process_is_replaced(tmp_path):
    scenes = GRID.scenes[1:4]
    sweep_result = sweep(scenes, study_tasks.deadly, seed=7, workers=2, folder=str(tmp_path), times=1)
    assert rows_without_seconds(sweep_result.rows) == rows_without_seconds(
        sweep(scenes, study_tasks.amplitude, seed=7).rows
    )


def test_a_job_that_kills_its_process_every_time_is_a_row(tmp_path):
    """Its neighbours are none that failed."""
    scenes = grid(SCENE, {"forcing.amplitude": (1.0, 2.0, 4.0, 3.0)})
    sweep_result = sweep(scenes, study_tasks.deadly, workers=2, folder=str(tmp_path), times=99)
    assert [row["cell"] for row in sweep_result.rows] == [0, 1, 2, 3]
    assert [(row["cell"], row["reason"]) for row in sweep_result.failed] == [
        (3, "its process was killed, or ran out of memory")
    ]
    assert len(list(tmp_path.iterdir())) <= 3


class Refusing(concurrent.futures.ThreadPoolExecutor):
    """An executor that cannot run a certain job, and says so in the future."""

    def submit(self, function, task, job, *more):
        return super().submit(self.refuse if job.number == 9 else function, task, job, *more)

    def refuse(self, *_):
        raise OSError("no worker survived it")


def test_what_an_executor_cannot_run_is_tried_alone():
    with Refusing(2) as pool:
        sweep_result = sweep([SCENE] * 20, study_tasks.amplitude, workers=pool)
    assert [(row["cell"], row["reason"]) for row in sweep_result.failed] == [(9, "OSError: no worker survived it")]


def test_an_executor_that_takes_no_more_is_no_failure_of_a_job(tmp_path):
    """It ends between the first attempt and the second."""

    class Closing(Refusing):
        def refuse(self, *_):
            self.shutdown(wait=False)
            raise OSError("no worker survived it")

    store = tmp_path / "rows.jsonl"
    with pytest.raises(RuntimeError, match="after shutdown"):
        sweep([SCENE] * 10, study_tasks.amplitude, workers=Closing(1), store=store)
    assert sorted(json.loads(row)["cell"] for row in store.read_text().splitlines()[1:]) == list(range(9))


def test_an_executor_that_ends_is_a_plain_error_and_the_store_goes_on(tmp_path, alone):
    """Its futures are cancelled, as by Dask when the scheduler is gone, or its processes are dead."""
    for kind in (concurrent.futures.CancelledError, concurrent.futures.BrokenExecutor):
        store = tmp_path / f"{kind.__name__}.jsonl"

        class Ending(concurrent.futures.ThreadPoolExecutor):
            def submit(self, function, task, job, *more):
                return super().submit(function if job.number < 2 else self.end, task, job, *more)

            def end(self, *_, kind=kind):
                raise kind

        with Ending(1) as pool, pytest.raises(RuntimeError, match=r"workers: the executor ended before all"):
            sweep(GRID, study_tasks.amplitude, seed=7, workers=pool, store=store)
        assert store.read_bytes().count(b"\n") == 3
        assert rows_without_seconds(
            sweep(GRID, study_tasks.amplitude, seed=7, store=store).rows
        ) == rows_without_seconds(alone.rows)


def stopping_at(count):
    def progress(done, _):
        if done == count:
            raise KeyboardInterrupt

    return progress


@pytest.mark.parametrize("workers", [1, 2])
def test_a_stopped_sweep_goes_on(tmp_path, alone, workers):
    store, reports = tmp_path / "folder" / "rows.jsonl", []
    with pytest.raises(KeyboardInterrupt):
        sweep(GRID, study_tasks.amplitude, seed=7, workers=workers, store=store, progress=stopping_at(2))
    kept = store.read_bytes()
    assert kept.count(b"\n") == 3
    store.write_bytes(kept + b'{"cell": 4, "se' + 9000 * b" ")  # what a kill in the middle of a line leaves
    sweep_result = sweep(GRID, study_tasks.amplitude, seed=7, store=store, progress=lambda *done: reports.append(done))
    assert rows_without_seconds(sweep_result.rows) == rows_without_seconds(alone.rows)
    assert reports == [(2, 5), (3, 5), (4, 5), (5, 5)]
    assert store.read_bytes().startswith(kept)
    assert store.read_bytes().endswith(b"}\n")
    # Nothing is left to do, and scenes may be added.
    more = sweep((*GRID.scenes, SCENE), study_tasks.amplitude, seed=7, store=store)
    assert rows_without_seconds(more.rows[:5]) == rows_without_seconds(alone.rows)
    assert store.read_bytes().count(b"\n") == 7


def test_stores_of_other_sweeps_are_refused(tmp_path):
    store = tmp_path / "rows.jsonl"
    sweep(GRID, "mc", store=store, cycles=1, realizations=10)
    kept = store.read_bytes()
    for refused, changed in {
        "store: got .*rows.jsonl with options = .*'realizations': 10}, accepted: a new file, or that .*: 20}": {
            "realizations": 20
        },
        "with another scene 0, accepted: .* the same scenes, motions and intensities, in this order, and seed": {
            "seed": 2
        },
        "with task = 'fpk_rocking.studies.tasks.mc'": {"task": "fpk"},
    }.items():
        with pytest.raises(ValueError, match=refused):
            sweep(GRID, **{"task": "mc", "store": store, "cycles": 1, "realizations": 10} | changed)
    with pytest.raises(ValueError, match="with another scene 4"):
        sweep(grid(SCENE, {"forcing.amplitude": AMPLITUDES[:4]}), "mc", store=store, cycles=1, realizations=10)
    assert store.read_bytes() == kept


@pytest.mark.parametrize("part", [0, 1, 40])
def test_a_sweep_that_ended_while_it_began_its_store_goes_on(tmp_path, alone, part):
    store = tmp_path / "rows.jsonl"
    sweep(GRID, study_tasks.amplitude, seed=7, store=store)
    content = store.read_bytes()
    store.write_bytes(content[:part])
    assert rows_without_seconds(sweep(GRID, study_tasks.amplitude, seed=7, store=store).rows) == rows_without_seconds(
        alone.rows
    )
    assert store.read_bytes().splitlines()[0] == content.splitlines()[0]


@pytest.mark.parametrize(
    "text", [" ", "\n", "no json\n", "[]\n", '{"format": 1}\n{"cell": 0}\n', '{"format": 2}\n'], ids=repr
)
def test_damaged_stores_are_refused(tmp_path, text):
    store = tmp_path / "rows.jsonl"
    store.write_text(text)
    with pytest.raises(ValueError, match="store: "):
        sweep(GRID, study_tasks.amplitude, store=store)
    assert store.read_text() == text


def test_damage_amid_a_store_is_refused(tmp_path):
    store = tmp_path / "rows.jsonl"
    sweep(GRID, study_tasks.amplitude, store=store)
    lines = store.read_text().splitlines(keepends=True)
    store.write_text("".join([*lines[:2], lines[2][:20] + "\n", *lines[3:]]))
    with pytest.raises(ValueError, match=r"rows.jsonl is damaged or not the file of a sweep \(line 3\)"):
        sweep(GRID, study_tasks.amplitude, store=store)


@pytest.mark.parametrize(
    ("options", "error", "text"),
    [
        ({"scenes": SCENE}, TypeError, "scenes: got Scene.*, accepted: one or more scenes"),
        ({"scenes": []}, ValueError, r"scenes: got \[\]|scenes: got \(\)"),
        ({"scenes": [SCENE, 3]}, TypeError, r"scenes\[1\]: got 3, accepted: Scene"),
        ({"task": "rk4"}, ValueError, "task: got 'rk4', accepted: 'mc', 'fpk', or a function"),
        ({"workers": 0}, ValueError, "workers: got 0, accepted: a whole number >= 1"),
        ({"workers": "two"}, TypeError, "workers: got 'two'"),
        ({"seed": -1}, ValueError, "seed: got -1"),
        ({"progress": 3}, TypeError, "progress: got 3"),
        ({"store": "rows.jsonl", "option": {1, 2}}, TypeError, "options: .*set.*accepted with a store"),
    ],
)
def test_bad_input_is_refused_before_any_work(tmp_path, monkeypatch, options, error, text):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(error, match=text):
        sweep(**{"scenes": GRID, "task": study_tasks.amplitude} | options)
    assert list(tmp_path.iterdir()) == []


SCRIPT = """
import study_tasks, sys
from fpk_rocking.studies import sweep
if __name__ == "__main__":
    sweep(study_tasks.GRID, study_tasks.slow, workers=2, store=sys.argv[1], seconds=float(sys.argv[2]))
"""


def test_a_killed_sweep_leaves_whole_rows_and_no_workers(tmp_path):
    store, script = tmp_path / "rows.jsonl", tmp_path / "script.py"
    script.write_text(SCRIPT)
    run = subprocess.Popen(
        [sys.executable, script, store, "0.5"], env={"PYTHONPATH": ":".join(sys.path)}, stdout=subprocess.PIPE
    )
    while run.poll() is None and not (store.exists() and store.read_bytes().count(b"\n") >= 2):
        time.sleep(0.05)
    run.kill()
    # Workers have inherited standard output: it ends with the last of them.
    run.communicate(timeout=20)
    rows = store.read_bytes().count(b"\n") - 1
    assert 1 <= rows < 5
    sweep_result = sweep(GRID, study_tasks.slow, store=store, seconds=0.5)
    assert len(sweep_result.rows) == 5
    assert json.loads(store.read_text().splitlines()[1])["wall_s"] >= 0.5


def test_a_store_is_taken_by_one_sweep_at_a_time(tmp_path, alone):
    """Refused while the other runs, whoever runs it, and free when that has ended, in whatever way."""
    pytest.importorskip("fcntl", reason="without locks of files")
    store, refused = tmp_path / "rows.jsonl", []
    asked = {"task": study_tasks.amplitude, "seed": 7, "store": store}

    def again(done, _):
        with pytest.raises(ValueError, match=r"store: got '.*rows\.jsonl', accepted: a file that no sweep in progress"):
            sweep(GRID, **asked)
        refused.append(done)
        if done == 3 and len(refused) < 5:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        sweep(GRID, **asked, progress=again)
    assert rows_without_seconds(sweep(GRID, **asked, progress=again).rows) == rows_without_seconds(alone.rows)
    assert refused == [0, 1, 2, 3, 3, 4, 5]
    assert store.read_bytes().count(b"\n") == 6


def test_sweeps_that_begin_one_store_at_once(tmp_path):
    """One of two processes has it; the other is refused, or comes later and finds its rows."""
    pytest.importorskip("fcntl", reason="without locks of files")
    store, script = tmp_path / "rows.jsonl", tmp_path / "script.py"
    script.write_text(SCRIPT.replace("workers=2", "workers=1"))
    command = [sys.executable, script, store, "0.2"]
    pipes = {"stderr": subprocess.PIPE, "text": True, "env": {"PYTHONPATH": ":".join(sys.path)}}
    runs = [subprocess.Popen(command, **pipes) for _ in range(2)]
    ended = [(run.communicate(timeout=60)[1], run.returncode) for run in runs]
    assert (("", 0)) in ended
    assert all(code == 0 or "ValueError: store: got " in said for said, code in ended)
    cells = [json.loads(row)["cell"] for row in store.read_text().splitlines()[1:]]
    assert sorted(cells) == list(range(5))
