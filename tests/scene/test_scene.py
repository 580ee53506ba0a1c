"""Scenes: what is accepted, what is refused and by which words, and the TOML form."""

import dataclasses
import math
import pathlib
import pickle

import numpy as np
import pytest

from fpk_rocking import (
    BandNoise,
    Block,
    Dimensions,
    Harmonic,
    NoNoise,
    Overturning,
    Scene,
    Start,
    WhiteNoise,
    cli,
    load_scene,
    melnikov,
)
from fpk_rocking.scene import ranges

SCENES = pathlib.Path(__file__).parents[2] / "cases" / "scenes"

MINIMAL = """
[block]
restitution = 0.5
[forcing]
amplitude = 4.6
frequency = 2.7
[noise]
kind = "none"
"""


def scene(**parts):
    values = {"block": Block(0.5), "forcing": Harmonic(4.6, 2.7), "noise": NoNoise()}
    return Scene(**values | parts)


def test_main_scene_file_is_the_papers_fig_6():
    assert load_scene(SCENES / "main.toml") == Scene(
        block=Block(restitution=0.5),
        forcing=Harmonic(amplitude=4.6, frequency=2.7, phase=math.pi),
        noise=BandNoise(variance=0.04, band=(0.0, 10.0), harmonics=100),
        start=Start(angle=0.0, velocity=0.0),
        overturning=Overturning(angle=math.pi / 2),
    )


def test_other_scene_files():
    fig05, second = load_scene(SCENES / "fig05.toml"), load_scene(str(SCENES / "second.toml"))
    assert fig05.forcing == Harmonic(4.2, 2.7, 3.14)
    main = load_scene(SCENES / "main.toml")
    assert fig05.noise == BandNoise(0.0025, (0.0, 10.0), 100)
    assert fig05.noise.remark == main.noise.remark
    assert "paper states no noise band" in main.noise.remark
    assert second == Scene(Block(0.7), Harmonic(3.0, 2.7, math.pi), WhiteNoise(0.012))


def test_optional_tables_and_keys_have_the_documented_defaults():
    assert Scene.from_toml(MINIMAL) == scene(start=Start(), overturning=Overturning())
    assert scene().start == Start(0.0, 0.0, None)
    assert scene().overturning.angle == math.pi / 2
    assert scene().forcing.phase == 0.0
    assert scene().period == scene().forcing.period == pytest.approx(2 * math.pi / 2.7, rel=1e-15)


SIZE = Dimensions(0.4, 1.7, 9.81)


@pytest.mark.parametrize(
    ("block", "angle"),
    [(Block(2 / 3, SIZE), 5 / 3), (Block(2 / 3, SIZE, slender=True), 1e16 / 3), (Block(2 / 3, None, 1 / 7), 7 / 3)],
    ids=["exact", "slender", "angle"],
)
@pytest.mark.parametrize("noise", [BandNoise(0.1, (1 / 3, 7.0), 30), WhiteNoise(1e-17), NoNoise()])
@pytest.mark.parametrize(
    "start", [Start(), Start(-0.1, 1e300), Start(0.3, -1 / 3, ((1e-4, -1e-5), (-1e-5, 2e-4)))], ids=str
)
def test_toml_form_round_trips_exactly(noise, start, block, angle):
    complete = Scene(block, Harmonic(1e-5, 2.7, -1.1), noise, start, Overturning(angle))
    assert Scene.from_toml(complete.to_toml()) == complete
    assert pickle.loads(pickle.dumps(complete)) == complete


