"""The event-driven engine against 50 digits, against Runge-Kutta's limit, and against closed forms."""

import dataclasses
import math
import pathlib

import numpy as np
import pytest
from mp_scenes import compare, follow_scene, random_scenes

from fpk_rocking.analytics.orbits import symmetric_orbits
from fpk_rocking.base.jit import at_most, thread_count
from fpk_rocking.scene import BandNoise, Block, Harmonic, NoNoise, Overturning, Scene, Start, load_scene
from montecarlo import histories, simulate

MAIN = load_scene(pathlib.Path(__file__).parents[2] / "cases" / "scenes" / "main.toml")
ROUNDING = 2e-12
"""Error that a flight and an impact may add; the comparison lets it grow as the motion does."""


def differences(scenes, cycles=5):
    """Compare the impacts of a realization of each scene with the 50-digit path: see `mp_scenes.compare`."""
    rows = []
    for number, scene in enumerate(scenes):
        run = histories(scene, cycles=cycles, seed=5, method="exact", samples_per_cycle=1)
        path = follow_scene(scene, 5, 0, cycles, rounding=ROUNDING)
        rows.append(compare(path, run.impact_time, run.impact_velocity))
        assert path.overturned == bool(run.overturn_side[0]), number
    return np.concatenate(rows).T


def test_no_impact_is_missed_and_all_are_in_time():
    late, error, off, velocity_error = differences(random_scenes(25, seed=9))
    assert error.size > 100
    assert (error <= late).all()
    assert (velocity_error <= off).all()


@pytest.mark.slow
def test_ten_thousand_impacts_are_those_of_fifty_digits():
    late, error, off, velocity_error = differences(random_scenes(1700, seed=7))
    assert error.size > 10_000
    assert (error <= late).all()
    assert (velocity_error <= off).all()
    assert np.quantile(error, 0.95) < 1e-10


def test_runge_kutta_converges_to_it_with_order_4():
    scene = dataclasses.replace(MAIN, start=Start(0.2, 0.3, ((0.04, 0.0), (0.0, 0.09))))
    exact = simulate(scene, cycles=1, realizations=400, method="exact")
    steps, errors = (50, 100, 200, 400), []
    for n in steps:
        rk4 = simulate(scene, cycles=1, realizations=400, method="rk4", steps_per_cycle=n)
        error = np.hypot(rk4.angle[:, 1] - exact.angle[:, 1], rk4.velocity[:, 1] - exact.velocity[:, 1])
        assert (np.isnan(rk4.angle) == np.isnan(exact.angle)).all()
        errors.append(np.nanmedian(error))
    order = -np.polyfit(np.log(steps), np.log(errors), 1)[0]
    assert order == pytest.approx(4.0, abs=0.15)
    assert errors[-1] < 1e-9


@pytest.mark.parametrize("frequency", [1.5, 5.0])
def test_no_dip_between_grid_points_is_missed(frequency):
    """Strong forcing throws blocks back within an interval: with bounds that fail, some 30 would lose an impact."""
    start = Start(0.2, 0.0, ((0.09, 0.0), (0.0, 4.0)))
    scene = Scene(Block(0.6), Harmonic(15.0, frequency, 0.3), NoNoise(), start, Overturning(6.0))
    exact = simulate(scene, cycles=1, realizations=4000, method="exact")
    rk4 = simulate(scene, cycles=1, realizations=4000, method="rk4", steps_per_cycle=2000)
    assert exact.angle == pytest.approx(rk4.angle, abs=1e-5, nan_ok=True)
    assert exact.velocity == pytest.approx(rk4.velocity, abs=1e-5, nan_ok=True)
    assert exact.overturn_time == pytest.approx(rk4.overturn_time, abs=1e-5, nan_ok=True)


