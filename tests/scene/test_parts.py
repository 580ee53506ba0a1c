"""Bodies of any shape: their numbers against mechanics, their form in files, and what is refused of them."""

import dataclasses
import math

import numpy as np
import pytest

from fpk_rocking import (
    Block,
    Body,
    Dimensions,
    Harmonic,
    NoNoise,
    Overturning,
    Scene,
    Start,
    WhiteNoise,
)
from fpk_rocking.scene import ranges

STATUE = Body(1.1, right=0.30, left=0.38, radius_of_gyration=0.62)
SCENE = Scene(Block(body=STATUE), Harmonic(1.3, 2.2), WhiteNoise(0.02))
G = 9.80665


def parts_of(body):
    """Point masses (m, x, y) with the centre, at x = 0, and the moment of inertia of a body of mass 1."""
    reach = body.radius_of_gyration
    return np.array(
        [(0.25, dx, body.height_of_centre + dy) for dx, dy in ((reach, 0), (-reach, 0), (0, reach), (0, -reach))]
    )


@pytest.mark.parametrize("side", [-1, 1])
def test_restitution_keeps_the_angular_momentum_of_point_masses(side):
    body, corners = STATUE, {1: STATUE.right, -1: -STATUE.left}
    mass, x, y = parts_of(body).T
    from_old, from_new = x - corners[side], x - corners[-side]
    # Clockwise at rate 1 about the old corner; then about the new one.
    momentum = (mass * (y * y + from_new * from_old)).sum()
    e = momentum / (mass * (y * y + from_new**2)).sum()
    assert body.restitution[0 if side < 0 else 1] == pytest.approx(e, rel=1e-14)


def test_frequency_parameters_are_those_of_small_oscillations_of_the_hanging_body():
    for side, (rate, corner) in enumerate(zip(STATUE.frequency_parameters, (-STATUE.left, STATUE.right), strict=True)):
        mass, x, y = parts_of(STATUE).T
        inertia = (mass * ((x - corner) ** 2 + y * y)).sum()
        assert rate**2 == pytest.approx(G * math.hypot(corner, 1.1) / inertia, rel=1e-14)
        assert STATUE.acceleration_scales[side] == pytest.approx((rate / STATUE.frequency_parameter) ** 2, rel=1e-14)
    assert STATUE.critical_angle == pytest.approx(math.atan(0.30 / 1.1), rel=1e-15)
    assert STATUE.saddles == pytest.approx((math.atan(0.38 / 1.1) / STATUE.critical_angle, 1.0), rel=1e-15)


def test_a_homogeneous_rectangle_is_a_body():
    size = Dimensions(0.5, 1.8)
    body = Body(0.9, 0.25, 0.25, math.hypot(0.5, 1.8) / math.sqrt(12.0))
    for name in ("critical_angle", "frequency_parameter", "restitution"):
        assert getattr(body, name) == pytest.approx(getattr(size, name), rel=1e-15)
    assert body.levers == pytest.approx((0.75, 0.75), rel=1e-15)
    assert Block(body=body).symmetric


def test_a_scene_of_a_body_is_read_back_from_its_text():
    assert Scene.from_toml(SCENE.to_toml()) == SCENE
    one = SCENE.varied(block={"restitution": 0.9})
    assert not one.block.symmetric
    assert Scene.from_toml(one.to_toml()) == one
    text = """
        [block.body]
        height_of_centre = "110 cm"
        right = 0.30
        left = 0.38
        radius_of_gyration = 0.62
        [forcing]
        peak_acceleration = "0.5 g"
        frequency_hz = 1.0
        [noise]
        kind = "none"
        [overturning]
        angle_deg = 90
    """
    scene = Scene.from_toml(text)
    assert scene == Scene.from_block(
        body=STATUE, peak_acceleration="0.5 g", frequency_hz=1.0, overturning_angle="90 deg"
    )
    assert scene.overturning.angle * STATUE.critical_angle == pytest.approx(0.5 * math.pi, rel=1e-15)
    assert scene.forcing.amplitude == pytest.approx(0.5 / math.atan(0.30 / 1.1), rel=1e-14)


