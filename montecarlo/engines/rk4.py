"""Classical Runge-Kutta of order 4 with Shinozuka noise: the paper's method.

Steps of T/n see the forcing at their begin, middle and end. Between impacts the motion of a slender block is linear, so
the four stages add up to one fixed matrix and three fixed weights. A step in which an impact, the cut-off or uplift
cannot be excluded takes the forcing as the parabola through its three values and follows the block without error
(`fpk_rocking.physics`): impacts, chatter, rest and first passage are located there, and order 4 is kept because such
steps are few.
"""

import sys
from typing import NamedTuple

import numpy as np

from fpk_rocking.base.jit import kernel
from fpk_rocking.physics.motion import TERMS
from fpk_rocking.physics.motion.equation import block_of, block_of_scene, dispatch_on_block
from fpk_rocking.physics.motion.events import advance_through_events, can_lift_off, folded_angle_bounds
from fpk_rocking.physics.motion.flight import runge_kutta_coefficients, runge_kutta_forcing
from fpk_rocking.physics.motion.segment import segment_from_particular
from fpk_rocking.physics.noise import band
from montecarlo.engines import shinozuka
from montecarlo.engines.grid import grid_of
from montecarlo.engines.march import carriers, marcher, realizer, the_state
from montecarlo.engines.shinozuka import band_of
from montecarlo.engines.start import start_numbers
from montecarlo.engines.steps import classical

METHOD = "rk4"
RENEWS = False
BLOCK = 1

CHUNK_STEPS = 20
"""Steps for which noise is made at once, at most: an overturned block has cost no more than that in vain."""


def takes(scene):
    """Whether this engine simulates a scene."""
    return scene.noise.kind in {"band", "none"}


class Problem(NamedTuple):
    """What the kernel has to know: a scene in numbers, nondimensional.

    `start` (5,); `count`, `spacing`, `marks`; `low_ratio` to `harmonics`: see `montecarlo.engines.start`, `grid` and
    `shinozuka`. `forcing` (n, 3): its values at the begin, the middle and the end of the n steps of a lap. `strength`
    (n, 3): the noise's envelope there.
    """

    restitution: float
    cutoff: float
    critical_angle: float | None
    start: np.ndarray
    count: int
    spacing: float
    marks: np.ndarray
    forcing: np.ndarray
    strength: np.ndarray
    low_ratio: float
    ratio_width: float
    weight: float
    harmonics: int


class Room(NamedTuple):
    """Working memory of one realization, and the forcing of a chunk of steps with what RK4 makes of it; m steps.

    `noise` (2 m + 1,) at the half steps; `force` (m, 3) with it at begin, middle and end of the steps; `low`, `high`
    (m,) bound the parabola through the three values of a step; `push` (m, 2) is the forcing's contribution to angle and
    velocity of a slender block over a step. `particular`, `scratch` (TERMS,) are room for a `Segment`.
    """

    harmonics: band.Realization
    noise: np.ndarray
    force: np.ndarray
    low: np.ndarray
    high: np.ndarray
    push: np.ndarray
    particular: np.ndarray
    scratch: np.ndarray


def problem_of(scene, steps_per_cycle, times=None):
    """Return the `Problem` of a scene with band noise or none; a realization does not depend on `times`."""
    grid = grid_of(scene, scene.forcing.time_scale / steps_per_cycle, times)
    return Problem(
        *block_of_scene(scene),
        start_numbers(scene.start),
        *grid,
        scene.forcing.stage_values(grid.spacing, grid.count),
        _strengths(scene.noise.envelope, grid),
        *band_of(scene, grid.duration),
    )


def _strengths(envelope, grid):
    """Return the envelope (n, 3) at the begin, the middle and the end of every step."""
    if envelope is None:
        return np.ones((grid.count, 3))
    places = np.arange(grid.count)[:, None] + np.array([0.0, 0.5, 1.0])
    return envelope.value(grid.spacing * places)


@kernel
def room_of(problem):
    """Return the `Room` of one realization."""
    n = problem.count
    chunks = (n + CHUNK_STEPS - 1) // CHUNK_STEPS
    length = (n + chunks - 1) // chunks
    return Room(
        band.allocate_realization(problem.harmonics, length),
        np.empty(2 * length + 1),
        np.empty((length, 3)),
        np.empty(length),
        np.empty(length),
        np.empty((length, 2)),
        np.zeros(TERMS),
        np.empty(TERMS),
    )


