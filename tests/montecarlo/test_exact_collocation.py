"""Event-driven paths of exact blocks against quadratures, an independent integrator and the slender limit."""

import math

import numpy as np
import pytest
from filtered_paths import coupled
from scipy.integrate import quad
from transient_paths import ForcedBlock, followed, random_scene

from fpk_rocking import FilteredNoise
from fpk_rocking.envelopes import Exponential, Trapezoid
from fpk_rocking.physics.motion.collocation import PLACES
from fpk_rocking.physics.noise import band
from fpk_rocking.scene import BandNoise, Block, Harmonic, NoNoise, Overturning, Pulse, Record, Scene, Start
from montecarlo import histories, restarted_poincare_map, simulate, tally
from montecarlo.engines import band_noise, batches, exact, exact_block
from montecarlo.engines.random import open_stream, stream_keys

BLOCK = Block(0.85, critical_angle=0.3)
NOISE = BandNoise(0.04, (0.0, 9.0), 30)
ENVELOPED = BandNoise(0.04, (0.0, 9.0), 30, envelope=Trapezoid(1.0, 3.0, 1.5))
SCENE = Scene(BLOCK, Harmonic(2.5, 2.7, 1.0), NOISE)


def housner(angle):
    """Restitution of a solid block by the formula of Housner."""
    return 1.0 - 1.5 * math.sin(angle) ** 2


@pytest.mark.parametrize(
    ("angle", "frequency", "edges"),
    [
        (0.1, 3.0, (1.3766, 3.6306, 3.6487)),
        (0.3, 3.0, (1.4648, 3.6043, 3.7932)),
        (0.25, 5.0, (2.9448, 6.8265, 7.4930)),
    ],
)
def test_amplitudes_at_which_a_sine_pulse_begins_or_ceases_to_overturn(angle, frequency, edges):
    """Edges from two independent integrations, known to 1e-4; overturned is |θ| > π/2."""
    end = 2.0 * math.pi / frequency
    for k, edge in enumerate(edges):
        for amplitude in (edge - 1.2e-4, edge + 1.2e-4):
            pulse, cutoff = Pulse("one-sine", amplitude, frequency), Overturning(0.5 * math.pi / angle)
            scene = Scene(Block(housner(angle), critical_angle=angle), pulse, NoNoise(), overturning=cutoff)
            overturns = simulate(scene, times=[end + 40.0]).overturn_side[0] != 0
            assert overturns == ((amplitude > edge) == (k != 1))


@pytest.mark.parametrize(("angle", "start"), [(0.05, 0.4), (0.3, 0.6), (0.3, 0.05), (1.0, 0.5)])
def test_free_rocking_is_its_quadrature_and_keeps_its_energy(angle, start):
    scene = Scene(Block(0.8, critical_angle=angle), Harmonic(0.0, 1.0), NoNoise(), Start(start))
    run = histories(scene, cycles=2, samples_per_cycle=400)

    def slowness(r):
        """Time by r, u = start (1 - r²), from the energy; the difference of cosines as a product."""
        u = start * (1.0 - r * r)
        sines = math.sin(0.5 * angle * (2.0 - start - u)) * math.sin(0.5 * angle * (start - u))
        return 2.0 * start * r * angle / math.sqrt(4.0 * sines)

    assert run.impact_time[0] == pytest.approx(quad(slowness, 0.0, 1.0, epsabs=0.0, epsrel=1e-13)[0], abs=1e-12)
    drop = math.cos(angle * (1.0 - start)) - math.cos(angle)
    speeds = math.sqrt(2.0 * drop) / angle * 0.8 ** np.arange(run.impact_time.size)
    assert np.abs(run.impact_velocity) == pytest.approx(speeds, abs=1e-12)
    phi = angle * (1.0 - np.abs(run.angle[0]))
    energy = 0.5 * run.velocity[0] ** 2 - (1.0 - np.cos(phi)) / angle**2
    flight = np.searchsorted(run.impact_time, run.time)
    levels = 0.5 * np.append(0.0, speeds * 0.8) ** 2 - (1.0 - math.cos(angle)) / angle**2
    levels[0] = -(1.0 - math.cos(angle * (1.0 - start))) / angle**2
    assert np.abs(energy - levels[flight]).max() < 1e-12


