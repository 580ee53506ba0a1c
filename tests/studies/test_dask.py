"""Sweeps on a Dask cluster of this machine, with a worker killed in the middle."""

import os
import signal
import threading

import pytest
import study_verbs
from test_sweep import GRID, told

from fpk_rocking.studies import sweep

distributed = pytest.importorskip("distributed")


@pytest.fixture(scope="module")
def client():
    options = {"n_workers": 2, "threads_per_worker": 1, "dashboard_address": None}
    with distributed.LocalCluster(**options) as cluster, distributed.Client(cluster) as connected:
        yield connected


def test_the_rows_are_those_of_one_process(client):
    found = sweep(GRID, "mc", workers=client.get_executor(), cycles=2, realizations=100)
    assert found.failed == ()
    assert told(found.rows) == told(sweep(GRID, "mc", cycles=2, realizations=100).rows)


def test_a_worker_killed_in_the_middle(client, tmp_path):
    store, pids = tmp_path / "rows.jsonl", list(client.run(os.getpid).values())
    killed = threading.Event()

    def kill(done, _):
        if done == 1:
            os.kill(pids[0], signal.SIGKILL)
            killed.set()

    scenes = GRID.scenes * 3
    found = sweep(
        scenes, study_verbs.slow, workers=client.get_executor(), seed=7, store=store, progress=kill, seconds=0.2
    )
    assert killed.is_set()
    assert told(found.rows) == told(sweep(scenes, study_verbs.slow, seed=7, seconds=0.0).rows)
    assert store.read_bytes().count(b"\n") == 16


def test_a_cell_that_no_worker_survives_is_a_row(client, tmp_path):
    client.cluster.scheduler.allowed_failures = 0
    found = sweep(GRID, study_verbs.deadly, workers=client.get_executor(), folder=str(tmp_path), times=99)
    assert [row["cell"] for row in found.failed] == [2]
    assert "KilledWorker" in found.failed[0]["reason"]
