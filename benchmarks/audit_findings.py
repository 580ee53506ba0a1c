"""What `audit.py` found: comparisons, findings of scenes, the file that keeps them, and the table that counts them."""

import csv
import math
import pathlib
from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np
from audit_scenes import KINDS
from report import table

from fpk_rocking.results import storage

SIGMAS = 3.0
ROUNDING = 1e-9
"""Difference of a probability that is none."""
NEARLY = 1e-3
"""Probability that is nearly none."""
NORMAL = 1.959964
"""97.5 % point of the normal distribution."""
FIELDS = [
    "kind", "number", "look", "quantity", "answer", "stated", "truth", "standard_error", "z", "excess", "hard",
    "verdict", "method", "seconds", "remark", "settings", "scene",
]  # fmt: skip
COLUMNS = [
    "asked", "tried", "refused", "stopped", "failed", "warned", "outside", "outside again", "twice", "with a warning",
    "s",
]  # fmt: skip


class Comparison(NamedTuple):
    """An answer ± stated error against truth ± standard error; `hard` where the stated error is no 95 % of a sample."""

    quantity: str
    answer: float
    stated: float
    truth: float
    standard_error: float
    hard: bool

    @property
    def difference(self) -> float:
        """|answer - truth|."""
        return abs(self.answer - self.truth)

    @property
    def z(self) -> float:
        """Difference over the standard error of the truth; inf where this is 0."""
        if self.difference == 0.0:
            return 0.0
        return (self.answer - self.truth) / self.standard_error if self.standard_error else math.inf

    @property
    def excess(self) -> float:
        """Difference over the stated error and three standard errors: above 1 it is a miss."""
        return self.difference / (self.stated + SIGMAS * self.standard_error + ROUNDING)

    @property
    def twice(self) -> bool:
        """Whether the difference is above twice the stated error and three standard errors."""
        return not self.difference <= 2.0 * self.stated + SIGMAS * self.standard_error + ROUNDING

    @property
    def false_alarm(self) -> float:
        """Probability at most of an excess above 1 where nothing is wrong."""
        if self.standard_error == 0.0 and self.hard:
            return 0.0
        own = 0.0 if self.hard else self.stated / NORMAL
        reach = (SIGMAS * self.standard_error + (0.0 if self.hard else self.stated)) or 1.0
        return math.erfc(reach / (math.hypot(own, self.standard_error) or 1.0) / math.sqrt(2.0))


class Finding(NamedTuple):
    """What a scene came to: "answered", "refused", "stopped" or "failed", its comparisons by look, and why not.

    `settings` are those of the audit, `scene` is the scene as TOML in one line of JSON.
    """

    kind: str
    number: int
    outcome: str
    looks: list[list[Comparison]]
    verdict: str
    method: str
    seconds: float
    remark: str
    settings: str
    scene: str

    @property
    def outside(self) -> list[Comparison]:
        """Comparisons of the last look that are outside; none where an earlier look had none."""
        return [one for one in self.looks[-1] if not one.excess <= 1.0] if self.looks else []

    @property
    def once(self) -> bool:
        """Whether the first look was outside."""
        return bool(self.looks) and any(not one.excess <= 1.0 for one in self.looks[0])

    @property
    def missed(self) -> bool:
        """Whether the last look was outside too."""
        return bool(self.outside)

    @property
    def missed_twice(self) -> bool:
        """Whether a comparison of the last look is outside twice the bound."""
        return any(one.twice for one in self.outside)

    @property
    def certain(self) -> bool:
        """Whether nearly all or nearly no blocks stand at every time that was compared, so that little is tried."""
        shares = [one.truth for one in self.looks[0] if one.quantity.startswith("survival")] if self.looks else []
        return all(min(share, 1.0 - share) < NEARLY for share in shares)

    @property
    def ok(self) -> bool:
        """Whether the answer says "ok"."""
        return self.verdict == "ok"


