"""The choice of a replacement for a band: by what the estimates say, and what is averaged over realizations."""

import dataclasses
import math

import numpy as np
import pytest
from scipy.integrate import quad

from fpk_rocking import BandNoise, Start, WhiteNoise, load_scene, melnikov, solve_fpk
from fpk_rocking.density import replacing, solver
from fpk_rocking.physics.noise.equivalence import forgetful_diffusion, response
from fpk_rocking.scene.least import kind_of

MAIN = load_scene("main")
STRATIFIED = MAIN.varied(noise=dataclasses.replace(MAIN.noise, frequencies="stratified"))


def test_the_strength_for_a_block_that_forgets_is_the_response_of_no_restitution_along_the_spectrum():
    noise = BandNoise(0.04, (1.0, 6.0), 100)
    band = quad(lambda w: 0.04 / 5.0 * response(w, 0.0), 1.0, 6.0)[0]
    assert forgetful_diffusion(noise) == pytest.approx(band, rel=1e-10)
    for states in (1, 2):
        filtered = MAIN.filtered_equivalent(states=states).noise
        integral = quad(lambda w, own=filtered: own.space.spectral_density(w) * response(w, 0.0), 0.0, np.inf)[0]
        assert forgetful_diffusion(filtered) == pytest.approx(0.04 * integral, rel=1e-8)
    assert forgetful_diffusion(WhiteNoise(0.3)) == 0.3


@pytest.mark.parametrize("angle", [0.0, 0.3])
def test_exponential_noise_has_both_variances_of_the_band(angle):
    scene = MAIN.varied(block=dataclasses.replace(MAIN.block, critical_angle=angle))
    noise = scene.filtered_equivalent(states=1).noise
    assert (noise.filter, noise.variance) == ("exponential", 0.04)
    assert melnikov.noise_variance(noise, critical_angle=angle) == pytest.approx(
        melnikov.noise_variance(MAIN.noise, critical_angle=angle), rel=1e-12
    )
    if not angle:
        ratio = melnikov.noise_variance(MAIN.noise) / 0.04
        assert noise.frequency == pytest.approx((1.0 + math.sqrt(1.0 + 2.0 * ratio)) / ratio - 1.0, rel=1e-12)
    with pytest.raises(ValueError, match=r"^states: got 3, accepted: a whole number from 1 to 2"):
        scene.filtered_equivalent(states=3)


def linear(scene):
    """Survival, overturned left and right that follow the logarithm of the diffusion; no block is next to rest."""
    part = 0.5 + 0.2 * math.log(scene.noise.diffusion / 0.006)
    return np.array([[1.0, 0.0, 0.0], [1.0 - part, 0.25 * part, 0.75 * part]]), 0.0


def test_the_fastest_noise_within_the_tolerance_is_taken_else_the_most_accurate():
    white = 0.2 * math.log(MAIN.white_equivalent().noise.diffusion / forgetful_diffusion(MAIN.noise))
    assert white > 0.0  # the white noise is stronger for a block that forgets
    chosen = {tol: replacing.choose(MAIN, tol, linear, lambda _: None) for tol in (3 * white, 0.7 * white, 1e-6)}
    assert [choice.name for choice in chosen.values()] == ["white", "filtered", "filtered"]
    assert chosen[3 * white].error == pytest.approx(2 * white, rel=1e-9)
    assert chosen[1e-6].error == chosen[0.7 * white].error < 0.3 * white
    assert chosen[1e-6].scene == MAIN.filtered_equivalent()
    assert chosen[3 * white].reason.startswith("white noise is the fastest within")
    assert "the most accurate, as none is within 1e-06" in chosen[1e-6].reason
    # A density need not be much more accurate than its noise.
    assert [choice.tol for choice in chosen.values()] == pytest.approx(
        [3 * white, 0.7 * white, chosen[1e-6].error / 3.0]
    )
    assert chosen[1e-6].reason.endswith(f"; the density is therefore solved to an error of {chosen[1e-6].tol:.1g}")
    assert "therefore solved" not in chosen[0.7 * white].reason

    def refuses(scene):
        if scene.noise.kind == "filtered":
            raise ValueError

    assert replacing.choose(MAIN, 1e-6, linear, refuses).name == "white"
    assert "exponential refused, filtered refused" in replacing.choose(MAIN, 1e-6, linear, refuses).reason
    # A larger tolerance would let the verdict be "ok" of larger errors.
    far = replacing.choose(MAIN, 1e-6, lambda scene: (linear(scene)[0], 1.0), refuses)
    assert (far.tol, far.error > 0.03) == (0.01, True)

    def refuses_two_states(scene):
        if scene.noise.kind == "filtered" and scene.noise.space.order == 2:
            raise ValueError

    slow = replacing.choose(MAIN, 1e-6, linear, refuses_two_states)
    assert (slow.name, slow.errors["exponential"]) == ("white", slow.errors["white"])
    overturned = 1.0 - linear(MAIN.white_equivalent())[0][-1, 0]
    part = 1.5 * white / overturned
    resting = replacing.choose(MAIN, 3 * white, lambda scene: (linear(scene)[0], part), lambda _: None)
    assert resting.name == "exponential"
    assert resting.errors["white"] == pytest.approx(3.5 * white)
    assert resting.error == pytest.approx(1.3 * white, rel=0.1)
    assert "filtered" not in resting.errors
    asked = []
    replacing.choose(MAIN, 3 * white, linear, asked.append)
    assert [scene.noise.kind for scene in asked] == ["white"]
    # Of a start that moves it is not known how often those overturn that come to rest.
    moving = MAIN.varied(start=Start(0.0, 0.5))
    resting = replacing.choose(moving, 1e-6, lambda scene: (linear(scene)[0], part), lambda _: None)
    assert resting.errors["white"] == pytest.approx(2.0 * white + part)
    assert resting.errors["filtered"] == pytest.approx(chosen[1e-6].error + 0.05 * part)


