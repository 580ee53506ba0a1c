"""A scene at one resolution, and the density that it evolves: one base, and a kind for each kind of scene."""

from fpk_rocking.density.run.base import Run
from fpk_rocking.density.run.filtered import FilteredRun
from fpk_rocking.density.run.periodic import PeriodicRun
from fpk_rocking.density.run.transient import TransientRun
from fpk_rocking.scene.scene import Scene

__all__ = ["FilteredRun", "PeriodicRun", "Run", "TransientRun", "kind_of"]


def kind_of(scene: Scene) -> type[PeriodicRun | TransientRun | FilteredRun]:
    """Return the kind of run that a scene needs, whose noise is white or filtered."""
    if scene.noise.kind == "filtered":
        return FilteredRun
    return PeriodicRun if scene.repeats else TransientRun
