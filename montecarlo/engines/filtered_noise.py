"""Filtered noise over equal intervals of time: drawn exactly in law, and as a polynomial within an interval.

Over an interval the filter and the flight of a slender block, which are one linear system, are drawn together from
their exact Gaussian law: the filter's states z at the interval's end, and the angle and velocity that the noise adds to
the flight. The noise within the interval is the polynomial of least degree that has the drawn states at both ends and
moves a flight by what was drawn: the conditional mean given all that, up to relative order (interval × filter rate).

Noise without a derivative crosses the level of lift-off between two such states, and keeps a block rattling that a
smooth force would let rest. Where an event cannot be excluded it is therefore drawn in equal parts of the interval
too, given all that was drawn for the interval: parts are drawn forward from the states at the begin, and what they miss
at the end is shared out by its covariance with each part, which is exact for Gaussian noise. Their random numbers
are a function of the interval's, so that the noise is the same function of time whether its parts are drawn or not.
"""

import math
from typing import NamedTuple

import numpy as np

from fpk_rocking.base.basis import bernstein_basis, gauss_legendre
from fpk_rocking.base.jit import kernel
from fpk_rocking.physics.motion import TERMS
from fpk_rocking.physics.noise.state_space import transition_and_factor
from montecarlo.engines.random import hash_word, normal
from montecarlo.tuning import TUNING


class PartTables(NamedTuple):
    """Law of noise without a derivative over equal parts of an interval; m of them, or 0 where none are drawn.

    `move`, `spread`, `shape`, `powers`: as of `NoiseTables`, for a part. `hyperbolic` (2,): cosh and sinh of its
    duration. `gain` (m, n + 2, n + 2): by how much each part is changed for what they miss in the end. `margin`: how
    far the noise may leave its polynomial over the interval, times the envelope. `slowest`: speed below which a block
    may come to rest in an interval.
    """

    move: np.ndarray
    spread: np.ndarray
    shape: np.ndarray
    powers: np.ndarray
    hyperbolic: np.ndarray
    gain: np.ndarray
    margin: float
    slowest: float


class NoiseTables(NamedTuple):
    """Law of filtered noise over an interval; n states, and a polynomial of degree d.

    `stationary` (n, n): Cholesky factor of the states at τ = 0, of noise of variance 1. `move` (n + 2, n), `spread`
    (n + 2, n + 2): mean and Cholesky factor of states, angle and velocity at an interval's end. `shape`
    (d + 1, 2n + 2): Bernstein coefficients of the polynomial from the states at both ends and the flight; `powers`
    (d + 1, d + 1): its coefficients in the time from them. `parts`: of the interval.
    """

    stationary: np.ndarray
    move: np.ndarray
    spread: np.ndarray
    shape: np.ndarray
    powers: np.ndarray
    parts: PartTables


def noise_tables(noise, span):
    """Return the `NoiseTables` of a noise for intervals of a duration `span`."""
    space, sigma = noise.space, math.sqrt(noise.variance)
    move, spread = _law(space, span, sigma)
    polynomial = _polynomial_tables(space, span, sigma)
    return NoiseTables(
        np.linalg.cholesky(space.correlation), move, spread, *polynomial, _part_tables(space, span, sigma)
    )


def _law(space, span, sigma):
    """Return `move` (n + 2, n) and `spread` (n + 2, n + 2) of `NoiseTables`, for a filter of unit variance.

    Rows are the states, then angle and velocity of the flight. Time counts in intervals within: every entry is then
    about 1 or less, and none lost in the rounding of another.
    """
    n = space.order
    drift = np.zeros((n + 2, n + 2))
    drift[:n, :n] = span * space.drift
    drift[n, n + 1], drift[n + 1, n], drift[n + 1, :n] = 1.0, span * span, space.output
    source = np.append(math.sqrt(span) * space.input, [0.0, 0.0])
    phi, spread = transition_and_factor(drift, source, 1.0)
    # Angle and velocity of the flight in their own units, and as strong as the noise.
    sizes = np.append(np.ones(n), [sigma * span * span, sigma * span])[:, None]
    return sizes * phi[:, :n], sizes * spread


