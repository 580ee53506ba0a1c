"""Studies of risk without noise: what does not depend on the intensities asked for, names of motions, corrections."""

import csv
import dataclasses
import functools
import math

import numpy as np
import pytest

from fpk_rocking import Body, Record, Scene, Start, studies
from fpk_rocking.risk import Building, Hazard, annual_frequency, search, study, synthetic_records
from fpk_rocking.risk.motions import intensities
from montecarlo import histories, simulate


@functools.cache
def stepped(count, low=0.3, high=3.0):
    block, motions = Scene.from_block(0.5, 1.8, "0.3 g", "1.5 Hz"), synthetic_records(6, duration=5.0, rms=1.5)
    return study(block, motions, Hazard([0.2, 0.7, 3.0], [2e-3, 8e-5, 1e-6]), np.geomspace(low, high, count))


def test_without_noise_the_rate_is_that_of_the_share_of_motions_that_overturn():
    result = stepped(5)
    jumps, hazard = result.fragility.motions.jumps[:, 0], result.risk.hazard
    # The share over the hazard on a grid of its own; beyond the search what stands or overturns goes on.
    grid = np.geomspace(0.05, 3e3, 400_001)
    share = ((jumps[:, None, :] <= np.sqrt(grid[1:] * grid[:-1])[:, None]).sum(axis=-1) % 2).mean(axis=0)
    parts = share * -np.diff(hazard(grid))
    assert result.risk.rate == pytest.approx(parts.sum(), rel=1e-4)
    inside = (result.risk.edges[:-1, None] <= grid[:-1]) & (grid[:-1] < result.risk.edges[1:, None])
    assert result.risk.contribution == pytest.approx((inside * parts).sum(axis=1) / parts.sum(), abs=1e-4)
    assert result.risk.contribution.sum() == pytest.approx(0.999, abs=1e-6)
    assert (result.risk.beyond_curve, result.risk.below_curve) == (0.0, 0.0)
    assert "Intensities below" not in result.text()
    beyond = parts[grid[:-1] >= 3.0].sum() / parts.sum()
    assert result.risk.beyond_hazard == pytest.approx(beyond + parts[grid[:-1] < 0.2].sum() / parts.sum(), abs=1e-4)
    assert result.risk.interval[0] < result.risk.rate < result.risk.interval[1]
    assert "Computed from every intensity at which a motion overturns the block" in result.text()


@pytest.mark.parametrize(("count", "low", "high"), [(24, 0.3, 3.0), (8, 0.2, 0.8), (48, 0.05, 10.0)])
def test_without_noise_rate_limits_and_fit_do_not_depend_on_the_intensities_asked_for(count, low, high):
    first, other = stepped(5), stepped(count, low, high)
    for result in (first, other):
        assert result.risk.interval[0] < result.risk.rate < result.risk.interval[1]
    assert (other.risk.rate, *other.risk.interval) == pytest.approx((first.risk.rate, *first.risk.interval), rel=1e-12)
    assert other.curve.fit == first.curve.fit
    assert np.array_equal(other.critical.jumps, first.critical.jumps, equal_nan=True)
    assert np.isfinite(first.critical.always).all()
    assert other.trust.verdict == first.trust.verdict


