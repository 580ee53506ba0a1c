"""Motions of a study: scaled to an intensity, and named in the lines of a table."""

import dataclasses

import pytest
from suites import SIZE, record

from fpk_rocking import BandNoise, Block, Harmonic, NoNoise, Scene, cli
from fpk_rocking.risk import at_intensity, critical_intensities, synthetic_records
from fpk_rocking.risk.motions import intensities, intensity_of, motion_lines, recorded_scenes


def test_scenes_at_an_intensity_have_it():
    scene = Scene(Block(0.9, SIZE), record(1), BandNoise(0.01, (0.0, 10.0), 30))
    for measure, field, unit in (("PGA", "pga", 9.80665), ("PGV", "pgv", 1.0)):
        there = at_intensity(scene, measure, 0.4)
        assert getattr(intensities(there), field) == pytest.approx(0.4 * unit, rel=1e-12)
        assert intensity_of(there, measure) == pytest.approx(0.4, rel=1e-12)
        factor = 0.4 / intensity_of(scene, measure)
        assert there.noise.variance == pytest.approx(0.01 * factor**2, rel=1e-12)
        assert at_intensity(scene, measure, 0.4, noise=False).noise == scene.noise
    with pytest.raises(ValueError, match=r"^measure: got 'PGD', accepted: 'PGA', 'PGV'"):
        at_intensity(scene, "PGD")
    with pytest.raises(ValueError, match=r"^measure: got 'pga', .*; did you mean PGA\?$"):
        at_intensity(scene, "pga")
    with pytest.raises(ValueError, match=r"^scene: got .* a block with dimensions"):
        at_intensity(Scene(Block(0.9), Harmonic(1.0, 2.0), NoNoise()))


def test_a_scale_is_not_said_to_be_a_multiple_of_the_motion(tmp_path, capsys):
    """Without noise, at scales of PGA in g: the critical scale in the terminal is the critical PGA of the motion."""
    block = Scene(Block(0.9, SIZE), Harmonic(1.0, 2.0), NoNoise())
    (tmp_path / "rack.toml").write_text(block.to_toml())
    samples = record(1).samples
    (tmp_path / "a.txt").write_text("\n".join(f"{0.02 * k:.2f} {a!r}" for k, a in enumerate(samples)))
    words = ["fragility", str(tmp_path / "rack.toml"), "--records", str(tmp_path / "a.txt"), "--units", "m/s2"]
    printed = {}
    for option, scales in (("--pga", "0.2:3:4"), ("--scales", "0.5:20:4")):
        assert cli.main([*words, option, scales]) == 0
        printed[option] = " ".join(capsys.readouterr().out.split())
    scene = dataclasses.replace(block, forcing=record(1))
    critical = critical_intensities(scene, highest=3.0, measure="PGA")
    assert "a.txt: scaled to PGA 1 g: PGA 1 g, PGV " in printed["--pga"]
    assert f"critical at PGA {critical.critical[0]:.4g} g" in printed["--pga"]
    assert "PGA, g PGV, m/s overturned" in printed["--pga"]
    assert "scale PGA, g PGV, m/s overturned" in printed["--scales"]
    own = intensities(scene)
    assert f"a.txt: at scale 1 PGA {own.pga / 9.80665:.3g} g, PGV {own.pgv:.3g} m/s, " in printed["--scales"]
    assert f"critical at scale {critical.factor[0]:.4g}" in printed["--scales"]
    assert "times its own" not in printed["--pga"] + printed["--scales"]


def test_band_noise_has_enough_harmonics_for_each_motion_and_not_for_the_placeholder():
    """20 Hz for 2 to 40 s; a number that the user chose stays."""
    motions = [synthetic_records(1, duration=duration, seed=3)[0] for duration in (2.0, 4.0, 8.0, 16.0, 40.0)]
    noise = {"noise_rms_acceleration": 0.3, "noise_band_hz": (0.0, 20.0)}
    for placeholder in ({"record": motions[-1]}, {"peak_acceleration": "0.3 g", "frequency_hz": "1.5 Hz"}):
        rack = Scene.from_block(0.5, 1.8, **placeholder, **noise)
        harmonics = [shaken.noise.harmonics for shaken in recorded_scenes(rack, motions)]
        assert harmonics == pytest.approx([100, 100, 160, 320, 800], abs=1)
        chosen = Scene.from_block(0.5, 1.8, **placeholder, **noise, harmonics=150)
        assert {shaken.noise.harmonics for shaken in recorded_scenes(chosen, motions)} == {150}


def test_a_motion_that_overturns_the_block_does_so_in_seconds():
    strong = dataclasses.replace(record(1), scale=10.0)
    suite = critical_intensities(Scene(Block(0.9, SIZE), strong, NoNoise()), [strong])
    (line,) = motion_lines(suite.table(), "PGV")
    seconds = SIZE.seconds(float(suite.overturn_time[0]))
    assert f"overturns to the {suite.table()['overturn_side'][0]} at {seconds:.4g} s, critical at PGV" in line
    # A block without a size knows no seconds.
    harmonic = Scene(Block(0.9), Harmonic(9.0, 2.0), NoNoise())
    found = critical_intensities(harmonic, measure="scale", cycles=20)
    assert f" at τ = {found.overturn_time[0]:.4g}, critical" in motion_lines(found.table(), "scale")[0]
