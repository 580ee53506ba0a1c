"""Pulses and records as values: their formulas, particular solution, and what refuses them."""

import json
import math
import pathlib

import numpy as np
import pytest
from transient_paths import SHAPES, pulse_force, random_scene, record_force

from fpk_rocking import (
    Block,
    CycleOperator,
    Dimensions,
    Harmonic,
    NoNoise,
    Pulse,
    Record,
    Scene,
    WhiteNoise,
    load_scene,
)
from fpk_rocking.analytics import melnikov
from fpk_rocking.cli import main
from fpk_rocking.physics.forcing.readers.components import MOST
from fpk_rocking.scene import ranges
from montecarlo import Ensemble, Tally, histories, simulate, tally
from montecarlo.poincare import mean_poincare_map, restarted_poincare_map
from montecarlo.results.statistics import overturning_rate
from montecarlo.splitting import split

ROOT = pathlib.Path(__file__).parents[2]
SIZE = Dimensions(0.6, 2.0)
SAMPLES = np.random.default_rng(3).normal(size=60)
RECORD = Record(0.01, SAMPLES, "g", 0.3)
PULSES = [Pulse(shape, 2.0, 3.0, 3 if shape == "n-sine" else None) for shape in SHAPES]
SHAKEN = Scene(Block(dimensions=SIZE), RECORD, NoNoise())


@pytest.mark.parametrize("forcing", [*PULSES, SHAKEN.forcing], ids=str)
def test_pieces_are_the_force_and_a_smooth_bounded_particular_solution(forcing):
    force, kinks = record_force(RECORD, SIZE) if forcing.kind == "record" else pulse_force(forcing)
    assert forcing.duration == pytest.approx(kinks[-1], rel=1e-13)
    # The bounded solution is -½ ∫ exp(-|τ-s|) f(s) ds: sums over pieces with 12 Gauss points.
    points, weights = np.polynomial.legendre.leggauss(12)
    edges = np.linspace(0.0, forcing.duration, 590 + 1)
    half, s = 0.5 * np.diff(edges)[0], 0.5 * np.diff(edges)[0] * (1.0 + points) + edges[:-1, None]
    values = np.vectorize(force)(s)
    for time in (edges[0], edges[37], edges[211], edges[-1], edges[-1] + 1.3):
        bounded = -0.5 * half * (values * weights * np.exp(-np.abs(time - s))).sum()
        assert forcing.particular(time)[0] == pytest.approx(bounded, abs=1e-12)
    assert forcing.particular(500.0) == pytest.approx((0.0, 0.0), abs=1e-100)
    for instant in (0.0, edges[300] + 0.3 * half, forcing.duration):
        piece = np.polynomial.Polynomial(forcing.pieces([instant])[0])
        for late in np.linspace(0.0, min(forcing.longest_piece, 1.2 * half), 5):
            assert (piece(late), piece.deriv()(late)) == pytest.approx(forcing.particular(instant + late), abs=1e-12)
            assert piece.deriv(2)(late) - piece(late) == pytest.approx(forcing.value(instant + late), abs=1e-11)
            if 0.0 < instant + late < forcing.duration:
                assert forcing.value(instant + late) == pytest.approx(force(instant + late), abs=1e-11)
    assert forcing.value(forcing.duration) == 0.0


@pytest.mark.parametrize("forcing", [*PULSES, SHAKEN.forcing], ids=str)
def test_bounds_hold_and_are_near(forcing):
    times = np.linspace(0.0, forcing.duration, 40_001)[:-1]
    values = forcing.values(times)
    assert np.abs(values).max() <= forcing.largest * (1.0 + 1e-12)
    assert np.abs(values).max() == pytest.approx(forcing.largest, rel=2e-3)
    slopes = np.abs(np.diff(values)) / times[1]
    assert slopes.max() <= forcing.steepest * (1.0 + 1e-9)
    assert slopes.max() >= 0.98 * forcing.steepest
    p, q = forcing.pieces(times)[:, :2].T
    drift = max(np.abs(p + q).max(), np.abs(p - q).max())
    assert drift <= forcing.swing <= 1.4 * drift + 0.03
    above = np.abs(values) > 1.0
    rises = times[np.flatnonzero(above & ~np.append(False, above[:-1]))]
    for time in times[::1777]:
        elapsed, slope = forcing.since_lift_off(time)
        before = rises[rises <= time]
        if before.size:
            assert elapsed == pytest.approx(time - before[-1], abs=2.0 * times[1])
            assert slope == pytest.approx(abs(forcing.slope(time - elapsed)))
        else:
            assert elapsed == math.inf
    assert (forcing.period, forcing.half_antisymmetric, forcing.longest_rest) == (None, False, math.inf)
    spacing = forcing.spacing(0.013)
    assert spacing <= 0.013
    assert forcing.unit / spacing == pytest.approx(round(forcing.unit / spacing), abs=1e-9)


