"""Random numbers: those of realization number r are a function of the seed, the starting cycle and r alone.

`open_stream` makes of the keys of a seed (`stream_keys`, `keys_at`) and r the state of a generator; every random number
of that realization is drawn from it in a fixed order: first the start (`draw_start`), then the noise. Splitting opens a
stream for each walker that it continues, and one more for each repeat.

Generator: xoshiro256++ (D. Blackman, S. Vigna, ACM Trans. Math. Softw. 47(4), 36, 2021). A stream's four words of
state are hashes (the finalizer of splitmix64) of r under the four keys, so no two realizations of a seed share a word.
Normals: the ziggurat of 256 layers (G. Marsaglia, W. W. Tsang, J. Stat. Softw. 5(8), 2000, in the form of J. A.
Doornik, 2005, where the layer and the abscissa use different bits).
"""

import math

import numpy as np

from fpk_rocking.base.jit import kernel

_GOLDEN = 0x9E3779B97F4A7C15
_TAIL = 3.6541528853610088  # where the last layer begins


def _ziggurat():
    """Return the right ends (257,) of the layers, widest first, and the fraction (256,) of each inside the next."""
    ends, area = np.zeros(257), 0.00492867323399  # of each layer
    density = math.exp(-0.5 * _TAIL**2)
    ends[0], ends[1] = area / density, _TAIL
    for i in range(2, 256):
        ends[i] = math.sqrt(-2.0 * math.log(area / ends[i - 1] + density))
        density = math.exp(-0.5 * ends[i] ** 2)
    return ends, ends[1:] / ends[:-1]


_ENDS, _INSIDE = _ziggurat()


@kernel
def hash_word(word):
    word = (word ^ (word >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    word = (word ^ (word >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return word ^ (word >> np.uint64(31))


def stream_keys(seed):
    """Return the four keys (4,) uint64 of a seed, from 0 to 2**64 - 1."""
    return np.array([hash_word(np.uint64((seed + i * _GOLDEN) & (2**64 - 1))) for i in range(1, 5)], dtype=np.uint64)


@kernel
def keys_at(keys, cycle):
    """Return the keys of paths that begin at a cycle: those of the seed at cycle 0, else hashes of both."""
    if cycle == 0:
        return keys
    moved = np.empty_like(keys)
    for i in range(4):
        moved[i] = hash_word(keys[i] ^ hash_word(np.uint64(cycle)))
    return moved


@kernel
def open_stream(keys, realization):
    """Return the first state (4,) uint64 of the generator of a realization."""
    name = hash_word(np.uint64(realization) + np.uint64(_GOLDEN))
    state = np.empty(4, np.uint64)
    for i in range(4):
        state[i] = hash_word(name ^ keys[i])
    return state


@kernel(inline="always")
def _advance_generator(s0, s1, s2, s3):
    total = s0 + s3
    word = ((total << np.uint64(23)) | (total >> np.uint64(41))) + s0
    s2 ^= s0
    s3 ^= s1
    return word, s0 ^ s3, s1 ^ s2, s2 ^ (s1 << np.uint64(17)), (s3 << np.uint64(45)) | (s3 >> np.uint64(19))


@kernel
def next_word(state):
    word, state[0], state[1], state[2], state[3] = _advance_generator(state[0], state[1], state[2], state[3])
    return word


@kernel
def uniform_pairs(state, first, second, count):
    """Write `count` uniform numbers to each of `first` and `second`, in turn."""
    s0, s1, s2, s3 = state[0], state[1], state[2], state[3]
    for n in range(count):
        word, s0, s1, s2, s3 = _advance_generator(s0, s1, s2, s3)
        first[n] = float(word >> np.uint64(11)) * 2.0**-53
        word, s0, s1, s2, s3 = _advance_generator(s0, s1, s2, s3)
        second[n] = float(word >> np.uint64(11)) * 2.0**-53
    state[0], state[1], state[2], state[3] = s0, s1, s2, s3


@kernel
def uniform(state):
    """Return a number, uniform in [0, 1), a multiple of 2**-53."""
    return float(next_word(state) >> np.uint64(11)) * 2.0**-53


@kernel(forceinline=True)
def normal(state):
    while True:
        word = next_word(state)
        layer = np.int64(word & np.uint64(255))
        share = 2.0 * (float(word >> np.uint64(11)) * 2.0**-53) - 1.0
        if abs(share) < _INSIDE[layer]:
            return share * _ENDS[layer]
        if layer == 0:
            return math.copysign(_tail(state), share)
        x = share * _ENDS[layer]
        low = math.exp(0.5 * (x * x - _ENDS[layer] ** 2))
        high = math.exp(0.5 * (x * x - _ENDS[layer + 1] ** 2))
        if low + uniform(state) * (high - low) < 1.0:
            return x


@kernel
def _tail(state):
    """Return a standard normal number, given that it is above `_TAIL`."""
    while True:
        x = math.log(1.0 - uniform(state)) / _TAIL
        y = math.log(1.0 - uniform(state))
        if -2.0 * y >= x * x:
            return _TAIL - x


def start_parameters(start):
    """Return (5,): angle and velocity of a `Start`, and xx, vx, vv of its covariance's Cholesky factor."""
    spread = np.zeros((2, 2)) if start.covariance is None else np.linalg.cholesky(np.array(start.covariance))
    return np.array([start.angle, start.velocity, spread[0, 0], spread[1, 0], spread[1, 1]])


@kernel
def draw_start(stream, start):
    """Return (angle, velocity) at τ = 0; a start at a point takes no random numbers."""
    angle, velocity, xx, vx, vv = start
    if xx > 0.0:
        first, second = normal(stream), normal(stream)
        angle, velocity = angle + xx * first, velocity + vx * first + vv * second
    return angle, velocity
