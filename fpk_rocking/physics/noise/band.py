"""Shinozuka noise (paper 4): a sum of N harmonics with random frequencies and phases, at any time or on a uniform grid.

    eta(t) = sigma sqrt(2/N) sum cos(nu_n t + phi_n)

Time is counted in forcing cycles, a whole number and a fraction, frequencies in turns per cycle and phases in turns:
then the phase at a late cycle is reduced exactly, where the product nu_n t of a large t would lose digits.

On a grid the samples are made in chunks of 2 m + 1 about a centre. Each sample is one rotation away from the centre, by
the same angle in every chunk, so a chunk is a product of small matrices; and as cosines are even and sines odd, one
product serves the samples on both sides. The centres move on by rotation and are anchored afresh now and then.
"""

import math
from typing import NamedTuple

import numpy as np

from fpk_rocking.base.jit import kernel

ANCHOR_CYCLES = 16
"""Cycles between fresh anchors; the rotations between them, some 200, cost about 1e-14 of the noise's amplitude."""

_LANES = 8
_GRAIN = 2.0**24

# Taylor coefficients of sin(pi r)/r and cos(pi r) in r^2, for `circle`.
S0, S1, S2, S3, S4, S5, S6, S7, S8, S9, S10 = (
    (-1) ** k * math.pi ** (2 * k + 1) / math.factorial(2 * k + 1) for k in range(11)
)
C1, C2, C3, C4, C5, C6, C7, C8, C9, C10 = ((-1) ** k * math.pi ** (2 * k) / math.factorial(2 * k) for k in range(1, 11))


class Realization(NamedTuple):
    """One realization, and the rotations that sample it on a grid; M is the number of harmonics, padded with zeros.

    `ratios`, `phases`, `weights` (M,): turns per cycle, phase in turns, amplitude. `cosines`, `sines` (M,): the
    weighted harmonics at the centre of the present chunk. `hop` (2, M): cosine and sine of the rotation to the next
    centre in a cycle, `wrap` (2, M): to the first centre of the next cycle. `even`, `odd` (m, M): cosines and sines of
    the rotations from a centre to the samples beside it, m padded to a multiple of 4.
    """

    ratios: np.ndarray
    phases: np.ndarray
    weights: np.ndarray
    cosines: np.ndarray
    sines: np.ndarray
    hop: np.ndarray
    wrap: np.ndarray
    even: np.ndarray
    odd: np.ndarray


@kernel
def allocate(count, half):
    """Make room for `count` harmonics sampled in chunks of 2 * half + 1; the realization is still to be written."""
    padded = (count + _LANES - 1) // _LANES * _LANES
    rows = (half + 3) // 4 * 4
    return Realization(
        np.zeros(padded),
        np.zeros(padded),
        np.zeros(padded),
        np.zeros(padded),
        np.zeros(padded),
        np.zeros((2, padded)),
        np.zeros((2, padded)),
        np.zeros((rows, padded)),
        np.zeros((rows, padded)),
    )


@kernel
def turns(ratio, phase, cycle, fraction):
    """Phase of a harmonic in turns, less whole turns of full cycles; exact to rounding for ratio * cycle < 5e8."""
    coarse = math.floor(ratio * _GRAIN) / _GRAIN
    whole = coarse * cycle
    return (whole - math.floor(whole)) + (ratio - coarse) * cycle + ratio * fraction + phase


@kernel(inline="always")
def circle(angle):
    """Cosine and sine of an angle in turns, to 1e-15; free of branches and calls, so that loops become vectors."""
    r = angle - math.floor(angle + 0.5)
    q = r * r
    # Taylor series at half the angle, at most a quarter turn.
    s = S4 + q * (S5 + q * (S6 + q * (S7 + q * (S8 + q * (S9 + q * S10)))))
    c = C4 + q * (C5 + q * (C6 + q * (C7 + q * (C8 + q * (C9 + q * C10)))))
    s = r * (S0 + q * (S1 + q * (S2 + q * (S3 + q * s))))
    c = 1.0 + q * (C1 + q * (C2 + q * (C3 + q * c)))
    return 1.0 - 2.0 * s * s, 2.0 * s * c


