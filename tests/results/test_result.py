"""Results in the hand: the line, the card, the picture, the tables, and the verdict; of every kind of result."""

import dataclasses
import math
import pathlib
import re
import sys

import fakes
import numpy as np
import pytest
from scipy import special

from fpk_rocking import BandNoise, Block, Harmonic, NoNoise, Scene, Start, WhiteNoise
from fpk_rocking.compare import compare
from fpk_rocking.results.pictures import shown_edges
from fpk_rocking.results.trust import CAUTION, UNUSABLE, Diagnostic, assess, verdict
from fpk_rocking.risk import Fragility
from fpk_rocking.scene.axes import joint_edges
from fpk_rocking.studies import Sweep
from montecarlo import Splitting, histories, simulate, tally

DOCUMENT = pathlib.Path(__file__).parents[2] / "docs" / "results.md"
MAIN = Scene(Block(0.5), Harmonic(4.6, 2.7, math.pi), BandNoise(0.04, (0.0, 10.0), 100))
WHITE = dataclasses.replace(MAIN, noise=WhiteNoise(0.006))


def splitting(repeats=30, spread=0.1):
    rng = np.random.default_rng(1)
    last = 1e-5 * (1.0 + spread * rng.standard_normal((repeats, 1))) * [0.3, 0.7]
    return Splitting(
        scene=WHITE,
        walkers=100,
        seed=1,
        steps_per_cycle=200,
        wall_s=0.5,
        repeat_overturned=np.stack([np.zeros((repeats, 2)), 0.1 * last, last], axis=1),
        levels=np.full(repeats, 7),
        killed=np.full(repeats, 70),
    )


def fragility(axis="scene", size=1):
    scale, median = np.geomspace(0.5, 2.0, 6), (np.arange(size) + 3.0) / 3.0
    values = special.ndtr(np.log(scale / np.multiply.outer(median, [[1.0], [0.8]])) / 0.4)
    return Fragility(
        scenes=(MAIN,) * size,
        axis=axis,
        place=np.arange(size) + 1.0,
        level=np.array([0.7]),
        scale=scale,
        probability=np.round(values, 3),
        error_estimate=np.full(values.shape, np.nan),
        engine="exact",
        realizations=1000,
        noise_scaled=True,
        options={"cycles": 4, "seed": 1},
        noise_replacement="",
        reasons={},
        wall_s=1.0,
    )


def rows(*verdicts):
    for number, one in enumerate(verdicts):
        values = {"survival": [1.0, 0.5 + 0.1 * number], "method": "exact", "trust": one} if one else {}
        reason = "" if one else "ValueError: refused"
        yield {"cell": number, "seed": 1, "digest": "", "wall_s": 1.0, "values": values, "reason": reason}


KINDS = {
    "density": lambda: fakes.FakeEvolution(MAIN),
    "ensemble": lambda: simulate(MAIN, cycles=2, realizations=400, method="rk4"),
    "tally": lambda: tally(MAIN, cycles=2, realizations=400, method="rk4"),
    "histories": lambda: histories(MAIN, cycles=2, realizations=3, method="rk4"),
    "splitting": splitting,
    "comparison": lambda: compare(fakes.FakeEnsemble(MAIN, realizations=4000), fakes.FakeEvolution(MAIN)),
    "fragility": fragility,
    "surface": lambda: fragility("size", 3),
    "sweep": lambda: Sweep(tuple(rows("ok", "ok", "ok", "caution")), {"a": (1.0, 2.0), "b": (3.0, 4.0)}, 2.0),
    "list": lambda: Sweep(tuple(rows("ok", "")), {}, 2.0),
}


@pytest.fixture(scope="module")
def kinds():
    return {name: make() for name, make in KINDS.items()}


@pytest.fixture(params=KINDS)
def result(request, kinds):
    return kinds[request.param]


def test_the_line_is_short_and_ends_with_the_verdict(result):
    line = repr(result)
    assert "\n" not in line
    assert len(line) < 320
    assert "array(" not in line
    assert re.match(rf"<{type(result).__name__}: .+; trust: {result.trust.verdict}\. .+>$", line)


def test_the_card_holds_all_it_shows(result):
    card = result._repr_html_()
    assert f"trust: {result.trust.verdict}" in card
    assert re.findall(r"(?:src|href)='(.{22})", card) == ["data:image/png;base64,"]
    assert 5_000 < len(card) < 150_000


def test_texts_cannot_become_elements_of_the_card():
    class Named(fakes.FakeEvolution):
        engine = "<b>"

        @property
        def metadata(self):
            return super().metadata | {"note": "<i>"}

    failed = Sweep(tuple(rows("ok", "")), {"<u>": (1.0, 2.0)}, 2.0)
    for card in (Named(MAIN)._repr_html_(), failed._repr_html_()):
        assert not re.search("<[biu]>", card)
    assert "&lt;i&gt;" in Named(MAIN)._repr_html_()


