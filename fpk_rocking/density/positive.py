"""`solve_positive`: the densities of `solve_fpk` by a scheme that cannot make them negative.

The density is carried as masses on the nodes of a mesh, and a step is a matrix without negative entries. What makes it
accurate is in `density.clouds`; what it costs, and why limiters do not do, is in docs/numerics.md.
"""

import dataclasses
import time

import numpy as np

from fpk_rocking import checks
from fpk_rocking.density.acceptance import (
    Progress,
    bins_tolerance,
    closure_of,
    refuse_broken,
    refuse_large,
    refuse_unsolvable,
    warn_beyond,
)
from fpk_rocking.density.chain import Chain, ladder
from fpk_rocking.density.evolution import Evolution
from fpk_rocking.density.mesh import velocity_bound
from fpk_rocking.density.positive_start import NodeDeparture
from fpk_rocking.density.step import Dynamics
from fpk_rocking.scene import Scene

TIGHTEST = 3e-4
"""Least tolerance."""

MOST_NODES = 3_000_000
"""Most nodes times matrices kept, each of about 400 bytes."""

RATTLING = 0.5
"""Mass on the nodes around the origin above which a density counts as not resolved."""


def solve_positive(scene, *, cycles, tol=1e-3, progress=None):
    """Evolve the joint density of angle and velocity by a scheme that keeps it non-negative.

    Band noise is replaced by white noise of equal Melnikov variance, and the result's `closure` says so. Steps and mesh
    are refined until the difference from the solution before is below the tolerance, or memory ends it.

    Parameters
    ----------
    scene : Scene
        With white or band noise.
    cycles : int
        Forcing cycles to evolve.
    tol : float
        Wanted error in survival, from 3e-4 up; the binned density is wanted to `acceptance.bins_tolerance`.
    progress : callable, optional
        Called as ``progress(done, total)`` after each cycle of each solution; `total` grows when one is added.

    Returns
    -------
    Evolution
        Its density is bilinear in the cells of the mesh. `negative_mass` is that of all steps: 0. In `settings`,
        `excess_noise` is the variance that the mesh adds to the density in a step, at worst, over the velocity variance
        of the noise, and `origin_mass` the largest mass on the nodes around the origin.

    Warns
    -----
    RuntimeWarning
        The finest solution that memory allows is not within the tolerance by its own estimate.

    Raises
    ------
    TypeError, ValueError
        As `solve_fpk`; noise so weak that the mesh would not fit into two gigabytes is refused as well.
    """
    begin = time.perf_counter()
    checks.instance("scene", scene, Scene)
    cycles = checks.count("cycles", cycles)
    tol = checks.number("tol", tol, at_least=TIGHTEST)
    white = scene.white_equivalent()
    refuse_unsolvable(white)
    resolution, space, fine, errors = _refined(white, cycles, tol, Progress(progress, cycles, least=2))
    result = Evolution(
        scene=scene,
        diffusion=white.noise.diffusion,
        closure=closure_of(scene, white),
        tol=tol,
        survival=fine.inside,
        overturned=fine.gone[:, :2],
        lost=fine.gone[:, 2],
        error_estimate=errors[0],
        bins_error_estimate=errors[1],
        mass_defect=float(np.abs(fine.inside + fine.gone.sum(axis=1) - 1.0).max()),
        negative_mass=fine.negative,
        wall_s=time.perf_counter() - begin,
        settings=dataclasses.asdict(resolution)
        | {"unknowns": resolution.nodes, "velocity_bound": float(space.velocity_lines[-1])}
        | {"excess_noise": fine.excess, "origin_mass": fine.origin},
        coefficients=fine.coefficients,
        space=space,
    )
    _judge(result)
    return result


def _refined(white, cycles, tol, progress):
    """Climb the ladder until the errors are within the tolerance: resolution, space, solution and both errors."""
    bound = velocity_bound(white, white.noise.diffusion)
    rungs = ladder(white, bound)
    fitting = [rung for rung in rungs if rung.nodes * (rung.steps // 2 + 1) <= MOST_NODES]
    if len(fitting) < 2:
        accepted = f"noise for which fewer than {rungs[1].nodes:.1e} nodes do; solve_fpk() needs no such fine mesh"
        raise ValueError(checks.refusal("noise", f"white noise of D = {white.noise.diffusion:g}", accepted))
    refuse_large(0.0, 32.0 * fitting[1].nodes * (cycles + 1), cycles)
    departure, fine = NodeDeparture(Dynamics.of(white), white.start, white.period), None
    for resolution in fitting:
        coarse, chain = fine, Chain(white, resolution, bound)
        fine = chain.evolve(cycles, departure, progress.next())
        if coarse:
            survival, bins = np.abs(fine.inside - coarse.inside), np.abs(fine.bins - coarse.bins)[1:]
            errors = float(survival.max()), float(bins.sum(axis=(1, 2)).max())
            if errors[0] <= tol and errors[1] <= bins_tolerance(tol):
                break
    return resolution, chain.mesh.space, fine, errors


def _judge(result):
    """Refuse what is not resolved, and warn of what is not within the tolerance."""
    refuse_broken(result)
    if result.settings["origin_mass"] > RATTLING:
        accepted = (
            "a scene whose density a mesh can resolve; the nodes around the origin hold a mass of "
            f"{result.settings['origin_mass']:.1e}: the block rattles at rest (use simulate())"
        )
        raise ValueError(checks.refusal("scene", f"diffusion {result.diffusion:g}", accepted))
    warn_beyond(result, "solve_fpk()")
