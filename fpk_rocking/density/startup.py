"""The start-up: from the start of a scene to the first density that the main mesh resolves.

A start that is a point, or a Gaussian finer than the mesh, is carried on moving patches (`patches`): small meshes that
follow the density and grow with it. While nothing can happen to the block the density is a Gaussian in closed form.
Next to x = 0 it is not: at rest under |f| > 1 noise beats drift until about t* = D / (|f| - 1)^2, the block rattles
through x = 0 and only then lifts off; under |f| <= 1 it keeps rattling. There steps are in proportion to the time
elapsed.

Under filtered noise (`FilteredStart`) the flight is linear until something happens to the block: angle, velocity and
the states of the filter are Gaussian together, in closed form, and at each node of the filter's states so are angle and
velocity. The mesh takes over when it resolves these, or else at the last step before anything can happen. So narrow a
density of an exact block is taken as Gaussian too: see `exact_moments`.
"""

import math
from typing import NamedTuple

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.base.basis import legendre_basis
from fpk_rocking.base.checks import Array
from fpk_rocking.density.filter_nodes import whitened
from fpk_rocking.density.patches import Gaussian, cell_size, exact_flight, next_patch, patch_of, resolution_of
from fpk_rocking.density.resolution import PatchSettings
from fpk_rocking.density.space import Space
from fpk_rocking.density.step.dynamics import Dynamics, event_cells
from fpk_rocking.density.step.step import Characteristics, Quadrature, Step
from fpk_rocking.density.tuning import TUNING
from fpk_rocking.physics.noise.state_space import transition_and_factor


class PatchDensity(NamedTuple):
    """A density on a patch, a small mesh that moves with it: time, patch, coefficients, outflow on the way."""

    time: float
    patch: Space
    coefficients: np.ndarray
    outflow: np.ndarray


