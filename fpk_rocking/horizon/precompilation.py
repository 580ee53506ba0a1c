"""A least run that needs the kernels of the one-cycle operator; see `fpk_rocking.base.precompilation`."""

from fpk_rocking.horizon.operator import CycleOperator
from fpk_rocking.scene import Block, Harmonic, Overturning, Scene, Start, WhiteNoise


def operator():
    """Leading mode of a scene that is easy to resolve."""
    scene = Scene(
        block=Block(0.5),
        forcing=Harmonic(4.6, 2.7, 0.0),
        noise=WhiteNoise(0.05),
        start=Start(),
        overturning=Overturning(),
    )
    CycleOperator(scene, tol=1e-2).survival(1)