def rows_of(finding: Finding) -> list[list[Any]]:
    """Rows of the CSV: each comparison of each look, or one row without."""
    tail = [finding.verdict, finding.method, round(finding.seconds, 2), finding.remark, finding.settings, finding.scene]
    rows = [
        [finding.kind, finding.number, look, *one[:5], one.z, one.excess, int(one.hard), *tail]
        for look, comparisons in enumerate(finding.looks)
        for one in comparisons
    ]
    return rows or [[finding.kind, finding.number, 0, finding.outcome, *[""] * 7, *tail]]


def findings_of(rows: Iterable[dict[str, str]]) -> list[Finding]:
    """Findings of the rows of a CSV."""
    groups: dict[tuple[str, int], list[dict[str, str]]] = {}
    for row in rows:
        groups.setdefault((row["kind"], int(row["number"])), []).append(row)
    findings = []
    for (kind, number), group in groups.items():
        looks: list[list[Comparison]] = []
        for row in group if group[0]["answer"] else ():
            looks += [[]] * (int(row["look"]) + 1 - len(looks))
            values = (float(row[name]) for name in ("answer", "stated", "truth", "standard_error"))
            looks[-1] = [*looks[-1], Comparison(row["quantity"], *values, bool(int(row["hard"])))]
        first, outcome = group[0], "answered" if looks else group[0]["quantity"]
        own = (
            first["verdict"],
            first["method"],
            float(first["seconds"]),
            first["remark"],
            first["settings"],
            first["scene"],
        )
        findings.append(Finding(kind, number, outcome, looks, *own))
    return findings


def kept(path: pathlib.Path | None) -> list[Finding]:
    """Findings that a file holds; none without one."""
    if path is None or not path.exists():
        return []
    csv.field_size_limit(1 << 24)
    with path.open(encoding="utf-8", newline="") as file:
        return findings_of(csv.DictReader(file))


def keep(path: pathlib.Path, findings: list[Finding]) -> None:
    """Write the file of findings, whole or not at all."""
    rows = [row for finding in findings for row in rows_of(finding)]
    storage.write_csv(path, dict(zip(FIELDS, zip(*rows, strict=True), strict=True)))


def counts_of(findings: list[Finding]) -> list[Any]:
    """Cells of a line of the table: of scenes that say "ok" how many are outside, and of those that warn."""
    answered = [one for one in findings if one.outcome == "answered"]
    ok = [one for one in answered if one.ok]
    return [
        len(findings),
        *(sum(one.outcome == name for one in findings) for name in ("refused", "stopped", "failed")),
        len(answered) - len(ok),
        *(sum(getattr(one, name) for one in ok) for name in ("once", "missed", "missed_twice")),
        sum(one.missed for one in answered if not one.ok),
        f"{sum(one.seconds for one in findings):.0f}",
    ]


def summary(findings: list[Finding]) -> str:
    """Return the table by kind, with its last line of all."""
    lines = [[KINDS[kind], *counts_of(own)] for kind in KINDS if (own := [f for f in findings if f.kind == kind])]
    return table(COLUMNS, [*lines, ["all", *counts_of(findings)]])


def alarms(findings: list[Finding]) -> tuple[int, float]:
    """Return the number of comparisons at first look, and how many of them may be outside by chance at most."""
    first = [one for finding in findings if finding.looks for one in finding.looks[0]]
    return len(first), sum(one.false_alarm for one in first)


def noticed(findings: list[Finding]) -> float:
    """Return the median error that a comparison notices: stated error and three standard errors, where not certain."""
    first = [one for finding in findings if finding.looks and not finding.certain for one in finding.looks[0]]
    return float(np.median([one.stated + SIGMAS * one.standard_error for one in first])) if first else math.nan


def miss_lines(findings: list[Finding]) -> list[list[Any]]:
    """Cells of every scene that is outside again: the comparison that is furthest."""
    lines = []
    for one in findings:
        if one.missed:
            worst = max(one.outside, key=lambda comparison: np.nan_to_num(comparison.excess, nan=math.inf))
            values = f"{worst.answer:.5g} ± {worst.stated:.2g}", f"{worst.truth:.5g} ± {worst.standard_error:.2g}"
            lines.append([
                f"{one.kind}-{one.number}", worst.quantity, *values, f"{worst.excess:.2f}", one.verdict, one.method
            ])  # fmt: skip
    return lines