def test_the_table_of_motions_and_the_curve_agree():
    """P is between the shares of the motions whose always and whose first intensity lies below; the fit is by a third.

    An interval narrower than 1 % is not critical, so the share by the critical intensity may be lower by those.
    """
    result = stepped(24)
    table, curve = result.table(), result.curve
    median = math.exp(np.log(table["equivalent_intensity"]).mean())
    assert curve.fit.median == pytest.approx(median, rel=1e-12)
    # Of the share of motions below one, over the logarithm, the second moment; motions are few.
    fine = np.linspace(math.log(0.05), math.log(20.0), 200_001)
    share = result.critical.overturned(np.exp(fine)).mean(axis=0)
    within = np.diff(share) @ (0.5 * (fine[1:] + fine[:-1]) - math.log(median)) ** 2
    logs = np.log(table["equivalent_intensity"])
    assert curve.fit.dispersion**2 == pytest.approx(within - logs.var() + logs.var(ddof=1), rel=1e-3)
    assert curve.sources["record to record"] == pytest.approx(logs.std(ddof=1), rel=1e-6)
    assert curve.sources["intervals"] > 0.1
    grid = np.exp(np.arange(math.log(0.1), math.log(10.0), 1e-4))
    over = result.critical.overturned(grid).sum(axis=1) * 1e-4
    assert np.log(grid[-1] / table["equivalent_intensity"]) == pytest.approx(over, abs=2e-3)
    least, most = (
        (table[name] <= curve.intensity[:, None]).mean(axis=1) for name in ("always_intensity", "critical_intensity")
    )
    assert np.all((least <= curve.probability) & (curve.probability <= most))
    assert (least < most).any()
    assert np.all(table["critical_intensity"] <= table["equivalent_intensity"])
    assert np.all(table["equivalent_intensity"] <= table["always_intensity"])
    assert result.text().count("The critical PGV of a motion is the lowest from which it overturns the block") == 1


def test_intensities_have_a_default_over_which_the_motions_overturn_the_block():
    """With and without noise the same; without, the search is not repeated for them."""
    block, motions = Scene.from_block(0.5, 1.8, "0.3 g", "1.5 Hz"), synthetic_records(6, duration=5.0, rms=1.5)
    result = study(block, motions, None)
    intensity, suite = result.curve.intensity, stepped(5).critical
    wanted = 0.5 * np.nanmin(suite.jumps), 1.01 * suite.always.max()
    assert intensity == pytest.approx(np.geomspace(*wanted, 12), rel=1e-9)
    assert result.curve.probability.tolist() == suite.overturned(intensity).mean(axis=0).tolist()
    assert result.curve.probability[[0, -1]].tolist() == [0.0, 1.0]
    noisy = Scene.from_block(0.5, 1.8, "0.3 g", "1.5 Hz", noise_rms_acceleration=0.3, noise_band_hz=(0, 8))
    assert study(noisy, motions, None, realizations=2).curve.intensity == pytest.approx(intensity, rel=1e-9)


def test_with_noise_intensities_are_added_up_to_where_each_motion_overturns_the_block():
    noisy = Scene.from_block(0.5, 1.8, "0.3 g", "1.5 Hz", noise_rms_acceleration=0.3, noise_band_hz=(0, 8))
    motions = synthetic_records(6, duration=5.0, rms=1.5)
    result = study(noisy, motions, Hazard.power_law(1e-4, 2.5), [0.3, 0.5, 0.7], realizations=20)
    scale, top = result.fragility.scale, stepped(5).critical.equivalent.max()
    assert top <= scale[-1] < 1.4 * top
    assert result.added == scale.size - 3
    assert np.isfinite(result.factors).all()
    # Without a rate nothing is added.
    assert study(noisy, motions, None, [0.3, 0.5], realizations=2).curve.intensity == pytest.approx([0.3, 0.5])


def test_motions_that_do_not_settle_are_told_by_name(monkeypatch):
    """Searches that end at three times the scale of lift-off: the motions that stand there."""
    monkeypatch.setattr(search, "FARTHEST", 3.0)
    block, motions = Scene.from_block(0.5, 1.8, "0.3 g", "1.5 Hz"), synthetic_records(6, duration=5.0, rms=1.5)
    result = study(block, motions, Hazard.power_law(1e-4, 2.5), [0.3, 1.0, 3.0])
    stands = np.isinf(result.critical.always)
    assert 0 < stands.sum() < 6
    names = ", ".join(motion.source for motion, standing in zip(motions, stands, strict=True) if standing)
    (said,) = [text for text in result.remarks if "where the search ends" in text]
    assert f"where the search ends, under {names}. The limits count" in said
    ends = [3.0 * 0.5 / 1.8 * 9.80665 / intensities(scene).pga * intensities(scene).pgv for scene in result.recorded]
    assert result.curve.reach == pytest.approx(min(end for end, standing in zip(ends, stands, strict=True) if standing))
    monkeypatch.undo()
    assert not any("where the search ends" in text for text in stepped(5).remarks)


