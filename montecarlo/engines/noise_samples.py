"""Samples of band noise, in chunks as a realization goes on, and what is interpolated from them.

The engine `exact` needs the noise over each interval of its grid: a polynomial, the product of `WIDTH` samples and the
polynomials of an interpolant (`physics.noise.band`). It makes `CHUNK` samples at once. Of the engine's `Parameters`
(`band_noise`) the grid, `halvings` and the interpolant are read.
"""

from typing import NamedTuple

import numpy as np

from fpk_rocking.base.jit import kernel
from fpk_rocking.physics.noise import band
from fpk_rocking.physics.noise.band import WIDTH, evaluate_compensation

HALF = 8
"""Samples on each side of the centre of a chunk of noise."""

CHUNK = 2 * HALF + 1


class Samples(NamedTuple):
    """Harmonics of the interpolant of a realization, and its last samples (WIDTH - 1 + CHUNK,), CHUNK of them new."""

    harmonics: band.Realization
    values: np.ndarray


@kernel
def allocate_samples(harmonics):
    """Return the named tuple `Samples`, of zeros, with room for a number of `harmonics` (int)."""
    return Samples(band.allocate_realization(harmonics, HALF), np.zeros(WIDTH - 1 + CHUNK))


@kernel
def divide_by_window(harmonics, parameters):
    """Turn `harmonics.weights` (M,), in place, from the noise's amplitudes into those of its interpolant's samples.

    `harmonics`: a `band.Realization`; of `parameters`, `Parameters` of `band_noise`, `compensation` and `ratio_scale`
    are read.
    """
    for n in range(harmonics.ratios.size):
        harmonics.weights[n] *= evaluate_compensation(
            parameters.compensation, harmonics.ratios[n] * parameters.ratio_scale
        )


@kernel(inline="always")
def write_first_samples(samples, cycle, parameters):
    """Write the samples of the noise for the first CHUNK intervals from a `cycle` (its number) on, and those before.

    They are written to `samples.values` (WIDTH - 1 + CHUNK,), nondimensional, and `samples.harmonics` are set for the
    next ones; `samples`: a `Samples`. Of `parameters`, `Parameters` of `band_noise`, the grid and `halvings` are read.
    """
    harmonics, parts = samples.harmonics, 1 << parameters.halvings
    spacing = parameters.grid.spacing / (parameters.grid.count * parameters.grid.spacing) * parts
    band.write_sample_rotations(harmonics, HALF, spacing)
    band.write_rotation(harmonics.ratios, CHUNK * spacing, harmonics.hop[0], harmonics.hop[1])
    band.set_centre(harmonics, cycle, (WIDTH // 2 + HALF - CHUNK) * parts / parameters.grid.count)
    _write_chunk(harmonics, samples.values)
    band.rotate_centre(harmonics, harmonics.hop)
    _write_chunk(harmonics, samples.values)


@kernel(forceinline=True)
def write_next_samples(samples, number, cycle, parameters):
    """Write the next CHUNK samples of the noise to `samples`, a `Samples`, if the last are used up; return whether so.

    `number` (int) is that of the interval for which samples are wanted, counted from the begin of the run at `cycle`.
    Of `parameters`, `Parameters` of `band_noise`, the grid and `halvings` are read.
    """
    sample, part = sample_and_part(number, parameters)
    used_up = part == 0 and sample % CHUNK == 0 and number > 0
    if used_up:
        _write_further(samples.harmonics, samples.values, sample, cycle, parameters.grid.count, parameters.halvings)
    return used_up


@kernel(forceinline=True)
def sample_and_part(number, parameters):
    """Return (sample, part), int: the last sample of the noise before an interval, and the interval's place after it.

    Samples and the interval's `number` count from the begin of the run; of the 2^`halvings` intervals between two
    samples the first has the part 0. Of `parameters`, `Parameters` of `band_noise`, `halvings` is read.
    """
    sample = number >> parameters.halvings
    return sample, number - (sample << parameters.halvings)


@kernel
def _write_further(harmonics, values, sample, cycle, intervals, halvings):
    """Move the centre of `harmonics`, a `band.Realization`, on by a chunk, or set it anew; write the chunk's samples.

    They are written to `values` (WIDTH - 1 + CHUNK,). `sample` counts samples, 2^`halvings` intervals apart, from the
    begin of the run at `cycle`; a cycle has a number of `intervals`.
    """
    if sample // CHUNK % ((band.ANCHOR_CYCLES * intervals + CHUNK - 1) // CHUNK) == 0:
        centre = (sample + WIDTH // 2 + HALF) << halvings
        band.set_centre(harmonics, cycle + centre // intervals, centre % intervals / intervals)
    else:
        band.rotate_centre(harmonics, harmonics.hop)
    _write_chunk(harmonics, values)


@kernel(fastmath={"contract"})
def _write_chunk(harmonics, values):
    """Write the CHUNK samples of the noise about the centre of the harmonics, behind the last WIDTH - 1 samples.

    `harmonics`: a `band.Realization`, whose centre the caller moved; `values`: (WIDTH - 1 + CHUNK,), nondimensional.
    """
    for k in range(WIDTH - 1):
        values[k] = values[k + CHUNK]
    values[WIDTH - 1 :] = 0.0
    band.add_samples(harmonics, HALF, values[WIDTH - 1 :])


# Sixteen products in one expression: a loop over them would keep the sums in memory, at three times the cost.
@kernel(fastmath={"contract"}, forceinline=True)
def interpolate(out, base, s, g, k):
    """Write to `out` (n,) the sums `base` (n,) plus g[k : k + WIDTH] @ s, the noise in an interval.

    `g` are samples of the noise, and the columns of `s` (WIDTH, n) the weights of WIDTH of them, from number k on. With
    the polynomials of the interpolant as `s` the result is the noise as a polynomial, with their values its values.
    """
    a0, a1, a2, a3, a4, a5, a6, a7 = g[k], g[k + 1], g[k + 2], g[k + 3], g[k + 4], g[k + 5], g[k + 6], g[k + 7]
    k += 8
    b0, b1, b2, b3, b4, b5, b6, b7 = g[k], g[k + 1], g[k + 2], g[k + 3], g[k + 4], g[k + 5], g[k + 6], g[k + 7]
    for n in range(out.size):
        first = (a0 * s[0, n] + a1 * s[1, n]) + (a2 * s[2, n] + a3 * s[3, n])
        second = (a4 * s[4, n] + a5 * s[5, n]) + (a6 * s[6, n] + a7 * s[7, n])
        third = (b0 * s[8, n] + b1 * s[9, n]) + (b2 * s[10, n] + b3 * s[11, n])
        fourth = (b4 * s[12, n] + b5 * s[13, n]) + (b6 * s[14, n] + b7 * s[15, n])
        out[n] = base[n] + ((first + second) + (third + fourth))


@kernel(fastmath={"contract"})
def write_nodes(samples, node, ends):
    """Write to `node` (CHUNK,) the noise's share of P at the ends of the CHUNK intervals that new samples complete.

    `samples` (WIDTH - 1 + CHUNK,): of the noise, weighted for P; `ends` (2, WIDTH): as of `ClosedForm`, of which row 0,
    values, is used. All are nondimensional.
    """
    node[:] = 0.0
    for i in range(0, WIDTH, 4):
        a, b, c, d = ends[0, i], ends[0, i + 1], ends[0, i + 2], ends[0, i + 3]
        for k in range(CHUNK):
            node[k] += (a * samples[k + i] + b * samples[k + i + 1]) + (c * samples[k + i + 2] + d * samples[k + i + 3])
