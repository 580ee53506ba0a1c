"""Hazard curves: continued as power laws, plateaus, rates of 0, refused by name."""

import dataclasses
import itertools
import math
import time
import tracemalloc

import numpy as np
import pytest
from scipy import integrate, special
from suites import curve_of

from fpk_rocking.risk import Hazard, annual_frequency
from fpk_rocking.risk.lognormal import LognormalFit


@pytest.mark.parametrize(
    ("intensity", "rate", "said"),
    [
        ([0.1, 0.1], [1e-2, 1e-3], r"hazard\.intensity\[1\]: got 0\.1, accepted: values that rise"),
        ([0.1, 0.2, 0.3], [1e-2, 2e-2, 1e-3], r"hazard\.rate\[1\]: got 0\.02, accepted: values that do not rise"),
        ([0.1, 0.2, 0.3], [2e-2, 1e-2, 1e-2], r"hazard\.rate\[2\]: got 0\.01, accepted: a rate that falls to the last"),
        ([0.1, 0.2], [475.0, 2475.0], r"hazard\.rate: got \[475\.0, 2475\.0\], .*return periods rise: a rate is 1/per"),
        ([0.1, 0.2, 0.3], [2e-2, 0.0, 0.0], r"hazard\.rate: .* accepted: at least two rates above 0"),
        ([0.1, 0.2], [1e-2, -1.0], r"hazard\.rate: got"),
        ([0.0, 0.2], [1e-2, 1e-3], r"hazard\.intensity: got"),
        ([0.1], [1e-2], r"hazard\.intensity: got"),
    ],
)
def test_what_is_no_hazard_is_refused_by_name(intensity, rate, said):
    with pytest.raises(ValueError, match=said):
        Hazard(intensity, rate)
    with pytest.raises(ValueError, match=r"^hazard\.measure: got 'SA', accepted: 'PGA', 'PGV', .* or 'Sa\(T\)'"):
        Hazard([0.1, 0.2], [1e-2, 1e-3], measure="SA")


def test_a_hazard_ends_where_its_rate_is_0_and_does_not_fall_on_a_plateau():
    hazard = Hazard([0.1, 0.2, 0.4, 0.8, 1.6], [1e-2, 1e-2, 1e-3, 0.0, 0.0])
    k = math.log(10.0) / math.log(2.0)
    assert hazard(np.array([0.01, 0.15])) == pytest.approx([1e-2, 1e-2])
    assert hazard(0.3) == pytest.approx(1e-2 * 1.5**-k)
    assert (hazard(0.79), hazard(0.8), hazard(5.0)) == (pytest.approx(1e-3 * (0.79 / 0.4) ** -k), 0.0, 0.0)
    assert hazard.exponents == pytest.approx([0.0, k])
    many = np.geomspace(0.1, 2.0, 10_000)
    assert Hazard(many, 1e-3 / many).with_slopes(0.5, 2.0).exponents[[0, -1]] == pytest.approx([0.5, 2.0])
    steeper = Hazard([0.1, 0.4], [1e-2, 1e-3]).with_slopes(0.5, 2.0)
    k = math.log(10.0) / math.log(4.0)
    assert steeper([0.05, 0.2, 0.8]) == pytest.approx([1e-2 * 2 ** (k / 2), 1e-2 * 2**-k, 1e-3 * 2 ** (-2 * k)])


def integral(curve, hazard, probability):
    """Rate by SciPy's quadrature of each piece between points of the hazard and the curve."""
    above, places = hazard.rate > 0.0, np.log(curve.intensity)
    x, h = np.log(hazard.intensity[above]), np.log(hazard.rate[above])
    k = -np.diff(h) / np.diff(x)
    end = math.log(hazard.intensity[~above][0]) if not above.all() else max(x[-1], places[-1]) + 5.0
    pieces = [(-20.0, x[0], 0, k[0]), *zip(x[:-1], x[1:], range(k.size), k, strict=True), (x[-1], end, k.size, k[-1])]
    parts = [probability(end) * math.exp(h[-1] - k[-1] * (end - x[-1]))]
    for first, last, point, slope in pieces:
        stops = np.unique([first, last, *places[(places > first) & (places < last)], *np.arange(first, last, 0.2)])
        for a, b in itertools.pairwise(stops if slope > 0.0 else ()):
            value = integrate.quad(
                lambda y: slope * math.exp(h[point] - slope * (y - x[point])) * probability(y),  # noqa: B023
                a, b, epsabs=0.0, epsrel=1e-12,
            )[0]  # fmt: skip
            parts.append(value)
    return math.fsum(parts)