@pytest.mark.parametrize("start", [0.0, SHAKEN.forcing.unit, 0.4 * SHAKEN.forcing.duration])
def test_a_piece_over_next_to_no_time_is_the_force_there(start):
    piece = np.polynomial.Polynomial(SHAKEN.forcing.particular_over(start, 1e-9))
    assert piece.deriv(2)(0.0) - piece(0.0) == pytest.approx(SHAKEN.forcing.value(start), abs=1e-11)


def test_one_sine_is_an_n_sine_of_one_cycle_and_two_are_longer():
    one_sine, n_sine = Pulse("one-sine", 2.0, 3.0), Pulse("n-sine", 2.0, 3.0, 1)
    times = np.linspace(0.0, 3.0, 31)
    assert np.array_equal(one_sine.values(times), n_sine.values(times))
    assert Pulse("n-sine", 2.0, 3.0, 2).duration == pytest.approx(2.0 * one_sine.duration)


def test_a_record_scales_with_the_block():
    forcing, larger = SHAKEN.forcing, SHAKEN.varied(block=Block(0.8, Dimensions(1.2, 4.0)))
    assert forcing.largest == pytest.approx(0.3 * 9.80665 * np.abs(SAMPLES).max() / (9.80665 * SIZE.critical_angle))
    assert forcing.duration == pytest.approx(0.59 * SIZE.frequency_parameter)
    assert larger.forcing.duration == pytest.approx(forcing.duration / math.sqrt(2.0))
    assert larger.forcing.largest == pytest.approx(forcing.largest)
    assert SHAKEN.varied(forcing={"scale": 0.6}).forcing.largest == pytest.approx(2.0 * forcing.largest)
    metric = Record(0.01, SAMPLES * 9.80665, "m/s2", 0.3)
    assert np.array_equal(np.round(metric.for_size(SIZE).forces, 12), np.round(forcing.forces, 12))


def test_scenes_go_through_toml_and_blocks(tmp_path):
    (tmp_path / "motion.txt").write_text(
        "# made up\n" + "".join(f"{0.01 * k:.3f} {a!r}\n" for k, a in enumerate(SAMPLES.tolist()))
    )
    text = (
        "[block]\n[block.dimensions]\nwidth = 0.6\nheight = 2.0\n[forcing]\nkind = 'record'\nfile = 'motion.txt'\n"
        "units = 'g'\nscale = 0.3\n[noise]\nkind = 'none'\n"
    )
    (tmp_path / "scene.toml").write_text(text)
    scene = load_scene(tmp_path / "scene.toml")
    assert scene.forcing.source == "motion.txt"
    assert scene.block.restitution == SIZE.restitution
    assert scene.forcing.interval == pytest.approx(0.01, rel=1e-12)
    scene = scene.varied(forcing={"interval": 0.01})
    assert scene == SHAKEN
    assert hash(scene) == hash(SHAKEN)
    # The text form holds the samples, so results need no file.
    assert Scene.from_toml(scene.to_toml()) == SHAKEN
    assert Scene.from_toml(scene.to_toml()).forcing.source == "motion.txt"
    assert Scene.from_block(0.6, 2.0, record=RECORD) == SHAKEN
    for pulse in PULSES:
        pulsed = Scene(Block(0.8), pulse, WhiteNoise(0.01))
        assert Scene.from_toml(pulsed.to_toml()) == pulsed
    pulsed = Scene.from_block(0.6, 2.0, 4.0, 1.5, pulse="n-sine", pulse_cycles=2)
    assert pulsed.forcing == Pulse("n-sine", SIZE.amplitude(4.0), SIZE.frequency(1.5), 2)


