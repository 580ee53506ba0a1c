"""Random numbers: the published recurrence, the laws, and streams that share nothing."""

import numba
import numpy as np
from scipy import stats

from montecarlo.engines import random

MASK = 2**64 - 1


@numba.njit
def _fill(draw, keys, out):
    for r in range(out.shape[0]):
        state = random.open_stream(keys, r)
        for i in range(out.shape[1]):
            out[r, i] = draw(state)


def test_words_follow_the_published_recurrence():
    def rotate(word, by):
        return ((word << by) | (word >> (64 - by))) & MASK

    state = random.open_stream(random.stream_keys(7), 3)
    s = [int(word) for word in state]
    for _ in range(100):
        expected = (rotate((s[0] + s[3]) & MASK, 23) + s[0]) & MASK
        t = (s[1] << 17) & MASK
        s[2] ^= s[0]
        s[3] ^= s[1]
        s[1] ^= s[2]
        s[0] ^= s[3]
        s[2] ^= t
        s[3] = rotate(s[3], 45)
        assert int(random.next_word(state)) == expected


def test_numbers_have_their_laws():
    """Kolmogorov-Smirnov along one stream and across the first draws of many; false alarm 1e-4 each."""
    for draw, law in ((random.uniform, "uniform"), (random.normal, "norm")):
        for shape in ((1, 1_000_000), (200_000, 2)):
            numbers = np.empty(shape)
            _fill(draw, random.stream_keys(1), numbers)
            assert stats.kstest(numbers.ravel(), law).pvalue > 1e-4


def test_normals_have_their_tail():
    """Counts beyond the ziggurat's last layer and in its wedges, within 4 standard errors (6e-5 each)."""
    numbers = np.empty((1, 4_000_000))
    _fill(random.normal, random.stream_keys(2), numbers)
    for limit in (3.0, 3.7, 4.2):
        expected = 2.0 * stats.norm.sf(limit) * numbers.size
        assert abs(np.count_nonzero(np.abs(numbers) > limit) - expected) < 4.0 * np.sqrt(expected)


def test_paths_that_begin_at_a_later_cycle_have_keys_of_their_own():
    keys = random.stream_keys(7)
    assert np.array_equal(random.keys_at(keys, 0), keys)
    later = np.array([random.keys_at(keys, cycle) for cycle in range(100)])
    assert np.unique(later).size == 400
    with np.errstate(over="ignore"):  # Python sees an index beyond the end.
        assert np.array_equal(random.keys_at.py_func(keys, 9), later[9])


def test_streams_differ_in_every_word():
    for seeds, realizations in (((1,), range(2000)), (range(2000), (0,))):
        words = np.array([random.open_stream(random.stream_keys(s), r) for s in seeds for r in realizations])
        assert np.unique(words).size == words.size
