"""Comparison of results whose law is known, and the sampling floors against drawn samples."""

import dataclasses
import json
import math
import re

import fakes
import numpy as np
import pytest
from scipy.special import ndtr

from fpk_rocking import BandNoise, Block, Harmonic, NoNoise, Overturning, Scene, Start, WhiteNoise, melnikov
from fpk_rocking.compare import compare, joint_edges, shown_cycles
from fpk_rocking.results import sampling as distances
from fpk_rocking.results.remarks import noise_text, remarks
from montecarlo import histories

MAIN = Scene(Block(0.5), Harmonic(4.6, 2.7, math.pi), BandNoise(0.04, (0.0, 10.0), 100, "The band was assumed."))


def test_distances_of_known_bins():
    first, second = np.array([[0.5, 0.0], [0.2, 0.1]]), np.array([[0.25, 0.25], [0.2, -0.1]])
    assert distances.l1(first, second) == pytest.approx(0.25 + 0.25 + 0.2)
    # The negative bin counts as zero: the squares are (√.5 - √.25)², .25, 0 and .1.
    expected = math.sqrt(0.5 * ((math.sqrt(0.5) - 0.5) ** 2 + 0.25 + 0.1))
    assert distances.hellinger(first, second) == pytest.approx(expected)
    assert distances.hellinger(first, first) == distances.l1(first, first) == 0.0


@pytest.mark.parametrize(
    ("bins", "concentration", "sizes"),
    [
        (1500, 0.05, (20_000, math.inf)),  # mostly bins with no sample at all
        (1500, 0.05, (20_000, 5_000)),
        (300, 1.0, (200, math.inf)),  # less than one sample a bin
        (30, 1.0, (5_000, 5_000)),  # many samples a bin
    ],
)
def test_floors_are_what_samples_of_one_law_show(bins, concentration, sizes):
    """Means over 400 pairs of samples; the tolerance of 3 % is eight standard errors of the coarsest case."""
    rng = np.random.default_rng(7)
    law = 0.9 * rng.dirichlet(np.full(bins, concentration))
    whole = np.append(law, 0.1)

    def draw(size):
        return law if math.isinf(size) else rng.multinomial(int(size), whole)[:-1] / size

    pairs = [[draw(size) for size in sizes] for _ in range(400)]
    l1 = np.mean([distances.l1(*pair) for pair in pairs])
    hellinger = math.sqrt(np.mean([distances.hellinger(*pair) ** 2 for pair in pairs]))
    assert distances.l1_floor(law, *sizes) == pytest.approx(l1, rel=0.03)
    assert distances.hellinger_floor(law, *sizes) == pytest.approx(hellinger, rel=0.03)


def test_hellinger_floor_of_one_likely_bin():
    # The delta method: a frequency of variance p (1 - p)/n has a root of variance (1 - p)/(4 n).
    assert distances.hellinger_floor([0.9], 10_000, math.inf) == pytest.approx(math.sqrt(0.1 / 80_000), rel=1e-3)


def test_floor_of_two_exact_results_is_zero():
    law = np.full(10, 0.09)
    assert distances.l1_floor(law, math.inf, math.inf) == 0.0
    assert distances.hellinger_floor(law, math.inf, math.inf) == pytest.approx(0.0, abs=1e-8)


def test_root_deficit_is_continuous_where_its_series_begins():
    below, above = distances._root_deficit(np.array([30.0, np.nextafter(30.0, 31.0)]))
    assert below == pytest.approx(above, rel=1e-4)


def test_samples_of_the_density_itself_lie_at_the_floor():
    """One seed; the ratios to the floor scatter by 2.5 %, so each check fails by chance less than once in 10,000."""
    compared = compare(fakes.FakeEnsemble(MAIN, realizations=20_000, seed=3), fakes.FakeEvolution(MAIN))
    assert np.abs(compared.z).max() < 4.0
    np.testing.assert_allclose(compared.l1, compared.l1_floor, rtol=0.1)
    np.testing.assert_allclose(compared.hellinger, compared.hellinger_floor, rtol=0.1)
    error = np.sqrt(fakes.KEPT**4 * (1.0 - fakes.KEPT**4) / 20_000)
    assert compared.standard_error[4] == pytest.approx(error)
    assert compared.z[4] == pytest.approx(compared.difference[4] / error)
    assert not any("apart" in reason or "differs" in reason for reason in compared.trust.reasons)


