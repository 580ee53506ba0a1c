"""Forcing: its pieces, its properties, and that nobody takes it for a single cosine or for its own mirror image."""

import math

import numpy as np
import pytest

from fpk_rocking import (
    BandNoise,
    Block,
    CycleOperator,
    Harmonic,
    Harmonics,
    NoNoise,
    Scene,
    Start,
    WhiteNoise,
    melnikov,
    solve_fpk,
)
from fpk_rocking.physics.motion import TERMS
from fpk_rocking.physics.motion.equation import move_origin, value_and_slope
from montecarlo import histories, simulate, split, tally

TWO = Harmonics(2.7, (2.4, 1.1), (0.0, 0.7))
MANY = Harmonics(1.9, (0.4, 0.0, 1.3, 0.2), (0.3, 1.0, -2.0, 5.0))
SINGLE = Harmonic(4.6, 2.7, 0.4)


def by_hand(forcing, time):
    return -sum(a * math.cos(k * forcing.frequency * time + p) for k, a, p in forcing.components)


@pytest.mark.parametrize("forcing", [SINGLE, TWO, MANY])
def test_pieces_solve_the_equation(forcing):
    """P'' - P = f to 1e-13 of the forcing's size, as long as a piece is said to be right, and P is bounded by it."""
    size = sum(a for _, a, _ in forcing.components)
    for instant in (-3.0, 0.0, 0.7, 40.0):
        piece = np.polynomial.Polynomial(forcing.pieces([instant])[0])
        for late in np.linspace(-1.0, 1.0, 9) * forcing.longest_piece:
            force = piece.deriv(2)(late) - piece(late)
            assert force == pytest.approx(by_hand(forcing, instant + late), abs=1e-11 * size)
            assert piece(late) == pytest.approx(forcing.particular(instant + late)[0], abs=1e-13 * size)
            assert piece.deriv()(late) == pytest.approx(forcing.particular(instant + late)[1], abs=1e-12 * size)
    times = np.linspace(0.0, forcing.period, 4001)
    p, q = np.array([forcing.particular(t) for t in times]).T
    for drift in (p + q, p - q):
        assert np.abs(drift).max() <= forcing.swing * (1.0 + 1e-12)


@pytest.mark.parametrize("forcing", [SINGLE, TWO, MANY])
def test_values_agree_with_each_other(forcing):
    times = np.linspace(0.0, forcing.period, 20_001)
    values = np.array([forcing.value(t) for t in times])
    assert values[::4000] == pytest.approx([by_hand(forcing, t) for t in times[::4000]], abs=1e-14)
    assert forcing.values_in_cycle(np.arange(20_001), 20_000) == pytest.approx(values, abs=1e-12)
    slopes = np.array([forcing.slope(t) for t in times])
    assert np.diff(values) / np.diff(times) == pytest.approx(0.5 * (slopes[1:] + slopes[:-1]), abs=2e-5)
    assert np.abs(slopes).max() <= forcing.steepest
    assert np.abs(values).max() <= forcing.largest * (1.0 + 1e-12)
    assert np.abs(values).max() == pytest.approx(forcing.largest, rel=1e-6)
    lifted = np.abs(values) > 1.0
    for k in range(0, 20_000, 371):
        elapsed, slope = forcing.since_lift_off(times[k])
        before = np.roll(lifted, -k - 1)[::-1]  # this instant first, then backwards in time
        rises = np.flatnonzero(before[:-1] & ~before[1:])
        assert elapsed == pytest.approx(rises[0] * times[1], abs=2.0 * times[1])
        assert slope == pytest.approx(abs(forcing.slope(times[k] - elapsed)))
    rests, longest = np.flatnonzero(np.concatenate([lifted, lifted])), forcing.longest_rest
    assert longest == pytest.approx(np.diff(rests).max() * times[1], abs=2.0 * times[1])


def test_rest_and_lift_off_at_the_bounds():
    assert Harmonic(1.0, 2.0).longest_rest == math.inf
    assert Harmonic(0.0, 2.0).since_lift_off(0.3) == (math.inf, 0.0)
    assert Harmonic(1.0 + 1e-9, 2.0).longest_rest < math.pi / 2
    # Known in closed form: from one lift-off of |A cos| to the next crossing downwards.
    assert SINGLE.longest_rest == pytest.approx(2.0 * math.asin(1.0 / 4.6) / 2.7, rel=1e-14)


