"""A slender block under band noise or none, in closed form: s + P plus two exponentials, P the particular solution.

The state is (grow, decay, u): the exponentials and the folded angle.
"""

import math
from typing import NamedTuple

import numpy as np

from fpk_rocking.base.jit import kernel
from fpk_rocking.physics.motion.flight import exponential_parts, folded_angle
from fpk_rocking.physics.motion.impact import side_of_start
from fpk_rocking.physics.motion.intervals import cross_interval, state_in_interval
from fpk_rocking.physics.motion.slender import particular_at
from fpk_rocking.physics.noise.band import WIDTH, divide_by_stiffness, noise_slope
from montecarlo.engines.band_noise import (
    CHUNK,
    draw_start_and_noise,
    interpolate,
    write_first_samples,
    write_next_samples,
)
from montecarlo.engines.engine import Engine
from montecarlo.engines.exact import COMMON, has_envelope, in_closed_form, is_eventless, tables_of_scene


class ClosedForm(NamedTuple):
    """Tables of these flights."""

    node: np.ndarray  # (m, 2): P of the forcing and its derivative at the interval's end
    ends: np.ndarray  # (2, WIDTH): the interpolant's polynomials there, and their derivatives


def parameters_of(scene, _steps_per_cycle, times=None):
    tables = tables_of_scene(scene, times)
    half = 0.5 * tables.grid.spacing
    node = np.stack(particular_at(tables.forced, half), axis=-1)
    return tables._replace(flight=ClosedForm(node, np.stack(particular_at(tables.polynomials[0], half))))


@kernel(inline="always")
def _begin(stream, cycle, parameters, workspace):
    samples = workspace.samples
    x, v = draw_start_and_noise(stream, parameters.start, parameters.band, samples.harmonics)
    side = side_of_start(x, v)
    ratios, frequency = samples.harmonics.ratios, 2.0 * math.pi / (parameters.grid.count * parameters.grid.spacing)
    divide_by_stiffness(ratios, samples.harmonics.weights, frequency, parameters.compensation, parameters.ratio_scale)
    write_first_samples(samples, cycle, parameters)
    _write_nodes(samples.values, workspace.node, parameters.flight.ends)
    _build_particular(0, 0, parameters, workspace)
    grow, decay = exponential_parts(x, v, side, workspace.interval.particular, -workspace.interval.half)
    return (x, v), (grow, decay, abs(x))


@kernel(fastmath={"contract"})
def _write_nodes(samples, node, ends):
    """Write to `node` (CHUNK,) the noise's share of P at the ends of the intervals that new `samples` complete."""
    node[:] = 0.0
    for i in range(0, WIDTH, 4):
        a, b, c, d = ends[0, i], ends[0, i + 1], ends[0, i + 2], ends[0, i + 3]
        for k in range(CHUNK):
            node[k] += (a * samples[k + i] + b * samples[k + i + 1]) + (c * samples[k + i + 2] + d * samples[k + i + 3])


@kernel(forceinline=True)
def _draw(_stream, number, _j, cycle, parameters, workspace):
    """Write the next samples of the noise, and P at the intervals' ends, if the last are used up."""
    if write_next_samples(workspace.samples, number, cycle, parameters):
        _write_nodes(workspace.samples.values, workspace.node, parameters.flight.ends)


@kernel(forceinline=True)
def _try_step(state, side, number, j, parameters, workspace):
    """Whether interval j surely has no event, and the state at its end; never at rest."""
    factor, (grow, decay, u) = workspace.interval.factor * workspace.interval.factor, state
    grow, decay = grow * factor, decay * (1.0 / factor)
    end = folded_angle(side, parameters.flight.node[j, 0] + workspace.node[number % CHUNK], grow, decay)
    return side != 0 and is_eventless(u, end, side, j, parameters), (grow, decay, end)


@kernel(inline="always")
def _build_particular(number, j, parameters, workspace):
    """Write P in interval j to `workspace.interval.particular` (TERMS,), by the time since the interval's middle."""
    particular, samples = workspace.interval.particular, workspace.samples.values
    interpolate(particular, parameters.forced[j], parameters.polynomials[0], samples, number % CHUNK)


@kernel(inline="always")
def _step_with_events(state, end, side, number, j, _share, cycle, parameters, workspace, impacts):
    middle = cycle * (parameters.grid.count * parameters.grid.spacing) + (number + 0.5) * parameters.grid.spacing
    node = parameters.flight.node[j, 0] + workspace.node[number % CHUNK]
    grow, decay, u, side, time = cross_interval(
        workspace.interval, node, state[0], state[1], state[2], end[2], side, parameters.block, impacts, middle
    )
    return (grow, decay, u), side, time


@kernel(inline="always")
def _step_within(state, _end, side, _number, _j, share, _cycle, parameters, workspace, impacts):
    time, block = (share - 0.5) * parameters.grid.spacing, parameters.block
    return state_in_interval(workspace.interval, state[0], state[1], side, time, block, impacts), side, math.inf


@kernel(forceinline=True)
def _state_at_end(state, side, number, j, parameters, workspace):
    grow, decay, u = state
    if side == 0:
        return 0.0, 0.0
    slope = noise_slope(workspace.samples.values, number % CHUNK, parameters.flight.ends[1])
    return side * u, parameters.flight.node[j, 1] + slope + grow - decay


ENGINE = Engine(
    takes=lambda scene: scene.noise.kind in {"none", "band"} and in_closed_form(scene) and not has_envelope(scene),
    parameters_of=parameters_of,
    begin=_begin,
    draw=_draw,
    try_step=_try_step,
    build_force=_build_particular,
    step_with_events=_step_with_events,
    step_within=_step_within,
    state_at_end=_state_at_end,
    **COMMON,
)
