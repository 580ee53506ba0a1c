"""Ranges of the values of a scene: those that an engine can carry, and those that were hardly meant.

A `Scene` may hold any finite numbers, and the analytics take them. An engine cannot: where the velocity is 1e17 times
the cut-off the rounding of an angle is larger than the strip, with a phase of 1e16 nothing is left of the time beside
it, and squares of 1e200 overflow. The bounds are far from anything that rocks, and everything within them was tried
(docs/reliability.md). Sizes that are possible but hardly meant get a remark, and are not refused (`implausible`).
"""

import math
from typing import Any

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.physics.forcing.record import Record
from fpk_rocking.physics.noise.filters import Filter
from fpk_rocking.scene.parts import LENGTHS, Block
from fpk_rocking.scene.units import STANDARD_GRAVITY

_RANGES = {
    "noise.variance": (0.0, 1e6),
    "noise.diffusion": (1e-12, 1e4),
    "noise.frequency": (1e-3, 1e4),
    **dict.fromkeys((f"noise.envelope.{name}" for name in ("rise", "hold", "decay", "peak", "times")), (1e-5, 1e5)),
    "noise.envelope.values": (0.0, 1e4),
    "start.angle": (1e-30, 1e4),
    "start.velocity": (1e-30, 1e4),
    "overturning.angle": (1e-2, 1e4),
}
"""Smallest and largest size by dotted name, those of the forcing left out; noise and start may be 0 as well."""


def check(scene: Any) -> None:
    """Raise TypeError or ValueError, which names the value, for a scene that the engines cannot carry."""
    scene.forcing.check_range()
    for name, (low, high) in _RANGES.items():
        values: Any = scene
        for field in name.split("."):
            values = getattr(values, field, ())
        checks.sizes(name, values, low, high, or_none=name.startswith(("noise.", "start.")))
    if scene.noise.kind == "band":
        _check_band(scene.noise, 2.0 * math.pi / scene.forcing.time_scale)
    if scene.noise.kind == "filtered":
        _check_filter(scene.noise, 2.0 * math.pi / scene.forcing.time_scale)
    _check_covariance(scene.start)
    if scene.noise.kind != "white":
        _check_bounces(scene)


def _check_band(noise, frequency):
    """Raise ValueError for frequencies above 1e4 or 1e5 times that of the forcing, or over 100,000 harmonics."""
    highest = min(1e4, 1e5 * frequency)
    if noise.band[1] > highest:
        accepted = f"frequencies up to {highest:g}, and up to 100000 times that of the forcing{checks.ENGINES}"
        raise ValueError(checks.refusal("noise.band", noise.band, accepted))
    if noise.harmonics > 100_000:
        raise ValueError(checks.refusal("noise.harmonics", noise.harmonics, f"up to 100000{checks.ENGINES}"))


def _check_filter(noise, frequency):
    """Raise ValueError for rates or damping not resolved, or a rate above 1e4 times the forcing's frequency."""
    low, high = 1e-3, 1e3
    if noise.damping is not None and not low <= noise.damping <= high:
        raise ValueError(checks.refusal("noise.damping", noise.damping, f"from {low:g} to {high:g}{checks.ENGINES}"))
    name, value = "noise.frequency", noise.frequency
    if isinstance(noise.filter, Filter):
        name, value, rates = "noise.filter", str(noise.filter), noise.space.rates
        slowest, highest = _RANGES["noise.frequency"]
        sizes = np.abs(rates)
        if not (slowest <= sizes.min() and sizes.max() <= highest and (-rates.real / sizes).min() >= low):
            accepted = f"eigenvalues of sizes from {slowest:g} to {highest:g} that decay by {low:g} of their size"
            raise ValueError(checks.refusal(name, value, accepted + checks.ENGINES))
    if noise.space.fastest > 1e4 * frequency:
        accepted = f"a filter whose fastest rate is up to 10000 times the forcing's frequency{checks.ENGINES}"
        raise ValueError(checks.refusal(name, value, accepted))


def _check_covariance(start):
    """Raise ValueError for a start with a variance beyond 1e-24 to 1e8."""
    if start.covariance is None:
        return
    low, high = 1e-24, 1e8
    (xx, _), (_, vv) = start.covariance
    if not low <= min(xx, vv) <= max(xx, vv) <= high:
        accepted = f"variances from {low:g} to {high:g}, or none for a point{checks.ENGINES}"
        raise ValueError(checks.refusal("start.covariance", start.covariance, accepted))


def _check_bounces(scene):
    """Raise ValueError for an elastic block that starts so slowly that following its bounces has no end.

    White noise is left out, as it speeds the block up.
    """
    start = scene.start
    (xx, _), (_, vv) = start.covariance or ((0.0, 0.0), (0.0, 0.0))
    speed = math.hypot(abs(start.velocity) + math.sqrt(vv), math.sqrt(2.0 * (abs(start.angle) + math.sqrt(xx))))
    slowest = 1e-5
    if 0.0 < speed < slowest and min(scene.block.restitution_by_side) > 1.0 - 1e-6:
        name = "start.velocity" if start.velocity else "start.angle"
        accepted = (
            f"0, or a start that leads to impacts of speed {slowest:g} or more: at the restitution "
            f"{scene.block.restitution!r} a slower block bounces practically without end"
        )
        raise ValueError(checks.refusal(name, start.velocity or start.angle, accepted))


