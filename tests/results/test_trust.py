"""Every rule of the verdict and of the remarks, with a result just inside and just outside; limits in figures."""

import dataclasses
import math

import fakes
import numpy as np
import pytest
from made_results import MAIN, WHITE

from fpk_rocking import Block, Dimensions
from fpk_rocking.compare import compare
from fpk_rocking.results import trust
from fpk_rocking.results.remarks import remarks, scene_diagnostics
from fpk_rocking.results.replacement import Replacement
from fpk_rocking.risk.curves import Fragility
from fpk_rocking.risk.lognormal import LognormalFit
from montecarlo import Splitting

LIMITS = {
    "total_error": (0.01, 0.1),
    "error_estimate": (0.002, 0.1),
    "half_width": (0.002, 0.1),
    "overturning_error": (0.4, math.inf),
    "escape_error": (0.002 * math.e, 0.1 * math.e),
    "relative_error": (0.2, 0.5),
    "rate_error": (0.2, 0.5),
    "bins_error_estimate": (0.03, math.inf),
    "truncated": (0.002, 0.1),
    "mass_defect": (1e-9, 0.002),
    "negative_mass": (0.01, 0.1),
    "moving_negative_mass": (0.01, 0.1),
    "rest_error_estimate": (math.inf, math.inf),
    "residual": (1e-6, 0.002),
}
"""Of each figure for a tolerance of .002: above the first there is caution, above the second no use."""

COARSE = {"total_error": (0.3, 0.3), "truncated": (0.3, 0.3), "negative_mass": (0.01, 0.3), "mass_defect": (1e-9, 0.3)}
"""Likewise for a tolerance of .3, larger than what is of no use otherwise."""


def test_the_limits_are_these():
    found = trust._limits(0.002, 0.03)
    assert {name: pair for name, (_, *pair) in found.items()} == {name: [*pair] for name, pair in LIMITS.items()}
    coarse = trust._limits(0.3, math.inf)
    assert {name: tuple(coarse[name][1:]) for name in COARSE} == COARSE
    assert trust._limits(0.002, math.inf, {"moving_negative_mass": 0.0})["negative_mass"][1:] == (math.inf, math.inf)
    assert trust.UNASKED == 0.05


@pytest.mark.parametrize(
    ("block", "said", "friction"),
    [
        (Block(0.5, Dimensions(0.5, 1.8), slender=True), True, "0.278"),
        (Block(0.5, Dimensions(0.5, 1.8)), False, "0.278"),
        (Block(0.5, critical_angle=0.2), False, "0.203"),
        (Block(0.5, slender=True), False, ""),
        (Block(0.5), False, ""),
    ],
)
def test_a_block_with_dimensions_that_is_taken_as_slender_is_remarked_on(block, said, friction):
    """And with which friction it slides first, where that is known."""
    result = fakes.FakeEvolution(dataclasses.replace(MAIN.varied(noise=WHITE.noise), block=block))
    assert [one.name for one in result.model_diagnostics()] == ["slender"] * said
    assert [one.name for one in scene_diagnostics(result.scene, "")] == ["slender"] * said
    assert result.trust.verdict == ("caution" if said else "ok")
    sliding = (
        f"A block with a friction coefficient below {friction} slides before it rocks; rocking needs a higher one "
        "(contact_forces)."
    )
    first, rest = remarks(result)[: bool(friction)], remarks(result)[bool(friction) :]
    assert first == (sliding,) * bool(friction)
    assert [text.startswith("Slender block: 0.5 m by 1.8 m") for text in rest] == [True] * said
    assert all("up to 1.2 %, that of the shaking by up to 3.8 %:" in text for text in rest)


def replaced(difference, error=0.0, place=(2, 0), **given):
    """A density whose replacement of noise was found to make this difference at one place, with no other error."""
    arrays = np.zeros((2, 3, 3))
    arrays[:, *place] = difference, error
    check = Replacement(*arrays, "exact", 1000, 2, 0.1)
    return fakes.FakeEvolution(MAIN, cycles=2, error_estimate=0.0, replacement=check, **given)


@pytest.mark.parametrize("tol", [1e-3, 0.02])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_replacement_is_explained_where_its_error_is_above_a_hundredth_or_the_tolerance(tol, sign):
    limit = max(0.01, tol)
    for error, said in ((limit, False), (math.nextafter(limit, 1.0), True)):
        found = replaced(sign * error, tol=tol)
        assert found.trust.verdict == ("caution" if said else "ok")
        assert [text.split()[1] for text in remarks(found)[2:]] == ["paths", "possible"] * said


@pytest.mark.parametrize("place", [(2, 0), (1, 2)])
def test_more_paths_help_where_most_of_the_error_is_that_of_the_paths(place):
    """Judged where the total error is largest."""
    for error, first in ((0.02, "The paths"), (math.nextafter(0.02, 1.0), "Most of")):
        assert remarks(replaced(-0.02, error, place))[2].startswith(first)