def test_the_picture_is_a_figure_and_no_window(result):
    def windows():
        pyplot = sys.modules.get("matplotlib.pyplot")
        return pyplot.get_fignums() if pyplot else []

    before = windows()
    figure = result.plot()
    assert all(axes.has_data() for axes in figure.axes)
    assert windows() == before


@pytest.mark.parametrize("name", ["pandas", "xarray"])
def test_a_missing_library_is_named_with_the_extra_that_has_it(kinds, monkeypatch, name):
    monkeypatch.setitem(sys.modules, name, None)
    convert = kinds["density"].to_dataframe if name == "pandas" else kinds["density"].to_xarray
    with pytest.raises(ModuleNotFoundError, match=rf"{name} is not installed: pip install 'fpk-rocking\[frames\]'"):
        convert()


def test_a_tally_is_shown_in_the_bins_that_it_kept(kinds):
    edges = np.array([-1.6, -0.7, 0.0, 0.4, 1.6]), np.array([-4.0, 0.0, 1.0, 4.0])
    own = tally(MAIN, cycles=2, realizations=400, method="rk4", angle_edges=edges[0], velocity_edges=edges[1])
    assert all(np.array_equal(*pair) for pair in zip(own.bin_edges, edges, strict=True))
    assert own.variables["bin_probability"][1]().sum(axis=(1, 2)) == pytest.approx(own.survival)
    assert own.plot("bins").axes[0].get_xlim() == (-1.6, 1.6)
    assert all(np.array_equal(*pair) for pair in zip(kinds["tally"].bin_edges, joint_edges(MAIN), strict=True))


def test_what_to_plot(kinds):
    density, ensemble = kinds["density"], kinds["ensemble"]
    assert [len(density.plot(what).axes) for what in ("survival", "bins", "density")] == [1, 2, 2]
    line = density.plot("survival").axes[0].lines[0]
    assert np.array_equal(line.get_ydata(), density.survival)
    assert density.plot("bins", 4).axes[0].get_title() == "after 4 cycles, survival 0.6561"
    with pytest.raises(ValueError, match=r"what: got 'density', accepted: 'survival', 'bins'$"):
        ensemble.plot("density")
    with pytest.raises(ValueError, match="cycle: got 3"):
        ensemble.plot("bins", 3)


def test_pictures_show_the_bins_that_hold_the_probability():
    edges = np.arange(-10.0, 11.0), np.arange(-100.0, 101.0)
    found = np.zeros((20, 200))
    found[12:14] = 1.0 / 400.0
    angle, velocity = shown_edges(edges, found, 24)
    assert (angle[0], angle[-1]) == (1.0, 5.0)
    assert set(edges[0][11:16]) <= set(angle)
    assert angle.size == 25
    assert (velocity[0], velocity[-1]) == (-100.0, 100.0)
    assert velocity.size - 1 <= 96
    assert shown_edges(edges, found, 0)[0].tolist() == [1.0, 2.0, 3.0, 4.0, 5.0]


@pytest.mark.parametrize(
    ("facts", "wanted", "reason"),
    [
        ({"error_estimate": 9e-4, "tol": 1e-3}, "ok", "error of the probabilities is 0.0009, within 0.001."),
        ({"error_estimate": 2e-3, "tol": 1e-3}, "caution", "error of the probabilities is 0.002, above 0.001."),
        ({"error_estimate": 0.11, "tol": 1e-3}, "do not use", "probabilities is 0.11, above 0.1."),
        ({"error_estimate": math.nan, "tol": 1e-3}, "do not use", "probabilities is nan, above 0.1."),
        ({"half_width": 0.049}, "ok", "interval of the probabilities is 0.049, within 0.05."),
        ({"half_width": 0.051}, "caution", "0.051, above 0.05."),
        ({"half_width": 0.101}, "do not use", "0.101, above 0.1."),
        ({"escape_error": 2.7e-3, "tol": 1e-3}, "ok", "relative error of the escape rate is 0.0027, within 0.0027."),
        ({"escape_error": 2.8e-3, "tol": 1e-3}, "caution", "rate is 0.0028, above 0.0027."),
        ({"relative_error": 0.3}, "caution", "The relative standard error of the probability is 0.3, above 0.2."),
        ({"bins_tol": 0.03, "bins_error_estimate": 0.04}, "caution", "binned density (L1) is 0.04, above 0.03."),
        ({"bins_error_estimate": 0.04}, "caution", "No error is estimated."),
        ({"error_estimate": 0.0, "tol": 1e-2, "truncated": [0.0, 0.02, 0.0]}, "caution", "mesh is 0.02, above 0.01."),
        ({"error_estimate": 0.0, "tol": 1e-2, "mass_defect": 1e-8}, "caution", "or lost) is 1e-08, above 1e-09."),
        ({"error_estimate": 0.0, "tol": 1e-2, "mass_defect": 0.011}, "do not use", "or lost) is 0.011, above 0.01."),
        ({"error_estimate": 0.0, "tol": 1e-2, "negative_mass": 0.02}, "caution", "below 0) is 0.02, above 0.01."),
        ({"error_estimate": 0.0, "negative_mass": 0.5, "moving_negative_mass": 0.009}, "ok", "within 0.05."),
        ({"error_estimate": 0.0, "negative_mass": 0.5, "moving_negative_mass": 0.02}, "caution",
         "blocks at rest left out) is 0.02, above 0.01."),
        ({}, "caution", "No error is estimated."),
    ],
)  # fmt: skip
def test_the_verdict_of_figures(facts, wanted, reason):
    asked = {name: facts[name] for name in ("tol", "bins_tol") if name in facts}
    trust = verdict(assess(facts, **asked))
    assert trust.verdict == wanted
    assert trust.reasons[0].endswith(reason) or reason in trust.reasons[0]
    assert str(trust) == f"trust: {wanted}. {trust.reasons[0]}"