@kernel
def begin(stream, x, v, side, cycle, problem, room):  # noqa: ARG001  (all of the noise is drawn with the start)
    """Tabulate the rotations of the noise."""
    n, length, harmonics = problem.count, room.low.size, room.harmonics
    band.write_sample_rotations(harmonics, length, 0.5 / n)
    band.write_rotation(harmonics.ratios, length / n, harmonics.hop[0], harmonics.hop[1])
    last = (n - 1) // length * length
    band.write_rotation(harmonics.ratios, 1.0 - last / n, harmonics.wrap[0], harmonics.wrap[1])
    return x, v


@kernel(forceinline=True, borrows=True)
def know(stream, number, j, cycle, problem, room):  # noqa: ARG001
    """Make the forcing of the next chunk of steps, where the last one is used up."""
    if j % room.low.size == 0:
        _extend(number, j, cycle, problem, room)


@kernel(borrows=True)
def _extend(number, first, cycle, problem, room):
    """Make the forcing of the chunk that begins with a step, bounds of it, and what it does in each step."""
    n, length, harmonics, h = problem.count, room.low.size, room.harmonics, problem.spacing
    cycle += number // n
    if number == 0 or (first == 0 and cycle % band.ANCHOR_CYCLES == 0):
        band.set_centre(harmonics, cycle, 0.5 * length / n)
    else:
        band.rotate_centre(harmonics, harmonics.wrap if first == 0 else harmonics.hop)
    room.noise[:] = 0.0
    band.add_samples(harmonics, length, room.noise)
    for j in range(min(length, n - first)):
        for i in range(3):
            room.force[j, i] = problem.forcing[first + j, i]
            room.force[j, i] += problem.strength[first + j, i] * room.noise[2 * j + i]
        begin, middle, end = room.force[j, 0], room.force[j, 1], room.force[j, 2]
        bend = 0.125 * abs(begin - 2.0 * middle + end)
        room.low[j] = min(begin, middle, end) - bend
        room.high[j] = max(begin, middle, end) + bend
        room.push[j, 0], room.push[j, 1] = runge_kutta_forcing(begin, middle, end, h)


@kernel(inline="always")
def _slender_step(x, v, side, k, h, room, block):  # noqa: ARG001
    keep, swap, share = runge_kutta_coefficients(h)
    return keep * x + swap * v + room.push[k, 0] - side * share, swap * x + keep * v + room.push[k, 1] - side * swap


@kernel(inline="always")
def _exact_step(x, v, side, k, h, room, block):
    begin, middle, end = room.force[k, 0], room.force[k, 1], room.force[k, 2]
    u, w = classical(side * x, side * v, side, begin, middle, end, h, block)
    return side * u, side * w


_step = dispatch_on_block(_slender_step, _exact_step)


@kernel(fastmath={"contract"}, forceinline=True, borrows=True)
def coast(state, side, number, j, problem, room):  # noqa: ARG001
    """Whether nothing happens in a step, and angle and velocity at its end if so."""
    k, h, (x, v) = j % room.low.size, problem.spacing, state
    if side == 0:
        return not can_lift_off(room.low[k], room.high[k], block_of(problem)), state
    floor, roof = folded_angle_bounds(side * x, side * v, side, room.low[k], room.high[k], h, block_of(problem))
    x, v = _step(x, v, side, k, h, room, block_of(problem))
    cutoff = problem.cutoff
    return floor > 0.0 and roof < cutoff and 0.0 < side * x < cutoff, (x, v)


@kernel(borrows=True)
def resolve(number, j, problem, room):  # noqa: ARG001
    """Write P of the parabola through the three values of the forcing in a step."""
    k, h = j % room.low.size, problem.spacing
    begin, middle, end = room.force[k, 0], room.force[k, 1], room.force[k, 2]
    slope = (4.0 * middle - 3.0 * begin - end) / h
    curvature = 4.0 * (begin - 2.0 * middle + end) / (h * h)
    # With f a parabola, P = -f - f'' solves P'' = P + f.
    room.particular[0] = -begin - curvature
    room.particular[1] = -slope
    room.particular[2] = -0.5 * curvature


@kernel(borrows=True)
def carry(x, v, side, number, j, share, cycle, problem, room, impacts):
    """Carry a block through a share of a resolved step; return x, v, side and the time reached."""
    n, h, k = problem.count, problem.spacing, j % room.low.size
    origin = (cycle + number // n) * (n * h) + (j - k) * h
    segment = segment_from_particular(room.particular, room.scratch, h)
    x, v, side, time = advance_through_events(
        x, v, side, segment, 0.0, h * share, block_of(problem), impacts, origin + k * h
    )
    return x, v, side, origin + (k * h + time)


draw = shinozuka.draw
look, cross = carriers(sys.modules[__name__])
seen = the_state
march = marcher(sys.modules[__name__])
realize = realizer(sys.modules[__name__])
