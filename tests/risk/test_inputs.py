"""Uncertain blocks, synthetic motions and the order of intensity measures, each against what it was made of."""

import json
import math

import numpy as np
import pytest
from scipy import stats

from fpk_rocking import BandNoise, Block, Dimensions, NoNoise, Record, Scene, cli
from fpk_rocking.envelopes import Trapezoid
from fpk_rocking.risk import IntensityCurve, drawn, fragility, intensities, ranked, synthetic_records
from fpk_rocking.risk.capacities import Capacities
from fpk_rocking.risk.curves import Fragility

SIZE = Dimensions(0.6, 2.0)
SCENE = Scene.from_block(0.6, 2.0, "0.4 g", 1.5, noise_rms_acceleration=0.3, noise_band_hz=(0.0, 8.0))
SCALES = np.geomspace(0.1, 3.0, 15)


def test_draws_are_stratified_and_set_in_their_order():
    uncertain = {"size_factor": "lognormal:1.1:0.05", "block.restitution_factor": stats.uniform(0.93, 0.05)}
    result = drawn([SCENE, SCENE.varied(forcing={"amplitude": 2.0})], uncertain, 25, seed=4)
    assert result.origin == (0,) * 25 + (1,) * 25
    assert [scene.forcing.kind for scene in result.scenes] == ["harmonic"] * 50
    laws = stats.lognorm(0.05, scale=1.1), stats.uniform(0.93, 0.05)
    for law, values in zip(laws, result.values.values(), strict=True):
        assert np.sort(np.floor(50 * law.cdf(values))).tolist() == list(range(50))
    for scene, factor, part in zip(result.scenes, *result.values.values(), strict=True):
        size = scene.block.dimensions
        assert size.half_diagonal == pytest.approx(factor * SIZE.half_diagonal, rel=1e-12)
        assert size.width / size.height == pytest.approx(0.3, rel=1e-12)
        assert scene.block.restitution == pytest.approx(part * size.restitution, rel=1e-12)
    assert drawn(SCENE, uncertain, 5, seed=9) == drawn(SCENE, uncertain, 5, seed=9)
    assert drawn(SCENE, uncertain, 5, seed=9).values != drawn(SCENE, uncertain, 5, seed=8).values
    draw = drawn(SCENE, {"width": stats.uniform(0.5, 0.3)}, 1)
    assert draw.scenes[0].block.dimensions.width == draw.values["width"][0] != 0.6


@pytest.mark.parametrize(
    ("uncertain", "message"),
    [
        ({}, r"^uncertain: got \{\}"),
        ({"width": "uniform:1:1"}, r"^uncertain\['width'\]: got 'uniform:1:1', accepted: 'uniform:LOW:HIGH'"),
        ({"width": "gamma:1:2"}, r"^uncertain\['width'\]: got 'gamma:1:2'"),
        (
            {"width": "beta:2:3"},
            r"^uncertain\['width'\]: got 'beta:2:3', accepted: .*, 'beta:A:B:LOW:HIGH', with LOW below HIGH",
        ),
        ({"width": "beta:2:0:0.5:0.7"}, r"^uncertain\['width'\]: got 'beta:2:0:0.5:0.7'"),
        ({"width": "beta:2:3:0.7:0.5"}, r"^uncertain\['width'\]: got 'beta:2:3:0.7:0.5'"),
        ({"width": "normal:1:inf"}, r"^uncertain\['width'\]: got 'normal:1:inf'"),
        ({"width": "normal:1"}, r"^uncertain\['width'\]: got 'normal:1'"),
        ({"width": 3}, r"^uncertain\['width'\]: got 3"),
        ({"weight": "normal:1:2"}, r"^parameter: got 'weight'"),
        ({"block.mass_factor": "normal:1:2"}, r"^uncertain: got 'block\.mass_factor', .* such as 'width_factor'$"),
        (
            {"restitution_factor": "uniform:0.93:1"},
            r"^uncertain: got 'restitution_factor', .*; did you mean block\.restitution_factor\?$",
        ),
        ({"slendernes_factor": "uniform:0.8:1"}, r"^uncertain: got .*; did you mean slenderness_factor\?$"),
        ({"restitution": "uniform:0.8:1"}, r"^parameter: got 'restitution', .*; did you mean block\.restitution\?$"),
        (
            {"block.restitution": "uniform:0.8:1.2"},
            r"^uncertain\['block\.restitution'\]: got 'uniform:0\.8:1\.2', .*: it drew 1\.[01]\d+ \(block\..*: got ",
        ),
        (
            {"block.restitution_factor": "uniform:1:1.5"},
            r"^uncertain\['block\.restitution_factor'\]: .*: it drew 1\.\d+ \(block\.restitution: got 1\.\d+, accepted",
        ),
        (
            {"width": "uniform:0.95:1.05"},
            r"^uncertain\['width'\]: got 'uniform:0\.95:1\.05', .* the scene's own value, 0\.6, or 'width_factor' for",
        ),
        ({"size": "normal:2:0.1"}, r"^uncertain\['size'\]: .* value, 1\.044, or 'size_factor'"),
        (
            {"block.restitution": "lognormal:0.6:0.05"},
            r"^uncertain\['block\.restitution'\]: .*'block\.restitution_factor'",
        ),
    ],
)
def test_what_is_no_distribution_is_refused_by_name(uncertain, message):
    with pytest.raises((TypeError, ValueError), match=message):
        drawn(SCENE, uncertain, 3)


