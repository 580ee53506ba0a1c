"""Metres, seconds and hertz against the nondimensional scene."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from fpk_rocking import BandNoise, Block, Dimensions, NoNoise, Scene, Start, WhiteNoise, load_scene
from fpk_rocking.scene import Record
from fpk_rocking.scene.ranges import implausible
from fpk_rocking.scene.units import in_units


def test_a_block_in_round_numbers():
    size = Dimensions(width=0.6, height=0.8, gravity=10.0)
    assert size.half_diagonal == pytest.approx(0.5, rel=1e-15)
    assert size.critical_angle == pytest.approx(math.atan(0.75), rel=1e-15)
    assert size.frequency_parameter == pytest.approx(math.sqrt(15.0), rel=1e-15)
    assert size.restitution == pytest.approx(1 - 1.5 * 0.36, rel=1e-15)
    assert size.amplitude(3.0) == pytest.approx(0.3 / math.atan(0.75), rel=1e-15)
    assert size.frequency(2.0) == pytest.approx(4 * math.pi / math.sqrt(15.0), rel=1e-15)
    assert size.radians(1.0) == size.critical_angle


@pytest.mark.parametrize("name", ["width", "height", "gravity"])
def test_sizes_that_no_conversion_survives_are_refused(name):
    for good in (1e-100, 1e100):
        size = Dimensions(**{"width": 0.5, "height": 2.0} | {name: good})
        converted = [size.amplitude(1.0), size.frequency(1.0), size.seconds(1.0), size.tau(1.0), size.radians(1.0)]
        assert all(0.0 < value < math.inf for value in converted)
    for bad in (9e-101, 1.1e100, 5e-324, 1e308):
        with pytest.raises(ValueError, match=rf"^block\.dimensions\.{name}: got .* >= 1e-100 and <= 1e\+100$"):
            Dimensions(**{"width": 0.5, "height": 2.0} | {name: bad})


def test_seconds_and_tau_undo_each_other_on_arrays():
    size, times = Dimensions(0.5, 2.0), np.linspace(0.0, 40.0, 7)
    np.testing.assert_allclose(size.tau(size.seconds(times)), times, rtol=1e-15)
    assert size.tau(1.0) == size.frequency_parameter


def test_slender_block_moves_as_the_full_equation_of_motion_in_metres_and_seconds():
    """I θ'' = -m g R sin(θ_cr - θ) + m a R cos(θ_cr - θ), I = 4mR²/3, against the linear scene; θ_cr = 0.02."""
    width, height, peak, hertz = 0.02, 1.0, 0.5, 1.0
    size = Dimensions(width, height)
    radius, critical, gravity = size.half_diagonal, size.critical_angle, size.gravity
    scene = Scene.from_block(width, height, peak, hertz, phase=math.pi)

    def full(time, state):
        base = peak * math.cos(2 * math.pi * hertz * time)
        lean = critical - state[0]
        return [state[1], 3 / (4 * radius) * (-gravity * math.sin(lean) + base * math.cos(lean))]

    def linear(tau, state):
        forcing = -scene.forcing.amplitude * math.cos(scene.forcing.frequency * tau + scene.forcing.phase)
        return [state[1], state[0] - 1.0 + forcing]

    seconds = 0.3
    angle = solve_ivp(full, (0, seconds), [0.0, 0.0], rtol=1e-10, atol=1e-13).y[0, -1]
    scaled = solve_ivp(linear, (0, size.tau(seconds)), [0.0, 0.0], rtol=1e-10, atol=1e-12).y[0, -1]
    assert angle > 0.3 * critical
    assert size.radians(scaled) == pytest.approx(angle, rel=1e-3)


def test_housner_restitution_conserves_angular_momentum_about_the_new_corner():
    """Before: turning about the old corner; the centre's velocity is perpendicular to the old radius, length R·rate."""
    size = Dimensions(0.7, 1.9)
    radius, half_width, half_height, rate = size.half_diagonal, 0.35, 0.95, 1.3
    centre_velocity = rate * np.array([-half_height, half_width])
    from_new_corner = np.array([-half_width, half_height])
    orbital = from_new_corner[0] * centre_velocity[1] - from_new_corner[1] * centre_velocity[0]
    spin = radius**2 / 3 * rate
    after = (orbital + spin) / (4 / 3 * radius**2)
    assert after / rate == pytest.approx(size.restitution, rel=1e-14)