def splitting(alive, repeats):
    """As many repeats as given, so many of which saw the same probability and the others none."""
    estimates = np.zeros((repeats, 2, 2))
    estimates[:alive, 1, 0] = 2.0**-20
    return Splitting(WHITE, 100, 1, 200, 0.5, estimates, np.full(repeats, 7), np.full(repeats, 70))


@pytest.mark.parametrize(
    ("alive", "repeats", "verdict"),
    [(20, 20, "ok"), (19, 19, "caution"), (50, 100, "ok"), (49, 100, "do not use")],
)
def test_splitting_takes_20_repeats_of_which_half_are_effective(alive, repeats, verdict):
    found = splitting(alive, repeats)
    assert found.trust.verdict == verdict
    assert found.skewed == (verdict == "do not use")


class Standing(fakes.FakeEvolution):
    """A density of survival .5 after one cycle, and some less after two."""

    less = 0.0

    @property
    def survival(self):
        return np.array([1.0, 0.5, 0.5 - self.less])

    @property
    def overturned(self):
        return np.stack([1.0 - self.survival, 0.0 * self.survival], axis=1)


@pytest.mark.parametrize(
    ("apart", "verdict"),
    [
        (2.0**-9, "ok"),
        (2.0**-9 + 2.0**-40, "caution"),
        (2.0**-9 + 0.1 - 1e-9, "caution"),
        (2.0**-9 + 0.1 + 1e-9, "do not use"),
    ],
)
def test_densities_may_differ_by_the_sum_of_their_errors(apart, verdict):
    class Less(Standing):
        less = apart

    given = {"cycles": 2, "error_estimate": 2.0**-10}
    for pair in ((Standing, Less), (Less, Standing)):
        found = compare(*(kind(WHITE, **given) for kind in pair), joint_cycles=[1]).trust
        assert found.verdict == verdict


@pytest.mark.parametrize(
    ("standing", "verdict"), [(19_601, "ok"), (19_599, "caution"), (20_399, "ok"), (20_401, "caution")]
)
def test_a_sample_may_differ_by_four_standard_errors(standing, verdict):
    """Of .5 by 40,000 paths one is .0025, which are 100 paths."""

    class Counted(fakes.FakeEnsemble):
        survival = np.array([1.0, 0.5, standing / 40_000])
        overturned = np.stack([1.0 - survival, 0.0 * survival], axis=1)

    sample = Counted(WHITE, cycles=2, realizations=40_000, method="white")
    density = Standing(WHITE, cycles=2, error_estimate=0.0)
    assert compare(sample, density, joint_cycles=[]).trust.verdict == verdict


NOTHING = math.nan, math.nan


def fit(misfit=0.0, p_value=math.nan, deviance=1.0):
    return LognormalFit(1.0, 0.4, NOTHING, NOTHING, misfit, deviance, p_value, 0.95, "")


def diagnostics(fits=(), reasons=(), probability=(0.5,)):
    """Diagnostics of fragility curves of 100 realizations, with the given fits."""
    shape = 1, 1, len(probability)
    curves = Fragility(
        scenes=(WHITE,), axis="scene", place=np.zeros(1), level=np.empty(0), scale=np.linspace(0.5, 2.0, shape[-1]),
        probability=np.reshape(probability, shape), error_estimate=np.full(shape, math.nan), engine="exact",
        realizations=100, noise_scaled=True, options={}, noise_replacement="", wall_s=0.0,
        reasons=dict.fromkeys(reasons, "refused."),
    )  # fmt: skip
    vars(curves)["fits"] = [[one] for one in fits]
    return curves.model_diagnostics()


def test_curves_without_an_answer_are_of_no_use():
    (some,), (none,) = (diagnostics(reasons=range(count), probability=[0.5] * 4) for count in (3, 4))
    assert some[:3] == (trust.CAUTION, "The engine gave no answer for 3 of 4 probabilities: refused.", "unanswered")
    assert none[:2] == (trust.UNUSABLE, "The engine gave no answer for 4 of 4 probabilities: refused.")
    assert diagnostics() == []


@pytest.mark.parametrize(
    ("inside", "outside", "rule"),
    [
        (fit(0.3, 0.01), fit(0.3, math.nextafter(0.01, 0.0)), "(p = 0.01, below 0.01): it is off by up to 0.3. "),
        (fit(0.05), fit(math.nextafter(0.05, 1.0)), "(misfit above 0.05): it is off by up to 0.05. "),
        (fit(0.3, 0.05, math.nan), fit(0.3, math.nextafter(0.05, 0.0), math.nan), "(p = 0.05, below 0.05): it is "),
        (LognormalFit(reason="too few"), fit(0.3, 0.0), "(p = 0, below 0.01): it is off by up to 0.3. "),
    ],
)
def test_a_fit_is_rejected_beyond_its_limits(inside, outside, rule):
    """Of several the worst is told, and how many there are."""
    assert diagnostics([inside]) == []
    (one,), (two,) = diagnostics([outside]), diagnostics([inside, outside, outside])
    assert one.message.startswith(f"The lognormal fit is rejected {rule}")
    assert two.message.startswith(f"The lognormal fit of 2 of 3 curves is rejected {rule}")
    better = outside._replace(misfit=outside.misfit - 1e-3, p_value=0.0)
    assert f"off by up to {outside.misfit:.2g}" in diagnostics([better, outside, better])[0].message