HAZARDS = {
    "it begins with a plateau": ([0.05, 0.1, 0.2, 0.5, 1, 2], [0.02, 0.02, 0.02, 5e-3, 4e-4, 2e-5]),
    "equal neighbours": ([0.1, 0.4, 0.8, 2], [1e-2, 1e-3, 1e-3, 1e-5]),
    "nearly equal ones": ([0.1, 0.2, 0.4, 1, 3], [1e-2, 1e-2 * (1 - 1e-12), 9e-3, 1e-3, 1e-5]),
    "zeros at the end": ([0.1, 0.5, 1, 2, 3, 4], [1e-2, 1e-3, 1e-4, 1e-6, 0, 0]),
    "zeros amid the curve": ([0.1, 0.5, 0.6, 0.7], [1e-2, 1e-3, 5e-4, 0]),
    "a plateau, then zero": ([0.1, 0.5, 0.8, 1.0], [1e-2, 1e-3, 1e-3, 0]),
    "both": ([0.01, 0.02, 0.1, 0.3, 0.31, 1, 2, 4], [0.1, 0.1, 0.02, 2e-3, 2e-3, 1e-4, 1e-4, 0]),
    "it ends far below the curve": ([0.01, 0.02, 0.04], [1e-2, 5e-3, 0]),
    "it ends where hardly anything overturns": ([0.001, 0.002, 0.0025], [1e-2, 5e-3, 0]),
    "a law that hardly falls": ([0.1, 0.5, 2.0, 4.0], [1e-2, 1e-3, 1e-5, 9.999e-6]),
}


@pytest.mark.parametrize("name", HAZARDS)
@pytest.mark.parametrize("fitted", [True, False])
def test_rates_of_plateaus_and_zeros_are_the_integral_of_each_piece(name, fitted):
    curve, hazard = curve_of(0.7, 0.4, replicates=[(0.7, 0.4)] * 9), Hazard(*HAZARDS[name])
    if not fitted:
        curve = dataclasses.replace(curve, fit=LognormalFit(reason="left out"), replicates=np.empty((0, 2)))
    by_points = lambda y: float(curve.along(curve.probability, math.exp(y)))  # noqa: E731
    exact = integral(curve, hazard, (lambda y: special.ndtr((y - math.log(0.7)) / 0.4)) if fitted else by_points)
    risk = annual_frequency(curve, hazard)
    assert risk.rate == pytest.approx(exact, rel=1e-9, abs=0.0)
    assert risk.exported_rate == pytest.approx(exact, rel=1e-9, abs=0.0)
    if not hazard.rate[-1]:  # what is exceeded where it ends is no extrapolation, and comes from there
        assert risk.beyond_hazard < 0.1
        assert risk.edges[-1] <= hazard.end * (1.0 + 1e-12)
        if hazard.end <= curve.intensity[-1]:
            assert risk.beyond_curve - risk.below_curve == pytest.approx(0.0, abs=1e-9)
    if fitted:
        assert risk.interval == pytest.approx((exact, exact), rel=1e-9, abs=0.0)
    assert risk.contribution.sum() == pytest.approx(0.999, abs=1e-3)
    tracemalloc.start()
    begin = time.perf_counter()
    annual_frequency(curve, hazard)
    assert time.perf_counter() - begin < 0.5  # milliseconds, on a machine that is busy
    assert tracemalloc.get_traced_memory()[1] < 5e6
    tracemalloc.stop()


def test_motions_without_noise_under_a_hazard_that_ends():
    jumps = np.array([0.4, 0.9, 1.6])[:, None, None]
    curve = dataclasses.replace(curve_of(0.7, 0.5), fit=LognormalFit(reason="left out"), jumps=jumps, units=3)
    hazard = Hazard([0.1, 0.4, 0.8, 1.0], [1e-2, 1e-2, 1e-3, 0.0])
    risk = annual_frequency(curve, hazard)
    assert risk.rate == pytest.approx((1e-2 + hazard(0.9)) / 3.0, rel=1e-12)
    assert risk.contribution.sum() == pytest.approx(1.0, abs=2e-3)
    none = annual_frequency(dataclasses.replace(curve, jumps=jumps + 1.0), hazard)
    assert none.rate == 0.0
    assert none.title.startswith("annual rate of overturning = 0 (95 %: up to ")
    assert none.title.endswith("): by the hazard nothing exceeds PGV 1 m/s")