@pytest.mark.parametrize(
    ("forcing", "mirrored"),
    [
        (SINGLE, True),
        (TWO, False),
        (Harmonics(2.7, (1.0, 0.0, 0.5), (0.0, 0.3, 0.7)), True),
        (Harmonics(2.7, (1.0, 1e-9, 0.5), (0.0, 0.3, 0.7)), False),
    ],
)
def test_half_antisymmetry_is_a_property_of_the_forcing(forcing, mirrored):
    assert forcing.half_antisymmetric == mirrored
    values = forcing.values_in_cycle(np.arange(64), 64)
    assert np.allclose(values[32:], -values[:32], rtol=0.0, atol=1e-14) == mirrored


def test_half_a_cycle_later_the_mirror_image_has_its_even_harmonics_turned():
    """-f(τ + T/2) has Ψ₂ + π in place of Ψ₂; -f has both phases turned."""
    later = Harmonics(2.7, TWO.amplitudes, (0.0, 0.7 + math.pi))
    mirrored = Harmonics(2.7, TWO.amplitudes, (math.pi, 0.7 + math.pi))
    for time in np.linspace(-1.0, 3.0, 17):
        assert later.value(time) == pytest.approx(-TWO.value(time + 0.5 * TWO.period), abs=1e-13)
        assert mirrored.value(time) == pytest.approx(-TWO.value(time), abs=1e-13)
    assert abs(later.value(0.0) + TWO.value(0.0)) > 1.0


@pytest.mark.parametrize("amplitudes", [(2.4, 1e-320), (1e-320, 2.4), (1e-320, 1e-320), (0.0, 1e-320)])
@pytest.mark.filterwarnings("error")
def test_a_harmonic_too_small_to_show_is_none(amplitudes):
    """Without it the times at which |f| passes 1 are those in closed form: arcsin(1/A) to either side of a zero."""
    forcing, shown = Harmonics(2.7, amplitudes, (0.0, 0.0)), max(amplitudes)
    if shown < 1.0:
        assert (forcing.largest, forcing.longest_rest) == (0.0, math.inf)
        assert forcing.mean_excess(0.5) == 0.0
    else:
        frequency = 2.7 * (1 + amplitudes.index(shown))
        assert forcing.largest == pytest.approx(shown, rel=1e-15)
        assert forcing.longest_rest == pytest.approx(2.0 * math.asin(1.0 / shown) / frequency, rel=1e-13)


@pytest.mark.parametrize("forcing", [SINGLE, TWO, MANY])
def test_another_phase_is_another_time_of_the_cycle(forcing):
    later = forcing.at_phase(forcing.phase + 1.3)
    for time in (0.0, 0.4, 2.0):
        assert later.value(time) == pytest.approx(forcing.value(time + 1.3 / forcing.frequency), abs=1e-13)


def test_one_harmonic_of_several_is_the_same_forcing():
    """The density, the operator and the paths, to the last digits; what rounding makes of chaotic paths is left out."""
    sum_of_one = Harmonics(2.7, (4.6,), (math.pi,))
    scenes = [
        Scene(Block(0.5), forcing, WhiteNoise(0.00628), overturning=Scene.from_toml(MINIMAL).overturning)
        for forcing in (Harmonic(4.6, 2.7, math.pi), sum_of_one)
    ]
    first, second = (solve_fpk(scene, cycles=2, tol=1e-2).survival for scene in scenes)
    assert first == pytest.approx(second, abs=1e-12)
    first, second = (simulate(scene, cycles=2, realizations=300).angle[:, 1] for scene in scenes)
    assert np.nanmax(np.abs(first - second)) < 1e-9


MINIMAL = """
[block]
restitution = 0.5
[forcing]
kind = "harmonics"
frequency = 2.7
amplitudes = [2.4, 1.1]
phases = [0.0, 0.7]
[noise]
kind = "none"
"""