def test_the_weightiest_doubt_decides_and_stands_first():
    known = [Diagnostic(CAUTION, "Few."), Diagnostic(UNUSABLE, "Wrong."), Diagnostic(CAUTION, "Few.")]
    trust = verdict([*known, *assess({"error_estimate": 0.02}, tol=1e-2)])
    assert trust.verdict == "do not use"
    assert trust.reasons[:2] == ("Wrong.", "Few.")
    assert trust.plain == {"verdict": "do not use", "reasons": list(trust.reasons)}
    assert len(trust.reasons) == 3


def test_one_path_without_noise_is_certain_by_the_exact_engine():
    """Two realizations say no less than one; with noise, or from a spread start, they say nothing."""
    quiet = dataclasses.replace(MAIN, noise=NoNoise())
    spread = quiet.varied(start=Start(0.0, 0.0, ((0.01, 0.0), (0.0, 0.01))))
    for method, wanted in (("exact", "ok"), ("rk4", "caution")):
        samples = [fakes.FakeEnsemble(scene, realizations=2, method=method) for scene in (quiet, MAIN, spread)]
        assert [sample.trust.verdict for sample in samples] == [wanted, "do not use", "do not use"]
        curves = [dataclasses.replace(fragility(), scenes=(scene,), realizations=1) for scene in (quiet, MAIN)]
        curves = [dataclasses.replace(curve, engine=method) for curve in curves]
        assert [curve.trust.verdict for curve in curves] == [wanted, "do not use"]
        for found in (samples[0], curves[0]):
            assert found.trust.reasons[0].startswith("Deterministic: one path, ")


def test_splitting_is_doubted_where_its_repeats_are_few_or_skewed():
    assert splitting().trust.verdict == "ok"
    assert splitting(8).trust.reasons[0].startswith("8 repeats are few")
    skewed = splitting(30, 3.0)
    assert skewed.skewed
    assert skewed.trust.verdict == "do not use"


def test_comparisons_are_as_good_as_the_worse_result_and_doubted_where_these_differ():
    ensemble, density = fakes.FakeEnsemble(MAIN, realizations=4000), fakes.FakeEvolution(MAIN)
    white = fakes.FakeEnsemble(WHITE, realizations=4000, method="white")
    assert compare(white, fakes.FakeEvolution(WHITE)).trust.verdict == "ok"
    bad = compare(fakes.FakeEnsemble(MAIN, realizations=90), density)
    assert bad.trust.verdict == "do not use"
    assert [reason.partition(": ")[2][:10] for reason in bad.trust.reasons] == ["The half w", "Replaced, "]
    assert bad.summary()["trust"] == bad.trust.plain

    class Other(fakes.FakeEvolution):
        @property
        def survival(self):
            return fakes.KEPT ** np.arange(11) - 0.06 * (np.arange(11) == 5)

    differing = compare(Other(WHITE), fakes.FakeEvolution(WHITE)).trust
    assert differing.verdict == "caution"
    (reason,) = differing.reasons
    assert reason == (
        "Survival differs by 0.06 after 5 cycles, more than the 0.0002 accepted there: the estimated errors of the "
        "densities, 0.0002."
    )
    assert compare(ensemble, ensemble).trust.reasons[0].startswith("Both samples use seed 1")
    # Seven standard errors, and two.
    assert compare(white, Other(WHITE)).trust.verdict == "caution"
    within = compare(fakes.FakeEnsemble(WHITE, realizations=400, method="white"), Other(WHITE))
    assert within.trust.verdict == "ok"
    worst = np.abs(within.difference / (4.0 * within.standard_error + 1e-4))[1:].argmax() + 1
    accepted = 4.0 * within.standard_error[worst] + 1e-4
    assert within.trust.reasons[0] == (
        f"Neither result is in doubt. Survival differs by {abs(within.difference[worst]):.2g} after {worst} cycles "
        f"({abs(within.z[worst]):.1f} standard errors), within the {accepted:.2g} accepted there: 4 standard errors of "
        "the difference plus the estimated errors of the densities, 0.0001."
    )


