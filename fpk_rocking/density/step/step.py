"""A time step of the density as a linear map (transfer operator), and its adjoint, the step of the backward equation.

Cells that no event can reach move in free flight (`free_flight`). From all others every Gauss point sends
characteristics (`characteristics`), which end in cells where their mass is scattered (`scatter`). A density
on the mesh is one of states that are displaced a little from the real ones (`free_flight`); paths are followed from
real states to real ones (`trace_cells`). A step is set up once for its phase of the forcing and applied in every cycle.
"""

import dataclasses
import math

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.base.arrays import borrowed, scratch
from fpk_rocking.base.basis import gauss_hermite_product, gauss_legendre, legendre_at_gauss_points
from fpk_rocking.base.jit import kernel, run_in_parts
from fpk_rocking.density.space import Space
from fpk_rocking.density.step.characteristics import Noise, principal_axes, trace_point, write_end
from fpk_rocking.density.step.dynamics import Dynamics, GaussPoints, event_cells, points_of_cell
from fpk_rocking.density.step.free_flight import FreeFlight, displaced
from fpk_rocking.density.step.scatter import AffinePaths, Chunks, SourceCells, Targets, gather, scatter, sum_buffers
from fpk_rocking.density.tuning import TUNING
from fpk_rocking.physics.motion import TERMS
from fpk_rocking.physics.motion.equation import KernelBlock, Segment

_four_polynomials = scratch(4, TERMS)


@kernel
def _trace_cells(begin, end, cells, points, segment, block, noise, displacement, ends, flags):
    """Write the ends and flags of the paths of the cells from number `begin` to `end`, see `trace_cells`."""
    cells, points, segment, noise, ends, flags = borrowed((cells, points, segment, noise, ends, flags))
    scratch = _four_polynomials()
    for c in range(begin, end):
        side, x, v = points_of_cell(cells[c, 0], cells[c, 1], points)
        for p in range(len(x)):
            for q in range(len(v)):
                xp, vq, ends_here, flags_here = x[p], v[q], ends[c, p, q], flags[c, p, q]
                if displacement > 0.0:
                    xp, vq = displaced(xp, vq, side, 0.0, displacement, segment, block)
                trace_point(xp, vq, side, segment, block, noise, scratch, ends_here, flags_here)
                if displacement > 0.0:
                    _displace_back(segment, block, noise.duration, displacement, ends_here, flags_here)


@kernel
def _displace_back(segment, block, duration, displacement, ends, flags):
    """Replace the real `ends` (n, 2) of paths, in place, by states of the mesh, where `flags` (n,) are a side, ±1.

    What is past the cut-off then has overturned.
    """
    for n in range(len(ends)):
        side = flags[n]
        if abs(side) == 1:
            x, v = displaced(ends[n, 0], ends[n, 1], side, duration, -displacement, segment, block)
            write_end(n, x, v, side, side, block.cutoff, ends, flags)


def trace_cells(cells, points: GaussPoints, segment: Segment, block: KernelBlock, noise: Noise, displacement=0.0):
    """Return the ends of the characteristics of all Gauss points of some cells, one for each node of the noise.

    `cells` (m, 2) are indices of angle and velocity, `displacement` is that of states of the mesh from the real ones at
    begin and end (`displaced`). For g and h Gauss points and n nodes the ends (m, g, h, n, 2) are angle and velocity;
    with them come flags (m, g, h, n), the side there, -1 or 1, or an `Exit`, below these.
    """
    shape = len(cells), len(points.angle_points), len(points.velocity_points), len(noise.nodes)
    ends, flags = np.empty((*shape, 2)), np.empty(shape, np.int32)
    parts = np.ascontiguousarray(cells), points, segment, block, noise, displacement, ends, flags
    path = TUNING.seconds_path if block.critical_angle is None else TUNING.seconds_exact_path
    run_in_parts(_trace_cells, len(cells), *parts, seconds=path * flags.size)
    return ends, flags


@dataclasses.dataclass(frozen=True)
class Quadrature:
    """Numbers of nodes of a step: Gauss points of a cell in both axes, Gauss-Hermite nodes along both axes of noise.

    `diffusion` nodes are those of the velocity in free flight: 15 end at 6.4 standard deviations, 9 at 4.5.
    """

    angle: int
    velocity: int
    long: int
    short: int
    diffusion: int = 15


