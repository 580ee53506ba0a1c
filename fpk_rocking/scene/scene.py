"""The scene: everything that defines a rocking problem, as one frozen value with a TOML text form.

All quantities are nondimensional: angles in units of the critical angle, time τ = pt; equations and symbols are in
docs/theory.md. A scene says nothing about how it is solved.
"""

import dataclasses
import pathlib
import tomllib
from collections.abc import Mapping, Sequence
from typing import Any, Self

from fpk_rocking.base import checks
from fpk_rocking.base.checks import File
from fpk_rocking.physics.forcing import FORCINGS, Forcing, Harmonic, Pulse, Record
from fpk_rocking.physics.noise.equivalence import equivalent_diffusion, noise_variance
from fpk_rocking.physics.noise.filters import BUTTERWORTH, low_pass_frequency
from fpk_rocking.physics.noise.kinds import FREQUENCIES, NOISES, BandNoise, FilteredNoise, NoNoise, WhiteNoise
from fpk_rocking.scene.parts import Block, Body, Overturning, Start, check_cutoff
from fpk_rocking.scene.text import READERS, change_document, fields_of, table_of, with_harmonics, without_units
from fpk_rocking.scene.units import STANDARD_GRAVITY, Dimensions, in_units

_EQUAL_SIDES = (
    "noise of equal Melnikov variance, which is taken along the orbit between two equal sides",
    "use Monte Carlo, which takes the noise as it is, or white noise, for a wide band of D = (π/2) variance / width",
)
"""Why a replacement of noise needs equal sides, and what to do instead."""


