"""Block, noise, start and overturning of a scene, each checked when it is made (forcing: `physics.forcing`)."""

import dataclasses
import math
from typing import ClassVar, Literal, Self

from fpk_rocking.base import checks
from fpk_rocking.base.types import known
from fpk_rocking.physics.motion import lift_off
from fpk_rocking.physics.noise.envelope import ENVELOPES, Exponential, Table, Trapezoid
from fpk_rocking.physics.noise.filters import FILTERS, Filter
from fpk_rocking.physics.noise.state_space import StateSpace
from fpk_rocking.scene.units import Dimensions

_AS_MEASURED = 1e-3
"""Relative difference from the dimensions that a given critical angle may have."""


def _set(value, name, checked):
    object.__setattr__(value, name, checked)


@dataclasses.dataclass(frozen=True, slots=True)
class Block:
    """A rigid rocking block.

    Parameters
    ----------
    restitution : float, optional
        Velocity after an impact over that before it, from 0 to 1 (paper eq. 3). By default it follows from the
        dimensions, `Dimensions.restitution`.
    dimensions : Dimensions, optional
        Size of the block, for conversions to units. A record, a default restitution and a default critical angle need
        it.
    critical_angle : float, optional
        Critical angle α of the equation of motion, radians, from 0 to π/2. By default that of the
        dimensions, which a given one must match to 1e-3; without dimensions 0, the limit of a slender block (paper).
    slender : bool
        Take the equation of a slender block in spite of the dimensions: the critical angle is 0.

    Examples
    --------
    >>> from fpk_rocking import Block, Dimensions
    >>> block = Block(dimensions=Dimensions(width=0.5, height=1.8))
    >>> print(f"{block.restitution:.3f} {block.critical_angle:.3f} {block.least_friction:.3f}")
    0.893 0.271 0.278
    """

    restitution: float = None  # type: ignore[assignment]  # None until it follows from the dimensions
    dimensions: Dimensions | None = None
    critical_angle: float = None  # type: ignore[assignment]  # likewise
    slender: bool = False

    def __post_init__(self):
        if self.dimensions is not None:
            checks.instance("block.dimensions", self.dimensions, Dimensions)
        if self.restitution is None:
            if self.dimensions is None:
                raise ValueError("block.restitution: missing, required without block.dimensions")
            _set(self, "restitution", self.dimensions.restitution)
        _set(self, "restitution", checks.number("block.restitution", self.restitution, at_least=0.0, at_most=1.0))
        checks.instance("block.slender", self.slender, bool)
        own = 0.0 if self.dimensions is None or self.slender else self.dimensions.critical_angle
        given = own if self.critical_angle is None else self.critical_angle
        angle = checks.number("block.critical_angle", given, at_least=0.0, at_most=0.5 * math.pi)
        if angle != own and (self.slender or (self.dimensions and abs(angle - own) > _AS_MEASURED * own)):
            accepted = f"{own!r}, as block.{'slender' if self.slender else 'dimensions'} says, or nothing"
            raise ValueError(checks.refusal("block.critical_angle", angle, accepted))
        _set(self, "critical_angle", angle)

    @property
    def lift_off(self) -> float:
        """Largest nondimensional force |f| under which the block stays at rest: tan(α)/α, 1 for a slender block."""
        return lift_off(self.critical_angle)

    @property
    def least_friction(self) -> float | None:
        """Friction coefficient below which the block slides before it lifts off: tan α, width over height.

        None for a slender block without dimensions.
        """
        angle = self.critical_angle or (self.dimensions.critical_angle if self.dimensions else 0.0)
        return math.tan(angle) if angle > 0.0 else None


def _check_envelope(envelope):
    if envelope is not None:
        checks.instance("noise.envelope", envelope, *ENVELOPES.values())


def _scaled(noise, rate, **changed):
    """Return a noise with some values changed, and the times of its envelope divided by a rate."""
    if noise.envelope is not None:
        changed["envelope"] = noise.envelope.faster(rate)
    return dataclasses.replace(noise, **changed)


HARMONICS = 100
"""Harmonics of band noise, unless given."""