class Characteristics:
    """The characteristics of one step from the Gauss points of its active cells, for any target mesh.

    Paths of the cells of a mask are traced at once. Where they end on another mesh, only a slender block that stays
    below the cut-off goes there in affine flight: all cells of an exact one count as cells that an event can reach.
    The `numbers` (angle cells, velocity cells) of the active `event_cells` are in the order in which these were traced,
    those of all others are -1; `ends`, `flags` are those of the cells active at first, see `trace_cells`.
    """

    def __init__(
        self,
        source: Space,
        start,
        duration,
        dynamics: Dynamics,
        quadrature: Quadrature,
        cells=True,
        to_other_mesh=False,
    ):
        # What a flight gathers weighs early noise more, so that a mean D would not do in a long step without events.
        axes = principal_axes(*dynamics.covariance(start, duration))
        dynamics = dynamics.averaged_over(start, duration)
        self.source, self.start, self.duration, self.dynamics = source, start, duration, dynamics
        rules = gauss_legendre(quadrature.angle), gauss_legendre(quadrature.velocity)
        tables = (legendre_at_gauss_points(count, source.degree) for count in (quadrature.angle, quadrature.velocity))
        self.points = GaussPoints(*source.lines, *(x for x, _ in rules), *(weights for _, weights in rules), *tables)
        nodes, self.node_weights = gauss_hermite_product(quadrature.long, quadrature.short)
        self.diffusion_nodes, self.affine = quadrature.diffusion, dynamics.affine(start, duration)
        self.offsets = nodes @ np.reshape(axes, (2, 2))
        farthest = dynamics.largest_factor * np.abs(self.offsets).max(axis=0)
        self._noise = Noise(duration, dynamics.diffusion, nodes, self.offsets, farthest[0])
        self._segment, self.excess = dynamics.segment(start, duration), dynamics.excess(start, duration)
        margins = self._noise.margin, math.inf if to_other_mesh else float(farthest[1])
        self.event_cells = event_cells(*source.lines, self._segment, duration, dynamics.block, margins)
        self.to_other_mesh = to_other_mesh
        self.event_cells |= dynamics.block.critical_angle is not None and to_other_mesh
        self.active = np.zeros_like(self.event_cells)
        self.numbers = np.full(self.event_cells.shape, -1, dtype=np.int32)
        self.ends, self.flags = self.activate(np.full_like(self.event_cells, cells))

    def activate(self, cells):
        """Add the cells of a mask to those that the step moves; return (ends, flags) of the paths traced for that."""
        new = np.argwhere(self.event_cells & cells & ~self.active)
        self.active |= cells
        self.numbers[new[:, 0], new[:, 1]] = self.numbers.max() + 1 + np.arange(len(new))
        displacement = 0.0 if self.to_other_mesh or not self.excess else self.duration**2 / 24.0
        return trace_cells(new, self.points, self._segment, self.dynamics.block, self._noise, displacement)


