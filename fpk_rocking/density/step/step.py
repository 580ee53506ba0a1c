"""One time step as a linear map of densities, set up once for its phase of the forcing and applied in every cycle."""

import dataclasses
import functools
import itertools
import math

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.base.basis import find_cells, gauss_hermite_product, gauss_legendre, legendre_at_gauss_points
from fpk_rocking.density.space.space import Space
from fpk_rocking.density.step.adjoint import collect, fly_back
from fpk_rocking.density.step.deposit import CHUNKS, Cells, Flown, Parts, deposit, gather
from fpk_rocking.density.step.free_flight import FreeFlight
from fpk_rocking.density.step.landed import Landed
from fpk_rocking.density.step.landing import Gauss, classify, trace_cells
from fpk_rocking.density.step.noise_paths import Noise, principal_axes
from fpk_rocking.physics.forcing import Force
from fpk_rocking.physics.motion import TERMS, lift_off
from fpk_rocking.physics.motion.block import gravity_at_contact
from fpk_rocking.physics.motion.equation import Body
from fpk_rocking.physics.motion.flight import accumulated_covariance, flight_covariance
from fpk_rocking.physics.motion.particular import affine_flights
from fpk_rocking.physics.motion.segment import segment_from_particular
from fpk_rocking.physics.noise.envelope import Envelope

FAINTEST = 1e-3
"""Least diffusion over that at g = 1: no mesh resolves a density without noise."""


@dataclasses.dataclass(frozen=True)
class Dynamics:
    """What a step needs to know of a scene with white noise; nondimensional.

    Parameters
    ----------
    forcing : Force
    diffusion, restitution, cutoff : float
        D, e and the angle of overturning.
    envelope : Envelope, optional
        g, where the diffusion is D g².
    faintest : float
        Least g² of a step.
    critical_angle : float, optional
        α, radians, of an exact block.
    """

    forcing: Force
    diffusion: float
    restitution: float
    cutoff: float
    envelope: Envelope | None = None
    faintest: float = FAINTEST
    critical_angle: float | None = None

    @classmethod
    def of(cls, scene):
        """Take the dynamics of a scene with white noise."""
        noise, block = scene.noise, scene.block
        common = scene.forcing, noise.diffusion, block.restitution, scene.overturning.angle, noise.envelope
        return cls(*common, critical_angle=block.critical_angle or None)

    def later(self, time):
        """Return the dynamics whose times count from a time on."""
        envelope = self.envelope and self.envelope.shifted(time)
        return dataclasses.replace(self, forcing=self.forcing.shifted(time), envelope=envelope)

    def during(self, start, duration):
        """Return the dynamics with a constant diffusion, its mean over a step, and at least `faintest` of D."""
        if self.envelope is None:
            return self
        begin, end = self.envelope.squared_integral(np.array([start, start + duration]))
        mean = max((end - begin) / duration, self.faintest)
        return dataclasses.replace(self, diffusion=self.diffusion * mean, envelope=None)

    def covariance(self, start, duration):
        """Covariance xx, xv, vv that a flight gathers."""
        if self.envelope is None:
            return flight_covariance(self.diffusion, duration)
        points, weights = gauss_legendre(16)
        late = duration * points[::-1]
        strength = np.maximum(self.envelope.value(start + duration - late) ** 2, self.faintest)
        weights = 2.0 * self.diffusion * duration * weights * strength
        return tuple(float(part) for part in accumulated_covariance(weights, late))

    def segment(self, start, duration):
        """Return the forcing over a step as the kernels take it."""
        return segment_from_particular(self.forcing.particular_over(start, duration), np.empty(TERMS), duration)

    def affine(self, start, duration):
        """Return the flight over a step as an `Affine` map; for an exact block `FreeFlight` adds the rest."""
        ends, part = (start, start + duration), gravity_at_contact(self.critical_angle)
        return affine_flights(*(part * value for time in ends for value in self.forcing.particular(time)), duration)

    @property
    def block(self):
        """What the kernels have to know of the block."""
        return Body(self.restitution, self.cutoff, self.critical_angle)

    @property
    def lift_off(self):
        """Largest |f| under which a block at rest stays."""
        return lift_off(self.critical_angle or 0.0)

    def since_lift_off(self, time):
        """Time since |f| last rose through the level of lift-off, and the slope of |f| there; (inf, 0) if never."""
        level = self.lift_off
        since, slope = _against(self.forcing, level).since_lift_off(time)
        return since, level * slope


@functools.lru_cache(maxsize=8)
def _against(forcing, level):
    """Keep what a forcing in units of a level has found of its lift-offs."""
    return forcing.in_units_of(level)


@dataclasses.dataclass(frozen=True)
class Quadrature:
    """Sampling of a step: Gauss points of a cell in both axes, Gauss-Hermite nodes along both axes of the noise.

    `blur` nodes make the blur of the velocity in free flight: 15 end at 6.4 standard deviations, 9 at 4.5; beyond,
    nothing is sent.
    """

    angle: int
    velocity: int
    long: int
    short: int
    blur: int = 15