@pytest.mark.parametrize("number", range(14))
def test_paths_under_pulses_and_records_are_those_of_an_independent_integrator(number):
    scene = random_scene(number, slender=False)
    end = scene.forcing.duration
    times = np.append(end * np.linspace(0.13, 1.0, 7), end + np.array([0.7, 3.0]))
    states, bounds, path = followed(scene, times)
    run = histories(scene, times=times)
    got = np.stack([run.angle[0, 1:], run.velocity[0, 1:]], axis=-1)
    assert np.array_equal(np.isnan(got), np.isnan(states))
    assert (np.nan_to_num(np.abs(got - states)).max(axis=1) <= 1e-10 + np.minimum(bounds, 1e-9)).all()
    hits = np.array([time for time, name in path.events if name == "impact"])
    fast = (np.abs(run.impact_velocity) > 1e-4) & (run.impact_time < times[-1])
    assert all(np.abs(hits - time).min() < 1e-8 for time in run.impact_time[fast])
    assert (run.overturn_side[0] != 0) == path.overturned
    if path.overturned:
        assert run.overturn_time[0] == pytest.approx(path.t, abs=1e-9)


def realized(scene, seed, number):
    """Force of a realization as a function of time, from the numbers that the engine draws."""
    parameters = exact_block.parameters_of(scene, 200, np.array([scene.period]))
    drawn = band.allocate_realization(parameters.band.harmonics, 1)
    band_noise.draw_start_and_noise(open_stream(stream_keys(seed), number), parameters.start, parameters.band, drawn)
    count, period = parameters.band.harmonics, parameters.grid.count * parameters.grid.spacing
    rates, phases = 2.0 * math.pi * drawn.ratios[:count] / period, 2.0 * math.pi * drawn.phases[:count]
    forcing, envelope = scene.forcing, scene.noise.envelope

    def force(t):
        noise = parameters.band.weight * np.cos(rates * t + phases).sum()
        strength = 1.0 if envelope is None else envelope.value(np.array([t]))[0]
        return float(-forcing.amplitude * math.cos(forcing.frequency * t + forcing.phase) + strength * noise)

    return force


@pytest.mark.parametrize(
    "envelope", [None, Exponential(3.0), Trapezoid(1.0, 2.0, 1.5)], ids=["none", "smooth", "kinks"]
)
def test_paths_under_noise_are_those_of_an_independent_integrator(envelope):
    scene = SCENE.varied(noise=BandNoise(0.09, (0.0, 9.0), 30, envelope=envelope))
    end = 3.0 * scene.period
    kinks = [end + 1.0] if envelope is None or not len(envelope.kinks) else [*envelope.kinks[1:].tolist(), end + 1.0]
    run = histories(scene, cycles=3, realizations=2, samples_per_cycle=8, seed=4)
    for number in range(2):
        path = ForcedBlock(realized(scene, 4, number), kinks, 0.85, scene.overturning.angle, 0.0, 0.0, 0.3)
        for k, time in enumerate(run.time[1:], 1):
            path.advance(time)
            if path.overturned:
                assert run.overturn_time[number] == pytest.approx(path.t, abs=1e-9)
                break
            assert (run.angle[number, k], run.velocity[number, k]) == pytest.approx((path.x, path.v), abs=1e-9)


@pytest.mark.parametrize("noise", [NOISE, ENVELOPED, FilteredNoise("low-pass", 0.04, 5.0, 0.7)])
def test_a_block_becomes_slender_with_order_2(noise):
    scene = SCENE.varied(noise=noise, start=Start(0.3))
    slender = simulate(scene.varied(block=Block(0.85)), cycles=1, realizations=100)
    angles, errors = np.array([0.02, 0.04, 0.08]), []
    for angle in angles:
        ensemble = simulate(scene.varied(block=Block(0.85, critical_angle=float(angle))), cycles=1, realizations=100)
        errors.append(np.median(np.abs(ensemble.angle - slender.angle)[:, 1]))
    assert np.polyfit(np.log(angles), np.log(errors), 1)[0] == pytest.approx(2.0, abs=0.15)