def test_up_to_what_lifts_the_block_off_no_probability_and_no_limit_is_above_zero():
    """Five motions that differ much: tails of lognormal curves reach below the PGA that lifts the block off."""
    block, motions = Scene.from_block(0.5, 1.8, "0.3 g", "1.5 Hz"), []
    for factor, motion in zip((0.3, 0.6, 1.0, 2.0, 4.0), synthetic_records(5, duration=5.0), strict=True):
        motions.append(dataclasses.replace(motion, interval=factor * motion.interval))
    hazard = Hazard([0.18, 0.34], [1 / 475, 1 / 2475], measure="PGA", source="map.csv")
    result = study(block, motions, hazard, [0.277, 0.278, 1.0], measure="PGA")
    assert result.curve.log_lift_off == pytest.approx(math.log(0.5 / 1.8), rel=1e-12)
    most = float(hazard(0.5 / 1.8))
    assert result.risk.rate < result.risk.interval[1] <= most
    free = dataclasses.replace(result.curve, measure="PGV", jumps=result.curve.jumps)
    assert annual_frequency(free, dataclasses.replace(hazard, measure="PGV")).interval[1] > most
    low, high = result.at_asked["low"], result.at_asked["high"]
    assert (low.tolist()[:2], high[0], high[1] > 0.0) == ([0.0, 0.0], 0.0, True)
    low, high = result.curve.limits(np.array([0.277, 0.278]))
    assert (low[0], high[0], high[1] > 0.0) == (0.0, 0.0, True)
    assert "At PGA 0.277 g: P(overturned) 0 (95 %: 0 to 0" in result.text()
    # Neither other measures, nor the PGA of the ground below a floor, nor a vertical motion leave it known.
    assert math.isinf(stepped(5).curve.log_lift_off)
    upright = dataclasses.replace(motions[0], vertical=motions[0])
    for changed in (
        [
            scene.varied(forcing=dataclasses.replace(upright, scale=scene.forcing.scale))
            for scene in result.curve.scenes
        ],
        [dataclasses.replace(result.curve.scenes[0], start=Start(0.1, 0.0))],
        [dataclasses.replace(result.curve.scenes[0], forcing=Building(0.5, 0.05, 1.0).floor_motion(motions[0]))],
    ):
        assert math.isinf(dataclasses.replace(result.curve, scenes=tuple(changed)).log_lift_off)
    floor = dataclasses.replace(result.curve, scenes=tuple(changed), measure="PFA")
    assert floor.log_lift_off == pytest.approx(math.log(0.5 / 1.8), rel=1e-12)


def test_without_noise_each_motion_is_told_by_name(tmp_path):
    result = stepped(5)
    motions = synthetic_records(6, duration=5.0, rms=1.5)
    result.write(tmp_path)
    rows = list(csv.DictReader((tmp_path / "motions.csv").open(encoding="utf-8")))
    lines = result.text().splitlines()[-6:]
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    for motion, row, line in zip(motions, rows, lines, strict=True):
        scene = Scene.from_block(0.5, 1.8, record=motion)
        own, path = intensities(scene).pgv, histories(scene, times=np.linspace(0.0, 25.0, 20_001))
        assert row["motion"] == motion.source
        assert float(row["peak_rotation"]) == pytest.approx(np.nanmax(np.abs(path.angle)), abs=1e-5)
        factor = float(row["critical_scale"])
        sides = [simulate(studies.scaled(scene, factor * change)).overturn_side[0] for change in (0.9995, 1.0005)]
        assert sides[0] == 0
        assert sides[1] != 0
        assert float(row["critical_intensity"]) == pytest.approx(factor * own, rel=1e-9)
        assert line.startswith(f"{motion.source}: PGA ")
        always = float(row["always_intensity"])
        more = f", always from {always:.4g}" * (always > 1.01 * factor * own)
        assert line.endswith(f"critical at PGV {factor * own:.4g} m/s, {factor:.3g} times its own strength{more}.")
        assert f"<td>{factor:.4g}</td>" in page


