"""Filtered noise: its filter sampled exactly at grid times, and closed-form flights between located impacts.

Over an interval of the grid the filter and the flight of a slender block, one linear system, are drawn together from
their exact Gaussian law. So a flight without an event is exact in law, however long the interval.

Where an event cannot be excluded, the noise within the interval is taken as the polynomial of least degree that has the
drawn states at both ends and moves a flight by what was drawn: the conditional mean given all that, up to relative
order (interval × filter rate). What it leaves out acts at events alone (docs/monte_carlo.md). Under an envelope, linear
in pieces that end at its kinks, the product of both is taken in flights too. For an exact block the polynomial is the
force in every flight (`physics.motion.collocation`): what it leaves out acts there through the equation's curvature.

Noise without a derivative crosses the level of lift-off between two such states, and keeps a block rattling that a
smooth force would let rest. There it is also drawn in equal parts of the interval: forward from the states at the
beginning, and what the parts miss at the end is shared out by its covariance with each, which is exact for Gaussian
noise. Their random numbers are a function of the interval's, so that the noise is the same function of time whether its
parts are drawn or not.
"""

import math
from typing import NamedTuple

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.base.arrays import borrowed, load
from fpk_rocking.base.basis import bernstein_basis, gauss_legendre
from fpk_rocking.base.jit import kernel
from fpk_rocking.physics.motion import TERMS, collocation
from fpk_rocking.physics.motion.collocation import NODES, PLACES, FlightTables, flight_tables
from fpk_rocking.physics.motion.equation import (
    KernelBlock,
    block_of_scene,
    dispatch_on_block,
    force_bounds,
    move_origin,
    particular_from_rest,
    segment_from_particular,
)
from fpk_rocking.physics.motion.events import advance_through_events, can_lift_off, surely_eventless
from fpk_rocking.physics.motion.flight import homogeneous_flight
from fpk_rocking.physics.motion.slender import force_series, forced_response, particular_at
from fpk_rocking.physics.noise.state_space import transition_and_factor
from montecarlo.engines.engine import Engine, TimeGrid, time_grid
from montecarlo.engines.random import draw_start, hash_word, normal, start_parameters
from montecarlo.tuning import TUNING

_USUAL_STEPS = 200
"""Default of `steps_per_cycle`, for which the limits of an interval in `TUNING` hold."""


class Law(NamedTuple):
    """Law of filtered noise over an interval or a part: n states, and a polynomial of degree d."""

    move: np.ndarray  # (n + 2, n): mean of states, angle and velocity at the end
    spread: np.ndarray  # (n + 2, n + 2): their Cholesky factor
    shape: np.ndarray  # (d + 1, 2n + 2): Bernstein coefficients by the states at both ends and the flight
    powers: np.ndarray  # (d + 1, d + 1): coefficients in the time by these


class PartTables(NamedTuple):
    """Noise without a derivative over m equal parts of an interval; 0 where none are drawn."""

    law: Law
    hyperbolic: np.ndarray  # (2,): cosh and sinh of a part's duration
    gain: np.ndarray  # (m, n + 2, n + 2): change of each part for what they miss in the end
    margin: float  # how far the noise may leave its polynomial over the interval, times the envelope
    slowest: float  # speed below which a block may come to rest in an interval


class NoiseTables(NamedTuple):
    """Filtered noise over the intervals of a grid."""

    stationary: np.ndarray  # (n, n): Cholesky factor of the states at τ = 0, of variance 1
    law: Law
    parts: PartTables


def _law(space, span, sigma):
    """Return the `Law` over a duration `span` of noise by a filter of unit variance, times sigma."""
    # Time counts in intervals within: every entry is then about 1 or less, and none lost in the rounding of another.
    n = space.order
    drift = np.zeros((n + 2, n + 2))
    drift[:n, :n] = span * space.drift
    drift[n, n + 1], drift[n + 1, n], drift[n + 1, :n] = 1.0, span * span, space.output
    source = np.append(math.sqrt(span) * space.input, [0.0, 0.0])
    phi, spread = transition_and_factor(drift, source, 1.0)
    # Angle and velocity of the flight in their own units, and as strong as the noise.
    sizes = np.append(np.ones(n), [sigma * span * span, sigma * span])[:, None]
    return Law(sizes * phi[:, :n], sizes * spread, *_polynomial_tables(space, span, sigma))


