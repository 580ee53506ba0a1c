"""The density of a scene, and beside it the paths that measure what the replacement of its noise changes."""

from typing import Any

from fpk_rocking.base import ahead, checks
from fpk_rocking.base.types import Progress
from fpk_rocking.density import Evolution, solve_fpk
from fpk_rocking.scene.scene import Scene
from montecarlo import simulate
from montecarlo.engines.choice import engine_of, task_of

PATHS, PATHS_OF_RECORDS = 40_000, 10_000
"""Paths of a check: over ten cycles of 100 harmonics .1 to .7 s on two cores, longest where blocks rest. In records
paths take up to a hundred times as long."""

SEED = 2
"""Another than that of `simulate`, so that an ensemble beside a check is independent of it."""


def solve_checked(scene: Scene, *, realizations: int | None = None, seed: int = SEED, **options: Any) -> Evolution:
    """Solve the Fokker-Planck equation of a scene, and measure what the replacement of its noise changes.

    `solve_fpk`, and where it replaced the noise, `checked`.

    Parameters
    ----------
    scene : Scene
    realizations, seed
        As for `checked`.
    **options
        The other parameters of `solve_fpk`; `progress` is called while the density is solved.

    Returns
    -------
    Evolution
        With `Evolution.replacement` where noise was replaced.

    Warns
    -----
    RuntimeWarning
        As `solve_fpk`.

    Raises
    ------
    TypeError, ValueError
        As `solve_fpk` and `checked`.

    Examples
    --------
    >>> from fpk_rocking import load_scene
    >>> from fpk_rocking.studies import solve_checked
    >>> density = solve_checked(load_scene("main"), cycles=4, tol=1e-2, realizations=1000)
    >>> print(f"{density.survival[4]:.2f} ± {density.total_error[4, 0]:.2f}")
    0.86 ± 0.03
    """
    realizations, seed = _asked(scene, realizations, seed)
    expect(scene)
    return checked(solve_fpk(scene, **options), realizations=realizations, seed=seed)


def checked(
    density: Any, *, realizations: int | None = None, seed: int = SEED, progress: Progress | None = None
) -> Any:
    """Sample the noise of a scene beside a density in which other noise replaced it.

    Parameters
    ----------
    density : Evolution
        One whose noise was solved as it is comes back as it is.
    realizations : int, optional
        Number of paths, at least 1. By default 40,000, and 10,000 in a record, where a path takes up to a hundred times
        as long.
    seed : int
        Seed of the paths.
    progress : callable, optional
        Called as ``progress(done, total)`` between batches of paths.

    Returns
    -------
    Evolution
        The same density with its ``replacement``.

    Raises
    ------
    TypeError, ValueError
        A parameter is refused.

    Examples
    --------
    >>> from fpk_rocking import load_scene, solve_fpk
    >>> from fpk_rocking.studies import checked
    >>> density = solve_fpk(load_scene("main"), cycles=4, tol=1e-2)
    >>> print(checked(density, realizations=1000).total_error[4].round(2))
    [0.03 0.01 0.03]
    """
    scene = density.scene
    realizations, seed = _asked(scene, realizations, seed)
    if not density.closure:
        return density
    rows = {"cycles": density.cycles} if scene.period else {"times": density.times[1:]}
    return density.checked(simulate(scene, **rows, realizations=realizations, seed=seed, progress=progress))


def expect(scene: Scene) -> None:
    """Say that the density of a scene will be checked: what that needs is compiled beside what solves for it."""
    if scene.noise.kind == "band":
        ahead.expect(task_of(engine_of(scene), scene))


def _asked(scene, realizations, seed):
    checks.instance("scene", scene, Scene)
    usual = PATHS_OF_RECORDS if scene.forcing.dimensional else PATHS
    realizations = usual if realizations is None else checks.count("realizations", realizations)
    return realizations, checks.count("seed", seed, at_least=0)
