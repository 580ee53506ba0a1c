"""Low bounces under white noise: their law, what it is taken for, and a block that rattles."""

import math

import numpy as np
import pytest
from scipy.special import erf

from fpk_rocking.base.threads import at_most, thread_count
from fpk_rocking.physics.motion.equation import KernelBlock
from fpk_rocking.physics.motion.events import next_event
from fpk_rocking.physics.motion.segment import Segment
from fpk_rocking.scene import Block, Harmonic, Scene, WhiteNoise
from montecarlo import histories, simulate
from montecarlo.engines import white
from montecarlo.engines.bounce import draw_bounce, first_return
from montecarlo.engines.random import open_stream, stream_keys
from montecarlo.tuning import TUNING

RATTLING = Scene(Block(0.85), Harmonic(0.8, 2.0), WhiteNoise(0.002))


def law(speed, growth, latest):
    """McKean's law in units of the diffusion and the pull: times, arrival speeds, and probabilities on their grid."""
    time = np.exp(np.linspace(math.log(1e-6), math.log(latest), 2500))[:, None]
    arrival = np.exp(np.linspace(math.log(1e-4), math.log(60.0), 700))
    pushed = (arrival + speed - time - growth * time**2 / 2.0) ** 2
    swung = 3.0 * (arrival - speed - growth * time**2 / 6.0) ** 2
    density = math.sqrt(3.0) * arrival / (2.0 * math.pi * time**2) * np.exp(-(pushed + swung) / (4.0 * time))
    density *= erf(np.sqrt(3.0 * speed * arrival / time))
    cells = np.gradient(np.log(time[:, 0]))[:, None] * time * np.gradient(np.log(arrival)) * arrival
    return time, arrival, density * cells


@pytest.mark.parametrize(
    ("speed", "growth", "latest"), [(0.1, 0.0, 200.0), (1.0, 0.1, 60.0), (4.0, 0.0, 300.0), (6.0, -0.004, 150.0)]
)
def test_returns_have_the_law_of_mckean(speed, growth, latest):
    """Means of six functions of time and speed, 60,000 draws; that the law adds up to one is its own check.

    Diffusion 0.003 and pull 0.4 give the units. False alarm 24 x 6e-5.
    """
    time, arrival, probability = law(speed, growth, latest)
    assert probability.sum() == pytest.approx(1.0, abs=1e-6)
    diffusion, pull = 0.003, 0.4
    units = diffusion / pull**2, diffusion / pull
    stream, lost = open_stream(stream_keys(5), 0), 0.75 if growth < 0.0 else 0.0
    flight = speed * units[1], pull, growth * pull / units[0], diffusion, math.sqrt((1.0 - lost) * speed)
    drawn = np.array([first_return(stream, *flight) for _ in range(60_000)]) / units
    for function in (
        lambda t, v: t + 0.0 * v,
        lambda t, v: v + 0.0 * t,
        lambda t, v: np.sqrt(t) * v,
        lambda t, v: v * v + 0.0 * t,
        lambda t, v: np.exp(-v / speed) + 0.0 * t,
        lambda t, v: np.exp(-t / speed - v / speed),
    ):
        values, mean = function(*drawn.T), (probability * function(time, arrival)).sum()
        assert abs(values.mean() - mean) < 4.0 * values.std() / math.sqrt(values.size)


def bounce_errors(share, angle, monkeypatch):
    """Relative errors of arrival speed and duration of bounces without noise that last about 2 share intervals."""
    monkeypatch.setattr(white, "TUNING", TUNING._replace(bounce_time=2.0))
    scene = Scene(Block(0.9, critical_angle=angle), Harmonic(0.9, 7.0), WhiteNoise(1e-20))
    parameters, block = white.parameters_of(scene, 200), KernelBlock(0.9, 1.5, angle or None)
    stream, begin, errors = open_stream(stream_keys(1), 1), 0.3 * parameters.grid.spacing, {}
    for j in range(parameters.low.size):
        for side in (-1, 1):
            pull = 1.0 - side * np.polynomial.polynomial.polyval(begin, parameters.force[j]) * math.cos(angle)
            speed = share * parameters.grid.spacing * pull
            after, overturned, end = draw_bounce(stream, speed, side, j, begin, math.inf, parameters, None, 0.0)
            if overturned != 0:
                segment = Segment(parameters.particular[j], parameters.force[j], -1.0, 1.0, 200.0)
                _, time, _, v = next_event(
                    0.0, side * speed, side, segment, begin, 10.0 * parameters.grid.spacing, block
                )
                errors[j, side] = after / (0.9 * abs(v)) - 1.0, (end - begin) / (time - begin) - 1.0
    return errors