def _part_tables(space, span, sigma):
    """Return the `PartTables` of an interval; of no part for smooth noise."""
    n, count = space.order, 0 if space.smooth or sigma == 0.0 else TUNING.filtered_parts
    length = span / max(count, 1)
    law = _law(space, length, sigma)
    keep, swap = math.cosh(length), math.sinh(length)
    # All as linear functions of the m (n + 2) normal numbers that are drawn for the parts.
    drawn, ends = np.zeros((count, n + 2, count * (n + 2))), np.zeros((n + 2, count * (n + 2)))
    for k in range(count):
        drawn[k] = law.move @ ends[:n]
        drawn[k, :, k * (n + 2) : (k + 1) * (n + 2)] += law.spread
        ends = drawn[k] + np.concatenate([np.zeros((n, ends.shape[1])), [[keep, swap], [swap, keep]] @ ends[n:]])
    sizes = np.linalg.norm(ends, axis=1) if count else np.ones(n + 2)
    gain = drawn @ (np.linalg.pinv(ends / sizes[:, None]) / sizes)
    # A Brownian bridge as rough as the noise has this standard deviation at its middle.
    bridge = 0.5 * sigma * abs(float(space.output @ space.input)) * math.sqrt(span)
    margin = TUNING.filtered_margin * bridge if count else 0.0
    return PartTables(law, np.array([keep, swap]), gain, margin, TUNING.filtered_slowest * span)


def polynomial_degree(space):
    """Return the degree of the polynomial within an interval: ends and flight, and slopes where the noise has them."""
    return 5 if space.smooth else 3


def _polynomial_tables(space, span, sigma):
    """Return `shape` (d + 1, 2n + 2) and `powers` (d + 1, d + 1) of a `Law`."""
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
    """Return (2, 2, degree + 1): angle, velocity by Bernstein polynomials from `begin` to `end`; [1] times the time."""
    points, weights = gauss_legendre(20, -1.0, 1.0)
    since = 0.5 * (end - begin) * (1.0 + points)
    t = (begin + since) / span
    left = span * (1.0 - t)
    weights = 0.5 * (end - begin) * weights * np.stack([np.sinh(left), np.cosh(left)])  # what an impulse adds
    return np.stack([weights @ bernstein_basis(t, degree).T, (weights * since) @ bernstein_basis(t, degree).T])


class EnvelopeTables(NamedTuple):
    """The envelope of the noise over m intervals, linear in pieces that end at its kinks; all empty without one."""

    first: np.ndarray  # (m + 1,): number of the first piece in each interval
    begins: np.ndarray  # (pieces,): since the interval's beginning
    ends: np.ndarray
    strength: np.ndarray  # (pieces, 2): at a piece's beginning, and its slope
    strongest: np.ndarray  # (m,): largest in an interval
    response: np.ndarray  # (m, 2, d + 1): angle, velocity that the Bernstein polynomials times the envelope add


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
    """Cut intervals at kinks (n,); return the first piece of each, and of pieces interval, beginning and end in it."""
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
    """The noise in an interval, without the factor of its envelope, as far as a realization has come."""

    drawn: np.ndarray  # (2n + 2,): states at both ends of the interval, and what the noise adds to a flight
    normals: np.ndarray  # (n + 2,): scratch
    bernstein: np.ndarray  # (d + 1,)
    signal: np.ndarray  # (TERMS,): coefficients in the time
    stream: np.ndarray  # (8,) uint64: random numbers of its parts, and as far as these are drawn
    parts: np.ndarray  # (m, 2n + 2): `drawn` of each


@kernel
def allocate_noise(tables):
    n, terms = tables.stationary.shape[0], tables.law.powers.shape[0]
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
    """Draw the next interval into `noise.drawn`, whose last states become the first, and numbers for its parts."""
    drawn, n = noise.drawn, tables.stationary.shape[0]
    for i in range(n):
        drawn[i] = drawn[n + i]
    _draw_ends(stream, tables.law, drawn, noise.normals)
    if noise.parts.shape[0] > 0:
        for i in range(4):
            noise.stream[i] = hash_word(stream[i])


@kernel(fastmath={"contract"}, forceinline=True)
def _draw_ends(stream, law, drawn, normals):
    """Draw the states at an end, and what the noise adds to a flight, into `drawn[n:]`, from the states `drawn[:n]`."""
    move, spread = law.move, law.spread
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
        _draw_ends(stream, tables.law, rows[k], noise.normals)
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
def _write_bernstein(j, shape, drawn, bernstein, envelope, margin):
    """Write `shape` (d + 1, n) @ `drawn` (n,) to `bernstein` (d + 1,); return its bounds with the envelope."""
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


