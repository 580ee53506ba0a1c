"""The sine sweep: against mpmath, an independent integrator, and white-noise paths."""

import math

import mpmath
import numpy as np
import pytest
from transient_paths import ForcedBlock

from fpk_rocking import Block, NoNoise, Scene, Start, WhiteNoise, solve_fpk
from fpk_rocking.forcings import Chirp
from montecarlo import simulate

SWEEPS = [
    Chirp(2.0, 1.5, 6.0, 7.0),
    Chirp(1.3, 5.0, 0.3, 4.0),
    Chirp(1.0, 3.0, 3.0, 5.0),
    Chirp(3.0, 0.1, 20.0, 0.5),
    Chirp(2.0, 0.1, 0.4, 0.3),
]


def phase_of(sweep, time):
    start, end, duration = map(mpmath.mpf, (sweep.start_frequency, sweep.end_frequency, sweep.duration))
    return start * time + (end - start) * time**2 / (2 * duration)


@pytest.mark.parametrize("sweep", SWEEPS, ids=str)
def test_its_series_are_those_of_mpmath_and_long_enough(sweep):
    with mpmath.workdps(40):
        for time in sweep.duration * np.array([0.0, 0.37, 0.95]):
            wanted = mpmath.taylor(lambda t: sweep.amplitude * mpmath.sin(phase_of(sweep, t)), mpmath.mpf(time), 15)
            series = sweep.series(np.array([time]))[0]
            scale = [(2.0 * math.pi / sweep.shortest_period) ** k / math.factorial(k) for k in range(16)]
            assert series / scale == pytest.approx(np.array(wanted, dtype=float) / scale, abs=1e-11)
            late = 0.8 * sweep.shortest_period / (2.0 * math.pi)
            exact = float(sweep.amplitude * mpmath.sin(phase_of(sweep, mpmath.mpf(time) + late)))
            assert series @ late ** np.arange(16) == pytest.approx(exact, abs=2e-13 * sweep.amplitude)
    assert sweep.value(sweep.duration) == sweep.value(sweep.duration + 1.0) == 0.0


def test_a_sweep_of_one_frequency_is_a_sine_and_one_backwards_is_its_mirror():
    times = np.linspace(0.0, 4.9, 50)
    assert SWEEPS[2].values(times) == pytest.approx(np.sin(3.0 * times), abs=1e-14)
    up, down = Chirp(1.0, 1.0, 4.0, 2.0 * math.pi), Chirp(1.0, 4.0, 1.0, 2.0 * math.pi)
    mirrored = [math.sin(5.0 * math.pi - float(phase_of(down, up.duration - time))) for time in times]
    assert up.values(times) == pytest.approx(mirrored, abs=1e-13)


@pytest.mark.parametrize("number", range(6))
def test_a_flight_is_that_of_an_independent_integrator(number):
    rng = np.random.default_rng([41, number])
    sweep = Chirp(rng.uniform(1.2, 4.0), *rng.uniform(0.5, 6.0, 2), rng.uniform(3.0, 8.0))
    scene = Scene(Block(rng.uniform(0.5, 0.95)), sweep, NoNoise(), Start(*rng.uniform([-0.4, -0.5], [0.4, 0.5])))
    times = sweep.duration * np.array([0.3, 0.6, 1.0, 1.2])
    path = ForcedBlock(
        lambda t: sweep.amplitude * math.sin(float(phase_of(sweep, t))), [sweep.duration], scene.block.restitution,
        scene.overturning.angle, scene.start.angle, scene.start.velocity,
    )  # fmt: skip
    ensemble = simulate(scene, times=times, realizations=1)
    for row, time in enumerate(times, 1):
        path.advance(time)
        wanted = (math.nan, math.nan) if path.overturned else (path.x, path.v)
        got = ensemble.angle[0, row], ensemble.velocity[0, row]
        assert got == pytest.approx(wanted, abs=1e-9, nan_ok=True)


def test_the_density_under_a_sweep_agrees_with_paths():
    # False alarms: 1e-3.
    scene, size = Scene(Block(0.8), Chirp(2.6, 1.5, 4.0, 3.0), WhiteNoise(0.02)), 20_000
    density = solve_fpk(scene, times=[3.0, 6.0], tol=1e-2)
    paths = simulate(scene, times=[3.0, 6.0], realizations=size, seed=5)
    error = 3.5 * np.sqrt(paths.survival * (1.0 - paths.survival) / size) + 1.0 / size
    assert 0.05 < density.survival[-1] < 0.95
    assert (np.abs(density.survival - paths.survival) <= density.error_estimate + error).all()


@pytest.mark.parametrize(
    ("values", "says"),
    [
        ((-1.0, 1.0, 2.0, 3.0), "forcing.amplitude: got -1.0"),
        ((1.0, 0.0, 2.0, 3.0), "forcing.start_frequency: got 0.0, accepted: a finite number > 0"),
        ((1.0, 1.0, math.inf, 3.0), "forcing.end_frequency: got inf"),
        ((1.0, 1.0, 2.0, 0.0), "forcing.duration: got 0.0"),
        ((1.0, 10.0, 10.0, 1e4), r"forcing.duration: got 10000.0, accepted: at most 6283.19, 10,000 cycles"),
    ],
)
def test_bad_values_are_refused_by_name(values, says):
    with pytest.raises(ValueError, match=says):
        Chirp(*values)
