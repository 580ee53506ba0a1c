"""Noise with an envelope: the envelopes themselves, every engine under them, and exact covariances of a flight."""

import math

import numpy as np
import pytest
from filter_formulas import autocovariance
from flight_moments import flight_moments
from scipy import stats

from fpk_rocking import (
    BandNoise,
    Block,
    CycleOperator,
    Dimensions,
    FilteredNoise,
    Harmonic,
    NoNoise,
    Overturning,
    Pulse,
    Record,
    Scene,
    Start,
    WhiteNoise,
)  # fmt: skip
from fpk_rocking.analytics import melnikov
from fpk_rocking.envelopes import Exponential, Table, Trapezoid
from fpk_rocking.physics.noise.envelope import FAINTEST, envelope_pieces, mean_diffusions
from montecarlo import simulate
from montecarlo.poincare import restarted_poincare_map
from montecarlo.splitting import split

ENVELOPES = [Trapezoid(0.7, 1.1, 2.2), Exponential(1.7), Table((0.2, 1.0, 4.0), (0.3, 1.2, 0.4)), Trapezoid(0, 1, 0)]
FLAT = Table((0.0, 1.0), (1.0, 1.0))
BAND, WHITE, FILTERED = BandNoise(0.1, (0.0, 9.0), 40), WhiteNoise(0.02), FilteredNoise("low-pass", 0.1, 9.0, 0.7)
PULSED = Scene(Block(0.9), Pulse("one-cosine", 2.6, 3.0), NoNoise())
TIMES = {"times": [0.3, 1.0, 2.5, 6.0]}


def with_envelope(noise, envelope):
    fields = {name: getattr(noise, name) for name in noise.__slots__ if name not in {"envelope", "remark"}}
    return type(noise)(**fields, envelope=envelope)


@pytest.mark.parametrize("envelope", ENVELOPES, ids=str)
def test_values_series_and_squares_agree(envelope):
    times = np.linspace(0.0, 7.0, 1401)
    values = envelope.value(times)
    assert (values >= 0.0).all()
    free = times[np.abs(times[:, None] - [0.0, *envelope.kinks]).min(axis=1) > 0.011]
    for late in (-0.01, 0.01):
        moved = np.array([np.polynomial.Polynomial(row)(late) for row in envelope.series(free, 8)])
        assert moved == pytest.approx(envelope.value(free + late), abs=1e-9)
    # Simpson's rule is exact between kinks, which are at nodes.
    middle = 0.5 * (times[1:] + times[:-1])
    inside = np.diff(times) / 6.0 * (values[1:] ** 2 + 4.0 * envelope.value(middle) ** 2 + values[:-1] ** 2)
    off = envelope.squared_integral(times) - np.append(0.0, np.cumsum(inside))
    assert np.abs(off).max() < (6e-3 if envelope.kind == "trapezoid" and not envelope.rise else 1e-10)
    assert mean_diffusions(0.3, None, times) == pytest.approx(np.full(1400, 0.3))


@pytest.mark.parametrize("envelope", ENVELOPES, ids=str)
def test_the_peak_of_an_envelope_may_be_taken_into_the_diffusion(envelope):
    times = np.linspace(0.0, 7.0, 1401)
    assert envelope.largest == pytest.approx(envelope.value(times).max(), rel=1e-4)
    noise = WhiteNoise(0.3, envelope)
    scaled = noise.with_unit_peak
    assert scaled.envelope.largest == 1.0
    squares = scaled.diffusion * scaled.envelope.value(times) ** 2
    assert squares == pytest.approx(0.3 * envelope.value(times) ** 2, rel=1e-13)
    assert scaled.with_unit_peak is scaled