def test_the_critical_angle_follows_from_the_dimensions_unless_the_block_is_taken_as_slender():
    exact, slender = Block(0.9, SIZE), Block(0.9, SIZE, slender=True)
    assert exact.critical_angle == SIZE.critical_angle
    assert (slender.critical_angle, Block(0.9).critical_angle, slender.lift_off) == (0.0, 0.0, 1.0)
    assert exact.lift_off == pytest.approx((0.4 / 1.7) / math.atan(0.4 / 1.7), rel=1e-15)
    assert Block(0.9, SIZE, SIZE.critical_angle * 1.0005).critical_angle == SIZE.critical_angle * 1.0005
    with pytest.raises(ValueError, match=r"^block\.critical_angle: got 0\.23"):
        Block(0.9, SIZE, SIZE.critical_angle * 1.002)
    for wrong in (Block(0.9, SIZE), Block(0.9, SIZE, slender=True)):
        with pytest.raises(ValueError, match=r"^block\.critical_angle: got 0\.5, accepted: "):
            dataclasses.replace(wrong, critical_angle=0.5)
    with pytest.raises(TypeError, match=r"^block\.slender: "):
        Block(0.9, SIZE, slender=1)


def test_changed_dimensions_bring_their_critical_angle():
    sized = scene(block=Block(0.9, SIZE))
    size = Dimensions(0.5, 1.7, 9.81)
    assert sized.varied(block={"dimensions": size}).block.critical_angle == size.critical_angle
    assert sized.varied(block={"slender": True}).block.critical_angle == 0.0
    assert sized.varied(block={"slender": True}).varied(block={"slender": False}) == sized


def test_overturning_is_refused_where_gravity_turns_a_block_back():
    scene(block=Block(0.9, None, 0.5), overturning=Overturning(1.0 + math.pi))
    with pytest.raises(
        ValueError, match=r"^overturning\.angle: got 4\.15, accepted: at most 1 \+ π/\(2α\) = 4\.14159 "
    ):
        scene(block=Block(0.9, None, 0.5), overturning=Overturning(4.15))


def test_values_are_frozen_and_hashable():
    with pytest.raises(dataclasses.FrozenInstanceError):
        scene().forcing.amplitude = 1.0
    assert len({scene(), scene(), scene(noise=WhiteNoise(0.1))}) == 2


def test_integers_and_numpy_numbers_become_floats():
    forcing = Harmonic(np.float32(4.5), 2, np.int64(1))
    assert [type(value) for value in (forcing.amplitude, forcing.frequency, forcing.phase)] == [float] * 3
    assert forcing == Harmonic(4.5, 2.0, 1.0)
    assert Start(covariance=np.array([[2, 1], [1, 2]])).covariance == ((2.0, 1.0), (1.0, 2.0))
    assert BandNoise(1, np.array([0, 10]), np.int64(7)) == BandNoise(1.0, (0.0, 10.0), 7)


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, 10**400], ids=["nan", "inf", "-inf", "huge"])
@pytest.mark.parametrize(
    ("make", "name"),
    [
        (Block, "block.restitution"),
        (lambda v: Harmonic(v, 1.0), "forcing.amplitude"),
        (lambda v: Harmonic(1.0, v), "forcing.frequency"),
        (lambda v: Harmonic(1.0, 1.0, v), "forcing.phase"),
        (lambda v: BandNoise(v, (0, 1), 1), "noise.variance"),
        (lambda v: BandNoise(1, (0, v), 1), "noise.band[1]"),
        (WhiteNoise, "noise.diffusion"),
        (Start, "start.angle"),
        (lambda v: Start(0, v), "start.velocity"),
        (lambda v: Start(covariance=((v, 0), (0, 1))), "start.covariance[0][0]"),
        (Overturning, "overturning.angle"),
        (lambda v: Dimensions(v, 1), "block.dimensions.width"),
        (lambda v: Dimensions(1, v), "block.dimensions.height"),
        (lambda v: Dimensions(1, 1, v), "block.dimensions.gravity"),
    ],
)
def test_what_is_not_finite_is_refused_by_name(make, name, value):
    with pytest.raises(ValueError, match="accepted: a finite number") as caught:
        make(value)
    assert str(caught.value).startswith(f"{name}: got {value!r}, ")