@dataclasses.dataclass(frozen=True, slots=True)
class BandNoise:
    """Shinozuka noise: harmonics with random frequencies in a band and random phases (paper eq. 4).

    Parameters
    ----------
    variance : float
        Variance σ², nondimensional, at least 0.
    band : (float, float)
        Lowest and highest angular frequency, nondimensional, 0 <= lowest < highest.
    harmonics : int
        Number N of harmonics, at least 1.
    remark : str
        A sentence that is shown with every result, for example that these values are assumed. It does not count when
        noises are compared.
    envelope : Trapezoid, Exponential or Table, optional
        Function of time g(τ) by which the noise is multiplied. By default the noise is stationary.

    Examples
    --------
    >>> from fpk_rocking import BandNoise, load_scene
    >>> noise = BandNoise(variance=0.04, band=(0.0, 5.0), harmonics=100)
    >>> print(f"{load_scene('main').varied(noise=noise).white_equivalent().noise.diffusion:.4f}")
    0.0125
    """

    kind: ClassVar[Literal["band"]] = "band"
    variance: float
    band: tuple[float, float]
    harmonics: int = HARMONICS
    remark: str = dataclasses.field(default="", compare=False)
    envelope: Trapezoid | Exponential | Table | None = None

    def __post_init__(self):
        _set(self, "variance", checks.number("noise.variance", self.variance, at_least=0.0))
        _set(self, "band", checks.interval("noise.band", self.band))
        _set(self, "harmonics", checks.count("noise.harmonics", self.harmonics))
        _check_envelope(self.envelope)
        _set(self, "remark", checks.sentence("noise.remark", self.remark))

    def scaled(self, strength: float, rate: float) -> Self:
        """Return the noise with accelerations and frequencies multiplied by factors."""
        band = tuple(rate * one for one in self.band)
        return _scaled(self, rate, variance=self.variance * strength**2, band=band)


@dataclasses.dataclass(frozen=True, slots=True)
class WhiteNoise:
    """White noise η with ⟨η(τ)η(τ')⟩ = 2Dδ(τ - τ').

    Parameters
    ----------
    diffusion : float
        Diffusion D, nondimensional, at least 0.
    envelope : Trapezoid, Exponential or Table, optional
        Function of time g(τ) by which the noise is multiplied. By default the noise is stationary.

    Examples
    --------
    >>> from fpk_rocking import WhiteNoise, load_scene
    >>> from montecarlo import simulate
    >>> scene = load_scene("main").varied(noise=WhiteNoise(diffusion=0.02))
    >>> print(simulate(scene, cycles=4, realizations=1000).survival.round(2))
    [1.   1.   0.95 0.78 0.64]
    """

    kind: ClassVar[Literal["white"]] = "white"
    remark: ClassVar[str] = ""
    diffusion: float
    envelope: Trapezoid | Exponential | Table | None = None

    def __post_init__(self):
        _set(self, "diffusion", checks.number("noise.diffusion", self.diffusion, at_least=0.0))
        _check_envelope(self.envelope)

    def scaled(self, strength: float, rate: float) -> Self:
        """Return the noise with accelerations and frequencies multiplied by factors."""
        # White noise of a given density in seconds: 2 D δ(τ) with δ(τ) = δ(t)/p.
        return _scaled(self, rate, diffusion=self.diffusion * strength**2 / rate)


@dataclasses.dataclass(frozen=True, slots=True)
class FilteredNoise:
    """Filtered noise η: white noise w that has passed a linear filter, stationary from τ = 0 on.

    The filters are

    * "exponential": η' + ωη = w,
    * "low-pass": η'' + 2ζωη' + ω²η = w,
    * "kanai-tajimi": η = ω²y + 2ζωy' with y'' + 2ζωy' + ω²y = w,
    * any other, of any number of states, given as a `CloughPenzien`, a `LinearFilter` or a class of one's own.

    Monte Carlo and the Melnikov functions take all of them, the density solver those of one or two states.

    Parameters
    ----------
    filter : str or Filter
        One of the names above, or a filter.
    variance : float
        Variance σ² of η, nondimensional, at least 0.
    frequency : float, optional
        Angular frequency ω of the filter, nondimensional, above 0. The exponential filter has the correlation time 1/ω.
        Required for a filter with a name, refused for another.
    damping : float, optional
        Damping ratio ζ, above 0. Required for the low-pass and the Kanai-Tajimi filter, refused for another.
    envelope : Trapezoid, Exponential or Table, optional
        Function of time g(τ) by which the noise is multiplied. By default the noise is stationary.

    Examples
    --------
    >>> from fpk_rocking import FilteredNoise, load_scene
    >>> from montecarlo import simulate
    >>> noise = FilteredNoise("low-pass", variance=0.04, frequency=9.0, damping=0.7)
    >>> print(simulate(load_scene("main").varied(noise=noise), cycles=4, realizations=1000).survival.round(2))
    [1.   1.   1.   0.98 0.87]
    """

    kind: ClassVar[Literal["filtered"]] = "filtered"
    remark: ClassVar[str] = ""
    filter: str | Filter
    variance: float
    frequency: float | None = None
    damping: float | None = None
    envelope: Trapezoid | Exponential | Table | None = None

    def __post_init__(self):
        _check_envelope(self.envelope)
        accepted = ", ".join(map(repr, FILTERS))
        if not isinstance(self.filter, str | Filter):
            raise TypeError(
                checks.refusal("noise.filter", self.filter, f"{accepted}, or a filter such as CloughPenzien")
            )
        if isinstance(self.filter, str) and self.filter not in FILTERS:
            raise ValueError(checks.refusal("noise.filter", self.filter, accepted))
        _set(self, "variance", checks.number("noise.variance", self.variance, at_least=0.0))
        named = FILTERS[self.filter] if isinstance(self.filter, str) else None
        for name, taken in (("frequency", named), ("damping", named and named.damped)):
            value = getattr(self, name)
            if taken:
                _set(self, name, checks.number(f"noise.{name}", value, above=0.0))
            elif value is not None:
                without = f"nothing; an {self.filter!r} filter has none" if named else "nothing; the filter has its own"
                raise ValueError(checks.refusal(f"noise.{name}", value, without))

    @property
    def space(self) -> StateSpace:
        """State space of the filter, for noise of variance 1."""
        if isinstance(self.filter, Filter):
            return self.filter.space
        return FILTERS[self.filter].space(known(self.frequency), self.damping)

    def scaled(self, strength: float, rate: float) -> Self:
        """Return the noise with accelerations and frequencies multiplied by factors."""
        variance = self.variance * strength**2
        if isinstance(self.filter, Filter):
            return _scaled(self, rate, variance=variance, filter=self.filter.faster(rate))
        return _scaled(self, rate, variance=variance, frequency=known(self.frequency) * rate)