@pytest.mark.parametrize("peak", [1e-3, 0.009, 1.0, 300.0])
@pytest.mark.parametrize("strength", [1e-6, 0.162, 40.0])
def test_which_noise_counts_as_none_does_not_depend_on_the_unit_of_its_envelope(strength, peak):
    """White noise D g² is what moves a block: a D twenty times as large under a smaller g is the same noise."""
    times = np.linspace(0.0, 60.0, 1201)
    values = np.array([0.0, 1.0, 0.02, 1e-4, 0.0])
    whole = mean_diffusions(strength, Table((0, 1, 5, 20, 50), tuple(values)), times)
    same = mean_diffusions(strength / peak**2, Table((0, 1, 5, 20, 50), tuple(peak * values)), times)
    assert same == pytest.approx(whole, rel=1e-10)
    assert not whole[-100:].any()
    dropped = strength * values[1] ** 2 * 1e-4
    assert whole[whole > 0.0].min() >= min(dropped, FAINTEST)
    assert (whole[:500] > 0.0).any()


def test_a_small_envelope_of_strong_white_noise_is_noise():
    """D = 2000 under an envelope of .009 is D = .162."""
    scenes = [
        Scene(Block(0.7), Harmonic(0.8, 2.0, 0.0), noise)
        for noise in (WhiteNoise(2000.0, Table((0.0, 1.0), (0.009, 0.009))), WhiteNoise(0.162))
    ]
    small, plain = (simulate(scene, cycles=2, realizations=4000, seed=seed) for seed, scene in enumerate(scenes))
    assert small.survival[-1] == pytest.approx(plain.survival[-1], abs=0.045)


@pytest.mark.parametrize("noise", [BAND, WHITE, FILTERED], ids=["band", "white", "filtered"])
@pytest.mark.parametrize("envelope", [*ENVELOPES, FLAT], ids=str)
def test_scenes_with_an_envelope_go_through_toml(noise, envelope):
    scene = PULSED.varied(noise=with_envelope(noise, envelope))
    assert Scene.from_toml(scene.to_toml()) == scene
    assert scene.white_equivalent().noise.envelope == envelope
    assert not scene.repeats


@pytest.mark.parametrize("forcing", [PULSED.forcing, Harmonic(2.0, 2.7, 1.0)], ids=str)
@pytest.mark.parametrize("noise", [BAND, FILTERED, WHITE], ids=["band", "filtered", "white"])
def test_an_envelope_of_one_changes_nothing(noise, forcing):
    asked = {"realizations": 100, **(TIMES if forcing.period is None else {"cycles": 3})}
    scene = PULSED.varied(forcing=forcing)
    plain = simulate(scene.varied(noise=noise), **asked)
    enveloped = simulate(scene.varied(noise=with_envelope(noise, FLAT)), **asked)
    if noise is WHITE:  # here a bounce in one draw ends with an interval
        assert np.abs(plain.survival - enveloped.survival).max() < 0.2
    else:
        assert enveloped.angle == pytest.approx(plain.angle, abs=1e-7, nan_ok=True)
        assert enveloped.overturn_time == pytest.approx(plain.overturn_time, abs=1e-7, nan_ok=True)


@pytest.mark.parametrize("forcing", [PULSED.forcing, Harmonic(2.0, 2.7, 1.0)], ids=str)
def test_rk4_comes_to_the_exact_engine(forcing):
    # Kinks of the envelope on steps: fourth order.
    step = forcing.time_scale / 200
    scene = PULSED.varied(forcing=forcing, noise=with_envelope(BAND, Trapezoid(30 * step, 40 * step, 100 * step)))
    asked = {"realizations": 40, **(TIMES if forcing.period is None else {"cycles": 2})}
    exact = simulate(scene, **asked)
    runs = [simulate(scene, method="rk4", steps_per_cycle=steps, **asked) for steps in (200, 400, 800)]
    errors = [np.nanmedian(np.abs(run.angle - exact.angle)[:, 1:]) for run in runs]
    assert 0.5 * np.log2(errors[0] / errors[2]) == pytest.approx(4.0, abs=0.5)
    assert errors[-1] < 1e-8


