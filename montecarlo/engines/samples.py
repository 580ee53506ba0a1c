"""Samples of the interpolant of band noise on an engine's grid, made in chunks as a realization goes on."""

import numpy as np

from fpk_rocking.base.jit import kernel
from fpk_rocking.physics.noise import band
from fpk_rocking.physics.noise.band import WIDTH

HALF = 8
"""Samples on each side of the centre of a chunk of noise."""

CHUNK = 2 * HALF + 1

_LEAD = WIDTH // 2 + HALF
"""Centre of the samples that the CHUNK intervals from number 0 on still lack."""


@kernel
def allocate(harmonics):
    """Make room for a number of harmonics, and for the samples (WIDTH - 1 + CHUNK,), the last CHUNK of them new."""
    return band.allocate_realization(harmonics, HALF), np.zeros(WIDTH - 1 + CHUNK)


@kernel(fastmath={"contract"}, borrows=True)
def first_samples(harmonics, samples, cycle, problem):
    """Tabulate the rotations of harmonics that are those of the interpolant, and make the first samples."""
    spacing = problem.spacing / (problem.count * problem.spacing)
    band.write_sample_rotations(harmonics, HALF, spacing)
    band.write_rotation(harmonics.ratios, CHUNK * spacing, harmonics.hop[0], harmonics.hop[1])
    band.set_centre(harmonics, cycle, (_LEAD - CHUNK) / problem.count)
    extend(harmonics, samples)
    band.rotate_centre(harmonics, harmonics.hop)
    extend(harmonics, samples)


@kernel(forceinline=True, borrows=True)
def more_samples(harmonics, samples, number, cycle, problem):
    """Make the samples of CHUNK intervals from a number on, if the last ones are used up; tell whether they were."""
    used_up = number % CHUNK == 0 and number > 0
    if used_up:
        _further(harmonics, samples, number, cycle, problem.count)
    return used_up


@kernel(borrows=True)
def _further(harmonics, samples, number, cycle, intervals):
    if number // CHUNK % ((band.ANCHOR_CYCLES * intervals + CHUNK - 1) // CHUNK) == 0:
        centre = number + _LEAD
        band.set_centre(harmonics, cycle + centre // intervals, centre % intervals / intervals)
    else:
        band.rotate_centre(harmonics, harmonics.hop)
    extend(harmonics, samples)


@kernel(fastmath={"contract"}, borrows=True)
def extend(harmonics, samples):
    """Make the next CHUNK samples about the centre of the harmonics."""
    for k in range(WIDTH - 1):
        samples[k] = samples[k + CHUNK]
    samples[WIDTH - 1 :] = 0.0
    band.add_samples(harmonics, HALF, samples[WIDTH - 1 :])


# Sixteen products in one expression: a loop over them would keep the sums in memory, at three times the cost.
@kernel(fastmath={"contract"}, forceinline=True, borrows=True)
def interpolate(out, base, s, g, k):
    """Write `base` plus the samples `g` from number k on times the columns of `s` (WIDTH, n): the noise in an interval.

    With the polynomials of the interpolant that is the noise as a polynomial, with their values its values.
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
