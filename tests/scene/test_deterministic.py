"""Scenes without chance: one path decides, nothing has an interval, and every output says so."""

import dataclasses
import json
import math
import re

import fakes
import numpy as np
import pytest
from scipy.integrate import quad

from fpk_rocking import BandNoise, Block, FilteredNoise, Harmonic, NoNoise, Scene, Start, WhiteNoise, cli
from fpk_rocking.compare import compare
from fpk_rocking.output import figures, tables
from montecarlo import histories, mean_poincare_map, overturning_rate, restarted_poincare_map, simulate, tally
from montecarlo.engines import exact_block, exact_slender

MAIN = Scene(Block(0.5), Harmonic(4.6, 2.7, math.pi), BandNoise(0.04, (0.0, 10.0), 100))
QUIET = MAIN.varied(noise=NoNoise())
FALL = Scene.from_block(0.5, 1.8, 0.0, 1.5, start=Start(-1.1))
"""Beyond the critical angle and at rest it falls freely until the cut-off π/2."""


def _fall():
    """Time of the fall from its energy: with φ the angle beyond the critical one, dτ = dφ / √(2 (cos φ₀ - cos φ))."""
    angle = FALL.block.critical_angle
    first, last = 0.1 * angle, (0.5 * math.pi - 1.0) * angle

    def slowness(root):
        sines = math.sin(0.5 * (2.0 * first + root * root)) * math.sin(0.5 * root * root)
        return 2.0 * root / math.sqrt(4.0 * sines)

    return quad(slowness, 0.0, math.sqrt(last - first), epsabs=0.0, epsrel=1e-13)[0]


FALLEN = _fall()


def test_a_scene_without_noise_and_spread_is_deterministic():
    spread = Start(0.0, 0.0, ((0.01, 0.0), (0.0, 0.01)))
    silent = BandNoise(0.0, (0.0, 10.0), 100), WhiteNoise(0.0), FilteredNoise("exponential", 0.0, 1.0), NoNoise()
    for noise in silent:
        assert MAIN.varied(noise=noise).deterministic
        assert not MAIN.varied(noise=noise, start=spread).deterministic
    for noise in (BandNoise(1e-9, (0.0, 10.0), 100), WhiteNoise(1e-9), FilteredNoise("exponential", 1e-9, 1.0)):
        assert not MAIN.varied(noise=noise).deterministic


def test_one_path_is_computed_however_many_are_wanted(monkeypatch):
    """Noise of strength 0 still draws its frequencies, but they make no difference."""
    rows = []

    def watch(engine):
        computed = engine.simulate

        def watched(keys, numbers, cycle, parameters, angle, *others):
            rows.append((engine.file.stem, *numbers.tolist(), len(angle)))
            computed(keys, numbers, cycle, parameters, angle, *others)

        monkeypatch.setitem(vars(engine), "simulate", watched)

    engines = exact_slender.ENGINE, exact_block.ENGINE
    for engine in engines:
        watch(engine)
    for scene in (QUIET, MAIN.varied(noise={"variance": 0.0}), FALL):
        single = simulate(scene, cycles=5)
        many = simulate(scene, cycles=5, realizations=200)
        assert single.angle.shape == (1, 6)
        for name in ("angle", "velocity", "overturn_time", "overturn_side"):
            copies = getattr(many, name)
            assert copies.shape[0] == 200
            assert np.array_equal(copies, np.repeat(getattr(single, name), 200, axis=0), equal_nan=True)
        listed = histories(scene, cycles=5, realizations=3)
        assert np.array_equal(listed.impact_time, np.tile(histories(scene, cycles=5).impact_time, 3))
        counted = tally(scene, cycles=5, realizations=200)
        assert np.array_equal(counted.survival, single.survival)
        assert counted.realizations == 200
    assert {*rows} == {(engine.file.stem, 0, 1) for engine in engines}


def test_a_number_is_required_where_there_is_chance():
    for run in (simulate, tally, restarted_poincare_map):
        with pytest.raises(TypeError, match="realizations: got None, accepted: a whole number"):
            run(MAIN, cycles=1)


def test_the_outcome_is_the_time_of_a_free_fall():
    seconds = FALL.block.dimensions.seconds(FALLEN)
    path = simulate(FALL, cycles=2)
    assert path.overturn_time[0] == pytest.approx(FALLEN, rel=1e-12)
    assert path.metadata["outcome"] == f"deterministic: overturns to the left at τ = {FALLEN:.4g} ({seconds:.3g} s)"
    pattern = r"deterministic: overturns to the left between τ = (\S+) \((\S+) s\) and τ = (\S+) \((\S+) s\)"
    low, low_s, high, high_s = map(float, re.fullmatch(pattern, tally(FALL, cycles=2).metadata["outcome"]).groups())
    assert low < FALLEN < high
    assert high - low == pytest.approx(FALL.period / 20, rel=0.01)
    assert low_s < seconds < high_s
    right = FALL.varied(start=Start(1.1))
    assert "to the right at" in simulate(right, cycles=2).metadata["outcome"]
    assert "to the right between" in tally(right, cycles=2).metadata["outcome"]
    for run in (simulate, tally):
        assert run(QUIET, cycles=2).metadata["outcome"] == f"deterministic: stands until τ = {2 * QUIET.period:.4g}"
        assert "outcome" not in run(MAIN, cycles=2, realizations=10).metadata
        weak = QUIET.varied(forcing=dataclasses.replace(QUIET.forcing, amplitude=1.0))  # lifts nothing off
        assert run(weak, cycles=2).metadata["outcome"] == f"deterministic: rests until τ = {2 * QUIET.period:.4g}"
        rocks = weak.varied(start=Start(0.1))
        assert "deterministic: stands until" in run(rocks, cycles=2).metadata["outcome"]