def test_squat_block_needs_a_restitution():
    with pytest.raises(ValueError, match=r"^block\.dimensions: got width/height = 1\.5, .*give block\.restitution"):
        Scene.from_block(1.5, 1.0, 1.0, 1.0)
    assert Scene.from_block(1.5, 1.0, 1.0, 1.0, restitution=0.2).block == Block(0.2, Dimensions(1.5, 1.0))
    assert Dimensions(math.sqrt(2.0) * (1 - 1e-12), 1.0).restitution >= 0.0


def test_the_moments_of_a_slender_block_are_off_by_these():
    """At rest gravity turns with sin θ_cr and the shaking with cos θ_cr, where the slender model has θ_cr and 1."""
    angle = math.atan2(2.0, 2.6)
    gravity, shaking = Dimensions(2.0, 2.6).slenderness_error
    assert gravity * math.sin(angle) == pytest.approx(angle - math.sin(angle))
    assert shaking * math.cos(angle) == pytest.approx(1.0 - math.cos(angle))


def test_from_block_converts_every_quantity():
    start = Start(0.1, 0.2)
    scene = Scene.from_block(
        0.5, 2.0, 4.0, 1.5, phase=0.3, noise_rms_acceleration=0.7, noise_band_hz=(0.5, 6.0), harmonics=50, start=start
    )
    size = Dimensions(0.5, 2.0)
    assert scene.block == Block(size.restitution, size)
    assert scene.forcing.amplitude == pytest.approx(4.0 / (9.80665 * math.atan(0.25)), rel=1e-15)
    assert size.seconds(scene.period) == pytest.approx(1 / 1.5, rel=1e-15)
    assert scene.forcing.phase == 0.3
    assert scene.noise.variance == pytest.approx(size.amplitude(0.7) ** 2, rel=1e-15)
    assert scene.noise.band == (size.frequency(0.5), size.frequency(6.0))
    assert scene.noise.harmonics == 50
    assert scene.start == start
    assert Scene.from_block(0.5, 2.0, 4.0, 1.5).noise == NoNoise()
    assert isinstance(scene.noise, BandNoise)


def test_noise_in_units_has_stratified_harmonics_enough_for_its_duration():
    """Width of the band in Hz times seconds: 30 cycles, or the duration of a pulse; a file says the same."""
    noise = {"noise_rms_acceleration": 0.7, "noise_band_hz": (0.5, 20.5)}
    scene = Scene.from_block(0.5, 2.0, 4.0, 1.5, **noise)
    assert (scene.noise.frequencies, scene.noise.harmonics) == ("stratified", 400)
    pulsed = Scene.from_block(0.5, 2.0, 4.0, 0.1, pulse="one-sine", **noise)
    assert (pulsed.noise.frequencies, pulsed.noise.harmonics) == ("stratified", 200)
    assert Scene.from_block(0.5, 2.0, 4.0, 1.5, **noise | {"noise_band_hz": (0.0, 1.0)}).noise.harmonics == 100
    paper = Scene.from_block(0.5, 2.0, 4.0, 1.5, frequencies="independent", **noise)
    assert (paper.noise.frequencies, paper.noise.harmonics) == ("independent", 100)
    assert all(Scene.from_toml(one.to_toml()) == one for one in (scene, pulsed, paper))
    table = '[noise]\nkind = "band"\nrms_acceleration = 0.7\nband_hz = [0.5, 20.5]\n'
    head = "[block.dimensions]\nwidth = 0.5\nheight = 2\n[forcing]\npeak_acceleration = 4\nfrequency_hz = 1.5\n"
    assert Scene.from_toml(table + head) == scene
    assert Scene.from_toml(head + table + 'frequencies = "independent"\n') == paper
    assert Scene.from_toml(head + table + "harmonics = 7\n").noise.harmonics == 7
    sizeless = "[block]\nrestitution = 0.5\n[forcing]\namplitude = 1\nfrequency = 2\n"
    plain = Scene.from_toml(sizeless + '[noise]\nkind = "band"\nvariance = 1\nband = [0, 90]')
    assert (plain.noise.frequencies, plain.noise.harmonics) == ("independent", 100)
    with pytest.raises(ValueError, match=r"^noise\.frequencies: got 'even', accepted: 'independent' or 'stratified'$"):
        Scene.from_toml(head + table + 'frequencies = "even"\n')


