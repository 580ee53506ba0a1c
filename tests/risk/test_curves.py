"""Fragility: counts against direct runs and whole histories, engines against each other, results kept and shown."""

import concurrent.futures
import csv
import dataclasses
import io
import json
import math
import types

import numpy as np
import pytest
from rich.console import Console
from scipy import stats

from fpk_rocking.results.trust import CAUTION, Diagnostic
from fpk_rocking.risk import Fragility, fragility
from fpk_rocking.risk.picture import curves_figure, fragility_table, message, surface_figure
from fpk_rocking.scene import NoNoise, Pulse, Scene, WhiteNoise
from fpk_rocking.studies import scaled
from fpk_rocking.studies.execution import seed_of
from montecarlo import Ensemble, histories, simulate

SCALE = 0.5, 0.8, 1.1, 1.4
BLOCK = Scene.from_block(0.6, 2.4, 3.0, 1.5, noise_rms_acceleration=0.3, noise_band_hz=(0.0, 5.0))

WHITE = dataclasses.replace(BLOCK, noise=WhiteNoise(0.01))


@pytest.fixture(scope="module")
def curve(main_scene):
    return fragility(main_scene, scale=SCALE, cycles=5, levels=(0.5, 1.0), realizations=2000, seed=3)


def test_counts_are_those_of_the_engine(main_scene, curve):
    assert (curve.engine, curve.realizations, curve.probability.shape) == ("exact", 2000, (1, 3, 4))
    for number, scale in enumerate(SCALE):
        seed = seed_of(3, number)
        direct = simulate(scaled(main_scene, scale), cycles=5, realizations=2000, seed=seed)
        assert curve.overturned[0, number] == np.count_nonzero(direct.overturn_side) / 2000


def test_levels_are_the_largest_angles_of_histories(main_scene, curve):
    """Samples miss the tops between them, so a few more of the same realizations reach a level than they tell."""
    assert np.all(np.diff(curve.probability[0, [0, 2, 1]], axis=0) >= 0.0)  # nested: the same realizations
    for number, scale in enumerate(SCALE[:3]):
        run = histories(
            scaled(main_scene, scale), cycles=5, realizations=2000, seed=seed_of(3, number), samples_per_cycle=100
        )
        over = np.isnan(run.angle).any(axis=1)
        top = np.nanmax(np.abs(run.angle), axis=1)
        for which, level in enumerate(curve.level):
            share = np.count_nonzero((top >= level) | over) / 2000
            assert share <= curve.reached[0, which, number] <= share + 0.005


def test_intervals_are_those_of_a_binomial(curve):
    limits = curve.interval()[0, 0]
    count = curve.overturned[0] * 2000
    assert np.all((limits[:, 0] <= curve.overturned[0]) & (curve.overturned[0] <= limits[:, 1]))
    some = (count > 10) & (count < 1990)
    exact = stats.beta.ppf([[0.025], [0.975]], [count, count + 1], [2001 - count, 2000 - count]).T
    assert np.allclose(limits[some], exact[some], atol=0.002)


def test_scenes_and_levels_share_random_numbers_as_told(main_scene):
    """Levels and values of a parameter share them; scenes given one by one, and scales, do not."""
    options = {"scale": (1.0, 1.0 + 1e-12), "cycles": 4, "realizations": 3000}
    first, other = fragility([main_scene, main_scene], **options).overturned
    assert np.all(first != other)
    assert first[0] != first[1]
    twice = fragility(main_scene, over={"noise.harmonics": (100, 100)}, **options).overturned
    assert np.array_equal(twice[0], twice[1])
    assert twice[0, 0] != twice[0, 1]