class Trace:
    """The paths of one step from the Gauss points of its active cells, before it is known where they land.

    Parameters
    ----------
    source : Space
        Where the paths start.
    start, duration : float
        The step, nondimensional times.
    dynamics : Dynamics
    quadrature : Quadrature
    cells : bool or ndarray of bool, shape (angle cells, velocity cells)
        Cells to activate now, whose paths' ends are kept; all unless given.
    to_other : bool
        Whether the paths end on another mesh. Only a slender block that stays below the cut-off goes there in affine
        flight: all cells of an exact one then count as cells that an event can reach.

    Attributes
    ----------
    marks, active : ndarray of bool, shape (angle cells, velocity cells)
        The cells that an event can reach, and those whose mass the step moves.
    events : ndarray of int, shape (angle cells, velocity cells)
        Number of an active cell that an event can reach, in the order in which they were traced; else -1.
    states, codes : ndarray
        Ends of the paths of the cells active at first, see `trace_cells`.
    """

    def __init__(
        self, source: Space, start, duration, dynamics: Dynamics, quadrature: Quadrature, cells=True, to_other=False
    ):
        # What a flight gathers weighs early noise more, so that a mean D would not do in a long step without events.
        axes = principal_axes(*dynamics.covariance(start, duration))
        dynamics = dynamics.during(start, duration)
        self.source, self.start, self.duration, self.dynamics = source, start, duration, dynamics
        rules = gauss_legendre(quadrature.angle), gauss_legendre(quadrature.velocity)
        tables = (legendre_at_gauss_points(count, source.degree) for count in (quadrature.angle, quadrature.velocity))
        lines = source.angle_lines, source.velocity_lines
        self.points = Gauss(*lines, *(points for points, _ in rules), *(weights for _, weights in rules), *tables)
        nodes, self.node_weights = gauss_hermite_product(quadrature.long, quadrature.short)
        self.blur, self.affine = quadrature.blur, dynamics.affine(start, duration)
        self.offsets = nodes @ np.reshape(axes, (2, 2))
        self._noise = Noise(duration, dynamics.diffusion, nodes, self.offsets, np.abs(self.offsets[:, 0]).max())
        self._segment = dynamics.segment(start, duration)
        margins = self._noise.margin, math.inf if to_other else float(np.abs(self.offsets[:, 1]).max())
        self.marks = classify(*lines, self._segment, duration, dynamics.block, margins)
        self.stays = not to_other
        self.marks |= dynamics.critical_angle is not None and to_other
        self.active = np.zeros_like(self.marks)
        self.events = np.full(self.marks.shape, -1, dtype=np.int32)
        self.states, self.codes = self.activate(np.full_like(self.marks, cells))

    def activate(self, cells):
        """Add cells to those that the step moves; return the states and codes of what had to be traced for that."""
        new = np.argwhere(self.marks & cells & ~self.active)
        self.active |= cells
        self.events[new[:, 0], new[:, 1]] = self.events.max() + 1 + np.arange(len(new))
        return trace_cells(new, self.points, self._segment, self.dynamics.block, self._noise)


