"""Contact forces against Newton's law for the centre of mass, and the noise that is drawn again against paths."""

import dataclasses
import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from fpk_rocking import BandNoise, Block, Dimensions, FilteredNoise, Harmonic, NoNoise, Pulse, Scene, Start, WhiteNoise
from fpk_rocking.envelopes import Trapezoid
from fpk_rocking.physics.motion.floor import contact_forces as forces_at
from montecarlo import contact_forces, histories

SIZE = Dimensions(0.5, 1.8)
NOISE = BandNoise(0.3, (0.0, 8.0), 30)
SCENE = Scene(Block(0.9, SIZE, slender=True), Harmonic(1.2, 4.0, 0.3), NOISE)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_forces_accelerate_the_centre_of_mass(side):
    """In metres and seconds: the corner moves with the base, the block turns about it by the full equation.

    The second difference of the centre's place over a step h has the order 2.
    """
    alpha, p, g, radius = SIZE.critical_angle, SIZE.frequency_parameter, SIZE.gravity, SIZE.half_diagonal

    def force(tau):
        return side * (0.4 + 0.9 * np.cos(3.0 * tau))

    def motion(tau, state):
        x, v = state
        phi = alpha * (1.0 - side * x)
        return v, -side * math.sin(phi) / alpha + force(tau) * math.cos(phi)

    solved = solve_ivp(
        motion, (0.0, 1.2), (side * 0.3, side * 0.9), "DOP853", rtol=1e-13, atol=1e-14, dense_output=True
    )

    def centre(tau):
        """Place of the centre of mass from the corner, metres: from x > 0 on the block turns about its right corner."""
        phi = alpha * (1.0 - side * solved.sol(tau)[0])
        return np.array([-side * radius * np.sin(phi), radius * np.cos(phi)])

    times = np.linspace(0.1, 1.1, 11)
    forces = forces_at(*solved.sol(times), force(times), alpha)
    assert np.all(side * solved.sol(times)[0] > 0.0)
    errors = []
    for step in (0.02, 0.01, 0.005):
        second = (centre(times + step) - 2.0 * centre(times) + centre(times - step)) / (step / p) ** 2
        # f is the acceleration of the base towards x < 0 over g α.
        second[0] -= g * alpha * force(times)
        second[1] += g
        errors.append(np.abs(forces - second / g).max())
    assert np.polyfit(np.log([0.02, 0.01, 0.005]), np.log(errors), 1)[0] == pytest.approx(2.0, abs=0.05)
    assert errors[-1] < 1e-4


def test_a_block_at_rest_and_one_that_is_just_tilted():
    alpha = 0.3
    level = math.tan(alpha) / alpha
    x, v, f = np.zeros(4), np.zeros(4), np.array([0.5, -0.99 * level, level * (1.0 + 1e-12), -level * (1.0 + 1e-12)])
    horizontal, normal = forces_at(x, v, f, alpha)
    np.testing.assert_allclose(horizontal, -alpha * f, rtol=1e-11)
    np.testing.assert_allclose(normal, 1.0, rtol=1e-11)
    assert abs(horizontal[3] / normal[3]) == pytest.approx(math.tan(alpha), rel=1e-11)
    # What the floor bears as a block is lifted off by a fifth more: x'' = (1.2 - 1) sin(α)/α.
    horizontal, normal = forces_at(x[:1], v[:1], -1.2 * level, alpha)
    assert normal == pytest.approx(1.0 + 0.75 * 0.2 * math.sin(alpha) ** 2, rel=1e-12)
    assert horizontal == pytest.approx(
        1.2 * math.tan(alpha) - 0.75 * 0.2 * math.sin(alpha) * math.cos(alpha), rel=1e-12
    )
    # A moving block at x = 0 is on the side of its velocity, and at α = .3 under no force presses with less than mg.
    pushed = forces_at(np.zeros(2), np.array([0.5, -0.5]), np.zeros(2), alpha)
    assert pushed[0, 0] == -pushed[0, 1] != 0.0
    assert pushed[1, 0] == pushed[1, 1] < 1.0
    assert np.isnan(forces_at(np.array([np.nan]), np.zeros(1), np.zeros(1), alpha)).all()


