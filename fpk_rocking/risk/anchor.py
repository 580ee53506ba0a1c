"""What keeps a block from rocking, by statics: the friction up to which it slides, lift-off, and a tie that holds it.

A block that a tie keeps on its base has the acceleration a of the base. About the corner that it would turn on, with
the weight W, the height h of the centre of mass and its distance b from the corner, the moment M = W (h a/g - b) is
left to the tie where it is above 0: a horizontal force M/H at the height H, or a tension M/B at the other edge, at the
distance B. This is exact for a rigid tie without slack, and a bound for the motion as its largest |a| counts in both
directions. If a tie stretches or has slack, the block begins to rock, and the force may be larger.
"""

import math
from typing import NamedTuple

from fpk_rocking.base import checks
from fpk_rocking.base.checks import not_none
from fpk_rocking.scene.parts import Block
from fpk_rocking.scene.units import STANDARD_GRAVITY


class Hold(NamedTuple):
    """Force of a tie that keeps a block on its base, in units of the block's weight; 0 where none is needed.

    Parameters
    ----------
    top : float
        Horizontal force at the top of a rectangle, or at the height of the centre of a `Body`.
    edge : float
        Vertical tension at the edge about which the block does not turn.
    """

    top: float
    edge: float


def hold(block: Block, acceleration: float) -> Hold:
    """Return the `Hold` of a block under a peak acceleration of its base.

    Parameters
    ----------
    block : Block
        A block with a size.
    acceleration : float
        Peak acceleration, m/s², 0 or more.

    Raises
    ------
    TypeError, ValueError
        The acceleration is not a number from 0 on, or the block has no size.

    Examples
    --------
    >>> from fpk_rocking import Block, Dimensions
    >>> from fpk_rocking.risk import hold
    >>> print(hold(Block(dimensions=Dimensions(width=0.5, height=2.0)), 0.5 * 9.80665))
    Hold(top=0.125, edge=0.5)
    """
    acceleration = checks.number("acceleration", acceleration, at_least=0.0)
    if block.size is None:
        raise ValueError(checks.refusal("block", block, "one with a size, as of Scene.from_block"))
    if block.body is None:
        size = not_none(block.dimensions)
        centre, arm, width, top = 0.5 * size.height, 0.5 * size.width, size.width, size.height
    else:
        body = block.body
        centre, arm, width, top = (
            body.height_of_centre,
            min(body.left, body.right),
            body.left + body.right,
            body.height_of_centre,
        )
    moment = max(centre * acceleration / not_none(block.size).gravity - arm, 0.0)
    return Hold(moment / top, moment / width)


def lift_off_g(block: Block) -> float:
    """Peak acceleration of the base, g, up to which a block with a size stays at rest; nan without a size."""
    size = block.size
    unit = math.nan if size is None else size.gravity * size.critical_angle
    return block.lift_off * unit / STANDARD_GRAVITY
