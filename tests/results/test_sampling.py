"""What the replacement of noise changes: measured by paths, in the total error, in the verdict, where it is printed."""

import dataclasses
import math

import fakes
import numpy as np
import pytest

from fpk_rocking import BandNoise, Block, Harmonic, Pulse, Scene, WhiteNoise
from fpk_rocking.output import tables
from fpk_rocking.results.remarks import remarks
from fpk_rocking.results.sampling import wilson_interval
from fpk_rocking.studies import tasks
from montecarlo import simulate

MAIN = Scene(Block(0.5), Harmonic(4.6, 2.7, math.pi), BandNoise(0.04, (0.0, 10.0), 100))


@dataclasses.dataclass(frozen=True)
class Counted(fakes.FakeEnsemble):
    """An ensemble of which exactly these stand after each cycle; the others lie to the right."""

    cycles: int = 2
    realizations: int = 40_000
    standing: tuple = (40_000, 36_000, 32_400)

    @property
    def survival(self):
        return np.array(self.standing) / self.realizations

    @property
    def overturned(self):
        return np.stack([np.zeros(self.cycles + 1), 1.0 - self.survival], axis=-1)


class Even(Counted):
    """An ensemble that overturns to both sides as the density does."""

    @property
    def overturned(self):
        return np.multiply.outer(1.0 - self.survival, [fakes.LEFT_SHARE, 1.0 - fakes.LEFT_SHARE])


def even(standing):
    """As many paths as usual, of which so many stand in the end."""
    return Even(MAIN, standing=(40_000, 36_000, standing))


def density(scene=MAIN, **given):
    """Survival 1, .9, .81; overturned to the left .6 of the rest."""
    return fakes.FakeEvolution(scene, cycles=2, **given)


def test_difference_sampling_error_and_total_of_known_counts():
    found = density(error_estimate=2e-4).checked(Counted(MAIN, standing=(40_000, 36_400, 0)))
    check = found.replacement
    expected = [[0.0, 0.0, 0.0], [0.01, -0.06, 0.05], [-0.81, -0.114, 0.924]]
    assert check.difference == pytest.approx(np.array(expected))
    half = 1.959964 * math.sqrt(0.91 * 0.09 / 40_000)
    assert check.sampling_error[1, 0] == pytest.approx(half, rel=2e-2)
    assert check.sampling_error[2, 0] == pytest.approx(1.959964**2 / 40_000, rel=1e-3)
    assert found.total_error == pytest.approx(2e-4 + np.abs(expected) + check.sampling_error)
    limits = wilson_interval([40_000, 36_400, 0], 40_000)
    assert (np.abs(limits.T - found.survival) < found.total_error[:, 0]).all()


def test_the_total_holds_the_truth_as_often_as_it_says():
    """A density off by .004, and 2,000 samples of 4,000; 95 % are promised, one-sided chance gives some 97.5 %.

    Fails falsely with probability 1e-6: at 95 %, 1,850 of 2,000 or fewer.
    """
    rng, truth = np.random.default_rng(5), 0.814
    own = density(error_estimate=0.0)
    held = 0
    for count in rng.binomial(4000, truth, 2000):
        found = own.checked(Counted(MAIN, realizations=4000, standing=(4000, 3600, int(count))))
        held += abs(truth - found.survival[2]) <= found.total_error[2, 0]
    assert held > 1850


@pytest.mark.parametrize(
    ("tol", "standing", "verdict"),
    [(1e-3, 32_400, "ok"), (1e-3, 32_800, "caution"), (0.05, 32_800, "ok"), (1e-3, 36_800, "do not use")],
)
def test_the_verdict_is_by_the_total_error(tol, standing, verdict):
    """Off by 0, .01 and .11, with a sampling error of .004, against .01 or a larger tolerance, and .1."""
    left = density(tol=tol)
    assert left.trust.verdict == "caution"
    assert left.trust.reasons[0].startswith("Replaced, not checked")
    found = left.checked(even(standing))
    assert found.trust.verdict == verdict
    assert found.trust.reasons[0].startswith(
        "The largest total error of all times, with the replacement of the noise, is "
    )


def test_a_failure_to_one_side_is_seen():
    """As many stand as by the density, and all that fell lie to the right."""
    assert density().checked(Counted(MAIN)).trust.verdict == "do not use"


def test_noise_that_was_solved_as_it_is_needs_no_check():
    white = dataclasses.replace(MAIN, noise=WhiteNoise(0.006))
    assert density(white).trust.verdict == "ok"
    assert (density(white).total_error == 1e-4).all()
    assert density().total_error is None