def test_another_law_lies_far_above_the_floor():
    class Mirrored(fakes.FakeEvolution):
        def bin_probabilities(self, cycle, angle_edges, velocity_edges):
            return super().bin_probabilities(cycle, angle_edges, velocity_edges)[::-1]

    compared = compare(fakes.FakeEnsemble(MAIN, realizations=20_000), Mirrored(MAIN))
    assert np.all(compared.l1 > 4.0 * compared.l1_floor)
    assert np.all(compared.hellinger > 3.0 * compared.hellinger_floor)
    # Survival and sides are the same: the joint densities alone tell.
    assert compared.trust.verdict == "do not use"
    (reason,) = (reason for reason in compared.trust.reasons if "Replaced, not checked" not in reason)
    apart = re.fullmatch(r"The joint densities are ([\d.]+) apart \(L1, at most 2\) after 1 cycle, more .*", reason)
    assert float(apart[1]) == pytest.approx(compared.l1[0], rel=0.05)


def test_sides_are_judged_where_survival_agrees():
    """Exchanged sides; the bins of the fakes do not know of them."""
    exchanged = fakes.FakeEvolution(MAIN, overturned=fakes.FakeEvolution(MAIN).overturned[:, ::-1])
    compared = compare(fakes.FakeEnsemble(MAIN, realizations=20_000, seed=3), exchanged)
    assert np.abs(compared.z).max() < 4.0
    assert [name in " ".join(compared.trust.reasons) for name in ("to the left)", "to the right)")] == [True, True]
    assert not any("Survival" in reason for reason in compared.trust.reasons)


def test_two_ensembles_combine_their_errors():
    first, second = (fakes.FakeEnsemble(MAIN, realizations=size, seed=size) for size in (4_000, 1_000))
    compared = compare(first, second)
    pooled = (4.0 * first.survival[5] + second.survival[5]) / 5.0
    assert compared.standard_error[5] == pytest.approx(math.sqrt(pooled * (1 - pooled) * (1 / 4_000 + 1 / 1_000)))
    np.testing.assert_array_equal(compared.interval[:, 1], second.survival_interval(0.95))
    assert not any("seed" in remark for remark in compared.remarks)


@pytest.mark.parametrize(
    ("block", "message"),
    [
        (
            Block(0.6),
            r"^block\.restitution: got 0\.5 in the first result and 0\.6 in the second, accepted: two results",
        ),
        (
            Block(0.5, critical_angle=0.3),
            r"^block\.critical_angle: got 0\.0 in the first result and 0\.3 in the second",
        ),
    ],
)
def test_results_of_other_blocks_are_refused(block, message):
    with pytest.raises(ValueError, match=message):
        compare(fakes.FakeEvolution(MAIN), fakes.FakeEvolution(MAIN.varied(block=block)))


def test_bins_reach_four_deviations_of_a_start():
    """No forcing: the cut-off, a rebound, and what the start has; in steps of a tenth."""
    calm = Scene(Block(0.1), Harmonic(0.0, 1.0), WhiteNoise(1e-12), overturning=Overturning(2.0))
    wide = dataclasses.replace(calm, start=Start(covariance=((0.01, 0.0), (0.0, 0.04))))
    assert [joint_edges(one)[1][-1] for one in (calm, wide)] == pytest.approx([2.1, 2.0 + 4.0 * (0.1 + 0.2)], abs=0.11)


def test_shared_random_numbers_are_pointed_out():
    compared = compare(fakes.FakeEnsemble(MAIN, realizations=500), fakes.FakeEnsemble(MAIN, realizations=100))
    assert any("seed 1" in remark for remark in compared.remarks)


def test_two_densities_have_no_sampling_error():
    compared = compare(fakes.FakeEvolution(MAIN), fakes.FakeEvolution(MAIN))
    assert np.all(compared.standard_error == 0.0)
    assert np.all(np.isnan(compared.z))
    assert compared.error_estimate.tolist() == [1e-4, 1e-4]


