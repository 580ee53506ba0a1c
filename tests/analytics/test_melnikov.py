"""Melnikov process and criteria against quadrature over the orbit, sampled noise and integration of the manifolds."""

import inspect
import math

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp

from fpk_rocking import BandNoise, Harmonic, NoNoise, WhiteNoise, melnikov

FORCING = Harmonic(4.0, 4.0)
NOISE = BandNoise(0.16, (0.0, 10.0), 100)


def test_heteroclinic_orbit_is_a_flight_between_the_saddles():
    times = np.linspace(0.3, 8.0, 12)
    solved = solve_ivp(lambda _, z: (z[1], z[0] - 1.0), (0.0, 8.0), (0.0, 1.0), t_eval=times, rtol=1e-12, atol=1e-14)
    angle, velocity = melnikov.heteroclinic_orbit(np.concatenate([-times, times]))
    # The orbit's neighbours leave like exp(τ), and so do the integrator's errors.
    tolerance = 1e-13 * np.exp(times) + 1e-12
    assert np.all(np.abs(angle[12:] - solved.y[0]) < 50 * tolerance)
    assert np.all(np.abs(velocity[12:] - solved.y[1]) < 50 * tolerance)
    np.testing.assert_array_equal(angle[:12], -angle[12:])
    np.testing.assert_array_equal(velocity[:12], velocity[12:])
    assert melnikov.heteroclinic_orbit(0.0) == (0.0, 1.0)


@pytest.mark.parametrize("frequency", [0.0, 0.3, 1.0, 2.7, 10.0])
def test_transfer_by_quadrature_of_the_orbit(frequency):
    def velocity(time):
        return melnikov.heteroclinic_orbit(time)[1]

    rule = {"weight": "cos", "wvar": frequency, "epsabs": 1e-13, "limit": 200}
    halves = [quad(velocity, *ends, **rule)[0] for ends in ((-45.0, 0.0), (0.0, 45.0))]
    assert melnikov.transfer(frequency) == pytest.approx(sum(halves), abs=1e-11)


def test_mean_is_the_work_of_the_forcing_less_the_loss():
    forcing, e = Harmonic(1.7, 2.3, 0.8), 0.6
    for offset in (0.0, 0.9, 3.1):

        def power(time, offset=offset):
            velocity = melnikov.heteroclinic_orbit(time)[1]
            return -velocity * 1.7 * math.cos(2.3 * (time + offset) + 0.8)

        work = sum(quad(power, *ends, epsabs=1e-12, limit=500)[0] for ends in ((-40.0, 0.0), (0.0, 40.0)))
        # The orbit arrives with the velocity 1 and leaves with e.
        assert melnikov.process_mean(forcing, e, offset) == pytest.approx(work - (1.0 - e * e) / 2.0, abs=1e-10)


def test_sampled_process_is_the_work_of_its_noise():
    noise, forcing, e = BandNoise(0.3, (0.3, 3.0), 4), Harmonic(1.0, 2.0), 0.8
    generator = np.random.default_rng(5)
    nu, phi = generator.uniform(0.3, 3.0, 4), generator.uniform(0.0, 2.0 * math.pi, 4)

    def power(time, offset):
        push = math.sqrt(2.0 * 0.3 / 4) * np.cos(nu * (time + offset) + phi).sum() - math.cos(2.0 * (time + offset))
        return melnikov.heteroclinic_orbit(time)[1] * push

    sampled = melnikov.sampled_process(forcing, e, noise, [0.0, 1.3], nu, phi)
    for offset, value in zip((0.0, 1.3), sampled, strict=True):
        work = sum(quad(power, *ends, (offset,), epsabs=1e-12, limit=500)[0] for ends in ((-38.0, 0.0), (0.0, 38.0)))
        assert value == pytest.approx(work - 0.18, abs=1e-10)


