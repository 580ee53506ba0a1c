"""The engines there are, which of them simulates a scene, and what it compiles before."""

from fpk_rocking.base import ahead, checks
from montecarlo.engines import enveloped, exact, filtered, nonlinear, rk4, white

ENGINES = exact, enveloped, nonlinear, rk4, white, filtered
"""All engines. Of those that take a scene the first is the default; those of one method take different scenes."""

METHODS = tuple(dict.fromkeys(engine.METHOD for engine in ENGINES))
"""Names of the methods that a user may ask for."""


def fitting(scene, method=None):
    """Return the engines that take a scene, of one method or of any, the default first."""
    return [engine for engine in ENGINES if engine.takes(scene) and method in (None, engine.METHOD)]


def engine_of(scene, method=None):
    """Return the engine, a module, that simulates a scene by a method, or by the first that fits.

    Raises
    ------
    ValueError
        There is no such method, or it does not take the scene.
    """
    found = fitting(scene, method)
    if found:
        return found[0]
    if not isinstance(method, str) or method not in METHODS:
        accepted = ", ".join(map(repr, METHODS)) + " or None (the first that fits the noise)"
        raise ValueError(checks.refusal("method", method, accepted))
    names = dict.fromkeys(repr(engine.METHOD) for engine in fitting(scene))
    accepted = f"{' or '.join(names)} for noise of kind {scene.noise.kind!r}"
    if method in {"white", "filtered"}:
        accepted += f"; {method!r} needs {method} noise, which scene.{method}_equivalent() makes of this one"
    raise ValueError(checks.refusal("method", method, accepted))


def task_of(engine, scene):
    """Return the task of `fpk_rocking.base.ahead` that compiles an engine for a scene."""
    return ahead.of_block(f"montecarlo.ahead:{engine.__name__.rpartition('.')[2]}", scene)