def test_white_noise_is_not_enough_for_a_block_that_the_band_leaves_at_rest():
    """13 % of the blocks are at rest at first, and overturn no more often than all."""
    noise = BandNoise(0.203**2, (0.0, 26.19), 100, frequencies="stratified")
    scene = MAIN.varied(forcing={"amplitude": 1.23, "frequency": 2.746, "phase": 0.0}, noise=noise)
    choice = replacing.choose(scene, 0.02, linear, lambda _: None)
    assert choice.name != "white"
    overturned = 1.0 - linear(scene.white_equivalent())[0][-1, 0]
    assert choice.errors["white"] == pytest.approx(0.13 * overturned, abs=0.01)
    assert choice.errors["exponential"] < 0.02
    moving = scene.varied(start=Start(0.0, 0.5))
    assert replacing.choose(moving, 0.02, linear, lambda _: None).name == "white"


def test_a_band_that_leaves_out_frequencies_may_act_like_white_noise_of_its_level():
    """[.77, 2.17] with e = .86: .63 of 40,000 paths overturned, .37 under white noise and .36 under low-pass noise."""
    noise = BandNoise(0.038, (0.77, 2.17), 100, frequencies="stratified")
    covered = melnikov.relative_variance(noise)
    choice = replacing.choose(MAIN.varied(noise=noise), 1e-9, linear, lambda _: None)
    assert covered == pytest.approx(0.24, abs=0.01)
    assert min(choice.errors.values()) >= 0.2 * math.log(1.0 / covered) * (1.0 - 1e-9)
    assert choice.errors["white"] >= 0.4 * math.log(1.0 / covered) * (1.0 - 1e-9)


def test_few_harmonics_act_like_their_scatter_and_kurtosis():
    """Survival exp(-c d²), which has both derivatives by the strength d, by sums of harmonics, without a block."""
    square = [d**2 for d in replacing.STRENGTHS]
    assert replacing.second_derivative(square) == pytest.approx(2.0, rel=1e-12)
    scatter, harmonics, c = 0.05, 1000, 0.4
    survivals = [np.array([1.0, math.exp(-c * s)]) for s in square]
    tails = replacing.lighter_tails(scatter, harmonics, survivals)
    kurtosis = 0.5 * (scatter**2 - 1.0 / harmonics)
    changed = 0.5 * ((2.0 * c) ** 2 * scatter**2 - 2.0 * c * kurtosis)
    alone = 0.5 * ((2.0 * c) ** 2 - 2.0 * c) * scatter**2
    assert tails == pytest.approx([0.0, changed - alone], rel=1e-10)


@pytest.mark.parametrize("harmonics", [5, 30])
def test_the_kurtosis_of_a_response_is_three_times_that_of_the_tails(harmonics):
    """4·10⁵ sums of harmonics, seed 5, with the response of e = 1/2: standard error of the kurtosis about .015."""
    noise, rng = BandNoise(1.0, (0.0, 10.0), harmonics), np.random.default_rng(5)
    frequencies, phases = rng.uniform(0.0, (10.0, 2.0 * math.pi), (400_000, harmonics, 2)).transpose(2, 0, 1)
    sums = (np.sqrt(response(frequencies, 0.5)) * np.cos(phases)).sum(axis=1)
    excess = np.mean(sums**4) / np.mean(sums**2) ** 2 - 3.0
    scatter = melnikov.realized_spread(noise, 0.5)
    assert excess == pytest.approx(1.5 * (scatter**2 - 1.0 / harmonics), abs=0.06)