def test_late_cycles_have_their_noise():
    """In the slender limit, past chunks and fresh anchors: impacts up to cycle 60 are those of the slender engine."""
    scene = Scene(Block(0.5), Harmonic(0.2, 2.7), BandNoise(0.3, (0.0, 10.0), 40), Start(1e-9))
    collocated = histories(scene, cycles=60, samples_per_cycle=1)
    limit = histories(scene.varied(block=Block(0.5, critical_angle=1e-6)), cycles=60, samples_per_cycle=1)
    impacts, limit_impacts = (run.impact_time[np.abs(run.impact_velocity) > 1e-3] for run in (collocated, limit))
    assert impacts.size == limit_impacts.size > 50
    assert impacts == pytest.approx(limit_impacts, abs=1e-8)


@pytest.mark.parametrize("noise", [NOISE, FilteredNoise("low-pass", 0.04, 5.0, 0.7)], ids=["band", "filtered"])
def test_a_run_that_begins_later_goes_on(noise):
    scene = SCENE.varied(noise=noise)
    complete = simulate(scene, cycles=4, realizations=6, seed=7)
    assert np.isfinite(complete.angle[:, 4]).sum() >= 3
    for r in np.nonzero(np.isfinite(complete.angle[:, 4]))[0]:
        begun = scene.varied(start=Start(complete.angle[r, 3], complete.velocity[r, 3]))
        run = batches.checked_run(begun, 1, int(r) + 1, 7, None, 200)
        (batch,) = batches.simulate_batches(run, first=int(r), cycle=3)
        assert batch.angle[0, 1] == pytest.approx(complete.angle[r, 4], abs=1e-11)


def test_maps_samples_and_tallies_are_of_the_same_paths():
    ensemble = simulate(SCENE, cycles=6, realizations=300)
    run = histories(SCENE, cycles=6, realizations=300, samples_per_cycle=7)
    assert run.poincare()[0].tobytes() == ensemble.angle.tobytes()
    assert run.overturn_time.tobytes() == ensemble.overturn_time.tobytes()
    assert np.array_equal(tally(SCENE, cycles=6, realizations=300).overturned, ensemble.overturned)
    assert 0.0 < ensemble.survival[-1] < 1.0
    quiet = SCENE.varied(noise=NoNoise())
    mapped = restarted_poincare_map(quiet, cycles=4)
    assert mapped.points[:, 0] == pytest.approx(simulate(quiet, cycles=4).angle[0], abs=1e-11)


def test_the_mirrored_scene_mirrors():
    scene = SCENE.varied(noise=NoNoise(), start=Start(0.2, -0.3))
    mirrored = scene.varied(forcing=Harmonic(2.5, 2.7, 1.0 + math.pi), start=Start(-0.2, 0.3))
    plain, mirror_image = (simulate(scene_or_mirrored, cycles=5) for scene_or_mirrored in (scene, mirrored))
    assert plain.angle == pytest.approx(-mirror_image.angle, abs=1e-10, nan_ok=True)
    # Noise has no side: as many realizations go over to the left as to the right (false alarms: 6e-5).
    still = Scene(BLOCK, Harmonic(0.0, 2.7), BandNoise(1.2, (0.0, 6.0), 30))
    left, right = simulate(still, cycles=4, realizations=4000).overturned[-1] * 4000
    assert left + right > 500
    assert abs(left - right) < 4.0 * math.sqrt(left + right)


def test_a_block_lifts_off_beyond_the_level_of_its_angle():
    level = BLOCK.lift_off
    for amplitude, moves in ((level * (1.0 - 1e-9), False), (level * (1.0 + 1e-6), True)):
        run = simulate(Scene(BLOCK, Harmonic(amplitude, 2.7), NoNoise()), cycles=3)
        assert bool(np.nanmax(np.abs(run.velocity))) == moves or histories(run.scene, cycles=3).angle.any() == moves