def test_harmonics_in_a_scene_file():
    scene = Scene.from_toml(MINIMAL)
    assert scene.forcing == TWO
    assert Scene.from_toml(scene.to_toml()) == scene
    assert scene.varied(forcing={"amplitudes": [1, 2]}).forcing.amplitudes == (1.0, 2.0)
    single = Scene(Block(0.5), SINGLE, NoNoise())
    assert "kind" not in single.to_toml().split("[noise]")[0]
    assert Scene.from_toml(single.to_toml().replace("[forcing]", '[forcing]\nkind = "harmonic"')) == single


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("[2.4, 1.1]", "[2.4]"), r"forcing.phases: got \(0.0, 0.7\), accepted: 1 phases, as many as"),
        (("[2.4, 1.1]", "[0.0, 0.0]"), r"forcing.amplitudes: got \(0.0, 0.0\), accepted: at least one above 0"),
        (("[2.4, 1.1]", "[2.4, -1]"), r"forcing.amplitudes\[1\]: got -1, accepted: a finite number >= 0"),
        (("[2.4, 1.1]", "[]"), r"forcing.amplitudes: got \[\], accepted: a list of 1 to 32 numbers"),
        (("[2.4, 1.1]", "[2.4, nan]"), r"forcing.amplitudes\[1\]: got nan, accepted: a finite number >= 0"),
        (("[2.4, 1.1]", "[2.4, true]"), r"forcing.amplitudes\[1\]: got True, accepted: a finite number >= 0"),
        (("[0.0, 0.7]", "[0.0]"), r"forcing.phases: got \(0.0,\), accepted: 2 phases, as many as forcing.amplitudes"),
        (("[0.0, 0.7]", "[]"), r"forcing.phases: got \[\], accepted: a list of 1 to 32 numbers"),
        (("[0.0, 0.7]", "[0.0, inf]"), r"forcing.phases\[1\]: got inf, accepted: a finite number"),
        (("phases = [0.0, 0.7]", ""), r"forcing.phases: missing, required: frequency, amplitudes, phases"),
        (("= 2.7", "= nan"), r"forcing.frequency: got nan, accepted: a finite number > 0"),
        (("[2.4, 1.1]", "2.4"), r"forcing.amplitudes: got 2.4, accepted: a list of 1 to 32 numbers"),
        (('"harmonics"', '"sine"'), r"forcing.kind: got 'sine', accepted: 'harmonic', 'harmonics'"),
        (("frequency = 2.7", "frequency = 2.7\namplitude = 1.0"), r"forcing.amplitude: unknown.*forcing.amplitudes\?"),
    ],
)
def test_harmonics_that_are_refused(change, message):
    with pytest.raises((TypeError, ValueError), match=message):
        Scene.from_toml(MINIMAL.replace(*change))


@pytest.fixture(scope="module")
def operator():
    """Of a scene whose half cycles are unlike."""
    return CycleOperator(Scene(Block(0.6), Harmonics(4.0, (2.0, 1.5), (1.0, 0.4)), WhiteNoise(0.05)), tol=1e-2)


def test_white_paths_density_and_operator_agree_under_unlike_halves(operator):
    """Ten times as many overturn to the right. Within 3.5 standard errors: false alarms 5e-4 for another seed.

    The operator's survival is that of its own steps, another run of the solver.
    """
    density = solve_fpk(operator.scene, cycles=3, tol=1e-2)
    paths = tally(operator.scene, cycles=3, realizations=40_000, angle_edges=[-2, 2], velocity_edges=[-9, 9])
    error = np.sqrt(density.survival * (1.0 - density.survival) / 40_000)
    assert np.all(np.abs(paths.survival - density.survival) <= 3.5 * error + 1e-3)
    assert np.all(np.abs(paths.overturned - density.overturned)[1:] <= 3.5 * error[1:, None] + 1e-3)
    assert density.overturned[3, 1] > 0.05 + density.overturned[3, 0]
    assert operator.survival([1, 3]) == pytest.approx(density.survival[[1, 3]], abs=2e-3)
    vector = operator.vector(density.coefficients[1]) if density.space.shape == operator.space.shape else None
    assert vector is None or operator.matvec(vector).shape == vector.shape


def test_the_operator_of_unlike_halves_is_the_whole_cycle(operator):
    """Duality of the map and its adjoint, leakage against the eigenvalue, and the phase of a map's start."""
    rng = np.random.default_rng(3)
    first, second = rng.random((2, operator.shape[0]))
    assert operator.matvec(first) @ second == pytest.approx(first @ operator.rmatvec(second), rel=1e-11)
    assert 1.0 - operator.leakage.sum() - operator.truncated == pytest.approx(math.exp(-operator.escape_rate), rel=1e-9)
    assert abs(operator.eigenvalues[0]) == pytest.approx(math.exp(-operator.escape_rate), rel=1e-6)
    assert abs(operator.leakage[0] - operator.leakage[1]) > 0.1 * operator.leakage.sum()
    later = operator.scene.varied(forcing=operator.scene.forcing.at_phase(2.0), start=Start(0.3, -0.2))
    survival = solve_fpk(later, cycles=2, tol=1e-2).survival[2]
    assert operator.survival_map(2, phase=2.0)(0.3, -0.2) == pytest.approx(survival, abs=1e-2)


