"""Sweeps on a Dask cluster of this machine, with a worker, and its scheduler, killed in the middle."""

import contextlib
import json
import os
import signal
import subprocess
import sys
import threading

import pytest
import study_tasks
from study_tasks import GRID
from test_sweeping import rows_without_seconds

from fpk_rocking.studies import sweep


@pytest.fixture(scope="module")
def distributed():
    """The package, which takes long to import, in every process that collects tests."""
    return pytest.importorskip("distributed")


@pytest.fixture(scope="module")
def client(distributed):
    options = {"n_workers": 2, "threads_per_worker": 1, "dashboard_address": None}
    with distributed.LocalCluster(**options) as cluster, distributed.Client(cluster) as connected:
        yield connected


def test_the_rows_are_those_of_one_process(client):
    sweep_result = sweep(GRID, "mc", workers=client.get_executor(), cycles=2, realizations=100)
    assert sweep_result.failed == ()
    assert rows_without_seconds(sweep_result.rows) == rows_without_seconds(
        sweep(GRID, "mc", cycles=2, realizations=100).rows
    )


def test_a_worker_killed_in_the_middle(client, tmp_path):
    store, pids = tmp_path / "rows.jsonl", list(client.run(os.getpid).values())
    killed = threading.Event()

    def kill(done, _):
        if done == 1:
            os.kill(pids[0], signal.SIGKILL)
            killed.set()

    scenes = GRID.scenes * 3
    sweep_result = sweep(
        scenes, study_tasks.slow, workers=client.get_executor(), seed=7, store=store, progress=kill, seconds=0.1
    )
    assert killed.is_set()
    assert rows_without_seconds(sweep_result.rows) == rows_without_seconds(
        sweep(scenes, study_tasks.slow, seed=7, seconds=0.0).rows
    )
    assert store.read_bytes().count(b"\n") == 16


@pytest.mark.slow
def test_a_cell_that_no_worker_survives_is_a_row(client, tmp_path):
    client.cluster.scheduler.allowed_failures = 0
    sweep_result = sweep(GRID, study_tasks.deadly, workers=client.get_executor(), folder=str(tmp_path), times=99)
    assert [row["cell"] for row in sweep_result.failed] == [2]
    assert "KilledWorker" in sweep_result.failed[0]["reason"]


@contextlib.contextmanager
def scheduler_and_worker(folder):
    """Yield a scheduler, the first of two processes, and its address; the worker outlives it for a while."""
    file, processes = folder / "scheduler.json", []
    where = {"env": os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}, "stderr": subprocess.DEVNULL}
    begin = [sys.executable, "-m", "distributed.cli.dask_"]

    def started(name, *options):
        command = [*begin[:2], f"{begin[2]}{name}", "--scheduler-file", file, "--no-dashboard", *options]
        processes.append(subprocess.Popen(command, **where))

    try:
        started("scheduler", "--host", "127.0.0.1", "--port", "0")
        started("worker", "--no-nanny", "--nthreads", "1", "--death-timeout", "60")
        yield processes[0], file
    finally:
        for process in processes:
            process.kill()
            process.wait()


@pytest.mark.slow
def test_a_scheduler_killed_in_the_middle(distributed, tmp_path):
    """A plain error; the rows that came are kept, and the sweep goes on from them without the cluster."""
    store, scenes = tmp_path / "rows.jsonl", GRID.scenes * 3
    asked = {"scenes": scenes, "task": study_tasks.slow, "seed": 7, "store": store, "seconds": 0.1}
    with scheduler_and_worker(tmp_path) as (scheduler, file):
        client = distributed.Client(scheduler_file=str(file), timeout=30, set_as_default=False)

        def kill(done, _):
            if done == 4:
                scheduler.kill()

        client.wait_for_workers(1)
        with client, pytest.raises(RuntimeError, match=r"workers: the executor ended before all scenes"):
            sweep(**asked, workers=client.get_executor(), progress=kill)
    kept = store.read_bytes()
    assert 5 <= kept.count(b"\n") < 16
    assert rows_without_seconds(sweep(**asked).rows) == rows_without_seconds(
        sweep(scenes, study_tasks.slow, seed=7, seconds=0.0).rows
    )
    assert store.read_bytes().startswith(kept)
    assert sorted(json.loads(row)["cell"] for row in store.read_text().splitlines()[1:]) == list(range(15))
