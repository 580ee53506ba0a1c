"""The engines under pulses and records: against an independent integrator, and against each other."""

import numpy as np
import pytest
from transient_paths import followed, random_scene
from two_samples import survival_test

from fpk_rocking import BandNoise, Block, Dimensions, FilteredNoise, NoNoise, Pulse, Record, Scene, WhiteNoise
from montecarlo import histories, simulate, tally
from montecarlo.engines import batches

SAMPLES = np.sin(np.arange(70) * 0.35) * np.sin(np.arange(70) * np.pi / 69)
SHAKEN = Scene(Block(None, Dimensions(0.5, 1.8)), Record(0.04, SAMPLES, "g", 0.45), NoNoise())
PULSED = Scene(Block(0.9), Pulse("one-cosine", 2.6, 3.0), NoNoise())


@pytest.mark.parametrize("number", range(28))
def test_exact_paths_are_those_of_an_independent_integrator(number):
    # Where impacts amplify rounding, the integrator tells by how much at most.
    scene = random_scene(number)
    end = scene.forcing.duration
    times = np.append(end * np.linspace(0.13, 1.0, 7), end + np.array([0.7, 3.0]))
    states, bounds, path = followed(scene, times)
    ensemble = simulate(scene, times=times, realizations=1)
    got = np.stack([ensemble.angle[0, 1:], ensemble.velocity[0, 1:]], axis=-1)
    assert np.array_equal(np.isnan(got), np.isnan(states))
    off = np.nan_to_num(np.abs(got - states)).max(axis=1)
    assert (off <= 1e-10 + np.minimum(bounds, 1e-9)).all()
    assert (ensemble.overturn_side[0] != 0) == path.overturned
    if path.overturned:
        assert ensemble.overturn_time[0] == pytest.approx(path.t, abs=1e-10)


def test_some_of_these_paths_overturn():
    sides = [simulate(random_scene(number), realizations=1).overturn_side[0] for number in range(28)]
    assert {-1, 0, 1} <= set(np.sign(sides).tolist())


@pytest.mark.parametrize(("scene", "coarsest"), [(SHAKEN, 400), (PULSED, 200)], ids=["record", "pulse"])
def test_rk4_is_of_fourth_order_across_kinks_and_jumps(scene, coarsest):
    scene = scene.varied(noise=BandNoise(0.04, (0.0, 10.0), 30))
    common = {"times": scene.forcing.duration * np.array([0.4, 0.8, 1.0]), "realizations": 20, "seed": 3}
    exact = simulate(scene, **common)
    errors = []
    for steps in (coarsest, 2 * coarsest, 4 * coarsest):
        ensemble = simulate(scene, method="rk4", steps_per_cycle=steps, **common)
        errors.append(np.nanmedian(np.abs(ensemble.angle - exact.angle)[:, 1:]))
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert errors[0] > 1e-12
    assert orders == pytest.approx(4.0, abs=0.6)


@pytest.mark.parametrize(
    ("noise", "method"),
    [(BandNoise(0.1, (0.0, 9.0), 40), "exact"), (BandNoise(0.1, (0.0, 9.0), 40), "rk4"),
     (FilteredNoise("low-pass", 0.1, 9.0, 0.7), "filtered")],
)  # fmt: skip
@pytest.mark.parametrize("scene", [SHAKEN, PULSED], ids=["record", "pulse"])
def test_a_realization_does_not_depend_on_the_times(scene, noise, method):
    scene, end = scene.varied(noise=noise), scene.forcing.duration
    few, common = [0.31 * end, end + 1.0], {"realizations": 30, "method": method}
    times = np.union1d(np.linspace(0.0, end + 1.0, 77), few)
    many = simulate(scene, times=times, **common)
    sparse = simulate(scene, times=few, **common)
    rows = np.searchsorted(times, few)
    assert sparse.angle[:, 1:] == pytest.approx(many.angle[:, rows], abs=1e-9, nan_ok=True)
    assert sparse.velocity[:, 1:] == pytest.approx(many.velocity[:, rows], abs=1e-9, nan_ok=True)
    assert sparse.overturn_time == pytest.approx(many.overturn_time, abs=1e-9, nan_ok=True)
    # Nothing is told of what happens after the last time.
    early = simulate(scene, times=[0.83 * end], **common)
    before_end = many.overturn_time <= 0.83 * end
    assert np.array_equal(np.isfinite(early.overturn_time), before_end)
    assert np.array_equal(early.overturn_side != 0, before_end)
    run = histories(scene, times=few, **common)
    assert run.angle.tobytes() == sparse.angle.tobytes()


def test_white_paths_keep_their_law_whatever_the_times():
    # False alarms: 1 in 1000.
    scene = SHAKEN.varied(noise=WhiteNoise(0.02))
    end, size = scene.forcing.duration, 20_000
    few = np.array([0.5 * end, end, end + 2.0])
    many = np.union1d(np.linspace(0.05, end + 2.0, 61), few)
    first = simulate(scene, times=few, realizations=size, seed=1)
    second = simulate(scene, times=many, realizations=size, seed=2)
    rows = np.searchsorted(many, few) + 1
    assert survival_test(first.survivors[1:], size, second.survivors[rows], size).agrees
    assert 0.2 < first.survival[-1] < 0.9


def test_a_tally_counts_the_realizations_of_an_ensemble():
    scene, times = PULSED.varied(noise=BandNoise(0.2, (0.0, 9.0), 40)), [0.4, 1.9, 2.4, 9.0]
    ensemble = simulate(scene, times=times, realizations=400)
    counted = tally(scene, times=times, realizations=400)
    assert 0.0 < ensemble.survival[-1] < 1.0
    assert np.array_equal(counted.survival, ensemble.survival)
    assert np.array_equal(counted.overturned, ensemble.overturned)
    parts = np.concatenate([np.linspace(a, b, 21)[1:] for a, b in zip([0.0, *times[:-1]], times, strict=True)])
    passages = np.histogram(ensemble.overturn_time, np.append(0.0, parts))[0]
    assert np.array_equal(np.round(counted.first_passage.sum(axis=1)[1:] * 400), passages)


def test_a_forcing_that_repeats_is_cut_out_of_a_pulse():
    # Ten cycles of sine as a pulse, and as harmonic forcing -A cos(Ωτ + π/2): the same paths up to its end.
    from fpk_rocking import Harmonic

    noise = BandNoise(0.05, (0.0, 9.0), 40)
    pulse = Scene(Block(0.7), Pulse("n-sine", 2.5, 2.7, 10), noise)
    harmonic = Scene(Block(0.7), Harmonic(2.5, 2.7, np.pi / 2.0), noise)
    ensemble = simulate(harmonic, cycles=10, realizations=200)
    cut_out = simulate(pulse, times=ensemble.times, realizations=200)
    assert cut_out.angle == pytest.approx(ensemble.angle, abs=1e-8, nan_ok=True)
    assert 0.1 < cut_out.survival[-1] < 0.9
    assert batches.checked_run(pulse, None, 1, 1, None, 200).times[-1] == pytest.approx(pulse.forcing.duration + 10.0)
