"""Shinozuka noise (paper eq. 4): N harmonics of random frequencies and phases, at any time or on a uniform grid.

    eta(t) = sigma sqrt(2/N) sum cos(nu_n t + phi_n)

Time is counted in forcing cycles, a whole number and a fraction, frequencies in turns per cycle and phases in turns:
then the phase at a late cycle is reduced exactly, where the product nu_n t of a large t would lose digits.

On a grid the samples are made in chunks of 2 m + 1 about a centre. Each sample is one rotation away from the centre, by
the same angle in every chunk, so a chunk is a product of small matrices; and as cosines are even and sines odd, one
product serves the samples on both sides. The centres move on by rotation and are anchored afresh now and then.

Between coarse samples such a sum is interpolated to 3e-12, from 1.6 times the fewest possible: sampled at the spacing
d <= pi/(OVERSAMPLING b), b its highest frequency, after each harmonic has been divided by the transform of a window
psi; then the signal is sum_k psi((t - t_k)/d) g_k. What folds over from other bands is suppressed like
exp(-pi WIDTH sqrt(1 - 1/OVERSAMPLING)), psi being a Kaiser-Bessel window of WIDTH samples
(J. F. Kaiser, R. W. Schafer, IEEE Trans. ASSP 28, 105-107, 1980; as in nonuniform Fourier transforms, D. Potts,
G. Steidl, M. Tasche, 2001). Between two samples each piece of psi is a polynomial, and so is the interpolant.
"""

import functools
import math
from typing import NamedTuple

import numpy as np

from fpk_rocking.base.arrays import load
from fpk_rocking.base.checks import Array
from fpk_rocking.base.jit import kernel
from fpk_rocking.physics.motion import TERMS

ANCHOR_CYCLES = 16
"""Cycles between fresh anchors; the rotations between them, some 200, cost about 1e-14 of the noise's amplitude."""

_LANES = 8
"""Harmonics are padded to a multiple of it, the numbers in the widest vector registers."""

WIDTH, OVERSAMPLING = 16, 1.6
"""Samples under the window of the interpolation, and samples over the fewest possible: together they give 3e-12."""

_SHAPE, _ORDER = math.pi * WIDTH * (1.0 - 0.5 / OVERSAMPLING), 20
"""Shape of the Kaiser-Bessel window, and terms of the polynomial of `window_compensation`."""

_SINE = tuple((-1) ** k * math.pi ** (2 * k + 1) / math.factorial(2 * k + 1) for k in range(11))
_COSINE = tuple((-1) ** k * math.pi ** (2 * k) / math.factorial(2 * k) for k in range(11))
"""Taylor coefficients of sin(pi r)/r and cos(pi r) in r^2, for `cos_sin_of_turns`."""