@pytest.mark.parametrize("method", ["exact", "rk4", "filtered", "enveloped"])
def test_the_noise_that_is_drawn_again_is_that_of_the_paths(method):
    """The force is the acceleration of the velocity, by central differences, wherever no impact is near."""
    scene = SCENE
    if method == "enveloped":
        scene = scene.varied(noise={"envelope": Trapezoid(0.5, 2.0, 1.0)}, start={"angle": 0.3})
    if method == "filtered":
        scene = scene.varied(noise=FilteredNoise("low-pass", 0.3, 5.0, 0.7, Trapezoid(0.5, 2.0, 1.0)))
    covariance = ((1e-2, 0.0), (0.0, 1e-2)) if method in {"exact", "filtered"} else None
    scene = dataclasses.replace(scene, start=Start(0.3, 0.2, covariance))
    paths = histories(
        scene,
        cycles=2,
        realizations=3,
        seed=5,
        method="exact" if method == "enveloped" else method,
        samples_per_cycle=400,
        steps_per_cycle=400,
    )
    forces = contact_forces(paths)
    step, alpha = paths.time[1], SIZE.critical_angle
    x, v = paths.angle[:, 1:-1], paths.velocity[:, 1:-1]
    acceleration = (paths.velocity[:, 2:] - paths.velocity[:, :-2]) / (2.0 * step)
    smooth = (np.sign(paths.angle[:, 2:]) == np.sign(paths.angle[:, :-2])) & (np.abs(x) > 0.02)
    side = np.sign(x)
    phi = alpha * (1.0 - side * x)
    base = 0.75 * (alpha * acceleration * np.cos(phi) + side * (alpha * v) ** 2 * np.sin(phi))
    shaking = acceleration - x + side
    assert np.count_nonzero(smooth) > 400
    np.testing.assert_allclose((base - alpha * shaking)[smooth], forces.horizontal[:, 1:-1][smooth], atol=2e-4)


def test_the_sentence_and_the_probability_of_sliding():
    forces = contact_forces(histories(SCENE, cycles=3, realizations=40, seed=2))
    assert forces.friction.shape == (40, forces.time.size)
    assert SCENE.block.least_friction == pytest.approx(0.5 / 1.8, rel=1e-14)
    part, error = forces.sliding([0.0, np.sort(forces.needed)[9], 10.0])
    assert part == pytest.approx([1.0, 30 / 40, 0.0])
    assert error == pytest.approx([0.0, math.sqrt(0.75 * 0.25 / 40), 0.0])
    assert isinstance(forces.sliding(0.3)[0], float)
    assert str(forces).startswith("A block with a friction coefficient below 0.278 slides before it rocks. At the ")
    worst, median = forces.needed.max(), np.median(forces.needed)
    assert f"of {worst:.3g} in the worst of 40 paths and {median:.3g} in the median one, and" in str(forces)
    assert f"falls to {forces.least.min():.3g} of the weight" in str(forces)
    lifted = dataclasses.replace(forces, normal=forces.normal - forces.least.min())
    assert np.isinf(lifted.needed).sum() == 1
    assert "the corner leaves the floor in 1 of 40 paths" in str(lifted)
    with pytest.raises(ValueError, match=r"^friction: got -0\.1, accepted: numbers >= 0"):
        forces.sliding(-0.1)


def test_one_path_of_a_pulse_that_rests_needs_the_acceleration_over_g():
    scene = Scene(Block(0.9, SIZE, slender=True), Pulse("one-sine", 0.8, 3.0), NoNoise())
    forces = contact_forces(histories(scene, times=np.linspace(0.0, 2.0, 401)))
    alpha = SIZE.critical_angle
    assert forces.needed == pytest.approx([0.8 * alpha], rel=1e-4)
    assert forces.least == pytest.approx([1.0], rel=1e-14)
    assert "(median" not in forces.headline


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"block": Block(0.9)}, r"^block\.critical_angle: got 0\.0, accepted: an angle above 0, or block\.dimensions"),
        ({"noise": WhiteNoise(0.01)}, r"^noise\.kind: got 'white', accepted: 'band', 'filtered' or 'none' for contact"),
    ],
)
def test_what_has_no_contact_forces_is_refused(changed, message):
    path = histories(SCENE, cycles=1)
    with pytest.raises(ValueError, match=message):
        contact_forces(dataclasses.replace(path, scene=dataclasses.replace(SCENE, **changed)))
    with pytest.raises(TypeError, match=r"^histories: got "):
        contact_forces(SCENE)