def test_values_of_a_beta_distribution_have_its_mean_and_ends():
    """Latin hypercube sampling: the mean of 1,000 is off by far less than .001."""
    values = np.array(drawn(SCENE, {"width": "beta:2:6:0.5:0.9"}, 1000).values["width"])
    assert values.mean() == pytest.approx(0.5 + 0.4 * 2.0 / 8.0, abs=1e-3)
    assert values.std() == pytest.approx(0.4 * math.sqrt(12.0 / (64.0 * 9.0)), rel=0.01)
    assert 0.5 < values.min() < values.max() < 0.9


@pytest.mark.parametrize(
    "uncertain",
    [
        {"width": "uniform:0.6:0.7"},
        {"height": "uniform:1.9:2"},
        {"width": "normal:0.639:0.01"},
        {"width": f"lognormal:{0.6 * math.exp(0.039)}:0.01"},
        {"block.restitution_factor": "uniform:0.9:0.95"},
        {"start.angle": "uniform:0.1:0.2"},
    ],
    ids=str,
)
def test_a_distribution_may_end_at_the_own_value_and_have_factors_beside_one(uncertain):
    """Up to 4 deviations away, here 3.9; a value that is 0 has no multiples, so that any distribution is taken."""
    assert len(drawn(SCENE, uncertain, 2).scenes) == 2


def test_dispersions_are_those_that_the_values_were_given():
    """Capacities m exp(.3 x - .1 y + .25 u) with curves of β .2: regression finds .3 and .1, and none for z.

    u is not among the values. Its standard error is .25/√400 = .0125 a term: 4 of them, false alarm 1e-4.
    """
    rng = np.random.default_rng(3)
    x, y, z, u = rng.standard_normal((4, 400))
    medians = 0.6 * np.exp(0.3 * x - 0.1 * y + 0.25 * u)
    scale, values = np.geomspace(0.05, 8.0, 25), {"x": np.exp(x), "y": y, "z": z}
    for shares, trials in (
        (stats.norm.cdf(np.log(scale / medians[:, None]) / 0.2), 0),
        ((scale > medians[:, None]).astype(float), 1),  # deterministic blocks
    ):
        capacities = Capacities.of(scale, shares, trials, np.arange(400))
        result = capacities.parts(capacities.draws(50, rng)[1], values)
        assert {name: value for name, (value, _) in result.items()} == pytest.approx(
            {"x": 0.3, "y": 0.1, "z": 0.0}, abs=0.05
        )
        assert [error for _, error in result.values()] == pytest.approx([0.0125] * 3, rel=0.2)


def test_uncertain_restitution_widens_a_curve_on_the_command_line(capsys, tmp_path):
    file = tmp_path / "block.toml"
    file.write_text(SCENE.to_toml())
    arguments = ["fragility", str(file), "--scales", "1,2,4", "--cycles", "3", "--realizations", "40"]
    drawing = ["--uncertain", "block.restitution=uniform:0.6:0.95", "--blocks", "6", "--json"]
    assert cli.main([*arguments, *drawing]) == 0
    printed = capsys.readouterr().out
    draws = drawn(SCENE, {"block.restitution": "uniform:0.6:0.95"}, 6)
    curves = fragility(draws.scenes, scale=(1.0, 2.0, 4.0), cycles=3, realizations=40)
    values, curve = json.loads(printed), IntensityCurve.of(curves, "scale", draws=draws)
    assert values["overturned"] == curves.overturned.tolist()
    assert values["pooled"]["probability"] == curve.probability.tolist()
    assert values["pooled"]["sources"] == curve.sources
    assert curve.units == 6
    assert cli.main([*arguments[:2], "--scales", "1,2", "--uncertain", "size_factor=uniform:0.9:1.1", "--blocks", "3",
                     "--cycles", "1", "--realizations", "5"]) == 0  # fmt: skip
    printed = " ".join(capsys.readouterr().out.split())
    assert "against scale, from 3 blocks" in printed
    assert "From 3 blocks, the probabilities for others of their kind are known to ±" in printed
    for wrong in (["--pga", "0.4"], ["--blocks", "3"], ["--uncertain", "x"], [*drawing, "--over", "width=1,2"]):
        assert cli.main([*arguments, *wrong]) == 2
        assert "accepted: " in capsys.readouterr().err


