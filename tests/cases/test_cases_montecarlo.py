"""The cases of the Monte Carlo figures and studies, re-run coarse.

Seeds are fixed. Where a probability is held against a known value the bound is 4.5 standard errors, a false alarm of
7e-6 for another seed; known values of band noise are from 600,000 realizations, those of white noise independent.
"""

import dataclasses
import json
import math

import matplotlib.image
import numpy as np
import pytest

from fpk_rocking import CycleOperator, NoNoise, load_scene, melnikov, solve_fpk
from fpk_rocking.analytics.orbits import symmetric_orbits
from montecarlo import overturning_rate, simulate


def written(folder, name, values):
    """The files hold the values and a picture that is not blank."""
    assert {path.name for path in folder.iterdir()} == {f"{name}.png", f"{name}.json"}
    assert json.loads((folder / f"{name}.json").read_text(encoding="utf-8")) == values
    pixels = matplotlib.image.imread(folder / f"{name}.png")[..., :3]
    assert min(pixels.shape[:2]) > 600
    return np.unique((255 * pixels[::4, ::4]).astype(int).reshape(-1, 3), axis=0).shape[0] > 50


def sampled(probability, realizations):
    return pytest.approx(probability, abs=4.5 * math.sqrt(probability * (1.0 - probability) / realizations))


def small_fig05(module, folder):
    module.LATE = 40
    values = module.run(folder, realizations=1000, cycles=60, bounded_cycles=100)
    paths = simulate(load_scene("fig05"), cycles=60, realizations=1000)
    assert paths.overturn_side[values["realization"]] == 1
    assert abs(values["overturned_after_cycles"] - 40.0) <= 5.0
    assert "variance = 0.0025" in values["scene"]
    assert sorted(x for x, _ in values["periodic_points"]) == pytest.approx([-0.0836, -0.0219], abs=5e-5)
    assert values["bounded_without_noise"] is True
    with pytest.raises(ValueError, match=r"realizations: got 3, accepted: enough for one to overturn to the right"):
        module.run(folder, realizations=3, cycles=50, bounded_cycles=10)
    return values


def small_fig07(module, folder):
    """After four cycles; the mirror image exchanges the sides."""
    coarse = {"cycles": 4, "realizations": 20, "variances": (0.04,), "density_variances": (0.04,)}
    values = module.run(folder, **coarse, phase_variances=(0.04,))
    assert values["density"][0]["survival"] == pytest.approx(0.8627, abs=2e-3)
    assert values["white"][0]["survival"] == sampled(0.8627, 200)
    paper, quarter, half = values["phases"]
    assert [noise["stands_without_noise"] for noise in (paper, quarter, half)] == [True, False, True]
    assert paper["survival"][0] == sampled(0.8656, 400)
    assert paper["to_the_right"][0] == pytest.approx(1.0 - half["to_the_right"][0], abs=4.5 * math.sqrt(0.5 / 50))
    return values


def small_fig08(module, folder):
    values = module.run(folder, cycles=20, realizations=20, seeds=1)
    attractor = module.attractor_of(load_scene("main").varied(forcing={"phase": 3.14}), 20)
    assert values["without_noise"]["deviation"] == pytest.approx(np.std(attractor, axis=0))
    assert "variance = 0.0016" in values["scene"]
    assert values["mean_overturned_after"] == [None]
    assert values["restarted"]["deviation"] == pytest.approx(values["without_noise"]["deviation"], rel=0.3)
    return values


def small_fig09(module, folder):
    values = module.run(folder, paper=(0.05, 0.2), between=(), seeds=1, realizations=20, cycles=30)
    standing, overturning = values["maps"]
    assert (standing["deviation"], standing["overturned_after"]) == (0.05, [None])
    assert overturning["overturned_after"][0] < 30
    assert values["without_noise"]["covered"] > 0.95
    return values


def small_bifurcation(module, folder):
    module.BLOCKS = 2
    values = module.run(folder, amplitudes=(2.6, 4.9), cycles=60)
    for low, high in (values["crisis"], values["crisis_at_twice_the_cutoff"]):
        assert 4.75 < low < high < 4.85
        assert high - low <= 1e-3
    assert values["rest_overturns"] == [4.9]
    assert values["symmetric_orbit_stable_up_to"] == pytest.approx(2.899856, abs=1e-6)
    return values


