"""`solve_fpk` and its result: what is refused, what is reported, what is saved."""

import dataclasses
import math
import pathlib
import time

import numpy as np
import pytest

from fpk_rocking import Evolution, load_scene, solve_fpk
from fpk_rocking.density.evolution import near_rest
from fpk_rocking.density.refinement import SOLUTIONS, ProgressCount
from fpk_rocking.density.space import Space
from fpk_rocking.physics.noise.equivalence import equivalent_diffusion
from fpk_rocking.results.remarks import remarks
from fpk_rocking.scene import Block, NoNoise, Start, WhiteNoise
from fpk_rocking.studies import checked

SCENES = pathlib.Path(__file__).parents[2] / "cases" / "scenes"
MAIN = load_scene(SCENES / "main.toml")


def test_the_total_of_the_progress_grows_with_every_solution_beyond_those_known():
    reports = []
    count = ProgressCount(lambda *pair: reports.append(pair), rows=2)
    for _ in range(SOLUTIONS + 1):
        done = count.start_solution()
        done()
        done()
    first_total, more = 2 * SOLUTIONS, 2 * SOLUTIONS + 2
    assert reports == [(k, first_total if k <= first_total else more) for k in range(1, more + 1)]


@pytest.mark.parametrize(
    ("start", "first"), [(Start(0.004, -0.09), 1.0), (Start(0.006), 0.0), (Start(0.0, 0.11), 0.0), (None, 0.25)]
)
def test_a_density_near_rest_is_within_small_angles_and_velocities(start, first):
    """A uniform one on a rectangle four times as large as that of rest."""
    space = Space(np.array([-0.01, 0.01]), np.array([-0.2, 0.2]), 0)
    coefficients = np.full((2, 1, 1, 1, 1), 1.0 / (0.02 * 0.4))
    spread = Start(0.0, 0.0, ((1e-4, 0.0), (0.0, 1e-4)))
    assert near_rest(space, coefficients, start or spread) == pytest.approx([first, 0.25])


@pytest.fixture(scope="module")
def band():
    return solve_fpk(MAIN, cycles=2, tol=1e-2, noise_replacement="white")


@pytest.fixture(scope="module")
def gaussian():
    start = Start(0.4, -0.3, ((0.02, 0.001), (0.001, 0.05)))
    return solve_fpk(dataclasses.replace(MAIN.white_equivalent(), start=start), cycles=1, tol=1e-2)


def test_band_noise_is_solved_as_its_white_equivalent_and_says_so(band):
    began = time.perf_counter()
    white = solve_fpk(MAIN.white_equivalent(), cycles=2, tol=1e-2)
    elapsed = time.perf_counter() - began
    assert 0.5 * elapsed < white.wall_s <= elapsed
    assert band.scene == MAIN
    assert band.diffusion == equivalent_diffusion(MAIN.noise)
    assert band.noise_replacement.startswith("Band noise (variance 0.04 on [0, 10]) was replaced by white noise")
    assert white.noise_replacement == ""
    assert white.coefficients.tobytes() == band.coefficients.tobytes()


def test_shapes_and_honesty_figures(band):
    assert (band.cycles, band.survival.shape, band.overturned.shape, band.truncated.shape) == (2, (3,), (3, 2), (3,))
    assert band.survival[0] == 1.0
    assert np.all(band.overturned[0] == 0.0)
    assert 0.0 < band.error_estimate < 1e-2
    assert 0.0 < band.negative_mass < 1e-2
    assert band.mass_defect < 1e-12
    assert band.settings["unknowns"] == band.space.unknowns
    for edge, half_width in zip(band.at(1).mesh_lines, (np.pi / 2, band.settings["velocity_bound"]), strict=True):
        assert np.array_equal(edge, -edge[::-1])
        assert 0.0 in edge
        assert edge[-1] == pytest.approx(half_width, rel=1e-15)


def test_bins_hold_the_survival(band):
    bins = band.bin_probabilities(2, np.linspace(-1.6, 1.6, 33), np.linspace(-4.0, 4.0, 41))
    assert bins.shape == (32, 40)
    assert bins.sum() == pytest.approx(band.survival[2], abs=1e-12)
    assert band.bin_probabilities(np.int64(2), [-np.inf, np.inf], [-np.inf, np.inf]) == pytest.approx(bins.sum())
    corner = band.bin_probabilities(2, [0.0, 0.5], [-1.0, 0.0])[0, 0]
    assert corner == pytest.approx(bins[16:21, 15:20].sum(), abs=1e-13)


