"""`solve_realizations`: band noise of few harmonics as a mixture of white noises, the solver averaged over them.

A realization of band noise draws its N frequencies once. What it has near the system's own frequencies is therefore
random, and so is the diffusion D_r that it stands for: the mean is that of the band, the relative spread falls as
N^(-1/2). Survival is not linear in D, so an ensemble of realizations is not the mean white noise. Here it is the mean
over the distribution of D_r. Each frequency counts in it by `physics.noise.equivalence.response`, in which the impact
keeps its jump of velocity: where blocks lose speed they respond to more frequencies than the kernel of (15) has, and
realizations differ less.
"""

import dataclasses
import math
from typing import Any

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.base.types import Array, ArrayLike, known
from fpk_rocking.density.evolution import Evolution
from fpk_rocking.density.solver import solve_fpk
from fpk_rocking.physics.forcing import refuse_transient
from fpk_rocking.physics.noise.envelope import refuse_envelope
from fpk_rocking.physics.noise.equivalence import equivalent_diffusion, jump_diffusion, response
from fpk_rocking.results.replacement import Replacement
from fpk_rocking.results.result import DensityResult
from fpk_rocking.scene import BandNoise, Scene, WhiteNoise

_SAMPLES, _SEED = 200_000, 1
"""Realizations whose diffusions are drawn for the quadrature, and their seed."""


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class RealizationAverage(DensityResult):
    """Average of density solutions over the scatter between realizations of band noise; see `solve_realizations`.

    Attributes
    ----------
    scene : Scene
        The scene that was given, with band noise.
    diffusions, weights : ndarray, shape (nodes,)
        Nodes and weights of the Gauss quadrature over the distribution of a realization's diffusion.
    evolutions : tuple of Evolution
        The solution for each of the diffusions.
    replacement : Replacement, optional
        As in `Evolution`.

    Examples
    --------
    >>> from fpk_rocking import load_scene, solve_realizations
    >>> few = load_scene("main").varied(noise={"harmonics": 30})
    >>> average = solve_realizations(few, cycles=2, tol=1e-2, nodes=2)
    >>> print(average.diffusions.round(4), average.weights.round(2))
    [0.0042 0.01  ] [0.64 0.36]
    """

    scene: Scene
    diffusions: np.ndarray
    weights: np.ndarray
    evolutions: tuple[Evolution, ...]
    replacement: Replacement | None = None

    @property
    def cycles(self) -> int:
        """Number of forcing cycles."""
        return known(self.evolutions[0].cycles)

    @property
    def times(self) -> Array:
        """Times τ of whole cycles, shape (cycles + 1,)."""
        return self.evolutions[0].times

    @property
    def closure(self) -> str:
        """Which noises replaced the band noise, as a sentence."""
        return (
            f"Band noise replaced by a mixture of {len(self.weights)} white noises, of diffusions from "
            f"{self.diffusions.min():.3g} to {self.diffusions.max():.3g}, as those of single realizations scatter."
        )

    @property
    def error_estimate(self) -> float:
        """Estimated error of survival: the weighted mean of those of the solutions."""
        return float(self.weights @ [evolution.error_estimate for evolution in self.evolutions])

    @property
    def mass_defect(self) -> float:
        """Largest mass defect of the solutions."""
        return max(evolution.mass_defect for evolution in self.evolutions)

    @property
    def negative_mass(self) -> float:
        """Weighted mean of the negative masses of the solutions; that of the average is not larger."""
        return float(self.weights @ [evolution.negative_mass for evolution in self.evolutions])

    @property
    def moving_negative_mass(self) -> float:
        """The same without the blocks at rest."""
        return float(self.weights @ [evolution.moving_negative_mass for evolution in self.evolutions])

    @property
    def facts(self) -> dict[str, Any]:
        """Error figures, diffusions and weights, as plain values by name."""
        names = "error_estimate", "mass_defect", "negative_mass", "moving_negative_mass"
        own = {name: float(getattr(self, name)) for name in names}
        own |= {"tol": self.evolutions[0].tol}
        return own | {"diffusions": self.diffusions.tolist(), "weights": self.weights.tolist()} | self.replacement_facts

    def at(self, cycle: int) -> None:  # noqa: ARG002  (the same call as of an evolution)
        """Return None, as the solutions have meshes of their own; use ``evolutions[i].at(cycle)``.

        Parameters
        ----------
        cycle : int
            Not used.
        """
        return

    @property
    def wall_s(self) -> float:
        """Seconds that all solutions took."""
        return sum(evolution.wall_s for evolution in self.evolutions)

    @property
    def survival(self) -> Array:
        """Probability of not having overturned by kT, shape (cycles + 1,)."""
        return self.weights @ np.array([evolution.survival for evolution in self.evolutions])

    @property
    def overturned(self) -> Array:
        """Probability of having overturned by kT to the left and to the right, shape (cycles + 1, 2)."""
        return np.tensordot(self.weights, [evolution.overturned for evolution in self.evolutions], 1)

    def bin_probabilities(self, cycle: int, angle_edges: ArrayLike, velocity_edges: ArrayLike) -> Array:
        """Probability of standing, with angle and velocity in each of some bins.

        Parameters
        ----------
        cycle, angle_edges, velocity_edges
            As for `Evolution.bin_probabilities`.

        Returns
        -------
        ndarray, shape (angle bins, velocity bins)
        """
        parts = [evolution.bin_probabilities(cycle, angle_edges, velocity_edges) for evolution in self.evolutions]
        return np.tensordot(self.weights, parts, 1)


