"""The density solver on hard cases, judged by white-noise Monte Carlo; writes its section of docs/validation.md.

python benchmarks/hard_cases.py                 # every row
python benchmarks/hard_cases.py "D = 0.05"      # some rows, printed only
python benchmarks/hard_cases.py --references    # tests/data/hard_cases.npz first: rows that are new or changed
"""

import math
import sys
import time
import warnings
from typing import NamedTuple

import numpy as np
from hard_rows import MAIN, SEED, Reference, Row, load, rows, save, simulated
from report import VALIDATION, table, write_section

from fpk_rocking import solve_fpk
from fpk_rocking.density.resolution import in_rest
from fpk_rocking.results import sampling as distances

TOL = 1e-3
SIGMAS = 3.5
BINS = 10.0
COLUMNS = [
    "row", "S", "dS", "estimate", "L1 of the bins", "negative", "truncated", "mass defect", "time", "verdict"
]  # fmt: skip


class Finding(NamedTuple):
    """What a row came to: the figures of its table line, the verdict, and the text of its refusal or warnings."""

    cells: list
    verdict: str
    remark: str = ""

    @property
    def stands(self):
        """Whether the row is inside its tolerance, or refused."""
        return not self.verdict.startswith("**FAILS**")


def sampling(reference: Reference):
    """Return survival of a reference and its standard errors, not 0 where every path stands or none."""
    paths = int(reference.paths)
    likely = (reference.standing + 1.0) / (paths + 2.0)
    return reference.standing / paths, np.sqrt(likely * (1.0 - likely) / paths)


def survival_errors(evolution, reference: Reference):
    """Return the largest error in survival and its standard error, and the most that sampling leaves unexplained."""
    truth, noise = sampling(reference)
    errors = np.asarray(evolution.survival)[: truth.size] - truth
    worst = int(np.abs(errors).argmax())
    return errors[worst], noise[worst], (np.abs(errors) - SIGMAS * noise).max()


def bin_distances(evolution, reference: Reference):
    """Return, for both binned cycles, L1 of the bins, what sampling explains on average, and at most."""
    distances_and_limits = []
    for cycle, counts in zip(reference.binned, reference.counts, strict=True):
        edges, paths = (reference.angle_edges, reference.velocity_edges), int(reference.paths)
        ours = _pooled(evolution.bin_probabilities(int(cycle), *edges), edges)
        theirs = _pooled(counts, edges) / paths
        floor = distances.l1_floor(np.clip(ours, 0.0, 1.0), math.inf, paths)
        # The bins' absolute deviations are nearly independent, each of variance (1 - 2/pi) p (1 - p) / n.
        spread = math.sqrt((1.0 - 2.0 / math.pi) * float((theirs * (1.0 - theirs)).sum()) / paths)
        distances_and_limits.append((distances.l1(ours, theirs), floor, floor + SIGMAS * spread))
    return distances_and_limits


def _pooled(bins, edges):
    """Add up the bins about the origin and in the region of rest, as the solver does: flat, that one bin at the end."""
    rest = np.outer(*((line[:-1] <= 0.0) & (line[1:] >= 0.0) for line in edges)).astype(bool)
    rest |= in_rest(*(0.5 * (line[:-1] + line[1:]) for line in edges))
    return np.append(bins[~rest], bins[rest].sum())


def tail_rates(evolution, reference: Reference):
    """Return the loss a cycle of log survival after the reference ends, that of its last part, and its standard error.

    The reference's begins at its 10th cycle; the paths of its end are then a sample of those that stood at its begin.
    """
    first, last = reference.standing[10], reference.standing[-1]
    span = reference.standing.size - 11
    survival = np.asarray(evolution.survival)
    mine = math.log(survival[reference.standing.size - 1] / survival[-1]) / (survival.size - reference.standing.size)
    return mine, math.log(first / last) / span, math.sqrt(1.0 / last - 1.0 / first) / span


def faults(row: Row, evolution, reference: Reference):
    """Return the names of what a result gets wrong by its own tolerance."""
    tol = evolution.tol
    _, _, beyond = survival_errors(evolution, reference)
    names = []
    if not beyond <= tol:
        names.append("survival")
    if not beyond <= evolution.error_estimate:
        names.append("estimate")
    if not evolution.truncated[-1] <= tol:
        names.append("truncated")
    if not all(distance <= most + BINS * tol for distance, _, most in bin_distances(evolution, reference)):
        names.append("bins")
    if row.cycles > row.sampled:
        mine, theirs, noise = tail_rates(evolution, reference)
        if not abs(mine - theirs) <= tol + SIGMAS * noise:
            names.append("tail")
    return names


