"""What many test files need: scenes, reference data, cases, and a process that hears SIGINT."""

import signal

import pytest


@pytest.fixture
def interruptible():
    """Have SIGINT raise KeyboardInterrupt, here and in processes started from here.

    What runs in the background of a script, or under nohup, is started with SIGINT ignored, and hands that on.
    """
    previous = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, previous)
