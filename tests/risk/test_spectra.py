"""Response spectra: against integration, as intensities, and as what a floor's motion is recognized by."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from suites import SIZE, record

from fpk_rocking import Block, Harmonic, NoNoise, Record, Scene
from fpk_rocking.risk import Building, at_intensity, critical_intensities, response_spectrum, synthetic_records
from fpk_rocking.risk.motions import NARROW, floor_diagnostics, intensity_of
from fpk_rocking.risk.spectra import narrowness

G = 9.80665


def oscillator(samples, interval, period, damping, lasts):
    """Relative displacement and acceleration of an oscillator by DOP853, from sample to sample of lines between them.

    They start at 0, one interval before the first sample.
    """
    rate, points = 2.0 * math.pi / period, np.concatenate([[0.0], samples, np.zeros(math.ceil(lasts / interval))])
    state, rows = np.zeros(2), [(0.0, 0.0, 0.0)]
    for k in range(len(points) - 1):
        slope = (points[k + 1] - points[k]) / interval

        def move(t, y, k=k, slope=slope):
            return [y[1], -points[k] - slope * t - 2.0 * damping * rate * y[1] - rate**2 * y[0]]

        steps = np.linspace(0.0, interval, 9)
        found = solve_ivp(move, (0.0, interval), state, "DOP853", steps, rtol=1e-12, atol=1e-14)
        state = found.y[:, -1]
        rows += [(k * interval + t, u, move(t, (u, v))[1]) for t, u, v in zip(steps[1:], *found.y[:, 1:], strict=True)]
    return np.array(rows).T


@pytest.mark.parametrize(("period", "damping"), [(0.11, 0.05), (0.6, 0.02), (2.3, 0.2)])
def test_a_spectrum_is_that_of_integration_with_the_vibration_after_the_motion(period, damping):
    """The record ends at full strength: after it the oscillator swings farther."""
    samples = np.array(record(3).samples)[40:125]
    motion = Record(0.02, samples, "m/s2", scale=-1.7)
    _, moved, _ = oscillator(1.7 * samples, 0.02, period, damping, period)
    during = np.abs(moved[: 8 * samples.size]).max()
    assert np.abs(moved).max() > during * (1.0 + 1e-6) or period < 1.0
    (found,) = response_spectrum(motion, [period], damping)
    assert found == pytest.approx((2.0 * math.pi / period) ** 2 * np.abs(moved).max(), rel=6e-4)
    inches = Record(0.02, 1.7 / 0.0254 * samples, "in/s2")
    assert response_spectrum(inches, [period], damping) == pytest.approx([found], rel=1e-9)


def test_a_spectrum_ends_in_the_peaks_of_the_motion():
    """Very stiff: the acceleration itself. Very soft: the ground's displacement times ω²."""
    motion = synthetic_records(1, duration=8.0)[0]
    samples = np.array(motion.samples)
    velocity = 0.01 * np.concatenate([[0.0], np.cumsum(0.5 * (samples[1:] + samples[:-1]))])
    displacement = np.abs(0.01 * np.cumsum(velocity)).max()
    stiff, soft = response_spectrum(motion, [0.01, 20.0])
    assert stiff == pytest.approx(np.abs(samples).max(), rel=0.02)
    assert soft == pytest.approx((0.1 * math.pi) ** 2 * displacement, rel=0.15)
    for period in (0.009, 21.0):
        with pytest.raises(ValueError, match=r"^period\[0\]: got .*, accepted: a finite number >= 0\.01 and <= 20"):
            response_spectrum(motion, [period])


def test_scenes_at_a_spectral_acceleration_have_it():
    scene = Scene(Block(0.9, SIZE), record(1), NoNoise())
    for name in ("Sa(1.0)", "SA(1)", "PSA(T=1.0 s)", "sa(1.)"):
        assert intensity_of(scene, name) == pytest.approx(response_spectrum(record(1), [1.0])[0] / G, rel=1e-12)
    there = at_intensity(scene, "Sa(1.0)", 0.4)
    assert response_spectrum(there.forcing, [1.0])[0] == pytest.approx(0.4 * G, rel=1e-12)
    wide = at_intensity(scene, "PGV*", 0.8)
    p, angle = SIZE.frequency_parameter, SIZE.critical_angle
    assert intensity_of(wide, "PGV") == pytest.approx(0.8 * SIZE.gravity * math.tan(angle) / p, rel=1e-12)
    for name in ("Sa", "Sa(0.001)", "Sa(1.0", "Sv(1.0)", "SD(1.0)"):
        with pytest.raises(
            ValueError, match=r"^measure: got '.*', accepted: 'PGA', .*'Sa\(T\)' with a period of 0\.01"
        ):
            intensity_of(scene, name)
    with pytest.raises(
        ValueError, match=r"^measure: got 'Sa\(1\.0\)', accepted: PGA or PGV of a motion that is no rec"
    ):
        at_intensity(Scene(Block(0.9, SIZE), Harmonic(1.0, 2.0), NoNoise()), "Sa(1.0)")


def test_critical_spectral_accelerations_are_the_same_scales():
    scenes = [Scene(Block(0.9, SIZE), record(seed), NoNoise()) for seed in (1, 2)]
    by_scale, by_sa = (critical_intensities(scenes, measure=measure) for measure in ("scale", "SA(0.5)"))
    assert (by_sa.measure, by_sa.unit) == ("Sa(0.5)", "g")
    own = [response_spectrum(scene.forcing, [0.5])[0] / G for scene in scenes]
    assert by_sa.critical == pytest.approx(by_scale.critical * own, rel=2e-3)


def test_floors_are_told_from_the_ground_and_only_where_their_peaks_count():
    """Of synthetic ground motions none of 40 is taken for a floor's; of floors on them nine in ten are."""
    ground = synthetic_records(40, seed=5)
    buildings = [Building(period, 0.03, 1.3) for period in np.geomspace(0.2, 1.5, 40)]
    floors = [building.floor_motion(motion) for building, motion in zip(buildings, ground, strict=True)]
    assert max(map(narrowness, ground)) < NARROW
    assert np.mean([narrowness(floor) > NARROW for floor in floors]) >= 0.9
    records = [Record(floor.interval, floor.samples, floor.units) for floor in floors]

    def scenes(motions):
        return [Scene(Block(0.9, SIZE), motion, NoNoise()) for motion in motions]

    (found,) = floor_diagnostics(scenes(records), "PGV")
    assert found.message.startswith(f"{sum(narrowness(one) > NARROW for one in floors)} of 40 motions have one narrow")
    assert floor_diagnostics(scenes(records[:3] + list(ground[:4])), "PGA") == []
    for motions, measure in ((ground, "PGV"), (records, "PFA"), (records, "scale"), (floors, "PGV")):
        assert floor_diagnostics(scenes(motions), measure) == []