def judged(row: Row, reference: Reference | None, tol=TOL):
    """Solve a row and hold it against its reference.

    Returns
    -------
    Finding
    """
    begin = time.perf_counter()
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            evolution = solve_fpk(row.scene, cycles=row.cycles, tol=tol)
        except ValueError as error:
            message = str(error)
            refused = ": got " in message and ", accepted: " in message
            return Finding(["-"] * 8, "refused" if refused else f"**FAILS** {type(error).__name__}", message)
    seconds = time.perf_counter() - begin
    if reference is None:
        return Finding(["-"] * 8, "**FAILS** solved, but nothing is known to judge it by")
    wrong, remark = faults(row, evolution, reference), "; ".join(str(warning.message) for warning in caught)
    verdict = f"**FAILS** {', '.join(wrong)}" if wrong else "inside"
    if evolution.error_estimate > tol:
        verdict += "; estimate above tol"
    if remark:
        verdict += "; with a warning"
    if row.cycles > row.sampled:
        rates = "loss of log S a cycle {:.5f}, reference {:.5f} ± {:.5f}".format(*tail_rates(evolution, reference))
        remark = "; ".join(filter(None, [rates, remark]))
    error, noise, _ = survival_errors(evolution, reference)
    cells = [
        f"{reference.standing[-1] / reference.paths:.4f} ({reference.paths:,})",
        f"{error:+.1e} ± {noise:.0e}",
        f"{evolution.error_estimate:.0e}",
        ", ".join(f"{distance:.4f} ({floor:.4f})" for distance, floor, _ in bin_distances(evolution, reference)),
        f"{evolution.negative_mass:.0e}",
        f"{evolution.truncated[-1]:.0e}",
        f"{evolution.mass_defect:.0e}",
        seconds,
    ]
    return Finding(cells, verdict, remark)


def renew_references():
    """Simulate the references that are missing or belong to another scene or size, and write them as they come."""
    stored, wanted = load(), [row for row in rows() if row.paths]
    references = {row.name: stored[row.name] for row in wanted if row.name in stored and stored[row.name].is_of(row)}
    for row in wanted:
        if row.name not in references:
            references[row.name] = simulated(row)
            save(references)
            print(f"{row.name}: {references[row.name].standing[-1] / row.paths:.5f} stand", flush=True)
    save(references)


def main():
    """Run the rows and write the table, or with names given print theirs."""
    asked = sys.argv[1:]
    if "--references" in asked:
        renew_references()
        asked.remove("--references")
    references = load()
    solve_fpk(MAIN, cycles=1, tol=TOL)  # compiles
    findings = {}
    for row in rows():
        if not asked or row.name in asked:
            findings[row.name] = judged(row, references.get(row.name))
            print(row.name, findings[row.name], flush=True)
    if not asked:
        write_table(findings)


def write_table(findings):
    """Write the section of the table."""
    unit = findings["main scene"].cells[-1]
    lines, remarks = [], []
    for name, finding in findings.items():
        *cells, seconds = finding.cells
        duration = seconds if isinstance(seconds, str) else f"{seconds / unit:.2f}"
        lines.append([name, *cells, duration, finding.verdict])
        if finding.remark:
            remarks.append(f"* {name}: {finding.remark}")
    standing = sum(finding.stands for finding in findings.values())
    write_section(
        "Hard cases",
        f"""**Result**, `solve_fpk` at tol {TOL:g}: {standing} of {len(findings)} rows are inside their tolerance or
refused, with a reason.

**Scenes.** The main scene with white noise has the amplitude A = 4.6, frequency Ω = 2.7 and phase Ψ = π of the forcing,
the restitution e = 0.5, the diffusion D = 0.00628, the cut-off π/2, a start from rest and 10 cycles. A row has these
values except for those that it names.

**Columns.** The reference of a row is a white-noise Monte Carlo (`tests/data/hard_cases.npz`, seed {SEED}).

* S: survival of the reference at its end (number of its paths).
* dS: largest error of the solver in survival ± its standard error; estimate: the solver's own.
* L1 of the bins of 0.1, at two cycles; in brackets that of sampling alone. The four bins about the origin, where blocks
  at rest are, count as one.
* negative, truncated, mass defect: integral of the negative density; mass beyond the mesh; how far all masses
  are from adding up to 1.
* time: 1 is the main scene's {unit:.1f} s in this run, good to a factor 2 where other work shares the cores.

**Verdict.** A row is *inside* if at all cycles of the reference

* |dS| is at most tol, and at most the solver's own estimate, each with {SIGMAS} standard errors added;
* L1 is at most {BINS:g} tol above that of sampling, with {SIGMAS} standard errors added;
* at most tol is truncated.

What fails is named: survival, estimate, bins, truncated. If all {len(findings)} rows are right, the probability
that chance makes one of them fail is below a hundredth, because tol is added. A row of more cycles than its reference
is also judged by its later loss of log S in a cycle (tail).

{table(COLUMNS, lines)}

Warnings, and reasons of refusals:

{chr(10).join(remarks)}
""",
        VALIDATION,
    )


if __name__ == "__main__":
    main()