@pytest.mark.parametrize("envelope", ENVELOPES[:3], ids=str)
@pytest.mark.parametrize("name", ["white", "filtered", "exact"])
def test_flights_have_the_exact_mean_and_covariance(name, envelope):
    # False alarms: 1e-3 for each of the nine, by chi-square of the whitened sums of squares and of the means.
    noise = {"white": WHITE, "filtered": FilteredNoise("exponential", 0.1, 5.0), "exact": BAND}[name]
    far = {"start": Start(60.0, 0.0), "overturning": Overturning(9e3)}
    scene = PULSED.varied(noise=with_envelope(noise, envelope), **far)
    # On the grid of the white engine, whose steps to a time within an interval have the mean of D over all of it.
    times, size = scene.forcing.duration / 28 * np.array([4, 15, 39]), 40_000
    if name == "exact":
        variance, (low, high) = noise.variance, noise.band

        def covariance(lag):
            return variance * (high * np.sinc(high * lag / np.pi) - low * np.sinc(low * lag / np.pi)) / (high - low)
    else:
        covariance = None if name == "white" else lambda lag: autocovariance(noise, np.abs(lag))
    mean, wanted = flight_moments(scene, times, covariance)
    ensemble = simulate(scene, times=times, realizations=size, seed=5)
    for k in range(3):
        states = np.stack([ensemble.angle[:, k + 1], ensemble.velocity[:, k + 1]], axis=-1) - mean[k]
        root = np.linalg.inv(np.linalg.cholesky(wanted[k]))
        whitened = states @ root.T
        level = 1e-3 / 12.0
        if name == "exact":  # not Gaussian: a harmonic's kurtosis is less
            assert np.cov(whitened.T) == pytest.approx(np.eye(2), abs=0.035)
        else:
            squares = (whitened**2).sum(axis=0)
            assert np.all(np.abs(stats.chi2.cdf(squares, size) - 0.5) < 0.5 - 0.5 * level)
        assert np.abs(whitened.mean(axis=0) * math.sqrt(size)).max() < stats.norm.isf(0.5 * level)


def test_kinks_at_the_ends_of_intervals_cut_nothing():
    """Intervals of .5 from 0 on; the kinks are at 0, 1, 3 and 4.5, and one moved into an interval cuts it."""
    middles = 0.25 + 0.5 * np.arange(12)
    piece, ends, _ = envelope_pieces(Trapezoid(1.0, 2.0, 1.5), middles, 0.25, 2)
    assert piece.tolist() == list(range(13))
    assert ends == pytest.approx(np.full(12, 0.25))
    piece, ends, _ = envelope_pieces(Trapezoid(1.1, 1.9, 1.5), middles, 0.25, 2)
    assert piece.tolist() == [0, 1, 2, *range(4, 14)]
    assert ends[2:4] == pytest.approx([-0.15, 0.25])


def test_before_white_noise_begins_a_block_moves_as_without_noise():
    """Through impacts, near x = 0 and far from it."""
    scene, asked = PULSED.varied(start=Start(0.4, 0.1)), {"times": [0.5, 1.3, 2.7, 4.1, 6.0], "realizations": 1}
    quiet = simulate(scene, **asked)
    ensemble = simulate(scene.varied(noise=with_envelope(WHITE, Table((20.0, 21.0), (0.0, 1.0)))), **asked)
    assert np.sign(quiet.angle).min() < 0.0 < np.sign(quiet.angle).max()
    assert ensemble.angle == pytest.approx(quiet.angle, abs=1e-9)
    assert ensemble.velocity == pytest.approx(quiet.velocity, abs=1e-9)


def test_a_block_rests_once_white_noise_has_died_away():
    scene = Scene(Block(0.8), Pulse("one-sine", 0.5, 3.0), with_envelope(WHITE, Trapezoid(0.5, 1.0, 0.5)))
    ensemble = simulate(scene, times=[1.5, 14.0], realizations=500)
    assert np.abs(ensemble.velocity[:, 1]).min() > 0.0
    standing = ensemble.overturn_side == 0
    assert standing.mean() > 0.5
    assert (ensemble.velocity[standing, 2] == 0.0).mean() > 0.95


