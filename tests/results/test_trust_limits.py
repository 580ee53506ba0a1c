"""Every limit of the verdict, with a figure at it and just above it; the limits themselves are read, not repeated."""

import math

import pytest

from fpk_rocking.results import trust

ASKED = {"tol": 2e-3, "bins_tol": 0.03}


def limits():
    found = trust._limits(**ASKED)
    return {name: row for name, row in found.items() if not math.isinf(row[1])}


def judged(figures, **asked):
    return trust.verdict(trust.assess(figures, **asked))


@pytest.mark.parametrize("name", limits())
def test_a_figure_is_judged_at_its_limits(name):
    what, caution, unusable = limits()[name]
    assert caution < unusable
    cases = [(0.0, "ok"), (caution, "ok"), (math.nextafter(caution, 1.0), "caution"), (math.nan, "do not use")]
    if math.isfinite(unusable):
        cases += [(unusable, "caution"), (math.nextafter(unusable, 1.0), "do not use")]
    for value, verdict in cases:
        found = judged({name: value}, **ASKED)
        assert (found.verdict, value) == (verdict, value)
        assert what in found.reasons[0]
        listed = judged({name: [0.0, value, 0.0]}, **ASKED)  # the largest of a list counts
        assert listed == found


@pytest.mark.parametrize(
    ("value", "said"), [(0.01009, "0.0101, above 0.01"), (0.2, "0.2, above 0.1"), (0.01, "0.01, within")]
)
def test_a_figure_has_the_digits_that_tell_it_from_its_limit(value, said):
    assert f" is {said}" in judged({"total_error": value}, tol=0.01).reasons[0]


@pytest.mark.parametrize("name", ["error_estimate", "half_width", "lost", "escape_error"])
def test_the_limit_of_an_error_is_what_was_asked_for(name):
    """Caution begins at the tolerance, in a rate at e times it; without one at `UNASKED`; of no use is a tenth."""
    factor = math.e if name == "escape_error" else 1.0
    for tol, least in (({"tol": 1e-2}, 1e-2), ({}, trust.UNASKED)):
        for value, verdict in ((least, "ok"), (trust.USELESS, "caution")):
            assert judged({name: factor * value}, **tol).verdict == verdict
            assert judged({name: factor * value * (1.0 + 1e-9)}, **tol).verdict != verdict


def test_without_a_tolerance_of_the_bins_their_error_is_not_judged():
    assert judged({"bins_error_estimate": 1e9}, tol=1e-3).reasons == ("No error is estimated.",)