@dataclasses.dataclass(frozen=True, slots=True)
class NoNoise:
    """No noise: the motion is deterministic.

    Examples
    --------
    >>> from fpk_rocking import NoNoise, load_scene
    >>> from montecarlo import simulate
    >>> print(simulate(load_scene("main").varied(noise=NoNoise()), cycles=10).outcome)
    deterministic: stands until τ = 23.27
    """

    kind: ClassVar[Literal["none"]] = "none"
    remark: ClassVar[str] = ""
    variance: ClassVar[float] = 0.0
    envelope: ClassVar[None] = None

    def scaled(self, strength: float, rate: float) -> Self:  # noqa: ARG002
        """Return the same: nothing is scaled."""
        return self


NOISES = {cls.kind: cls for cls in (BandNoise, WhiteNoise, FilteredNoise, NoNoise)}
"""Noises by their kind."""


@dataclasses.dataclass(frozen=True, slots=True)
class Start:
    """State at τ = 0: a point, or a Gaussian around it.

    Parameters
    ----------
    angle, velocity : float
        The point, or the mean of the Gaussian: angle in units of the critical angle, velocity per nondimensional time.
    covariance : ((float, float), (float, float)), optional
        Covariance [[xx, xv], [xv, vv]] of the Gaussian, symmetric and positive definite; None for a point.

    Examples
    --------
    >>> from fpk_rocking import Start, load_scene
    >>> from montecarlo import simulate
    >>> scene = load_scene("main").varied(start=Start(angle=0.2, covariance=((1e-2, 0.0), (0.0, 1e-2))))
    >>> print(simulate(scene, cycles=4, realizations=1000).survival.round(2))
    [1.   0.98 0.94 0.88 0.78]
    """

    angle: float = 0.0
    velocity: float = 0.0
    covariance: tuple[tuple[float, float], tuple[float, float]] | None = None

    def __post_init__(self):
        _set(self, "angle", checks.number("start.angle", self.angle))
        _set(self, "velocity", checks.number("start.velocity", self.velocity))
        if self.covariance is not None:
            _set(self, "covariance", _covariance(self.covariance))


def _covariance(value):
    name = "start.covariance"
    accepted = "[[xx, xv], [xv, vv]], symmetric and positive definite (leave it out to start from a point)"
    given = checks.sequence(name, value, accepted)
    rows = tuple(checks.vector(f"{name}[{i}]", row, "a row of two numbers") for i, row in enumerate(given))
    if len(rows) != 2:
        raise ValueError(checks.refusal(name, value, accepted))
    (xx, xv), (vx, vv) = rows
    # A correlation within rounding of 1 has no Cholesky factor, so it counts as singular.
    if xv != vx or xx <= 0.0 or vv <= 0.0 or abs(xv) >= (1.0 - 1e-12) * math.sqrt(xx) * math.sqrt(vv):
        raise ValueError(checks.refusal(name, value, accepted))
    return rows


@dataclasses.dataclass(frozen=True, slots=True)
class Overturning:
    """Criterion of overturning: the block has overturned once the absolute value of its angle reaches this one.

    Parameters
    ----------
    angle : float
        In units of the critical angle, above 0. π/2 is the paper's value. The shaking can still turn back a block
        beyond the critical angle, 1.

    Examples
    --------
    >>> from fpk_rocking import Overturning, load_scene
    >>> from montecarlo import simulate
    >>> scene = load_scene("main").varied(overturning=Overturning(angle=1.4))
    >>> print(simulate(scene, cycles=4, realizations=1000).survival.round(2))
    [1.   1.   0.98 0.88 0.76]
    """

    angle: float = math.pi / 2

    def __post_init__(self):
        _set(self, "angle", checks.number("overturning.angle", self.angle, above=0.0))