@pytest.mark.parametrize("value", [True, "0.5", {}, [0.5], 1j, np.array(0.5), np.bool_(True)], ids=repr)
@pytest.mark.parametrize(
    ("make", "name"),
    [
        (Block, "block.restitution"),
        (lambda v: Harmonic(v, 1.0), "forcing.amplitude"),
        (lambda v: BandNoise(1, (v, 1), 1), "noise.band[0]"),
        (lambda v: BandNoise(1, (0, 1), v), "noise.harmonics"),
        (Start, "start.angle"),
    ],
)
def test_what_is_not_a_number_is_refused_by_name(make, name, value):
    with pytest.raises(TypeError) as caught:
        make(value)
    assert str(caught.value).startswith(f"{name}: got {value!r}, accepted: a ")


BAND = r"accepted: two numbers \[lowest, highest\] with 0 <= lowest < highest"
COVARIANCE = r"start\.covariance: got .*accepted: \[\[xx, xv\], \[xv, vv\]\], symmetric and positive definite"


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Block(1.01), r"^block\.restitution: got 1\.01, accepted: a finite number >= 0\.0 and <= 1\.0$"),
        (lambda: Block(-0.01), r"^block\.restitution: got -0\.01, "),
        (lambda: Harmonic(-1, 2.7), r"^forcing\.amplitude: got -1, accepted: a finite number >= 0\.0$"),
        (lambda: Harmonic(1, 0), r"^forcing\.frequency: got 0, accepted: a finite number > 0\.0$"),
        (lambda: BandNoise(-0.1, (0, 1), 1), r"^noise\.variance: got -0\.1, "),
        (lambda: WhiteNoise(-1e-9), r"^noise\.diffusion: got -1e-09, "),
        (lambda: BandNoise(1, (3, 3), 1), r"^noise\.band: got \(3, 3\), " + BAND),
        (lambda: BandNoise(1, (3, 2), 1), BAND),
        (lambda: BandNoise(1, (-1, 2), 1), BAND),
        (lambda: BandNoise(1, (1, 2, 3), 1), BAND),
        (lambda: BandNoise(1, (0, 1), 0), r"^noise\.harmonics: got 0, accepted: a whole number >= 1$"),
        (lambda: Overturning(0), r"^overturning\.angle: got 0, accepted: a finite number > 0\.0$"),
        (lambda: Start(covariance=((1, 0.5), (0.4, 1))), COVARIANCE),
        (lambda: Start(covariance=((1, 1), (1, 1))), COVARIANCE),
        (lambda: Start(covariance=((1, 2), (2, 1))), COVARIANCE),
        (lambda: Start(covariance=((-1, 0), (0, -1))), COVARIANCE),
        (lambda: Start(covariance=((0, 0), (0, 1))), COVARIANCE),
        (lambda: Start(covariance=((1, 0), (0, 1), (0, 0))), COVARIANCE),
        (lambda: Start(covariance=((1, 0, 0), (0, 1, 0))), r"^start\.covariance\[0\]: got "),
        (lambda: scene(start=Start(math.pi / 2)), r"^start\.angle: got 1\.57.*overturning\.angle = 1\.57"),
        (lambda: scene(start=Start(-2.0)), r"^start\.angle: got -2\.0, accepted: an absolute value below"),
        (lambda: scene(start=Start(0.5), overturning=Overturning(0.4)), r"^start\.angle: .*overturning\.angle = 0\.4$"),
    ],
)
def test_values_out_of_bounds_are_refused(make, message):
    with pytest.raises(ValueError, match=message):
        make()


def test_the_ends_of_the_range_of_the_engines_belong_to_it():
    ranges.check(scene(noise=BandNoise(0.04, (0.0, 1e4), 100_000)))
    for band, harmonics, name in (((0.0, 10_001.0), 100_000, "band"), ((0.0, 1e4), 100_001, "harmonics")):
        with pytest.raises(ValueError, match=rf"^noise\.{name}: .*the range of the engines"):
            ranges.check(scene(noise=BandNoise(0.04, band, harmonics)))