def test_density_against_paths(main_scene):
    """Within its own estimate and 4.5 standard errors: one of 40,000 choices of the seed is further at one of four."""
    white = main_scene.varied(noise=WhiteNoise(0.006))
    options = {"scale": (0.6, 1.0), "cycles": 3, "levels": (0.6,)}
    paths = fragility(white, realizations=20_000, **options)
    density = fragility(white, engine="density", tol=5e-3, **options)
    share = (paths.probability * 20_000 + 1.0) / 20_002
    noise = np.sqrt(share * (1.0 - share) / 20_000)
    assert np.all(np.abs(paths.probability - density.probability) <= 4.5 * noise + density.error_estimate)
    assert paths.engine == "white"
    assert density.realizations == 0


def test_a_surface_over_size(main_scene):
    curves = fragility(BLOCK, scale=(1.0, 2.0, 4.0), over={"size": (0.6, 1.2)}, cycles=4, realizations=1000)
    assert (curves.axis, curves.place.tolist()) == ("size", [0.6, 1.2])
    assert np.all(np.diff(curves.overturned, axis=0) <= 0.0)  # the larger block stands better
    with pytest.raises(ValueError, match="accepted: a fragility of one scene, or of a list of scenes"):
        _ = curves.pooled  # the values share random numbers
    with pytest.raises(ValueError, match="parameter: got 'size', accepted: only where the scene has"):
        fragility(main_scene, scale=(1.0,), over={"size": (0.6, 1.2)}, cycles=4)


def test_motions_that_end_and_their_mean():
    """Without noise a pulse overturns a block or not: one realization, and of four pulses a share."""
    scenes = [
        dataclasses.replace(BLOCK, noise=NoNoise(), forcing=Pulse("one-sine", 2.0, w)) for w in (1.0, 1.5, 2.0, 4.0)
    ]
    curves = fragility(scenes, scale=np.geomspace(0.4, 6.0, 12))
    assert curves.realizations == 1
    assert set(np.unique(curves.overturned)) == {0.0, 1.0}
    for fits, outcomes in zip(curves.fits, curves.overturned, strict=True):
        first, count = outcomes.argmax(), round(outcomes.sum())
        where = "from {:.4g} on" if count == 12 - first else "first at {:.4g}"
        where = ("{:.4g}" if count == 1 else where).format(curves.scale[first])
        assert fits[0].reason.startswith(f"nothing is random; it happens at {count} of 12 scales: {where}")
    again = fragility(scenes, scale=np.geomspace(0.4, 6.0, 12), times=[50.0])
    assert np.array_equal(again.overturned, curves.overturned)
    with pytest.raises(ValueError, match="cycles: got 3, accepted: nothing, as a"):
        fragility(scenes, scale=(1.0,), cycles=3)


PULSES = [
    dataclasses.replace(BLOCK, noise=NoNoise(), forcing=Pulse("one-sine", 2.0, w)) for w in (1.0, 1.5, 2.0, 2.5, 4.0)
]
"""One after the other they overturn from higher scales on."""


@pytest.fixture(scope="module")
def outcomes():
    return fragility(PULSES, scale=np.geomspace(0.4, 6.0, 12))


def test_outcomes_have_no_bars_and_hidden_curves_are_told(tmp_path, outcomes):
    assert np.array_equal(outcomes.interval(), np.stack([outcomes.probability] * 2, axis=-1))
    assert outcomes.trust.verdict == "ok"
    assert outcomes.trust.reasons[0].startswith("Deterministic: one path, exact but for rounding errors")
    assert fragility(PULSES[0], scale=(1.0, 2.0), engine="rk4").trust.verdict == "caution"
    figure = outcomes.plot()
    assert figure.get_suptitle() == "The first 3 of 5 curves"
    assert not any(axes.containers for axes in figure.axes)
    assert dataclasses.replace(outcomes, scenes=(*PULSES[:4], BLOCK)).deterministic.tolist() == [True] * 4 + [False]
    mixed = fragility([BLOCK, BLOCK.varied(noise=NoNoise())], scale=(1.0, 2.0, 3.0), cycles=4, realizations=50)
    assert [bool(axes.containers) for axes in mixed.plot().axes] == [True, False]
    title, table, _ = fragility_table(mixed)
    assert title == "Fragility by exact, 50 realizations a point"
    assert list(table.columns[-1].cells)[3:] == ["exact"] * 3
    title, table, sentences = fragility_table(outcomes)
    assert title == "Fragility by exact, one path a point"
    assert [column.header for column in table.columns] == ["motion", "scale", "PGA, g", "PGV, m/s", "overturned"]
    assert not any(sentence.startswith("p:") for sentence in sentences)
    curves_figure(tmp_path / "curves.png", [outcomes], "Outcomes")


