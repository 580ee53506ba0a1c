"""Event-driven realizations under band noise or none, method "exact": what its three engines share.

Noise and forcing are band-limited: polynomials between the points of a grid far coarser than an integrator's steps.
Over an interval a block is carried in one flight; only intervals in which a bound of the acceleration cannot exclude an
event are looked at more closely. Its engines differ in how a block flies: `exact_slender`, `exact_enveloped`,
`exact_block`.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from fpk_rocking.base.arrays import borrowed, load
from fpk_rocking.base.jit import kernel
from fpk_rocking.physics.motion import TERMS, collocation
from fpk_rocking.physics.motion.collocation import NODES
from fpk_rocking.physics.motion.equation import (
    KernelBlock,
    block_in,
    block_of_scene,
    dispatch_on_block,
    force_bounds,
    particular_from_rest,
    segment_from_particular,
)
from fpk_rocking.physics.motion.events import advance_through_events, can_lift_off, chord_clearance
from fpk_rocking.physics.motion.intervals import Interval, interval_tables
from fpk_rocking.physics.noise.band import OVERSAMPLING, interpolant_polynomials, window_compensation, write_product
from fpk_rocking.physics.noise.envelope import EnvelopePieces, envelope_pieces, largest_values
from montecarlo.engines.band_noise import (
    CHUNK,
    Band,
    Samples,
    allocate_samples,
    band_of_scene,
    divide_by_window,
    draw_start_and_noise,
    largest_noise,
    write_first_samples,
    write_next_samples,
)
from montecarlo.engines.engine import TimeGrid, time_grid
from montecarlo.engines.random import start_parameters
from montecarlo.tuning import TUNING


class ExactParameters(NamedTuple):
    """A scene in numbers, nondimensional, and tables over the m intervals of a table period."""

    block: KernelBlock
    start: np.ndarray  # (5,), of `start_parameters`
    band: Band
    grid: TimeGrid
    halvings: int  # 2 to this power intervals lie between two samples of the noise
    polynomials: np.ndarray  # (2^halvings, WIDTH, TERMS): interpolant of the noise
    compensation: np.ndarray
    ratio_scale: float
    zeros: np.ndarray  # (TERMS,)
    forced: np.ndarray  # (m, TERMS): P of the forcing by the time since the middle; the forcing for an exact block
    least: np.ndarray  # (m, 2), by side < 0, > 0: a flight with both ends between `least` and `most` has no event
    most: np.ndarray
    stays: np.ndarray  # (m,): whether a block at rest surely stays so
    weights: np.ndarray  # (m, 3), of `Weight` from the middle on; (0, 3) where the base does not move vertically
    envelope: EnvelopePieces
    exponentials: np.ndarray
    bend: np.ndarray
    flight: Any  # tables of the engine's flights


def tables_of_scene(scene, times, finer=False):
    """Return parameters without tables of flights; `finer` intervals may lie closer than samples of the noise."""
    forcing, envelope, block = scene.forcing, scene.noise.envelope, block_of_scene(scene)
    longest = min(TUNING.exact_longest, forcing.shortest_period / TUNING.exact_fewest)
    sampling = math.pi / (OVERSAMPLING * scene.noise.band[1]) if scene.noise.kind == "band" else math.inf
    grid = time_grid(scene, min(longest, sampling), times)
    half, middles = 0.5 * grid.spacing, (np.arange(grid.count) + 0.5) * grid.spacing
    # The samples of a record lie closer than those that its noise needs. A cycle has a whole number of either.
    apart = finer and not scene.repeats and scene.noise.kind == "band"
    halvings = int(math.log2(sampling / grid.spacing * (1.0 + 1e-12))) if apart else 0
    harmonics = band_of_scene(scene, grid.duration)
    particular = forcing.pieces(middles)
    low, high = np.empty((2, grid.count))
    force_bounds(particular, half, low, high)
    loudest = largest_noise(scene.noise, harmonics) * largest_values(envelope, grid.spacing * np.arange(grid.count + 1))
    weights = forcing.weights(grid.spacing, grid.count)
    weights[:, 0] += half * weights[:, 1]
    least, most, stays = eventless_angles(low - loudest, high + loudest, weights, grid.spacing, block)
    exponentials, bend = interval_tables(half)
    return ExactParameters(
        block=block,
        start=start_parameters(scene.start),
        band=harmonics,
        grid=grid,
        halvings=halvings,
        polynomials=interpolant_polynomials(grid.spacing, 1 << halvings),
        compensation=window_compensation(),
        ratio_scale=2.0 * OVERSAMPLING / grid.count * (1 << halvings),
        zeros=np.zeros(TERMS),
        forced=particular,
        least=least,
        most=most,
        stays=stays,
        weights=weights,
        envelope=envelope_pieces(envelope, middles, half, TUNING.envelope_order),
        exponentials=exponentials,
        bend=bend,
        flight=None,
    )


def eventless_angles(low, high, weights, spacing, block):
    """Return `least`, `most` (m, 2) and `stays` (m,) by bounds `low`, `high` (m,) of the force in each interval."""
    (below, above), stays = np.empty((2, low.size, 2)), np.empty(low.size, np.bool_)
    _write_clearances(low, high, weights, spacing, block, below, above, stays)
    return below, block.cutoff - above, stays


@kernel
def _write_clearances(low, high, weights, spacing, block, below, above, stays):
    """Write how far flights may leave the chord between their ends (m, 2), and whether a block at rest stays (m,)."""
    for j in range(low.size):
        own = block_in(weights, j, block)
        stays[j] = not can_lift_off(low[j], high[j], own)
        for k in range(2):
            below[j, k], above[j, k] = chord_clearance(2 * k - 1, low[j], high[j], spacing, own)


class Workspace(NamedTuple):
    """Arrays of a thread."""

    samples: Samples
    node: np.ndarray  # (CHUNK,): the noise's share of P at the ends of the intervals that the last samples complete
    interval: Interval  # P in an interval, and scratch
    noise: np.ndarray  # (TERMS,): in an interval, less its envelope
    acceleration: np.ndarray  # (1, NODES): u'' of an exact block in the flight that `try_step` has tried


@kernel
def workspace_of(parameters):
    samples, rows = allocate_samples(parameters.band.harmonics), np.empty((4, TERMS))
    half = 0.5 * parameters.grid.spacing
    exponentials, bend = parameters.exponentials, parameters.bend
    interval = Interval(rows[0], rows[1], rows[2], exponentials, bend, half, math.exp(half))
    return Workspace(samples, np.empty(CHUNK), interval, rows[3], np.zeros((1, NODES)))


@kernel(inline="always")
def is_eventless(u, end, side, j, parameters):
    """Whether a flight from folded angle u to folded angle `end` surely has no event in interval j."""
    s = 1 if side > 0 else 0
    return min(u, end) > parameters.least[j, s] and max(u, end) < parameters.most[j, s]


# What follows is for a state that is (angle, velocity): with an envelope, or of an exact block.


@kernel(inline="always")
def begin(stream, cycle, parameters, workspace):
    samples = workspace.samples
    x, v = draw_start_and_noise(stream, parameters.start, parameters.band, samples.harmonics)
    divide_by_window(samples.harmonics, parameters)
    write_first_samples(samples, cycle, parameters)
    return (x, v), (x, v)


@kernel(inline="always")
def draw(_stream, number, _j, cycle, parameters, workspace):
    """Write the next samples of the noise if the last are used up; all is drawn with the start."""
    write_next_samples(workspace.samples, number, cycle, parameters)


@kernel(inline="always")
def _advance_slender(x, v, side, j, begin, end, strength, _tried, _last, parameters, workspace, impacts, origin, block):
    """Carry a slender block to `end` in interval j under the envelope `strength` (order,): (x, v, side, time)."""
    force, particular, half = workspace.interval.force, workspace.interval.particular, workspace.interval.half
    write_product(strength, workspace.noise, parameters.zeros, force)
    particular_from_rest(force, particular)
    for n in range(TERMS):
        particular[n] += parameters.forced[j, n]
    segment = borrowed(segment_from_particular(particular, force, half))
    return advance_through_events(x, v, side, segment, begin, end, block, impacts, origin)


@kernel(inline="always")
def _advance_exact(x, v, side, j, begin, end, strength, tried, last, parameters, workspace, impacts, origin, block):
    """As `_advance_slender`, of an exact block; if `tried`, `last` is the state at `end` without an event."""
    force, half, acceleration = workspace.interval.force, workspace.interval.half, load(workspace.acceleration, 0)
    write_product(strength, workspace.noise, parameters.forced[j], force)
    angle, speed = last
    return collocation.advance_from_flight(
        force, half, x, v, side, begin, end, block, impacts, origin, tried, side * angle, side * speed, acceleration
    )


_advance = dispatch_on_block(_advance_slender, _advance_exact)


@kernel(forceinline=True)
def step_with_events(state, end, side, number, j, share, cycle, parameters, workspace, impacts):
    """Carry a block through a share of interval j, by the pieces of the envelope: `Engine.step_with_events`."""
    (x, v), first = state, parameters.envelope.first
    spacing, time, tried = parameters.grid.spacing, 0.0, False
    if share == 1.0:
        tried = side != 0 and not math.isnan(end[0]) and first[j + 1] == first[j] + 1
    origin = cycle * (parameters.grid.count * spacing) + (number + 0.5) * spacing
    until, start, block = (share - 0.5) * spacing, -0.5 * spacing, block_in(parameters.weights, j, parameters.block)
    for piece in range(first[j], first[j + 1]):
        strength, stop = parameters.envelope.strength[piece], min(parameters.envelope.ends[piece], until)
        if start >= until:
            break
        x, v, side, time = _advance(
            x, v, side, j, start, stop, strength, tried, end, parameters, workspace, impacts, origin, block
        )
        if abs(x) >= parameters.block.cutoff:
            return (x, v), side, origin + time
        start = stop
    return (x, v), side, math.inf


def in_closed_form(scene):
    """Whether flights of a scene's block have a closed form: it is slender, and the base does not move vertically."""
    return scene.block.critical_angle == 0.0 and scene.forcing.vertical is None


def has_envelope(scene):
    return scene.noise.kind == "band" and scene.noise.envelope is not None


COMMON = {"method": "exact", "workspace_of": workspace_of}
"""Of all engines of this method."""

PIECEWISE = COMMON | {"begin": begin, "draw": draw, "step_with_events": step_with_events}
"""Of those whose state is (angle, velocity)."""