class Step:
    """The transfer operator of one step, from the coefficients of a density in one space to those in another.

    Mass is conserved to rounding: what does not end on the target mesh is returned as absorbed, that is overturned (to
    the left, to the right) or truncated, which is beyond the mesh or out of cells that are not active.

    Steps of one run may share `buffers`, from `scatter_buffers`, and those that differ in a constant force alone an
    `angle_remap`, from `free_flight.angle_remap_of`.
    """

    def __init__(self, characteristics: Characteristics, target: Space, buffers=None, angle_remap=None):
        if not characteristics.to_other_mesh and target is not characteristics.source:
            raise ValueError(
                checks.refusal("target", target, "the mesh of the characteristics, or some with to_other_mesh")
            )
        self.characteristics, self.target, self.angle_remap = characteristics, target, angle_remap
        self._affine = AffinePaths(*characteristics.affine, characteristics.offsets, characteristics.node_weights)
        self.buffers = scatter_buffers(target) if buffers is None else buffers
        self._absorbed = np.empty((TUNING.chunks, 3 if characteristics.dynamics.diffusion > 0.0 else 4))
        self._bases = (1.0,) * (characteristics.source.degree + 1), (1.0,) * (target.degree + 1)
        self._targets = Targets.empty()
        self._extend(characteristics.ends.copy(), characteristics.flags)

    def activate(self, cells):
        """Add the cells of a mask (angle cells, velocity cells) to those whose mass the step moves."""
        self._extend(*self.characteristics.activate(cells))

    @property
    def active(self):
        """Mask (angle cells, velocity cells) of the cells whose mass the step moves."""
        return self.characteristics.active

    @property
    def nbytes(self):
        """Bytes of targets and own remaps. Buffers, characteristics and a shared angle remap are left out."""
        return self._targets.nbytes + (self._flight.nbytes if self._flight else 0)

    def _extend(self, ends, flags):
        """Add the targets of traced paths, and divide the active cells in two; `ends` are overwritten.

        Free cells fly where source and target are one mesh, all others are scattered.
        """
        paths, target = self.characteristics, self.target
        self._targets = self._targets.extended(ends, flags, target.cell_searches, target.first_positive)
        self._flight, self._scattered = None, paths.active
        if target is paths.source:
            free = paths.active & ~paths.event_cells
            self._scattered = paths.active & paths.event_cells
            if free.any():
                self._flight = FreeFlight(
                    target, free, paths.affine, paths.dynamics.diffusion, paths.duration, paths.diffusion_nodes,
                    self.angle_remap, paths.excess,
                )  # fmt: skip
        per_cell = paths.points.angle_points.size * paths.points.velocity_points.size * paths.node_weights.size
        self._seconds = TUNING.seconds_deposit * per_cell * np.count_nonzero(self._scattered)
        self._columns = self._split()

    def apply(self, coefficients):
        """Return (coefficients, masses): the density after the step, and what overturned left, right and was truncated.

        The masses are (3,), or without diffusion (4,): the fourth came to rest.
        """
        paths, source = self.characteristics, self.characteristics.source
        cells = SourceCells(self._scattered, source.areas, paths.numbers)
        chunks = Chunks(self._columns, self.buffers, self._absorbed)
        run_in_parts(
            scatter, len(chunks.columns), coefficients, cells, paths.points, self._targets, self._affine,
            *self.target.cell_searches, chunks, *self._bases, seconds=self._seconds,
        )  # fmt: skip
        out = np.empty(self.target.shape)
        sum_buffers(self.buffers, self._columns, self.target.areas, out)
        absorbed = self._absorbed.sum(axis=0)
        if self._flight:
            absorbed[:3] += self._flight.apply(coefficients, out)
        absorbed[2] += source.masses(coefficients)[~paths.active].sum()
        return out, absorbed

    def apply_adjoint(self, values, exit_values):
        """Return the mean, before the step, of a function of the state after it (backward equation, Koopman operator).

        Adjoint of `apply` in L2: for every density p of the source, with ``after, absorbed = apply(p)``, the integral
        of p times the result is the integral of `after` times the function, plus ``absorbed @ exit_values``, to
        rounding. With 1 for the function and 0 for all exits it is the probability of not overturning.
        `exit_values` (3,) are those of having overturned to the left, to the right, and of truncation.
        """
        if self.target is not self.characteristics.source:
            raise ValueError(checks.refusal("target", self.target, "the mesh of the characteristics"))
        paths, exit_values = self.characteristics, np.asarray(exit_values, dtype=float)
        out = np.zeros(paths.source.shape)
        if self._flight:
            self._flight.apply_adjoint(values, exit_values, out)
        cells = np.ascontiguousarray(np.argwhere(self._scattered))
        run_in_parts(
            gather, len(cells), values.reshape(-1, self.buffers.shape[2]), exit_values, paths.points, paths.numbers,
            self._targets, paths.node_weights, cells, out, *self._bases, seconds=self._seconds,
        )  # fmt: skip
        out[~paths.active] = 0.0
        out[~paths.active, 0, 0] = exit_values[2]
        return out

    def _split(self):
        """Return columns (chunks, 4), angle cells: from and to that a chunk reads, and from and to that it writes."""
        paths, (limit, across, *_) = self.characteristics, self.target.shape
        load = np.cumsum(self._scattered.sum(axis=1) + 1e-9)
        edges = np.searchsorted(load, load[-1] * np.arange(1, TUNING.chunks) / TUNING.chunks)
        columns = np.zeros((TUNING.chunks, 4), dtype=np.int64)
        columns[1:, 0], columns[:-1, 1], columns[-1, 1] = edges, edges, len(load)
        if paths.to_other_mesh:
            columns[:, 3] = limit
            return columns
        nearest, farthest = self._targets.columns(across, limit)
        traced = paths.numbers >= 0
        for k, (begin, end) in enumerate(columns[:, :2]):
            order = paths.numbers[begin:end][traced[begin:end]]
            reached = nearest[order].min(initial=limit), farthest[order].max(initial=-1) + 1
            columns[k, 2:] = reached if reached[0] < reached[1] else (0, 0)
        return columns


def scatter_buffers(target: Space):
    """Return buffers (chunks, target cells, modes²) of the steps that end on a mesh, not initialized."""
    angle, velocity, modes, _ = target.shape
    return np.empty((TUNING.chunks, angle * velocity, modes * modes))


def with_neighbours(cells: np.ndarray, rings: int = 1) -> np.ndarray:
    """Return a mask of `cells`, a mask (angle, velocity), and their neighbours up to so many `rings`.

    With these a growing density does not need new cells every time.
    """
    grown = cells.copy()
    grown[1:] |= cells[:-1]
    grown[:-1] |= cells[1:]
    grown[:, 1:] |= cells[:, :-1]
    grown[:, :-1] |= cells[:, 1:]
    return with_neighbours(grown, rings - 1) if rings > 1 else grown


def overlapping_cells(space: Space, cells: np.ndarray, other: Space) -> np.ndarray:
    """Return a mask of the cells of the mesh `other` that overlap `cells`, a mask (..., angle, velocity) of `space`."""
    angle, velocity = (
        (theirs[:-1, None] < own[1:]) & (theirs[1:, None] > own[:-1])
        for theirs, own in zip(other.lines, space.lines, strict=True)
    )
    return angle.astype(np.int32) @ cells @ velocity.T > 0


@kernel
def mark_massive_cells(coefficients, areas, negligible, active, marks):
    """Add to the mask `marks` the cells with more than a negligible mass; return whether one of them is not active."""
    (limit, across, modes, _), beyond = coefficients.shape, False
    for i in range(limit):
        for j in range(across):
            least = negligible / areas[i, j]
            for a in range(modes):
                for b in range(modes):
                    if abs(coefficients[i, j, a, b]) > least:
                        marks[i, j] = True
            beyond |= marks[i, j] and not active[i, j]
    return beyond
