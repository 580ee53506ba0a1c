"""The kinds of noise of a scene, each checked when it is made: band, white, filtered and none.

Their common attributes are `kind`, the name in a scene file; `envelope`, None where the noise is stationary; and
`scaled`. Band and filtered noise have a `variance`, filtered noise the `space` of its filter.
"""

import dataclasses
import math
from typing import ClassVar, Literal, Self

from fpk_rocking.base import checks
from fpk_rocking.base.checks import not_none
from fpk_rocking.physics.noise.envelope import ENVELOPES, Exponential, Table, Trapezoid
from fpk_rocking.physics.noise.filters import FILTERS, Filter
from fpk_rocking.physics.noise.state_space import StateSpace


def _check_envelope(envelope):
    if envelope is not None:
        checks.instance("noise.envelope", envelope, *ENVELOPES.values())


def _scaled(noise, rate, **changed):
    """`noise` with fields replaced, and the times of its envelope divided by `rate`."""
    if noise.envelope is not None:
        changed["envelope"] = noise.envelope.faster(rate)
    return dataclasses.replace(noise, **changed)


HARMONICS = 100
"""Harmonics of band noise, unless given; those of a block with dimensions may be more, see `enough_harmonics`."""

FREQUENCIES = "independent", "stratified"
"""How the frequencies of band noise are drawn."""


def enough_harmonics(band: tuple[float, float], duration: float) -> int:
    """How many harmonics band noise over a duration needs: the width of its band in turns times the duration.

    With fewer, the sum of stratified harmonics has another correlation than the noise at lags within the duration.
    """
    return math.ceil((band[1] - band[0]) * duration / (2.0 * math.pi) - 1e-9)


@dataclasses.dataclass(frozen=True, slots=True)
class BandNoise:
    """Noise with a flat spectrum in a band: a sum of harmonics with random frequencies and random phases.

    With independent frequencies it is Shinozuka noise (paper eq. 4). The number of frequencies that move the block then
    differs between the realizations, and so does their strength. With few harmonics, small probabilities of overturning
    may therefore be several times too large. Stratified frequencies, with Gaussian amplitudes, make the noise Gaussian
    with the band's spectrum as long as there are `enough_harmonics`.

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
        Function of time g(τ) by which the noise is multiplied; none for stationary noise.
    frequencies : {"independent", "stratified"}
        "independent": each is uniform in the band, and all amplitudes are equal. "stratified": one is uniform in each
        of N equal parts of the band, and the amplitudes are those of Gaussian noise; this is the default of
        `Scene.from_block` and of files with ``[block.dimensions]``.

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
    frequencies: str = FREQUENCIES[0]

    def __post_init__(self):
        if self.frequencies not in FREQUENCIES:
            accepted = " or ".join(map(repr, FREQUENCIES))
            raise ValueError(checks.refusal("noise.frequencies", self.frequencies, accepted))
        checks.keep_numbers(self, "noise", "variance", at_least=0.0)
        checks.keep(self, band=checks.interval("noise.band", self.band))
        checks.keep(self, harmonics=checks.count("noise.harmonics", self.harmonics))
        _check_envelope(self.envelope)
        checks.keep(self, remark=checks.sentence("noise.remark", self.remark))

    def scaled(self, strength: float, rate: float) -> Self:
        """The noise with accelerations times `strength` and frequencies, its envelope's too, times `rate`."""
        band = tuple(rate * frequency for frequency in self.band)
        return _scaled(self, rate, variance=self.variance * strength**2, band=band)


@dataclasses.dataclass(frozen=True, slots=True)
class WhiteNoise:
    """White noise η with ⟨η(τ)η(τ')⟩ = 2Dδ(τ - τ').

    Parameters
    ----------
    diffusion : float
        Diffusion D, nondimensional, at least 0.
    envelope : Trapezoid, Exponential or Table, optional
        Function of time g(τ) by which the noise is multiplied; none for stationary noise.

    Examples
    --------
    >>> from fpk_rocking import WhiteNoise, load_scene
    >>> from montecarlo import simulate
    >>> scene = load_scene("main").varied(noise=WhiteNoise(diffusion=0.02))
    >>> print(simulate(scene, cycles=4, realizations=1000).survival.round(2))
    [1.   1.   0.96 0.79 0.65]
    """

    kind: ClassVar[Literal["white"]] = "white"
    remark: ClassVar[str] = ""
    diffusion: float
    envelope: Trapezoid | Exponential | Table | None = None

    def __post_init__(self):
        checks.keep_numbers(self, "noise", "diffusion", at_least=0.0)
        _check_envelope(self.envelope)

    def scaled(self, strength: float, rate: float) -> Self:
        # White noise of a given density in seconds: 2 D δ(τ) with δ(τ) = δ(t)/p.
        return _scaled(self, rate, diffusion=self.diffusion * strength**2 / rate)

    @property
    def with_unit_peak(self) -> Self:
        """The same noise, by an envelope whose largest value is 1 and the diffusion that goes with it."""
        if self.envelope is None or self.envelope.largest == 1.0:
            return self
        return dataclasses.replace(
            self, diffusion=self.diffusion * self.envelope.largest**2, envelope=self.envelope.with_unit_peak
        )