def small_passage(module, folder):
    values = module.run(folder, variances=(0.04,), cycles=4, realizations=500, tol=5e-2)
    (row,) = values["noise"]
    assert max(map(abs, row["white_z"].values())) < 4.5
    assert sum(row["density"][:4]) == pytest.approx(1.0 - 0.8627, abs=2e-3)
    by_cycle = np.array(values["early"]).sum(axis=1).reshape(4, 20).sum(axis=1)
    assert by_cycle == pytest.approx(np.array(row["band"]), abs=1e-12)
    return values


def small_band(module, folder):
    coarse = {"bands": (5.0, 10.0), "raised": ((2.0, 4.0),), "left_out": (6.0,), "realizations": 50}
    values = module.run(folder, **coarse, seeds=1, few_seeds=1, map_size=20, map_cycles=20)
    low, ours, raised = values["rows"]
    assert ours["melnikov_variance_of_fig3"] == pytest.approx(2.0 * 0.0062806 * 0.286 / 0.04, rel=1e-4)
    assert (low["meets"]["Fig. 3"], ours["meets"]["Fig. 3"]) == (False, True)
    assert ours["late_survival"] == sampled(0.9064, 50)
    assert ours["survival"]["10"] == sampled(0.4787, 50)
    assert raised["meets"]["Fig. 6"] is False
    assert module.table(values).row_count == 3
    return values


SMALL = {
    "fig05_overturning": ("fig05", small_fig05),
    "fig07_survival_against_noise": ("fig07", small_fig07),
    "fig08_mean_poincare": ("fig08", small_fig08),
    "fig09_mean_map_and_noise": ("fig09", small_fig09),
    "bifurcation": ("bifurcation", small_bifurcation),
    "first_passage": ("passage", small_passage),
    "band_inferred": ("band", small_band),
}
"""Of cases whose runs below are slow: the name of their files, and a run in a second or two with what it must give."""


@pytest.mark.parametrize("name", SMALL)
def test_a_small_run_gives_what_it_must_and_writes_it(name, case, tmp_path):
    stem, run = SMALL[name]
    values = run(case(name), tmp_path)
    assert written(tmp_path, stem, values)


def test_bands_are_weighed_by_the_product_of_their_chances(case):
    chances = {"Fig. 5(b)": 0.5, "Fig. 9 (a)": 0.0}
    rows = [
        {"band": [0.0, 1.0], "likelihood": chances, "meets": {"a": True}},
        {"band": [0.0, 2.0], "meets": {"a": False}},
    ]
    rows[1]["likelihood"] = chances | {"Fig. 9 (a)": 0.25}
    joint = case("band_inferred")._joint(rows, 9, 4)
    assert joint["log_likelihood"] == pytest.approx([math.log(0.05), math.log(0.125)])
    assert (joint["best"], joint["within"], joint["meets_all"]) == (2.0, [1.0, 2.0], [1.0])


@pytest.mark.slow
def test_fig05_has_the_known_share_standing_and_a_bounded_motion_without_noise(case, tmp_path):
    """Known: 100,000 realizations of another seed stand after 125 cycles with .7330, .9064 and .9855."""
    values = case("fig05_overturning").run(tmp_path, realizations=3000, cycles=140, bounded_cycles=400)
    assert "variance = 0.0025" in values["scene"]
    assert sorted(x for x, _ in values["periodic_points"]) == pytest.approx([-0.0836, -0.0219], abs=5e-5)
    assert values["bounded_without_noise"] is True
    assert abs(values["overturned_after_cycles"] - 125.0) <= 5.0
    late = {row["band"][1]: row["standing_after_125"] for row in values["late"]}
    assert [late[band] for band in (5.0, 10.0, 20.0)] == [
        sampled(survival, 3000) for survival in (0.7330, 0.9064, 0.9855)
    ]
    with pytest.raises(ValueError, match=r"realizations: got 3, accepted: enough for one to overturn to the right"):
        case("fig05_overturning").run(tmp_path, realizations=3, cycles=131, bounded_cycles=100)
    assert written(tmp_path, "fig05", values)


