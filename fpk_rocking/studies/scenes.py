"""Scenes of a study: scaled shaking, blocks of another size, grids over parameters.

All of it is a change of the scene's numbers. A base acceleration a enters as a/(g θ_cr) and a frequency as ω/p
(docs/theory.md, section 1), so a block of another size has other numbers under the same shaking.
"""

import dataclasses
import difflib
import itertools
import math
from collections.abc import Mapping
from typing import Any, NamedTuple

from fpk_rocking.base import checks
from fpk_rocking.base.checks import ArrayLike
from fpk_rocking.scene.parts import LENGTHS, Block, Start
from fpk_rocking.scene.scene import Scene
from fpk_rocking.scene.text import fields_of
from fpk_rocking.scene.units import Dimensions

SIZES = "width", "height", "size", "slenderness"
"""Names of the parameters of a rectangle that `varied` takes beside dotted names."""


class Grid(NamedTuple):
    """Scenes of all combinations of some parameters, as `grid` returns them.

    Parameters
    ----------
    scenes : tuple of Scene
        The last axis changes fastest.
    axes : dict of str to tuple of float
        Values of each parameter by name.
    """

    scenes: tuple[Scene, ...]
    axes: dict[str, tuple[float, ...]]

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of values of each parameter, in the order of `axes`."""
        return tuple(len(values) for values in self.axes.values())

    def parameters(self, number: int) -> dict[str, float]:
        """Return the parameters of one scene by name.

        Parameters
        ----------
        number : int
            Place in `scenes`, from 0.
        """
        values = next(itertools.islice(itertools.product(*self.axes.values()), number, None))
        return dict(zip(self.axes, values, strict=True))


def grid(scene: Scene, axes: Mapping[str, ArrayLike]) -> Grid:
    """Return the scenes of all combinations of some parameters.

    Parameters
    ----------
    scene : Scene
    axes : dict of str to sequence of float
        Values of each parameter by name, as `varied` takes it; set in this order.

    Examples
    --------
    >>> from fpk_rocking import load_scene
    >>> from fpk_rocking.studies import grid
    >>> cells = grid(load_scene("main"), {"forcing.amplitude": [4.2, 4.6], "noise.variance": [0.01, 0.04]})
    >>> print(cells.shape, cells.parameters(2))
    (2, 2) {'forcing.amplitude': 4.6, 'noise.variance': 0.01}
    """
    checks.instance("scene", scene, Scene)
    if not isinstance(axes, Mapping) or not axes:
        raise TypeError(checks.refusal("axes", axes, 'a dict such as {"forcing.amplitude": [3.0, 4.0]}'))
    lists = {name: checks.several(f"axes[{name!r}]", values, most=100_000) for name, values in axes.items()}
    scenes = [scene]
    for name, values in lists.items():
        scenes = [varied(changed, name, value) for changed in scenes for value in values]
    return Grid(tuple(scenes), lists)


def varied(scene: Scene, name: str, value: Any) -> Scene:
    """Return a scene with one parameter changed.

    Parameters
    ----------
    scene : Scene
    name : str
        A dotted name of a scene file, such as "noise.variance"; "scale", a factor of forcing and noise (`scaled`); or,
        for another block under the same shaking (`resized`), "width", "height" or "size" (the half diagonal R), all in
        metres, or "slenderness" (height over width at the same R); of a body "height_of_centre", "right", "left" or
        "radius_of_gyration".
    value : float or (float, float)
        Two for the restitution of a body.

    Examples
    --------
    >>> from fpk_rocking import Scene
    >>> from fpk_rocking.studies.scenes import varied
    >>> rack = varied(Scene.from_block(0.5, 1.8, "0.3 g", "1.5 Hz"), "height", 2.4)
    >>> print(rack.block.dimensions.height, f"{rack.block.critical_angle:.3f}")
    2.4 0.205
    """
    part, _, field = str(name).partition(".")
    if name == "scale":
        return scaled(scene, value)
    if name in SIZES:
        size = dimensions_of(scene, name)
        value = checks.number(name, value, above=0.0)
        if name in {"width", "height"}:
            return resized(scene, **{name: value})
        radius, slenderness = size.half_diagonal, size.height / size.width
        radius, slenderness = (value, slenderness) if name == "size" else (radius, value)
        width = 2.0 * radius / math.hypot(1.0, slenderness)
        return resized(scene, width=width, height=slenderness * width)
    if name in LENGTHS:
        if scene.block.body is None:
            accepted = "only where the scene has [block.body]; this one has none"
            raise ValueError(checks.refusal("parameter", name, accepted))
        return _with_size(scene, dataclasses.replace(scene.block.body, **{name: value}))
    if part not in {"block", "forcing", "noise", "start", "overturning"} or not field:
        names = ", ".join(map(repr, (*SIZES, *LENGTHS)))
        accepted = f"a dotted name of a scene file such as 'forcing.amplitude', 'scale', {names}{meant(scene, name)}"
        raise ValueError(checks.refusal("parameter", name, accepted))
    integer = isinstance(getattr(getattr(scene, part), field, None), int) and float(value).is_integer()
    return scene.varied(**{part: {field: int(value) if integer else value}})


def meant(scene: Scene, field: str, suffix: str = "") -> str:
    """Return "; did you mean PART.FIELD?" where a part of a scene has this field, with a suffix; else an empty text."""
    names = [f"{part}.{field}{suffix}" for part, values in fields_of(scene).items() if field in fields_of(values)]
    names += [f"{name}{suffix}" for name in difflib.get_close_matches(field, (*SIZES, *LENGTHS), n=1)]
    return f"; did you mean {names[0]}?" if names else ""


def scaled(scene: Scene, factor: float, *, noise: bool = True) -> Scene:
    """Return a scene with the acceleration of the base multiplied by a factor above 0.

    Parameters
    ----------
    scene : Scene
    factor : float
    noise : bool
        Whether the noise is multiplied too: its variance, or diffusion, by the square.

    Examples
    --------
    >>> from fpk_rocking import load_scene
    >>> from fpk_rocking.studies import scaled
    >>> strong = scaled(load_scene("main"), 2.0)
    >>> print(strong.forcing.amplitude, round(strong.noise.variance, 2))
    9.2 0.16
    """
    factor = checks.number("factor", factor, above=0.0)
    shaken = scene.noise.scaled(factor, 1.0) if noise else scene.noise
    return dataclasses.replace(scene, forcing=scene.forcing.scaled(factor, 1.0), noise=shaken)


def resized(scene: Scene, *, width: float | None = None, height: float | None = None) -> Scene:
    """Return the scene of a block of another size under the same shaking in m/s² and Hz.

    The start keeps its radians and seconds, the overturning angle its value in units of θ_cr. A restitution that was
    Housner's for the old block becomes Housner's for the new one; any other is kept.

    Parameters
    ----------
    scene : Scene
        Of a block with dimensions.
    width, height : float, optional
        New full width and height, metres; what is left out is kept.

    Examples
    --------
    >>> from fpk_rocking import Scene
    >>> from fpk_rocking.studies import resized
    >>> from fpk_rocking.risk import intensities
    >>> rack = Scene.from_block(0.5, 1.8, "0.3 g", "1.5 Hz")
    >>> tall = resized(rack, height=2.4)
    >>> print(f"{rack.forcing.amplitude:.3f} {tall.forcing.amplitude:.3f}, PGA {intensities(tall).pga:.2f} m/s²")
    1.107 1.461, PGA 2.94 m/s²
    """
    old = dimensions_of(scene, "width" if width is not None else "height")
    new = Dimensions(old.width if width is None else width, old.height if height is None else height, old.gravity)
    return _with_size(scene, new)


def _with_size(scene, new):
    """Return the scene of a block of a new size, `Dimensions` or `Body`, under the same shaking (`resized`)."""
    block, start = scene.block, scene.start
    old, own = block.size, block.restitution
    angle = old.critical_angle / new.critical_angle
    rate = old.frequency_parameter / new.frequency_parameter
    try:
        lawful = own == old.restitution
    except ValueError:  # so squat a block has none
        lawful = False
    covariance = start.covariance
    if covariance is not None:
        (xx, xv), (_, vv) = covariance
        xv *= angle**2 * rate
        covariance = (xx * angle**2, xv), (xv, vv * (angle * rate) ** 2)
    sizes = {"dimensions": new} if isinstance(new, Dimensions) else {"body": new}
    # What is in seconds takes the size of the scene's block by itself.
    forcing = scene.forcing
    return dataclasses.replace(
        scene,
        block=Block(new.restitution if lawful else own, slender=block.slender, **sizes),
        forcing=forcing if forcing.dimensional else forcing.scaled(angle, rate),
        noise=scene.noise.scaled(angle, rate),
        start=Start(start.angle * angle, start.velocity * angle * rate, covariance),
    )


def dimensions_of(scene: Scene, name: str) -> Dimensions:
    """Return the dimensions of a scene's block; ValueError where it has none, for the parameter `name`."""
    if scene.block.dimensions is None:
        accepted = "only where the scene has [block.dimensions], a rectangle; this one has none"
        raise ValueError(checks.refusal("parameter", name, accepted))
    return scene.block.dimensions


def checked_scenes(name: str, scenes: Any) -> tuple[Scene, ...]:
    """Return one or more scenes as a tuple; anything else is refused as the parameter `name`."""
    accepted = "one or more scenes"
    scenes = checks.sequence(name, scenes, accepted)
    if not scenes:
        raise ValueError(checks.refusal(name, scenes, accepted))
    return tuple(checks.instance(f"{name}[{number}]", scene, Scene) for number, scene in enumerate(scenes))
