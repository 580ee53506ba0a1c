"""What the replacement of band noise changes in a density, measured by paths under the noise of the scene.

This is the one place that defines the measured replacement and the total error of a printed probability.
"""

import dataclasses
from collections.abc import Iterator
from typing import Annotated, Any

import numpy as np

from fpk_rocking.base.checks import Array
from fpk_rocking.physics.noise import equivalence
from fpk_rocking.results.sampling import wilson_interval
from fpk_rocking.results.storage import plain
from fpk_rocking.results.trust import REPLACED


@dataclasses.dataclass(frozen=True, eq=False)
class Replacement:
    """Probabilities by paths under the noise of the scene, minus those by a density with a replaced noise.

    Row k is that of the density. The columns are survival, overturned to the left and overturned to the right.

    Attributes
    ----------
    difference : ndarray, shape (cycles + 1, 3)
        Probability by the paths minus that by the density.
    sampling_error : ndarray, shape (cycles + 1, 3)
        Sampling error of the difference, 95 %: from the share of the paths to the farther end of Wilson's interval.
    method, realizations, seed, wall_s
        Engine, number, seed and seconds of the paths.

    Examples
    --------
    >>> from fpk_rocking import load_scene, solve_fpk
    >>> from fpk_rocking.studies import checked
    >>> density = checked(solve_fpk(load_scene("main"), cycles=4, tol=1e-2), realizations=1000)
    >>> print(density.replacement.difference[4].round(2), density.replacement.sampling_error[4].round(2))
    [ 0.    0.   -0.01] [0.02 0.01 0.02]
    """

    difference: Annotated[Array, "f8 time 3"]
    sampling_error: Annotated[Array, "f8 time 3"]
    method: str
    realizations: int
    seed: int
    wall_s: float

    def total(self, numerics: float) -> Array:
        """Return total errors of the density's probabilities: numerics + |difference| + sampling error.

        The density's probability ± this contains Wilson's 95 % interval of the paths, so in each row it contains the
        probability under the noise of the scene in at least 95 % of all cases.

        Parameters
        ----------
        numerics : float
            The solver's own estimate of its error.

        Returns
        -------
        ndarray, shape (cycles + 1, 3)
        """
        return numerics + np.abs(self.difference) + self.sampling_error

    @property
    def plain(self) -> dict[str, Any]:
        """All fields by name as plain values, for JSON, and "columns", the names of the columns."""
        values = {field.name: getattr(self, field.name) for field in dataclasses.fields(self)}
        return plain(values | {"columns": ["survival", "overturned left", "overturned right"]})


def measured(density: Any, paths: Any) -> Replacement:
    """Return the `Replacement` of an `Evolution`, by an `Ensemble` or a `Tally` of its scene at its times or more.

    ValueError where the paths are of another scene or of other times, or no noise was replaced.
    """
    if not density.noise_replacement:
        raise ValueError("density: got one whose noise was solved as it is, accepted: one whose noise was replaced")
    if paths.scene != density.scene:
        raise ValueError("paths: got those of another scene, accepted: paths of the density's own scene and noise")
    rows = len(density.times)
    if len(paths.times) < rows or not np.allclose(paths.times[:rows], density.times, rtol=1e-12, atol=0.0):
        raise ValueError("paths: got other times, accepted: all times of the density")
    sampled, solved = (np.column_stack([result.survival, result.overturned])[:rows] for result in (paths, density))
    limits = wilson_interval(np.round(sampled * paths.realizations), paths.realizations)
    error = np.abs(limits - sampled[..., None]).max(axis=-1)
    return Replacement(sampled - solved, error, paths.method, paths.realizations, paths.seed, float(paths.wall_s))


def check_remarks(density: Any) -> Iterator[str]:
    """Yield sentences about the `replacement` of an `Evolution`: how it was measured and, if inaccurate, what helps."""
    check, total = density.replacement, density.total_error
    yield (
        f"{density.overturning_text()}. Replacement: {check.realizations:,} paths under the noise of the scene "
        f"({check.method}, seed {check.seed}, {check.wall_s:.1f} s) minus the density, with its 95 % sampling error. "
        "Total: numerics + |replacement| + sampling error."
    )
    if total.max() <= max(REPLACED, density.tol):
        return
    worst = np.unravel_index(total.argmax(), total.shape)
    if check.sampling_error[worst] > abs(check.difference[worst]):
        yield "Most of the total error is the sampling error of the check: more paths make it smaller."
        return
    alone = 1.0 - density.survival[-1] - check.difference[-1, 0]
    yield (
        f"The paths alone are better here: P(overturned) = {alone:.4f} ± {check.sampling_error[-1, 0]:#.2g} at the end."
    )
    noise, block = density.scene.noise, density.scene.block
    part = equivalence.relative_variance(noise, critical_angle=block.critical_angle)
    spread = ""
    if noise.frequencies == "independent":
        strength = equivalence.realized_spread(noise, block.restitution, critical_angle=block.critical_angle)
        spread = f"; realizations of {noise.harmonics} harmonics differ in strength by {100.0 * strength:.0f} %"
    rest = (
        f"; the forcing alone reaches {density.scene.forcing.largest:.3g}, a block at rest lifts off above "
        f"{block.lift_off:.4g}, but under white noise no block stays at rest"
    )
    yield (
        f"A possible cause: the band [{noise.band[0]:g}, {noise.band[1]:g}] covers {100.0 * part:.0f} % of the "
        f"Melnikov variance of equally strong white noise{spread}{'' if density.rests_exactly else rest}."
    )