class Realization(NamedTuple):
    """One realization, and the rotations that sample it on a grid; M is the number of harmonics, padded with zeros.

    `ratios`, `phases`, `weights` (M,): turns per cycle, phase in turns, amplitude. `cosines`, `sines` (M,): weighted
    harmonics at the centre of the present chunk. `hop`, `wrap` (2, M): cosine and sine of the rotation to the next
    centre in a cycle, and to the first one of the next cycle. `even`, `odd` (m, M): cosines and sines of the rotations
    from a centre to the samples beside it, m padded to a multiple of 4.
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
def allocate_realization(count, half):
    """A `Realization` of zeros for `count` harmonics in chunks of 2 `half` + 1 samples."""
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
def phase_in_turns(ratio, phase, cycle, fraction):
    """Phase of a harmonic, in turns, after `cycle` (a whole number) cycles and a `fraction` of one, less whole turns.

    It is exact to rounding for ratio * cycle < 5e8.
    """
    coarse = math.floor(ratio * 2.0**24) / 2.0**24
    turns = coarse * cycle
    return (turns - math.floor(turns)) + (ratio - coarse) * cycle + ratio * fraction + phase


@kernel(inline="always")
def cos_sin_of_turns(angle):
    """(cos, sin) of an angle in turns, to 1e-15; free of branches and calls, so that loops become vectors."""
    r = angle - math.floor(angle + 0.5)
    q = r * r
    # Taylor series at half the angle, at most a quarter turn.
    s = _SINE[4] + q * (_SINE[5] + q * (_SINE[6] + q * (_SINE[7] + q * (_SINE[8] + q * (_SINE[9] + q * _SINE[10])))))
    c = _COSINE[4] + q * (
        _COSINE[5] + q * (_COSINE[6] + q * (_COSINE[7] + q * (_COSINE[8] + q * (_COSINE[9] + q * _COSINE[10]))))
    )
    s = r * (_SINE[0] + q * (_SINE[1] + q * (_SINE[2] + q * (_SINE[3] + q * s))))
    c = 1.0 + q * (_COSINE[1] + q * (_COSINE[2] + q * (_COSINE[3] + q * c)))
    return 1.0 - 2.0 * s * s, 2.0 * s * c


@kernel(fastmath={"contract"})
def write_sample_rotations(harmonics, half, spacing):
    """Write `even`, `odd` (m, M) for `half` samples on a side of a centre, `spacing` cycles apart."""
    ratios, even, odd = harmonics.ratios, harmonics.even, harmonics.odd
    write_rotation(ratios, spacing, even[0], odd[0])
    for j in range(1, half):
        for n in range(ratios.size):
            even[j, n] = even[0, n] * even[j - 1, n] - odd[0, n] * odd[j - 1, n]
            odd[j, n] = odd[0, n] * even[j - 1, n] + even[0, n] * odd[j - 1, n]


@kernel(fastmath={"contract"})
def write_rotation(ratios, cycles, cosines, sines):
    """Write cosines and sines (M,) of the harmonics' phase changes over a time in cycles."""
    for n in range(ratios.size):
        c, s = cos_sin_of_turns(ratios[n] * cycles)
        cosines[n] = c
        sines[n] = s


@kernel(fastmath={"contract"})
def set_centre(harmonics, cycle, fraction):
    """Put the centre of a realization at a time directly, without a rotation."""
    for n in range(harmonics.ratios.size):
        c, s = cos_sin_of_turns(phase_in_turns(harmonics.ratios[n], harmonics.phases[n], cycle, fraction))
        harmonics.cosines[n] = harmonics.weights[n] * c
        harmonics.sines[n] = harmonics.weights[n] * s


@kernel(fastmath={"contract"})
def rotate_centre(harmonics, rotation):
    """Move the centre of a realization on by `rotation` (2, M), its `hop` or `wrap`."""
    for n in range(harmonics.ratios.size):
        c, s = harmonics.cosines[n], harmonics.sines[n]
        harmonics.cosines[n] = c * rotation[0, n] - s * rotation[1, n]
        harmonics.sines[n] = s * rotation[0, n] + c * rotation[1, n]


