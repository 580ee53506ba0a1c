"""Survival and leakage of a sample of realizations, from counts."""

from typing import Any

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.base.types import Array
from fpk_rocking.results.intervals import wilson_interval
from fpk_rocking.results.result import SurvivalResult


def certain(scene):
    """Whether all paths of a scene are one: there is no noise, and the start is a point."""
    return scene.noise.kind == "none" and scene.start.covariance is None


class Sample(SurvivalResult):
    """What an ensemble and a tally have in common.

    A subclass has ``realizations``, ``times``, ``method``, ``seed``, ``steps_per_cycle``, ``wall_s`` and ``_gone``,
    the count of the overturned after each cycle, to the left and to the right, shape (cycles + 1, 2).
    """

    closure = ""
    shown_bins = 24

    @property
    def engine(self) -> str:
        """Name of the engine and its method."""
        return f"Monte Carlo {self.method}"

    @property
    def facts(self) -> dict[str, Any]:
        """Confidence intervals, method, seed and sizes, as plain values by name."""
        interval = self.survival_interval()
        spread = {} if certain(self.scene) else {"half_width": float(0.5 * np.diff(interval).max())}
        return spread | {
            "interval": interval.tolist(),
            "method": self.method,
            "realizations": int(self.realizations),
            "seed": int(self.seed),
            "steps_per_cycle": int(self.steps_per_cycle),
        }

    @property
    def account(self) -> str:
        """Seed, steps a cycle (none for the exact engine) and seconds, as a sentence."""
        steps = "" if self.method == "exact" else f" {self.steps_per_cycle} steps a cycle,"
        return f"Seed {self.seed},{steps} {self.wall_s:.1f} s."

    def at(self, cycle: int) -> None:  # noqa: ARG002  (the same call as of a density)
        """Return None: a sample has no density. Use `bin_probabilities`.

        Parameters
        ----------
        cycle : int
            Not used.
        """
        return

    @property
    def survivors(self) -> Array:
        """Number of realizations that have not overturned by kT, shape (cycles + 1,)."""
        return self.realizations - self._gone.sum(axis=1)

    @property
    def survival(self) -> Array:
        """Probability of not having overturned by kT, shape (cycles + 1,)."""
        return self.survivors / self.realizations

    @property
    def overturned(self) -> Array:
        """Probability of having overturned by kT to the left and to the right, shape (cycles + 1, 2)."""
        return self._gone / self.realizations

    def survival_interval(self, level: float = 0.95) -> Array:
        """Return Wilson's confidence limits of survival.

        Parameters
        ----------
        level : float
            Confidence of each interval, in (0, 1).

        Returns
        -------
        ndarray, shape (cycles + 1, 2)
        """
        return wilson_interval(self.survivors, self.realizations, level)

    def _checked_cycle(self, cycle):
        accepted = f"a whole number from 0 to {len(self.times) - 1}"
        if isinstance(cycle, bool) or not isinstance(cycle, int | np.integer):
            raise TypeError(checks.refusal("cycle", cycle, accepted))
        if not 0 <= cycle < len(self.times):
            raise ValueError(checks.refusal("cycle", cycle, accepted))
        return int(cycle)