class StartUp:
    """The density of a start on moving patches, computed as far as is asked; all meshes that take it over share it."""

    def __init__(self, dynamics: Dynamics, start, settings: PatchSettings, period, waiting=None):
        self.dynamics, self.settings, self._cycle = dynamics, settings, period
        self._waiting, self._lift_off_is_known = waiting or 0.0, waiting is not None
        self._look_ahead = period + self._waiting
        self._initial = Gaussian.of(start)
        x, v = self._initial.mean
        self._still = start.at_rest
        self._side = 1 if (x or v or dynamics.force(0.0)) > 0.0 else -1
        self._exact = dynamics.block.critical_angle is not None
        self._flight = exact_flight(self._initial, dynamics, self._side) if self._exact else None
        self._longest_flight = TUNING.exact_flight * settings.growth if self._exact else math.inf
        self._noise_time = self._initial.covariance[1, 1] / (2.0 * dynamics.averaged_over(0.0, 1e-9 * period).diffusion)
        self._gaussian_until = self._last_gaussian_time()
        self._carried = [self._on_patch(self._gaussian_until)]

    @property
    def starts_at_rest(self):
        """Whether the block is at rest at the start and the forcing does not lift it off then: a bool."""
        return self._still and self.dynamics.rest_gap(0.0) >= 0.0

    def flight(self, time):
        """Return the `Gaussian` of angle and velocity at a `time` τ, nondimensional, if there was no event before."""
        if time <= 0.0:
            return self._initial
        return self._flight(time) if self._exact else self._initial.after_flight(self.dynamics, 0.0, time, self._side)

    def spread(self, time):
        """Return the `Gaussian` of the start's spread at a `time`: about rest where nothing has lifted it off."""
        gaussian = self.flight(time)
        if self.starts_at_rest and self.dynamics.since_lift_off(time)[0] > time:
            gaussian.mean = np.zeros(2)
        return gaussian

    def resolution(self, time, space):
        """Return the density's least conditional standard deviation at a `time` over the size of a `Space`'s cell."""
        if not (self._waiting or self._lifted_later):
            return self.spread(time).resolution(space)
        now, settings = self._before(time), self.settings
        sizes = [np.diff(lines).min() * settings.cells / (2.0 * settings.reach) for lines in now.patch.lines]
        mean = self.flight(time).mean if self.dynamics.since_lift_off(time)[0] <= time else np.zeros(2)
        if self._lifted_later:
            masses = now.patch.masses(now.coefficients)
            mean = [masses.sum(axis=1 - k) @ (0.5 * (line[1:] + line[:-1])) for k, line in enumerate(now.patch.lines)]
        return min(size / cell_size(lines, at) for size, lines, at in zip(sizes, space.lines, mean, strict=True))

    def rattles_unresolved(self, time):
        """Whether, at a `time`, a block at rest is still to be lifted off by a forcing within its period: a bool."""
        return self._lifted_later and self.dynamics.since_lift_off(time)[0] > time

    @property
    def _lifted_later(self):
        """Whether a block that begins at rest is lifted off later, at a time that is not known in advance: a bool."""
        if self._lift_off_is_known or not self.starts_at_rest:
            return False
        return self.dynamics.forcing.largest > self.dynamics.lift_off

    def mass_within(self, time, angle, velocity):
        """Return the mass, a float, within |x| < `angle` and |v| < `velocity` at a `time`; nondimensional."""
        now = self._before(time)
        return float(now.patch.bin_integrals(now.coefficients[None], [-angle, angle], [-velocity, velocity]).sum())

    def undisturbed(self, gaussian):
        """Whether a `Gaussian` is on the side of the start, and keeps away from x = 0 and the cut-off: a bool."""
        reach = self.settings.reach * math.sqrt(gaussian.covariance[0, 0])
        return reach < self._side * gaussian.mean[0] < self.dynamics.block.cutoff - reach

    def project(self, end, target: Space):
        """Return (coefficients, outflow): the density at a time `end` on a mesh, and the mass lost since the start."""
        now = self._before(end)
        duration = end - now.time
        quiet = self._free_time(now, duration) >= duration
        coefficients, outflow = Step(self._characteristics(now, duration, quiet), target).apply(now.coefficients)
        return coefficients, now.outflow + outflow

    def _before(self, end):
        """Return the last `PatchDensity` from which one step leads to a time `end`."""
        part = TUNING.closed_form_part
        if end <= self._gaussian_until / part:
            return self._on_patch(min(self._gaussian_until, max(part * end, end - self._longest_flight)))
        while self._carried[-1].time < end:
            self._carried.append(self._further(self._carried[-1]))
        return next(now for now in reversed(self._carried) if now.time < end)

    def _further(self, now):
        """Return the `PatchDensity` after one step from `now`, another."""
        longest = self.dynamics.forcing.shortest_period / TUNING.patch_steps_per_harmonic
        duration = min(self.settings.growth * (now.time + self._noise_time), longest)
        if self._rattles(now, duration):
            duration = min(duration, self._longest_step_near_rest(now))
        left = self._look_ahead - now.time
        free = self._free_time(now, min(left, self._longest_flight)) if left > 0.0 else 0.0
        quiet = free >= duration
        duration, dynamics = max(free, duration), self.dynamics
        characteristics = self._characteristics(now, duration, quiet)
        target = next_patch(self.settings, characteristics, now.coefficients, dynamics.block.cutoff)
        coefficients, outflow = Step(characteristics, target).apply(now.coefficients)
        # Masses of either sign that together are a hundred times all of it: the density grows without bound.
        if not np.abs(target.masses(coefficients)).sum() < 100.0:
            raise ValueError(
                "scene: got a density that the meshes of the start do not resolve, accepted: stronger noise than the "
                f"diffusion {dynamics.diffusion:.3g}, or another start; or use Monte Carlo"
            )
        return PatchDensity(now.time + duration, target, coefficients, now.outflow + outflow)

    def _characteristics(self, now, duration, quiet):
        """Return the `Characteristics`, the paths, of one step from the cells of a patch with mass in them."""
        # A block that the forcing cannot lift off rattles: many short steps follow, of one Gauss point more.
        rattles = self.dynamics.rest_gap(now.time) >= 0.0
        points, noise = self.settings.points + rattles, TUNING.free_patch_nodes if quiet else TUNING.patch_nodes
        active = np.abs(now.coefficients).max(axis=(2, 3)) * now.patch.areas > TUNING.no_mass
        rule = Quadrature(points, points, *noise)
        return Characteristics(now.patch, now.time, duration, self.dynamics, rule, active, to_other_mesh=True)

    def _on_patch(self, time):
        """Return the `PatchDensity` at a `time` of the Gaussian of an eventless flight, on a patch of its own."""
        gaussian, cutoff = self.flight(time), self.dynamics.block.cutoff
        if self._still:
            # So early noise beats drift: the block is on either side half of the time, and so is its mean pulled back.
            gaussian = Gaussian(self.dynamics.affine(0.0, time).shifts[[1, -1]].mean(axis=0), gaussian.covariance)
        patch = patch_of(self.settings, gaussian.mean, gaussian.covariance, cutoff)
        coefficients, tails = patch.project(gaussian, self.settings.points + 1), gaussian.tails(cutoff)
        missing = 1.0 - sum(tails) - patch.masses(coefficients).sum()
        if abs(missing) > TUNING.missing_mass:
            accepted = "a wider Gaussian, or one with less correlation, as the mesh does not resolve this one"
            raise ValueError(checks.refusal("start.covariance", gaussian.covariance.tolist(), accepted))
        return PatchDensity(time, patch, coefficients, np.array([*tails, missing]))

    def _last_gaussian_time(self):
        """Return the last time, a float, until which the density is a Gaussian that nothing has disturbed."""
        initial, least = self._initial, 1e-9 * self._cycle
        if self._still:
            return self.settings.early * _drift_time(self.dynamics)
        quiet = 0.0 if initial.covariance.any() else least
        for time in np.geomspace(least, TUNING.closed_form_part * self._look_ahead, 100):
            gaussian = self.flight(time)
            if not self.undisturbed(gaussian) or self._bent(gaussian, time):
                break
            quiet = time
        return quiet

    def _bent(self, gaussian, time):
        """Whether a `Gaussian` is so wide that the curvature of an exact block's acceleration matters to its mean."""
        if not self._exact:
            return False
        alpha, force = self.dynamics.block.critical_angle, self.dynamics.forcing.largest
        # The mean moves by about the curvature α² (1 + |f|), times an eighth of the variance, times t².
        shift = 0.125 * alpha**2 * (1.0 + force) * gaussian.covariance[0, 0] * time**2
        return shift > TUNING.bent_gaussian * self.settings.growth

    def _longest_step_near_rest(self, now):
        """Return the longest duration of a step from `now`, a `PatchDensity`, for a block near rest."""
        time, growth = now.time, self.settings.growth
        dynamics = self.dynamics.averaged_over(time, 1e-6 * self._cycle)
        gap, change = dynamics.rest_gap(time), abs(dynamics.forcing.slope(time + dynamics.origin))
        if gap > 0.0:
            lifting = min(dynamics.diffusion / gap**2, _crossing_time(dynamics, change))
            part = TUNING.rattle_step * lifting
            step = growth * max(part, self._cycle / TUNING.rattle_steps, TUNING.waiting_step * (self._waiting - time))
            if self._waiting or self.starts_at_rest:
                return step
            # Of a block that has moved hardly anything rattles, and negative masses grow in steps without noise.
            spread = TUNING.contact_step * np.diff(now.patch.velocity_lines).min()
            return max(step, spread**2 / (2.0 * dynamics.diffusion))
        since, change = dynamics.since_lift_off(time)
        if since > time:
            return math.inf
        return growth * (TUNING.lifted_step * since + TUNING.rattle_step * _crossing_time(dynamics, change))

    def _rattles(self, now, duration):
        """Whether mass of a `PatchDensity` that matters may come to rest at x = 0 within a `duration`: a bool."""
        slow = max(self.dynamics.rest_gap(now.time), 0.0) * duration
        slow += self.settings.reach * math.sqrt(
            2.0 * self.dynamics.averaged_over(now.time, duration).diffusion * duration
        )
        angle, velocity = (
            (lines[:-1] < size) & (lines[1:] > -size)
            for lines, size in zip(now.patch.lines, (slow * duration, slow), strict=True)
        )
        return np.abs(now.patch.masses(now.coefficients))[np.ix_(angle, velocity)].sum() > TUNING.missing_mass

    def _free_time(self, now, longest):
        """Return the longest halving of a duration within which no path of a density meets an event."""
        dynamics, patch, masses = self.dynamics, now.patch, np.abs(now.patch.masses(now.coefficients))

        def is_free(duration):
            reach = self.settings.reach * math.sqrt(dynamics.covariance(now.time, duration)[0])
            reach *= dynamics.largest_factor
            segment = dynamics.segment(now.time, duration)
            events = event_cells(*patch.lines, segment, duration, dynamics.block, (reach, math.inf))
            return masses[events].sum() < TUNING.no_mass

        durations = longest * 0.5 ** np.arange(7)
        # Next to x = 0 none is free, and the shortest tells so.
        return next(filter(is_free, durations)) if is_free(durations[-1]) else 0.0


