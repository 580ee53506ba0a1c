"""Steps next to x = 0 and the cut-off, by the functions themselves and without noise; low bounces against their law."""

import math

import numpy as np
import pytest
from scipy.special import erf
from tuned_histories import white_histories

from fpk_rocking.base.jit import at_most, thread_count
from fpk_rocking.physics.motion import TERMS
from fpk_rocking.physics.motion.equation import KernelBlock, Segment
from fpk_rocking.physics.motion.events import next_event
from fpk_rocking.scene import Block, Harmonic, Scene, WhiteNoise
from montecarlo import histories, simulate
from montecarlo.engines import barriers, white
from montecarlo.engines.barriers import draw_bounce, first_return
from montecarlo.engines.random import open_stream, stream_keys

BLOCK = KernelBlock(0.6, 1.5)
SCENE = Scene(Block(0.6), Harmonic(1.0, 2.0), WhiteNoise(0.01))
PARAMETERS = white.parameters_of(SCENE, 200)._replace(
    block=BLOCK, shortest=1e-6, diffusion=np.zeros(1), reach=np.array([1e-4])
)


def constant(force):
    """The segment of a constant force."""
    coefficients = np.zeros(TERMS)
    coefficients[0] = force
    return Segment(-coefficients, coefficients, force, force, 0.0)


def test_a_step_is_as_long_as_a_gap_surely_stays_open():
    """All nine tenths of the reach are kept all along the step; it is the limit, or the whole reach is not."""
    rng, lengths = np.random.default_rng(3), []
    for _ in range(300):
        gap, slope, reach = rng.uniform(0.0, 0.2), rng.normal(), rng.uniform(0.01, 0.3)
        bend = -rng.uniform(0.0, 3.0)
        h = barriers.safe_step(gap, slope, bend, reach, 0.5, 1e-9)
        times = np.linspace(0.0, h, 50)

        def left(t, part, gap=gap, slope=slope, bend=bend, reach=reach):
            return gap + t * (slope + 0.5 * bend * t - part * reach * np.sqrt(t))

        assert left(times, 0.9).min() > -1e-12
        assert h == 0.5 or left(h, 1.0) < 1e-12
        lengths.append(h)
    assert 0.1 < np.mean(np.array(lengths) == 0.5) < 0.9


def test_a_step_without_noise_ends_where_the_gap_closes():
    for gap, slope, bend in np.random.default_rng(4).uniform((0.0, -2.0, -3.0), (0.2, 2.0, 0.0), (300, 3)):
        closes = max(np.roots([0.5 * bend, slope, gap]).real)
        assert barriers.safe_step(gap, slope, bend, 0.0, 0.5, 1e-9) == pytest.approx(min(closes, 0.5), rel=1e-9)


def near(u, w, side, force):
    """A step from 0.2 up to 1.2 without noise, under a constant force."""
    stream = open_stream(stream_keys(1), 0)
    return barriers.step_near_barrier(stream, u, w, side, constant(force), 0, 0.2, 1.2, PARAMETERS, None, 0.0)


@pytest.mark.parametrize("side", [1, -1])
def test_a_step_ends_before_a_bound_of_the_acceleration_brings_a_block_to_a_barrier(side):
    """From rest: -u'' is at most 1 - s f, and u'' at most cutoff - 1 + s f; no step is shortened without a need."""
    for u, folded, bound in ((0.2, -3.0, 4.0), (1.3, 3.0, 3.5)):
        gap = min(u, BLOCK.cutoff - u)
        *_, end = near(u, 0.0, side, side * folded)
        assert end - 0.2 == pytest.approx(math.sqrt(2.0 * gap / bound), rel=1e-3)
    assert near(1.0, 0.0, side, 0.0)[-1] == 1.2
    # Towards a barrier at a speed against which noise is nothing a flight goes there at once.
    assert near(0.01, -1.0, side, 0.0)[::2] == (0.0, -side)
    assert near(1.49, 1.0, side, 0.0)[0] == BLOCK.cutoff


def reflected(u, w, side, lift, *times):
    """What follows a state drawn beyond x = 0, where the block is accelerated by `lift`."""
    segment = constant(side * (lift + 1.0 - u))
    return barriers.reflect_draw(u, w, side, segment, *times, PARAMETERS, None, 0.0)