@pytest.mark.parametrize("harmonics", [1, 7, 1000])
@pytest.mark.parametrize("band", [(0.0, 0.3), (3.0, 3.1), (0.0, 60.0)])
def test_any_band_and_number_of_harmonics(harmonics, band):
    """Against rk4 with steps short for the band, one cycle; errors may have grown a thousandfold by then."""
    scene = dataclasses.replace(MAIN, noise=BandNoise(0.09, band, harmonics))
    exact = simulate(scene, cycles=1, realizations=20, method="exact")
    rk4 = simulate(scene, cycles=1, realizations=20, method="rk4", steps_per_cycle=4000)
    assert exact.angle == pytest.approx(rk4.angle, abs=1e-9, nan_ok=True)
    assert exact.velocity == pytest.approx(rk4.velocity, abs=1e-9, nan_ok=True)


def test_strong_noise_hides_no_event():
    """Few strong harmonics throw blocks to a near cut-off and back within an interval: 20,000 against rk4.

    With bounds of the acceleration that leave out the noise some 10 to 80 would miss an impact or the cut-off.
    """
    scene = dataclasses.replace(MAIN, noise=BandNoise(100.0, (0.0, 8.0), 5), overturning=Overturning(0.8))
    exact = simulate(scene, cycles=1, realizations=20_000, method="exact")
    rk4 = simulate(scene, cycles=1, realizations=20_000, method="rk4", steps_per_cycle=500)
    assert exact.overturn_time == pytest.approx(rk4.overturn_time, abs=1e-6, nan_ok=True)
    assert np.array_equal(exact.overturn_side, rk4.overturn_side)


def test_late_cycles_have_their_noise():
    """Impacts up to cycle 60, past chunks and fresh anchors, are those of rk4, whose grid is another."""
    scene = Scene(Block(0.5), Harmonic(0.2, 2.7), BandNoise(0.3, (0.0, 10.0), 40), Start(1e-9))
    # Weak forcing: the block rests again and again and so forgets how it came to where it is.
    exact = histories(scene, cycles=60, method="exact", samples_per_cycle=1)
    rk4 = histories(scene, cycles=60, method="rk4", steps_per_cycle=2000, samples_per_cycle=1)
    exact_impacts, rk4_impacts = (run.impact_time[np.abs(run.impact_velocity) > 1e-3] for run in (exact, rk4))
    assert exact_impacts.size == rk4_impacts.size > 50
    assert exact_impacts == pytest.approx(rk4_impacts, abs=1e-6)
    assert exact_impacts[-1] > 50 * scene.period


def orbit_scene(amplitude, frequency, restitution):
    """Scene that starts on the symmetric orbit with the fastest impact, and that orbit."""
    orbit = symmetric_orbits(amplitude, frequency, restitution)[-1]
    x, v = orbit.state(1.0)
    return Scene(Block(restitution), Harmonic(amplitude, frequency, 1.0), NoNoise(), Start(float(x), float(v))), orbit


@pytest.mark.parametrize("parameters", [(1.5, 2.7, 0.5), (3.0, 3.0, 0.9), (5.0, 5.0, 0.925)])
def test_stable_orbits_are_held_for_500_cycles(parameters):
    scene, orbit = orbit_scene(*parameters)
    assert orbit.stable
    run = simulate(scene, cycles=500, realizations=1, method="exact")
    assert np.abs(run.angle - scene.start.angle).max() < 1e-9
    assert np.abs(run.velocity - scene.start.velocity).max() < 1e-9


@pytest.mark.parametrize("parameters", [(4.6, 2.7, 0.5), (4.0, 4.0, 0.3)])
def test_unstable_orbits_are_left_at_their_rate(parameters):
    scene, orbit = orbit_scene(*parameters)
    x, v = scene.start.angle, scene.start.velocity
    run = simulate(dataclasses.replace(scene, start=Start(x + 1e-9, v)), cycles=20, realizations=1, method="exact")
    off = np.abs(run.angle[0] - x)
    growing = np.flatnonzero((off > 1e-8) & (off < 1e-4))
    assert growing.size >= 5
    rate = np.polyfit(growing, np.log(off[growing]), 1)[0]
    assert rate == pytest.approx(2.0 * math.log(abs(orbit.multipliers[-1])), rel=0.03)