@pytest.mark.parametrize("angle", [0.0, 0.3])
def test_bounces_under_a_changing_force_converge(angle, monkeypatch):
    """Against the exact flight, at most 1e-3 off: fourth order of the duration in speed and third in time."""
    errors_of_shares = [bounce_errors(share, angle, monkeypatch) for share in (0.5, 0.25, 0.125)]
    common = set(errors_of_shares[0]) & set(errors_of_shares[1]) & set(errors_of_shares[2])
    assert len(common) >= 16
    errors = np.array([[run[key] for key in sorted(common)] for run in errors_of_shares])
    assert np.abs(errors).max() < 1e-3
    speed, time = np.sqrt((errors**2).mean(axis=1)).T
    assert np.all(speed[:-1] > 10.0 * speed[1:])
    assert np.all(time[:-1] > 6.0 * time[1:])


def test_bounces_keep_the_energy_balance(monkeypatch):
    """The unforced block at a shortest step of 0.8 D, where steps alone are off by 0.118; 2,000 paths tell 0.002."""
    errors = []
    scene = Scene(Block(0.5), Harmonic(0.0, math.pi / 8.0), WhiteNoise(0.01))
    for brief in (TUNING.bounce_time, 0.0):
        monkeypatch.setattr(white, "TUNING", TUNING._replace(bounce_time=brief))
        run = histories(scene, cycles=1, realizations=2000, seed=1, steps_per_cycle=8, samples_per_cycle=1)
        late = run.impact_time > 1.0
        errors.append(0.375 * np.square(run.impact_velocity[late]).sum() / 2000 / 15.0 / 0.01 - 1.0)
    assert abs(errors[0]) < 0.02
    assert errors[1] > 0.1


def test_a_rattling_block_has_the_speeds_of_the_quasi_steady_layer():
    """Impact speeds have the law w exp(-w/s) / s^2, s = 4 D / (3 (1 - e^2) (1 - f^2)), for e near 1 (docs/theory).

    From time 4 to 8, about a maximum of the force at 6, 20 relaxation times after the start. 800 paths tell the mean
    to 1 %; what else is left of it is of first order in 1 - e.
    """
    restitution, diffusion, frequency = 0.95, 5e-5, 0.4
    scene = Scene(Block(restitution), Harmonic(0.5, frequency, math.pi - 6.0 * frequency), WhiteNoise(diffusion))
    run = histories(scene, cycles=1, realizations=800, seed=2, samples_per_cycle=4)
    chosen = (run.impact_time > 4.0) & (run.impact_time < 8.0)
    speed, time = np.abs(run.impact_velocity[chosen]), run.impact_time[chosen]
    scale = 4.0 * diffusion / (3.0 * (1.0 - restitution**2) * (1.0 - (0.5 * np.cos(frequency * (time - 6.0))) ** 2))
    assert (speed / scale).mean() == pytest.approx(2.0, rel=0.05)
    assert np.square(speed / scale).mean() == pytest.approx(6.0, rel=0.1)


def test_bounces_and_fine_steps_have_one_law(monkeypatch):
    """A block that rattles most of the time: six means over states, and the number of impacts; false alarm 4e-4."""
    runs = []
    for brief, steps in ((TUNING.bounce_time, 100), (0.0, 1000)):
        monkeypatch.setattr(white, "TUNING", TUNING._replace(bounce_time=brief))
        runs.append(
            histories(RATTLING, cycles=3, realizations=3000, seed=steps, steps_per_cycle=steps, samples_per_cycle=8)
        )
    x, v = ([getattr(run, name) for run in runs] for name in ("angle", "velocity"))
    small = [[np.minimum(values, 1e-4) for values in (np.abs(x[i]), np.square(v[i]))] for i in (0, 1)]
    for first, second in [*zip(*small, strict=True), x, v, np.abs(x), np.square(v)]:
        means = first.mean(axis=1), second.mean(axis=1)
        error = math.sqrt(sum(values.var() for values in means) / 3000)
        assert abs(means[0].mean() - means[1].mean()) < 4.0 * error
    counts = [np.bincount(run.impact_realization, minlength=3000) for run in runs]
    assert abs(counts[0].mean() - counts[1].mean()) < 4.0 * math.sqrt(sum(c.var() for c in counts) / 3000)


def test_rattling_paths_depend_on_seed_and_number_alone():
    threads, results = thread_count(), []
    for count, size in ((1, 150), (threads, 400)):
        with at_most(count):
            results.append(simulate(RATTLING, cycles=3, realizations=size, seed=11))
    assert results[0].angle.tobytes() == results[1].angle[:150].tobytes()
    assert results[0].velocity.tobytes() == results[1].velocity[:150].tobytes()


def test_impacts_are_listed_in_the_order_of_time_and_states_lie_between_them():
    """A bounce may outlast an interval, but no state that is kept: its side is that of the last impact."""
    run = histories(RATTLING, cycles=2, realizations=40, seed=6, samples_per_cycle=5)
    for r in range(40):
        chosen = run.impact_realization == r
        time, velocity = run.impact_time[chosen], run.impact_velocity[chosen]
        assert np.all(np.diff(time) > 0.0)
        assert np.all(velocity[1:] * velocity[:-1] < 0.0)
        last = np.searchsorted(time, run.time[1:]) - 1
        assert np.array_equal(np.sign(run.angle[r, 1:]), np.sign(velocity[last]))
