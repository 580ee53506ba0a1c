"""What holds a block and what lifts it off: by a linear program of its equilibrium, and by paths."""

import csv
import dataclasses
import re

import numpy as np
import pytest
from scipy import optimize, stats
from suites import SIZE, record, searched

from fpk_rocking import Block, Body, Dimensions, NoNoise, Record, Scene, cli
from fpk_rocking.results.trust import CAUTION, UNUSABLE
from fpk_rocking.risk import Hazard, IntensityCurve, study
from fpk_rocking.risk.anchor import hold, lift_off_g
from fpk_rocking.risk.lognormal import LognormalFit
from fpk_rocking.risk.motions import intensities
from montecarlo import simulate

G = 9.80665
BODY = Body(height_of_centre=1.1, right=0.3, left=0.38, radius_of_gyration=0.62)


def least_ties(left, right, centre, top, acceleration):
    """Least horizontal force at the top, and least tension at an edge, in weights, so that the floor need not pull.

    The acceleration, in g, acts to both sides. The floor pushes at the edges, and its friction is unlimited.
    """
    forces, tensions = [], []
    for inertia in (acceleration, -acceleration):
        # Force at the top to the right and to the left, tension at the left and right edge, push at the left and right.
        matrix = [[0.0, 0.0, -1.0, -1.0, 1.0, 1.0], [-top, top, left, -right, -left, right]]
        balance = [1.0, centre * inertia]
        for part, kept, other in ((forces, slice(0, 2), slice(2, 4)), (tensions, slice(2, 4), slice(0, 2))):
            costs, bounds = np.zeros(6), np.full((6, 2), (0.0, np.inf))
            costs[kept], bounds[other] = 1.0, 0.0
            part.append(optimize.linprog(costs, A_eq=matrix, b_eq=balance, bounds=bounds).fun)
    return max(forces), max(tensions)


@pytest.mark.parametrize("peak", [0.2, 0.29, 0.31, 0.5, 1.7])
def test_the_forces_that_hold_a_block_are_the_least_of_its_equilibrium(peak):
    for width, height in ((0.6, 2.0), (0.9, 1.1)):
        held = hold(Block(dimensions=Dimensions(width, height)), peak * G)
        expected = least_ties(width / 2, width / 2, height / 2, height, peak)
        assert tuple(held) == pytest.approx(expected, abs=1e-9)
        assert (held.top > 0.0) == (peak > width / height)
    # Of a body at the height of its centre; on a planet of half the gravity the same acceleration is twice as many g.
    body = Body(1.1, 0.3, 0.38, 0.62, gravity=0.5 * G)
    for part in (BODY, body):
        expected = least_ties(0.38, 0.3, 1.1, 1.1, peak * G / part.gravity)
        assert tuple(hold(Block(body=part), peak * G)) == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize("block", [Block(dimensions=SIZE), Block(body=BODY), Block(0.9, SIZE, slender=True)])
def test_a_block_leaves_its_base_just_above_the_acceleration_that_is_stated_and_not_just_below(block):
    easier = 1.0 if block.body is None or block.body.right < block.body.left else -1.0
    for factor, moves in ((1.0 - 1e-6, False), (1.0 + 1e-6, True)):
        # A positive acceleration moves the base to the left, and tips the block to the right.
        samples = np.array([0.0, 1.0, 1.0, 0.0]) * factor * easier * lift_off_g(block)
        path = simulate(Scene(block, Record(0.2, samples, "g"), NoNoise()), times=[0.9])
        assert (easier * path.angle[0, -1] > 0.0) == moves


@pytest.fixture(scope="module")
def found():
    motions, scene = [record(n) for n in range(8)], Scene(Block(0.9, SIZE), record(0), NoNoise())
    return study(scene, motions, Hazard.power_law(1e-3, 2.5), [0.9, 0.3], mass=250.0)


def test_at_each_intensity_that_was_asked_for_stand_the_probability_its_own_limits_and_the_tie(found):
    table = found.at_asked
    assert table["PGV_m_per_s"] == pytest.approx([0.3, 0.9], rel=1e-12)
    critical = found.critical
    for value, share, low, high, exported, peak, top, edge in zip(*table.values(), strict=True):
        over = int(critical.overturned([value]).sum())
        proper = stats.binomtest(over, 8).proportion_ci(method="exact")
        assert (share, low, high) == pytest.approx((over / 8, proper.low, proper.high), abs=1e-9)
        own = [intensities(scene) for scene in found.recorded]
        assert peak == pytest.approx(max(value / one.pgv * one.pga for one in own) / G, rel=1e-9)
        assert exported == pytest.approx(float(found.curve(value)), rel=1e-12)
        assert (top, edge) == pytest.approx(least_ties(0.3, 0.3, 1.0, 2.0, peak), abs=1e-9)
        text = f"At PGV {value:.4g} m/s: P(overturned) {share:.3g} (95 %: {low:.2g} to {high:.2g}); peak acceleration "
        newtons = [float(f"{250.0 * G * force:.3g}") for force in (top, edge)]
        text += (
            f"up to {peak:.3g} g, a tie of {newtons[0]:,.0f} N horizontal at the top, or of {newtons[1]:,.0f} N down"
        )
        assert text in found.text()
    assert (
        "The block lifts off at 0.3 g. With a coefficient of friction below 0.3 it slides before it rocks"
        in found.text()
    )


