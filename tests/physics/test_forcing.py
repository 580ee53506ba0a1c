"""Every kind of forcing has every part that the rest of the code asks of one; a new kind needs a row in `OF_KIND`."""

import dataclasses
import math

import numpy as np
import pytest

from fpk_rocking import Block, Dimensions, NoNoise, Scene, WhiteNoise
from fpk_rocking.forcings import FORCINGS, Chirp, Forcing, Harmonic, Harmonics, Pulse, Record
from fpk_rocking.physics.forcing.base import RANGES
from fpk_rocking.physics.motion import TERMS
from fpk_rocking.risk import FloorMotion, intensities
from fpk_rocking.scene import ranges
from fpk_rocking.studies import resized, scaled
from montecarlo import simulate

SIZE = Dimensions(0.5, 1.8)
OF_KIND = {
    "harmonic": Harmonic(1.6, 2.7, 0.4),
    "harmonics": Harmonics(1.9, (0.7, 1.1), (0.2, -1.0)),
    "pulse": Pulse("one-cosine", 2.3, 3.1),
    "chirp": Chirp(2.0, 1.5, 6.0, 7.0),
    "record": Record(0.04, np.sin(np.arange(50) * 0.7), "g", 0.5).for_size(SIZE),
    "floor": FloorMotion.of(*[Record(0.04, np.sin(np.arange(50) * 0.7), "g", 0.5)] * 2).for_size(SIZE),
}
every = pytest.mark.parametrize("forcing", [OF_KIND.get(kind) for kind in FORCINGS], ids=list(FORCINGS))


def scene_of(forcing, noise=None):
    return Scene(Block(0.9, SIZE), forcing, noise or NoNoise())


def end_of(forcing):
    return forcing.period or forcing.duration


@every
def test_it_is_a_forcing_with_every_part(forcing):
    assert isinstance(forcing, Forcing)
    assert FORCINGS[forcing.kind] is type(forcing)
    for name in Forcing.__annotations__:
        assert hasattr(forcing, name), name
    assert not forcing.__abstractmethods__
    assert hash(forcing) == hash(dataclasses.replace(forcing))
    assert str(forcing) != repr(forcing)


@every
def test_pieces_steps_and_values_are_of_one_force(forcing):
    """P'' - P = f; a piece, a step and the stages of a grid agree."""
    times = np.linspace(0.0, 1.2 * end_of(forcing), 40)[1:]
    late = 0.4 * forcing.spacing(min(forcing.longest_piece, 0.1))
    for time, row in zip(times, forcing.pieces(times), strict=True):
        piece = np.polynomial.Polynomial(row)
        assert row.shape == (TERMS,)
        assert piece.deriv(2)(0.0) - piece(0.0) == pytest.approx(forcing.value(time), abs=1e-12)
        assert piece.deriv(3)(0.0) - piece.deriv()(0.0) == pytest.approx(forcing.slope(time), abs=1e-10)
        assert (row[0], row[1]) == pytest.approx(forcing.particular(time), abs=1e-12)
        step = np.polynomial.Polynomial(forcing.particular_over(time, late))
        assert (step(late), step.deriv()(late)) == pytest.approx(forcing.particular(time + late), abs=1e-12)
    spacing = forcing.spacing(0.07)
    assert 0.0 < spacing <= 0.07
    begins = spacing * np.arange(20)
    assert end_of(forcing) / spacing == pytest.approx(round(end_of(forcing) / spacing), abs=1e-9)
    wanted = [[forcing.value(time) for time in (begin, begin + 0.5 * spacing)] for begin in begins]
    stages = forcing.stage_values(spacing, 20)
    assert stages[:, :2] == pytest.approx(np.array(wanted), abs=1e-12)
    assert stages[:-1, 2] == pytest.approx(stages[1:, 0], abs=1e-12)


