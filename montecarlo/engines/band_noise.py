"""Band noise (a sum of harmonics) in engines: how it is drawn, and the tables of a scene with it.

All of a realization's noise is drawn with its start: frequencies and phases of the harmonics. What makes functions of
time of them is `fpk_rocking.physics.noise.band`; `noise_samples` samples them as a realization goes on. `Parameters`
and `Workspace` are what the three kinds of flight of the engine `exact` share.
"""

import math
from typing import NamedTuple

import numpy as np

from fpk_rocking.base.jit import kernel
from fpk_rocking.physics.motion import TERMS
from fpk_rocking.physics.motion.block import force_series, forced_response, particular_at, particular_series
from fpk_rocking.physics.motion.equation import KernelBlock, block_of_scene, force_bounds
from fpk_rocking.physics.motion.events import can_lift_off, chord_clearance
from fpk_rocking.physics.motion.intervals import NODES, PLACES, FlightTables, Interval, flight_tables, interval_tables
from fpk_rocking.physics.noise.band import OVERSAMPLING, interpolant_polynomials, window_compensation
from fpk_rocking.physics.noise.envelope import EnvelopePieces, envelope_pieces, largest_envelope
from montecarlo.engines.engine import TimeGrid, time_grid
from montecarlo.engines.noise_samples import CHUNK, Samples, allocate_samples
from montecarlo.engines.random import draw_start, start_parameters, uniform, uniform_pairs
from montecarlo.tuning import TUNING


class Band(NamedTuple):
    """Lowest frequency and width of the band in turns per table period; amplitude and number of the harmonics.

    `parts`: equal parts of the band, in each of which there is the same number of harmonics; 1 for independent ones.
    `gaussian`: whether the amplitudes are random, and `weight` is the root of their mean square.
    """

    low_ratio: float
    ratio_width: float
    weight: float
    harmonics: int
    parts: int
    gaussian: bool


def band_of_scene(scene, period):
    """Return the named tuple `Band` of a `Scene`, its frequencies in turns in a time `period`, nondimensional.

    `period` is the duration of the table period. Without noise the band has no harmonics.
    """
    if scene.noise.kind != "band":
        return Band(0.0, 0.0, 0.0, 0, 1, False)
    low, high = (frequency * period / (2.0 * math.pi) for frequency in scene.noise.band)
    weight = math.sqrt(2.0 * scene.noise.variance / scene.noise.harmonics)
    stratified = scene.noise.frequencies == "stratified"
    parts = scene.noise.harmonics if stratified else 1
    return Band(low, high - low, weight, scene.noise.harmonics, parts, stratified)


@kernel(inline="always")
def draw_start_and_noise(stream, start, band, harmonics):
    """Draw the start and the harmonics of one realization; return (angle, velocity) at τ = 0, nondimensional.

    `stream` (4,) uint64: state of the random numbers; `start` (5,): from `start_parameters`; `band`: a `Band`. Of
    `harmonics`, a named tuple, the arrays `ratios` (turns per table period), `phases` (turns) and `weights`
    (amplitudes) are written, each of `band.harmonics` numbers or longer.
    """
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


def _largest_noise(noise, harmonics):
    """Return a bound (float) of |η|, band noise without the factor of its envelope, nondimensional; 0 without noise.

    `noise`: that of a scene; `harmonics`: its `Band`. Equal amplitudes have a sum. Gaussian noise has none, but passes
    12 standard deviations with a probability of 4e-33.
    """
    if harmonics.gaussian:
        return 12.0 * math.sqrt(noise.variance)
    return harmonics.weight * harmonics.harmonics


class Parameters(NamedTuple):
    """A scene in numbers, nondimensional, and tables over the m intervals of a table period.

    `start` (5,): see `start_parameters`. `halvings`: 2 to this power intervals lie between two samples of the noise.
    `polynomials` (2^halvings, WIDTH, TERMS), `compensation`, `ratio_scale`: interpolant of the noise. `zeros` (TERMS,).
    `forced` (m, TERMS): P of the forcing in the time since the interval's middle, or the forcing for an exact block.
    `least`, `most` (m, 2), indexed [interval, side < 0 or > 0]: between these angles at both ends of an interval a
    flight has no event in it. `stays` (m,): whether a block at rest surely stays at rest. `envelope`: of the noise.
    `exponentials`, `bend`: see `physics.motion.intervals.Interval`. `flight`: tables of a kind of flight.
    """

    block: KernelBlock
    start: np.ndarray
    band: Band
    grid: TimeGrid
    halvings: int
    polynomials: np.ndarray
    compensation: np.ndarray
    ratio_scale: float
    zeros: np.ndarray
    forced: np.ndarray
    least: np.ndarray
    most: np.ndarray
    stays: np.ndarray
    envelope: EnvelopePieces
    exponentials: np.ndarray
    bend: np.ndarray
    flight: "ClosedForm | Response | Collocation"