def test_what_a_replacement_of_noise_is_estimated_to_neglect_is_accepted():
    known = fakes.FakeEvolution(MAIN, settings={"replacement": {"error": 0.006}})
    other = fakes.FakeEvolution(MAIN.white_equivalent(), survival=known.survival + 0.004)
    accepted = compare(known, other)
    assert accepted.error_estimate.tolist() == pytest.approx([0.0061, 1e-4])
    assert accepted.trust.verdict == "ok"
    assert "the estimated errors of the densities, 0.0062" in accepted.trust.reasons[0]
    alone = compare(fakes.FakeEvolution(MAIN.white_equivalent()), other)
    assert "more than the 0.0002 accepted there" in " ".join(alone.trust.reasons)


def test_common_cycles_and_leakage():
    first, second = fakes.FakeEvolution(MAIN, cycles=4), fakes.FakeEnsemble(MAIN, cycles=9)
    compared = compare(first, second)
    assert compared.cycles.tolist() == [0, 1, 2, 3, 4]
    assert compared.joint_cycles.tolist() == [1, 2, 4]
    np.testing.assert_allclose(compared.leakage.sum(axis=0), [first.overturned[4], second.overturned[4]])
    # The bins end at a velocity of 3.2; the law goes on.
    left, right = (ndtr((-3.2 - mean) / 0.6) + ndtr((mean - 3.2) / 0.6) for mean in fakes.VELOCITY_MEAN)
    tails = fakes.LEFT_SHARE * left + (1.0 - fakes.LEFT_SHARE) * right
    np.testing.assert_allclose(compared.outside[:, 0], first.survival[[1, 2, 4]] * tails, rtol=1e-9)


def test_to_dict_is_json():
    compared = compare(fakes.FakeEnsemble(MAIN), fakes.FakeEvolution(MAIN), joint_cycles=[2, 5])
    values = json.loads(json.dumps(compared.summary(), allow_nan=False))
    assert values["names"] == ["Monte Carlo rk4", "Fokker-Planck density"]
    assert values["realizations"] == [1000, None]
    assert values["interval"][3][1] == [None, None]
    assert values["survival"][3] == pytest.approx(compared.survival[3].tolist())
    fields = {field.name for field in dataclasses.fields(compared)} - {"results"}
    assert set(values) == fields | {"names", "realizations", "wall_s", "trust", "remarks"}


def test_melnikov_figures_of_each_noise():
    """D_m = 9.2/8.29, M = 0.375; the noise of an ensemble without any does not count."""
    quiet = dataclasses.replace(MAIN, noise=NoNoise())
    compared = compare(fakes.FakeEnsemble(quiet), fakes.FakeEvolution(MAIN))
    assert (compared.melnikov_amplitude, compared.melnikov_loss) == pytest.approx((9.2 / 8.29, 0.375))
    deviation = math.sqrt(0.008 * (10.0 / 101.0 + math.atan(10.0)))
    assert compared.melnikov_deviation == pytest.approx([0.0, deviation])
    assert compared.melnikov_margin == pytest.approx([9.2 / 8.29 - 0.375, math.hypot(9.2 / 8.29, deviation) - 0.375])
    assert compared.phase_flux == pytest.approx([0.186117, 0.188039], abs=1e-6)


def test_melnikov_figures_are_those_of_the_block():
    scene = dataclasses.replace(MAIN, block=Block(0.5, critical_angle=0.3))
    compared = compare(fakes.FakeEnsemble(scene), fakes.FakeEvolution(scene))
    assert compared.melnikov_amplitude == melnikov.harmonic_amplitude(MAIN.forcing, critical_angle=0.3)
    assert compared.melnikov_loss == melnikov.impact_loss(0.5, critical_angle=0.3)
    assert (
        compared.melnikov_deviation.tolist() == [math.sqrt(melnikov.noise_variance(MAIN.noise, critical_angle=0.3))] * 2
    )
    assert compared.melnikov_margin.tolist() == [melnikov.margin(MAIN.forcing, 0.5, MAIN.noise, critical_angle=0.3)] * 2
    assert compared.phase_flux.tolist() == [melnikov.phase_flux(MAIN.forcing, 0.5, MAIN.noise, critical_angle=0.3)] * 2


@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("block.restitution", {"block": Block(0.6)}),
        ("forcing", {"forcing": Harmonic(4.6, 2.7, 0.0)}),
        ("start", {"start": Start(0.1)}),
        ("overturning", {"overturning": Overturning(1.0)}),
    ],
)
def test_different_problems_are_refused(name, change):
    other = dataclasses.replace(MAIN, **change)
    with pytest.raises(ValueError, match=f"{name}: got .* in the first .* in the second"):
        compare(fakes.FakeEvolution(MAIN), fakes.FakeEvolution(other))