def test_the_mean_of_motions_is_a_curve_for_others_of_their_kind(outcomes):
    pooled = outcomes.pooled
    assert np.array_equal(pooled.probability, outcomes.overturned.mean(axis=0))
    assert np.array_equal(pooled.intensity, outcomes.scale)
    assert (pooled.records, pooled.units, pooled.unit, pooled.scenes) == (5, 5, "", tuple(PULSES))
    assert np.all(np.diff(pooled.interval)[2:4] > 0.3)  # five motions tell little of others
    assert pooled.fit.median_interval[0] < pooled.fit.median < pooled.fit.median_interval[1]
    assert pooled.trust.verdict == "caution"
    half = 0.5 * np.diff(pooled.point_limits).max()
    assert (
        f"From 5 motions, the probabilities for others of their kind are known to ±{half:.2g} at worst (95 %)."
        in pooled.trust.reasons
    )
    assert json.dumps(pooled.summary(), allow_nan=False)
    probability = outcomes.probability.copy()
    probability[2, 0, 3] = np.nan
    holed = dataclasses.replace(outcomes, probability=probability, reasons={"2,0,3": "ValueError: refused"}).pooled
    assert np.array_equal(holed.intensity, np.delete(outcomes.scale, 3))
    assert "no answer for 1 of 60 probabilities: ValueError: refused" in " ".join(holed.trust.reasons)


def test_doubts_are_grouped_by_their_code_and_sentences_by_nothing(monkeypatch):
    """Remarks on two noises begin alike, and two doubts of one kind do not."""
    noise = {"variance": 0.02, "remark": "Measured: here."}, {"variance": 0.02, "remark": "Measured: there."}
    scenes = [BLOCK.varied(noise=kind) for kind in noise]
    curves = fragility(scenes, scale=(1.0, 2.0), cycles=1, realizations=20)
    assert curves.remarks[:2] == ("Measured: here.", "Measured: there.")

    def diagnosed(scene, *_, **__):
        size = scene.noise.remark
        return [
            Diagnostic(CAUTION, f"Wide: {size}", "wide"),
            Diagnostic(CAUTION, f"Wide: of {size}", "other"),
            Diagnostic(1, "Bare."),
        ]

    monkeypatch.setattr("fpk_rocking.risk.curves.scene_diagnostics", diagnosed)
    reasons = [reason for reason in dataclasses.replace(curves, wall_s=2.0).trust.reasons if "half width" not in reason]
    assert [reason for reason in reasons if "fit" not in reason] == [
        "Wide: Measured: here. (The same holds for 1 of the others.)",
        "Wide: of Measured: here. (The same holds for 1 of the others.)",
        "Bare.",
    ]


def test_what_an_engine_refuses_is_a_hole_with_its_reason(main_scene):
    curves = fragility(
        main_scene.varied(noise=WhiteNoise(0.01)), scale=(1e-6, 1.0, 1.2, 1.4), cycles=2, realizations=500
    )
    assert np.isnan(curves.overturned[0]).tolist() == [True, False, False, False]
    assert "noise.diffusion: got 1e-14" in curves.reasons["0,0,0"]
    assert any(text.startswith("The engine gave no answer for 1 of 4") for text in curves.remarks)
    assert not curves.fits[0][0].reason
    limits = curves.interval()
    assert np.isnan(limits[0, 0, 0]).all()
    assert json.dumps(curves.summary(), allow_nan=False)