def test_a_point_has_bins_but_no_density(band):
    bins = band.bin_probabilities(0, [-1.0, 0.0, 1.0], [-0.5, 0.5, 1.5])
    assert bins.tolist() == [[0.0, 0.0], [1.0, 0.0]]
    with pytest.raises(ValueError, match="cycle: got 0, accepted: 1 or later; this start is a point"):
        band.at(0)


def test_a_gaussian_start_can_be_looked_at(gaussian):
    assert gaussian.at(0).mean == pytest.approx([0.4, -0.3], abs=1e-3)
    assert gaussian.bin_probabilities(0, [-2.0, 2.0], [-4.0, 4.0]) == pytest.approx(1.0, abs=1e-3)


@pytest.mark.parametrize("cycle", [-1, 3, 1.0, True, None, "1"])
def test_refuses_cycles_that_are_not_there(band, cycle):
    for call in (band.at, lambda k: band.bin_probabilities(k, [0.0, 1.0], [0.0, 1.0])):
        with pytest.raises((TypeError, ValueError), match=r"cycle: got .*, accepted: a whole number from 0 to 2"):
            call(cycle)


@pytest.mark.parametrize("edges", [[0.0], [0.0, 0.0], [1.0, 0.0], [[0.0, 1.0]], [0.0, np.nan, 1.0], []])
def test_refuses_bad_edges(band, edges):
    with pytest.raises(ValueError, match=r"angle_edges: got .*, accepted: two or more numbers"):
        band.bin_probabilities(1, edges, [0.0, 1.0])
    with pytest.raises(ValueError, match=r"velocity_edges: got .*, accepted: two or more numbers"):
        band.bin_probabilities(1, [0.0, 1.0], edges)


def test_refuses_what_has_no_density():
    for restitution in (0.0, 0.163033534821580):
        scene = dataclasses.replace(MAIN, block=Block(restitution))
        with pytest.raises(
            ValueError, match=r"block\.restitution: got 0\..*, accepted: above 0\.16303 under white noise"
        ):
            solve_fpk(scene, cycles=1, noise_replacement="white")
    for noise in (NoNoise(), WhiteNoise(0.0)):
        with pytest.raises(ValueError, match=r"noise: got .*, accepted: noise of a variance or diffusion above 0"):
            solve_fpk(dataclasses.replace(MAIN, noise=noise), cycles=1)


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        ({"scene": "main.toml"}, TypeError, "scene: got 'main.toml'"),
        ({"cycles": 0}, ValueError, "cycles: got 0"),
        ({"cycles": 1.5}, TypeError, r"cycles: got 1\.5"),
        ({"cycles": True}, TypeError, "cycles: got True"),
        ({"tol": 1e-5}, ValueError, r"tol: got 1e-05, accepted: .*>= 0\.0001"),
        ({"tol": float("nan")}, ValueError, "tol: got nan"),
        ({"tol": "fine"}, TypeError, "tol: got 'fine'"),
    ],
)
def test_refuses_bad_arguments(arguments, error, message):
    with pytest.raises(error, match=message):
        solve_fpk(**{"scene": MAIN, "cycles": 1} | arguments)


def test_saved_result_is_loaded_whole(gaussian, tmp_path):
    path = tmp_path / "result.npz"
    gaussian.save(path)
    loaded = Evolution.load(path)
    assert [file.name for file in tmp_path.iterdir()] == ["result.npz"]
    for field in dataclasses.fields(Evolution):
        before, after = getattr(gaussian, field.name), getattr(loaded, field.name)
        if isinstance(before, np.ndarray):
            assert before.tobytes() == after.tobytes()
        elif field.name != "space":
            assert before == after
    points = np.linspace(-1.5, 1.5, 30), np.linspace(-2.0, 2.0, 41)[:, None]
    assert np.array_equal(gaussian.at(1)(*points), loaded.at(1)(*points))


def test_progress_is_told_and_can_interrupt():
    seen = []
    solve_fpk(MAIN, cycles=2, tol=1e-2, progress=lambda done, total: seen.append((done, total)))
    assert seen[-1] == (6, 6)
    assert [done for done, _ in seen] == sorted({done for done, _ in seen})

    def interrupt(_done, _total):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        solve_fpk(MAIN, cycles=2, tol=1e-2, progress=interrupt)


