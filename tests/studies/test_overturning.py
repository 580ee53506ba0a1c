"""`probability`: the wanted error, the way that is taken, and what is refused."""

import numpy as np
import pytest

from fpk_rocking import NoNoise, Start, load_scene, probability, solve_fpk
from fpk_rocking.studies import overturning
from fpk_rocking.studies.overturning import Probability
from fpk_rocking.studies.probability import joined
from montecarlo import simulate, split
from montecarlo.engines.batches import Batch

MAIN = load_scene("main")
WHITE = MAIN.white_equivalent()
RARE = MAIN.varied(noise={"variance": 0.03}).white_equivalent()
RARE_OVERTURNED = 5.72e-4, 1.2e-5  # after two cycles: 4e6 paths of seed 77, and their standard error


def bernoulli_batches(share, shift=0.0, seed=1):
    """A stand-in for `simulate_batches`: paths overturn in the middle with a share, shifted where steps are long."""
    random = np.random.default_rng(seed)

    def batches(run, first=0, progress=None, followed=None):  # noqa: ARG001
        count, chance = run.realizations - first, share + shift * (run.steps_per_cycle < 200)
        side = np.where(random.random(count) < chance, random.choice([-1, 1], count), 0).astype(np.int8)
        when = np.where(side != 0, 0.5 * run.times[-1], np.nan)
        yield Batch(first, None, None, when, side, None, np.zeros(2, int))
        if progress is not None:
            progress(run.realizations, run.realizations)

    return batches


class Clock:
    """A stand-in for `time`: its seconds are those of the paths that were sampled."""

    def __init__(self, batches, path_s):
        self.batches, self.path_s, self.seconds = batches, path_s, 0.0

    def perf_counter(self):
        return self.seconds

    def simulate_batches(self, run, first=0, **options):
        self.seconds += self.path_s * (run.realizations - first)
        return self.batches(run, first, **options)


@pytest.mark.parametrize("share", [0.5, 0.04, 0.0])
def test_sampling_stops_at_the_wanted_error_and_covers(monkeypatch, share):
    """Of 300 answers each, 95 % cover: fewer than 273 do with a probability of 2e-3."""
    monkeypatch.setattr(overturning, "simulate_batches", bernoulli_batches(share))
    answers = [probability(MAIN, cycles=1, tol=0.02) for _ in range(300)]
    assert all(answer.error <= 0.02 == answer.wanted and answer.verdict == "ok" for answer in answers)
    assert sum(abs(answer.overturned - share) <= answer.error for answer in answers) >= 273


def test_relative_error(monkeypatch):
    monkeypatch.setattr(overturning, "simulate_batches", bernoulli_batches(0.003))
    answer = probability(MAIN, cycles=1, rtol=0.1)
    assert 0.05 * answer.overturned < answer.error <= 0.1 * answer.overturned
    larger = probability(MAIN, cycles=1, rtol=0.1, tol=0.002)
    assert larger.realizations < answer.realizations / 5


def test_a_probability_below_its_error_is_said_to_be(monkeypatch):
    for share, small in ((0.0005, True), (0.02, False)):
        monkeypatch.setattr(overturning, "simulate_batches", bernoulli_batches(share))
        answer = probability(MAIN, cycles=1, tol=0.01)
        assert (answer.error > answer.overturned) == small == any("`rtol`" in text for text in answer.remarks)


def test_paths_are_those_of_the_engine():
    answer = probability(MAIN, cycles=3, tol=0.01, seed=5)
    sample = simulate(MAIN, cycles=3, realizations=answer.realizations, seed=5)
    assert answer.method == "paths"
    np.testing.assert_allclose(answer.survival, sample.survival, atol=1e-12)
    np.testing.assert_array_equal(answer.left, sample.overturned[:, 0])
    limits = sample.survival_interval()
    half_widths = np.abs(limits - sample.survival[:, None]).max(axis=1)
    np.testing.assert_allclose(answer.errors[1:, 0], half_widths[1:], atol=1e-12)
    assert answer.left[-1] != answer.right[-1]


def test_no_noise_is_one_path():
    calm, strong = MAIN.varied(noise=NoNoise()), MAIN.varied(noise=NoNoise(), forcing={"amplitude": 20.0})
    answers = [probability(scene, cycles=10) for scene in (calm, strong)]
    assert [(answer.overturned, answer.error, answer.method) for answer in answers] == [
        (0.0, 0.0, "one path"),
        (1.0, 0.0, "one path"),
    ]
    assert "P(overturned) = 1 (one path)" in answers[1].title