@kernel
def noise_at(harmonics, cycle, fraction):
    """Evaluate the noise directly.

    Parameters
    ----------
    harmonics : Realization
        Only the realization in it is used.
    cycle : int or float
        Whole number of cycles.
    fraction : float
        The time in cycles after that.

    Returns
    -------
    float
        eta, nondimensional.
    """
    value = 0.0
    for n in range(harmonics.ratios.size):
        angle = turns(harmonics.ratios[n], harmonics.phases[n], cycle, fraction)
        value += harmonics.weights[n] * math.cos(2.0 * math.pi * angle)
    return value


@kernel(fastmath={"contract"}, borrows=True)
def prepare(harmonics, half, spacing):
    """Write the rotations `even`, `odd` to `half` samples beside a centre, `spacing` cycles apart."""
    ratios, even, odd = harmonics.ratios, harmonics.even, harmonics.odd
    set_rotation(ratios, spacing, even[0], odd[0])
    for j in range(1, half):
        for n in range(ratios.size):
            even[j, n] = even[0, n] * even[j - 1, n] - odd[0, n] * odd[j - 1, n]
            odd[j, n] = odd[0, n] * even[j - 1, n] + even[0, n] * odd[j - 1, n]


@kernel(fastmath={"contract"}, borrows=True)
def set_rotation(ratios, cycles, cosines, sines):
    """Write the rotations of the harmonics over a time given in cycles, as for `hop` and `wrap`."""
    for n in range(ratios.size):
        c, s = circle(ratios[n] * cycles)
        cosines[n] = c
        sines[n] = s


@kernel(fastmath={"contract"}, borrows=True)
def anchor(harmonics, cycle, fraction):
    """Put the centre at a time given in cycles, directly."""
    for n in range(harmonics.ratios.size):
        c, s = circle(turns(harmonics.ratios[n], harmonics.phases[n], cycle, fraction))
        harmonics.cosines[n] = harmonics.weights[n] * c
        harmonics.sines[n] = harmonics.weights[n] * s


@kernel(fastmath={"contract"}, borrows=True)
def rotate(harmonics, rotation):
    """Move the centre on by a rotation (2, M): `hop` or `wrap`."""
    for n in range(harmonics.ratios.size):
        c, s = harmonics.cosines[n], harmonics.sines[n]
        harmonics.cosines[n] = c * rotation[0, n] - s * rotation[1, n]
        harmonics.sines[n] = s * rotation[0, n] + c * rotation[1, n]


@kernel(fastmath={"contract", "reassoc"}, borrows=True)
def add_chunk(harmonics, half, out):
    """Add the noise at the centre and at `half` samples on each side of it to `out` (2 * half + 1,).

    The centre is sample `half`. Four offsets at a time share the loads of the centre's harmonics.
    """
    cosines, sines, even, odd = harmonics.cosines, harmonics.sines, harmonics.even, harmonics.odd
    total = 0.0
    for n in range(cosines.size):
        total += cosines[n]
    out[half] += total
    for j in range(0, half, 4):
        e0 = e1 = e2 = e3 = 0.0
        o0 = o1 = o2 = o3 = 0.0
        for n in range(cosines.size):
            c, s = cosines[n], sines[n]
            e0 += c * even[j, n]
            e1 += c * even[j + 1, n]
            e2 += c * even[j + 2, n]
            e3 += c * even[j + 3, n]
            o0 += s * odd[j, n]
            o1 += s * odd[j + 1, n]
            o2 += s * odd[j + 2, n]
            o3 += s * odd[j + 3, n]
        _pair(out, half, j + 1, e0, o0)
        _pair(out, half, j + 2, e1, o1)
        _pair(out, half, j + 3, e2, o2)
        _pair(out, half, j + 4, e3, o3)


@kernel(inline="always", borrows=True)
def _pair(out, half, offset, even, odd):
    if offset <= half:
        out[half + offset] += even - odd
        out[half - offset] += even + odd