def _part_tables(space, span, sigma):
    """Return the `PartTables` of an interval; of no part for smooth noise."""
    n, count = space.order, 0 if space.smooth or sigma == 0.0 else TUNING.filtered_parts
    length = span / max(count, 1)
    move, spread = _law(space, length, sigma)
    keep, swap = math.cosh(length), math.sinh(length)
    # All as linear functions of the m (n + 2) normal numbers that are drawn for the parts.
    drawn, ends = np.zeros((count, n + 2, count * (n + 2))), np.zeros((n + 2, count * (n + 2)))
    for k in range(count):
        drawn[k] = move @ ends[:n]
        drawn[k, :, k * (n + 2) : (k + 1) * (n + 2)] += spread
        ends = drawn[k] + np.concatenate([np.zeros((n, ends.shape[1])), [[keep, swap], [swap, keep]] @ ends[n:]])
    sizes = np.linalg.norm(ends, axis=1) if count else np.ones(n + 2)
    gain = drawn @ (np.linalg.pinv(ends / sizes[:, None]) / sizes)
    # A Brownian bridge as rough as the noise has this standard deviation at its middle.
    bridge = 0.5 * sigma * abs(float(space.output @ space.input)) * math.sqrt(span)
    margin = TUNING.filtered_margin * bridge if count else 0.0
    shape, powers = _polynomial_tables(space, length, sigma)
    return PartTables(move, spread, shape, powers, np.array([keep, swap]), gain, margin, TUNING.filtered_slowest * span)


def polynomial_degree(space):
    """Return the degree, 3 or 5, of the polynomial that stands for noise of a `StateSpace` within an interval.

    It has the values of the flight and of the noise at both ends, and of the noise's derivative where it has one.
    """
    return 5 if space.smooth else 3


def _polynomial_tables(space, span, sigma):
    """Return `shape` (d + 1, 2n + 2) and `powers` (d + 1, d + 1) of `NoiseTables`."""
    n, degree = space.order, polynomial_degree(space)
    shape = np.zeros((degree + 1, 2 * n + 2))
    shape[0, :n] = shape[degree, n : 2 * n] = sigma * space.output
    if space.smooth:
        slope = span * sigma * (space.output @ space.drift) / degree
        shape[1, :n], shape[degree - 1, n : 2 * n] = sigma * space.output + slope, sigma * space.output - slope
    middle = degree // 2
    # What a polynomial adds to a flight, by its Bernstein coefficients.
    moments = _response(degree, span, 0.0, span)[0]
    right = -moments @ shape
    right[:, 2 * n :] = np.eye(2)
    shape[middle : middle + 2] = np.linalg.solve(moments[:, middle : middle + 2], right)
    powers = np.zeros((degree + 1, degree + 1))
    for k in range(degree + 1):
        for i in range(degree - k + 1):
            powers[k + i, k] = math.comb(degree, k) * math.comb(degree - k, i) * (-1) ** i
    return shape, powers / span ** np.arange(degree + 1)[:, None]


def _response(degree, span, begin, end):
    """Return (2, 2, degree + 1): angle [:, 0] and velocity [:, 1] that forces add to a flight which ends at `span`.

    The forces act from `begin` to `end`: [0] the Bernstein polynomials of an interval [0, `span`], [1] these times the
    time since `begin`.
    """
    points, weights = gauss_legendre(20, -1.0, 1.0)
    since = 0.5 * (end - begin) * (1.0 + points)
    t = (begin + since) / span
    left = span * (1.0 - t)
    weights = 0.5 * (end - begin) * weights * np.stack([np.sinh(left), np.cosh(left)])  # what an impulse adds
    return np.stack([weights @ bernstein_basis(t, degree).T, (weights * since) @ bernstein_basis(t, degree).T])


class EnvelopeTables(NamedTuple):
    """The envelope of the noise over m intervals, linear in pieces that end at its kinks; all empty without one.

    `first` (m + 1,): number of the first piece in each interval. `begins`, `ends` (pieces,): times since the interval's
    beginning. `strength` (pieces, 2): the envelope at a piece's beginning, and its slope. `strongest` (m,): its largest
    value in an interval. `response` (m, 2, d + 1): angle and velocity that the Bernstein polynomials of degree d, times
    the envelope, add to a flight.
    """

    first: np.ndarray
    begins: np.ndarray
    ends: np.ndarray
    strength: np.ndarray
    strongest: np.ndarray
    response: np.ndarray