_LARGEST_PHASE = 20.0
"""Phase, in radians, beyond which degrees may have been meant: three turns."""


_LARGEST_ANGLE = 20.0
"""Angle of overturning, in critical angles, beyond which degrees may have been meant."""


def implausible(scene: Any, least: float = 1.0, most: float = 1.0) -> list[str]:
    """Return sentences on sizes and accelerations of a scene that were hardly meant: metres for mm, m/s² for g.

    The shaking is multiplied by factors from `least` to `most`. Of a block without a size the phase alone is judged.
    """
    size, phase = scene.block.size, getattr(scene.forcing, "phase", 0.0)
    turns = f"forcing.phase is {phase:g} rad; was {math.radians(phase):.4g} meant ({phase:g} degrees)?"
    sentences = [turns] * bool(abs(phase) > _LARGEST_PHASE)
    # Where the critical angle is known, angles far beyond 90 degrees are refused.
    if scene.overturning.angle > _LARGEST_ANGLE and not scene.block.critical_angle:
        sentences.append(
            f"overturning.angle is {scene.overturning.angle:g} times the critical angle; were degrees meant?"
        )
    if size is None:
        return sentences
    sentences += implausible_sizes(scene.block)
    unit = size.gravity * size.critical_angle
    noise = _noise_rms(scene.noise) * unit
    # The strongest recorded accelerations are below 4.5 g.
    strongest, weakest = 5.0 * STANDARD_GRAVITY, 0.1 * STANDARD_GRAVITY
    forcing, weak = scene.forcing, True
    value = least * forcing.largest * unit
    if isinstance(forcing, Record):
        # Factors of a record, and a velocity that is that of a drift, say nothing of how its numbers were meant.
        sentences += forcing.implausible
        weak = forcing.drift.pga < weakest and not forcing.drifts
    elif strongest < value < math.inf:
        meant = f"was {1e-2 * value:.4g} m/s² meant (cm/s²)?"
        sentences.append(f"The peak acceleration of the forcing is {_in_both_units(value)}; {meant}")
    if strongest < least * noise < math.inf:
        value = least * noise
        sentences.append(f"The rms of the noise is {_in_both_units(value)}; was {1e-2 * value:.4g} m/s² meant (cm/s²)?")
    peak, needed = most * scene.forcing.largest * unit, scene.block.lift_off * unit
    if scene.start.at_rest and weak and 0.0 < peak < weakest and peak + 3.0 * most * noise < needed:
        sentences.append(
            f"The peak acceleration of the forcing is {_in_both_units(peak)}, and this block lifts off above "
            f"{_in_both_units(needed)}: it does not move. Was {peak:.4g} g meant?"
        )
    return sentences


def implausible_sizes(block: Block) -> list[str]:
    """Return sentences on sizes of a block that were hardly meant; none of a block without a size."""
    kind, names = ("body", LENGTHS) if block.body else ("dimensions", ("width", "height"))
    sentences = []
    for name in names if block.size else ():
        value = getattr(block.size, name)
        if not 0.005 <= value <= 100.0:
            others = (1e3 * value,) if value < 0.005 else (1e-2 * value, 1e-3 * value)
            other = " or ".join(f"{meant:g} m" for meant in others if 0.05 <= meant <= 5.0) or f"{others[0]:g} m"
            sentences.append(f"block.{kind}.{name} is {value:g} m; was {other} meant?")
    if block.body and not sentences:
        radius = block.body.radius_of_gyration
        corner = math.hypot(block.body.height_of_centre, max(block.body.left, block.body.right))
        # Of a rectangle it is .58 times that distance, of a ring that stands on its lowest point once.
        if radius > 3.0 * corner:
            times = f"{radius / corner:.2g} times the distance of the centre of mass from the farther corner"
            sentences.append(f"block.body.radius_of_gyration is {radius:g} m, {times}; is it the moment of inertia?")
        if radius < 0.2 * corner:
            part = "less than a fifth of the distance of the centre of mass from the farther corner"
            sentences.append(f"block.body.radius_of_gyration is {radius:g} m, {part}; was {1e2 * radius:g} m meant?")
    return sentences


def _noise_rms(noise):
    """Return the root mean square of a noise; inf for white noise."""
    if noise.kind == "white":
        return math.inf if noise.diffusion > 0.0 else 0.0
    return math.sqrt(noise.variance)


def _in_both_units(acceleration):
    """Return an acceleration, m/s², as a text in m/s² and in g."""
    return f"{acceleration:.4g} m/s² ({acceleration / STANDARD_GRAVITY:.2g} g)"