@kernel(fastmath={"contract", "reassoc"})
def add_samples(harmonics, half, out):
    """Add the noise at the centre of a realization and at `half` samples on each side to `out` (2 * half + 1,).

    Four offsets at a time share the loads of the centre's harmonics.
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


@kernel(inline="always")
def _pair(out, half, offset, even, odd):
    """Add even - odd and even + odd to `out` at the places half + offset and half - offset, if it has them."""
    if offset <= half:
        out[half + offset] += even - odd
        out[half - offset] += even + odd


def interpolant_polynomials(spacing: float, parts: int = 1) -> Array:
    """Polynomials (parts, WIDTH, TERMS) that interpolate the noise between two samples, in equal parts of that time.

    `spacing` is the duration of a part. Row i belongs to sample i - WIDTH/2 + 1 (0: before the parts, 1: after them);
    coefficients in the time since the middle of the part, lowest power first.
    """
    powers = (2.0 / np.longdouble(spacing)) ** np.arange(TERMS, dtype=np.longdouble)
    return np.array([(_window_pieces(part, parts) * powers).astype(float) for part in range(parts)])


@functools.cache
def _window_pieces(part, parts):
    """Polynomials (WIDTH, TERMS), in long double, of `interpolant_polynomials` for parts of duration 2."""
    # In long double where there is one: rounding of the window is what limits the derivative otherwise.
    order = np.arange(TERMS, dtype=np.longdouble)
    angles = np.longdouble("3.14159265358979323846264") * (order + 0.5) / TERMS
    nodes = np.cos(angles)
    places = (nodes + (2 * part + 1 - parts)) / parts
    window = _bessel(1.0 - ((places - 2.0 * order[:WIDTH, None] + (WIDTH - 1.0)) / WIDTH) ** 2) / _bessel(1.0)
    rows = window @ np.cos(order * angles[:, None]) * (2.0 / TERMS)
    rows[:, 0] *= 0.5
    return np.array([np.polynomial.chebyshev.cheb2poly(row) for row in rows])


def _bessel(square):
    """I0(_SHAPE sqrt(square)), in long double, as a power series, all terms of which are positive."""
    square = np.asarray(square, np.longdouble) * np.longdouble(0.5 * _SHAPE) ** 2
    term = total = np.ones_like(square)
    for k in range(1, 120):
        term = term * square / (k * k)
        total = total + term
    return total


@functools.cache
def window_compensation() -> Array:
    """Coefficients (_ORDER,) of 1/(transform of the interpolation's window), not to be written to.

    It is a polynomial in 2 (b d OVERSAMPLING/pi)^2 - 1; b is a frequency and d the spacing.
    """
    nodes = np.cos(np.pi * (np.arange(_ORDER) + 0.5) / _ORDER)
    argument = np.sqrt(_SHAPE**2 - 0.5 * (1.0 + nodes) * (0.5 * WIDTH * math.pi / OVERSAMPLING) ** 2)
    inverse = float(np.i0(_SHAPE)) * argument / (WIDTH * np.sinh(argument))
    return np.polynomial.chebyshev.cheb2poly(np.polynomial.chebyshev.chebfit(nodes, inverse, _ORDER - 1))


@kernel(inline="always")
def evaluate_compensation(coefficients, ratio):
    """The polynomial of `window_compensation` at `ratio` = frequency * spacing * OVERSAMPLING / pi, from 0 to 1."""
    square = 2.0 * ratio * ratio - 1.0
    value = coefficients[_ORDER - 1]
    for k in range(_ORDER - 2, -1, -1):
        value = value * square + coefficients[k]
    return value


@kernel(fastmath={"contract"})
def divide_by_stiffness(ratios, weights, frequency, compensation, ratio_scale):
    """Turn the amplitudes `weights` (n,) of the noise's harmonics, in place, into those of the interpolant of P.

    `ratios` (n,): frequencies in turns per table period; `frequency`: angular, of one turn; `ratio_scale`: from a ratio
    to the argument of `evaluate_compensation`.
    """
    for n in range(ratios.size):
        gain = -evaluate_compensation(compensation, ratios[n] * ratio_scale)
        omega = frequency * ratios[n]
        weights[n] *= gain / (1.0 + omega * omega)


@kernel(fastmath={"contract", "reassoc"})
def noise_slope(samples, k, slopes):
    """Derivative of the noise's share of P at the end of interval k of a chunk, by the interpolant's `slopes`."""
    total = 0.0
    for i in range(WIDTH):
        total += slopes[i] * samples[k + i]
    return total


@kernel(fastmath={"contract"}, forceinline=True)
def noise_at_points(values, part, g, k):
    """Noise, without its envelope, at the Gauss points of an interval, a SIMD vector.

    `values` (parts WIDTH, NODES): the interpolant's polynomials at the points, row WIDTH part + i for sample i; `g`:
    samples of a chunk, those of this interval from number `k` on.
    """
    row = WIDTH * part
    first = load(values, row) * g[k] + load(values, row + 1) * g[k + 1]
    second = load(values, row + 2) * g[k + 2] + load(values, row + 3) * g[k + 3]
    for i in range(4, WIDTH, 4):
        n = row + i
        first = first + (load(values, n) * g[k + i] + load(values, n + 1) * g[k + i + 1])
        second = second + (load(values, n + 2) * g[k + i + 2] + load(values, n + 3) * g[k + i + 3])
    return first + second


@kernel(forceinline=True)
def write_product(strength, noise, base, out):
    """Write to `out` (TERMS,) the polynomial `base` plus the product of the envelope's `strength` and the `noise`."""
    for n in range(TERMS):
        force = base[n]
        for i in range(min(n + 1, strength.size)):
            force += strength[i] * noise[n - i]
        out[n] = force