# The arrays are taken out of their tuples in here: a caller that took them out would count references to them.
@kernel(fastmath={"contract"}, forceinline=True)
def bound_noise(j, law, envelope, noise, margin):
    """Write the noise in interval j to `noise.bernstein`; return its bounds, by a `margin` wider, with the envelope."""
    return _write_bernstein(j, law.shape, noise.drawn, noise.bernstein, envelope, margin)


@kernel(fastmath={"contract"})
def bound_part(j, part, law, envelope, noise):
    """Write the noise in a part of interval j to `noise.bernstein`; return its bounds with the envelope."""
    return _write_bernstein(j, law.shape, noise.parts[part], noise.bernstein, envelope, 0.0)


@kernel(fastmath={"contract"})
def write_polynomial(law, noise):
    """Write the polynomial in `noise.bernstein` to `noise.signal` (TERMS,), of an interval or a part."""
    signal, bernstein = noise.signal, noise.bernstein
    signal[:] = 0.0
    for k in range(bernstein.size):
        for i in range(k + 1):
            signal[k] += law.powers[k, i] * bernstein[i]


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


class FilteredParameters(NamedTuple):
    """A scene in numbers, nondimensional, and tables over the m intervals of a table period."""

    block: KernelBlock
    start: np.ndarray  # (5,), of `start_parameters`
    grid: TimeGrid
    hyperbolic: np.ndarray  # (2,): cosh and sinh of an interval's duration
    noise: NoiseTables
    envelope: EnvelopeTables
    forced: np.ndarray  # (m, TERMS): P of the forcing since the beginning, or the forcing for an exact block
    low: np.ndarray  # (m,): bounds of the forcing
    high: np.ndarray
    drift: np.ndarray  # (m, 2): what it adds to a flight
    pushes: np.ndarray  # (m, NODES): the forcing
    basis: np.ndarray  # (d + 1, NODES): Bernstein polynomials
    strength_at_points: np.ndarray  # (m, NODES): the envelope
    steps: FlightTables


class Workspace(NamedTuple):
    """Arrays of a thread: the noise, and scratch (TERMS,)."""

    noise: NoiseWorkspace
    share: np.ndarray
    particular: np.ndarray
    force: np.ndarray


def parameters_of(scene, steps_per_cycle, times=None):
    """Return the parameters of a scene; `steps_per_cycle` times the filter's fastest rate sets the longest interval."""
    envelope, space = scene.noise.envelope, scene.noise.space
    rate = space.fastest * steps_per_cycle
    longest = (TUNING.filtered_smooth if space.smooth else TUNING.filtered_rough) / rate
    if longest * TUNING.filtered_intervals < scene.forcing.time_scale:
        most = int(steps_per_cycle * longest * TUNING.filtered_intervals / scene.forcing.time_scale)
        raise ValueError(checks.refusal("steps_per_cycle", steps_per_cycle, f"up to {most} with a filter of this rate"))
    # Fewer steps than usual lengthen every interval, so that they tell the error of the steps.
    coarser = max(1.0, _USUAL_STEPS / steps_per_cycle)
    longest = min(
        longest, coarser * scene.forcing.shortest_period / TUNING.filtered_fewest, coarser * TUNING.filtered_longest
    )
    longest = longest if envelope is None else min(longest, envelope.spacing)
    return parameters_on_grid(scene, time_grid(scene, longest, times))


def parameters_on_grid(scene, grid):
    span, envelope, space = grid.spacing, scene.noise.envelope, scene.noise.space
    degree, sigma = polynomial_degree(space), math.sqrt(scene.noise.variance)
    begins = np.arange(grid.count) * span
    forced = scene.forcing.pieces(begins)
    force = force_series(forced)
    low, high = np.empty((2, grid.count))
    force_bounds(forced, span, low, high)
    return FilteredParameters(
        block_of_scene(scene),
        start_parameters(scene.start),
        grid,
        np.array([math.cosh(span), math.sinh(span)]),
        NoiseTables(np.linalg.cholesky(space.correlation), _law(space, span, sigma), _part_tables(space, span, sigma)),
        envelope_tables(envelope, grid, degree),
        force if scene.block.critical_angle else forced,
        low,
        high,
        np.stack(forced_response(forced[:, 0], forced[:, 1], *particular_at(forced, span), span), axis=-1),
        force @ (span * PLACES) ** np.arange(TERMS)[:, None],
        bernstein_basis(PLACES, degree),
        np.empty((0, NODES)) if envelope is None else envelope.value(begins[:, None] + span * PLACES),
        flight_tables(span),
    )