@pytest.mark.parametrize(
    ("start", "got"), [(Start(1e-12), "angle: got 1e-12"), (Start(0.0, -1e-6), "velocity: got -1e-06")]
)
def test_an_elastic_block_that_bounces_without_end_is_refused(start, got):
    ranges.check(scene(start=start))
    with pytest.raises(
        ValueError, match=rf"^start\.{got}, accepted: 0, or a start that leads to impacts of speed 1e-05"
    ):
        ranges.check(scene(start=start, block=Block(1.0)))


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: BandNoise(1, 3, 1), r"^noise\.band: got 3, " + BAND),
        (lambda: BandNoise(1, "01", 1), r"^noise\.band: got '01', "),
        (lambda: BandNoise(1, (0, 1), 100.0), r"^noise\.harmonics: got 100\.0, accepted: a whole number"),
        (lambda: Start(covariance=0.01), r"^start\.covariance: got 0\.01, "),
        (lambda: Start(covariance=(1, 1)), r"^start\.covariance\[0\]: got 1, "),
        (lambda: Block(0.5, (1, 2)), r"^block\.dimensions: got \(1, 2\), accepted: Dimensions$"),
        (lambda: scene(block=0.5), r"^block: got 0\.5, accepted: Block$"),
        (
            lambda: scene(noise=None),
            r"^noise: got None, accepted: BandNoise or WhiteNoise or FilteredNoise or NoNoise$",
        ),
        (lambda: scene(start=(0, 0)), r"^start: got \(0, 0\), accepted: Start$"),
    ],
)
def test_wrong_types_are_refused(make, message):
    with pytest.raises(TypeError, match=message):
        make()


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            "restitution",
            "restituton",
            r"block\.restituton: unknown, accepted: restitution, dimensions, .*; did you mean ",
        ),
        ("amplitude", "phase = 1\nx", r"forcing\.x: unknown, accepted: amplitude, frequency, phase$"),
        ("[forcing]", "[forcign]", r"forcign: unknown, .*did you mean forcing\?$"),
        ('kind = "none"', 'kind = "none"\nvariance = 1', r"noise\.variance: unknown, accepted: no key$"),
        ("frequency = 2.7", "", r"forcing\.frequency: missing, required: amplitude, frequency$"),
        ('[noise]\nkind = "none"', "", r'^noise: missing, required: \[noise\]; kind = "none" says that there is none$'),
        ('kind = "none"', "", r"noise\.kind: missing, accepted: 'band', 'white', 'filtered', 'none'$"),
        ('"none"', '"pink"', r"noise\.kind: got 'pink', accepted: 'band', 'white', 'filtered', 'none'$"),
        ('"none"', "3", r"noise\.kind: got 3, accepted: 'band', 'white', 'filtered', 'none'$"),
        ('"none"', '"white"', r"noise\.diffusion: missing, required: diffusion$"),
        ('"none"', '"band"', r"noise\.variance: missing, required: variance, band$"),
        ("0.5", "nan", r"block\.restitution: got nan"),
        ("[block]", "[block", r"^not valid TOML: "),
    ],
)
def test_toml_keys_are_refused_by_name(old, new, message):
    assert old in MINIMAL
    with pytest.raises(ValueError, match=message):
        Scene.from_toml(MINIMAL.replace(old, new))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("start = 3\n" + MINIMAL, r"^start: got 3, accepted: a table \[start\]$"),
        (MINIMAL.replace('[noise]\nkind = "none"', "").replace("[block]", "noise = 1\n[block]"), r"^noise: got 1, "),
        (MINIMAL.replace("0.5", '"0.5"'), r"^block\.restitution: got '0\.5', accepted: a finite number"),
        (MINIMAL.replace("0.5", "0.5\ndimensions = 2"), r"^block\.dimensions: got 2, accepted: a table"),
    ],
)
def test_toml_types_are_refused_by_name(text, message):
    with pytest.raises(TypeError, match=message):
        Scene.from_toml(text)


