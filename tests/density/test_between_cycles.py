"""Results within the cycles: densities between steps, on either half of a cycle, and what knows their times."""

import csv
import math

import numpy as np
import pytest
from helpers.filtered_grids import EDGES, MAIN, grid_of

from fpk_rocking import load_scene, solve_fpk
from fpk_rocking.compare import compare
from fpk_rocking.density import Evolution
from fpk_rocking.density.filtered import FilteredPropagator
from fpk_rocking.forcings import Pulse
from fpk_rocking.output import vtk
from fpk_rocking.studies import checked
from montecarlo import simulate
from montecarlo.results.statistics import overturning_rate

SCENE, CYCLES, SAMPLES, PATHS = load_scene("main"), 4, 5, 20_000


@pytest.fixture(scope="module")
def whole():
    return solve_fpk(SCENE, cycles=CYCLES, tol=1e-2, noise_replacement="white")


@pytest.fixture(scope="module")
def between():
    return solve_fpk(SCENE, cycles=CYCLES, samples_per_cycle=SAMPLES, tol=1e-2, noise_replacement="white")


@pytest.fixture(scope="module")
def paths():
    return simulate(SCENE.white_equivalent(), cycles=CYCLES, samples_per_cycle=SAMPLES, realizations=PATHS, seed=4)


def assert_alike(survival, overturned, bins, sample):
    """Largest of some 60 normal variables below 4.2 in all but one of 600 cases; beside it the mesh of tol = 1e-2."""
    for ours, theirs in ((survival, sample.survival), (overturned, sample.overturned)):
        error = np.sqrt(theirs * (1.0 - theirs) / PATHS)
        assert np.all(np.abs(ours - theirs) <= 4.2 * error + 2e-3)
    for row in range(2, len(survival)):
        sampled = sample.bin_probabilities(sample.cycle_of(row), *EDGES)
        floor = np.sqrt(2.0 / math.pi * sampled / PATHS).sum()
        assert np.abs(bins(row) - sampled).sum() < 1.3 * floor + 0.015


def test_a_result_within_the_cycles_has_the_rows_of_whole_cycles_to_the_last_bit(whole, between):
    assert np.array_equal(between.survival[::SAMPLES], whole.survival)
    assert np.array_equal(between.overturned[::SAMPLES], whole.overturned)
    assert np.array_equal(between.coefficients[::SAMPLES], whole.coefficients)
    assert between.times == pytest.approx(SCENE.period * np.arange(CYCLES * SAMPLES + 1) / SAMPLES, rel=1e-15)
    assert np.array_equal(between.times[::SAMPLES], whole.times)


def test_densities_within_the_cycles_are_those_of_sampled_paths(between, paths):
    """On both halves of a cycle, of which one has the mirror images of the steps of the other; and before a step."""
    assert_alike(
        between.survival,
        between.overturned,
        lambda row: between.bin_probabilities(between.cycle_of(row), *EDGES),
        paths,
    )
    assert np.diff(between.survival).max() < 1e-6
    assert np.diff(between.overturned, axis=0).min() > -1e-5
    assert between.mass_defect < 1e-12


def test_filtered_noise_has_densities_within_the_cycles_too():
    run = FilteredPropagator(MAIN, grid_of(MAIN, 1, (8,), 12), 1e-8)
    solution = run.propagate(MAIN.period * np.arange(3 * SAMPLES + 1) / SAMPLES)
    again = FilteredPropagator(MAIN, grid_of(MAIN, 1, (8,), 12), 1e-8).propagate(MAIN.period * np.arange(4))
    assert np.array_equal(solution.survival[::SAMPLES], again.survival)
    sample = simulate(MAIN, cycles=3, samples_per_cycle=SAMPLES, realizations=PATHS, seed=3)
    bins = run.space.bin_integrals(solution.coefficients, *EDGES)
    assert_alike(solution.survival, solution.outflow[:, :2], lambda row: bins[row], sample)
    assert list(solution.resolved) == [False] * SAMPLES + [True] * (2 * SAMPLES + 1)


