"""What many test files need: scenes, reference data, cases, and a process that hears SIGINT."""

import gc
import importlib.util
import os
import pathlib
import signal

import numpy as np
import pytest

from fpk_rocking import load_scene

ROOT = pathlib.Path(__file__).parents[1]


def pytest_configure(config):
    """Set what costs time and is not needed here.

    Where workers share the processors, each uses one thread for linear algebra: more wait in a busy loop. Garbage is
    looked for less often.
    """
    if config.getoption("numprocesses", None):
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    gc.set_threshold(20_000, 20, 100)


def pytest_collection_finish():
    """Have the garbage collector leave out what tests have imported: to go through that took a twelfth of the time."""
    gc.freeze()


@pytest.fixture(scope="session")
def named_scene():
    """Scene of a file in cases/scenes, by its name."""
    return lambda name: load_scene(ROOT / "cases" / "scenes" / f"{name}.toml")


@pytest.fixture(scope="session")
def main_scene(named_scene):
    """The main scene, with band noise."""
    return named_scene("main")


@pytest.fixture(scope="session")
def reference():
    """Arrays of a file in tests/data, by its name; tests/data/README.md says what they are."""
    return lambda name: np.load(ROOT / "tests" / "data" / f"{name}.npz")


@pytest.fixture(scope="session")
def case():
    """Module of a file in cases, by its name; a new one at every call."""

    def load(name):
        spec = importlib.util.spec_from_file_location(name, ROOT / "cases" / f"{name}.py")
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
        return module

    return load


@pytest.fixture
def interruptible():
    """Have SIGINT raise KeyboardInterrupt, here and in processes started from here.

    What runs in the background of a script, or under nohup, is started with SIGINT ignored, and hands that on.
    """
    previous = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, previous)