def test_noise_may_differ_and_is_named():
    compared = compare(fakes.FakeEnsemble(MAIN.white_equivalent(), method="white"), fakes.FakeEvolution(MAIN))
    assert any("white noise, diffusion 0.00628" in remark and "band noise" in remark for remark in compared.remarks)
    assert "The band was assumed." in compared.remarks
    assert fakes.FakeEvolution(MAIN).noise_replacement in compared.remarks


@pytest.mark.parametrize(("cycles", "error"), [([11], ValueError), ([-1], ValueError), ([1.0], TypeError)])
def test_cycles_that_are_not_there_are_refused(cycles, error):
    with pytest.raises(error, match=r"joint_cycles: got .* a whole number from 0 to 10"):
        compare(fakes.FakeEvolution(MAIN), fakes.FakeEvolution(MAIN), joint_cycles=cycles)


def test_shown_cycles_end_with_the_last():
    assert shown_cycles(1) == [1]
    assert shown_cycles(13) == [1, 2, 4, 10, 13]


def test_bins_of_the_main_scene():
    angle, velocity = joint_edges(MAIN)
    np.testing.assert_allclose(angle, np.linspace(-1.6, 1.6, 33), atol=1e-15)
    np.testing.assert_allclose(velocity, np.linspace(-3.2, 3.2, 65), atol=1e-15)
    assert 0.0 in angle
    assert 0.0 in velocity


def test_bins_follow_the_scene():
    still = dataclasses.replace(MAIN, forcing=Harmonic(0.0, 2.7), noise=NoNoise(), overturning=Overturning(1.0))
    angle, velocity = joint_edges(still)
    # Without forcing and noise |v| <= max(1, c + e) = 1.5.
    assert (angle[-1], velocity[-1]) == (1.0, 1.5)
    thrown = dataclasses.replace(still, start=Start(0.0, -3.0))
    assert joint_edges(thrown)[1][0] == -4.0
    leaning = dataclasses.replace(still, start=Start(0.5, -3.0))
    assert joint_edges(leaning)[1][0] == -4.5
    wide = dataclasses.replace(still, start=Start(0.0, 0.0, ((0.25, 0.0), (0.0, 0.25))))
    assert joint_edges(wide)[1][-1] == 5.0
    noisy = dataclasses.replace(still, noise=WhiteNoise(0.25))
    assert joint_edges(noisy)[1][-1] == 3.5


def test_bins_hold_a_strongly_driven_escape():
    """From rest at 8 phases a far cut-off is reached at up to .94 of the last edge, which the driven speed sets."""
    fastest = 0.0
    for phase in 2.0 * np.pi * np.arange(8) / 8:
        scene = Scene(Block(0.1), Harmonic(8.0, 0.6, phase), NoNoise(), Start(), Overturning(8.0))
        run = histories(scene, cycles=2, method="exact", samples_per_cycle=400)
        fastest = max(fastest, np.nanmax(np.abs(run.velocity)))
    edge = joint_edges(scene)[1][-1]
    assert 0.9 * edge < fastest < edge


def test_labels():
    assert fakes.FakeEnsemble(MAIN, realizations=20_000).label == "Monte Carlo rk4, 20,000 realizations"
    assert fakes.FakeEvolution(MAIN).label == "Fokker-Planck density"
    assert noise_text(MAIN.noise) == "band noise, variance 0.04 on [0, 10], 100 harmonics"
    assert noise_text(NoNoise()) == "no noise"
    own = dataclasses.replace(MAIN, noise=BandNoise(0.04, (1.0, 6.0), 100))
    assert remarks(fakes.FakeEnsemble(own)) == ()


@pytest.mark.parametrize("wrong", [np.zeros(3), None, "density.npz", MAIN, 1.0])
def test_what_is_no_result_is_refused_by_name(wrong):
    density = fakes.FakeEvolution(MAIN)
    with pytest.raises(TypeError, match=r"(?s)^first: got .*, accepted: SurvivalResult"):
        compare(wrong, density)
    with pytest.raises(TypeError, match=r"(?s)^second: got .*, accepted: SurvivalResult"):
        compare(density, wrong)
