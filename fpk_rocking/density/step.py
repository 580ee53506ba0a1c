"""One step of the density in time: traced once, applied as often as its phase of the forcing cycle comes round."""

import dataclasses
import itertools
import math

import numpy as np

from fpk_rocking.density.adjoint import collect
from fpk_rocking.density.landing import classify, settle_in_cells, trace_cells
from fpk_rocking.density.lines import FreeFlight
from fpk_rocking.density.paths import hermite_nodes, principal_axes
from fpk_rocking.density.space import Space, gauss, shapes
from fpk_rocking.density.transport import CHUNKS, deposit, gather
from fpk_rocking.physics.gaussian import flight_covariance


@dataclasses.dataclass(frozen=True)
class Dynamics:
    """What a step needs to know of a scene with white noise; nondimensional.

    Parameters
    ----------
    harmonic : tuple of float
        Amplitude, frequency and phase of f = -A cos(Omega t + Psi).
    diffusion, restitution, cutoff : float
        D, e and the angle of overturning.
    """

    harmonic: tuple
    diffusion: float
    restitution: float
    cutoff: float

    @classmethod
    def of(cls, scene):
        """Take the dynamics of a scene with white noise."""
        forcing = scene.forcing
        harmonic = (forcing.amplitude, forcing.frequency, forcing.phase)
        return cls(harmonic, scene.noise.diffusion, scene.block.restitution, scene.overturning.angle)

    def force(self, time):
        """Harmonic forcing f at a time."""
        amplitude, frequency, phase = self.harmonic
        return -amplitude * math.cos(frequency * time + phase)

    def _particular(self, time):
        amplitude, frequency, phase = self.harmonic
        scale, angle = amplitude / (1.0 + frequency * frequency), frequency * time + phase
        return scale * math.cos(angle), -scale * frequency * math.sin(angle)

    def affine(self, start, duration):
        """Affine flight z -> M z + shift: (cosh, sinh, shifts), the latter (3, 2) with the side as first index."""
        (p0, q0), (p1, q1) = self._particular(start), self._particular(start + duration)
        cosh, sinh = math.cosh(duration), math.sinh(duration)
        shifts = np.zeros((3, 2))
        for side in (1, -1):
            shifts[side] = side + p1 - cosh * (side + p0) - sinh * q0, q1 - sinh * (side + p0) - cosh * q0
        return cosh, sinh, shifts


@dataclasses.dataclass(frozen=True)
class Quadrature:
    """Sampling of a step: Gauss points of a cell in both axes, Gauss-Hermite nodes along both axes of the noise."""

    angle: int
    velocity: int
    long: int
    short: int


class Trace:
    """The paths of one step from all Gauss points of a space, before it is known on which mesh they land."""

    def __init__(self, source: Space, start, duration, dynamics: Dynamics, quadrature: Quadrature):
        self.source = source
        (self.angle_points, self.angle_weights) = gauss(quadrature.angle)
        (self.velocity_points, self.velocity_weights) = gauss(quadrature.velocity)
        nodes, self.node_weights = hermite_nodes(quadrature.long, quadrature.short)
        axes = principal_axes(*flight_covariance(dynamics.diffusion, duration))
        self.offsets = nodes @ np.reshape(axes, (2, 2))
        self.cosh, self.sinh, self.shifts = dynamics.affine(start, duration)
        self.dynamics, self.duration = dynamics, duration
        lines = source.angle_lines, source.velocity_lines
        margin = np.abs(self.offsets[:, 0]).max()
        marks = classify(*lines, start, duration, dynamics.harmonic, dynamics.cutoff, margin)
        self.events = np.full(marks.shape, -1, dtype=np.int32)
        self.events[marks] = np.arange(np.count_nonzero(marks))
        cells = np.ascontiguousarray(np.argwhere(marks))
        self.states, self.codes = trace_cells(
            cells, *lines, self.angle_points, self.velocity_points, start, duration, dynamics.harmonic,
            dynamics.diffusion, dynamics.restitution, dynamics.cutoff, nodes, self.offsets, margin,
        )  # fmt: skip