def test_what_may_explain_a_failure_stands_beside_it_alone():
    def told(found):
        starts = "The paths alone", "A possible cause", "Most of the total"
        return [text for text in remarks(found) if text.startswith(starts)]

    assert told(density()) == told(density().checked(even(32_400))) == []
    better, why = told(density().checked(even(33_600)))
    assert better == "The paths alone are better here: P(overturned) = 0.1600 ± 0.0036 at the end."
    assert "covers 100 %" in why
    assert "100 harmonics differ in strength by 24 %" in why
    assert "the forcing alone reaches 4.6" in why
    few = Even(MAIN, realizations=400, standing=(400, 360, 324))
    (why,) = told(density().checked(few))
    assert why == "Most of the total error is the sampling error of the check: more paths make it smaller."


def test_every_form_prints_value_numerics_replacement_and_total():
    found = density().checked(even(32_600))
    line = "P(overturned) = 0.1900 ± 0.0001 (numerics), replacement of the noise: -0.0050 ± 0.0038, total ± 0.0089"
    _, table, sentences = tables.result_table(found)
    assert line in found.title
    assert line in found._repr_html_()
    assert any(text.startswith(line) for text in sentences)
    assert (
        list(next(one for one in table.columns if one.header == "total ±").cells)[2] == f"{found.total_error[2, 0]:.5f}"
    )
    values = found.summary()
    assert values["total_error"] == pytest.approx(found.total_error.max())
    assert values["replacement"]["difference"][2][0] == pytest.approx(0.005)
    assert (values["replacement"]["method"], values["replacement"]["realizations"]) == ("rk4", 40_000)
    assert "replacement of the noise: not checked" in density().title
    band = found.plot("survival").axes[0].collections[0].get_paths()[0].vertices[:, 1]
    assert 0.81 + found.total_error[2, 0] == pytest.approx(band[np.isclose(band, 0.819, atol=2e-3)][0])


@pytest.mark.parametrize(
    ("paths", "error", "message"),
    [
        (density(), TypeError, r"paths: got 'FakeEvolution', accepted: an Ensemble or a Tally"),
        (fakes.FakeEnsemble(MAIN.white_equivalent()), ValueError, r"paths: got those of another scene"),
        (fakes.FakeEnsemble(MAIN, cycles=1), ValueError, r"paths: got other times"),
    ],
)
def test_other_paths_are_refused(paths, error, message):
    with pytest.raises(error, match=message):
        density().checked(paths)


def test_a_density_without_a_replacement_is_refused():
    white = MAIN.white_equivalent()
    with pytest.raises(ValueError, match=r"density: got one whose noise was solved as it is, accepted: one whose"):
        density(white).checked(fakes.FakeEnsemble(white))


def test_a_density_is_checked_by_paths_of_its_scene():
    """The paths are those of `simulate` with this number and seed; noise that is not replaced is not sampled."""
    density = fakes.FakeEvolution(MAIN, cycles=3, tol=1e-2)
    replaced = tasks.checked(density, realizations=500, seed=7)
    paths = simulate(MAIN, cycles=3, realizations=500, seed=7)
    assert replaced.tol == 1e-2
    assert replaced.replacement.difference[:, 0] == pytest.approx(paths.survival - replaced.survival)
    assert replaced.replacement.difference[:, 1:] == pytest.approx(paths.overturned - replaced.overturned)
    white = tasks.checked(fakes.FakeEvolution(MAIN.white_equivalent(), cycles=3))
    assert white.replacement is None
    for name, bad in (("realizations", 0), ("seed", -1)):
        with pytest.raises(ValueError, match=name):
            tasks.checked(density, **{name: bad})


def test_a_motion_that_does_not_repeat_is_checked_at_its_times():
    pulse = dataclasses.replace(MAIN, forcing=Pulse("one-sine", 4.0, 2.0))

    class Once(fakes.FakeEvolution):
        times = np.array([0.0, 1.0, 5.0])

    replaced = tasks.checked(Once(pulse, cycles=2), realizations=200)
    paths = simulate(pulse, times=[1.0, 5.0], realizations=200, seed=2)
    assert replaced.replacement.difference[:, 0] == pytest.approx(paths.survival - replaced.survival)


def test_a_probability_that_rounds_to_0_has_no_sign():
    class Standing(fakes.FakeEvolution):
        survival = np.array([1.0, 1.0, 1.0 + 4e-8])

    assert "P(overturned) = 0.0000 ± " in Standing(MAIN, cycles=2).title