@dataclasses.dataclass(frozen=True, slots=True)
class Scene:
    """A rocking problem: block, shaking of its base, start, and the angle that counts as overturning.

    `from_block` makes a scene from metres, m/s² and Hz, `load_scene` reads one from a file. A scene cannot be changed;
    `varied` returns a changed copy.

    Parameters
    ----------
    block : Block
        Restitution, and the size of the block where units are wanted.
    forcing : Forcing
        Acceleration of the base that is known: `Harmonic`, `Harmonics`, `Pulse` or `Record`. A record needs
        ``block.dimensions`` or ``block.body``.
    noise : BandNoise, WhiteNoise, FilteredNoise or NoNoise
        Random acceleration of the base.
    start : Start
        Angle and velocity at τ = 0; at rest by default.
    overturning : Overturning
        Angle that counts as overturning; π/2 critical angles by default.

    Raises
    ------
    TypeError
        A part has the wrong type.
    ValueError
        The start is at or beyond overturning, overturning is beyond 1 + π/(2α), or a record has a block without a
        size.

    Examples
    --------
    >>> from fpk_rocking import Block, Harmonic, Scene, WhiteNoise
    >>> scene = Scene(Block(restitution=0.5), Harmonic(amplitude=4.6, frequency=2.7), WhiteNoise(diffusion=0.005))
    >>> print(scene.varied(noise={"diffusion": 0.01}).noise.diffusion)
    0.01
    >>> rack = Scene.from_block(0.5, 1.8, "0.3 g", "1.5 Hz")
    >>> print(f"{rack.block.restitution:.3f} {rack.forcing.amplitude:.3f}")
    0.893 1.107
    """

    block: Block
    forcing: Forcing
    noise: BandNoise | WhiteNoise | FilteredNoise | NoNoise
    start: Start = Start()
    overturning: Overturning = Overturning()

    def __post_init__(self):
        checks.instance("block", self.block, Block)
        checks.instance("forcing", self.forcing, Forcing, *FORCINGS.values())
        checks.instance("noise", self.noise, *NOISES.values())
        checks.instance("start", self.start, Start)
        checks.instance("overturning", self.overturning, Overturning)
        checks.keep(self, forcing=self.forcing.for_size(self.block.size))
        check_cutoff(self.overturning.angle, self.block.critical_angle)
        if abs(self.start.angle) >= self.overturning.angle:
            accepted = f"an absolute value below overturning.angle = {self.overturning.angle!r}"
            raise ValueError(checks.refusal("start.angle", self.start.angle, accepted))

    @property
    def period(self) -> float | None:
        """Nondimensional time T = 2π/Ω of one forcing cycle; None where the forcing does not repeat."""
        return self.forcing.period

    @property
    def repeats(self) -> bool:
        """Whether all cycles are alike: the forcing repeats, and the noise has no envelope."""
        return self.period is not None and self.noise.envelope is None

    @property
    def deterministic(self) -> bool:
        """Whether the block has one path: there is no noise, or noise of strength 0, and the start is a point."""
        strength = self.noise.diffusion if self.noise.kind == "white" else self.noise.variance
        return strength == 0.0 and self.start.covariance is None

    def varied(self, **parts: Any) -> Self:
        """Return a copy of the scene with some values changed.

        Parameters
        ----------
        **parts : dict or part of a scene
            New values of a part, or a new part: ``scene.varied(forcing={"amplitude": 4.2}, noise=NoNoise())``. A change
            of the noise drops its ``remark``, a new size drops the critical angle, unless a new one is given.
        """
        own = fields_of(self)
        checks.arguments("", own | parts, Scene)
        for name, part in parts.items():
            if isinstance(part, dict):
                cls = type(own[name])
                if "kind" in part:
                    accepted = f"values of {cls.__name__}, or a new part, as in scene.varied(noise=NoNoise())"
                    raise ValueError(checks.refusal(f"{name}.kind", part["kind"], accepted))
                dropped = {"remark"} | (
                    {"critical_angle"} if part.keys() & {"dimensions", "body", "slender"} else set()
                )
                unchanged = {key: value for key, value in fields_of(own[name]).items() if key not in dropped}
                parts[name] = cls(**checks.arguments(name, unchanged | part, cls))
        return dataclasses.replace(self, **parts)

    def white_equivalent(self) -> Self:
        """Return the same scene with white noise of equal Melnikov variance.

        This is an approximation of band noise and filtered noise, see `fpk_rocking.melnikov.equivalent_diffusion`. A
        scene without noise gets white noise of diffusion 0; one with white noise is returned as it is.
        """
        if self.noise.kind == "white":
            return self
        self.block.require_symmetric(*_EQUAL_SIDES)
        diffusion = equivalent_diffusion(self.noise, critical_angle=self.block.critical_angle)
        return dataclasses.replace(self, noise=WhiteNoise(diffusion, self.noise.envelope))

    def filtered_equivalent(self, states: int = 2) -> Self:
        """Return the same scene with low-pass or exponential noise in place of band noise.

        It has the variance and the Melnikov variance of the band noise. Unlike white noise it lets a block rest. A
        scene with filtered noise is returned as it is.

        Parameters
        ----------
        states : int
            2, of low-pass noise of damping ζ = 1/√2, or 1, of exponential noise.

        Raises
        ------
        ValueError
            The noise is not band noise of a variance above 0, or no frequency of the filter from 1e-8 to 1e8 gives the
            Melnikov variance.
        """
        noise = self.noise
        checks.count("states", states, at_most=2)
        if noise.kind == "filtered":
            return self
        if noise.kind != "band" or noise.variance == 0.0:
            raise ValueError(checks.refusal("noise", noise, "band noise of a variance > 0, or filtered noise"))
        self.block.require_symmetric(*_EQUAL_SIDES)
        ratio = noise_variance(noise, critical_angle=self.block.critical_angle) / noise.variance
        frequency = low_pass_frequency(ratio, critical_angle=self.block.critical_angle, states=states)
        if frequency is None:
            accepted = (
                "a band that low-pass noise can replace; none has this Melnikov variance, "
                f"{ratio!r} times the variance: the frequencies are all close to 0, or all very high"
            )
            raise ValueError(checks.refusal("noise.band", noise.band, accepted))
        named = ("exponential", None) if states == 1 else ("low-pass", BUTTERWORTH)
        filtered = FilteredNoise(named[0], noise.variance, frequency, named[1], noise.envelope)
        return dataclasses.replace(self, noise=filtered)

    @classmethod
    def from_block(
        cls,
        width: float | str | None = None,
        height: float | str | None = None,
        peak_acceleration: float | str | None = None,
        frequency_hz: float | str | None = None,
        *,
        record: Forcing | None = None,
        pulse: str | None = None,
        pulse_cycles: int | None = None,
        body: Body | None = None,
        restitution: float | tuple[float, float] | None = None,
        phase: float = 0.0,
        noise_rms_acceleration: float | str = 0.0,
        noise_band_hz: Sequence[float | str] | None = None,
        harmonics: int | None = None,
        frequencies: str = "stratified",
        gravity: float = STANDARD_GRAVITY,
        start: Start = Start(),
        overturning: Overturning = Overturning(),
        overturning_angle: float | str | None = None,
        slender: bool = False,
    ) -> Self:
        """Build a scene from the size of a block and the shaking of its base.

        Quantities may have other units as texts: ``"60 cm"``, ``"0.3 g"``.

        Parameters
        ----------
        width, height : float, optional
            Full width and height of a rectangle, metres. Required without a body.
        peak_acceleration : float, optional
            Amplitude of a harmonic base acceleration, or peak of a pulse, m/s². Required without a record.
        frequency_hz : float, optional
            Its frequency, Hz. Required without a record.
        record : Record, optional
            Recorded base acceleration, see `Record.from_file`, in place of peak and frequency.
        pulse : str, optional
            Shape of a pulse, see `Pulse`, in place of a harmonic acceleration.
        pulse_cycles : int, optional
            Number of cycles of the pulse "n-sine".
        body : Body, optional
            Any rigid body, in place of width, height and gravity.
        restitution : float or (float, float), optional
            Velocity after an impact over that before it; by default Housner's 1 - (3/2) sin²θ_cr, or that of the body.
            Two numbers are for impacts that leave the left side and for those that leave the right.
        phase : float
            Phase of the harmonic base acceleration, radians.
        noise_rms_acceleration : float
            Root mean square of the random base acceleration that is added to the shaking, m/s²; 0 for none.
        noise_band_hz : (float, float), optional
            Lowest and highest frequency of the noise, Hz. Required where there is noise, refused where there is none.
        harmonics : int, optional
            Number of harmonics of the noise. By default 100, or more if 30 cycles, or the duration of a pulse or
            record, need more: the width of the band in Hz times that duration in seconds.
        frequencies : {"stratified", "independent"}
            Of the harmonics, see `BandNoise`.
        gravity : float
            Acceleration of gravity, m/s².
        start, overturning : Start, Overturning
            Nondimensional, angles in units of the critical angle.
        overturning_angle : float, optional
            Angle that counts as overturning, degrees, in place of `overturning`. At 90 it lies on its side.
        slender : bool
            Take the equation of motion of a slender block instead of the exact one.
        """
        size = _size_of_block(width, height, gravity, body)
        forcing = _shaking_of_block(size, peak_acceleration, frequency_hz, record, pulse, pulse_cycles, phase)
        rms = in_units("noise_rms_acceleration", noise_rms_acceleration, "acceleration")
        rms = checks.number("noise_rms_acceleration", rms, at_least=0.0)
        if (rms > 0.0) != (noise_band_hz is not None):
            accepted = "a number > 0 together with noise_band_hz = [lowest, highest], or neither of them"
            raise ValueError(checks.refusal("noise_rms_acceleration", noise_rms_acceleration, accepted))
        noise: BandNoise | NoNoise = NoNoise()
        if noise_band_hz is not None:
            low, high = checks.interval("noise_band_hz", in_units("noise_band_hz", noise_band_hz, "frequency"))
            noise = BandNoise(size.amplitude(rms) ** 2, (size.frequency(low), size.frequency(high)))
        if overturning_angle is not None:
            name = "overturning_angle"
            radians = checks.number(name, in_units(name, overturning_angle, "angle"), above=0.0)
            overturning = Overturning(radians / size.critical_angle)
        dimensions = None if isinstance(size, Body) else size
        block = Block(restitution, dimensions, slender=slender, body=body)  # type: ignore[arg-type]  # None: from the size
        return with_harmonics(cls(block, forcing, noise, start, overturning), harmonics, frequencies)

    @classmethod
    def from_toml(cls, text: str, folder: File = ".", changes: Mapping[str, Any] | None = None) -> Self:
        """Read a scene from TOML text.

        Parameters
        ----------
        text : str
            The tables ``[block]``, ``[forcing]`` and ``[noise]`` are required, ``[start]`` and ``[overturning]`` are
            optional. Their keys are the parameters of the classes, and the following: ``noise.kind`` is "band",
            "white", "filtered" or "none"; band noise of a block with dimensions has the ``frequencies`` and
            ``harmonics`` of `from_block` by default; ``noise.filter`` is a name, or a table of the kind "linear" or
            "clough-penzien"; ``noise.envelope.kind`` is "trapezoid", "exponential" or "table";
            ``forcing.kind`` is "harmonic" (by default), "harmonics", "pulse", "chirp" or "record". A record may have
            ``file`` in place of ``interval`` and ``samples``. If the block has a size, quantities may have units:
            ``peak_acceleration``, ``rms_acceleration`` (in m/s², or "0.3 g"), ``frequency_hz``, ``band_hz``, and others
            that end with ``_hz``, ``_s`` or ``_deg``.
        folder : str or pathlib.Path
            Folder that the file of a record is relative to.
        changes : dict of str, optional
            Values that replace those of the text, by dotted names: ``{"forcing.peak_acceleration": "0.3 g"}``. A new
            ``kind`` drops the other keys of its table.
        """
        try:
            document = tomllib.loads(text)
        except (ValueError, RecursionError) as error:  # numbers of 5,000 digits, and tables of 5,000 levels
            raise ValueError(f"not valid TOML: {error}") from None
        for name, value in (changes or {}).items():
            change_document(document, name, value)
        if document.keys() <= {field.name for field in dataclasses.fields(cls)}:
            if "noise" not in document:
                raise ValueError('noise: missing, required: [noise]; kind = "none" says that there is none')
            if "forcing" not in document:
                raise ValueError("forcing: missing, required: [forcing], or recorded motions in its place (--records)")
        tables = checks.arguments("", document, cls)
        block = READERS["block"]("block", tables.pop("block"), folder)
        parts = {"block": block}
        for name, table in tables.items():
            plain_table = without_units(name, checks.table(name, table), block.size)
            parts[name] = READERS[name](name, plain_table, folder)
            tables[name] = plain_table
        noise = tables["noise"]
        return with_harmonics(cls(**parts), noise.get("harmonics"), noise.get("frequencies", FREQUENCIES[1]))

    def to_toml(self) -> str:
        """Return the scene as TOML text, samples of a record included; `from_toml` reads it back."""
        tables = fields_of(self)
        for name in ("dimensions", "body"):
            part = getattr(self.block, name)
            if part is not None:
                tables = {"block": self.block, f"block.{name}": part} | tables
        for name in ("envelope", "filter"):
            part = getattr(self.noise, name, None)
            if dataclasses.is_dataclass(part):
                tables[f"noise.{name}"] = part
        if self.forcing.vertical is not None:
            tables["forcing.vertical"] = self.forcing.vertical
        return "\n".join(table_of(name, part) for name, part in tables.items())


