"""Scaled and resized scenes against scenes built anew from metres and seconds, and intensities in closed form."""

import dataclasses
import math
import warnings

import numpy as np
import pytest

from fpk_rocking.envelopes import Exponential, Table, Trapezoid
from fpk_rocking.risk import drawn, intensities
from fpk_rocking.risk.motions import measured
from fpk_rocking.scene import (
    Block,
    Body,
    FilteredNoise,
    Harmonic,
    Harmonics,
    NoNoise,
    Pulse,
    Record,
    Scene,
    Start,
    WhiteNoise,
)
from fpk_rocking.studies import grid, resized, scaled
from fpk_rocking.studies.scenes import varied

NOISE = {"noise_rms_acceleration": 0.3, "noise_band_hz": (0.0, 5.0)}
SAMPLES = np.random.default_rng(4).normal(size=60)
RECORD = Record(0.05, SAMPLES, "m/s2")
SHAKINGS = {
    "harmonic": {"peak_acceleration": 3.0, "frequency_hz": 1.5},
    "pulse": {"peak_acceleration": 3.0, "frequency_hz": 1.5, "pulse": "one-cosine"},
    "record": {"record": RECORD},
}


def numbers(value):
    """All numbers of a scene, in order."""
    if dataclasses.is_dataclass(value):
        return [number for field in dataclasses.fields(value) for number in numbers(getattr(value, field.name))]
    if isinstance(value, tuple):
        return [number for entry in value for number in numbers(entry)]
    return [value] if isinstance(value, int | float) else []


def same(scene, other):
    assert (scene.forcing.kind, scene.noise.kind) == (other.forcing.kind, other.noise.kind)
    assert np.allclose(numbers(scene), numbers(other), rtol=1e-13, atol=0.0)


@pytest.mark.parametrize("kind", SHAKINGS)
def test_a_resized_block_is_that_block_under_the_same_shaking(kind):
    old = Scene.from_block(0.6, 2.0, **SHAKINGS[kind], **NOISE)
    same(resized(old, width=0.9, height=4.0), Scene.from_block(0.9, 4.0, **SHAKINGS[kind], **NOISE))
    same(resized(old, height=4.0), Scene.from_block(0.6, 4.0, **SHAKINGS[kind], **NOISE))
    dull = Scene.from_block(0.6, 2.0, restitution=0.8, **SHAKINGS[kind], **NOISE)
    assert resized(dull, width=0.9).block.restitution == 0.8
    if kind == "record":
        assert np.allclose(resized(old, width=0.9).forcing.forces, SAMPLES / (9.80665 * math.atan2(0.9, 2.0)))


@pytest.mark.parametrize("kind", SHAKINGS)
def test_scaled_shaking(kind):
    def times(factor, noise=1.0):
        peak = (
            {"peak_acceleration": 3.0 * factor}
            if kind != "record"
            else {"record": Record(0.05, SAMPLES, "m/s2", factor)}
        )
        rms = {"noise_rms_acceleration": 0.3 * noise}
        return Scene.from_block(0.6, 2.0, **SHAKINGS[kind] | peak | NOISE | rms)

    same(scaled(times(1.0), 1.7), times(1.7, 1.7))
    same(scaled(times(1.0), 1.7, noise=False), times(1.7))


def test_what_is_physical_is_kept():
    """Noise of a dull spectrum, and a start in radians and seconds, on blocks of three times the width."""
    start = Start(0.3, 0.2, ((0.01, 0.004), (0.004, 0.02)))
    forcing = Harmonics(2.0, (1.0, 0.5), (0.1, 0.2))
    small = Scene.from_block(0.3, 2.0, 1.0, 1.0)
    for noise in (WhiteNoise(0.02), FilteredNoise("low-pass", 0.04, 9.0, 0.7), NoNoise()):
        old = dataclasses.replace(small, noise=noise, start=start, forcing=forcing)
        new = resized(old, width=0.9)
        kept = []
        for scene in (old, new):
            size = scene.block.dimensions
            angle, p, unit = size.critical_angle, size.frequency_parameter, size.gravity * size.critical_angle
            (xx, xv), (_, vv) = scene.start.covariance
            rows = [scene.start.angle * angle, scene.start.velocity * angle * p, scene.forcing.frequency * p]
            rows += [xx * angle**2, xv * angle**2 * p, vv * (angle * p) ** 2]
            rows += [unit * amplitude for amplitude in scene.forcing.amplitudes]
            if noise.kind == "white":
                # The velocity that it gives in a second has the variance 2D p (g θ_cr / p)².
                rows.append(2.0 * scene.noise.diffusion * p * (unit / p) ** 2)
            if noise.kind == "filtered":
                rows += [scene.noise.variance * unit**2, scene.noise.frequency * p]
            kept.append(rows)
        assert np.allclose(*kept, rtol=1e-13)


