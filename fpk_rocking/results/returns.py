"""Blocks that count as overturned and yet come back.

The default angle of overturning, π/2 critical angles, is passed before a block falls, and strong shaking can bring it
back from there. Monte Carlo follows some of the paths that pass it on to the fall, which is 90 degrees.
"""

import math

from fpk_rocking.base.checks import Array
from fpk_rocking.results.sampling import wilson_interval
from fpk_rocking.results.trust import CAUTION, Diagnostic
from fpk_rocking.scene.parts import Overturning
from fpk_rocking.scene.scene import Scene


def angle_of_fall(scene: Scene) -> float | None:
    """Return the angle, in critical angles, at which the block of a scene lies flat, 90 degrees.

    None where the critical angle is unknown, or where overturning is at another angle than the default, or not before
    the fall.
    """
    alpha, cutoff = scene.block.critical_angle, scene.overturning.angle
    before = cutoff == Overturning().angle and 0.0 < alpha * cutoff < 0.5 * math.pi
    return 0.5 * math.pi / alpha if before else None


def return_diagnostics(scene: Scene, overturned: float, error: float, returns: Array) -> list[Diagnostic]:
    """Return a caution if blocks that come back change a probability of overturning by more than its error.

    `overturned` and `error` are those at the last time; `returns` (2,) counts the paths that overturned and were
    followed to the fall, and those of them that came back. The list is empty where the lower limit (95 %) of the part
    that comes back is within the error.
    """
    followed, back = (int(count) for count in returns)
    if followed == 0:
        return []
    low, high = wilson_interval(back, followed).tolist()
    if overturned * low <= error:
        return []
    degrees = math.degrees(scene.block.critical_angle * scene.overturning.angle)
    limits = (
        "" if scene.deterministic else f" (95 %: {overturned * (1.0 - high):.2f} to {overturned * (1.0 - low):.2f})"
    )
    paths = "the one path" if followed == 1 else f"{back} of {followed} such paths"
    sentence = (
        f"A block counts as overturned here from {degrees:.0f}° on (π/2 critical angles, the default), but the shaking "
        f"brings blocks back from there: {paths} followed further did not fall. If the fall itself counted, "
        f"P(overturned) would be about {overturned * (1.0 - back / followed):.2f}{limits} in place of "
        f'{overturned:.2f}: take overturning_angle = "90 deg" (in a scene file overturning.angle_deg = 90).'
    )
    return [Diagnostic(CAUTION, sentence, "returns")]