def _size_of_block(width: Any, height: Any, gravity: Any, body: Any) -> Dimensions | Body:
    """Return the `Dimensions`, or the `Body` where there is one; ValueError for both."""
    if body is None:
        return Dimensions(width, height, gravity)
    usual = ("width", width, None), ("height", height, None), ("gravity", gravity, STANDARD_GRAVITY)
    for name, value, default in usual:
        if value != default:
            raise ValueError(checks.refusal(name, value, "nothing where there is a body"))
    return checks.instance("body", body, Body)


def _shaking_of_block(
    size: Dimensions | Body, peak: Any, hertz: Any, record: Any, pulse: Any, pulse_cycles: Any, phase: float
) -> Harmonic | Pulse | Record:
    """Return the forcing of `Scene.from_block`: the `Record`, or a pulse or harmonic scaled by a size."""
    if record is not None:
        checks.instance("record", record, Record)
        for name, value in (("peak_acceleration", peak), ("frequency_hz", hertz), ("pulse", pulse)):
            if value is not None:
                raise ValueError(checks.refusal(name, value, "nothing where there is a record"))
        return record
    peak = checks.number("peak_acceleration", in_units("peak_acceleration", peak, "acceleration"), at_least=0.0)
    hertz = checks.number("frequency_hz", in_units("frequency_hz", hertz, "frequency"), above=0.0)
    amplitude, frequency = size.amplitude(peak), size.frequency(hertz)
    if pulse is not None:
        return Pulse(pulse, amplitude, frequency, pulse_cycles)
    return Harmonic(amplitude, frequency, phase)


