"""The Monte Carlo engines, which integrate the realizations of a scene; listed here, and chosen for a scene.

`engine` says what an engine is and has the loop over time; `batches` checks the parameters of a run and yields its
realizations; `random` has their random numbers. An engine is a file: `exact_slender`, `exact_enveloped` and
`exact_block` (with `exact`, what they share) and `rk4`, for band noise or none (`band_noise`); `white` (with
`barriers`); `filtered`. `walkers` has the kernels of `montecarlo.splitting`.
"""

from fpk_rocking.base import checks
from fpk_rocking.physics.forcing import refuse_vertical
from montecarlo.engines import exact_block, exact_enveloped, exact_slender, filtered, rk4, white

ENGINES = tuple(module.ENGINE for module in (exact_slender, exact_enveloped, exact_block, rk4, white, filtered))
"""All engines. Of those that take a scene the first is the default; those of one method take different scenes."""


def engines_for(scene, method=None):
    """Return the engines, of a method or of any, that take a scene, the default first; maybe none."""
    return [engine for engine in ENGINES if engine.takes(scene) and method in (None, engine.method)]


def engine_of(scene, method=None):
    """Return the engine that simulates a scene by a method, by default the first that fits; ValueError for none."""
    engines = engines_for(scene, method)
    if engines:
        return engines[0]
    methods = dict.fromkeys(engine.method for engine in ENGINES)
    if scene.noise.kind in {"white", "filtered"}:
        refuse_vertical(scene.forcing, f"paths under {scene.noise.kind} noise")
    if not isinstance(method, str) or method not in methods:
        accepted = ", ".join(map(repr, methods)) + " or None (the first that fits the noise)"
        raise ValueError(checks.refusal("method", method, accepted))
    names = dict.fromkeys(repr(engine.method) for engine in engines_for(scene))
    accepted = f"{' or '.join(names)} for noise of kind {scene.noise.kind!r}"
    if method in {"white", "filtered"}:
        accepted += f"; {method!r} needs {method} noise, which scene.{method}_equivalent() makes of this one"
    raise ValueError(checks.refusal("method", method, accepted))