def test_a_cycle_may_be_a_part_of_one(between):
    assert np.array_equal(between.at(2.4).coefficients, between.coefficients[12])
    assert np.array_equal(between.at(1 / 5).coefficients, between.coefficients[1])
    assert between.at(4).moment(0, 0) == pytest.approx(between.survival[-1])
    for powers, kind in (((-1, 0), ValueError), ((0, 0.5), TypeError)):
        with pytest.raises(kind, match=r"_power: got .*, accepted: a whole number >= 0"):
            between.at(4).moment(*powers)
    assert (between.cycles, between.samples_per_cycle) == (CYCLES, SAMPLES)
    assert [between.when(row) for row in (5, 12)] == ["after 1 cycle", "after 2.4 cycles"]
    for cycle in (0.1, 4.2, -0.2, math.nan):
        with pytest.raises(ValueError, match=r"^cycle: got .*, accepted: (0 to 4 in steps of 1/5|a finite number)"):
            between.bin_probabilities(cycle, *EDGES)
    with pytest.raises(ValueError, match=r"accepted: 0\.2 or later"):
        between.at(0)


def test_files_and_tables_know_the_times(between, tmp_path):
    between.save(tmp_path / "density.npz")
    loaded = Evolution.load(tmp_path / "density.npz")
    assert np.array_equal(loaded.at(2.4).coefficients, between.at(2.4).coefficients)
    loaded.to_csv(tmp_path / "density.csv")
    rows = list(csv.DictReader((tmp_path / "density.csv").open()))
    assert [float(row["cycle"]) for row in rows] == pytest.approx(np.arange(CYCLES * SAMPLES + 1) / SAMPLES)
    assert float(rows[12]["time"]) == between.times[12]
    assert float(rows[12]["survival"]) == between.survival[12]
    dataset = between.to_xarray()
    assert float(dataset.survival.sel(time=between.times[12])) == between.survival[12]
    assert float(dataset.cycle[12]) == pytest.approx(2.4)
    assert between.summary()["samples_per_cycle"] == SAMPLES


def test_a_series_for_viewers_has_all_rows_or_those_that_are_named(between, tmp_path):
    text = vtk.write_series(tmp_path, "all", between).read_text()
    assert text.count("<DataSet") == CYCLES * SAMPLES + 1
    assert f'timestep="{float(between.times[12])!r}"' in text
    assert vtk.write_series(tmp_path, "some", between, [0.2, 4]).read_text().count("<DataSet") == 2
    assert (tmp_path / "some_0001.vtu").exists()
    assert f'Name="cycle">{2.4!r}<' in (tmp_path / "all_0012.vtu").read_text()


def test_comparisons_and_rates_are_of_whole_cycles(whole, between, paths):
    compared, usual = compare(paths, between), compare(paths, whole)
    assert np.array_equal(compared.difference, usual.difference)
    assert np.array_equal(compared.l1, usual.l1)
    assert compared.cycles.tolist() == list(range(CYCLES + 1))
    rate = overturning_rate(paths, after=2)
    left = np.count_nonzero(paths.overturn_time > 2 * SCENE.period)
    assert rate.count == left


def test_the_check_of_the_noise_has_paths_at_all_times(between):
    measured = checked(between, realizations=2000)
    assert measured.total_error.shape == (CYCLES * SAMPLES + 1, 3)
    sample = simulate(SCENE, cycles=CYCLES, realizations=2000, seed=2)
    assert measured.replacement.difference[::SAMPLES, 0] == pytest.approx(
        sample.survival - between.survival[::SAMPLES], abs=1e-12
    )


def test_samples_are_refused_where_nothing_repeats():
    pulse = SCENE.varied(forcing=Pulse("one-sine", 2.0, 2.0))
    refusal = r"^samples_per_cycle: got 4, accepted: nothing, as a pulse has no cycles"
    with pytest.raises(ValueError, match=refusal):
        solve_fpk(pulse, samples_per_cycle=4)
    with pytest.raises(ValueError, match=refusal):
        simulate(pulse, samples_per_cycle=4, realizations=10)
    with pytest.raises(ValueError, match=r"^samples_per_cycle: got 0"):
        solve_fpk(SCENE, cycles=1, samples_per_cycle=0)