def load_scene(path: File, changes: Mapping[str, Any] | None = None) -> Scene:
    """Read a scene file, or one of the scenes that come with the package.

    Parameters
    ----------
    path : str or pathlib.Path
        A TOML file, or the name of a scene of the package: ``"main"``, ``"second"``, ``"fig05"``,
        ``"second_harmonic"``, ``"rest"`` or ``"record"``. To read a file of such a name write ``"./main"``.
    changes : dict of str, optional
        As for `Scene.from_toml`.

    Raises
    ------
    FileNotFoundError
        There is no such file, nor a scene of this name.
    TypeError, ValueError
        A value is refused; the message begins with the path.

    Examples
    --------
    >>> from fpk_rocking import load_scene
    >>> print(load_scene("main", {"noise.variance": 0.01}).noise.variance)
    0.01
    """
    # The scenes of the package are within it in a wheel, beside it in a checkout or a source distribution.
    package = pathlib.Path(__file__).parents[1]
    folder = package / "scenes" if (package / "scenes").is_dir() else package.parent / "cases" / "scenes"
    shipped = {file.stem: file for file in folder.glob("*.toml")}
    path = shipped[path] if isinstance(path, str) and path in shipped else checks.path("path", path)
    try:
        text = path.read_text(encoding="utf-8")
    except FileNotFoundError:
        looked = f"looked from {str(pathlib.Path.cwd())!r}; scenes of the package: {', '.join(sorted(shipped))}"
        raise FileNotFoundError(f"no scene file {str(path)!r} ({looked})") from None
    except UnicodeDecodeError as error:
        raise ValueError(f"{path}: not a text file in UTF-8 ({error})") from None
    try:
        return Scene.from_toml(text, path.parent, changes)
    except (TypeError, ValueError, OSError) as error:
        raise type(error)(f"{path}: {error}") from None


def under_motion(scene: Scene, motion: Forcing) -> Scene:
    """Return a copy of a scene with another forcing.

    Where its band noise has the default number of harmonics for its own forcing, it has that for the other.
    """
    moved, noise = dataclasses.replace(scene, forcing=motion), scene.noise
    if noise.kind != "band" or scene != with_harmonics(scene, None, noise.frequencies):
        return moved
    return with_harmonics(moved, None, noise.frequencies)
