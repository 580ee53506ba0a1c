"""The Monte Carlo engines, which integrate the realizations of a scene.

`engine` says what an engine is, and has the loop over time that all of them share; `batches` checks the parameters of a
run and yields its realizations; `random` has the random numbers of each. The engines are `exact` and `rk4`, for band
noise or none (`band_noise`), `white` (with `barriers`), and `filtered` (`filtered_noise`). This module lists them and
chooses one for a scene. `walkers` has the kernels of `montecarlo.splitting`.
"""

from fpk_rocking.base import checks, precompilation
from montecarlo.engines import exact, filtered, rk4, white

ENGINES = exact.SLENDER, exact.ENVELOPED, exact.EXACT_BLOCK, rk4.ENGINE, white.ENGINE, filtered.ENGINE
"""All engines. Of those that take a scene the first is the default; those of one method take different scenes."""


def engines_for(scene, method=None):
    """Return a list of the `Engine` objects that take a `Scene`, the default first.

    `method`: a name, as "exact", to which they are restricted, or None for all; the list may be empty.
    """
    return [engine for engine in ENGINES if engine.takes(scene) and method in (None, engine.method)]


def engine_of(scene, method=None):
    """Return the `Engine` that simulates a `Scene` by a `method`, a name as "exact"; None: by the first that fits.

    Raises
    ------
    ValueError
        There is no such method, or it does not take the scene.
    """
    engines = engines_for(scene, method)
    if engines:
        return engines[0]
    methods = dict.fromkeys(engine.method for engine in ENGINES)
    if not isinstance(method, str) or method not in methods:
        accepted = ", ".join(map(repr, methods)) + " or None (the first that fits the noise)"
        raise ValueError(checks.refusal("method", method, accepted))
    names = dict.fromkeys(repr(engine.method) for engine in engines_for(scene))
    accepted = f"{' or '.join(names)} for noise of kind {scene.noise.kind!r}"
    if method in {"white", "filtered"}:
        accepted += f"; {method!r} needs {method} noise, which scene.{method}_equivalent() makes of this one"
    raise ValueError(checks.refusal("method", method, accepted))


def task_of(engine, scene):
    """Return the task that compiles `engine`, an `Engine`, for the block of a `Scene`: a text "module:function".

    `fpk_rocking.base.precompilation` takes such texts.
    """
    return precompilation.task_for_block(f"fpk_rocking.least_runs:{engine.task}", scene)
