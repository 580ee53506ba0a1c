"""The scenes that an engine can carry: sizes that double precision resolves beside each other, without overflow.

A `Scene` may hold any finite numbers, and the analytics take them. An engine cannot: where the velocity is 1e17 times
the cut-off the rounding of an angle is larger than the strip, with a phase of 1e16 nothing is left of the time beside
it, and squares of 1e200 overflow. The bounds are far from anything that rocks, and everything within them was tried
(docs/reliability.md).
"""

import math
from typing import Any

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.physics.noise.filters import Filter

_RANGES = {
    "noise.variance": (0.0, 1e6),
    "noise.diffusion": (1e-12, 1e4),
    "noise.frequency": (1e-3, 1e4),
    "noise.envelope.rise": (1e-5, 1e5),
    "noise.envelope.hold": (1e-5, 1e5),
    "noise.envelope.decay": (1e-5, 1e5),
    "noise.envelope.peak": (1e-5, 1e5),
    "noise.envelope.times": (1e-5, 1e5),
    "noise.envelope.values": (0.0, 1e4),
    "start.angle": (1e-30, 1e4),
    "start.velocity": (1e-30, 1e4),
    "overturning.angle": (1e-2, 1e4),
}
"""Smallest and largest size by dotted name, those of the forcing left out; noise and start may be 0 as well."""

_HIGHEST, _TURNS, _HARMONICS = 1e4, 1e5, 100_000
_DAMPING, _RATE = (1e-3, 1e3), 1e4
_VARIANCES = 1e-24, 1e8
_ELASTIC, _SLOWEST = 1.0 - 1e-6, 1e-5


def check(scene: Any) -> None:
    """Refuse a scene that the engines cannot carry.

    Parameters
    ----------
    scene : Scene

    Raises
    ------
    TypeError
        Not a scene.
    ValueError
        A value is out of the engines' range; the message names it.
    """
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
    highest = min(_HIGHEST, _TURNS * frequency)
    if noise.band[1] > highest:
        accepted = f"frequencies up to {highest:g}, and up to {_TURNS:g} times that of the forcing{checks.ENGINES}"
        raise ValueError(checks.refusal("noise.band", noise.band, accepted))
    if noise.harmonics > _HARMONICS:
        raise ValueError(checks.refusal("noise.harmonics", noise.harmonics, f"up to {_HARMONICS}{checks.ENGINES}"))


def _check_filter(noise, frequency):
    low, high = _DAMPING
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
    if noise.space.fastest > _RATE * frequency:
        accepted = f"a filter whose fastest rate is up to {_RATE:g} times the forcing's frequency{checks.ENGINES}"
        raise ValueError(checks.refusal(name, value, accepted))


def _check_covariance(start):
    (xx, _), (_, vv) = start.covariance or ((_VARIANCES[0], 0.0), (0.0, _VARIANCES[0]))
    if not _VARIANCES[0] <= min(xx, vv) <= max(xx, vv) <= _VARIANCES[1]:
        accepted = f"variances from {_VARIANCES[0]:g} to {_VARIANCES[1]:g}, or none for a point{checks.ENGINES}"
        raise ValueError(checks.refusal("start.covariance", start.covariance, accepted))


def _check_bounces(scene):
    """Refuse an elastic block that bounces so slowly that following it would not end; white noise speeds it up."""
    start = scene.start
    (xx, _), (_, vv) = start.covariance or ((0.0, 0.0), (0.0, 0.0))
    speed = math.hypot(abs(start.velocity) + math.sqrt(vv), math.sqrt(2.0 * (abs(start.angle) + math.sqrt(xx))))
    if 0.0 < speed < _SLOWEST and scene.block.restitution > _ELASTIC:
        name = "start.velocity" if start.velocity else "start.angle"
        accepted = (
            f"0, or a start that leads to impacts of speed {_SLOWEST:g} or more: at the restitution "
            f"{scene.block.restitution!r} a slower block bounces practically without end"
        )
        raise ValueError(checks.refusal(name, start.velocity or start.angle, accepted))