def test_sampled_processes_have_the_mean_variance_and_flux():
    """4000 realizations at 16 phases of cycles far apart; each of the three fails falsely with probability 7e-6."""
    generator, realizations = np.random.default_rng(2), 4000
    shape = (realizations, NOISE.harmonics)
    nu, phi = generator.uniform(0.0, 10.0, shape), generator.uniform(0.0, 2.0 * math.pi, shape)
    times = FORCING.period * (13.0 + 1.0 / 16.0) * np.arange(16)
    process = melnikov.sampled_process(FORCING, 0.5, NOISE, times, nu, phi)
    assert process.shape == (realizations, 16)
    noise = process - melnikov.process_mean(FORCING, 0.5, times)
    positive = np.maximum(process, 0.0)
    exact = (0.0, melnikov.noise_variance(NOISE), melnikov.phase_flux(FORCING, 0.5, NOISE))
    for values, expected in zip((noise, noise**2, positive), exact, strict=True):
        means = values.mean(axis=1)
        error = means.std(ddof=1) / math.sqrt(realizations)
        assert means.mean() == pytest.approx(expected, abs=4.5 * error)
        assert error < 0.02


def test_critical_amplitudes():
    expected = {0.3: 0.91 * 17 / 4, 0.5: 0.75 * 17 / 4, 0.9: 0.19 * 17 / 4, 1.0: 0.0}
    for e, amplitude in expected.items():
        assert melnikov.critical_amplitude(4.0, e, NoNoise()) == pytest.approx(amplitude, rel=1e-14)
    # σ_M² = 0.032 (10/101 + atan 10), more than M² at e = 0.9.
    square = 0.032 * (10.0 / 101.0 + math.atan(10.0))
    pinned = [8.5 * math.sqrt(loss**2 - square) for loss in (0.455, 0.375, 0.255)] + [0.0]
    assert melnikov.critical_amplitude(4.0, [0.3, 0.5, 0.7, 0.9], NOISE) == pytest.approx(pinned, rel=1e-13)
    assert pinned[:3] == pytest.approx([3.36562, 2.55539, 1.03339], abs=1e-5)


@pytest.mark.parametrize(("criterion", "share"), [("peak", 1.0), ("mean square", 0.5)])
def test_critical_amplitude_meets_its_criterion_and_no_smaller_one_does(criterion, share):
    omega, e = np.array([0.7, 2.7, 6.0]), np.array([[0.2], [0.5]])
    amplitude = melnikov.critical_amplitude(omega, e, NOISE, criterion)
    assert amplitude.shape == (2, 3)
    square = share * melnikov.harmonic_amplitude((amplitude, omega)) ** 2 + melnikov.noise_variance(NOISE)
    assert square == pytest.approx(np.broadcast_to(melnikov.impact_loss(e) ** 2, (2, 3)), rel=1e-13)


def test_margin_vanishes_at_the_critical_amplitude():
    for noise in (NoNoise(), NOISE, WhiteNoise(0.01)):
        amplitude = melnikov.critical_amplitude(2.7, 0.5, noise)
        assert melnikov.margin((amplitude, 2.7), 0.5, noise) == pytest.approx(0.0, abs=1e-15)
        assert melnikov.margin((1.1 * amplitude, 2.7), 0.5, noise) > 0.0
    margins = melnikov.margin(Harmonic(4.6, 2.7), 0.5, [NoNoise(), BandNoise(0.04, (0.0, 10.0), 100)])
    assert margins == pytest.approx([9.2 / 8.29 - 0.375, math.hypot(9.2 / 8.29, 0.112076) - 0.375], abs=1e-6)


def jump(amplitude, omega, e, moment):
    """Velocity with which the unstable orbit of the left saddle leaves x = 0, less that of the stable one of the right.

    Both by integration of the motion from close to the saddles' own orbits ±1 + P, backward in time for the stable one.
    """
    size = amplitude / (1.0 + omega * omega)

    def motion(time, state, side):
        return state[1], state[0] - side - amplitude * math.cos(omega * time)

    speeds = []
    for side, direction in ((-1.0, 1.0), (1.0, -1.0)):
        start = moment - 14.0 * direction
        # Where it arrives depends on how far from the saddle's orbit it begins: x = 0 is met at `moment`.
        away = -side * (1.0 + side * size * math.cos(omega * moment)) * math.exp(-14.0)
        saddle = side + size * math.cos(omega * start), -size * omega * math.sin(omega * start)
        begin = saddle[0] + away, saddle[1] + direction * away
        arrived = solve_ivp(motion, (start, moment), begin, "DOP853", args=(side,), rtol=3e-14, atol=1e-15).y[:, -1]
        assert abs(arrived[0]) < 1e-6
        speeds.append(arrived[1])
    return e * speeds[0] - speeds[1]


