"""What a density's replacement of noise does to its probabilities, measured by paths under the noise of the scene.

This is the one place that defines the measured replacement and the total error of a printed probability.
"""

import dataclasses
from typing import Any

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.base.types import Array
from fpk_rocking.results.intervals import wilson_interval

__all__ = ["Replacement", "measured"]

ARRAYS = {"replacement": "f8 k+1 2 3"}
"""Layout of a saved replacement: difference and sampling error of survival, left and right."""

_SAID = {"method": str, "realizations": int, "seed": int, "wall_s": float}


@dataclasses.dataclass(frozen=True, eq=False)
class Replacement:
    """Probabilities by paths under the noise of the scene, less those by a density with another noise in its place.

    Row k is that of the density. Its three columns are survival, overturned to the left and overturned to the right.

    Attributes
    ----------
    difference : ndarray, shape (cycles + 1, 3)
        Probability by the paths less that by the density.
    sampling_error : ndarray, shape (cycles + 1, 3)
        Sampling error of the difference, 95 %: from the share of the paths to the farther end of Wilson's interval.
    method : str
        Engine of the paths, as in "exact".
    realizations : int
        Number of paths.
    seed : int
        Of the paths.
    wall_s : float
        Seconds that the paths took.

    Examples
    --------
    >>> from fpk_rocking import load_scene, solve_fpk
    >>> from fpk_rocking.studies import checked
    >>> density = checked(solve_fpk(load_scene("main"), cycles=4, tol=1e-2), realizations=1000)
    >>> print(density.replacement.difference[4].round(2), density.replacement.sampling_error[4].round(2))
    [ 0.01  0.   -0.01] [0.02 0.01 0.02]
    """

    difference: np.ndarray
    sampling_error: np.ndarray
    method: str
    realizations: int
    seed: int
    wall_s: float

    def total(self, numerics: float) -> Array:
        """Whole errors of the density's probabilities: numerics + |difference| + sampling error.

        Parameters
        ----------
        numerics : float
            The solver's own estimate of its error.

        Returns
        -------
        ndarray, shape (cycles + 1, 3)
            The density's probability ± this contains Wilson's 95 % interval of the paths, so it contains the
            probability under the noise of the scene in at least 95 % of all cases, in each row.
        """
        return numerics + np.abs(self.difference) + self.sampling_error

    @property
    def plain(self) -> dict[str, Any]:
        """Everything as plain values by name, for JSON."""
        own = {name: kind(getattr(self, name)) for name, kind in _SAID.items()}
        lists = {"difference": self.difference.tolist(), "sampling_error": self.sampling_error.tolist()}
        return own | {"columns": ["survival", "overturned left", "overturned right"]} | lists

    def stored(self) -> tuple[dict[str, Array], dict[str, Any]]:
        """Return arrays and attributes of a file; `restored` takes them."""
        said = {name: kind(getattr(self, name)) for name, kind in _SAID.items()}
        return {"replacement": np.stack([self.difference, self.sampling_error], axis=1)}, {"check": said}

    @classmethod
    def restored(cls, values: Array, said: dict) -> "Replacement":
        """Return what `stored` gave; raises ValueError where `said` is something else."""
        if said.keys() != _SAID.keys() or any(type(said[name]) is not kind for name, kind in _SAID.items()):
            raise ValueError(checks.refusal("check", said, f"values of {', '.join(_SAID)}"))
        return cls(values[:, 0], values[:, 1], **said)


def measured(density: Any, paths: Any) -> Replacement:
    """Hold paths under the noise of a scene against a density in which other noise replaced it.

    Parameters
    ----------
    density : DensityResult
        Its noise was replaced (``closure``).
    paths : Ensemble or Tally
        Of the same scene, at the same times or more.

    Returns
    -------
    Replacement

    Raises
    ------
    ValueError
        The paths are of another scene or of other times, or no noise was replaced.
    """
    if not density.closure:
        raise ValueError("density: got one whose noise was solved as it is, accepted: one whose noise was replaced")
    if paths.scene != density.scene:
        raise ValueError("paths: got those of another scene, accepted: paths of the density's own scene and noise")
    rows = len(density.times)
    if len(paths.times) < rows or not np.allclose(paths.times[:rows], density.times, rtol=1e-12, atol=0.0):
        raise ValueError("paths: got other times, accepted: all times of the density")
    sampled, solved = (_probabilities(result)[:rows] for result in (paths, density))
    limits = wilson_interval(np.round(sampled * paths.realizations), paths.realizations)
    error = np.abs(limits - sampled[..., None]).max(axis=-1)
    return Replacement(sampled - solved, error, paths.method, paths.realizations, paths.seed, float(paths.wall_s))


def _probabilities(result):
    return np.column_stack([result.survival, result.overturned])
