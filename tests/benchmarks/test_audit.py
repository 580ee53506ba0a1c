"""The audit of random scenes: what it draws, that a wrong answer is a miss, and its file, which is gone on with."""

import importlib
import math
import pathlib
import sys

import numpy as np
import pytest

from fpk_rocking.scene import Block, Body, Harmonic, NoNoise, Pulse, Scene, Start, WhiteNoise
from fpk_rocking.scene.axes import result_times
from montecarlo import simulate

ROOT = pathlib.Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "benchmarks"))
audit = importlib.import_module("audit")
audit_findings = importlib.import_module("audit_findings")
audit_scenes = importlib.import_module("audit_scenes")
audit_truth = importlib.import_module("audit_truth")
CHEAP = ["--count", "2", "--kinds", "calm", "white", "--tol", "0.05", "--paths", "5000", "--seed", "1"]


def comparison(answer, stated, truth, error, hard=True):
    return audit_findings.Comparison("survival 1", answer, stated, truth, error, hard)


def test_cheap_scenes_are_answered_and_right(capsys, tmp_path):
    findings = audit.main([*CHEAP, "--out", str(tmp_path / "audit.csv")])
    assert [(one.kind, one.number, one.outcome) for one in findings] == [
        ("calm", 0, "answered"),
        ("white", 0, "answered"),
    ]
    assert not any(one.missed for one in findings)
    assert "| all | 2 | 0 | 0 | 0 | 0 | 0 | 0 | 0 | 0 |" in capsys.readouterr().out
    kept = audit_findings.kept(tmp_path / "audit.csv")
    assert [one._replace(seconds=0.0) for one in kept] == [one._replace(seconds=0.0) for one in findings]
    assert Scene.from_toml(audit.json.loads(kept[1].scene)) == audit_scenes.drawn("white", 1, 0).scene


def test_a_shifted_answer_is_a_miss(capsys):
    findings = audit.main([*CHEAP, "--shift", "0.3"])
    assert all(one.missed and one.missed_twice for one in findings)
    assert [len(one.looks) for one in findings] == [1, 2]
    assert "white-0" in capsys.readouterr().out


def test_a_file_is_gone_on_with_and_is_of_one_audit(capsys, tmp_path, monkeypatch):
    path = str(tmp_path / "audit.csv")
    audit.main([*CHEAP, "--count", "1", "--out", path])
    calls = []
    monkeypatch.setattr(audit, "judged", lambda *rest: calls.append(rest[:2]) or finding([[]], kind=rest[0]))
    audit.main([*CHEAP, "--out", path])
    assert calls == [("white", 0)]
    audit.main([*CHEAP, "--out", path, "--limit-s", "-1", "--count", "9"])
    assert calls == [("white", 0)]
    assert "2 scenes are judged" in capsys.readouterr().out
    with pytest.raises(SystemExit, match="holds an audit of"):
        audit.main([*CHEAP, "--out", path, "--seed", "2"])


def finding(looks, verdict="ok", outcome="answered", kind="white"):
    settings = audit.Options(0.05, 5000, 60.0, 1).settings
    return audit_findings.Finding(kind, 0, outcome, looks, verdict, "paths", 1.0, "", settings, '""')


def test_misses_are_counted_by_what_the_last_look_says():
    right, wrong, far = (
        comparison(0.5, 0.01, 0.51, 0.001),
        comparison(0.5, 0.01, 0.52, 0.001),
        comparison(0.5, 0.01, 0.6, 0.001),
    )
    rows = [
        finding([[right]]),
        finding([[wrong], [right]]),
        finding([[right, wrong], [wrong]]),
        finding([[far], [far]]),
        finding([[far], [far]], "caution"),
        finding([], "", "refused"),
        finding([], "", "stopped"),
        finding([], "", "failed"),
    ]
    assert audit_findings.counts_of(rows) == [8, 1, 1, 1, 1, 3, 2, 1, 1, "8"]
    assert [line[0] for line in audit_findings.miss_lines(rows)] == ["white-0"] * 3
    number, chance = audit_findings.alarms(rows)
    assert (number, chance) == (6, pytest.approx(6 * math.erfc(3.0 / math.sqrt(2.0))))


def test_what_is_certain_and_what_would_be_noticed():
    certain, other = finding([[comparison(1.0, 0.0, 0.9999, 1e-5)]]), finding([[comparison(0.5, 0.01, 0.5, 0.002)]])
    assert (certain.certain, other.certain) == (True, False)
    assert audit_findings.noticed([certain, other]) == pytest.approx(0.016)