@pytest.mark.parametrize(
    "envelope", [Trapezoid(1.0, 3.0, 2.0), Exponential(2.5), Table((0.0, 1.0, 4.0), (0.0, 1.0, 0.2))]
)
def test_envelopes_keep_their_seconds(envelope):
    old = Scene.from_block(0.3, 2.0, 1.0, 1.0, **NOISE)
    old = old.varied(noise=dataclasses.replace(old.noise, envelope=envelope))
    new = resized(old, width=0.9)
    seconds = np.linspace(0.0, 3.0, 50)
    values = [scene.noise.envelope.value(scene.block.dimensions.tau(seconds)) for scene in (old, new)]
    assert np.allclose(*values, rtol=1e-12, atol=1e-12)
    twice = {"forcing": {"amplitude": 2.0 * old.forcing.amplitude}, "noise": {"variance": 4.0 * old.noise.variance}}
    same(scaled(old, 2.0), old.varied(**twice))


def test_similar_blocks_have_one_scene():
    """Of four times the size and the same slenderness, a block has the same scene under shaking of half the rate."""
    old = Scene.from_block(0.6, 2.0, 3.0, 1.5, noise_rms_acceleration=0.3, noise_band_hz=(0.0, 5.0))
    slow = Scene.from_block(0.6, 2.0, 3.0, 0.75, noise_rms_acceleration=0.3, noise_band_hz=(0.0, 2.5))
    new = varied(slow, "size", 4.0 * old.block.dimensions.half_diagonal)
    new = dataclasses.replace(new, block=old.block)
    same(new, old)


def test_sizes_and_slendernesses():
    scene = Scene.from_block(0.6, 2.0, 3.0, 1.5)
    radius = scene.block.dimensions.half_diagonal
    for name, value, slenderness, half in (("size", 2.5, 2.0 / 0.6, 2.5), ("slenderness", 7.0, 7.0, radius)):
        size = varied(scene, name, value).block.dimensions
        assert size.height / size.width == pytest.approx(slenderness, rel=1e-13)
        assert size.half_diagonal == pytest.approx(half, rel=1e-13)


@pytest.mark.parametrize(
    ("axes", "error", "text"),
    [
        ({"mass": [1.0]}, ValueError, "parameter: got 'mass', accepted: a dotted name"),
        ({"bolck.restitution": [1.0]}, ValueError, "parameter: got 'bolck.restitution', accepted: a dotted name"),
        ({"block": [1.0]}, ValueError, "parameter: got 'block', accepted: a dotted name"),
        ({"forcing.amplitud": [1.0]}, ValueError, "forcing.amplitud: unknown, accepted: .*did you mean"),
        ({"size": [1.0]}, ValueError, r"parameter: got 'size', accepted: only where the scene has"),
        ({"scale": [0.0]}, ValueError, "factor: got 0.0, accepted: a finite number > 0"),
        ({"scale": 1.0}, TypeError, r"axes\['scale'\]: got 1.0"),
        ({}, TypeError, "axes: got {}"),
        ([("scale", 1.0)], TypeError, "axes: got"),
    ],
)
def test_bad_grids_are_refused(axes, error, text):
    scene = Scene(block=Block(0.5), forcing=Harmonic(4.6, 2.7, 0.0), noise=NoNoise())
    with pytest.raises(error, match=text):
        grid(scene, axes)


def test_whole_numbers_stay_whole():
    scene = Scene.from_block(0.6, 2.0, 3.0, 1.5, **NOISE)
    assert varied(scene, "noise.harmonics", 30.0).noise.harmonics == 30


def forced(forcing):
    return Scene(block=Block(0.5), forcing=forcing, noise=NoNoise())


@pytest.mark.parametrize(
    ("forcing", "acceleration", "velocity"),
    [
        (Harmonic(4.0, 2.5, 1.0), 4.0, 1.6),
        (Harmonic(0.0, 2.5, 1.0), 0.0, 0.0),
        (Pulse("one-sine", 4.0, 2.5), 4.0, 3.2),
        (Pulse("one-cosine", 4.0, 2.5), 4.0, 1.6),
        (Pulse("n-sine", 4.0, 2.5, 3), 4.0, 3.2),
        # ∫ (1 - y²) exp(-y²/2) dy = y exp(-y²/2), largest at y = 1; y = Ωτ/√2.
        (Pulse("symmetric-ricker", 4.0, 2.5), 4.0, 1.6 * math.sqrt(2.0) * math.exp(-0.5)),
    ],
    ids=str,
)
def test_intensities_in_closed_form(forcing, acceleration, velocity):
    result = intensities(forced(forcing))
    assert result.acceleration == pytest.approx(acceleration, rel=1e-12)
    assert result.velocity == pytest.approx(velocity, rel=1e-7)
    assert result.relative_velocity == result.velocity
    assert np.isnan([result.pga, result.pgv]).all()


