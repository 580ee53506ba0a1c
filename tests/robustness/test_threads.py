"""The same bits from any number of threads."""

import os
import pathlib
import subprocess
import sys

import pytest


@pytest.mark.slow
def test_every_engine_gives_the_same_bits_for_any_number_of_threads():
    """In processes of their own, the linear algebra library's threads included."""
    printed = []
    for threads in ("1", "2", "3"):
        counts = {f"{library}_NUM_THREADS": threads for library in ("NUMBA", "OMP", "OPENBLAS", "MKL")}
        command = [sys.executable, pathlib.Path(__file__).with_name("engines_digest.py")]
        done = subprocess.run(
            command, env=os.environ | counts, capture_output=True, text=True, timeout=900, check=False
        )
        assert done.returncode == 0, done.stderr
        printed.append(done.stdout)
    assert printed[0].count("\n") == 15
    assert printed[1:] == printed[:1] * 2