class ClosedForm(NamedTuple):
    """Tables of the flights of a slender block without an envelope.

    `node` (m, 2): P of the forcing and its derivative at the interval's end. `ends` (2, WIDTH): polynomials of the
    interpolant there, and their derivatives.
    """

    node: np.ndarray
    ends: np.ndarray


class Response(NamedTuple):
    """Tables of the flights of a slender block under noise with an envelope.

    `noise` (order, 2, WIDTH): angle and velocity that the polynomials of the interpolant, times powers of the time, add
    to a flight over an interval. `forcing` (m, 2): those that the forcing adds.
    """

    noise: np.ndarray
    forcing: np.ndarray


class Collocation(NamedTuple):
    """Tables of the flights of an exact block.

    `values` (2^halvings WIDTH, NODES): polynomials of the interpolant at the points of an interval. `forcing` (m,
    NODES) and `envelope` (m, NODES), (0, NODES) without one: their values there. `slack` (m,): how far the force may
    pass its values there in the interval, inf with an envelope. `steps`: see `physics.motion.collocation`.
    """

    values: np.ndarray
    forcing: np.ndarray
    envelope: np.ndarray
    slack: np.ndarray
    steps: FlightTables


def parameters_of(scene, steps_per_cycle, times=None):  # noqa: ARG001  (this engine takes no steps)
    """Return the named tuple `Parameters` of a `Scene` with band noise or none.

    `times` (rows,), at which states are wanted, are nondimensional and count from the begin of the table period (a
    cycle, or the whole time up to the last of them); by default its end alone. A realization does not depend on them.
    `steps_per_cycle` is not used.
    """
    forcing, envelope, exact = scene.forcing, scene.noise.envelope, scene.block.critical_angle > 0.0
    longest = min(TUNING.exact_longest, forcing.shortest_period / TUNING.exact_fewest)
    sampling = math.pi / (OVERSAMPLING * scene.noise.band[1]) if scene.noise.kind == "band" else math.inf
    grid = time_grid(scene, min(longest, sampling), times)
    half, middles = 0.5 * grid.spacing, (np.arange(grid.count) + 0.5) * grid.spacing
    # The samples of a record lie closer than those that its noise needs. A cycle has a whole number of either.
    apart = exact and not scene.repeats and scene.noise.kind == "band"
    halvings = int(math.log2(sampling / grid.spacing * (1.0 + 1e-12))) if apart else 0
    polynomials = interpolant_polynomials(grid.spacing, 1 << halvings)
    harmonics = band_of_scene(scene, grid.duration)
    particular = forcing.pieces(middles)
    low, high = np.empty((2, grid.count))
    force_bounds(particular, half, low, high)
    loudest = _largest_noise(scene.noise, harmonics) * largest_envelope(envelope, grid)
    parts = envelope_pieces(envelope, middles, half, TUNING.envelope_order)
    if exact:
        fastest = scene.noise.band[1] if harmonics.harmonics else 0.0
        loud = math.inf if envelope is not None else _largest_noise(scene.noise, harmonics) * fastest
        flight = _collocation(
            force_series(particular), envelope, polynomials, middles, grid.spacing, (loud, loud * fastest)
        )
    elif envelope is not None:
        flight = _response(particular, polynomials[0], parts.strength.shape[1], half)
    else:
        flight = _closed_form(particular, polynomials[0], half)
    return Parameters(
        block_of_scene(scene),
        start_parameters(scene.start),
        harmonics,
        grid,
        halvings,
        polynomials,
        window_compensation(),
        2.0 * OVERSAMPLING / grid.count * (1 << halvings),
        np.zeros(TERMS),
        force_series(particular) if exact else particular,
        *_eventless_angles(low - loudest, high + loudest, grid.spacing, block_of_scene(scene)),
        parts,
        *interval_tables(half),
        flight,
    )


def scaled_parameters(parameters, factor):
    """Return a copy of `parameters`, the `Parameters` of a scene without noise, with the forcing times a `factor` > 0.

    The tables of the forcing are linear in it. To make them anew costs several times as much as a path.
    """
    flight, forced = parameters.flight, factor * parameters.forced
    if isinstance(flight, Collocation):
        force, flight = forced, flight._replace(forcing=factor * flight.forcing, slack=factor * flight.slack)
    else:
        force, flight = force_series(forced), flight._replace(node=factor * flight.node)
    spread = np.abs(force[:, 1:]) @ (0.5 * parameters.grid.spacing) ** np.arange(1, TERMS)
    bounds = force[:, 0] - spread, force[:, 0] + spread
    least, most, stays = _eventless_angles(*bounds, parameters.grid.spacing, parameters.block)
    return parameters._replace(forced=forced, flight=flight, least=least, most=most, stays=stays)


def _closed_form(particular, polynomials, half):
    """Return the named tuple `ClosedForm` from P of the forcing and the polynomials of the interpolant.

    `particular` (m, TERMS), `polynomials` (WIDTH, TERMS): coefficients of P, the particular solution of P'' = P + f,
    in the time since the interval's middle; `half`: half an interval's duration. All are nondimensional.
    """
    return ClosedForm(np.stack(particular_at(particular, half), axis=-1), np.stack(particular_at(polynomials, half)))