def test_a_law_that_gives_infinite_rates_is_refused():
    with pytest.raises(
        ValueError, match=r"^lowest exponent of the hazard: got 132\.9, accepted: less, as this power law leads"
    ):
        annual_frequency(curve_of(), Hazard([0.5, 0.51, 2.0], [1e-2, 7.2e-4, 1e-4]))
    steep = annual_frequency(curve_of(0.7, 1.0), Hazard([0.5, 0.6], [1e-2, 1e-3]))
    assert math.isfinite(steep.rate)
    assert steep.by_other_slopes[1] == math.inf


def test_a_hazard_of_another_measure_is_refused():
    """That of PGA, taken as one of PGV, gave 7.9e-5 for 2.0e-4 a year."""
    with pytest.raises(ValueError, match=r"^measure of the hazard: got 'PGA', accepted: PGV, as for the curve"):
        annual_frequency(curve_of(), Hazard([0.1, 1.0], [1e-2, 1e-4], measure="PGA"))
    # Where the unit is known, no other one is asked for.
    far = {"intensity": 100.0 * np.geomspace(0.02, 6.0, 20), "rate": np.geomspace(1e-1, 1e-6, 20)}
    asked, known = (annual_frequency(curve_of(), Hazard(**far, measure=name)).sentences[1] for name in ("", "PGV"))
    assert asked.startswith("Are the intensities of the hazard in cm/s?")
    assert known.startswith("91 % of the rate comes from")
    own = Hazard([0.1, 1.0], [1e-2, 1e-4], measure="PGV", note="Read so.")
    assert " are taken as known. Read so. " in annual_frequency(curve_of(), own).sentences[0]


def test_two_points_of_a_map_give_a_rate_and_what_other_slopes_would_make_of_it():
    """.15 m/s in 475 years and .3 m/s in 2,475: k = 2.38 between them, and half or twice of it beyond."""
    curve, k = curve_of(0.3, 0.4, replicates=[(0.3, 0.4)] * 9), math.log(2475 / 475) / math.log(2.0)
    risk = annual_frequency(curve, Hazard([0.15, 0.3], [1 / 475, 1 / 2475]))
    assert risk.rate == pytest.approx(0.3**k / 2475 * 0.3**-k * math.exp(0.5 * (k * 0.4) ** 2), rel=1e-9)
    wanted = []
    for below, beyond in itertools.product((0.5, 2.0), repeat=2):
        im = [0.15 * math.exp(-20.0), 0.15, 0.3, 0.3 * math.exp(20.0)]
        rate = [math.exp(20.0 * below * k) / 475, 1 / 475, 1 / 2475, math.exp(-20.0 * beyond * k) / 2475]
        wanted.append(annual_frequency(curve, Hazard(im, rate)).rate)
    assert risk.by_other_slopes == pytest.approx((min(wanted), max(wanted)), rel=1e-9)
    assert min(wanted) < 0.9 * risk.rate < risk.rate < 1.1 * max(wanted)
    assert risk.trust.verdict == "caution"
    low, high = (f"{value:.2e}".replace("e-0", "e-") for value in risk.by_other_slopes)
    share = f"{100 * risk.beyond_hazard:.0f} % of the rate comes from intensities beyond the points of the hazard curve"
    text = f"{share}, where power laws extrapolate it; with half and with twice their exponents there the rate is "
    assert f"{text}{low} to {high}." in risk.sentences
    far = annual_frequency(curve_of(1.5, 0.4, replicates=[(1.5, 0.4)] * 9), risk.hazard)
    assert far.trust.verdict == "do not use"
    assert far.sentences[1].endswith(": give more points.")


def test_what_is_exceeded_so_often_is_the_inverse_of_the_hazard():
    """On a plateau it is its end; of 0 it is inf; beyond the points the laws go on."""
    hazard = Hazard([0.1, 0.2, 0.5, 1.0], [1e-2, 1e-2, 1e-3, 1e-4])
    places = np.array([0.21, 0.4, 0.5, 0.7, 3.0])
    assert hazard.exceeded_at(hazard(places)) == pytest.approx(places, rel=1e-12)
    assert hazard.exceeded_at(np.array([1e-2, 0.0])) == pytest.approx([0.2, math.inf])
    law, ends = Hazard.power_law(2e-3, 2.5), Hazard([0.1, 0.5, 1.0], [1e-2, 1e-3, 0.0])
    assert law.exceeded_at(law(np.array([1e-5, 7e4]))) == pytest.approx([1e-5, 7e4], rel=1e-9)
    assert ends.exceeded_at(np.array([5e-3, 1e-9]))[0] == pytest.approx(
        float(0.1 * 2.0 ** (math.log(5.0) / math.log(10.0))), rel=1e-9
    )
    assert ends.exceeded_at(np.array([1e-9]))[0] > 1.0