def test_density_where_it_is_faster(monkeypatch):
    monkeypatch.setattr(overturning, "_SHORT_S", 0.0)
    monkeypatch.setattr("fpk_rocking.density.solver.predicted_seconds", lambda *_, **__: [1e-3, 0.0, 0.0])
    answer = probability(WHITE, cycles=4, tol=2e-3)
    density = solve_fpk(WHITE, cycles=4, tol=2e-3, bins_tol=np.inf)
    assert answer.method == "density"
    np.testing.assert_array_equal(answer.left, density.overturned[:, 0])
    assert answer.error == density.error_estimate <= 2e-3
    assert "density" in answer.title


def test_density_that_the_paths_contradict_is_not_taken(monkeypatch):
    monkeypatch.setattr(overturning, "_SHORT_S", 0.0)
    monkeypatch.setattr("fpk_rocking.density.solver.predicted_seconds", lambda *_, **__: [1e-3, 0.0, 0.0])
    calmer = MAIN.varied(noise={"variance": 0.015}).white_equivalent()
    wrong = solve_fpk(calmer, cycles=4, tol=2e-3, bins_tol=np.inf)
    monkeypatch.setattr("fpk_rocking.density.solver.solve_fpk", lambda *_, **__: wrong)
    assert probability(WHITE, cycles=4, tol=2e-3).method == "paths"


def test_density_slower_than_predicted_is_left_for_paths(monkeypatch):
    """The first solution takes more than a microsecond, so that the second would take hours."""
    monkeypatch.setattr(overturning, "_SHORT_S", 0.0)
    predicted, seen = [1e-6, 0.01, 0.0], []
    monkeypatch.setattr("fpk_rocking.density.solver.predicted_seconds", lambda *_, **__: predicted)
    answer = probability(WHITE, cycles=4, tol=2e-3, progress=lambda done, total: seen.append((done, total)))
    assert answer.method == "paths"
    assert [done for done, total in seen if total == 12] == [1, 2, 3, 4]


def test_splitting_where_overturning_is_rare(monkeypatch):
    monkeypatch.setattr(overturning, "_SPLITTING_S", 0.0)
    monkeypatch.setattr(overturning, "_SHORT_S", np.inf)
    answer = probability(RARE, cycles=2, rtol=0.3)
    expected, standard_error = RARE_OVERTURNED
    assert answer.method == "splitting"
    assert abs(answer.overturned - expected) <= 1.5 * answer.error + 3.0 * standard_error
    assert answer.error <= 0.3 * answer.overturned


def test_what_few_paths_have_seen_decides_on_no_other_way(monkeypatch):
    """Of 2,000 paths none may overturn at .001: the wanted error would be one that no density has."""
    clock, looks = Clock(bernoulli_batches(1e-3), 1e-5), []

    def look(call, _):
        looks.append((call.counts.overturned, call.counts.paths))
        return False

    monkeypatch.setattr(overturning, "simulate_batches", clock.simulate_batches)
    monkeypatch.setattr(overturning, "time", clock)
    monkeypatch.setattr(overturning._Call, "_density_pays", look)
    monkeypatch.setattr(overturning._Call, "_splitting_pays", look)
    for seed in range(3):
        probability(MAIN, cycles=1, rtol=0.2, seed=seed)
    assert len(looks) >= 3
    assert all(overturned >= 5 for overturned, _ in looks)
    looks.clear()
    clock.batches = bernoulli_batches(0.0)
    with pytest.raises(ValueError, match=r"^rtol: got 0\.2"):
        probability(MAIN, cycles=1, rtol=0.2, limit_s=100.0)
    assert looks[0][1] * 1e-5 >= 0.5


def test_error_of_the_steps_is_added(monkeypatch):
    monkeypatch.setattr(overturning, "simulate_batches", bernoulli_batches(0.3, shift=0.1))
    answer = probability(MAIN.filtered_equivalent(), cycles=1, tol=0.02)
    assert 0.05 < answer.error < 0.13
    assert answer.verdict == "caution"