@pytest.mark.slow
def test_fig07_has_the_known_survival_and_a_mirror_image(case, tmp_path):
    coarse = {"cycles": 10, "realizations": 1000, "variances": (0.01, 0.04), "density_variances": (0.04,)}
    values = case("fig07_survival_against_noise").run(tmp_path, **coarse, phase_variances=(0.04,))
    assert "phase = 0.0" in values["scene"]
    assert values["density"][0]["survival"] == pytest.approx(0.4696, abs=2e-3)
    assert values["white"][0]["survival"] == sampled(0.4696, values["white"][0]["realizations"])
    assert values["white"][0]["realizations"] == 10_000
    assert values["bands"][1]["survival"][1] == sampled(0.4787, 1000)
    assert values["stands_without_noise"] is True
    paper, quarter, half = values["phases"]
    assert [noise["stands_without_noise"] for noise in (paper, quarter, half)] == [True, False, True]
    assert paper["survival"][0] == sampled(0.4787, 20_000)
    assert half["survival"][0] == sampled(0.4787, 20_000)
    # The mirror image: as many to the right as else to the left.
    assert paper["to_the_right"][0] == pytest.approx(1.0 - half["to_the_right"][0], abs=4.5 * math.sqrt(0.5 / 10_000))
    assert written(tmp_path, "fig07", values)


@pytest.mark.slow
def test_fig08_restarted_means_stay_on_the_attractor_without_noise(case, tmp_path):
    values = case("fig08_mean_poincare").run(tmp_path, cycles=150, realizations=200, seeds=2)
    assert "phase = 3.14\n" in values["scene"]
    assert "variance = 0.0016" in values["scene"]
    assert values["mean_overturned_after"] == [None, None]
    restarted, still = values["restarted"], values["without_noise"]
    assert restarted["deviation"] == pytest.approx(still["deviation"], rel=0.2)
    # From 150 points each; 500 give 1.046 ± 0.016 and 1.057 ± 0.019.
    assert restarted["dimension"] == pytest.approx(1.05, abs=0.2)
    assert still["dimension"] == pytest.approx(1.05, abs=0.2)
    # The free ensemble has forgotten its start: its mean is that of the attractor, up to the correlation of its points.
    assert values["free_last"] == pytest.approx(still["mean"], abs=0.1)
    assert written(tmp_path, "fig08", values)


@pytest.mark.slow
def test_fig09_mean_maps_shrink_and_overturn_as_noise_grows(case, tmp_path):
    module = case("fig09_mean_map_and_noise")
    paper = (0.05, 0.06, 0.09, 0.16, 0.2)
    values = module.run(tmp_path, paper=paper, between=(), seeds=2, realizations=200, cycles=120)
    maps = {mapped["deviation"]: mapped for mapped in values["maps"]}
    assert maps[0.05]["overturned_after"] == maps[0.09]["overturned_after"] == [None, None]
    assert None not in maps[0.2]["overturned_after"]
    assert max(maps[0.2]["overturned_after"]) < 120
    assert maps[0.2]["dimension"] is None
    # The attractor of the mean map shrinks between 0.05 and 0.06, from 1.35 to 0.53 in angle with 1,200 realizations.
    assert min(maps[0.05]["largest_angle"]) > 1.2
    assert max(maps[0.09]["largest_angle"]) < 0.9
    assert maps[0.05]["dimension"] > maps[0.09]["dimension"]
    assert values["without_noise"]["covered"] > 0.95
    assert maps[0.05]["covered"] > 0.8
    assert maps[0.09]["covered"] < 0.5
    assert maps[0.2]["covered"] is None
    assert written(tmp_path, "fig09", values)


@pytest.mark.slow
def test_bifurcation_ends_at_the_known_crisis(case, main_scene, tmp_path):
    module = case("bifurcation")
    module.BLOCKS = 12
    values = module.run(tmp_path, amplitudes=(2.6, 4.6, 4.9), cycles=1500)
    for low, high in (values["crisis"], values["crisis_at_twice_the_cutoff"]):
        assert 4.7536 < low < high < 4.765
        assert high - low <= 1e-3
    assert values["rest_overturns"] == [4.9]
    assert values["symmetric_orbit_stable_up_to"] == pytest.approx(2.899856, abs=1e-6)
    settled = module.continued(main_scene.varied(noise=NoNoise()), (2.6,))[0]
    orbit = symmetric_orbits(2.6, 2.7, 0.5)[-1]
    assert settled[-1] == pytest.approx(np.array(orbit.state(main_scene.forcing.phase)), abs=1e-10)
    assert written(tmp_path, "bifurcation", values)


@pytest.mark.slow
def test_survival_against_restitution_is_the_known_one(case, tmp_path):
    coarse = {"restitutions": (0.5, 0.7, 1.0), "density_restitutions": (0.7,), "realizations": 2000, "tol": 5e-2}
    values = case("survival_against_restitution").run(tmp_path, **coarse)
    survival = np.array(values["bands"][1]["survival"])
    assert survival[0, 0] == sampled(0.4787, 2000)
    assert survival[1, 0] == sampled(values["density"][0]["survival"][0], 2000)
    assert survival[2, 0] == sampled(0.0136, 2000)
    assert values["cycles_without_noise"][:2] == [200.0, 200.0]
    assert values["cycles_without_noise"][2] < 2.0
    assert written(tmp_path, "restitution", values)