def test_a_scene_that_needs_another_noise(main_scene):
    for engine in ("white", "filtered"):
        curves = fragility(main_scene, scale=(1.0,), cycles=2, engine=engine, realizations=100)
        direct = getattr(main_scene, f"{engine}_equivalent")()
        seed = seed_of(1, 0)
        assert curves.overturned[0, 0] == 1.0 - simulate(direct, cycles=2, realizations=100, seed=seed).survival[-1]
        assert any(f"{engine} noise of equal Melnikov variance" in text for text in curves.remarks)


def test_a_curve_for_noise_that_was_replaced_is_never_ok():
    for engine, verdict in (("white", "caution"), ("exact", "ok")):
        curves = fragility(BLOCK, scale=(0.5, 1.0), cycles=1, engine=engine, realizations=2000)
        assert curves.trust.verdict == verdict
        assert any(text.startswith("Replaced, not checked") for text in curves.remarks) == (engine == "white")


def test_only_the_forcing_may_be_scaled(main_scene):
    curves = fragility(main_scene, scale=(1.2,), cycles=4, realizations=400, scale_noise=False)
    direct = main_scene.varied(forcing={"amplitude": 1.2 * 4.6})
    assert (
        curves.overturned[0, 0] == 1.0 - simulate(direct, cycles=4, realizations=400, seed=seed_of(1, 0)).survival[-1]
    )


def test_saved_and_loaded(tmp_path, curve):
    curve.save(tmp_path / "curve.npz")
    loaded = Fragility.load(tmp_path / "curve.npz")
    for field in dataclasses.fields(Fragility):
        before, after = getattr(curve, field.name), getattr(loaded, field.name)
        assert np.array_equal(before, after, equal_nan=True) if isinstance(before, np.ndarray) else before == after, (
            field.name
        )
    with pytest.raises(ValueError, match="read-only"):
        loaded.probability[0] = 1.0
    with pytest.raises(ValueError, match="got a result of kind 'fragility', accepted: 'ensemble'"):
        Ensemble.load(tmp_path / "curve.npz")


def test_a_store_makes_the_same_of_two_halves(tmp_path, main_scene, curve):
    def stop(done, _):
        if done == 5:
            raise KeyboardInterrupt

    options = {"cycles": 5, "levels": (0.5, 1.0), "realizations": 2000, "seed": 3, "store": tmp_path / "rows.jsonl"}
    with pytest.raises(KeyboardInterrupt):
        fragility(main_scene, scale=SCALE, progress=stop, **options)
    with concurrent.futures.ThreadPoolExecutor(2) as pool:
        curves = fragility(main_scene, scale=SCALE, workers=pool, **options)
    assert np.array_equal(curves.probability, curve.probability)


def test_csv_and_xarray(tmp_path, curve):
    curve.to_csv(tmp_path / "curve.csv")
    rows = list(csv.DictReader((tmp_path / "curve.csv").read_text().splitlines()))
    assert len(rows) == 12
    assert [float(row["probability"]) for row in rows[::3]] == curve.overturned[0].tolist()
    assert float(rows[0]["relative_velocity"]) == pytest.approx(0.5 * 4.6 / 2.7)
    xarray = pytest.importorskip("xarray")
    data = curve.to_xarray()
    assert isinstance(data, xarray.Dataset)
    assert data.probability.sel(scene=0, level=1.0).values.tolist() == curve.reached[0, 1].tolist()