def test_synthetic_motions_have_the_spectrum_and_the_strength_that_they_were_asked_for():
    """60 stationary motions of 30 s: variance to 10 %, spectrum in four bands to 15 %: above 4 standard errors.

    Of the variance 4 the filter leaves what its gain says.
    """
    options = {"duration": 40.0, "spread": 0.0, "envelope": Trapezoid(1.0, 100.0, 1.0), "rms": 2.0}
    motions = synthetic_records(60, **options, frequency_hz=2.0, damping=0.5)
    samples = np.array([motion.samples for motion in motions])[:, 1000:]
    frequencies = 2.0 * np.pi * np.fft.rfftfreq(samples.shape[1], 0.01)
    power = (np.abs(np.fft.rfft(samples)) ** 2).mean(axis=0)
    soil, low = 4.0 * np.pi, 2.0 * np.pi * 0.24
    r, q = frequencies / soil, frequencies / low
    soil_shape = (1.0 + r**2) / ((1.0 - r**2) ** 2 + r**2)
    shape = soil_shape * q**4 / ((1.0 - q**2) ** 2 + (1.2 * q) ** 2)
    # Above the highest frequency of the samples a spectrum 1/r² goes on.
    beyond = soil_shape[-1] * frequencies[-1] / (frequencies[1] - frequencies[0])
    assert samples.var() == pytest.approx(4.0 * (shape.sum() + beyond) / (soil_shape.sum() + beyond), rel=0.1)
    bands = np.searchsorted(frequencies, 2.0 * np.pi * np.array([0.05, 0.5, 1.5, 3.0, 8.0]))
    parts = np.add.reduceat(power, bands)[:4] / power[bands[0] : bands[-1]].sum()
    wanted = np.add.reduceat(shape, bands)[:4] / shape[bands[0] : bands[-1]].sum()
    assert parts == pytest.approx(wanted, rel=0.15)


def test_synthetic_motions_come_to_rest_and_differ():
    motions = synthetic_records(12, seed=5)
    assert motions == synthetic_records(12, seed=5)
    assert len({motion.samples for motion in motions}) == 12
    velocity = np.cumsum([motion.samples for motion in motions], axis=1) * 0.01
    assert np.abs(velocity[:, -1]).max() < 0.02 * np.abs(velocity).max(axis=1).min()
    frequencies = [float(motion.source.split()[-2]) for motion in motions]
    assert 0.15 < np.log(frequencies).std() < 0.8  # .4, of 12
    rising = np.array([motion.samples for motion in synthetic_records(200, duration=10.0, spread=0.0)])
    strength = rising.std(axis=0)
    assert strength[40] == pytest.approx(0.4, rel=0.3)  # on the ramp of a second
    assert strength[150:350].mean() == pytest.approx(1.0, rel=0.1)
    with pytest.raises(ValueError, match=r"^rms: got 0, "):
        synthetic_records(1, rms=0)


def test_the_measure_that_outcomes_follow_comes_first():
    """Pulses of one PGA and many frequencies whose blocks overturn by their velocity, and the other way round."""
    scenes = []
    for hertz in np.geomspace(0.5, 4.0, 8):
        samples = np.sin(2.0 * np.pi * hertz * np.arange(0.0, 1.0 / hertz, 0.01))
        scenes.append(Scene(Block(0.9, SIZE), Record(0.01, samples, "m/s2"), BandNoise(0.01, (0.0, 9.0), 9)))
    strengths = [intensities(scene) for scene in scenes]
    for field, first in (("pgv", "PGV, m/s"), ("pga", "PGA, g")):
        values = np.array([getattr(strength, field) for strength in strengths])[:, None] * SCALES
        shares = stats.norm.cdf(np.log(values / np.median(values)) / 0.3)[:, None]
        curves = Fragility(
            tuple(scenes), "scene", np.arange(8.0), np.empty(0), SCALES, shares, np.full(shares.shape, np.nan),
            "exact", 1000, True, {}, "", {}, 0.0,
        )  # fmt: skip
        rankings = ranked(curves)
        assert {ranking.measure for ranking in rankings} == {
            "PGA, g",
            "PGV, m/s",
        }  # p PGV/(g tan θ_cr) is PGV for one block
        assert rankings[0].deviance == pytest.approx(0.0, abs=1e-6)
        if field == "pga":
            assert rankings[0].measure == first
            assert rankings[0].dispersion == pytest.approx(0.3, rel=1e-6)
            assert rankings[1].deviance > 5.0
        else:
            assert rankings[0].measure == first
            assert rankings[1].deviance > 5.0
    assert ranked(fragility(scenes[0].varied(noise=NoNoise(), block=Block(0.9, SIZE)), scale=(0.1, 0.2))) == []