class Step:
    """The linear map of densities over one step, from the coefficients of one space to those of another.

    Mass is conserved to rounding: what does not land on the target is returned, overturned (to the left, to the
    right) or beyond the mesh.
    """

    def __init__(self, trace: Trace, target: Space):
        self.trace, self.target = trace, target
        self._grids = _grid(target.angle_lines), _grid(target.velocity_lines)
        points = trace.states.copy()
        cells = settle_in_cells(points, trace.codes, *self._grids, target.first_positive)
        self._landed = cells, points
        degree = trace.source.degree
        self._tables = shapes(trace.angle_points, degree), shapes(trace.velocity_points, degree)
        self._weights = trace.angle_weights, trace.velocity_weights
        self._affine = (
            trace.source.angle_lines, trace.source.velocity_lines, trace.angle_points, trace.velocity_points,
            trace.cosh, trace.sinh, trace.shifts, trace.offsets, trace.node_weights,
        )  # fmt: skip
        angle, velocity, modes, _ = target.shape
        self._buffers = np.empty((CHUNKS, angle * velocity, modes * modes))
        self._sinks = np.empty((CHUNKS, 3))
        self._flights = []
        if target is trace.source:
            self._flights = [
                FreeFlight(
                    target, side, (trace.cosh, trace.sinh, trace.shifts[side]), trace.dynamics.diffusion, trace.duration
                )
                for side, columns in ((1, target.shape[0] - target.first_positive), (-1, target.first_positive))
                if columns
            ]
        self._chunks = self._split(cells)
        self._norms = (1.0,) * (degree + 1), (1.0,) * modes

    def apply(self, coefficients):
        """Return the coefficients after the step and the masses (3,) that went left, right and off the mesh."""
        trace, source, deposited = self.trace, self.trace.source, coefficients
        if self._flights:
            free = (trace.events < 0)[:, :, None, None]
            flying, deposited = np.where(free, coefficients, 0.0), np.where(free, 0.0, coefficients)
        deposit(
            deposited, source.areas, self._tables, self._weights, trace.events, self._landed, self._affine,
            *self._grids, self._chunks, self._buffers, self._sinks, *self._norms,
        )  # fmt: skip
        out = np.empty(self.target.shape)
        gather(self._buffers, self._chunks, self.target.areas, out)
        sinks = self._sinks.sum(axis=0)
        for flight in self._flights:
            part, overturned, lost = flight.apply(flying[flight.columns])
            out[flight.columns] += part
            sinks[:2] += overturned
            sinks[2] += lost.sum()
        return out, sinks

    def apply_adjoint(self, values, worth):
        """Return what a function of the state after the step is worth, on average, before it.

        Adjoint of `apply` in L2: for every density p of the source, with ``after, sinks = apply(p)``, the integral of p
        times the result is the integral of `after` times the function, plus ``sinks @ worth``, to rounding.

        Parameters
        ----------
        values : ndarray, shape ``target.shape``
            Coefficients of the function. A one is 1 in the first of every cell, 0 in the others.
        worth : array_like, shape (3,)
            Of having overturned to the left, to the right, and of having left the mesh.

        Returns
        -------
        ndarray, shape ``trace.source.shape``
            Coefficients of the function before the step.
        """
        trace, worth = self.trace, np.asarray(worth, dtype=float)
        out = np.empty(trace.source.shape)
        for flight in self._flights:
            out[flight.columns] = flight.apply_adjoint(values[flight.columns], worth)
        cells = np.argwhere(trace.events >= 0 if self._flights else np.ones_like(trace.events))
        collect(
            values.reshape(-1, self._buffers.shape[2]), worth, self._tables, self._weights, trace.events,
            self._landed, self._affine, *self._grids, np.ascontiguousarray(cells), out, *self._norms,
        )  # fmt: skip
        return out

    def _split(self, cells):
        """Columns of the source that each chunk reads, and columns of the target that it writes."""
        trace, (limit, across, *_) = self.trace, self.target.shape
        lines = trace.source.angle_lines
        edges = np.linspace(0, trace.source.shape[0], CHUNKS + 1).astype(np.int64)
        chunks = np.zeros((CHUNKS, 4), dtype=np.int64)
        for k, (low, high) in enumerate(itertools.pairwise(edges)):
            rows = trace.events[low:high]
            landed = cells[rows[rows >= 0]]
            landed = landed[landed >= 0] // across
            bounds = [landed.min(), landed.max()] if landed.size else []
            for i in range(low, high) if not self._flights else ():
                free = np.flatnonzero(trace.events[i] < 0)
                if free.size:
                    side = 1 if lines[i] + lines[i + 1] > 0.0 else -1
                    v = trace.source.velocity_lines[[free[0], free[-1] + 1]]
                    x = trace.shifts[side, 0] + trace.cosh * lines[[i, i + 1]] + trace.sinh * v
                    reach = x + np.array([trace.offsets[:, 0].min(), trace.offsets[:, 0].max()])
                    bounds += list(np.clip(np.searchsorted(self.target.angle_lines, reach) - 1, 0, limit - 1))
            chunks[k] = low, high, min(bounds, default=0), max(bounds, default=-1) + 1
        return chunks


def _grid(lines):
    """Prepare mesh lines for `locate`: no two of them between neighbouring entries of its table."""
    sizes = np.diff(lines)
    count = math.ceil((lines[-1] - lines[0]) / sizes.min() * (1.0 + 1e-9)) + 1
    density = count / (lines[-1] - lines[0])
    cells = np.searchsorted(lines, lines[0] + np.arange(count + 1) / density, side="right") - 1
    return lines, 2.0 / sizes, np.clip(cells, 0, len(sizes) - 1).astype(np.int32), density