def envelope_tables(envelope, grid, degree):
    """Return the `EnvelopeTables` of an `Envelope`, or of None, on a grid, for noise of a `degree`."""
    if envelope is None:
        empty = np.empty(0)
        return EnvelopeTables(np.zeros(0, int), empty, empty, np.empty((0, 2)), empty, np.empty((0, 2, degree + 1)))
    span = grid.spacing
    first, owner, begins, ends = _cut_at_kinks(np.sort(envelope.kinks) / span, grid.count)
    strength = _linear_pieces(envelope, owner + begins, owner + ends, span)
    begins, ends = span * begins, span * ends
    strongest = np.zeros(grid.count)
    np.maximum.at(strongest, owner, np.maximum(strength[:, 0], strength[:, 0] + strength[:, 1] * (ends - begins)))
    moves = np.einsum("pn,ncd->pcd", strength[first[:-1]], _response(degree, span, 0.0, span))
    for j in np.nonzero(np.diff(first) > 1)[0]:
        parts = range(first[j], first[j + 1])
        moves[j] = sum(np.tensordot(strength[p], _response(degree, span, begins[p], ends[p]), 1) for p in parts)
    return EnvelopeTables(first, begins, ends, strength, strongest, moves)


def _cut_at_kinks(kinks, count):
    """Cut `count` intervals at the kinks (n,) inside them, ascending; return (first, owner, begins, ends).

    `owner` (pieces,): number of a piece's interval; `begins`, `ends`: since its beginning. All times count in
    intervals.
    """
    inside = kinks[(np.abs(kinks - np.rint(kinks)) > 1e-9) & (kinks > 0.0) & (kinks < count)]
    edges = np.sort(np.concatenate([np.arange(count), inside]))
    owner = np.floor(edges).astype(int)
    begins = edges - owner
    ends = np.append(begins[1:], 0.0)
    return np.searchsorted(owner, np.arange(count + 1)), owner, begins, np.where(ends == 0.0, 1.0, ends)


def _linear_pieces(envelope, begins, ends, span):
    """Return (pieces, 2): the envelope at the beginnings of pieces, in intervals since τ = 0, and its slopes by τ."""
    if len(envelope.kinks) == 0:
        values = envelope.value(span * begins)
        return np.stack([values, (envelope.value(span * ends) - values) / (span * (ends - begins))], axis=-1)
    strength = envelope.series(0.5 * span * (begins + ends), 2)
    strength[:, 0] -= 0.5 * span * (ends - begins) * strength[:, 1]
    return strength


class NoiseWorkspace(NamedTuple):
    """The noise in an interval, without the factor of its envelope, as far as a realization has come.

    `drawn` (2n + 2,): the states at the interval's beginning and at its end, and the angle and velocity that the noise
    adds to a flight over it. `normals` (n + 2,): scratch. `bernstein` (d + 1,): its Bernstein coefficients; `signal`
    (TERMS,): its coefficients in the time since the interval's beginning. `stream` (8,) uint64: random numbers of its
    parts, and as far as these are drawn; `parts` (m, 2n + 2): what `drawn` is, for each of them.
    """

    drawn: np.ndarray
    normals: np.ndarray
    bernstein: np.ndarray
    signal: np.ndarray
    stream: np.ndarray
    parts: np.ndarray


@kernel
def allocate_noise(tables):
    """Return the `NoiseWorkspace` for some `NoiseTables`."""
    n, terms = tables.stationary.shape[0], tables.powers.shape[0]
    parts = np.zeros((tables.parts.gain.shape[0], 2 * n + 2))
    words = np.zeros(8, np.uint64)
    return NoiseWorkspace(np.zeros(2 * n + 2), np.empty(n + 2), np.empty(terms), np.empty(TERMS), words, parts)


@kernel
def draw_first_states(stream, tables, noise):
    """Draw the filter's n states at τ = 0 into `noise.drawn[n:2 * n]`."""
    drawn, normals, n = noise.drawn, noise.normals, tables.stationary.shape[0]
    for i in range(n):
        normals[i] = normal(stream)
        drawn[n + i] = 0.0
        for k in range(i + 1):
            drawn[n + i] += tables.stationary[i, k] * normals[k]


