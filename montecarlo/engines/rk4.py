"""Classical Runge-Kutta of order 4 with Shinozuka noise: the paper's method.

Steps of T/n see the forcing at their beginning, middle and end; for a slender block the four stages add up to one
matrix and three weights. A step in which an event cannot be excluded takes the forcing as the parabola through its
three values and follows the block without error (`fpk_rocking.physics`); order 4 is kept because such steps are few.
"""

import math
from typing import NamedTuple

import numpy as np

from fpk_rocking.base.arrays import borrowed
from fpk_rocking.base.jit import kernel
from fpk_rocking.physics.motion import TERMS
from fpk_rocking.physics.motion.equation import (
    KernelBlock,
    acceleration,
    block_of_scene,
    dispatch_on_block,
    inlined_block_at,
    inlined_block_in,
    segment_from_particular,
)
from fpk_rocking.physics.motion.events import advance_through_events, can_lift_off, folded_angle_bounds
from fpk_rocking.physics.motion.flight import runge_kutta_coefficients, runge_kutta_forcing
from fpk_rocking.physics.noise import band
from montecarlo.engines.band_noise import Band, band_of_scene, draw_start_and_noise
from montecarlo.engines.engine import Engine, TimeGrid, time_grid
from montecarlo.engines.random import start_parameters


class RungeKuttaParameters(NamedTuple):
    """What the kernels of rk4 read of a scene, nondimensional."""

    block: KernelBlock
    start: np.ndarray  # (5,), of `start_parameters`
    grid: TimeGrid
    forcing: np.ndarray  # (n, 3), at the beginning, middle and end of the n steps of a table period
    strength: np.ndarray  # (n, 3), the noise's envelope
    band: Band
    weights: np.ndarray  # (n, 3), of `Weight`; (0, 3) where the base does not move vertically


class Workspace(NamedTuple):
    """Arrays of a thread: the noise, and the force in a chunk of m steps with what RK4 makes of it."""

    harmonics: band.Realization
    noise: np.ndarray  # (2 m + 1,), at the half steps
    force: np.ndarray  # (m, 3), at the three times of the steps
    low: np.ndarray  # (m,), bounds of the parabola through them
    high: np.ndarray
    push: np.ndarray  # (m, 2): what it adds to angle and velocity of a slender block
    particular: np.ndarray  # (TERMS,), of a `Segment`
    scratch: np.ndarray


def parameters_of(scene, steps_per_cycle, times=None):
    grid, envelope = time_grid(scene, scene.forcing.time_scale / steps_per_cycle, times), scene.noise.envelope
    places = np.arange(grid.count)[:, None] + np.array([0.0, 0.5, 1.0])
    strength = np.ones(places.shape) if envelope is None else envelope.value(grid.spacing * places)
    return RungeKuttaParameters(
        block_of_scene(scene),
        start_parameters(scene.start),
        grid,
        scene.forcing.stage_values(grid.spacing, grid.count),
        strength,
        band_of_scene(scene, grid.duration),
        scene.forcing.weights(grid.spacing, grid.count),
    )


@kernel
def workspace_of(parameters):
    n = parameters.grid.count
    chunks = (n + 19) // 20  # of 20 steps at most: noise that is made for an overturned block is in vain
    length = (n + chunks - 1) // chunks
    return Workspace(
        band.allocate_realization(parameters.band.harmonics, length),
        np.empty(2 * length + 1),
        np.empty((length, 3)),
        np.empty(length),
        np.empty(length),
        np.empty((length, 2)),
        np.zeros(TERMS),
        np.empty(TERMS),
    )


@kernel(inline="always")
def _begin(stream, _cycle, parameters, workspace):
    """Draw start and noise, and write the rotations by which the harmonics are sampled."""
    n, length, harmonics = parameters.grid.count, workspace.low.size, workspace.harmonics
    state = draw_start_and_noise(stream, parameters.start, parameters.band, harmonics)
    band.write_sample_rotations(harmonics, length, 0.5 / n)
    band.write_rotation(harmonics.ratios, length / n, harmonics.hop[0], harmonics.hop[1])
    last = (n - 1) // length * length
    band.write_rotation(harmonics.ratios, 1.0 - last / n, harmonics.wrap[0], harmonics.wrap[1])
    return state, state


@kernel(forceinline=True)
def _draw(_stream, number, j, cycle, parameters, workspace):
    """Write the force in the chunk of steps that begins with step j, if one does."""
    if j % workspace.low.size == 0:
        _write_chunk(number, j, cycle, parameters, workspace)