def test_scene_file_errors_name_the_file(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"no scene file .*absent\.toml"):
        load_scene(tmp_path / "absent.toml")
    bad = tmp_path / "bad.toml"
    bad.write_text(MINIMAL.replace("0.5", "1.5"))
    with pytest.raises(ValueError, match=r"bad\.toml: block\.restitution: got 1\.5"):
        load_scene(bad)
    bad.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ValueError, match=r"bad\.toml: not a text file in UTF-8"):
        load_scene(bad)


def test_white_equivalent_changes_the_noise_alone():
    main = load_scene(SCENES / "main.toml")
    white = main.white_equivalent()
    assert white == dataclasses.replace(main, noise=WhiteNoise(melnikov.equivalent_diffusion(main.noise)))
    assert white.noise.diffusion == pytest.approx(0.00628, abs=5e-6)
    assert white.white_equivalent() is white
    assert scene().white_equivalent().noise == WhiteNoise(0.0)


def test_varied_changes_what_it_is_told_alone():
    main = load_scene(SCENES / "main.toml")
    varied = main.varied(block={"restitution": 1}, noise={"variance": 0.01, "band": (0, 5)})
    assert varied == dataclasses.replace(main, block=Block(1.0), noise=BandNoise(0.01, (0.0, 5.0), 100))
    assert main.varied(noise=NoNoise()) == dataclasses.replace(main, noise=NoNoise())
    with pytest.raises(ValueError, match=r"noise\.varience: unknown, accepted: .*did you mean noise\.variance\?"):
        main.varied(noise={"varience": 0.01})
    with pytest.raises(ValueError, match=r"blocks: unknown, accepted: block, .*did you mean block\?"):
        main.varied(blocks={"restitution": 1})
    with pytest.raises(TypeError, match=r"forcing: got 4\.2, accepted: Forcing"):
        main.varied(forcing=4.2)


def test_a_remark_belongs_to_the_values_of_its_noise():
    """It is kept in files, does not make scenes differ, and is dropped when the values are varied."""
    text = 'Band "inferred" from C:\\data, σ too'
    assumed = scene(noise=BandNoise(0.04, (0.0, 10.0), 100, text))
    assert assumed == scene(noise=BandNoise(0.04, (0.0, 10.0), 100))
    assert Scene.from_toml(assumed.to_toml()).noise.remark == text
    assert "remark" not in scene(noise=BandNoise(0.04, (0.0, 10.0), 100)).to_toml()
    assert assumed.varied(block={"restitution": 0.7}).noise.remark == text
    assert assumed.varied(noise={"band": (0.0, 5.0)}).noise.remark == ""
    assert assumed.varied(noise={"variance": 0.01, "remark": "ours"}).noise.remark == "ours"
    for remark, error in (("two\nlines", ValueError), (5, TypeError)):
        with pytest.raises(error, match=r"noise.remark: got .*, accepted: a text of one line that can be printed"):
            BandNoise(0.04, (0.0, 10.0), 100, remark)


def test_only_the_projects_own_scenes_remark_on_their_band(capsys, tmp_path):
    """A user's scene with the same band says nothing about the paper."""
    main = load_scene(SCENES / "main.toml")
    own = Scene(main.block, main.forcing, BandNoise(0.04, (0.0, 10.0), 100))
    (tmp_path / "own.toml").write_text(own.to_toml(), encoding="utf-8")
    for path, said in ((SCENES / "main.toml", True), (tmp_path / "own.toml", False)):
        assert cli.main(["mc", str(path), "--cycles", "1", "--realizations", "10"]) == 0
        assert ("paper states no noise band" in " ".join(capsys.readouterr().out.split())) == said