@kernel(fastmath={"contract"}, forceinline=True)
def draw_next_interval(stream, tables, noise):
    """Draw the next interval into `noise.drawn` (2n + 2,), whose last states become the first.

    Where the interval has parts, the random numbers for them are set up in `noise.stream`.
    """
    drawn, n = noise.drawn, tables.stationary.shape[0]
    for i in range(n):
        drawn[i] = drawn[n + i]
    _draw_ends(stream, tables.move, tables.spread, drawn, noise.normals)
    if noise.parts.shape[0] > 0:
        for i in range(4):
            noise.stream[i] = hash_word(stream[i])


@kernel(fastmath={"contract"}, forceinline=True)
def _draw_ends(stream, move, spread, drawn, normals):
    """Draw the states at an end, and what the noise adds to a flight, into `drawn[n:]`, from the states `drawn[:n]`."""
    n = move.shape[1]
    for i in range(n + 2):
        normals[i] = normal(stream)
    for i in range(n + 2):
        total = 0.0
        for k in range(n):
            total += move[i, k] * drawn[k]
        for k in range(i + 1):
            total += spread[i, k] * normals[k]
        drawn[n + i] = total


@kernel(fastmath={"contract"})
def draw_parts(tables, noise):
    """Draw the parts of an interval into `noise.parts`, given what was drawn for it; the same if called again."""
    rows, drawn, missing, n = noise.parts, noise.drawn, noise.normals, noise.normals.size - 2
    x, v, stream = 0.0, 0.0, noise.stream[4:]
    stream[:] = noise.stream[:4]
    for k in range(rows.shape[0]):
        for i in range(n):
            rows[k, i] = drawn[i] if k == 0 else rows[k - 1, n + i]
        _draw_ends(stream, tables.move, tables.spread, rows[k], noise.normals)
        x, v = (
            tables.hyperbolic[0] * x + tables.hyperbolic[1] * v + rows[k, 2 * n],
            tables.hyperbolic[1] * x + tables.hyperbolic[0] * v + rows[k, 2 * n + 1],
        )
    for i in range(n):
        missing[i] = drawn[n + i] - rows[rows.shape[0] - 1, n + i]
    missing[n], missing[n + 1] = drawn[2 * n] - x, drawn[2 * n + 1] - v
    for k in range(rows.shape[0]):
        for i in range(n + 2):
            for m in range(n + 2):
                rows[k, n + i] += tables.gain[k, i, m] * missing[m]
        for i in range(n if k > 0 else 0):
            rows[k, i] = rows[k - 1, n + i]


@kernel(fastmath={"contract"}, forceinline=True)
def bound_noise(j, shape, drawn, bernstein, envelope, margin):
    """Write the noise in interval j, or a part of it, `shape` @ `drawn`, to `bernstein` (d + 1,); return its bounds.

    (low, high) are with the envelope: the polynomial lies between its coefficients, and the noise not farther from it
    than a `margin`.
    """
    low, high = math.inf, -math.inf
    for i in range(bernstein.size):
        value = 0.0
        for k in range(drawn.size):
            value += shape[i, k] * drawn[k]
        bernstein[i] = value
        low, high = min(low, value), max(high, value)
    low, high = low - margin, high + margin
    if envelope.strongest.size > 0:
        most = envelope.strongest[j]
        return min(most * low, 0.0), max(most * high, 0.0)
    return low, high


@kernel(fastmath={"contract"})
def write_polynomial(tables, noise):
    """Write the polynomial in `noise.bernstein` to `noise.signal` (TERMS,); `tables` are of an interval or a part."""
    signal, bernstein = noise.signal, noise.bernstein
    signal[:] = 0.0
    for k in range(bernstein.size):
        for i in range(k + 1):
            signal[k] += tables.powers[k, i] * bernstein[i]


@kernel(forceinline=True)
def response_to_noise(j, envelope, noise):
    """Return (angle, velocity) that the noise adds to a flight of a slender block over interval j."""
    n = noise.drawn.size - 2
    if envelope.response.size == 0:
        return noise.drawn[n], noise.drawn[n + 1]
    x, v = 0.0, 0.0
    for i in range(noise.bernstein.size):
        x += envelope.response[j, 0, i] * noise.bernstein[i]
        v += envelope.response[j, 1, i] * noise.bernstein[i]
    return x, v