def test_the_example_of_the_document(monkeypatch, capsys):
    for name in ("pandas", "xarray"):
        pytest.importorskip(name)
    monkeypatch.chdir(DOCUMENT.parents[1])
    (example,) = re.findall(r"```python\n(.*?)```", DOCUMENT.read_text(encoding="utf-8"), re.DOTALL)
    exec(compile(example, DOCUMENT, "exec"), {})
    printed = " ".join(re.findall(r"^# +(.*)$", example, re.MULTILINE))
    assert capsys.readouterr().out.split() == printed.split()


def test_fragility_and_sweeps_are_doubted_where_answers_are_missing(kinds):
    whole = kinds["fragility"]
    assert whole.trust.verdict == "ok"
    half = dataclasses.replace(whole, probability=np.round(0.5 * whole.probability, 3))
    (reason,) = half.trust.reasons
    worst = max(half.fits[0], key=lambda fit: fit.misfit)
    assert reason == (
        f"The lognormal fit of 2 of 2 curves is rejected (p = {worst.p_value:.2g}, below 0.01): it is off by up to "
        f"{worst.misfit:.2g}. Use the probabilities themselves."
    )
    one = dataclasses.replace(whole, reasons={"0,0,1": "ValueError: refused"})
    assert one.trust.reasons[0] == "The engine gave no answer for 1 of 12 probabilities: ValueError: refused"
    assert dataclasses.replace(whole, realizations=100).trust.verdict == "caution"
    assert kinds["sweep"].trust.reasons == ('1 of 4 scenes have the verdict "caution".',)
    assert kinds["list"].trust.reasons == ("1 of 2 scenes failed, the first one by: ValueError: refused",)
    assert Sweep(tuple(rows("", "")), {}, 1.0).trust.verdict == "do not use"
    assert "2 of 2 scenes failed" in Sweep(tuple(rows("", "")), {}, 1.0)._repr_html_()
    unknown = {"0,0,0": "ValueError: refused"}
    nothing = dataclasses.replace(whole, probability=np.full((1, 2, 6), np.nan), reasons=unknown)
    assert "no answer for 1 of 12 probabilities" in nothing._repr_html_()
    own = [row | {"values": {"angle": 1.0}} for row in rows("ok", "ok")]
    (reason,) = Sweep((*own, *rows("ok")), {}, 1.0).trust.reasons
    assert reason == '2 of 3 scenes have no verdict: their function returned none as "trust".'
    assert Sweep(tuple(rows("ok", "do not use")), {}, 1.0).trust.verdict == "do not use"
    assert Sweep(tuple(rows("ok")), {}, 1.0).trust.verdict == "ok"


def test_a_fragility_that_falls_or_never_reaches_a_half_says_so(kinds):
    whole = kinds["fragility"]
    scale = whole.scale
    assert "extrapolated" not in whole.describe(0)
    low = dataclasses.replace(whole, probability=np.round(0.1 * whole.probability, 3))
    first = low.probability[0, 0]
    reached = f"the probability is {first.min():.3g} to {first.max():.3g} at these scales"
    assert low.describe(0) == f"Lognormal (overturned): no median, {reached}, and the fit is rejected."
    assert "median" not in low.title
    assert "median" in whole.title
    some = scale[:3]
    rising = special.ndtr(np.log(some / (1.2 * some[-1])) / 0.4)
    options = {"scale": some, "probability": np.round([[rising, rising]], 3), "error_estimate": np.zeros((1, 2, 3))}
    beyond = dataclasses.replace(whole, **options)
    assert not beyond.fits[0][0].rejected
    assert "; the median is extrapolated, the probability is " in beyond.describe(0)
    falls = whole.probability.copy()
    falls[0, 0, -1] = falls[0, 0, -2] - 0.2
    (reason,) = [one for one in dataclasses.replace(whole, probability=falls).trust.reasons if "falls" in one]
    assert reason == (
        f"The probability falls as the shaking grows: {falls[0, 0, -2]:.3g} at scale {scale[-2]:.4g}, "
        f"{falls[0, 0, -1]:.3g} at {scale[-1]:.4g}. The phase of the harmonic shaking may cause this: try others."
    )
    falls = falls.copy()
    falls[0, 0, -1] = falls[0, 0, -2] - 0.001
    assert not [one for one in dataclasses.replace(whole, probability=falls).trust.reasons if "falls" in one]