@kernel
def workspace_of(parameters):
    rows = np.empty((3, TERMS))
    return Workspace(allocate_noise(parameters.noise), rows[0], rows[1], rows[2])


@kernel(inline="always")
def _begin(stream, cycle, parameters, workspace):
    state = draw_start(stream, parameters.start)
    draw_first_states(stream, parameters.noise, workspace.noise)
    for _ in range(cycle * parameters.grid.count):
        draw_next_interval(stream, parameters.noise, workspace.noise)
    return state, state


@kernel(inline="always")
def _draw(stream, _number, _j, _cycle, parameters, workspace):
    draw_next_interval(stream, parameters.noise, workspace.noise)


@kernel(inline="always")
def _fly_slender(x, v, side, j, parameters, workspace, _block):
    push, kick = response_to_noise(j, parameters.envelope, workspace.noise)
    end, speed = homogeneous_flight(x - side, v, parameters.hyperbolic[0], parameters.hyperbolic[1])
    return end + side + parameters.drift[j, 0] + push, speed + parameters.drift[j, 1] + kick, True


@kernel(fastmath={"contract"}, forceinline=True)
def _fly_exact(x, v, side, j, parameters, workspace, block):
    """Return (x, v, right) of an exact block at the end of interval j; right: no kink in it, and converged."""
    if parameters.envelope.first.size > 0 and parameters.envelope.first[j + 1] > parameters.envelope.first[j] + 1:
        return x, v, False
    noise = workspace.noise.bernstein[0] * load(parameters.basis, 0)
    for i in range(1, workspace.noise.bernstein.size):
        noise = noise + workspace.noise.bernstein[i] * load(parameters.basis, i)
    if parameters.strength_at_points.shape[0] > 0:
        noise = load(parameters.strength_at_points, j) * noise
    push, tables = load(parameters.pushes, j) + noise, parameters.steps
    end, speed, _, converged = collocation.fly_by_tables(
        side * x, side * v, side, side * push, tables, parameters.grid.spacing, block
    )
    return side * end, side * speed, converged


_fly = dispatch_on_block(_fly_slender, _fly_exact)


@kernel(inline="always")
def _takes_parts(state, side, parameters):
    """Whether noise moves a block in parts of an interval: it is rough, and the block at rest or nearly so."""
    parts = parameters.noise.parts
    return parts.gain.shape[0] > 0 and (side == 0 or abs(state[1]) < parts.slowest)


@kernel(inline="always")
def _try_step(state, side, _number, j, parameters, workspace):
    margin = parameters.noise.parts.margin if _takes_parts(state, side, parameters) else 0.0
    low, high = bound_noise(j, parameters.noise.law, parameters.envelope, workspace.noise, margin)
    low, high, (x, v) = low + parameters.low[j], high + parameters.high[j], state
    if side == 0:
        return not can_lift_off(low, high, parameters.block), state
    block = parameters.block
    end, speed, right = _fly(x, v, side, j, parameters, workspace, block)
    eventless = right and surely_eventless(side * x, side * end, side, low, high, parameters.grid.spacing, block)
    return eventless, (end, speed)


@kernel(fastmath={"contract"})
def _build_force(_number, j, parameters, workspace):
    """Write P in interval j (the force for an exact block) to `workspace.particular`; under an envelope the noise."""
    # The noise's share begins with zero angle and velocity. The one that is a polynomial no higher than the noise's,
    # with the terms -(η + η'' + ...), would be as large as the fourth derivative, and its rounding far above the
    # angle's.
    write_polynomial(parameters.noise.law, workspace.noise)
    if parameters.envelope.strength.size == 0:
        _write_particular(workspace.noise.signal, workspace.particular, parameters.block)
        for k in range(TERMS):
            workspace.particular[k] += parameters.forced[j, k]


@kernel(forceinline=True)
def _respond_slender(force, particular, _block):
    """Write the P with P'' = P + f, P = P' = 0 at t = 0, of a force f (TERMS,), for a slender block."""
    particular_from_rest(force, particular)