@pytest.mark.parametrize(
    ("overturned", "title"),
    [
        # Half is reached in the middle of a step, along the logarithm of the scale.
        ([[0.25, 0.75, 1.0]], "Half of the blocks overturn at scale 1.41: PGA at 1.41"),
        ([[0.25, math.nan, 0.75]], "Half of the blocks overturn at scale 2: PGA at 2.00"),
        ([[0.25, 0.75, 1.0], [0.0, 0.25, 0.75]], "Half of the blocks overturn at scales from 1.41 to 2.83"),
        ([[0.0, 0.1, 0.4]], "From 0 to 40 % of the blocks overturn"),
    ],
)
def test_the_title_of_a_picture_is_where_half_overturn(overturned, title):
    measure = types.SimpleNamespace(at=lambda scale: f"PGA at {scale:.2f}")
    result = types.SimpleNamespace(
        scale=np.array([1.0, 2.0, 4.0]), overturned=np.array(overturned), place=overturned, mixture=False,
        intensities=[measure], deterministic=np.array([False]),
    )  # fmt: skip
    assert message(result) == title


def test_table_and_pictures(tmp_path, curve):
    title, table, sentences = fragility_table(curve)
    shown = Console(file=io.StringIO(), width=160)
    shown.print(table)
    assert title == "Fragility by exact, 2,000 realizations a point"
    assert f"{curve.overturned[0, 2]:.4f}" in shown.file.getvalue()
    assert sentences[0] == str(curve.trust)
    assert sentences[1].startswith("Lognormal (overturned): median ")
    surface = fragility(BLOCK, scale=(1.0, 2.0, 4.0), over={"slenderness": (3.0, 5.0)}, cycles=2, realizations=100)
    curves_figure(tmp_path / "curves.png", [curve, curve], "A curve", which=None)
    written = surface_figure(str(tmp_path / "surface.png"), surface, "A surface")
    assert written == tmp_path / "surface.png"
    assert {path.name for path in tmp_path.iterdir()} == {"curves.png", "surface.png"}


@pytest.mark.parametrize(
    ("changed", "error", "text"),
    [
        ({"scale": [0.0, 1.0]}, ValueError, r"scale\[0\]: got 0.0, accepted: a finite number > 0"),
        ({"scale": []}, ValueError, r"scale: got \[\]"),
        ({"scale": [1.0, 1.0]}, ValueError, "scale: got .*, accepted: numbers that differ"),
        ({"scale": 1.0}, TypeError, "scale: got 1.0"),
        ({"cycles": 0}, ValueError, "cycles: got 0"),
        ({"cycles": None}, TypeError, "cycles: got None"),
        ({"engine": "fpk"}, ValueError, "engine: got 'fpk', accepted: 'exact', .*'density'"),
        (
            {"levels": [2.0]},
            ValueError,
            r"levels\[0\]: got 2.0, accepted: an angle above that of the start, 0, and below",
        ),
        ({"levels": [0.0]}, ValueError, r"levels\[0\]: got 0.0"),
        ({"levels": 0.5}, TypeError, "levels: got 0.5"),
        ({"times": 3.0}, ValueError, "times: got 3.0, accepted: nothing, as this forcing repeats"),
        ({"realizations": 0}, ValueError, "realizations: got 0"),
        (
            {"engine": "rk4", "scene": WHITE},
            ValueError,
            "scale: the engine answers none of .*: method: got 'rk4'",
        ),
        (
            {"engine": "density", "tol": 1e-9},
            ValueError,
            "scale: the engine answers none of .*: tol: got 1e-09",
        ),
        ({"over": {"scale": [1.0]}}, ValueError, "over: got .*, accepted: one parameter other than the scale"),
        (
            {"over": {"noise.variance": [0.1], "forcing.phase": [0.1]}},
            ValueError,
            "over: got .*, accepted: one parameter",
        ),
        ({"scene": 3}, TypeError, "scene: got 3, accepted: one or more scenes"),
        ({"seed": 2.0}, TypeError, "seed: got 2.0"),
        ({"workers": 0}, ValueError, "workers: got 0"),
    ],
)
def test_bad_input_is_refused_by_name(main_scene, changed, error, text):
    with pytest.raises(error, match=text):
        fragility(**{"scene": main_scene, "scale": SCALE, "cycles": 2} | changed)