@pytest.mark.parametrize(
    ("keywords", "message"),
    [
        ({"width": 0.0}, r"^block\.dimensions\.width: got 0\.0, accepted: a finite number > 0"),
        ({"peak_acceleration": -1.0}, r"^peak_acceleration: got -1\.0, "),
        ({"frequency_hz": 0.0}, r"^frequency_hz: got 0\.0, "),
        ({"restitution": 1.5}, r"^block\.restitution: got 1\.5, "),
        ({"noise_rms_acceleration": 0.3}, r"^noise_rms_acceleration: got 0\.3, .*together with noise_band_hz"),
        ({"noise_band_hz": (0, 3)}, r"^noise_rms_acceleration: got 0\.0, .*together with noise_band_hz"),
        ({"noise_rms_acceleration": 1, "noise_band_hz": (3, 2)}, r"^noise_band_hz: got \(3, 2\), accepted: two "),
    ],
)
def test_from_block_refuses_by_name(keywords, message):
    values = {"width": 0.5, "height": 2.0, "peak_acceleration": 1.0, "frequency_hz": 1.0}
    with pytest.raises(ValueError, match=message):
        Scene.from_block(**values | keywords)


SI = """
[block.dimensions]
width = "60 cm"
height = 2
[forcing]
peak_acceleration = "0.3 g"
frequency_hz = "1.5 Hz"
[noise]
kind = "band"
rms_acceleration = "50 gal"
band_hz = [0.0, 8]
harmonics = 30
envelope = {kind = "trapezoid", rise_s = 2, hold_s = "4000 ms", decay_s = 3.0}
[start]
angle_deg = 2
"""


def test_a_scene_file_takes_units_as_python_does():
    scene = Scene.from_toml(SI)
    size = Dimensions(0.6, 2.0)
    same = Scene.from_block(
        "60 cm", 2.0, "0.3 g", 1.5, noise_rms_acceleration=0.5, noise_band_hz=("0 Hz", 8), harmonics=30
    )
    assert (scene.block, scene.forcing) == (same.block, same.forcing)
    assert scene.forcing.amplitude == pytest.approx(0.3 / size.critical_angle, rel=1e-15)
    assert scene.noise.band == same.noise.band
    assert scene.noise.variance == pytest.approx(size.amplitude(0.5) ** 2, rel=1e-15)
    envelope = scene.noise.envelope
    assert size.seconds(np.array([envelope.rise, envelope.hold, envelope.decay])) == pytest.approx([2.0, 4.0, 3.0])
    assert size.radians(scene.start.angle) == pytest.approx(math.radians(2.0), rel=1e-15)
    assert Scene.from_toml(scene.to_toml()) == scene


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('"0.3 g"', '"0.3 gg"', r"^forcing\.peak_acceleration: got '0\.3 gg', .*such as \"0\.3 m/s2\""),
        ('"0.3 g"', '"0.3"', r"^forcing\.peak_acceleration: got '0\.3', .*\(m/s2, g, cm/s2\)"),
        ('"0.3 g"', '"-1 g"', r"^forcing\.peak_acceleration: got -9\.8"),
        ("peak_acc", "amplitude = 1\npeak_acc", r"^forcing\.peak_acceleration: .*nothing beside forcing\.amplitude$"),
        ("peak_acceleration", "amplitude", r"^forcing\.amplitude: .*it is forcing\.peak_acceleration = '0\.3 g'$"),
        ("[0.0, 8]", '[0.0, "8 m"]', r"^noise\.band_hz\[1\]: got '8 m', .*\(Hz, rad/s\)"),
        ('"4000 ms"', "true", r"^noise\.envelope\.hold_s: got True"),
        ('"60 cm"', '"0.6 s"', r"^block\.dimensions\.width: got '0\.6 s', accepted: a number in m"),
    ],
)  # fmt: skip
def test_units_that_do_not_fit_are_refused_by_name(old, new, message):
    with pytest.raises((TypeError, ValueError), match=message):
        Scene.from_toml(SI.replace(old, new))


def test_without_dimensions_there_are_no_units():
    sizeless = SI.replace('[block.dimensions]\nwidth = "60 cm"\nheight = 2', "[block]\nrestitution = 0.5")
    with pytest.raises(
        ValueError, match=r"^forcing\.peak_acceleration: got '0\.3 g', accepted: a scene with \[block\.dim"
    ):
        Scene.from_toml(sizeless)