def test_an_impact_lies_on_the_parabola_through_the_draw():
    for late in (0.01, 0.05, -0.02):  # a draw may end before its impact, if the step was to end with it
        u, w = -late * (0.8 + 0.75 * late), -(0.8 + 1.5 * late)
        assert reflected(u, w, 1, -1.5, 0.1, 0.3, 0.33) == pytest.approx((0.0, 0.6 * 0.8, -1, 0.3 - late))


@pytest.mark.parametrize(("w", "lift"), [(0.2, 100.0), (0.0, 100.0), (-0.05, -1.0), (-0.1, 0.0)])
def test_a_draw_beyond_an_impact_that_no_parabola_has_is_scaled(w, lift):
    """It rises, its impact would be before the step, or there is none."""
    assert reflected(-0.01, w, -1, lift, 0.25, 0.3, 0.3) == pytest.approx((0.006, -0.6 * w, 1, 0.3))


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


def bounce_errors(share, angle):
    """Relative errors of arrival speed and duration of bounces without noise that last about 2 share intervals."""
    scene = Scene(Block(0.9, critical_angle=angle), Harmonic(0.9, 7.0), WhiteNoise(1e-20))
    parameters, block = white.parameters_of(scene, 200), KernelBlock(0.9, 1.5, angle or None)
    parameters = parameters._replace(brief=2.0 * parameters.grid.spacing)
    stream, begin, errors = open_stream(stream_keys(1), 1), 0.3 * parameters.grid.spacing, {}
    for j in range(parameters.grid.count):
        for side in (-1, 1):
            pull = 1.0 - side * np.polynomial.polynomial.polyval(begin, parameters.forcing.force[j]) * math.cos(angle)
            speed = share * parameters.grid.spacing * pull
            after, overturned, end = draw_bounce(stream, speed, side, j, begin, math.inf, parameters, None, 0.0)
            if overturned != 0:
                segment = Segment(parameters.forcing.particular[j], parameters.forcing.force[j], -1.0, 1.0, 200.0)
                _, time, _, v = next_event(
                    0.0, side * speed, side, segment, begin, 10.0 * parameters.grid.spacing, block
                )
                errors[j, side] = after / (0.9 * abs(v)) - 1.0, (end - begin) / (time - begin) - 1.0
    return errors


@pytest.mark.parametrize("angle", [0.0, pytest.param(0.3, marks=pytest.mark.slow)])
def test_bounces_under_a_changing_force_converge(angle):
    """Against the exact flight, at most 1e-3 off: fourth order of the duration in speed and third in time."""
    errors_of_shares = [bounce_errors(share, angle) for share in (0.5, 0.25, 0.125)]
    common = set(errors_of_shares[0]) & set(errors_of_shares[1]) & set(errors_of_shares[2])
    assert len(common) >= 16
    errors = np.array([[run[key] for key in sorted(common)] for run in errors_of_shares])
    assert np.abs(errors).max() < 1e-3
    speed, time = np.sqrt((errors**2).mean(axis=1)).T
    assert np.all(speed[:-1] > 10.0 * speed[1:])
    assert np.all(time[:-1] > 6.0 * time[1:])


def test_bounces_keep_the_energy_balance():
    """The unforced block at a shortest step of 0.8 D, where steps alone are off by 0.118; 2,000 paths tell 0.002."""
    errors = []
    scene = Scene(Block(0.5), Harmonic(0.0, math.pi / 8.0), WhiteNoise(0.01))
    for changes in ({}, {"brief": 0.0}):
        run = white_histories(scene, realizations=2000, seed=1, steps_per_cycle=8, **changes)
        late = run.impact_time > 1.0
        errors.append(0.375 * np.square(run.impact_velocity[late]).sum() / 2000 / 15.0 / 0.01 - 1.0)
    assert abs(errors[0]) < 0.02
    assert errors[1] > 0.1


@pytest.mark.slow
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


def test_bounces_and_fine_steps_have_one_law():
    """A block that rattles most of the time: six means over states, and the number of impacts; false alarm 4e-4."""
    runs = []
    for steps, changes in ((100, {}), (1000, {"brief": 0.0})):
        size = {"cycles": 3, "realizations": 3000, "samples_per_cycle": 8}
        runs.append(white_histories(RATTLING, **size, seed=steps, steps_per_cycle=steps, **changes))
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
