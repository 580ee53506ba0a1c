"""What it changes to take a block as slender, measured: the same motions by both equations."""

import math
from typing import NamedTuple

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.base.types import ArrayLike
from fpk_rocking.scene.scene import Scene
from montecarlo import simulate

PAIRS = 5000


class SlendernessCost(NamedTuple):
    """Probability of overturning by the exact and by the slender equation, in pairs of paths under the same motion.

    Parameters
    ----------
    exact, slender : float
        Part of the paths that overturned.
    standard_error : float
        Of `difference`, from the pairs of which one overturned and the other did not; as from one such pair where there
        is none. 0 for a deterministic scene.
    realizations : int
        Number of pairs.

    Examples
    --------
    >>> from fpk_rocking import Scene
    >>> from fpk_rocking.studies import slenderness_cost
    >>> rack = Scene.from_block(0.5, 1.8, "0.5 g", "1.5 Hz",
    ...                         noise_rms_acceleration=0.5, noise_band_hz=(0, 5))
    >>> cost = slenderness_cost(rack, cycles=4, realizations=1000)
    >>> print(cost.exact, cost.slender, f"{cost.difference:.3f} ± {cost.standard_error:.3f}")
    0.077 0.164 0.087 ± 0.012
    """

    exact: float
    slender: float
    standard_error: float
    realizations: int

    @property
    def difference(self) -> float:
        """What taking the block as slender adds to the probability of overturning."""
        return self.slender - self.exact

    def __str__(self):
        return (
            f"Of {self.realizations:,} motions {self.slender:.4f} overturned the block by the equation of a slender "
            f"one, {self.exact:.4f} by the exact one: the difference is {self.difference:+.4f} ± "
            f"{self.standard_error:.2g} (standard error)."
        )


def slenderness_cost(
    scene: Scene,
    *,
    cycles: int | None = None,
    times: ArrayLike | None = None,
    realizations: int = PAIRS,
    seed: int = 1,
    method: str | None = None,
) -> SlendernessCost:
    """Measure by Monte Carlo what it changes to take a block as slender.

    Both equations meet the same realizations of the noise and of the start. It holds for a result of the density solver
    as well, as far as its noise is that of the scene.

    Parameters
    ----------
    scene : Scene
        Its block has dimensions or a critical angle above 0; whether it is taken as slender has no influence.
    cycles, times, seed, method
        As for `montecarlo.simulate`.
    realizations : int
        Number of pairs.

    Returns
    -------
    SlendernessCost

    Raises
    ------
    TypeError, ValueError
        The block has neither dimensions nor a critical angle, or as `montecarlo.simulate`.

    Examples
    --------
    >>> from fpk_rocking import Scene
    >>> from fpk_rocking.studies import slenderness_cost
    >>> rack = Scene.from_block(0.5, 1.8, "0.5 g", "1.5 Hz",
    ...                         noise_rms_acceleration=0.5, noise_band_hz=(0, 5))
    >>> print(f"{slenderness_cost(rack, cycles=4, realizations=1000).difference:.3f}")
    0.087
    """
    block = checks.instance("scene", scene, Scene).block
    if block.least_friction is None:
        accepted = "an angle above 0, or block.dimensions, for the cost of slenderness"
        raise ValueError(checks.refusal("block.critical_angle", block.critical_angle, accepted))
    exact = scene.varied(block={"slender": False}) if block.slender else scene
    fell = []
    for one in (exact, scene.varied(block={"slender": True})):
        ensemble = simulate(one, cycles=cycles, times=times, realizations=realizations, seed=seed, method=method)
        fell.append(np.isfinite(ensemble.overturn_time))
    both, count = fell[1].astype(int) - fell[0], fell[0].size
    spread = max(np.count_nonzero(both), 1) / count - both.mean() ** 2
    error = 0.0 if scene.deterministic else math.sqrt(spread / count)
    return SlendernessCost(float(fell[0].mean()), float(fell[1].mean()), error, count)
