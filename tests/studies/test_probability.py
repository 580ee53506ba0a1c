"""`probability`: the wanted error, the way that is taken, and what is refused."""

import functools

import numpy as np
import pytest

from fpk_rocking import NoNoise, Start, load_scene, probability, solve_fpk
from fpk_rocking.studies.probability import (
    Outlook,
    Paths,
    Probability,
    SlowerError,
    WantedError,
    by_density,
    by_paths,
    by_splitting,
    joined,
    soonest,
    stop_if_slow,
)
from montecarlo import simulate, split
from montecarlo.engines.batches import checked_run

MAIN = load_scene("main")
WHITE = MAIN.white_equivalent()
RARE = MAIN.varied(noise={"variance": 0.03}).white_equivalent()
RARE_OVERTURNED = 5.72e-4, 1.2e-5  # after two cycles: 4e6 paths of seed 77, and their standard error
OVERTURNED = {1: 0.0, 4: 0.1332, 10: 0.5204}  # by so many cycles of the main scene: 4e5 paths of seed 77


def paths_of(scene, cycles, seed=1):
    return Paths(checked_run(scene, cycles, 1, seed, None, 200))


class Drawn(Paths):
    """Paths that overturn in the middle with a given probability, more often where steps are long; without cost."""

    def __init__(self, share, path_s=1e-5, shift=0.0, scene=MAIN, seed=1):
        super().__init__(checked_run(scene, 1, 1, seed, None, 200))
        self.share, self.path_s, self.shift = share, path_s, shift
        self.random = np.random.default_rng(seed)

    def sample(self, until):
        count = int(until) - self.paths
        side = np.where(self.random.random(count) < self.share, self.random.choice([-1, 1], count), 0)
        self.add(side, np.where(side != 0, 0.5 * self.run.times[-1], np.nan))

    def pilot(self):
        self.sample(2000)
        return self.path_s

    def coarser(self):
        return Drawn(self.share + self.shift, scene=self.run.scene, seed=2)


@pytest.mark.parametrize("cycles", [1, 4, 10])
def test_sampling_stops_at_the_wanted_error_and_covers(cycles):
    """Of 60 answers each, 95 % cover: fewer than 50 do with a probability of 2e-4."""
    answers = [probability(MAIN, cycles=cycles, tol=0.02, seed=seed) for seed in range(60)]
    assert all(answer.error <= 0.02 == answer.wanted and answer.verdict == "ok" for answer in answers)
    assert sum(abs(answer.overturned - OVERTURNED[cycles]) <= answer.error for answer in answers) >= 50


@pytest.mark.parametrize("share", [0.5, 0.04, 0.0])
def test_the_rule_by_which_paths_are_added_covers(share):
    """Of 300 answers each, 95 % cover: fewer than 273 do with a probability of 2e-3."""
    inside = 0
    for seed in range(300):
        paths = Drawn(share, seed=seed)
        found = soonest(paths, WantedError(0.02, 0.0), 600.0)
        assert found.errors[-1, 0] <= 0.02
        inside += abs(found.sides[-1].sum() - share) <= found.errors[-1, 0]
    assert inside >= 273


def test_relative_error():
    answer = probability(MAIN, cycles=2, rtol=0.2)
    assert 0.1 * answer.overturned < answer.error <= 0.2 * answer.overturned
    larger = probability(MAIN, cycles=2, rtol=0.2, tol=0.002)
    assert larger.error > 0.2 * larger.overturned
    assert larger.realizations < answer.realizations / 3


def test_a_probability_below_its_error_is_said_to_be():
    for cycles, small in ((2, True), (4, False)):
        answer = probability(MAIN, cycles=cycles, tol=0.01)
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


def outlook_of(paths, wanted, limit_s=600.0, path_s=1e-3):
    return Outlook(wanted, limit_s, path_s, paths.overturned, paths.paths)


def test_density_where_it_is_faster():
    """A million paths would take ten times as long."""
    density = solve_fpk(WHITE, cycles=10, tol=1e-3, bins_tol=np.inf)
    answer = probability(WHITE, cycles=10, tol=1e-3)
    assert answer.method == "density"
    np.testing.assert_array_equal(answer.left, density.overturned[:, 0])
    assert answer.error == density.error_estimate <= 1e-3
    assert answer.title.endswith(" (estimated), after 10 cycles; density")
    assert f"The error of P(overturned) is {answer.error:.2g} (estimated), within 0.001." in answer.trust.reasons


def test_density_that_the_paths_contradict_is_not_taken():
    wanted, long = WantedError(2e-3, 0.0), [1e3]
    paths, calmer = (paths_of(scene, 4) for scene in (WHITE, MAIN.varied(noise={"variance": 0.015}).white_equivalent()))
    for sample in (paths, calmer):
        sample.sample(4000)
    assert by_density(paths, outlook_of(paths, wanted), long).method == "density"
    calmer.run = paths.run
    assert by_density(calmer, outlook_of(calmer, wanted), long) is None