@pytest.mark.slow
def test_what_the_polynomial_of_filtered_noise_leaves_out_is_of_its_order():
    """As for a slender block: coupled paths after a cycle, intervals as 1 : 2 : 4 against eight times finer.

    The intervals have no parts, with which the errors are below what as many paths can tell. 200,000 paths tell the
    order to 0.2; false alarm 1.3e-2.
    """
    scene = SCENE.varied(noise=FilteredNoise("exponential", 0.04, 5.0), forcing=Harmonic(0.867, 1.374, math.pi))
    errors = []
    for factor in (4, 8, 16):
        _, angle = coupled(scene, 256, factor, 1, 200_000, parts=False)
        errors.append(abs(np.mean(np.abs(angle[:, 1]) - np.abs(angle[:, 0]))))
    steps = np.diff(errors)
    assert errors[0] < errors[1] < errors[2] < 3e-4
    assert math.log2(steps[1] / steps[0]) == pytest.approx(1.65, abs=0.5)


@pytest.mark.parametrize("slack", [math.inf, -1.0])
def test_rest_is_decided_by_the_force_at_points_as_by_the_search_for_lift_off(slack):
    """Where nothing is decided by points (inf) paths are the same to the bit; where too much is, they are not."""
    motion = np.random.default_rng(5).normal(0.0, 1.5, 400)
    record = Record(0.02, motion.tolist(), "m/s2")
    scene = Scene.from_block(0.6, 2.0, record=record, noise_rms_acceleration=0.8, noise_band_hz=(0.0, 5.0))
    times = np.linspace(0.0, 20.0, 41)
    usual = simulate(scene, times=times, realizations=20, method="exact")
    assert 0.05 < np.mean(usual.angle[:, 1:] == 0.0) < 0.95
    run = batches.checked_run(scene, None, 20, 1, "exact", 200, times=times)
    parameters = exact_block.parameters_of(scene, None, times[1:])
    flight = parameters.flight._replace(slack=np.full_like(parameters.flight.slack, slack))
    (other,) = batches.simulate_batches(run, parameters=parameters._replace(flight=flight))
    assert np.array_equal(usual.angle, other.angle, equal_nan=True) is (slack == math.inf)


@pytest.mark.parametrize("interval", [0.005, 0.02])
def test_noise_under_a_record_is_that_of_its_harmonics_between_samples_as_well(interval):
    """A block that stays at one side moves by the force, which is that of the harmonics at any time."""
    record = Record(interval, (0.0, 0.1, 0.0), "m/s2")
    scene = Scene.from_block(0.6, 2.0, record=record, noise_rms_acceleration=0.3, noise_band_hz=(0.0, 5.0))
    parameters = exact_block.parameters_of(scene, None, np.array([4.0]))
    assert parameters.halvings == {0.005: 3, 0.02: 1}[interval]
    workspace = exact.workspace_of(parameters)
    harmonics = workspace.samples.harmonics
    rng, count = np.random.default_rng(1), parameters.band.harmonics
    harmonics.ratios[:count] = parameters.band.ratio_width * rng.random(count)
    harmonics.phases[:count] = rng.random(count)
    harmonics.weights[:count] = 0.1
    band_noise.divide_by_window(harmonics, parameters)
    band_noise.write_first_samples(workspace.samples, 0, parameters)
    for number in range(parameters.grid.count):
        band_noise.write_next_samples(workspace.samples, number, 0, parameters)
        sample, part = band_noise.sample_and_part(number, parameters)
        row = band.WIDTH * part
        near = workspace.samples.values[sample % band_noise.CHUNK :][: band.WIDTH]
        values = near @ parameters.flight.values[row : row + band.WIDTH]
        turns = (number + PLACES)[:, None] / parameters.grid.count * harmonics.ratios[:count] + harmonics.phases[:count]
        assert values == pytest.approx(0.1 * np.cos(2.0 * np.pi * turns).sum(axis=1), abs=1e-10)