@pytest.mark.parametrize(
    ("text", "kind", "value"),
    [
        ("2 ft", "length", 0.6096), ("1e3mm", "length", 1.0), (" .5 G ", "acceleration", 4.903325),
        ("3 m/s^2", "acceleration", 3.0), ("6.283185307179586 rad/s", "frequency", 1.0), ("180°", "angle", math.pi),
        (90, "angle", 0.5 * math.pi), (2, "time", 2),
    ],
)  # fmt: skip
def test_quantities_are_read_in_their_units(text, kind, value):
    assert in_units("x", text, kind) == pytest.approx(value, rel=1e-15)


def test_values_set_replace_those_of_a_file(tmp_path):
    file = tmp_path / "block.toml"
    file.write_text(SI)
    changes = {"forcing.amplitude": 1.5, "noise.kind": "none", "block.dimensions.width": 0.5, "block.restitution": 0.8}
    scene = load_scene(file, changes)
    assert scene.forcing.amplitude == 1.5  # in place of the peak acceleration
    assert scene.noise == NoNoise()
    assert (scene.block.dimensions.width, scene.block.restitution) == (0.5, 0.8)
    assert load_scene("main", {"noise.kind": "white", "noise.diffusion": 0.01}).noise == WhiteNoise(0.01)
    with pytest.raises(ValueError, match=r"forcing\.speed: unknown"):
        load_scene(file, {"forcing.speed": 3})
    with pytest.raises(TypeError, match=r"forcing\.peak_acceleration: got '0\.3 g', accepted: a table"):
        load_scene(file, {"forcing.peak_acceleration.x": 3})


def test_what_was_hardly_meant_is_named():
    plain = Scene.from_block(0.6, 2.0, "0.4 g", 1.5)
    assert implausible(plain) == []
    assert implausible(load_scene("main")) == []
    turned = load_scene("main").varied(forcing={"phase": 180.0})
    assert implausible(turned) == ["forcing.phase is 180 rad; was 3.142 meant (180 degrees)?"]
    (width, height, *_) = implausible(Scene.from_block(600.0, 2000.0, 3.0, 1.5))
    assert width == "block.dimensions.width is 600 m; was 0.6 m meant?"
    assert height.startswith("block.dimensions.height is 2000 m")
    high = Scene.from_block(30.0, 110.0, "2 g", 1.5)
    assert any(said.endswith("is 110 m; was 1.1 m or 0.11 m meant?") for said in implausible(high))
    (small,) = implausible(Scene.from_block(0.0006, 0.01, "2 g", 1.5))
    assert small == "block.dimensions.width is 0.0006 m; was 0.6 m meant?"
    (weak,) = implausible(Scene.from_block(0.6, 2.0, 0.3, 1.5))
    assert "is 0.3 m/s² (0.031 g), and this block lifts off above 2.942 m/s² (0.3 g)" in weak
    assert "Was 0.3 g meant?" in weak
    noisy = {"noise_rms_acceleration": 1.0, "noise_band_hz": (0.0, 8.0)}
    assert implausible(Scene.from_block(0.6, 2.0, 0.3, 1.5, **noisy)) == []
    assert implausible(Scene.from_block(0.6, 2.0, 0.3, 1.5), 0.1, 10.0) == []
    (strong,) = implausible(Scene.from_block(0.6, 2.0, 300.0, 1.5))
    assert strong == "The peak acceleration of the forcing is 300 m/s² (31 g); was 3 m/s² meant (cm/s²)?"
    assert implausible(Scene.from_block(0.6, 2.0, 300.0, 1.5), 0.01, 1.0) == []


def test_a_record_has_harmonics_for_its_own_duration():
    """Band of 30 Hz times a record of 5 s; the text without the number of harmonics gives the same scene."""
    motion = Record(0.01, [0.0, *np.sin(np.arange(500))], "m/s2")
    scene = Scene.from_block(0.5, 1.8, record=motion, noise_rms_acceleration=0.3, noise_band_hz=(0, 30))
    assert (scene.noise.harmonics, scene.noise.frequencies) == (150, "stratified")
    text = scene.to_toml()
    assert Scene.from_toml(text) == scene
    assert Scene.from_toml(text.replace("harmonics = 150\n", "")) == scene