@every
def test_bounds_hold_and_are_not_far(forcing):
    times = np.linspace(0.0, end_of(forcing), 8001)[:-1]
    values, slopes = (np.abs([part(time) for time in times.tolist()]) for part in (forcing.value, forcing.slope))
    p, q = forcing.pieces(times)[:, :2].T
    velocity = np.cumsum([forcing.value(time) for time in times.tolist()]) * times[1]
    velocity = np.abs(velocity - (velocity.mean() if forcing.period else 0.0))
    bounds = (values, forcing.largest), (slopes, forcing.steepest), (velocity, forcing.largest_velocity)
    for seen, bound in (*bounds, (np.maximum(np.abs(p + q), np.abs(p - q)), forcing.swing)):
        assert bound / 1.5 <= seen.max() <= bound * 1.002
    assert intensities(scene_of(forcing)).velocity == forcing.largest_velocity
    rises = times[1:][(values[1:] > 1.0) & (values[:-1] <= 1.0)]
    assert rises.size, "an example that lifts a block off"
    elapsed, slope = forcing.since_lift_off(rises[0] + 0.01)
    assert elapsed == pytest.approx(0.01, abs=2.0 * times[1])
    assert slope == pytest.approx(abs(forcing.slope(rises[0])), rel=0.1)
    assert 0.0 < forcing.longest_rest <= (end_of(forcing) if forcing.period else math.inf)
    assert forcing.time_scale > 0.0
    half = 0.5 * end_of(forcing)
    turned = all(abs(forcing.value(t) + forcing.value(t + half)) < 1e-9 for t in times[::400])
    assert forcing.half_antisymmetric == (turned and forcing.period is not None)
    assert (forcing.period is None) == (forcing.duration < math.inf)


@every
def test_it_is_scaled(forcing):
    """Stronger by 1.7 and faster by 1.3: f(τ) becomes 1.7 f(1.3 τ). A study's scenes are scaled by that."""
    changed = forcing.scaled(1.7, 1.3)
    assert type(changed) is type(forcing)
    for time in np.linspace(0.01, 1.1, 30) * end_of(forcing):
        assert changed.value(time / 1.3) == pytest.approx(1.7 * forcing.value(time), abs=1e-12)
    assert end_of(changed) == pytest.approx(end_of(forcing) / 1.3, rel=1e-13)
    scene = scene_of(forcing)
    assert scaled(scene, 1.7).forcing.value(0.3) == pytest.approx(1.7 * forcing.value(0.3), rel=1e-12)
    # Four times the size at the same slenderness: half the rate of p, the same angles.
    large = resized(scene, width=2.0, height=7.2).forcing
    assert large.value(0.2) == pytest.approx(forcing.value(0.4), rel=1e-12)
    assert end_of(large) == pytest.approx(0.5 * end_of(forcing), rel=1e-12)


@every
def test_a_scene_file_holds_it_and_its_range_is_kept(forcing):
    scene = scene_of(forcing, WhiteNoise(0.02))
    assert Scene.from_toml(scene.to_toml()) == scene
    assert type(Scene.from_toml(scene.to_toml()).forcing) is type(forcing)
    with pytest.raises(ValueError, match=r"forcing\.more: unknown"):
        Scene.from_toml(scene.to_toml().replace("[forcing]", "[forcing]\nmore = 1"))
    ranges.check(scene)
    fields = {
        field.name for field in dataclasses.fields(forcing) if not isinstance(getattr(forcing, field.name), str | None)
    }
    assert forcing.dimensional or fields <= forcing.ranges.keys()
    assert all(hasattr(forcing, name) for name in forcing.ranges)
    with pytest.raises(ValueError, match=rf"forcing\..*{ranges.checks.ENGINES[2:-1]}"):
        ranges.check(scene_of(forcing.scaled(2.0 * RANGES["amplitude"][1], 1.0)))
    with pytest.raises(ValueError, match=rf"forcing\..*{ranges.checks.ENGINES[2:-1]}"):
        ranges.check(scene_of(forcing.scaled(1.0, 1e-9)))


@every
def test_the_engines_take_it(forcing):
    """Two that know the force in their own ways follow one path."""
    extent = {"cycles": 1} if forcing.period else {"times": [forcing.duration]}
    scene = scene_of(forcing)
    exact, stepped = (simulate(scene, realizations=1, method=method, **extent) for method in ("exact", "rk4"))
    assert exact.angle[0, -1] == pytest.approx(stepped.angle[0, -1], abs=1e-3, nan_ok=True)


def test_the_base_makes_no_value():
    with pytest.raises(TypeError, match="abstract"):
        Forcing()


def test_a_constant_is_added():
    for forcing in (OF_KIND["harmonic"], OF_KIND["harmonics"], Harmonic(0.0, 2.0)):
        for constant in (0.7, -0.4, 0.0):
            more = forcing.with_constant(constant)
            for time in (0.0, 0.4, 1.9):
                assert more.value(time) == pytest.approx(forcing.value(time) + constant, abs=1e-14)
                assert more.slope(time) == forcing.slope(time)
                value, slope = forcing.particular(time)
                assert more.particular(time) == (value - constant, slope)
                assert more.particular_over(time, 0.1)[1:].tolist() == forcing.particular_over(time, 0.1)[1:].tolist()
            assert more.shortest_period == forcing.shortest_period
            reached = max(abs(forcing.value(time) + constant) for time in np.linspace(0.0, forcing.period, 4001))
            assert more.largest == pytest.approx(reached, rel=1e-5)