def realized_diffusions(
    noise: BandNoise, restitution: float, samples: int, seed: int, critical_angle: float = 0.0
) -> Array:
    """Draw the diffusions (samples,) that single realizations of a band noise stand for; nondimensional."""
    rng, (low, high) = np.random.default_rng(seed), noise.band
    total = np.zeros(samples)
    for _ in range(noise.harmonics):
        total += response(rng.uniform(low, high, samples), restitution, critical_angle)
    mean = noise.harmonics * jump_diffusion(noise, restitution, critical_angle) / noise.variance
    return equivalent_diffusion(noise, critical_angle) * total / mean


def gauss_quadrature(values: Array, count: int) -> tuple[Array, Array]:
    """Nodes and weights (count,) that are exact for polynomials up to degree 2 count - 1 of equally likely values.

    By Lanczos's recurrence on the values and the eigenvalues of its matrix (Golub and Welsch 1969); both are positive
    where the values are.
    """
    from scipy.linalg import eigh_tridiagonal

    mean, spread = values.mean(), values.std()
    scaled, size = (values - mean) / spread, len(values)
    before, now = np.zeros(size), np.full(size, 1.0 / math.sqrt(size))
    diagonal, beside, beta = [], [], 0.0
    for _ in range(count):
        new = scaled * now - beta * before
        diagonal.append(new @ now)
        new -= diagonal[-1] * now
        beta = math.sqrt(new @ new)
        beside.append(beta)
        before, now = now, new / beta
    nodes, vectors = eigh_tridiagonal(diagonal, beside[:-1])
    return mean + spread * nodes, vectors[0] ** 2


def solve_realizations(scene: Scene, *, cycles: int, tol: float = 1e-3, nodes: int = 5) -> RealizationAverage:
    """Solve for band noise of few harmonics, as the average over white noises of different strength.

    Each realization of band noise draws its N frequencies once, so some realizations act more strongly on the block
    than others. A realization is replaced by white noise of its own diffusion, and `solve_fpk` runs for a few of these
    diffusions, chosen by Gauss quadrature.

    Parameters
    ----------
    scene : Scene
        With band noise of two harmonics or more, under periodic forcing.
    cycles : int
        Number of forcing cycles.
    tol : float
        Wanted error of survival in each solution, at least 1e-4.
    nodes : int
        Number of solutions, from 2 to 12.

    Returns
    -------
    RealizationAverage

    Raises
    ------
    TypeError, ValueError
        A parameter is refused, the noise is not band noise of two harmonics or more, or `solve_fpk` refuses the scene.

    Examples
    --------
    >>> from fpk_rocking import load_scene, solve_realizations
    >>> few = load_scene("main").varied(noise={"harmonics": 30})
    >>> print(solve_realizations(few, cycles=2, tol=1e-2, nodes=2).survival.round(3))
    [1.    1.    0.995]
    """
    checks.instance("scene", scene, Scene)
    refuse_transient(scene.forcing, "an average over realizations")
    refuse_envelope(scene.noise, "an average over realizations")
    nodes = checks.count("nodes", nodes)
    if not 2 <= nodes <= 12:
        raise ValueError(checks.refusal("nodes", nodes, "a whole number from 2 to 12"))
    if scene.noise.kind != "band" or scene.noise.harmonics < 2 or scene.noise.variance == 0.0:
        raise ValueError(checks.refusal("noise", scene.noise, "band noise of two harmonics or more"))
    block = scene.block
    drawn = realized_diffusions(scene.noise, block.restitution, _SAMPLES, _SEED, block.critical_angle)
    diffusions, weights = gauss_quadrature(drawn, nodes)
    evolutions = tuple(
        solve_fpk(dataclasses.replace(scene, noise=WhiteNoise(float(diffusion))), cycles=cycles, tol=tol)
        for diffusion in diffusions
    )
    return RealizationAverage(scene, diffusions, weights, evolutions)