@pytest.mark.parametrize("run", [simulate, tally])
def test_no_output_has_an_interval(run, tmp_path, capsys):
    path = run(FALL, cycles=2, realizations=50)
    assert np.array_equal(path.survival_interval(), np.stack([path.survival] * 2, axis=-1))
    assert path.survival.tolist() == [1.0, 1.0, 0.0]
    with pytest.raises(ValueError, match="level: got"):
        path.survival_interval(2.0)
    values = path.summary()
    assert values["outcome"] == path.metadata["outcome"]
    assert not {"interval", "half_width"} & values.keys()
    assert not [name for name in path.table() if name.endswith(("low", "high"))]
    assert "survival_interval" not in path.variables
    tables.show(*tables.result_table(path))
    assert "95 %" not in capsys.readouterr().out
    assert path.title == f"Monte Carlo exact, one path, {path.metadata['outcome']}"
    assert "95 %" not in path._repr_html_()
    assert path.plot("survival").axes[0].get_legend_handles_labels()[1] == ["Monte Carlo exact, one path"]
    assert "seed" not in " ".join(tables.result_table(path)[2]).lower()
    figures.survival_figure(tmp_path / "one.png", [path, run(FALL, cycles=2, method="rk4")], "One path")


def test_comparing_paths_knows_no_chance():
    first, second = simulate(QUIET, cycles=5), simulate(QUIET, cycles=5, method="rk4")
    compared = compare(first, second)
    assert compared.realizations == (None, None)
    assert np.isnan(compared.z).all()
    assert np.isnan(compared.interval).all()
    assert not compared.standard_error.any()
    assert compared.trust.verdict == "caution"
    assert compared.trust.reasons[0].startswith("Monte Carlo rk4: Deterministic: one path, by the time steps")
    assert not any("seed" in text for text in compare(first, first).remarks)
    assert compare(first, fakes.FakeEvolution(MAIN, cycles=5)).realizations == (None, None)
    compared.plot()


def test_maps_of_one_path_have_no_error_and_no_rate():
    path = simulate(QUIET, cycles=5)
    for mapped in (mean_poincare_map(path), restarted_poincare_map(QUIET, cycles=5)):
        assert np.array_equal(mapped.points[:, 0], path.angle[0])
        assert not mapped.standard_error.any()
    with pytest.raises(ValueError, match="ensemble: got 'a deterministic scene', accepted: a scene with noise"):
        overturning_rate(path, 1)


def test_histories_are_judged_by_their_method():
    assert histories(QUIET, cycles=1).trust.verdict == "ok"
    assert histories(QUIET, cycles=1, method="rk4").trust.verdict == "caution"
    assert histories(MAIN, cycles=1).trust.reasons == ("These are single paths: nothing is estimated from them.",)


def test_the_command_line_says_what_happens(tmp_path, capsys):
    file = tmp_path / "fall.toml"
    file.write_text(FALL.to_toml(), encoding="utf-8")
    outcome = simulate(FALL, cycles=2).metadata["outcome"]
    assert cli.main(["mc", str(file), "--cycles", "2", "--report", str(tmp_path / "fall.html")]) == 0
    text = capsys.readouterr().out
    seconds = FALL.block.dimensions.seconds(2 * FALL.period)
    answer = f"P(overturned) = 1 (one path), after 2 cycles ({seconds:.4g} s)"
    assert text.startswith(f"{answer}\nMonte Carlo exact, one path: no noise, {outcome}\n")
    assert "trust: ok. Deterministic: one path, exact but for rounding errors" in text
    page = (tmp_path / "fall.html").read_text(encoding="utf-8")
    assert outcome in page
    assert "95 %" not in page
    assert cli.main(["mc", str(file), "--cycles", "2", "--json"]) == 0
    values = json.loads(capsys.readouterr().out)
    assert (values["outcome"], values["realizations"]) == (outcome, 1)
    scaled = ["fragility", str(file), "--scales", "1,2", "--cycles", "2"]
    assert cli.main(scaled) == 0
    text = capsys.readouterr().out
    assert text.startswith("Fragility by exact, one path a point\n")
    assert "95 %" not in text