def test_excess_and_false_alarms():
    assert comparison(0.5, 0.01, 0.513, 0.001).excess == pytest.approx(1.0)
    assert comparison(0.5, 0.01, 0.514, 0.001).excess > 1.0
    assert not comparison(0.5, 0.01, 0.522, 0.001).twice
    assert comparison(0.5, 0.01, 0.524, 0.001).twice
    assert comparison(1.0, 0.0, 1.0, 0.0).excess == 0.0
    assert comparison(1.0, 0.0, 0.0, 0.0).twice
    assert comparison(1.0, 0.0, 1.0 + 2e-16, 0.0).excess < 1.0
    assert not comparison(math.nan, 0.01, 0.5, 0.001).excess <= 1.0
    # A sample's own 95 % interval against a truth that is certain.
    assert comparison(0.5, 0.01, 0.5, 0.0, hard=False).false_alarm == pytest.approx(0.05, abs=1e-4)
    assert comparison(0.5, 0.01, 0.5, 0.0).false_alarm == 0.0


def test_what_one_side_alone_has_is_a_miss():
    answer = audit.Answer({"angle": (0.1, 1e-5)}, "ok", "one path exact", True)
    comparisons = audit.compared(answer, {"overturning time": (2.0, 0.0)})
    assert [one.quantity for one in comparisons] == ["angle", "overturning time"]
    assert not any(one.excess <= 1.0 for one in comparisons)


@pytest.mark.parametrize("kind", audit_scenes.KINDS)
def test_scenes_are_of_their_kind_and_depend_on_nothing_else(kind):
    draws = [audit_scenes.drawn(kind, 3, number) for number in range(3)]
    assert draws[2] == audit_scenes.drawn(kind, 3, 2)
    assert draws[2] != audit_scenes.drawn(kind, 4, 2)
    noises = {"calm": "none", "band": "band", "filtered": "filtered", "filtered density": "filtered"}
    assert {draw.scene.noise.kind for draw in draws} == {noises.get(kind, "white")}
    assert all((draw.cycles is None) == (draw.scene.period is None) for draw in draws)
    if kind in ("density", "filtered density", "operator", "splitting"):
        assert all(draw.scene.repeats for draw in draws)
    if kind == "passing density":
        assert not any(draw.scene.repeats for draw in draws)
    rows = draws[0].looked_at
    assert draws[0].times(rows)[-1] == pytest.approx(result_times(draws[0].scene, **draws[0].rows)[rows[-1]])


@pytest.mark.parametrize(
    "scene",
    [
        Scene(Block(0.7), Harmonic(3.0, 2.7, 1.0), NoNoise()),
        Scene(Block(0.6, critical_angle=0.4), Pulse("one-sine", 2.5, 1.5), NoNoise(), Start(0.3, -0.4)),
        Scene(Block((0.8, 0.6), body=Body(1.1, 0.3, 0.4, 0.62)), Harmonic(1.5, 2.0), NoNoise(), Start(-0.2, 0.1)),
    ],
    ids=["slender", "exact", "body"],
)
def test_the_motion_is_that_of_the_exact_engine(scene):
    draw = audit_scenes.Draw(scene, 3 if scene.period else None, 6.0)
    path = simulate(scene, **draw.rows)
    side, time, state = audit_truth.Motion(scene).outcome(draw.times(draw.looked_at))
    assert side == path.overturn_side[0]
    assert state == pytest.approx([path.angle[0, -1], path.velocity[0, -1]], abs=1e-8, nan_ok=True)
    assert time == pytest.approx(path.overturn_time[0], abs=1e-8, nan_ok=True)


def test_paths_under_sampled_noise_are_those_of_the_engine():
    """A false alarm, beyond 4.5 standard errors and the change by longer steps, has a probability below 1e-4."""
    scene = Scene(Block(0.5), Harmonic(3.5, 2.7), WhiteNoise(0.03), Start(0.1, 0.2))
    draw = audit_scenes.Draw(scene, 2, 0.0)
    sides, changes, paths = audit_truth.sampled(draw, 2000, 5)
    run = simulate(scene, cycles=2, realizations=20_000, seed=6)
    shares = run.overturned_counts[draw.looked_at] / run.realizations
    error = 4.5 * np.sqrt(np.maximum(shares, 1e-3) * (1 / 2000 + 1 / 20_000)) + np.abs(changes) / paths
    assert shares[-1].sum() > 0.05
    assert np.all(np.abs(sides / paths - shares) <= error)