def test_two_equal_restitutions_are_one():
    middle = Body(1.1, 0.3, 0.3, 0.62)
    assert Block((0.9, 0.9), body=middle).restitution == 0.9
    assert Block((0.9, 0.8), body=middle).restitution_by_side == (0.9, 0.8)
    assert not Block((0.9, 0.8), body=middle).symmetric


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"restitution": (0.9, 1.2), "body": STATUE}, r"block.restitution: got \(0.9, 1.2\), accepted: a number, or"),
        ({"restitution": (0.9, 0.8), "dimensions": Dimensions(1, 2)}, "block.restitution: got"),
        ({"dimensions": Dimensions(1, 2), "body": STATUE}, "nothing beside block.dimensions"),
        ({"body": STATUE, "slender": True}, "block.slender: got True, accepted: false for a body of unequal sides"),
        ({"body": STATUE, "critical_angle": 0.3}, "as block.body says"),
        ({"body": Body(0.3, 1.0, 1.0, 0.3)}, r"block.body: got right \* left = 1 m²"),
    ],
)
def test_blocks_that_are_refused(arguments, message):
    with pytest.raises((TypeError, ValueError), match=message):
        Block(**arguments)


@pytest.mark.parametrize(
    ("use", "what"),
    [
        (lambda: SCENE.varied(noise=NoNoise()).white_equivalent(), "noise of equal Melnikov variance"),
    ],
)
def test_unequal_sides_are_refused_by_name(use, what):
    with pytest.raises(ValueError, match=f"block.body: got 'body .*e = .*accepted: equal sides .* for {what}"):
        use()


def test_a_body_excludes_width_height_and_gravity():
    for name, value in (("width", 1.0), ("height", 2.0), ("gravity", 3.7)):
        with pytest.raises(ValueError, match=f"{name}: got {value}, accepted: nothing where there is a body"):
            Scene.from_block(body=STATUE, peak_acceleration=1.0, frequency_hz=1.0, **{name: value})


def test_lengths_in_millimetres_are_doubted():
    scene = Scene(Block(0.9, body=Body(1100.0, 300.0, 380.0, 620.0)), Harmonic(1.0, 1.0), NoNoise())
    sentences = ranges.implausible(scene)
    assert "block.body.height_of_centre is 1100 m; was 1.1 m meant?" in sentences
    assert ranges.implausible(scene.varied(block={"body": STATUE}, overturning=Overturning())) == []
    for radius, told in ((3.4, False), (3.6, True)):
        heavy = Block(0.9, body=dataclasses.replace(STATUE, radius_of_gyration=radius))
        asked = [sentence.endswith("; is it the moment of inertia?") for sentence in ranges.implausible_sizes(heavy)]
        assert asked == [True] * told
    light = [Block(0.9, body=dataclasses.replace(STATUE, radius_of_gyration=radius)) for radius in (0.2, 0.25)]
    (small,), none = map(ranges.implausible_sizes, light)
    assert small.startswith("block.body.radius_of_gyration is 0.2 m, less than a fifth of the distance")
    assert none == []


def test_an_angle_of_overturning_in_degrees_is_doubted():
    for block, angle, told in (
        (Block(0.9), 20.0, 0),
        (Block(0.9), 90.0, 1),
        (Block(0.9, critical_angle=0.03), 52.0, 0),
    ):
        scene = Scene(block, Harmonic(1.0, 1.0), NoNoise(), overturning=Overturning(angle))
        said = [sentence.startswith("overturning.angle is 90 times") for sentence in ranges.implausible(scene)]
        assert said == [True] * told


def test_a_kind_is_changed_by_a_new_part():
    with pytest.raises(ValueError, match=r"^noise.kind: got 'none', accepted: values of .*Noise, or a new part, as"):
        SCENE.varied(noise={"kind": "none"})
    assert SCENE.varied(noise=NoNoise()).noise == NoNoise()


def test_a_start_is_at_rest_if_it_is_the_point_at_angle_and_velocity_0():
    spread = ((1e-4, 0.0), (0.0, 1e-4))
    starts = Start(), Start(0.1), Start(0.0, -0.1), Start(0.0, 0.0, spread)
    assert [start.at_rest for start in starts] == [True, False, False, False]