def test_scatter_is_that_of_independent_harmonics_alone():
    assert replacing.scatter_of_strength(MAIN) == pytest.approx(melnikov.realized_spread(MAIN.noise, 0.5))
    assert replacing.scatter_of_strength(MAIN) == pytest.approx(0.243, abs=0.001)
    assert replacing.scatter_of_strength(STRATIFIED) == replacing.scatter_of_strength(MAIN.white_equivalent()) == 0.0


def test_what_few_harmonics_change_is_in_the_density():
    """Survival of 200,000 paths with independent harmonics, exact, seed 7: standard error .0011.

    The second scene has strong noise and 20 cycles; stratified, 8·10⁵ paths: .35441. Here few harmonics change most.
    """
    strong = BandNoise(0.34**2, (0.0, 8.9), 100, frequencies="stratified")
    strong = MAIN.varied(block={"restitution": 0.47}, forcing={"amplitude": 2.07, "frequency": 2.37}, noise=strong)
    scenes = (
        (STRATIFIED, 10, 5e-2, 0.4765, 50, 0.48519, 0.0035),  # .4765: stratified, 2·10⁶ paths
        (strong, 20, 0.1, 0.35441, 20, 0.43370, 0.005),
    )
    for scene, cycles, tol, stratified, harmonics, sampled, within in scenes:
        usual = solve_fpk(scene, cycles=cycles, tol=tol, bins_tol=np.inf, noise_replacement="white").survival[cycles]
        noise = dataclasses.replace(scene.noise, harmonics=harmonics, frequencies="independent")
        density = solve_fpk(scene.varied(noise=noise), cycles=cycles, tol=tol, bins_tol=np.inf)
        assert density.settings["replacement"]["choice"].startswith("white noise is the fastest within")
        assert density.survival[cycles] - usual == pytest.approx(sampled - stratified, abs=within)
        assert abs(density.survival[cycles] - sampled) < density.total_error[cycles, 0] - 3.0 * 0.0011
        assert density.mass_defect < 1e-12
        bins = density.bin_probabilities(cycles, [-2.0, 0.0, 2.0], [-9.0, 9.0])
        assert bins.sum() == pytest.approx(density.survival[cycles], abs=1e-10)
        scatter = density.settings["replacement"]["scatter"]
        assert f"Realizations differ in strength by {scatter:.2g}" in " ".join(density.remarks)
        total = density.total_error.max()
        assert density.trust.verdict == ("ok" if total <= tol else "caution" if total <= 0.1 else "do not use")
        assert not any("not checked" in reason for reason in density.trust.reasons)


@pytest.mark.parametrize(("band", "sigma"), [((1.0, 6.0), 0.2), ((2.0, 10.0), 0.3), ((4.0, 10.0), 0.6)])
def test_no_replacement_is_ok_for_a_band_that_leaves_out_the_frequencies_of_the_block(band, sigma, monkeypatch):
    monkeypatch.setattr(replacing, "REPLACEMENTS", ("white",))  # filtered noise takes long
    noise = BandNoise(sigma**2, band, 100, frequencies="stratified")
    density = solve_fpk(MAIN.varied(noise=noise), cycles=10, tol=1e-2, bins_tol=np.inf)
    # Survival of 200,000 paths, exact, seed 99.
    sampled = {1.0: 0.667, 2.0: 0.922, 4.0: 0.86274}[band[0]]
    assert abs(density.survival[10] - sampled) < density.total_error[10, 0]
    assert density.trust.verdict == "do not use"


def test_the_choice_has_the_density_compiled_first(monkeypatch):
    """One call of helpers counts in a process: that of filtered noise has a tenth of the kernels."""
    asked = []
    monkeypatch.setattr(solver, "start_helpers", lambda *compilations: asked.append(compilations))
    solve_fpk(MAIN, cycles=1, tol=1e-2, bins_tol=np.inf)
    assert asked[0][0] is solver.DENSITY[kind_of(MAIN.block)]


def test_what_needs_no_choice_is_solved_as_it_is():
    white = MAIN.white_equivalent().varied(start=Start(0.0, 0.0, ((0.01, 0.0), (0.0, 0.01))))
    density = solve_fpk(white, cycles=1, tol=1e-2)
    assert "replacement" not in density.settings
    assert density.neglected_error == 0.0
