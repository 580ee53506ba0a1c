"""Band noise, a sum of harmonics: how it is drawn, and its samples in chunks as a realization goes on.

All of a realization's noise is drawn with its start; `fpk_rocking.physics.noise.band` makes functions of time of it. In
an interval it is a polynomial: the product of `WIDTH` samples and an interpolant. `CHUNK` samples are made at once.
"""

import math
from typing import NamedTuple

import numpy as np

from fpk_rocking.base.jit import kernel
from fpk_rocking.physics.noise import band
from fpk_rocking.physics.noise.band import WIDTH, evaluate_compensation
from montecarlo.engines.random import draw_start, uniform, uniform_pairs

HALF = 8
"""Samples on each side of the centre of a chunk of noise."""

CHUNK = 2 * HALF + 1


class Band(NamedTuple):
    """The band, in turns per table period, and its harmonics."""

    low_ratio: float
    ratio_width: float
    weight: float  # amplitude of a harmonic; its root mean square if random
    harmonics: int
    parts: int  # equal parts of the band with as many harmonics each; 1: independent
    gaussian: bool  # whether the amplitudes are random


def band_of_scene(scene, period):
    """Return the `Band` of a scene, by turns in a time `period`; no harmonics without noise."""
    if scene.noise.kind != "band":
        return Band(0.0, 0.0, 0.0, 0, 1, False)
    low, high = (frequency * period / (2.0 * math.pi) for frequency in scene.noise.band)
    weight = math.sqrt(2.0 * scene.noise.variance / scene.noise.harmonics)
    stratified = scene.noise.frequencies == "stratified"
    parts = scene.noise.harmonics if stratified else 1
    return Band(low, high - low, weight, scene.noise.harmonics, parts, stratified)


@kernel(inline="always")
def draw_start_and_noise(stream, start, band, harmonics):
    """Draw (angle, velocity) at τ = 0, and `ratios`, `phases` (turns) and `weights` (n,) of the harmonics."""
    angle, velocity = draw_start(stream, start)
    uniform_pairs(stream, harmonics.ratios, harmonics.phases, band.harmonics)
    for n in range(band.harmonics):
        share = (n % band.parts + harmonics.ratios[n]) / band.parts
        harmonics.ratios[n] = band.low_ratio + band.ratio_width * share
        harmonics.weights[n] = band.weight
    if band.gaussian:
        # Exponential in square, of mean 1: two Gaussian coefficients, of the cosine and of the sine.
        for n in range(band.harmonics):
            harmonics.weights[n] *= math.sqrt(-math.log(1.0 - uniform(stream)))
    return angle, velocity


def largest_noise(noise, harmonics):
    """Return a bound of |η| without its envelope; Gaussian noise passes its own, 12 deviations, once in 4e-33."""
    if harmonics.gaussian:
        return 12.0 * math.sqrt(noise.variance)
    return harmonics.weight * harmonics.harmonics


class Samples(NamedTuple):
    """Harmonics of the interpolant of a realization, and its last samples (WIDTH - 1 + CHUNK,), CHUNK of them new."""

    harmonics: band.Realization
    values: np.ndarray


@kernel
def allocate_samples(harmonics):
    return Samples(band.allocate_realization(harmonics, HALF), np.zeros(WIDTH - 1 + CHUNK))


@kernel
def divide_by_window(harmonics, parameters):
    """Turn `harmonics.weights` (M,) from the noise's amplitudes into those of its interpolant's samples."""
    for n in range(harmonics.ratios.size):
        harmonics.weights[n] *= evaluate_compensation(
            parameters.compensation, harmonics.ratios[n] * parameters.ratio_scale
        )


@kernel(inline="always")
def write_first_samples(samples, cycle, parameters):
    """Write the samples for the first CHUNK intervals from a `cycle` on, and those before."""
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
    """Write the next CHUNK samples if the last are used up at interval `number` of the run; return whether so."""
    sample, part = sample_and_part(number, parameters)
    used_up = part == 0 and sample % CHUNK == 0 and number > 0
    if used_up:
        _write_further(samples.harmonics, samples.values, sample, cycle, parameters.grid.count, parameters.halvings)
    return used_up


@kernel(forceinline=True)
def sample_and_part(number, parameters):
    """Return (sample, part): the last sample before interval `number`, and the interval's place after it, from 0."""
    sample = number >> parameters.halvings
    return sample, number - (sample << parameters.halvings)


@kernel
def _write_further(harmonics, values, sample, cycle, intervals, halvings):
    """Move the centre on by a chunk, or set it anew, and write the chunk that begins with a `sample`."""
    if sample // CHUNK % ((band.ANCHOR_CYCLES * intervals + CHUNK - 1) // CHUNK) == 0:
        centre = (sample + WIDTH // 2 + HALF) << halvings
        band.set_centre(harmonics, cycle + centre // intervals, centre % intervals / intervals)
    else:
        band.rotate_centre(harmonics, harmonics.hop)
    _write_chunk(harmonics, values)


@kernel(fastmath={"contract"})
def _write_chunk(harmonics, values):
    """Write the CHUNK samples about the centre of the harmonics behind the last WIDTH - 1 `values`."""
    for k in range(WIDTH - 1):
        values[k] = values[k + CHUNK]
    values[WIDTH - 1 :] = 0.0
    band.add_samples(harmonics, HALF, values[WIDTH - 1 :])


# Sixteen products in one expression: a loop over them would keep the sums in memory, at three times the cost.
@kernel(fastmath={"contract"}, forceinline=True)
def interpolate(out, base, s, g, k):
    """Write to `out` (n,) the sums `base` (n,) plus g[k : k + WIDTH] @ s, s (WIDTH, n): the noise in an interval."""
    a0, a1, a2, a3, a4, a5, a6, a7 = g[k], g[k + 1], g[k + 2], g[k + 3], g[k + 4], g[k + 5], g[k + 6], g[k + 7]
    k += 8
    b0, b1, b2, b3, b4, b5, b6, b7 = g[k], g[k + 1], g[k + 2], g[k + 3], g[k + 4], g[k + 5], g[k + 6], g[k + 7]
    for n in range(out.size):
        first = (a0 * s[0, n] + a1 * s[1, n]) + (a2 * s[2, n] + a3 * s[3, n])
        second = (a4 * s[4, n] + a5 * s[5, n]) + (a6 * s[6, n] + a7 * s[7, n])
        third = (b0 * s[8, n] + b1 * s[9, n]) + (b2 * s[10, n] + b3 * s[11, n])
        fourth = (b4 * s[12, n] + b5 * s[13, n]) + (b6 * s[14, n] + b7 * s[15, n])
        out[n] = base[n] + ((first + second) + (third + fourth))