@dataclasses.dataclass(frozen=True, slots=True)
class FilteredNoise:
    """Filtered noise η: white noise w that has passed a linear filter, stationary from τ = 0 on.

    The filters are

    * "exponential": η' + ωη = w,
    * "low-pass": η'' + 2ζωη' + ω²η = w,
    * "kanai-tajimi": η = ω²y + 2ζωy' with y'' + 2ζωy' + ω²y = w,
    * any other, given as a `CloughPenzien`, a `LinearFilter` or a `Filter` of one's own.

    Monte Carlo and the Melnikov functions take all of them, the density solver those of one or two states.

    Parameters
    ----------
    filter : str or Filter
        One of the names above, or a filter.
    variance : float
        Variance σ² of η, nondimensional, at least 0.
    frequency : float, optional
        Angular frequency ω of a filter with a name, nondimensional, above 0; the exponential one has the correlation
        time 1/ω.
    damping : float, optional
        Damping ratio ζ of the low-pass and the Kanai-Tajimi filter, above 0.
    envelope : Trapezoid, Exponential or Table, optional
        Function of time g(τ) by which the noise is multiplied; none for stationary noise.

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
            every = f"{accepted}, or a filter such as CloughPenzien"
            raise TypeError(checks.refusal("noise.filter", self.filter, every))
        if isinstance(self.filter, str) and self.filter not in FILTERS:
            raise ValueError(checks.refusal("noise.filter", self.filter, accepted))
        checks.keep_numbers(self, "noise", "variance", at_least=0.0)
        named = FILTERS[self.filter] if isinstance(self.filter, str) else None
        for name, taken in (("frequency", named), ("damping", named and named.damped)):
            value = getattr(self, name)
            if taken:
                checks.keep_numbers(self, "noise", name, above=0.0)
            elif value is not None:
                without = f"nothing; an {self.filter!r} filter has none" if named else "nothing; the filter has its own"
                raise ValueError(checks.refusal(f"noise.{name}", value, without))

    @property
    def space(self) -> StateSpace:
        """State space of the filter, for noise of variance 1."""
        if isinstance(self.filter, Filter):
            return self.filter.space
        return FILTERS[self.filter].space(not_none(self.frequency), self.damping)

    def scaled(self, strength: float, rate: float) -> Self:
        variance = self.variance * strength**2
        if isinstance(self.filter, Filter):
            return _scaled(self, rate, variance=variance, filter=self.filter.faster(rate))
        return _scaled(self, rate, variance=variance, frequency=not_none(self.frequency) * rate)


@dataclasses.dataclass(frozen=True, slots=True)
class NoNoise:
    """No noise: the motion is deterministic.

    Examples
    --------
    >>> from fpk_rocking import NoNoise, load_scene
    >>> from montecarlo import simulate
    >>> print(simulate(load_scene("main").varied(noise=NoNoise()), cycles=10).metadata["outcome"])
    deterministic: stands until τ = 23.27
    """

    kind: ClassVar[Literal["none"]] = "none"
    remark: ClassVar[str] = ""
    variance: ClassVar[float] = 0.0
    envelope: ClassVar[None] = None

    def scaled(self, strength: float, rate: float) -> Self:  # noqa: ARG002
        return self


NOISES = {cls.kind: cls for cls in (BandNoise, WhiteNoise, FilteredNoise, NoNoise)}
"""Noises by their kind."""

Noise = BandNoise | WhiteNoise | FilteredNoise | NoNoise
"""Noise of any kind; its `kind` tells which."""


def refuse_envelope(noise: Noise, what: str) -> None:
    """Raise ValueError for a noise with an envelope; `what` names what is not defined for it, for the message."""
    if noise.envelope is not None:
        accepted = f"no envelope, as {what} is only defined for stationary noise"
        raise ValueError(checks.refusal("noise.envelope", noise.envelope, accepted))