def test_free_rocking_has_its_peaks():
    """Peaks 0.5, 0.098612, 0.023719, 0.005877: 1 - u is largest where u'' = u - 1 has used up e times the speed."""
    scene = Scene(Block(0.5), Harmonic(0.0, 1.0), NoNoise(), Start(0.5))
    run = histories(scene, cycles=1, method="exact", samples_per_cycle=4000)
    angle, sign = run.angle[0][2:-1], np.sign(run.velocity[0][1:])
    turns = np.abs(angle)[np.diff(sign)[:-1] * angle < 0.0]
    peak, peaks = 0.5, []
    for _ in range(3):
        peak = 1.0 - math.sqrt(1.0 - 0.25 * (1.0 - (1.0 - peak) ** 2))
        peaks.append(peak)
    assert peaks == pytest.approx([0.098612, 0.023719, 0.005877], abs=5e-7)
    assert turns[:3] == pytest.approx(peaks, abs=1e-6)
    speeds = [math.sqrt(1.0 - (1.0 - top) ** 2) for top in (0.5, *peaks)]
    assert np.abs(run.impact_velocity[:4]) == pytest.approx(speeds, abs=1e-12)


@pytest.mark.parametrize("noise", [NoNoise(), BandNoise(0.02, (0.0, 10.0), 20)])
def test_at_rest_it_stays_while_the_force_is_below_one(noise):
    """|f| <= 0.3 + sigma sqrt(2 N) = 0.3 + 0.2 sqrt(20/5) < 1 for certain."""
    bound = 0.3 + (math.sqrt(2.0 * 20 * noise.variance) if noise.kind == "band" else 0.0)
    scene = Scene(Block(0.5), Harmonic(0.3 if bound < 1.0 else 0.1, 2.7), noise)
    assert bound < 1.0 or 0.1 + bound - 0.3 < 1.0
    run = histories(scene, cycles=50, realizations=3, method="exact", samples_per_cycle=3)
    assert not run.angle.any()
    assert not run.velocity.any()
    assert run.impact_time.size == 0


def test_samples_and_impact_lists_change_nothing():
    plain = simulate(MAIN, cycles=8, realizations=200, method="exact")
    for samples in (1, 7, 100):
        run = histories(MAIN, cycles=8, realizations=200, method="exact", samples_per_cycle=samples)
        angle, velocity = run.poincare()
        assert angle.tobytes() == plain.angle.tobytes()
        assert velocity.tobytes() == plain.velocity.tobytes()
        assert run.overturn_time.tobytes() == plain.overturn_time.tobytes()


def test_states_between_lie_on_the_path():
    """v is the derivative of x between impacts: the trapezoidal rule, 1/4000 of a cycle, to 1e-9 a step."""
    run = histories(MAIN, cycles=2, method="exact", samples_per_cycle=4000)
    x, v, h = run.angle[0], run.velocity[0], MAIN.period / 4000
    free = np.ones(x.size - 1, bool)
    free[(run.impact_time / h).astype(int)] = False
    defect = np.diff(x) - 0.5 * h * (v[1:] + v[:-1])
    assert np.abs(defect[free]).max() < 1e-9
    assert np.abs(defect[~free]).max() > 1e-5


def test_same_realizations_for_any_threads_and_any_size():
    threads, results = thread_count(), []
    for count, size in ((1, 300), (threads, 300), (threads, 500)):
        with at_most(count):
            results.append(simulate(MAIN, cycles=20, realizations=size, method="exact", seed=3))
    for name in ("angle", "velocity", "overturn_time", "overturn_side"):
        first = getattr(results[0], name)
        for other in results[1:]:
            assert first.tobytes() == getattr(other, name)[:300].tobytes()


def test_the_mirrored_scene_mirrors():
    """(x, v, Psi) -> (-x, -v, Psi + pi) without noise, to rounding as far as chaos lets it be seen."""
    scene = dataclasses.replace(MAIN, noise=NoNoise(), start=Start(0.2, -0.3))
    mirrored = dataclasses.replace(
        scene, forcing=Harmonic(4.6, 2.7, MAIN.forcing.phase + math.pi), start=Start(-0.2, 0.3)
    )
    plain, mirror_image = (simulate(s, cycles=5, realizations=1, method="exact") for s in (scene, mirrored))
    assert plain.angle == pytest.approx(-mirror_image.angle, abs=1e-10)