def _response(particular, polynomials, order, half):
    """Return the named tuple `Response` from P of the forcing and the polynomials of the interpolant.

    `particular` (m, TERMS): coefficients of P, the particular solution of P'' = P + f; `polynomials` (WIDTH, TERMS):
    of the noise; both in the time since the interval's middle. `order`: terms of the envelope's polynomial; `half`:
    half an interval's duration. All are nondimensional.
    """

    def over_an_interval(particular):
        """Return (2, n), angle and velocity that flights over an interval gain from P of n forces (n, TERMS)."""
        return np.stack(
            forced_response(*particular_at(particular, -half), *particular_at(particular, half), 2.0 * half)
        )

    powers = [np.pad(polynomials, ((0, 0), (k, 0)))[:, :TERMS] for k in range(order)]
    noise = np.stack([over_an_interval(particular_series(0.0, 0.0, power)) for power in powers])
    return Response(noise, over_an_interval(particular).T.copy())


def _collocation(force, envelope, polynomials, middles, spacing, noise_bounds):
    """Return the named tuple `Collocation` from the forcing and the polynomials of the interpolant; nondimensional.

    `force` (m, TERMS) and `polynomials` (parts, WIDTH, TERMS) are coefficients in the time since the intervals'
    `middles` (m,), which are times τ, `spacing` apart; `envelope`: that of the noise, or None. `noise_bounds`: a pair
    of floats, bounds of the noise's first and second derivative.
    """
    times = 0.5 * spacing * (2.0 * PLACES - 1.0)
    order, half = np.arange(TERMS), 0.5 * spacing
    powers = times ** order[:, None]
    strength = np.empty((0, NODES)) if envelope is None else envelope.value(middles[:, None] + times)
    values = (polynomials @ powers).reshape(-1, NODES)
    # Beside the outer points the force changes by its slope, between two it leaves the chord by its curvature.
    slope = np.abs(force[:, 1:]) @ (order[1:] * half ** order[:-1]) + noise_bounds[0]
    bend = np.abs(force[:, 2:]) @ (order[2:] * order[1:-1] * half ** order[:-2]) + noise_bounds[1]
    slack = np.maximum(spacing * PLACES[0] * slope, 0.125 * (spacing * np.diff(PLACES).max()) ** 2 * bend)
    return Collocation(values, force @ powers, strength, slack, flight_tables(spacing))


def _eventless_angles(low, high, spacing, block):
    """Return three arrays of `Parameters`, `least` (m, 2), `most` (m, 2) and `stays` (m,) of bool.

    `low`, `high` (m,): bounds of the force in each interval; `spacing`: duration of one; `block`: `KernelBlock`. The
    folded angles `least` and `most` are indexed [interval, side < 0 or > 0]. All are nondimensional.
    """
    (below, above), stays = np.empty((2, low.size, 2)), np.empty(low.size, np.bool_)
    _write_clearances(low, high, spacing, block, below, above, stays)
    return below, block.cutoff - above, stays


@kernel
def _write_clearances(low, high, spacing, block, below, above, stays):
    """Write to `below`, `above` (m, 2) how far flights may leave the chord between their ends, as angles.

    They are indexed [interval, side < 0 or > 0]. `low`, `high` (m,) are bounds of the force, `spacing` is the duration
    of an interval, all nondimensional, and `block` a `KernelBlock`. Whether a block at rest surely stays is written to
    `stays` (m,), of bool.
    """
    for j in range(low.size):
        stays[j] = not can_lift_off(low[j], high[j], block)
        for k in range(2):
            below[j, k], above[j, k] = chord_clearance(2 * k - 1, low[j], high[j], spacing, block)


class Workspace(NamedTuple):
    """Arrays of a thread.

    `samples`: of the noise. `node` (CHUNK,): the noise's share of P at the ends of the CHUNK intervals that the last
    samples complete. `interval`: P in an interval, and scratch. `noise` (TERMS,): the noise in an interval, less its
    envelope. `acceleration` (1, NODES): u'' of an exact block in the flight that `try_step` has tried.
    """

    samples: Samples
    node: np.ndarray
    interval: Interval
    noise: np.ndarray
    acceleration: np.ndarray


@kernel
def workspace_of(parameters):
    """Return the named tuple `Workspace` of a thread, arrays of the sizes that `parameters`, a `Parameters`, need."""
    samples, rows = allocate_samples(parameters.band.harmonics), np.empty((4, TERMS))
    half = 0.5 * parameters.grid.spacing
    exponentials, bend = parameters.exponentials, parameters.bend
    interval = Interval(rows[0], rows[1], rows[2], exponentials, bend, half, math.exp(half))
    return Workspace(samples, np.empty(CHUNK), interval, rows[3], np.zeros((1, NODES)))