def test_a_point_that_is_no_number_has_no_density(band):
    density = band.at(1)
    assert np.isnan(density([np.nan, 0.3, 0.3], [0.1, np.nan, 0.1])).tolist() == [True, True, False]
    assert np.isnan(density.marginal_angle([np.nan, 0.3])).tolist() == [True, False]


def test_it_knows_what_was_asked_for_and_judges_itself(band, tmp_path):
    facts = band.metadata
    assert (facts["tol"], facts["bins_tol"]) == (1e-2, pytest.approx(0.1 / 3.0))
    assert facts["bins_error_estimate"] == band.bins_error_estimate
    band = checked(band)

    def against(result):
        """Names of what speaks against it; P(overturned) = .0024 ± .0014 is small beside its error."""
        return [diagnostic.name for diagnostic in result.diagnostics if diagnostic.severity]

    assert against(band) == ["overturning_error"]
    assert band.table()["at_rest"].tolist() == band.at_rest.tolist()
    assert len(repr(band)) < 300
    loose = dataclasses.replace(band, settings=band.settings | {"bins_tol": np.inf}, bins_error_estimate=0.9)
    assert against(loose) == ["overturning_error"]
    loose.save(tmp_path / "loose.npz")
    assert "bins_tol" not in Evolution.load(tmp_path / "loose.npz").metadata
    assert against(dataclasses.replace(band, bins_error_estimate=0.9)) == ["overturning_error", "bins_error_estimate"]


def test_a_probability_below_0_is_told(band):
    overturned = band.overturned.copy()
    overturned[1, 0] = -2e-6
    below = dataclasses.replace(band, overturned=overturned, error_estimate=3e-6)
    sentence = "A probability of overturning is -2e-06: take it as 0, within the error 3e-06."
    assert [text for text in remarks(below) if "below" in text or "take it as 0" in text] == [sentence]
    assert band.below_zero == ""


@pytest.mark.parametrize(
    ("rows", "where", "verdict"), [([1], "1 of 2 times", "ok"), ([1, 2], "every time", "caution"), ([], None, "ok")]
)
def test_rows_whose_density_is_not_judged_are_told(band, rows, where, verdict):
    """Where bins are judged: with a tolerance of inf nobody asked for them."""
    settings = band.settings | {"unresolved": rows, "bins_tol": 1.0}
    with_bins, survival_alone = (
        dataclasses.replace(band, noise_replacement="", settings=settings | {"bins_tol": most})
        for most in (1.0, math.inf)
    )
    sentence = (
        f"The density of angle and velocity is too narrow for the mesh at {where}: only survival is judged there."
    )
    assert [text for text in remarks(with_bins) if "narrow" in text] == [sentence] * (where is not None)
    assert with_bins.trust.verdict == verdict
    assert survival_alone.unjudged == ""
    assert survival_alone.trust.verdict == "ok"


def test_bins_that_part_blocks_at_rest_are_told(band):
    """A quarter of the largest share at rest, where that is above the stated error of the bins."""
    settings = band.settings | {"bins_tol": 1.0}
    rests = dataclasses.replace(band, at_rest=np.array([1.0, 0.2, 0.1]), bins_error_estimate=0.01, settings=settings)
    assert [text for text in remarks(rests) if "may be off by 0.05 in all (L1)" in text] == [rests.parted]
    for change in (
        {"bins_error_estimate": 0.051},
        {"rests_exactly": True},
        {"settings": settings | {"bins_tol": math.inf}},
    ):
        assert dataclasses.replace(rests, **change).parted == ""


def test_a_replacement_that_was_checked_is_saved_and_tabulated(band, tmp_path):
    density = checked(band, realizations=500)
    density.save(tmp_path / "checked.npz")
    loaded = Evolution.load(tmp_path / "checked.npz")
    assert loaded.replacement.plain == density.replacement.plain
    assert (loaded.trust, loaded.title) == (density.trust, density.title)
    columns = loaded.table()
    assert columns["survival_total_error"].tolist() == density.total_error[:, 0].tolist()
    assert columns["survival_replacement"].tolist() == density.replacement.difference[:, 0].tolist()
    assert columns["survival_replacement_error"].tolist() == density.replacement.sampling_error[:, 0].tolist()
    assert "survival_total_error" not in band.table()


def test_a_density_says_what_it_is(band):
    assert repr(band.at(2)).startswith(f"<Density: probability {band.survival[2]:.4f} on ")