@pytest.mark.slow
def test_first_passages_add_up_to_the_overturned(case, tmp_path):
    values = case("first_passage").run(tmp_path, variances=(0.04,), cycles=6, realizations=20_000, tol=1e-2)
    row = values["noise"][0]
    assert max(map(abs, row["white_z"].values())) < 4.5
    assert sum(row["density"][:4]) == pytest.approx(1.0 - 0.8627, abs=2e-3)
    by_cycle = np.array(values["early"]).sum(axis=1).reshape(6, 20).sum(axis=1)
    assert by_cycle == pytest.approx(np.array(row["band"]), abs=1e-12)
    assert written(tmp_path, "passage", values)


@pytest.mark.slow
def test_the_band_inferred_is_the_one_that_meets_the_figures(case, tmp_path):
    module = case("band_inferred")
    coarse = {"bands": (5.0, 10.0), "raised": ((2.0, 4.0),), "left_out": (6.0,), "realizations": 2000}
    values = module.run(tmp_path, **coarse, seeds=2, few_seeds=1, map_size=200, map_cycles=120)
    low, ours, raised = values["rows"]
    assert ours["survival"]["20"] == sampled(0.1864, 2000)
    assert ours["late_survival"] == sampled(0.9064, 2000)
    assert ours["melnikov_variance_of_fig3"] == pytest.approx(2.0 * 0.0062806 * 0.286 / 0.04, rel=1e-4)
    assert (low["meets"]["Fig. 3"], ours["meets"]["Fig. 3"]) == (False, True)
    assert [row["meets"]["Fig. 6"] for row in values["rows"]] == [True, True, False]
    assert raised["likelihood"]["Fig. 5(b)"] < 1e-2
    assert raised["meets"]["Fig. 5(b)"] is False
    assert ours["mean_stands"]["0.05"] == [1, 1]
    assert low["mean_stands"]["0.13"] == [0, 2]
    assert values["left_out"][0]["mean_stands"]["0.13"] == [0, 1]
    assert values["joint"]["best"] == 10.0
    assert module.table(values).row_count == 3
    assert written(tmp_path, "band", values)


def test_leakage_rises_with_the_flux_over_noise_but_not_over_restitution(case, main_scene, tmp_path):
    coarse = {"variances": (0.01, 0.04), "restitutions": (0.5, 0.7, 0.9), "cycles": 40, "realizations": 2000}
    values = case("leakage_against_flux").run(tmp_path, **coarse)
    ordering = values["over_noise"][1]
    assert ordering["kendall"] == 1.0
    assert ordering["rate"][0] == pytest.approx(0.0277, rel=4.5 / math.sqrt(ordering["count"][0]))
    m, d = 0.375, 9.2 / 8.29
    still = (math.sqrt(d * d - m * m) - m * math.acos(m / d)) / math.pi * main_scene.period
    assert still < ordering["flux_per_cycle"][0] < ordering["flux_per_cycle"][1] < 1.02 * still
    rates = values["over_restitution"]["rate"]
    assert rates[1] < min(rates[0], rates[2])
    assert written(tmp_path, "flux", values)


@pytest.fixture(scope="module")
def turned(case, named_scene):
    """The scene with a second harmonic, the same with Ψ₂ + π, and with both phases turned: another, and its mirror."""
    scene, module = named_scene("second_harmonic"), case("second_harmonic")
    later = module.with_second(scene, 1.0, scene.forcing.phases[1] + math.pi)
    return scene, later, scene.varied(forcing={"phases": [psi + math.pi for psi in scene.forcing.phases]})


def test_a_forcing_of_the_other_sign_exchanges_the_sides(turned):
    """From rest the mirror image has the same survival; with Ψ₂ alone turned it starts at another time of its cycle."""
    scene, later, mirrored = (solve_fpk(forcing_scene, cycles=3, tol=5e-2) for forcing_scene in turned)
    assert mirrored.survival == pytest.approx(scene.survival, abs=1e-12)
    assert mirrored.overturned == pytest.approx(scene.overturned[:, ::-1], abs=1e-12)
    assert later.survival[3] - scene.survival[3] > 0.2