@kernel
def _write_chunk(number, first, cycle, parameters, workspace):
    """Write the force in the chunk from step `first` of the table period on, its bounds, and what it adds."""
    n, length, harmonics, h = parameters.grid.count, workspace.low.size, workspace.harmonics, parameters.grid.spacing
    cycle += number // n
    if number == 0 or (first == 0 and cycle % band.ANCHOR_CYCLES == 0):
        band.set_centre(harmonics, cycle, 0.5 * length / n)
    else:
        band.rotate_centre(harmonics, harmonics.wrap if first == 0 else harmonics.hop)
    workspace.noise[:] = 0.0
    band.add_samples(harmonics, length, workspace.noise)
    for j in range(min(length, n - first)):
        for i in range(3):
            workspace.force[j, i] = parameters.forcing[first + j, i]
            workspace.force[j, i] += parameters.strength[first + j, i] * workspace.noise[2 * j + i]
        begin, middle, end = workspace.force[j, 0], workspace.force[j, 1], workspace.force[j, 2]
        bend = 0.125 * abs(begin - 2.0 * middle + end)
        workspace.low[j] = min(begin, middle, end) - bend
        workspace.high[j] = max(begin, middle, end) + bend
        workspace.push[j, 0], workspace.push[j, 1] = runge_kutta_forcing(begin, middle, end, h)


@kernel(inline="always")
def _slender_step(x, v, side, k, h, workspace, _block):
    """Return (angle, velocity) of a slender block after step k of a chunk without an event."""
    keep, swap, share = runge_kutta_coefficients(h)
    return keep * x + swap * v + workspace.push[k, 0] - side * share, swap * x + keep * v + workspace.push[
        k, 1
    ] - side * swap


@kernel(inline="always")
def classical_step(u, w, side, begin, middle, end, h, block):
    """Return the folded (u, w) after a classical Runge-Kutta step, by the forces at its three times."""
    half = 0.5 * h
    between = inlined_block_at(half, block)
    first = acceleration(u, side, begin, block)
    second = acceleration(u + half * w, side, middle, between)
    third = acceleration(u + half * (w + half * first), side, middle, between)
    fourth = acceleration(u + h * (w + half * second), side, end, inlined_block_at(h, block))
    return u + h * (w + h * (first + second + third) / 6.0), w + h * (first + 2.0 * (second + third) + fourth) / 6.0


@kernel(inline="always")
def _exact_step(x, v, side, k, h, workspace, block):
    begin, middle, end = workspace.force[k, 0], workspace.force[k, 1], workspace.force[k, 2]
    u, w = classical_step(side * x, side * v, side, begin, middle, end, h, block)
    return side * u, side * w


_step = dispatch_on_block(_slender_step, _exact_step)


@kernel(fastmath={"contract"}, forceinline=True)
def _try_step(state, side, _number, j, parameters, workspace):
    k, h, (x, v) = j % workspace.low.size, parameters.grid.spacing, state
    block = inlined_block_in(parameters.weights, j, parameters.block)
    if side == 0:
        return not can_lift_off(workspace.low[k], workspace.high[k], block), state
    floor, roof = folded_angle_bounds(side * x, side * v, side, workspace.low[k], workspace.high[k], h, block)
    x, v = _step(x, v, side, k, h, workspace, block)
    cutoff = block.cutoff
    return floor > 0.0 and roof < cutoff and 0.0 < side * x < cutoff, (x, v)


@kernel
def _build_force(_number, j, parameters, workspace):
    """Write P of the force in step j to `workspace.particular`, by the time since the step's beginning."""
    k, h = j % workspace.low.size, parameters.grid.spacing
    begin, middle, end = workspace.force[k, 0], workspace.force[k, 1], workspace.force[k, 2]
    slope = (4.0 * middle - 3.0 * begin - end) / h
    curvature = 4.0 * (begin - 2.0 * middle + end) / (h * h)
    # With f a parabola, P = -f - f'' solves P'' = P + f.
    workspace.particular[0] = -begin - curvature
    workspace.particular[1] = -slope
    workspace.particular[2] = -0.5 * curvature


@kernel
def _step_with_events(state, _end, side, number, j, share, cycle, parameters, workspace, impacts):
    (x, v), n, h, k = state, parameters.grid.count, parameters.grid.spacing, j % workspace.low.size
    block = inlined_block_in(parameters.weights, j, parameters.block)
    origin = (cycle + number // n) * (n * h) + (j - k) * h
    segment = borrowed(segment_from_particular(workspace.particular, workspace.scratch, h))
    x, v, side, time = advance_through_events(x, v, side, segment, 0.0, h * share, block, impacts, origin + k * h)
    return (x, v), side, (origin + (k * h + time) if abs(x) >= parameters.block.cutoff else math.inf)


ENGINE = Engine(
    method="rk4",
    takes=lambda scene: scene.noise.kind in {"band", "none"},
    parameters_of=parameters_of,
    workspace_of=workspace_of,
    begin=_begin,
    draw=_draw,
    try_step=_try_step,
    build_force=_build_force,
    step_with_events=_step_with_events,
)
