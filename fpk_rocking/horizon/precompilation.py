"""A least run that needs the kernels of the one-cycle operator; see `fpk_rocking.base.precompilation`."""

from fpk_rocking.density.precompilation import SCENE
from fpk_rocking.horizon.operator import CycleOperator


def operator():
    """Leading mode of a scene that is easy to resolve."""
    CycleOperator(SCENE, tol=1e-2).survival(1)