@pytest.mark.parametrize(("omega", "e"), [(1.0, 0.5), (2.7, 0.5), (6.0, 0.3), (4.0, 0.9)])
def test_manifolds_touch_at_the_exact_critical_amplitude(omega, e):
    """The jump over the phase is a constant and one harmonic, so three phases tell its maximum, which is zero there."""
    critical = melnikov.exact_critical_amplitude(omega, e)
    phases = 2.0 * math.pi * np.arange(3) / 3.0
    jumps = np.array([jump(critical, omega, e, phase / omega) for phase in phases])
    mean, harmonic = jumps.mean(), 2.0 / 3.0 * abs(np.sum(jumps * np.exp(1j * phases)))
    assert mean == pytest.approx(-(1.0 - e), abs=1e-6)
    assert mean + harmonic == pytest.approx(0.0, abs=1e-6)


def test_criterion_is_the_exact_one_to_first_order_in_the_loss():
    """The relative difference falls like 1 - e, with the coefficient 1 at low frequency."""
    losses = np.array([1e-2, 1e-3])
    exact = melnikov.exact_critical_amplitude(0.01, 1.0 - losses)
    ratio = melnikov.critical_amplitude(0.01, 1.0 - losses, NoNoise()) / exact
    assert (1.0 - ratio) / losses == pytest.approx([1.0, 1.0], abs=0.01)


def test_everything_broadcasts():
    amplitude, omega = np.linspace(1.0, 5.0, 4)[:, None, None], np.array([[2.0], [3.0], [4.0]])
    noises = [NoNoise(), NOISE]
    flux = melnikov.phase_flux((amplitude, omega), 0.5, noises)
    assert flux.shape == (4, 3, 2)
    assert flux[2, 1, 1] == melnikov.phase_flux(Harmonic(amplitude[2, 0, 0], 3.0), 0.5, NOISE)
    assert melnikov.phase_flux_as_printed((amplitude, omega), 0.5, noises, 18).shape == (4, 3, 2)
    assert melnikov.critical_amplitude(omega, [0.3, 0.5], noises).shape == (3, 2)
    assert melnikov.exact_critical_amplitude(omega, [0.3, 0.5]).shape == (3, 2)
    assert melnikov.process_mean(FORCING, [[0.3], [0.5]], np.linspace(0.0, 1.0, 7)).shape == (2, 7)
    assert isinstance(melnikov.phase_flux(FORCING, 0.5, NOISE), float)
    assert isinstance(melnikov.critical_amplitude(4.0, 0.5, NOISE), float)