def test_intensities_of_several_harmonics():
    forcing = Harmonics(2.0, (1.0, 0.8), (0.3, 1.1))
    time = np.linspace(0.0, forcing.period, 200_001)
    velocity = -np.sin(2.0 * time + 0.3) / 2.0 - 0.8 * np.sin(4.0 * time + 1.1) / 4.0
    result = intensities(forced(forcing))
    assert result.velocity == pytest.approx(np.abs(velocity).max(), rel=1e-9)


def test_the_velocity_of_a_drift_is_warned_of():
    """Once corrected, and where it does not drift, not; nor by the measures that results with a verdict take."""
    drifting = Record(0.01, tuple(0.04 + math.sin(0.1 * k) for k in range(4001)), "m/s2", source="BAM.AT2")
    scene = Scene.from_block(0.5, 1.8, record=drifting)
    with pytest.warns(UserWarning, match=r"BAM.AT2 drifts: its PGV is 1.\d+ m/s as recorded, but "):
        result = intensities(scene)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert measured(scene) == result
        intensities(Scene.from_block(0.5, 1.8, record=dataclasses.replace(drifting, baseline="high-pass")))


def test_intensities_with_units():
    scene = Scene.from_block(0.6, 2.0, record=RECORD)
    size, time = scene.block.dimensions, np.linspace(0.0, 59 * 0.05, 590_001)
    course = np.interp(time, np.arange(60) * 0.05, SAMPLES)
    pgv = np.abs(np.cumsum(0.5 * (course[1:] + course[:-1]) * np.diff(time))).max()
    result = intensities(scene)
    assert result.pga == pytest.approx(np.abs(SAMPLES).max(), rel=1e-13)
    assert result.pgv == pytest.approx(pgv, rel=1e-8)
    tangent = 0.6 / 2.0
    assert result.relative_velocity == pytest.approx(size.frequency_parameter * pgv / (9.80665 * tangent), rel=1e-8)
    assert np.allclose(intensities(scaled(scene, 2.5))[:4], 2.5 * np.array(result[:4]), rtol=1e-12)


@pytest.mark.parametrize("kind", list(SHAKINGS))
def test_a_body_with_another_length_is_that_body_under_the_same_shaking(kind):
    lengths = {"height_of_centre": 1.1, "right": 0.3, "left": 0.38, "radius_of_gyration": 0.62}
    old = Scene.from_block(body=Body(**lengths), **SHAKINGS[kind], **NOISE)
    # 0.25 on the left makes that the side that falls more easily, which is the unit of all angles.
    for name, value in (("height_of_centre", 1.4), ("left", 0.25), ("right", 0.36), ("radius_of_gyration", 0.8)):
        new = varied(old, name, value)
        same(new, Scene.from_block(body=Body(**lengths | {name: value}), **SHAKINGS[kind], **NOISE))
        assert new.block.body == Body(**lengths | {name: value})
    own = dataclasses.replace(old, block=Block((0.8, 0.7), body=old.block.body))
    assert varied(own, "left", 0.25).block.restitution == (0.8, 0.7)


def test_lengths_and_restitutions_of_a_body_are_drawn():
    old = Scene.from_block(body=Body(1.1, 0.3, 0.38, 0.62), **SHAKINGS["harmonic"])
    draws = drawn(old, {"radius_of_gyration_factor": "uniform:0.9:1.1", "block.restitution_factor": "uniform:0.9:1"}, 4)
    for scene, factor, loss in zip(draws.scenes, *draws.values.values(), strict=True):
        body = Body(1.1, 0.3, 0.38, 0.62 * factor)
        assert scene.block.body == body
        assert scene.block.restitution == pytest.approx(tuple(loss * e for e in body.restitution), rel=1e-15)
    with pytest.raises(ValueError, match=r"parameter: got 'left', accepted: only where the scene has \[block.body\]"):
        varied(Scene.from_block(0.6, 2.0, **SHAKINGS["harmonic"]), "left", 0.3)