@kernel(forceinline=True)
def _respond_exact(force, particular, _block):
    for k in range(TERMS):
        particular[k] = force[k]


_write_particular = dispatch_on_block(_respond_slender, _respond_exact)


@kernel(forceinline=True)
def _advance_slender(x, v, side, start, end, span, workspace, impacts, origin, block):
    """Carry a slender block from `start` to `end` under P, good to `span`; return (x, v, side, time)."""
    segment = borrowed(segment_from_particular(workspace.particular, workspace.force, span))
    return advance_through_events(x, v, side, segment, start, end, block, impacts, origin)


@kernel(forceinline=True)
def _advance_exact(x, v, side, start, end, span, workspace, impacts, origin, block):
    """As `_advance_slender`, of an exact block under the force in `workspace.particular`."""
    return collocation.advance_collocated(workspace.particular, span, x, v, side, start, end, block, impacts, origin)


_advance = dispatch_on_block(_advance_slender, _advance_exact)


@kernel(fastmath={"contract"})
def _build_force_in_piece(j, time, since, value, slope, parameters, workspace):
    """Write P, or the force, since a `time` in interval j; the noise is known since a time `since` before it."""
    particular, force, share = workspace.particular, workspace.force, workspace.share
    move_origin(workspace.noise.signal, since, share)
    for k in range(TERMS):
        force[k] = value * share[k] + (slope * share[k - 1] if k > 0 else 0.0)
    _write_particular(force, share, parameters.block)
    move_origin(parameters.forced[j], time, particular)
    for k in range(TERMS):
        particular[k] += share[k]


@kernel
def _advance_through_pieces(x, v, side, j, until, parameters, workspace, impacts, origin):
    """Carry a block through interval j up to `until`, by parts of the noise and pieces of the envelope."""
    noise, envelope, block, tables = workspace.noise, parameters.envelope, parameters.block, parameters.noise.parts
    enveloped, count = envelope.strength.size > 0, 1
    if _takes_parts((x, v), side, parameters):
        count = noise.parts.shape[0]
        draw_parts(tables, noise)
    piece, length = envelope.first[j] if enveloped else 0, parameters.grid.spacing / count
    for part in range(count):
        begin = part * length
        stop = min(begin + length, until) if part + 1 < count else until
        if begin >= until:
            break
        if count > 1:
            low, high = bound_part(j, part, tables.law, envelope, noise)
            if side == 0 and not can_lift_off(low + parameters.low[j], high + parameters.high[j], block):
                continue
            write_polynomial(tables.law, noise)
        time = begin
        while time < stop:
            value, slope, end = 1.0, 0.0, stop
            if enveloped:
                while envelope.ends[piece] <= time and piece + 1 < envelope.first[j + 1]:
                    piece += 1
                slope = envelope.strength[piece, 1]
                value = envelope.strength[piece, 0] + slope * (time - envelope.begins[piece])
                end = min(envelope.ends[piece], stop) if piece + 1 < envelope.first[j + 1] else stop
            _build_force_in_piece(j, time, time - begin, value, slope, parameters, workspace)
            last = end - time
            x, v, side, reached = _advance(x, v, side, 0.0, last, last, workspace, impacts, origin + time, block)
            if abs(x) >= block.cutoff:
                return x, v, side, time + reached
            time = end
    return x, v, side, until


@kernel(inline="always")
def _step_with_events(state, _end, side, number, j, share, cycle, parameters, workspace, impacts):
    origin, until = (cycle * parameters.grid.count + number) * parameters.grid.spacing, share * parameters.grid.spacing
    x, v = state
    if parameters.envelope.strength.size > 0 or _takes_parts(state, side, parameters):
        x, v, side, time = _advance_through_pieces(x, v, side, j, until, parameters, workspace, impacts, origin)
    else:
        span, block = parameters.grid.spacing, parameters.block
        x, v, side, time = _advance(x, v, side, 0.0, until, span, workspace, impacts, origin, block)
    return (x, v), side, (origin + time if abs(x) >= parameters.block.cutoff else math.inf)


ENGINE = Engine(
    method="filtered",
    takes=lambda scene: scene.noise.kind == "filtered" and scene.forcing.vertical is None,
    parameters_of=parameters_of,
    workspace_of=workspace_of,
    begin=_begin,
    draw=_draw,
    try_step=_try_step,
    build_force=_build_force,
    step_with_events=_step_with_events,
)