ASKED = {"tol": 2e-3, "bins_tol": 0.03}


def limited():
    found = trust._limits(**ASKED)
    return {name: row for name, row in found.items() if not math.isinf(row[1])}


def judged(figures, **asked):
    return trust.verdict(trust.assess(figures, **asked))


@pytest.mark.parametrize("name", limited())
def test_a_figure_is_judged_at_its_limits(name):
    what, caution, unusable = limited()[name]
    assert caution < unusable
    cases = [(0.0, "ok"), (caution, "ok"), (math.nextafter(caution, 1.0), "caution"), (math.nan, "do not use")]
    if math.isfinite(unusable):
        cases += [(unusable, "caution"), (math.nextafter(unusable, 1.0), "do not use")]
    for value, verdict in cases:
        found = judged({name: value}, **ASKED)
        assert (found.verdict, value) == (verdict, value)
        assert what in found.reasons[0]
        assert judged({name: [0.0, value, value]}, **ASKED) == found  # the largest of a list counts
        earlier = judged({name: [0.0, value, 0.0]}, **ASKED)
        assert earlier.verdict == ("caution" if verdict == "do not use" else verdict)
        assert ("At the last time it is 0." in earlier.reasons[0]) == (verdict != "ok")


@pytest.mark.parametrize(
    ("value", "said"), [(0.01009, "0.0101, above 0.01"), (0.2, "0.2, above 0.1"), (0.01, "0.01, within")]
)
def test_a_figure_has_the_digits_that_tell_it_from_its_limit(value, said):
    assert f" is {said}" in judged({"total_error": value}, tol=0.01).reasons[0]


@pytest.mark.parametrize(
    ("over", "error", "verdict"),
    [
        (1.5e-5, 8e-5, "caution"),
        (0.006, 0.003, "caution"),
        (0.006, 0.0023, "ok"),
        (0.0, 1e-3, "caution"),
        (-1e-6, 1e-12, "ok"),
        (1.8e-6, 1.8e-6, "ok"),  # a block at rest, certain to a thousandth of what was asked
        (1.8e-6, 1.1e-5, "caution"),
    ],
)
def test_a_small_probability_of_overturning_is_judged_in_parts_of_itself(over, error, verdict):
    """Of a density; what is below a millionth is held against a millionth."""

    class Small(fakes.FakeEvolution):
        survival = np.array([1.0, 1.0 - over])
        overturned = np.array([[0.0, 0.0], [over, 0.0]])
        truncated = at_rest = np.zeros(2)

    found = Small(WHITE, cycles=1, error_estimate=error, tol=1e-2)
    assert found.trust.verdict == verdict
    assert found.summary()["overturning_error"] == pytest.approx(error / max(over, 1e-6))
    assert ("relative error of the last probability of overturning is" in str(found.trust)) == (verdict != "ok")


@pytest.mark.parametrize(("count", "verdict"), [(0, "ok"), (20, "caution"), (30, "ok")])
def test_few_overturned_paths_are_no_probability(count, verdict):
    """Of 10,000: the half width of Wilson's limits is .44 of the share of 20 of them, .36 of that of 30.

    Where none has overturned the answer is the upper limit, to an error that is far below what was asked for.
    """

    class Few(fakes.FakeEnsemble):
        survival = np.array([1.0, 1.0 - count / 10_000])
        overturned = np.array([[0.0, 0.0], [count / 10_000, 0.0]])

    assert Few(WHITE, cycles=1, realizations=10_000, method="white").trust.verdict == verdict


@pytest.mark.parametrize("name", ["error_estimate", "half_width", "truncated", "escape_error"])
def test_the_limit_of_an_error_is_what_was_asked_for(name):
    """Caution begins at the tolerance, in a rate at e times it; without one at `UNASKED`; of no use is a tenth."""
    factor = math.e if name == "escape_error" else 1.0
    for tol, least in (({"tol": 1e-2}, 1e-2), ({}, trust.UNASKED)):
        for value, verdict in ((least, "ok"), (trust.USELESS, "caution")):
            assert judged({name: factor * value}, **tol).verdict == verdict
            assert judged({name: factor * value * (1.0 + 1e-9)}, **tol).verdict != verdict


def test_without_a_tolerance_of_the_bins_their_error_is_not_judged():
    assert judged({"bins_error_estimate": 1e9}, tol=1e-3).reasons == ("No error is estimated.",)
