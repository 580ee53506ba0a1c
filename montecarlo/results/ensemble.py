"""Results that keep every realization: `Ensemble`, its states by cycle, and `Histories`, also those between."""

import dataclasses
import functools
from typing import Annotated, Any, ClassVar, Self

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.base.checks import Array, ArrayLike
from fpk_rocking.physics.forcing import refuse_transient
from fpk_rocking.results.remarks import EXACT_PATH, path_diagnostics
from fpk_rocking.results.trust import Diagnostic
from fpk_rocking.scene import Scene
from fpk_rocking.scene.axes import result_times
from montecarlo.results.counts import Paths, Sample


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class Ensemble(Sample):
    """Independent realizations of a scene; all quantities are nondimensional.

    Column k of an array is for ``times[k]``; rows and the parameter ``cycle`` are those of `SurvivalResult`.

    Parameters
    ----------
    scene, seed, steps_per_cycle
        As given to `simulate`.
    method : str
        "exact", "rk4", "white" or "filtered"; a name of one's own for `from_paths`.
    wall_s : float
        Seconds that the call took, compilation included.
    times : ndarray, shape (rows,)
        Times τ of the states, from 0 on.
    angle, velocity : ndarray, shape (realizations, rows)
        States, Poincaré points after whole cycles; nan after overturning.
    overturn_time, overturn_side : ndarray, shape (realizations,)
        Time τ of overturning, and side: -1 left, +1 right; nan and 0 for a block that stands.
    returns : ndarray of int, shape (2,)
        How many paths that overturned were followed further to the fall, 90 degrees, and how many of these came back. 0
        where the critical angle is unknown, or the angle of overturning is not the default.
    """

    kind: ClassVar = "ensemble"
    times: Annotated[Array, "f8 time"]
    angle: Annotated[Array, "f8 realization time"]
    velocity: Annotated[Array, "f8 realization time"]
    overturn_time: Annotated[Array, "f8 realization"]
    overturn_side: Annotated[Array, "i1 realization"]
    returns: Annotated[Array, "i8 2"]

    @classmethod
    def from_paths(
        cls, scene: Scene, angle: ArrayLike, velocity: ArrayLike, times: ArrayLike | None = None, method: str = "own"
    ) -> Self:
        """Make an ensemble of paths that were computed elsewhere, to plot it or compare it with other results.

        A block counts as overturned from its first state at ``scene.overturning.angle`` or beyond, to the side of the
        sign of that angle; later states are not used, and may be nan. The time of overturning is that of this state,
        later than the true one: `overturning_rate` and `first_passage` refuse it.

        Parameters
        ----------
        scene : Scene
            Scene that the paths are computed for.
        angle, velocity : array_like, shape (realizations, n + 1)
            Nondimensional states, in critical angles, after 0 to n cycles, or at `times`, the first at the start.
        times : array_like, optional
            Where the forcing does not repeat: n + 1 times τ, the first 0.
        method : str
            Name of what computed them, for titles.

        Raises
        ------
        ValueError
            Shapes differ, a state before the block has overturned is not finite, or paths do not begin at the start.

        Examples
        --------
        >>> from fpk_rocking import load_scene
        >>> from montecarlo import Ensemble
        >>> own = Ensemble.from_paths(load_scene("main"), [[0, 0.4, 1.7], [0, -0.2, 0.1]], [[0, 1, 3], [0, -1, 0]])
        >>> print(own.survival, own.overturn_side)
        [1.  1.  0.5] [1 0]
        """
        accepted = "a row for each path, a column for each time from the start on"
        states = [checks.array(name, value, accepted) for name, value in (("angle", angle), ("velocity", velocity))]
        if states[0].ndim != 2 or states[0].shape != states[1].shape or 0 in states[0].shape:
            got = " and ".join(str(state.shape) for state in states)
            raise ValueError(checks.refusal("angle and velocity", f"arrays of shapes {got}", accepted))
        rows, bound = states[0].shape[1], checks.instance("scene", scene, Scene).overturning.angle
        at = result_times(scene, rows - 1) if times is None else result_times(scene, times=times)
        if at.size != rows:
            raise ValueError(checks.refusal("times", f"{at.size} times", f"the {rows} of the columns, the first 0"))
        over = np.maximum.accumulate(np.abs(states[0]) >= bound, axis=1)
        if not np.isfinite(np.where(over, 0.0, states)).all():
            accepted = f"numbers up to the first state at an angle of ±{bound:g} or beyond, which tells the side"
            raise ValueError(checks.refusal("angle and velocity", "nan or inf before overturning", accepted))
        start = np.array([scene.start.angle, scene.start.velocity])
        away = np.abs(states - start[:, None, None])[:, :, 0]
        if scene.start.covariance is None and not (away <= 1e-6).all():
            farthest = [float(state[away.max(axis=0).argmax(), 0]) for state in states]
            accepted = f"the start of the scene, {start.tolist()}, in the first column"
            raise ValueError(checks.refusal("angle and velocity", farthest, accepted))
        first, ended = np.argmax(over, axis=1), over[:, -1]
        side = np.sign(np.take_along_axis(states[0], first[:, None], axis=1)[:, 0])
        angles, velocities = np.where(over, np.nan, states)
        return cls(
            scene=scene,
            method=checks.sentence("method", method),
            seed=0,
            steps_per_cycle=0,
            wall_s=0.0,
            times=at,
            angle=angles,
            velocity=velocities,
            overturn_time=np.where(ended, at[first], np.nan),
            overturn_side=np.where(ended, side, 0.0).astype(np.int8),
            returns=np.zeros(2, np.int64),
        )

    @property
    def realizations(self) -> int:
        """Number of realizations."""
        return self.angle.shape[0]

    @property
    def at_rest(self) -> Array:
        """Part of the realizations (cycles + 1,) at rest; under white noise no block rests after the start."""
        return np.count_nonzero((self.angle == 0.0) & (self.velocity == 0.0), axis=0) / self.realizations

    @functools.cached_property
    def overturned_counts(self) -> Array:
        """Number of realizations that have overturned to the left and to the right, shape (cycles + 1, 2)."""
        sides = [np.count_nonzero(np.isnan(self.angle[self.overturn_side == side]), axis=0) for side in (-1, 1)]
        return np.stack(sides, axis=-1)

    @property
    def first_overturning(self) -> tuple[float, float, int] | None:
        """(earliest, latest, side) of overturning of realization 0: times τ, and -1 or 1; None if it stands."""
        latest, side = float(self.overturn_time[0]), int(self.overturn_side[0])
        # Own paths tell the states before and after it.
        earliest = latest if self.steps_per_cycle else float(self.times[self.times < latest].max(initial=0.0))
        return (earliest, latest, side) if side else None

    def _binned(self, row, edges):
        standing = np.isfinite(self.angle[:, row])
        points = self.angle[standing, row], self.velocity[standing, row]
        return np.histogram2d(*points, bins=edges)[0] / self.realizations


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class Histories(Paths):
    """Time histories of independent realizations, with every impact; all quantities are nondimensional.

    Parameters
    ----------
    scene, seed, steps_per_cycle, samples_per_cycle
        As given to `histories`.
    method, wall_s, overturn_time, overturn_side
        As of `Ensemble`.
    time : ndarray, shape (n,)
        Times τ of the states, from 0 on; n = cycles · samples_per_cycle + 1, equally spaced, where the forcing repeats.
    angle, velocity : ndarray, shape (realizations, n)
        States; nan after overturning.
    impact_realization : ndarray of int, shape (n_impacts,)
        Realization of each impact: ascending, and in the order of time within each realization.
    impact_time, impact_velocity : ndarray, shape (n_impacts,)
        Time τ of each impact, and the velocity just before it. A burst of ever smaller impacts (chatter) that an engine
        sums up is not listed.
    """

    kind: ClassVar = "histories"
    samples_per_cycle: int
    time: Annotated[Array, "f8 time"]
    angle: Annotated[Array, "f8 realization time"]
    velocity: Annotated[Array, "f8 realization time"]
    overturn_time: Annotated[Array, "f8 realization"]
    overturn_side: Annotated[Array, "i1 realization"]
    impact_realization: Annotated[Array, "i8 impact"]
    impact_time: Annotated[Array, "f8 impact"]
    impact_velocity: Annotated[Array, "f8 impact"]

    row_dims = ("realization", "time")
    more_metadata = ("realizations",)

    @property
    def realizations(self) -> int:
        """Number of realizations."""
        return self.angle.shape[0]

    @property
    def cycles(self) -> int | None:
        """Number of forcing cycles; None where the forcing does not repeat."""
        return None if self.scene.period is None else (self.time.size - 1) // self.samples_per_cycle

    @property
    def impacts(self) -> Array:
        """Number of impacts of each realization, shape (realizations,).

        Under white noise a start at rest has impacts without limit: shorter steps show more and slower ones.
        """
        return np.bincount(self.impact_realization, minlength=self.realizations)

    @property
    def remarks(self) -> tuple[str, ...]:
        """Sentences as of every result, and one if the number of impacts depends on the time steps."""
        if self.method != "white" or not self.scene.start.at_rest:
            return super().remarks
        said = (
            "From a start at rest white noise makes impacts without limit: shorter steps show more of them, and slower "
            "ones. Count impacts from a later time on, or start from a block that moves."
        )
        return (*super().remarks, said)

    def model_diagnostics(self) -> list[Diagnostic]:
        """Diagnostics of the model, and of the time steps of a path where nothing is random."""
        return super().model_diagnostics() + (path_diagnostics(self.method) if self.scene.deterministic else [])

    @property
    def reason_if_ok(self) -> str:
        """Reason of the verdict "ok": single paths have no sampling error."""
        return EXACT_PATH if self.scene.deterministic else "These are single paths: nothing is estimated from them."

    @property
    def title(self) -> str:
        """Number of paths, of those overturned and of impacts, as a line of text."""
        ended = np.count_nonzero(self.overturn_side)
        return (
            f"{self.realizations:,} path{'s' * (self.realizations != 1)} by Monte Carlo {self.method} until "
            f"τ = {self.time[-1]:.4g}, {ended:,} overturned, {self.impact_time.size:,} impacts"
        )

    def plot(self, realizations: int = 3) -> Any:
        """Draw angle against time, and paths in the phase plane: a matplotlib figure.

        Parameters
        ----------
        realizations : int
            How many to draw, from the first on.
        """
        from fpk_rocking.results.pictures import figure_of

        def angles(_, axes):
            axes.plot(self.time, self.angle[:realizations].T, linewidth=0.9)
            axes.set(xlabel="time τ", ylabel="angle Θ")

        def plane(_, axes):
            axes.plot(self.angle[:realizations].T, self.velocity[:realizations].T, linewidth=0.7)
            axes.set(xlabel="angle Θ", ylabel="velocity dΘ/dτ")

        return figure_of(angles, plane)

    def poincare(self) -> tuple[Array, Array]:
        """Angle and velocity at the whole cycles, (realizations, cycles + 1) each; nan after overturning."""
        refuse_transient(self.scene.forcing, "a Poincaré map")
        return self.angle[:, :: self.samples_per_cycle], self.velocity[:, :: self.samples_per_cycle]