@pytest.mark.slow
def test_in_the_long_run_a_turned_second_harmonic_exchanges_the_sides(case, turned):
    """The same rate, on another mesh; shares of cycles half a cycle apart differ by less than it."""
    module = case("second_harmonic")
    scene, later = (
        CycleOperator(module.with_second(scene, 1.5, scene.forcing.phases[1] - math.pi / 2), tol=0.2)
        for scene in turned[:2]
    )
    assert later.escape_rate == pytest.approx(scene.escape_rate, rel=scene.escape_error)
    left, right = module.side_rates(scene)
    assert left + right == pytest.approx(scene.escape_rate, rel=1e-12)
    assert module.side_rates(later) == pytest.approx([right, left], rel=scene.escape_rate)
    assert left > 3.0 * right


@pytest.mark.slow
def test_densities_under_a_second_harmonic_agree_with_samples(case, tmp_path):
    """Coarse densities of five cycles beside 2000 realizations and survival at tol 1e-3; rates beside theirs."""
    module = case("second_harmonic")
    values = module.run(tmp_path, amplitudes=(1.0,), parts=2, cycles=5, realizations=2000, tol=5e-2)
    for run in (*values["phases"], values["from_rest"]):
        survival, sides = np.array(run["survival"]), np.array(run["overturned"])
        assert survival + sides.sum(axis=1) == pytest.approx(np.ones(survival.size), abs=1e-6)
        for ours, theirs in zip(survival, run["sampled_survival"], strict=True):
            assert theirs == sampled(ours, 2000)
        for ours, theirs in zip(sides.ravel(), np.ravel(run["sampled_overturned"]), strict=True):
            assert theirs == sampled(ours, 2000)
    survival = [run["survival"][0] for run in values["phases"]]
    assert survival[::2] == pytest.approx(values["from_rest"]["survival"], abs=1e-12)
    assert survival == pytest.approx([0.7038, 0.5800, 0.5088, 0.9597], abs=1e-3)
    later = values["long_run"]
    assert later["rate"][0] == pytest.approx([0.00848, 0.00281], rel=0.02)
    assert later["rate"][1] == later["rate"][0][::-1]
    assert later["rate_without"] == pytest.approx([0.00277, 0.00277], rel=0.02)
    for rates, intervals in zip(later["rate"], later["interval"], strict=True):
        assert all(0.8 * low < rate < 1.25 * high for rate, (low, high) in zip(rates, intervals, strict=True))
    scene = module.load_scene("second_harmonic")
    both = melnikov.phase_flux(scene.forcing, 0.6, scene.noise) * scene.period
    assert np.mean(module.side_fluxes(scene)) == pytest.approx(both, rel=1e-9)
    # Over the right saddle most where the force peaks to the right: Ψ₂ = π.
    assert later["flux_per_cycle"][1][1] > 1.3 * later["flux_per_cycle"][1][0]
    assert written(tmp_path, "second_harmonic", values)


def test_overturning_rate_counts_cycles_lived(main_scene):
    """Three blocks: one gone before it counts, one that lived for 2.5 of the cycles that count, one that stands."""
    ensemble = simulate(main_scene, cycles=10, realizations=3)
    angle = np.zeros((3, 11))
    angle[0, 3:], angle[1, 7:] = np.nan, np.nan
    times = main_scene.period * np.array([2.5, 6.5, np.nan])
    altered = dataclasses.replace(
        ensemble, angle=angle, overturn_time=times, overturn_side=np.array([1, -1, 0], dtype=np.int8)
    )
    estimate = overturning_rate(altered, after=4)
    assert (estimate.rate, estimate.count) == (pytest.approx(1.0 / 8.5), 1)
    assert estimate.interval == pytest.approx(np.array([0.0253178, 5.5716434]) / 8.5, rel=1e-6)
    sides = [overturning_rate(altered, after=4, side=side) for side in (-1, 1)]
    assert [(side_rate.rate, side_rate.count) for side_rate in sides] == [(pytest.approx(1.0 / 8.5), 1), (0.0, 0)]
    assert overturning_rate(altered, after=8).interval == pytest.approx(np.array([0.0, 3.6888795]) / 2.0, rel=1e-6)
    for bad in (0, 2, True, "left"):
        with pytest.raises(ValueError, match=rf"side: got {bad!r}, accepted: None, or -1 \(left\) or 1 \(right\)"):
            overturning_rate(altered, after=4, side=bad)
    with pytest.raises(ValueError, match=r"after: got 10, accepted: a number below 10"):
        overturning_rate(altered, after=10)
