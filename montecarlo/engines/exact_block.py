"""An exact block under band noise or none, with an envelope or without: carried by `physics.motion.collocation`.

So is a slender one on a base that moves vertically, whose flights have no closed form.
"""

import math
from typing import NamedTuple

import numpy as np

from fpk_rocking.base.arrays import load, store
from fpk_rocking.base.jit import kernel
from fpk_rocking.physics.motion import TERMS, collocation
from fpk_rocking.physics.motion.collocation import NODES, PLACES, FlightTables, flight_tables
from fpk_rocking.physics.motion.equation import block_at, block_in
from fpk_rocking.physics.motion.events import can_lift_off
from fpk_rocking.physics.motion.slender import force_series
from fpk_rocking.physics.noise.band import noise_at_points
from montecarlo.engines.band_noise import CHUNK, interpolate, largest_noise, sample_and_part
from montecarlo.engines.engine import Engine
from montecarlo.engines.exact import PIECEWISE, in_closed_form, is_eventless, tables_of_scene


class Collocation(NamedTuple):
    """Tables of these flights, at the NODES points of an interval."""

    values: np.ndarray  # (2^halvings WIDTH, NODES): polynomials of the interpolant
    forcing: np.ndarray  # (m, NODES)
    envelope: np.ndarray  # (m, NODES), (0, NODES) without one
    slack: np.ndarray  # (m,): how far the force may pass its values at the points, inf with an envelope
    steps: FlightTables


def parameters_of(scene, _steps_per_cycle, times=None):
    tables, envelope = tables_of_scene(scene, times, finer=True), scene.noise.envelope
    force, spacing = force_series(tables.forced), tables.grid.spacing
    middles, points = (np.arange(tables.grid.count) + 0.5) * spacing, 0.5 * spacing * (2.0 * PLACES - 1.0)
    order, half = np.arange(TERMS), 0.5 * spacing
    powers = points ** order[:, None]
    strength = np.empty((0, NODES)) if envelope is None else envelope.value(middles[:, None] + points)
    values = (tables.polynomials @ powers).reshape(-1, NODES)
    # Bounds of the noise's first and second derivative.
    fastest = scene.noise.band[1] if tables.band.harmonics else 0.0
    loud = math.inf if envelope is not None else largest_noise(scene.noise, tables.band) * fastest
    # Beside the outer points the force changes by its slope, between two it leaves the chord by its curvature.
    slope = np.abs(force[:, 1:]) @ (order[1:] * half ** order[:-1]) + loud
    bend = np.abs(force[:, 2:]) @ (order[2:] * order[1:-1] * half ** order[:-2]) + loud * fastest
    slack = np.maximum(spacing * PLACES[0] * slope, 0.125 * (spacing * np.diff(PLACES).max()) ** 2 * bend)
    flight = Collocation(values, force @ powers, strength, slack, flight_tables(spacing))
    return tables._replace(forced=force, flight=flight)


@kernel(forceinline=True)
def _surely_rests(force, slack, scratch, block):
    """Whether a block surely stays at rest, by the `force` at the NODES points and the `slack` between them."""
    store(scratch, 0, force)
    low, high = scratch[0, 0], scratch[0, 0]
    for n in range(1, NODES):
        low, high = min(low, scratch[0, n]), max(high, scratch[0, n])
    return not can_lift_off(low - slack, high + slack, block)


@kernel(inline="always")
def _try_step(state, side, number, j, parameters, workspace):
    """Whether interval j surely has no event, and the state at its end, nan where collocation has not converged."""
    x, v = state
    if side == 0 and (parameters.stays[j] or parameters.flight.slack[j] == math.inf):
        return parameters.stays[j], state
    if parameters.envelope.first[j + 1] > parameters.envelope.first[j] + 1:
        return False, state
    tables, spacing = parameters.flight, parameters.grid.spacing
    block = block_at(-0.5 * spacing, block_in(parameters.weights, j, parameters.block))
    sample, part = sample_and_part(number, parameters)
    push = noise_at_points(tables.values, part, workspace.samples.values, sample % CHUNK)
    if tables.envelope.shape[0] > 0:
        push = load(tables.envelope, j) * push
    push = load(tables.forcing, j) + push
    if side == 0:
        return _surely_rests(push, tables.slack[j], workspace.acceleration, block), state
    u, push = side * x, side * push
    end, speed, acceleration, converged = collocation.fly_by_tables(
        u, side * v, side, push, tables.steps, spacing, block
    )
    store(workspace.acceleration, 0, acceleration)
    eventless = converged and is_eventless(u, end, side, j, parameters)
    return eventless, (side * end if converged else math.nan, side * speed)


@kernel(inline="always")
def _build_noise(number, _j, parameters, workspace):
    """Write the noise, without its envelope, to `workspace.noise` (TERMS,), by the time since the interval's middle."""
    sample, part = sample_and_part(number, parameters)
    samples, polynomials = workspace.samples.values, parameters.polynomials[part]
    interpolate(workspace.noise, parameters.zeros, polynomials, samples, sample % CHUNK)


ENGINE = Engine(
    takes=lambda scene: scene.noise.kind in {"none", "band"} and not in_closed_form(scene),
    parameters_of=parameters_of,
    try_step=_try_step,
    build_force=_build_noise,
    **PIECEWISE,
)