def takeover_step(startup: StartUp, space: Space, edges, settled=None):
    """Return the index, 1 or more, of those step `edges` (n,), times since the start, where a mesh takes over."""
    before, last = None, len(edges) - 1
    for step in range(1, last):
        if startup.rattles_unresolved(edges[step]):
            continue
        resolution = startup.resolution(edges[step], space)
        if resolution >= TUNING.resolved or (settled and settled(edges[step])):
            return step
        if startup.undisturbed(startup.flight(edges[step])):
            before = step if resolution >= TUNING.barely_resolved else None
        elif before:
            return before
    return last


def _drift_time(dynamics: Dynamics):
    """Time at which the drift from rest overtakes the noise: D / (|f| - 1)^2, less where f changes sooner."""
    # An instant: times are over 1/p, and neither force nor envelope changes in 1e-9 of that.
    dynamics = dynamics.averaged_over(0.0, 1e-9)
    drift = abs(dynamics.rest_gap(0.0))
    steady = dynamics.diffusion / drift**2 if drift > 0.0 else math.inf
    return min(steady, _crossing_time(dynamics, dynamics.forcing.steepest), 1.0)


def _crossing_time(dynamics: Dynamics, change):
    """Return the time in which a drift that grows from 0 at a rate overtakes the noise, (D / rate^2)^(1/3)."""
    return (dynamics.diffusion / change**2) ** (1.0 / 3.0) if change > 0.0 else math.inf


