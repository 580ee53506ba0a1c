"""The times of results: the defaults, and the largest and smallest numbers of cycles and times."""

import numpy as np
import pytest
from made_results import MAIN, PULSE

from fpk_rocking.scene.axes import result_times


def test_after_each_twentieth_of_a_motion_and_ten_later():
    times, duration = result_times(PULSE), PULSE.forcing.duration
    assert times == pytest.approx([*np.linspace(0.0, duration, 21), duration + 10.0])


def test_as_many_cycles_as_fit():
    assert result_times(MAIN, cycles=5) == pytest.approx(MAIN.period * np.arange(6))
    assert result_times(MAIN, cycles=2**24).size == 2**24 + 1
    with pytest.raises(ValueError, match=f"cycles: got {2**24 + 1}, accepted: a whole number from 1 to {2**24}"):
        result_times(MAIN, cycles=2**24 + 1)


def test_as_many_times_as_fit():
    assert result_times(PULSE, times=[2.0]).tolist() == [0.0, 2.0]
    assert result_times(PULSE, times=[0.0, 2.0]).tolist() == [0.0, 2.0]
    assert result_times(PULSE, times=np.arange(100_000)).size == 100_000
    for bad in ([], [0.0], np.arange(100_001), [1.0, 1.0], [-1e-9, 1.0], [1.0, np.inf]):
        with pytest.raises(ValueError, match=r"^times: got "):
            result_times(PULSE, times=bad)