@pytest.mark.parametrize(
    ("call", "error", "message"),
    [
        (lambda: melnikov.phase_flux(FORCING, 1.2, NOISE), ValueError, r"restitution: got 1\.2, accepted: .* <= 1\.0"),
        (lambda: melnikov.phase_flux(FORCING, "0.5", NOISE), TypeError, r"restitution: got '0\.5', accepted: finite"),
        (lambda: melnikov.phase_flux(FORCING, [0.5, [0.3]], NOISE), TypeError, r"restitution: got \[0\.5, \[0\.3\]\]"),
        (lambda: melnikov.phase_flux(FORCING, 0.5, 0.16), TypeError, r"noise: got 0\.16, accepted: BandNoise or"),
        (
            lambda: melnikov.phase_flux(4.0, 2.7, NOISE),  # A and Ω apart
            TypeError,
            r"forcing: got 4\.0, accepted: a Harmonic, Harmonics, or a tuple \(amplitude, frequency\)",
        ),
        (lambda: melnikov.phase_flux([4.0, 2.7], 0.5, NOISE), TypeError, r"forcing: got \[4\.0, 2\.7\], .* a tuple"),
        (lambda: melnikov.margin(0.5, (4.0, 2.7), NOISE), TypeError, r"forcing: got 0\.5, accepted"),
        (
            lambda: melnikov.phase_flux_sampled((4.0,), 0.5, NOISE),
            TypeError,
            r"forcing: got \(4\.0,\), accepted: a Harmonic, or a tuple",
        ),
        (
            lambda: melnikov.phase_flux(([1, 2, 3], [1, 2]), 0.5, NOISE),
            ValueError,
            r"shapes of amplitude, frequency: got \[\(3,\), \(2,\)\], accepted: shapes that broadcast",
        ),
        (
            lambda: melnikov.phase_flux(([1, 2, 3], 2.7), [0.5, 0.4], NOISE),
            ValueError,
            r"shapes of forcing, restitution, noise: got \[\(3,\), \(2,\), \(\)\]",
        ),
        (
            lambda: melnikov.critical_amplitude([1.0, 2.0], [0.5, 0.4, 0.3], NOISE),
            ValueError,
            r"shapes of frequency, restitution, noise: got",
        ),
        (lambda: melnikov.critical_amplitude(0.5, 2.7, NOISE), ValueError, r"restitution: got 2\.7, .* <= 1\.0"),
        (
            lambda: melnikov.process_mean(FORCING, [0.5, 0.6], np.zeros(3)),
            ValueError,
            r"shapes of times, restitution: got \[\(3,\), \(2,\)\]",
        ),
        (lambda: melnikov.phase_flux((4.0, 0.0), 0.5, NOISE), ValueError, r"forcing frequency: got 0\.0, .* > 0\.0"),
        (lambda: melnikov.phase_flux((-1.0, 4.0), 0.5, NOISE), ValueError, r"forcing amplitude: got -1\.0, .* >= 0\.0"),
        (lambda: melnikov.critical_amplitude(4.0, 0.5, NOISE, "mean"), ValueError, r"criterion: got 'mean', .* 'peak'"),
        (lambda: melnikov.critical_amplitude(math.nan, 0.5, NOISE), ValueError, r"frequency: got nan, .* finite"),
        (lambda: melnikov.exact_critical_amplitude(True, 0.5), TypeError, r"frequency: got True, accepted: finite"),
        (lambda: melnikov.phase_flux_as_printed(FORCING, 0.5, NOISE, 19), ValueError, r"equation: got 19, .* 17 or 18"),
        (
            lambda: melnikov.phase_flux_as_printed(FORCING, 0.5, WhiteNoise(0.1)),
            ValueError,
            r"noise\.kind: got 'white', accepted: 'band', 'filtered' or 'none'",
        ),
        (lambda: melnikov.noise_variance(0.16), TypeError, r"noise: got 0\.16, accepted: BandNoise, "),
        (lambda: melnikov.equivalent_diffusion("white"), TypeError, r"noise: got 'white', accepted: BandNoise, "),
        (lambda: melnikov.realized_spread(NOISE, 5.0), ValueError, r"restitution: got 5\.0, accepted: .* <= 1\.0"),
        (lambda: melnikov.relative_variance(5), TypeError, r"noise: got 5, accepted: BandNoise, "),
        (lambda: melnikov.phase_flux_sampled(FORCING, 0.5, NOISE, repeats=1), ValueError, r"repeats: got 1, .* >= 2"),
        (lambda: melnikov.phase_flux_sampled(FORCING, 0.5, NOISE, strata=0), ValueError, r"strata: got 0, .* >= 1"),
        (lambda: melnikov.process_mean((4.0, 4.0), 0.5, 0.0), TypeError, r"forcing: got .* Harmonic or Harmonics$"),
        (
            lambda: melnikov.sampled_process(FORCING, 0.5, NOISE, 0.0, np.ones(99), np.ones(99)),
            ValueError,
            r"shape of frequencies and phases: got \(99,\), accepted: \(\.\.\., 100\)",
        ),
        (
            lambda: melnikov.sampled_process(FORCING, 0.5, WhiteNoise(0.1), 0.0, [1.0], [1.0]),
            TypeError,
            r"noise: got WhiteNoise.* accepted: BandNoise",
        ),
    ],
)
def test_bad_arguments_are_refused_by_name(call, error, message):
    with pytest.raises(error, match=message):
        call()


def test_no_number_is_taken_as_the_critical_angle_unless_it_is_named():
    """A restitution behind the noise would be one for a squat block, in silence."""
    taken = {name: inspect.signature(getattr(melnikov, name)).parameters["critical_angle"] for name in melnikov.__all__}
    assert [name for name, angle in taken.items() if angle.kind is not inspect.Parameter.KEYWORD_ONLY] == []
    with pytest.raises(TypeError, match="relative_variance"):
        melnikov.relative_variance(NOISE, 0.5)