class FilteredStart:
    """The Gaussian of angle, velocity and the filter's states, in a flight from the start in which nothing happens."""

    def __init__(self, scene, nodes, dynamics):
        self.scene, self.nodes, self.dynamics = scene, nodes, dynamics
        start = scene.start
        self._mean = np.array([start.angle, start.velocity])
        self._covariance = np.zeros((2, 2)) if start.covariance is None else np.array(start.covariance)
        push = self._mean[0] or self._mean[1] or scene.forcing.value(0.0)
        self.side = 1 if push > 0.0 else -1
        self._moments = None
        if dynamics.block.critical_angle is not None:
            self._moments = exact_moments(dynamics, nodes, self._mean, self._covariance, scene.period, self.side)

    @property
    def at_rest(self) -> bool:
        """Whether the block starts at rest and the noise decides when it is lifted off: a bool."""
        if not self.scene.start.at_rest:
            return False
        room = TUNING.filtered_reach * math.sqrt(self.scene.noise.variance)
        return abs(self.scene.forcing.value(0.0)) <= self.dynamics.lift_off + room

    def at(self, time: float) -> tuple[Array, Array]:
        """Return (mean, covariance), (2,) and (2 + states, 2 + states), at a `time` since τ = 0, nondimensional."""
        if self._moments:
            return self._moments(time)
        flight = self.dynamics.affine(0.0, time)
        mean = flight.matrix @ self._mean + flight.shifts[self.side]
        return mean, joint_covariance(self.nodes, self._covariance, time)

    def undisturbed(self, time: float) -> bool:
        """Whether nothing can have happened by a `time`, a bool: the block is far from x = 0 and from the cut-off."""
        mean, covariance = self.at(time)
        reach = TUNING.filtered_reach * math.sqrt(covariance[0, 0])
        return reach < self.side * mean[0] < self.dynamics.block.cutoff - reach

    def takeover_step(self, space: Space, begins: Array) -> int:
        """Return the number of the step before which the mesh takes over: resolved, or the last without an event."""
        last = 0
        for step, time in enumerate(begins[1:], 1):
            if not self.undisturbed(time):
                break
            last = step
            if self.resolution(time, space) >= TUNING.filtered_resolved:
                break
        return last

    def resolution(self, time: float, space: Space) -> float:
        """Block's least standard deviation, of angle or velocity, in sizes of the mesh cell its mean is in."""
        mean, covariance = self.at(time)
        return resolution_of(mean, covariance[:2, :2] - covariance[:2, 2:] @ covariance[2:, :2], space)

    def project(self, time: float, space: Space) -> tuple[Array, Array]:
        """Return (densities, outflow) at a `time` on a mesh, a `Space`."""
        mean, covariance = (
            self.at(time) if time > 0.0 else (self._mean, np.pad(self._covariance, (0, len(self.nodes.drift))))
        )
        slope = covariance[:2, 2:]
        rest = covariance[:2, :2] - slope @ slope.T
        points, weights = _points(rest)
        out, outflow = np.zeros((*self.nodes.weights.shape, *space.shape)), np.zeros(3)
        for place, weight in np.ndenumerate(self.nodes.weights):
            states = points + mean + slope @ self.nodes.states[place][: slope.shape[1]]
            outflow += deposit_points(space, states, weight * weights, self.side, out[place])
        return out, outflow