class Step:
    """The linear map of densities over one step, from the coefficients of one space to those of another.

    Mass is conserved to rounding: what does not land on the target is returned, overturned (to the left, to the
    right) or lost, which is beyond the mesh or out of cells that are not active.

    Parameters
    ----------
    trace : Trace
    target : Space
        Where the paths end.
    buffers : ndarray, optional
        From `deposit_buffers`, to be shared by the steps of one run.
    angle_shear : Shift, optional
        From `free_flight.angle_shear_of`, to be shared by steps that differ in a constant force alone.
    """

    def __init__(self, trace: Trace, target: Space, buffers=None, angle_shear=None):
        if trace.stays and target is not trace.source:
            raise ValueError(checks.refusal("target", target, "the mesh of the trace, or a trace with to_other"))
        self.trace, self.target, self.angle_shear = trace, target, angle_shear
        self._grids = target.tables
        degree, modes = trace.source.degree, target.degree + 1
        self._flown = Flown(*trace.affine, trace.offsets, trace.node_weights)
        self.buffers = deposit_buffers(target) if buffers is None else buffers
        self._sinks = np.empty((CHUNKS, 3 if trace.dynamics.diffusion > 0.0 else 4))
        self._bases = (1.0,) * (degree + 1), (1.0,) * modes
        self._landed = self._with(Landed.nothing(), trace.states.copy(), trace.codes)
        self._prepare()

    def activate(self, cells):
        """Add cells (angle cells, velocity cells) to those whose mass the step moves."""
        self._landed = self._with(self._landed, *self.trace.activate(cells))
        self._prepare()

    @property
    def memory(self):
        """Bytes that the step holds, shared buffers left out."""
        return self._landed.memory + (self._flight.memory if self._flight else 0)

    def _with(self, landed, states, codes):
        return landed.joined(states, codes, self._grids, self.target.first_positive)

    def _prepare(self):
        """Divide the active cells: free ones fly where source and target are one mesh, all others are deposited."""
        trace = self.trace
        self._flight, self._deposited = None, trace.active
        if self.target is trace.source:
            free = trace.active & ~trace.marks
            self._deposited = trace.active & trace.marks
            self._flight = FreeFlight(
                self.target, free, trace.affine, trace.dynamics.diffusion, trace.duration, trace.blur, self.angle_shear,
                trace.dynamics.critical_angle,
            )  # fmt: skip
        self._chunks = self._split()

    def apply(self, coefficients):
        """Return the coefficients after the step and the masses (3,) that went left, right and were lost.

        Without diffusion there is a fourth mass: what came to rest.
        """
        trace, source = self.trace, self.trace.source
        cells = Cells(self._deposited, source.areas, trace.events)
        parts = Parts(self._chunks, self.buffers, self._sinks)
        deposit(coefficients, cells, trace.points, self._landed, self._flown, *self._grids, parts, *self._bases)
        out = np.empty(self.target.shape)
        gather(self.buffers, self._chunks, self.target.areas, out)
        sinks = self._sinks.sum(axis=0)
        if self._flight:
            sinks[:3] += self._flight.apply(coefficients, out)
        sinks[2] += source.masses(coefficients)[~trace.active].sum()
        return out, sinks

    def apply_adjoint(self, values, exit_values):
        """Return the mean, before the step, of a function of the state after it (the backward equation).

        Adjoint of `apply` in L2: for every density p of the source, with ``after, sinks = apply(p)``, the integral of p
        times the result is the integral of `after` times the function, plus ``sinks @ exit_values``, to rounding.

        Parameters
        ----------
        values : ndarray, shape ``target.shape``
            Coefficients of the function. A one is 1 in the first of every cell, 0 in the others.
        exit_values : array_like, shape (3,)
            Of having overturned to the left, to the right, and of being lost.

        Returns
        -------
        ndarray, shape ``trace.source.shape``
            Coefficients of the function before the step.
        """
        trace, exit_values = self.trace, np.asarray(exit_values, dtype=float)
        out = np.zeros(trace.source.shape)
        if self._flight:
            fly_back(self._flight, values, exit_values, out)
        collect(
            values.reshape(-1, self.buffers.shape[2]), exit_values, trace.points, trace.events, self._landed,
            self._flown, *self._grids, np.ascontiguousarray(np.argwhere(self._deposited)), out, *self._bases,
        )  # fmt: skip
        out[~trace.active, 0, 0] = exit_values[2]
        return out

    def _split(self):
        """Columns of the source that each chunk reads, and columns of the target that it writes."""
        trace, (limit, across, *_) = self.trace, self.target.shape
        (low, high), lines = self._reach(), self.target.angle_lines
        first = np.where(low < high, find_cells(lines, low, "left"), limit)
        last = np.where(low < high, find_cells(lines, high, "left"), -1)
        nearest, farthest = self._landed.reach(across, limit)
        rows = np.nonzero(trace.events >= 0)[0]
        order = trace.events[trace.events >= 0]
        np.maximum.at(last, rows, farthest[order])
        np.minimum.at(first, rows, nearest[order])
        load = np.cumsum(self._deposited.sum(axis=1) + 1e-9)
        edges = np.searchsorted(load, load[-1] * np.arange(1, CHUNKS) / CHUNKS)
        edges = np.concatenate([[0], edges, [len(load)]])
        chunks = np.zeros((CHUNKS, 4), dtype=np.int64)
        for k, (begin, end) in enumerate(itertools.pairwise(edges)):
            reached = min(first[begin:end], default=limit), max(last[begin:end], default=-1) + 1
            chunks[k] = begin, end, *(reached if reached[0] < reached[1] else (0, 0))
        return chunks

    def _reach(self):
        """Lowest and highest angle, (columns,) each, that the free cells to be deposited send a node to."""
        trace, lines = self.trace, self.trace.source.angle_lines
        free = self._deposited & ~trace.marks
        hulls = np.stack([free.argmax(axis=1), free.shape[1] - free[:, ::-1].argmax(axis=1)])
        shift = trace.affine.shifts[np.where(lines[1:] + lines[:-1] > 0.0, 1, -1), 0]
        low, high = (
            shift + trace.affine.cosh * edge + trace.affine.sinh * trace.source.velocity_lines[hull] + extreme
            for edge, hull, extreme in zip(
                (lines[:-1], lines[1:]), hulls, (trace.offsets[:, 0].min(), trace.offsets[:, 0].max()), strict=True
            )
        )
        return np.where(free.any(axis=1), [low, high], 0.0)


def deposit_buffers(target: Space):
    """Make room for what the chunks of a step deposit."""
    angle, velocity, modes, _ = target.shape
    return np.empty((CHUNKS, angle * velocity, modes * modes))