def test_results_go_through_files_and_checkpoints(tmp_path):
    times = [0.5, 1.25, 4.0]
    ensemble = simulate(SHAKEN, times=times, realizations=3)
    ensemble.save(tmp_path / "ensemble.npz")
    again = Ensemble.load(tmp_path / "ensemble.npz")
    assert again.scene == SHAKEN
    assert again.times.tolist() == [0.0, *times]
    assert again.cycles is None
    assert again.angle.tobytes() == ensemble.angle.tobytes()
    path = tmp_path / "tally.npz"
    tally(SHAKEN, times=times, realizations=3, checkpoint=path)
    counted = tally(SHAKEN, times=times, realizations=5, checkpoint=path)
    assert counted.realizations == 5
    assert Tally.load(path).times.tolist() == [0.0, *times]
    with pytest.raises(ValueError, match=r"checkpoint: got .* with 3 times up to 4, accepted: 2 times up to 4"):
        tally(SHAKEN, times=times[1:], realizations=5, checkpoint=path)


def test_the_command_line_takes_times(tmp_path, capsys):
    path = tmp_path / "scene.toml"
    path.write_text(SHAKEN.to_toml())
    assert main(["mc", str(path), "--times", "0.5", "1.25", "--realizations", "3", "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed["times"] == [0.0, 0.5, 1.25]
    assert "cycles" not in printed
    assert main(["mc", str(path), "--realizations", "3"]) == 0
    assert capsys.readouterr().out.count("\n") > 22
    assert main(["mc", str(path), "--cycles", "3"]) == 2
    assert "cycles: got 3, accepted: nothing, as a record has no cycles; use times" in capsys.readouterr().err
    assert main(["mc", str(ROOT / "cases" / "scenes" / "main.toml"), "--times", "3"]) == 2
    assert "this forcing repeats" in capsys.readouterr().err


def test_the_record_of_the_project_is_what_its_script_makes(case):
    script = case("records/synthetic")
    record = Record.from_file(script.PATH)
    assert record.samples == pytest.approx(script.acceleration(), abs=1e-8)
    assert (record.interval, len(record.samples), np.abs(record.samples).max()) == (0.01, 4001, pytest.approx(0.35))
    scene = load_scene(ROOT / "cases" / "scenes" / "record.toml")
    assert scene.forcing == record.__class__(0.01, record.samples, "g", 1.3).for_size(scene.block.dimensions)
    assert scene.block.restitution == scene.block.dimensions.restitution


def test_times_stand_in_place_of_cycles():
    pulsed, periodic = Scene(Block(0.8), PULSES[0], NoNoise()), Scene(Block(0.8), Harmonic(2.0, 3.0), NoNoise())
    default = simulate(pulsed, realizations=1)
    assert default.times == pytest.approx(
        [*np.linspace(0.0, pulsed.forcing.duration, 21), pulsed.forcing.duration + 10.0]
    )
    assert default.angle.shape == (1, 22)
    assert simulate(periodic, cycles=3, realizations=1).times == pytest.approx(periodic.period * np.arange(4))
    for wrong in ([], [1.0, 1.0], [-1.0, 2.0], [0.0], [1.0, math.inf], [math.nan], [[1.0, 2.0]], 3.0):
        with pytest.raises(ValueError, match="times: got"):
            simulate(pulsed, times=wrong, realizations=1)
    for wrong in ("abc", [[1.0], [2.0, 3.0]], [1j]):
        with pytest.raises(TypeError, match="times: got"):
            simulate(pulsed, times=wrong, realizations=1)
    with pytest.raises(ValueError, match=r"times: got .* this forcing repeats"):
        simulate(periodic, cycles=2, times=[1.0], realizations=1)
    with pytest.raises(ValueError, match="cycles: got 3, accepted: nothing, as a pulse has no cycles"):
        simulate(pulsed, cycles=3, realizations=1)
    with pytest.raises(TypeError, match="cycles: got None"):
        simulate(periodic, realizations=1)
    with pytest.raises(ValueError, match="samples_per_cycle: got 5, accepted: nothing, as a pulse has no cycles"):
        histories(pulsed, samples_per_cycle=5)
    with pytest.raises(ValueError, match="cycle: got 22, accepted: a whole number from 0 to 21"):
        default.bin_probabilities(22, [-1.0, 1.0], [-1.0, 1.0])


def test_what_needs_a_cycle_refuses_a_forcing_without():
    noisy = Scene(Block(0.8), PULSES[0], WhiteNoise(0.01))
    quiet = Scene(Block(0.8), PULSES[0], NoNoise())
    ensemble = simulate(quiet, realizations=1)
    calls = (
        lambda: CycleOperator(noisy),
        lambda: split(noisy, cycles=1),
        lambda: restarted_poincare_map(quiet, cycles=1, realizations=1),
        lambda: mean_poincare_map(ensemble),
        lambda: overturning_rate(ensemble, 1),
        lambda: histories(quiet).poincare(),
        lambda: melnikov.harmonic_amplitude(PULSES[0]),
        lambda: melnikov.phase_flux(PULSES[0], 0.8, NoNoise()),
        lambda: melnikov.process_mean(PULSES[0], 0.8, 0.0),
    )
    for call in calls:
        with pytest.raises(
            ValueError, match=r"forcing.kind: got 'pulse', accepted: 'harmonic' or 'harmonics', as .* is only defined"
        ):
            call()


def test_bad_values_are_refused_by_name():
    for make, says in (
        (lambda: Record(0.01, [0.0] * (MOST + 1), "g"), "forcing.samples: got 'an array of shape"),
        (lambda: Record(0.01, [1.0], "g"), "forcing.samples: got"),
        (lambda: Record(0.01, [1.0, math.inf], "g"), r"forcing.samples\[1\]: got inf"),
        (lambda: Record(0.0, [1.0, 2.0], "g"), "forcing.interval: got 0.0"),
        (lambda: Record(0.01, [1.0, 2.0], "kip"), "forcing.units: got 'kip', accepted: 'g' or 'm/s2' or 'cm/s2'"),
        (lambda: Record(0.01, [1.0, 2.0], "g", math.nan), "forcing.scale: got nan"),
        (lambda: Pulse("two-sine", 1.0, 1.0), "forcing.shape: got 'two-sine', accepted: 'one-sine'"),
        (lambda: Pulse("one-sine", 1.0, 1.0, 2), "forcing.cycles: got 2, accepted: nothing"),
        (lambda: Pulse("n-sine", 1.0, 1.0, 1001), "forcing.cycles: got 1001, accepted: a whole number from 1 to 1000"),
        (lambda: Pulse("one-sine", -1.0, 1.0), "forcing.amplitude: got -1.0"),
        (
            lambda: Scene(Block(0.8), RECORD, NoNoise()),
            "block.dimensions: missing, required for a forcing of kind 'record'",
        ),
        (lambda: RECORD.duration, "block.dimensions: missing"),
        (Block, "block.restitution: missing"),
        (lambda: ranges.check(SHAKEN.varied(forcing={"scale": 1e6})), "forcing.scale: got 1000000.0, accepted: acc"),
        (
            lambda: Scene.from_block(0.6, 2.0, 4.0, record=RECORD),
            "peak_acceleration: got 4.0, accepted: nothing where",
        ),
    ):
        with pytest.raises(ValueError, match=says):
            make()
    with pytest.raises(TypeError, match=r"forcing.samples"):
        Record(0.01, "abc", "g")
    with pytest.raises(ValueError, match="at most 4194304 intervals"):
        simulate(SHAKEN, times=[1e6], realizations=1)


def test_random_scenes_for_the_engines_are_of_all_kinds():
    kinds = {getattr(scene.forcing, "shape", scene.forcing.kind) for scene in map(random_scene, range(7))}
    assert kinds == {*SHAPES, "record"}