def test_records_take_an_envelope_too():
    samples = np.sin(np.arange(90) * 0.25) * np.sin(np.arange(90) * np.pi / 89)
    size = Dimensions(0.5, 1.8)
    scene = Scene(Block(None, size), Record(0.02, samples, "g", 0.6), with_envelope(BAND, Exponential(1.7)))
    exact = simulate(scene, times=[2.0, 5.0], realizations=50)
    steps = simulate(scene, times=[2.0, 5.0], realizations=50, method="rk4", steps_per_cycle=800)
    assert np.nanmedian(np.abs(exact.angle - steps.angle)[:, 1:]) < 1e-9


def test_what_changes_with_time_is_refused_where_it_has_no_meaning():
    white, band = (Scene(Block(0.8), Harmonic(2.0, 2.7), with_envelope(n, ENVELOPES[0])) for n in (WHITE, BAND))
    calls = (
        lambda: CycleOperator(white),
        lambda: split(white, cycles=1),
        lambda: restarted_poincare_map(band, cycles=1, realizations=1),
        lambda: melnikov.phase_flux(band.forcing, 0.8, band.noise),
    )
    for call in calls:
        with pytest.raises(ValueError, match=r"noise.envelope: got Trapezoid.*, accepted: no envelope, as"):
            call()


def test_envelopes_that_no_engine_carries_are_refused_by_name():
    """Values that overflow, and times that leave nothing of each other: under filtered noise such a run did not end."""
    for envelope, says in (
        (Table((0.0, 1.0), (0.5, 1e308)), "values: got 1e.308, accepted: an absolute value from 0 to 10000"),
        (
            Table((0.0, 1e-300), (0.5, 1.0)),
            "times: got 1e-300, accepted: an absolute value from 1e-05 to 100000, or 0",
        ),
        (Exponential(1e300), "peak: got 1e.300"),
        (Trapezoid(0.0, 0.0, 1e-300), "decay: got 1e-300"),
    ):
        for noise in (WHITE, BAND):
            with pytest.raises(ValueError, match=rf"noise\.envelope\.{says}"):
                simulate(PULSED.varied(noise=with_envelope(noise, envelope)), realizations=1)
    assert (
        simulate(PULSED.varied(noise=with_envelope(WHITE, Trapezoid(0.0, 1.0, 0.0))), realizations=1).realizations == 1
    )


def test_bad_envelopes_are_refused_by_name():
    for make, says in (
        (lambda: Trapezoid(-1.0, 1.0, 1.0), r"noise.envelope.rise: got -1.0"),
        (lambda: Trapezoid(0.0, 0.0, 0.0), r"noise.envelope: got Trapezoid"),
        (lambda: Exponential(0.0), r"noise.envelope.peak: got 0.0"),
        (lambda: Table((0.0, 0.0), (1.0, 1.0)), r"noise.envelope.times: got \(0.0, 0.0\), accepted: two or more asc"),
        (lambda: Table((0.0, 1.0), (1.0,)), r"noise.envelope.values: got \(1.0,\), accepted: 2 values"),
        (lambda: Table((0.0, 1.0), (0.0, 0.0)), r"noise.envelope.values: got \(0.0, 0.0\)"),
        (lambda: Table((0.0, 1.0), (1.0, -1.0)), r"noise.envelope.values\[1\]: got -1.0"),
    ):
        with pytest.raises(ValueError, match=says):
            make()
    with pytest.raises(TypeError, match=r"noise.envelope: got 1.0, accepted: Trapezoid or Exponential or Table"):
        WhiteNoise(0.1, 1.0)
    text = PULSED.varied(noise=with_envelope(WHITE, ENVELOPES[0])).to_toml()
    with pytest.raises(
        ValueError, match=r"noise.envelope.kind: got 'box', accepted: 'trapezoid', 'exponential', 'table'"
    ):
        Scene.from_toml(text.replace('"trapezoid"', '"box"'))
    with pytest.raises(ValueError, match=r"noise.envelope.hold: missing"):
        Scene.from_toml(text.replace("hold", "# hold"))
