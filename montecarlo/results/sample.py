"""Survival and leakage of a sample of realizations, from counts."""

import abc
import functools
from typing import TYPE_CHECKING, Any

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.base.types import Array
from fpk_rocking.results.intervals import wilson_interval
from fpk_rocking.results.remarks import doubts
from fpk_rocking.results.result import SurvivalResult
from fpk_rocking.results.trust import CAUTION, Doubt, Trust, verdict

EXACT_PATH = "Deterministic: one path, exact to rounding, which a chaotic motion amplifies."
"""Reason of the verdict on the one path of a deterministic scene by the method "exact"."""


def path_doubts(method: str) -> list[Doubt]:
    """Return what speaks against the one path of a deterministic scene, where only a method's own error is left."""
    if method == "exact":
        return []
    sentence = (
        f"Deterministic: one path, by the time steps of the method {method!r}, whose error is not estimated. Compare "
        "with the method 'exact', or with another `steps_per_cycle`."
    )
    return [Doubt(CAUTION, sentence, "steps")]


class Sample(SurvivalResult):
    """What an ensemble and a tally have in common.

    A subclass has the rest of `Result`, and what follows here for the type checker.
    """

    if TYPE_CHECKING:  # properties here would forbid fields of these names
        method: str
        seed: int
        steps_per_cycle: int

        @property
        @abc.abstractmethod
        def realizations(self) -> int:
            """Number of realizations."""

        @property
        @abc.abstractmethod
        def _gone(self) -> Array:
            """Count of the overturned after each cycle, to the left and to the right, shape (cycles + 1, 2)."""

        @property
        @abc.abstractmethod
        def _overturning(self) -> tuple[float, float, int] | None:
            """Earliest and latest time of overturning of the first realization, and the side; None if it stands."""

    closure = ""
    shown_bins = 24

    @property
    def engine(self) -> str:
        """Name of the engine and its method."""
        return f"Monte Carlo {self.method}"

    @property
    def facts(self) -> dict[str, Any]:
        """Confidence intervals or what the one path does, method, seed and sizes, as plain values by name."""
        if self.deterministic:
            spread: dict[str, Any] = {"outcome": self.outcome}
        else:
            interval = self.survival_interval()
            spread = {"half_width": float(0.5 * np.diff(interval).max()), "interval": interval.tolist()}
        return spread | {
            "method": self.method,
            "realizations": int(self.realizations),
            "seed": int(self.seed),
            "steps_per_cycle": int(self.steps_per_cycle),
        }

    @property
    def deterministic(self) -> bool:
        """Whether nothing is random (`Scene.deterministic`): all realizations are one path."""
        return self.scene.deterministic

    @property
    def outcome(self) -> str:
        """What the one path of a deterministic scene does, with seconds where the size is known; empty for others.

        As in ``"deterministic: overturns to the left at τ = 7.62 (1.84 s)"``.
        """
        if not self.deterministic:
            return ""
        if self._overturning is None:
            return f"deterministic: stands until {self._when(self.times[-1])}"
        low, high, side = self._overturning
        when = f"at {self._when(high)}" if low == high else f"between {self._when(low)} and {self._when(high)}"
        return f"deterministic: overturns to the {'left' if side < 0 else 'right'} {when}"

    def _when(self, time):
        size = self.scene.block.dimensions
        return f"τ = {time:.4g}" + ("" if size is None else f" ({size.seconds(time):.3g} s)")

    @functools.cached_property
    def trust(self) -> Trust:
        """Verdict with its reasons: "ok", "caution" or "do not use"."""
        return verdict(doubts(self) + path_doubts(self.method), EXACT_PATH) if self.deterministic else super().trust

    @property
    def account(self) -> str:
        """Seed if there is chance, steps a cycle (none for the exact engine) and seconds, as a sentence."""
        parts = [] if self.deterministic else [f"seed {self.seed}"]
        parts += [] if self.method == "exact" else [f"{self.steps_per_cycle} steps a cycle"]
        said = ", ".join([*parts, f"{self.wall_s:.1f} s."])
        return said[0].upper() + said[1:]

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
        """Return Wilson's confidence limits of survival; of a deterministic scene survival itself, which is exact.

        Parameters
        ----------
        level : float
            Confidence of each interval, in (0, 1).

        Returns
        -------
        ndarray, shape (cycles + 1, 2)
        """
        limits = wilson_interval(self.survivors, self.realizations, level)
        return np.stack([self.survival, self.survival], axis=-1) if self.deterministic else limits

    def _checked_cycle(self, cycle):
        return checks.count("cycle", cycle, at_least=0, at_most=len(self.times) - 1)