def joint_covariance(filter_states, covariance, time):
    """Return the covariance (2 + n, 2 + n) of angle, velocity and n `filter_states` in a slender block's flight."""
    count = len(filter_states.drift)
    joint = np.zeros((2 + count, 2 + count))
    joint[0, 1] = joint[1, 0] = 1.0
    joint[1, 2] = filter_states.sigma
    joint[2:, 2:] = filter_states.drift
    phi, factor = transition_and_factor(joint, np.append([0.0, 0.0], filter_states.input), time)
    begin = np.eye(2 + count)
    begin[:2, :2] = covariance
    return phi @ begin @ phi.T + factor @ factor.T


def exact_moments(dynamics, filter_states, mean, covariance, end, side):
    """Function of time: Gaussian of an eventless exact block and a filter, mean to 2nd order, covariance linearized."""
    from scipy.integrate import solve_ivp  # takes longer to import than all else here

    alpha, forcing, size = dynamics.block.critical_angle, dynamics.forcing, 2 + len(filter_states.drift)
    rate, source = np.zeros((size, size)), np.zeros((size, size))
    rate[0, 1], rate[2:, 2:], source[2:, 2:] = (
        1.0,
        filter_states.drift,
        np.outer(filter_states.input, filter_states.input),
    )

    def rates(time, state):
        x, v, joint = state[0], state[1], state[2:].reshape(size, size)
        phi, force = alpha * (1.0 - side * x), forcing.value(time)
        sine, cosine = side * alpha * math.sin(phi), math.cos(phi)
        rate[1, 0], rate[1, 2] = cosine + force * sine, filter_states.sigma * cosine
        bend = 0.5 * (sine - force * alpha**2 * cosine) * joint[0, 0] + filter_states.sigma * sine * joint[0, 2]
        moved = rate @ joint
        return np.concatenate([[v, force * cosine - sine / alpha**2 + bend], (moved + moved.T + source).ravel()])

    begin = np.eye(size)
    begin[:2, :2] = covariance
    states = np.concatenate([mean, begin.ravel()])
    # Of a narrow start under weak noise all variances are small: what counts as 0 is so in their own units.
    own = np.minimum(np.maximum(np.sqrt(np.diag(covariance)), filter_states.sigma), 1.0)
    units = np.append(own, np.ones(size - 2))
    small = 1e-14 * np.concatenate([np.ones(2), np.outer(units, units).ravel()])
    moments_at = solve_ivp(rates, (0.0, end), states, method="DOP853", rtol=1e-8, atol=small, dense_output=True).sol
    return lambda time: (moments_at(time)[:2], moments_at(time)[2:].reshape(size, size))


def spread_left(noise, covariance, time):
    """Return the part, 0 to 1, of the angle's standard deviation that is left where the filter's states are known."""
    joint = joint_covariance(whitened(noise), covariance or np.zeros((2, 2)), time)
    return math.sqrt(max(1.0 - joint[0, 2:] @ joint[2:, 0] / joint[0, 0], 0.0))


def _points(covariance):
    """Return (points, weights), (n, 2) and (n,), that stand for a Gaussian about 0 of a covariance (2, 2)."""
    values, axes = np.linalg.eigh(covariance)
    lines, spacing = [], 0.1
    for value in np.sqrt(np.maximum(values, 0.0)):
        count = 60 if value > 0.0 else 0
        lines.append(value * spacing * np.arange(-count, count + 1))
    weights = [np.exp(-0.5 * np.square(spacing * (np.arange(len(line)) - len(line) // 2))) for line in lines]
    weights = [weight / weight.sum() for weight in weights]
    grid = np.stack(np.meshgrid(*lines, indexing="ij"), axis=-1).reshape(-1, 2)
    return grid @ axes.T, np.outer(*weights).ravel()


def deposit_points(space: Space, states: Array, masses: Array, side: int, out: Array) -> Array:
    """Add point masses (n,) at states (n, 2), angle and velocity, to the coefficients `out` of a density."""
    cells, references = [], []
    for lines, values in zip(space.lines, states.T, strict=True):
        cell = np.searchsorted(lines, values, side="right" if side > 0 else "left") - 1
        nearest = np.clip(cell, 0, len(lines) - 2)
        references.append((values - lines[nearest]) / np.diff(lines)[nearest])
        cells.append(cell)
    (i, j), (limit, across) = cells, space.shape[:2]
    beyond = [i < 0, i >= limit, (i >= 0) & (i < limit) & ((j < 0) | (j >= across))]
    outflow = np.array([masses[where].sum() for where in beyond])
    inside = ~(beyond[0] | beyond[1] | beyond[2])
    i, j = i[inside], j[inside]
    along, across = (legendre_basis(part[inside], space.degree) for part in references)
    values = np.einsum("n,na,nb->nab", masses[inside] / space.areas[i, j], along, across)
    np.add.at(out, (i, j), values)
    return outflow