def test_the_report_has_these_answers_before_its_motions(found, tmp_path):
    found.write(tmp_path)
    page = (tmp_path / "report.html").read_text()
    head = page[: page.index("<h2>Motions</h2>")]
    force = 250.0 * G * found.at_asked["top"][1]
    top = f"{float(f'{force:.3g}'):,.0f} N"
    for said in (
        "<th>tie horizontal at the top</th>",
        f"<td>{top}</td>",
        "slides before it rocks",
        "lifts off at 0.3 g",
    ):
        assert said in head
    assert page[: page.index("<script")].count("slides before it rocks") == 1


def test_no_probability_of_the_curve_lies_below_its_own_lower_limit(found, tmp_path):
    """Limits of a fit stand in columns of their own, and nowhere if it is rejected."""
    fitted = IntensityCurve.of(searched(0.3 * stats.norm.ppf((np.arange(20) + 0.5) / 20)), "scale", samples=999)
    for curve in (found.curve, fitted):
        curve.to_csv(tmp_path / "curve.csv")
        for row in csv.DictReader((tmp_path / "curve.csv").open(encoding="utf-8")):
            assert float(row["low"]) <= float(row["probability"]) <= float(row["high"])
            of_fit = (
                float(row["lognormal_low"] or "nan") <= float(row["lognormal"]) <= float(row["lognormal_high"] or "nan")
            )
            assert of_fit == curve.fitted
        # How little so many motions tell is by these limits, too.
        (few,) = (one.value for one in curve.diagnostics if one.name == "few motions")
        assert few == pytest.approx(0.5 * np.diff(curve.point_limits).max(), rel=1e-12)
    assert (found.curve.fitted, fitted.fitted) == (False, True)


def test_a_mass_is_refused_by_name_before_any_work():
    with pytest.raises(ValueError, match=re.escape("mass: got 0")):
        study(Scene(Block(0.9, SIZE), record(0), NoNoise()), ["missing.AT2"] * 5, None, mass=0.0)


def test_a_mass_without_intensities_states_forces_in_newtons_at_those_of_the_curve(found):
    """Which are the same as without the mass."""
    scene, motions = found.scene, [shaken.forcing for shaken in found.recorded]
    heavy, light = (study(scene, motions, None, mass=mass) for mass in (250.0, None))
    assert heavy.asked == pytest.approx(light.curve.intensity, rel=1e-12)
    assert (light.asked.size, heavy.asked.size) == (0, 12)
    columns = heavy.at_asked
    newtons = float(f"{250.0 * G * least_ties(0.3, 0.3, 1.0, 2.0, columns['peak_g'][-1])[0]:.3g}")
    line = next(line for line in heavy.text().splitlines() if line.startswith(f"At PGV {heavy.asked[-1]:.4g} m/s: "))
    assert f"a tie of {newtons:,.0f} N horizontal at the top" in line
    assert "At PGV" not in light.text()


def test_a_hold_needs_an_acceleration_in_plain_numbers_and_a_size():
    with pytest.raises(TypeError, match=r"^acceleration: got '0.45 g', accepted: a finite number >= 0"):
        hold(Block(0.9, SIZE), "0.45 g")
    with pytest.raises(ValueError, match=r"^block: got .*, accepted: one with a size"):
        hold(Block(0.9), 4.0)


def test_the_screen_says_what_probability_the_exported_curve_has_where_that_is_another_one(found):
    fit = LognormalFit(0.7, 0.4, p_value=0.5)
    text = dataclasses.replace(found, curve=dataclasses.replace(found.curve, fit=fit)).text()
    for value, share in zip(found.at_asked["PGV_m_per_s"], found.at_asked["probability"], strict=True):
        line = next(line for line in text.splitlines() if line.startswith(f"At PGV {value:.4g} m/s: "))
        assert f"P(overturned) {share:.3g} (95 %: " in line
        assert f"; by the lognormal curve of files {float(fit(value)):.3g}); peak" in line
    points = dataclasses.replace(found, curve=dataclasses.replace(found.curve, fit=LognormalFit(reason="none"))).text()
    assert "lognormal curve of files" not in points


def test_a_block_that_slides_before_it_rocks_is_not_to_be_used(found):
    """Width over height .3; the option of the command line is the parameter of the study."""
    for friction, told in ((0.29, True), (0.31, False), (None, False)):
        judged = dataclasses.replace(found, friction=friction)
        severe = [one for one in judged.diagnostics if one.name == "friction"]
        assert len(severe) == told
        assert ("With 0.31 it lifts off" in judged.block_sentences[0]) == (friction == 0.31)
        if told:
            assert judged.trust.verdict == "do not use"
            assert severe[0].severity == UNUSABLE
            assert severe[0].message.startswith(
                "With a coefficient of friction of 0.29, below 0.3, the block slides before it rocks"
            )
    for wrong in (-1.0, 35.0):
        with pytest.raises(ValueError, match=f"^friction: got {wrong}, accepted: a finite number > 0.0 and <= 2.0$"):
            study(Scene(Block(0.9, SIZE), record(0), NoNoise()), ["missing.AT2"] * 5, None, friction=wrong)
    assert cli.command_line().parse_args(["risk", "rack.toml", "--friction", "0.29"]).friction == 0.29


def test_a_friction_that_holds_the_nearer_corner_alone_is_told():
    """Lift-off needs a force of .18/.95 of the weight over one corner, of .24/.95 over the other."""
    body = Scene.from_block(body=Body(0.95, 0.18, 0.24, 0.55), record=record(0), restitution=0.9)
    found = study(body, [record(0)], None, [1.0])
    for friction, severity in ((0.18, [UNUSABLE]), (0.2, [CAUTION]), (0.26, [])):
        judged = dataclasses.replace(found, friction=friction).diagnostics
        assert [one.severity for one in judged if one.name == "friction"] == severity
