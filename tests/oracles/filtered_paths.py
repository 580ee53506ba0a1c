"""Paths under filtered noise on two grids at once: the same noise, so that their difference has little scatter."""

import math

import numpy as np

from fpk_rocking.base.jit import kernel
from fpk_rocking.physics.motion.impact import side_of_start
from montecarlo.engines.engine import TimeGrid
from montecarlo.engines.filtered import (
    ENGINE,
    draw_first_states,
    draw_next_interval,
    draw_parts,
    parameters_on_grid,
    workspace_of,
)
from montecarlo.engines.random import draw_start, open_stream, stream_keys

try_step, build_force, step_with_events = ENGINE.try_step, ENGINE.build_force, ENGINE.step_with_events


def with_intervals(scene, intervals):
    """The engine's parameters of a scene for a number of intervals in a cycle."""
    return parameters_on_grid(scene, TimeGrid(intervals, scene.period / intervals, np.array([float(intervals)])))


@kernel
def _gather(fine, part, parameters, coarse):
    """Add part number `part` of a coarse interval's noise, drawn on the fine grid: states and flight."""
    n = fine.drawn.size // 2 - 1
    keep, swap = parameters.hyperbolic
    if part == 0:
        for i in range(n):
            coarse.drawn[i] = fine.drawn[i]
        coarse.drawn[2 * n], coarse.drawn[2 * n + 1] = 0.0, 0.0
    x, v = coarse.drawn[2 * n], coarse.drawn[2 * n + 1]
    coarse.drawn[2 * n] = keep * x + swap * v + fine.drawn[2 * n]
    coarse.drawn[2 * n + 1] = swap * x + keep * v + fine.drawn[2 * n + 1]
    for i in range(n):
        coarse.drawn[n + i] = fine.drawn[n + i]
    coarse.stream[:] = fine.stream


@kernel
def interval(x, v, side, number, j, parameters, workspace, by_force):
    """Carry a block through an interval whose noise is drawn; return x, v, side and the time reached.

    With `by_force` that is by the polynomial of the force, of which a path without events has no need.
    """
    eventless, end = try_step((x, v), side, number, j, parameters, workspace)
    if by_force or not eventless:
        build_force(number, j, parameters, workspace)
        end, side, time = step_with_events((x, v), end, side, number, j, 1.0, 0, parameters, workspace, None)
        if time < math.inf:
            return *end, side, time
    return *end, side, (number + 1) * parameters.grid.spacing


@kernel
def _pair(stream, fine, coarse, factor, cycles):
    """Follow one path on both grids; return both times of overturning (inf: none) and both last angles."""
    workspaces = workspace_of(fine), workspace_of(coarse)
    x, v = draw_start(stream, fine.start)
    states = [(x, v, side_of_start(x, v)), (x, v, side_of_start(x, v))]
    times = [math.inf, math.inf]
    draw_first_states(stream, fine.noise, workspaces[0].noise)
    intervals = fine.low.size
    for number in range(cycles * intervals):
        draw_next_interval(stream, fine.noise, workspaces[0].noise)
        _gather(workspaces[0].noise, number % factor, fine, workspaces[1].noise)
        if times[0] == math.inf:
            x, v, side = states[0]
            x, v, side, time = interval(x, v, side, number, number % intervals, fine, workspaces[0], False)
            states[0] = x, v, side
            if abs(x) >= fine.block.cutoff:
                times[0] = time
        if times[1] == math.inf and number % factor == factor - 1:
            x, v, side = states[1]
            j = number % intervals // factor
            x, v, side, time = interval(x, v, side, number // factor, j, coarse, workspaces[1], False)
            states[1] = x, v, side
            if abs(x) >= fine.block.cutoff:
                times[1] = time
    return times[0], times[1], states[0][0], states[1][0]


@kernel
def _pairs(keys, fine, coarse, factor, cycles, out, angle):
    for r in range(out.shape[0]):
        out[r, 0], out[r, 1], angle[r, 0], angle[r, 1] = _pair(open_stream(keys, r), fine, coarse, factor, cycles)


def without_parts(parameters):
    """The parameters of an engine that never draws its noise in parts of an interval."""
    parts = parameters.noise.parts
    return parameters._replace(noise=parameters.noise._replace(parts=parts._replace(gain=parts.gain[:0], margin=0.0)))


def coupled(scene, intervals, factor, cycles, paths, seed=1, parts=True):
    """Return times of overturning and last angles, (paths, 2) each: `intervals` in a cycle, `factor` times fewer."""
    out, angle = np.empty((2, paths, 2))
    parameters = with_intervals(scene, intervals), with_intervals(scene, intervals // factor)
    if not parts:
        parameters = [without_parts(each) for each in parameters]
    _pairs(stream_keys(seed), *parameters, factor, cycles, out, angle)
    return out, angle


@kernel
def _parts(keys, parameters, states, flights):
    n, count = len(parameters.noise.stationary), parameters.noise.parts.gain.shape[0]
    for r in range(states.shape[0]):
        stream, noise = open_stream(keys, r), workspace_of(parameters).noise
        draw_first_states(stream, parameters.noise, noise)
        for k in range(states.shape[1] // count):
            draw_next_interval(stream, parameters.noise, noise)
            draw_parts(parameters.noise.parts, noise)
            states[r, k * count : (k + 1) * count] = noise.parts[:, n : 2 * n]
            flights[r, k * count : (k + 1) * count] = noise.parts[:, 2 * n :]


def parts_of(parameters, intervals, paths, seed=1):
    """Return states (paths, m, n) at the ends of the m parts of some intervals, and flights (paths, m, 2) over them."""
    count, order = len(parameters.noise.parts.gain), len(parameters.noise.stationary)
    states, flights = np.empty((paths, intervals * count, order)), np.empty((paths, intervals * count, 2))
    _parts(stream_keys(seed), parameters, states, flights)
    return states, flights


@kernel
def _noise(keys, parameters, states, flights):
    n = len(parameters.noise.stationary)
    for r in range(states.shape[0]):
        stream, workspace = open_stream(keys, r), workspace_of(parameters)
        draw_first_states(stream, parameters.noise, workspace.noise)
        for k in range(states.shape[1]):
            states[r, k] = workspace.noise.drawn[n : 2 * n]
            draw_next_interval(stream, parameters.noise, workspace.noise)
            flights[r, k] = workspace.noise.drawn[2 * n :]


def noise_of(parameters, count, paths, seed=1):
    """Return states (paths, count, n) of the filter of noise of variance 1, and flights (paths, count, 2) between."""
    states, flights = np.empty((paths, count, len(parameters.noise.stationary))), np.empty((paths, count, 2))
    _noise(stream_keys(seed), parameters, states, flights)
    return states, flights