def test_too_long_is_refused():
    with pytest.raises(ValueError, match=r"^tol: got 1e-05, .* limit_s \(got 2 s\)"):
        probability(MAIN, cycles=4, tol=1e-5, limit_s=2)
    with pytest.raises(ValueError, match=r"^rtol: got 0\.01, which takes at least .* \(0 of 2,000 paths"):
        probability(MAIN, cycles=1, rtol=0.01, limit_s=0.01)


@pytest.mark.parametrize(("share", "paths"), [(1e-6, (2000, 20_000)), (8e-4, (2001, 20_000)), (0.01, (30_000, 60_000))])
def test_whether_the_limit_is_enough_is_decided_within_a_tenth_of_it(monkeypatch, share, paths):
    """An `rtol` of .1 takes 3.8e8, 4.8e5 and 3.8e4 paths of 1 ms: only the last fits 200 s."""
    clock = Clock(bernoulli_batches(share), 1e-3)
    monkeypatch.setattr(overturning, "simulate_batches", clock.simulate_batches)
    monkeypatch.setattr(overturning, "time", clock)
    try:
        sampled = probability(MAIN, cycles=1, rtol=0.1, limit_s=200.0).realizations
    except ValueError as error:
        sampled = int(str(error).split(" of ")[1].split()[0].replace(",", ""))
    least, most = paths
    assert least <= sampled <= most
    assert clock.seconds == pytest.approx(1e-3 * sampled)


def test_splitting_that_takes_too_long_is_refused_after_its_first_walkers(monkeypatch):
    walkers = []

    def counted(scene, **options):
        walkers.append(options["walkers"])
        return split(scene, **options)

    monkeypatch.setattr(overturning, "split", counted)
    with pytest.raises(ValueError, match=r"^rtol: got 1e-05, which takes .* paths, about .* s, splitting about .* s "):
        probability(RARE, cycles=2, rtol=1e-5, limit_s=20.0)
    assert walkers in ([10, 100], [10, 100, 300])  # the first hundred may be too few to tell


def test_repeats_of_splitting_are_averaged_by_their_walkers():
    first, second = (split(RARE, cycles=2, walkers=n, repeats=3, seed=n) for n in (20, 60))
    both = joined(joined(None, first), second)
    assert both.walkers == 80
    expected = 0.25 * first.repeat_overturned + 0.75 * second.repeat_overturned
    np.testing.assert_allclose(both.repeat_overturned, expected, rtol=1e-14)


def test_a_point_has_no_error_at_time_0():
    wide = MAIN.varied(start=Start(covariance=((0.3, 0.0), (0.0, 0.3))))
    point, gaussian = (probability(scene, cycles=1, tol=0.02) for scene in (MAIN, wide))
    assert np.all(point.errors[0] == 0.0)
    assert np.all(point.errors[1] > 0.0)
    assert gaussian.survival[0] < 1.0
    assert np.all(gaussian.errors > 0.0)


@pytest.mark.parametrize(
    ("name", "value", "error"),
    [("tol", 0.0, ValueError), ("rtol", -1.0, ValueError), ("tol", "x", TypeError), ("limit_s", 0.0, ValueError)],
)
def test_wrong_parameters_are_refused(name, value, error):
    with pytest.raises(error, match=f"^{name}: got"):
        probability(MAIN, cycles=1, **{name: value})


def test_interruption_hands_back_the_paths_so_far():
    def stop(done, _):
        if done > 3000:
            raise KeyboardInterrupt

    answer = probability(MAIN, cycles=2, tol=1e-3, progress=stop)
    assert answer.interrupted
    assert answer.realizations >= 2000
    assert answer.verdict == "caution"
    assert "interrupted" in answer.trust.reasons[0]


def test_answer_is_saved_and_written(tmp_path):
    answer = probability(MAIN, cycles=3, tol=0.02)
    answer.save(tmp_path / "answer.npz")
    loaded = Probability.load(tmp_path / "answer.npz")
    assert loaded.summary() == answer.summary()
    answer.to_csv(tmp_path / "answer.csv")
    lines = (tmp_path / "answer.csv").read_text().splitlines()
    assert lines[0] == "cycle,time,survival,left,right,survival_error,left_error,right_error"
    assert float(lines[-1].split(",")[3]) == answer.left[-1]
    (axes,) = answer.plot().axes
    np.testing.assert_allclose(axes.lines[0].get_ydata(), answer.left + answer.right)