def test_band_noise_engines_agree_under_harmonics():
    """rk4 at 400 steps against exact flights, from the same numbers; and rest, of a forcing that lifts off once."""
    scene = Scene(Block(0.6), TWO, BandNoise(0.02, (0.0, 8.0), 20))
    exact, stepped = (
        simulate(scene, cycles=2, realizations=200, method=method, steps_per_cycle=400) for method in ("exact", "rk4")
    )
    both = np.isfinite(exact.angle[:, 1]) & np.isfinite(stepped.angle[:, 1])
    assert np.median(np.abs(exact.angle - stepped.angle)[both, 1]) < 1e-5
    assert both.sum() > 150
    quiet = Scene(Block(0.6), Harmonics(2.7, (0.7, 0.5), (0.0, 0.0)), NoNoise())
    assert quiet.forcing.largest == pytest.approx(1.2)
    run = histories(quiet, cycles=1, realizations=1, samples_per_cycle=64)
    lifted = np.flatnonzero(run.angle[0] != 0.0)
    # f = -1.2 at τ = 0: lifted off to the left at once.
    assert lifted[0] == 1
    assert run.angle[0, 1] < 0.0


@pytest.mark.slow
def test_rare_overturning_under_harmonics_agrees_with_the_density():
    """Within 4 of the splitting's standard errors: false alarms 6e-5."""
    scene = Scene(Block(0.6), Harmonics(2.7, (1.2, 0.5), (0.0, 0.7)), WhiteNoise(0.01))
    rare = split(scene, cycles=3, walkers=200, repeats=12)
    density = solve_fpk(scene, cycles=3, tol=1e-3)
    error = rare.standard_error[3] if np.ndim(rare.standard_error) else rare.standard_error
    assert abs(1.0 - rare.survival[3] - (1.0 - density.survival[3])) <= 4.0 * error + 2e-4


def test_polynomials_move_their_origin():
    rng = np.random.default_rng(7)
    coefficients, moved = rng.normal(size=TERMS) / 2.0 ** np.arange(TERMS), np.empty(TERMS)
    move_origin(coefficients, 0.3, moved)
    for t in (-0.2, 0.0, 0.5):
        assert value_and_slope(moved, t) == pytest.approx(value_and_slope(coefficients, t + 0.3), rel=1e-13)


def test_melnikov_functions_of_several_harmonics():
    """One harmonic gives the closed form; three are held against an average over 400,000 phases, to its own error."""
    alone, single = Harmonics(4.0, (4.0,), (0.3,)), Harmonic(4.0, 4.0, 0.3)
    noises = [NoNoise(), BandNoise(0.16, (0.0, 10.0), 100), WhiteNoise(1e-5)]
    for restitution in (0.3, 0.9):
        both = [melnikov.phase_flux(forcing, restitution, noises) for forcing in (alone, single)]
        assert both[0] == pytest.approx(both[1], abs=1e-12)
        both = [melnikov.margin(forcing, restitution, noises) for forcing in (alone, single)]
        assert both[0] == pytest.approx(both[1], abs=1e-12)
    several = Harmonics(2.7, (2.4, 1.1, 0.5), (0.0, 0.7, 2.0))
    times = several.period * (np.arange(400_000) + 0.5) / 400_000
    wave = melnikov.process_mean(several, 0.6, times) + melnikov.impact_loss(0.6)
    assert melnikov.harmonic_amplitude(several) == pytest.approx(np.abs(wave).max(), rel=1e-9)
    mean = 0.5 * sum(np.maximum(side * wave - melnikov.impact_loss(0.6), 0.0).mean() for side in (1.0, -1.0))
    assert melnikov.phase_flux(several, 0.6, NoNoise()) == pytest.approx(mean, rel=1e-9)
    nodes, weights = np.polynomial.hermite_e.hermegauss(200)
    sigma = math.sqrt(melnikov.noise_variance(noises[1]))
    mean = 0.5 * sum(
        weight * np.maximum(side * wave[::100] + sigma * node - melnikov.impact_loss(0.6), 0.0).mean()
        for side in (1.0, -1.0)
        for node, weight in zip(nodes, weights / weights.sum(), strict=True)
    )
    assert melnikov.phase_flux(several, 0.6, noises[1]) == pytest.approx(mean, rel=1e-4)
    with pytest.raises(TypeError, match=r"forcing: got .*, accepted: a Harmonic, or a tuple"):
        melnikov.phase_flux_sampled(several, 0.6, NoNoise())