def test_density_slower_than_predicted_is_left_for_paths():
    """The first solution takes more than a microsecond, so that the second would take hours."""
    seen = []
    paths = Paths(checked_run(WHITE, 4, 1, 1, None, 200), lambda done, total: seen.append((done, total)))
    paths.sample(2000)
    assert by_density(paths, outlook_of(paths, WantedError(2e-3, 0.0)), [1e-6, 0.01, 0.0]) is None
    assert [done for done, total in seen if total == 12] == [1, 2, 3, 4]
    as_predicted = stop_if_slow([1e9, 1.0], 10.0, 4)
    as_predicted(4, 8)
    with pytest.raises(SlowerError):
        stop_if_slow([1e-9, 1.0], 10.0, 4)(4, 8)


def test_splitting_where_overturning_is_rare():
    paths = paths_of(RARE, 2)
    paths.sample(2000)
    found, _ = by_splitting(paths, outlook_of(paths, WantedError(0.0, 0.3)))
    expected, standard_error = RARE_OVERTURNED
    overturned, error = found.sides[-1].sum(), found.errors[-1, 0]
    assert found.method == "splitting"
    assert abs(overturned - expected) <= 1.5 * error + 3.0 * standard_error
    assert error <= 0.3 * overturned


def test_few_overturned_paths_are_added_to_before_anything_else():
    """Of 2,000 paths none may overturn at .001: the wanted error would be one that no density has."""
    wanted = WantedError(0.0, 0.2)
    for overturned in range(5):
        few = Outlook(wanted, 600.0, 1e-5, overturned, 2000)
        assert few.too_few
        assert 2500 <= few.next_stage(few.few_s) <= 32_000
    assert not Outlook(wanted, 600.0, 1e-5, 5, 2000).too_few
    # Nor where a second has been spent on them.
    assert not Outlook(wanted, 600.0, 1e-5, 4, 50_000).too_few
    paths = Drawn(0.0)
    with pytest.raises(ValueError, match=r"^rtol: got 0\.2"):
        soonest(paths, wanted, 100.0)
    assert 0.5 <= paths.paths * paths.path_s <= 10.0


def test_error_of_the_steps_is_added():
    found = by_paths_of(Drawn(0.3, shift=0.1, scene=MAIN.filtered_equivalent()))
    assert 0.05 < found.errors[-1, 0] < 0.13
    assert by_paths_of(Drawn(0.3, shift=0.1)).errors[-1, 0] < 0.02
    answer = probability(MAIN.filtered_equivalent(), cycles=4, tol=0.02)
    assert "Steps 4 times as long change the last probability by" in answer.reason


def by_paths_of(paths):
    soonest(paths, WantedError(0.02, 0.0), 600.0)
    return by_paths(paths)


def test_too_long_is_refused():
    with pytest.raises(ValueError, match=r"^tol: got 1e-05, .* limit_s \(got 2 s\)"):
        probability(MAIN, cycles=4, tol=1e-5, limit_s=2)
    with pytest.raises(ValueError, match=r"^rtol: got 0\.01, which takes at least .* \(0 of 2,000 paths"):
        probability(MAIN, cycles=1, rtol=0.01, limit_s=0.01)


@pytest.mark.parametrize(("share", "paths"), [(1e-6, (2000, 20_000)), (8e-4, (2001, 20_000)), (0.01, (30_000, 60_000))])
def test_whether_the_limit_is_enough_is_decided_within_a_tenth_of_it(share, paths):
    """An `rtol` of .1 takes 3.8e8, 4.8e5 and 3.8e4 paths of 1 ms: only the last fits 200 s."""
    drawn = Drawn(share, path_s=1e-3)
    answer = functools.partial(soonest, drawn, WantedError(0.0, 0.1), 200.0)
    if share == 0.01:
        answer()
    else:
        with pytest.raises(ValueError, match=r"^rtol: got 0\.1, which takes"):
            answer()
    least, most = paths
    assert least <= drawn.paths <= most


def test_splitting_that_takes_too_long_is_refused_after_its_first_walkers():
    repeats = []
    with pytest.raises(ValueError, match=r"^rtol: got 1e-05, which takes .* paths, about .* s, splitting about .* s "):
        probability(RARE, cycles=2, rtol=1e-5, limit_s=20.0, progress=lambda done, total: repeats.append((done, total)))
    assert repeats.count((2, 2)) == 1
    assert repeats.count((32, 32)) in {1, 2}  # the first hundred may be too few to tell


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