def test_a_correction_under_motions_that_overturn_nothing_changes_nothing(monkeypatch):
    monkeypatch.setattr(search, "FARTHEST", 1.5)
    block, hazard = Scene.from_block(0.5, 1.8, "0.3 g", "1.5 Hz"), Hazard.power_law(1e-4, 2.5)
    motions = [
        dataclasses.replace(motion, samples=tuple((0.05 * np.array(motion.samples) + 0.002).tolist()))
        for motion in synthetic_records(5, duration=5.0)
    ]
    result = study(block, motions, hazard, [0.01, 0.02], baseline="high-pass")
    assert result.critical.jumps.size == 0
    assert "P(overturned) would differ by up to 0 (at PGV " in result.about_correction


def test_what_a_correction_of_baselines_changes_of_the_rate_is_said():
    """Motions with a drift added: the rate without the correction is that of a study of the motions as they are."""
    block, hazard = Scene.from_block(0.5, 1.8, "0.3 g", "1.5 Hz"), Hazard.power_law(1e-4, 2.5)
    drifting = [
        dataclasses.replace(motion, samples=tuple((np.array(motion.samples) + 0.05).tolist()))
        for motion in synthetic_records(5, duration=5.0, rms=1.5)
    ]
    raw = study(block, drifting, hazard, [0.3, 3.0])
    assert raw.uncorrected is None
    assert not any("Without the correction" in text for text in raw.remarks)
    reports = []
    corrected = study(
        block, drifting, hazard, [0.3, 3.0], baseline="high-pass", progress=lambda *parts: reports.append(parts)
    )
    # Motions with the correction, then without it.
    assert [done for done, _ in reports] == sorted(done for done, _ in reports)
    assert {total for _, total in reports} == {10}
    assert reports[-1] == (10, 10)
    (text,) = [text for text in corrected.remarks if text.startswith("Without the correction")]
    rate = f"{raw.risk.rate:.2e}".replace("e-0", "e-")
    ratio = f"{raw.risk.rate / corrected.risk.rate:.3g}"
    assert text.endswith(
        f"annual rate would be {rate}, {ratio} times this one; the limits do not contain this difference."
    )
    as_recorded = corrected.table()["pgv_as_recorded_m_per_s"]
    assert as_recorded == pytest.approx(raw.table()["pgv_m_per_s"], rel=2e-3)  # at samples, and between them
    assert as_recorded != pytest.approx(corrected.table()["pgv_m_per_s"], rel=0.05)
    assert "pgv_as_recorded_m_per_s" not in raw.table()
    grid = np.geomspace(0.02, 20.0, 50_001)
    change = np.abs(np.subtract(*(result.critical.overturned(grid).mean(axis=0) for result in (raw, corrected)))).max()
    assert f"would differ by up to {change:.2g} (at PGV " in text
    assert text in corrected.text()
    noisy = study(
        Scene.from_block(0.5, 1.8, "0.3 g", "1.5 Hz", noise_rms_acceleration=0.3, noise_band_hz=(0, 8)),
        drifting, None, [1.0, 2.0], baseline="high-pass", realizations=2,
    )  # fmt: skip
    assert 'baseline = "none" (--baseline none) gives the result without the correction' in noisy.text()


def test_sizes_that_were_hardly_meant_are_told_first_and_where_no_motion_overturns_the_block():
    """A body whose moment of inertia was taken for its radius of gyration."""
    short = Record(0.01, [0.0, 1.0, 0.0], "m/s2")
    body = Body(height_of_centre=1.1, right=0.25, left=0.35, radius_of_gyration=288.0)
    said = r"block\.body\.radius_of_gyration is 288 m; was 2\.88 m or 0\.288 m meant\?"
    with (
        pytest.warns(UserWarning, match=f"^{said}$"),
        pytest.raises(ValueError, match=rf"^intensities: got None, .* no motion overturns the block .* noise; {said}$"),
    ):
        study(Scene.from_block(body=body, record=short, restitution=0.9), [short], None)
