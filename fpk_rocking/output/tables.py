"""What a command writes to the screen: results as tables on standard output, and progress on standard error.

Progress is a bar in a terminal, now and then a line elsewhere.
"""

import contextlib
import math
import sys
import time
from collections.abc import Iterable, Iterator, Sequence

import numpy as np
from rich import box
from rich.console import Console
from rich.table import Table

from fpk_rocking.base.checks import Progress
from fpk_rocking.results.remarks import noise_text


def show(title, table, sentences):
    """Print a title, a table and the sentences that belong below it; a pipe or a file gets text 100 columns wide."""
    console = Console(highlight=False)
    if not console.is_terminal:
        console = Console(highlight=False, width=100)
    console.print(title, markup=False, style="bold")
    console.print(table)
    for sentence in sentences:
        console.print(sentence, markup=False, style="dim")


def result_table(result) -> tuple[str, Table, tuple[str, ...]]:
    """Return (title, table, sentences) of a `SurvivalResult`: survival and overturned probability at each time."""
    columns, seconds = _times(result), result.time_s if result.cycles is not None else None
    columns["survival"] = [f"{value:.5f}" for value in result.survival]
    if result.interval is not None:
        columns["95 % interval"] = [_limits(limits, 5) for limits in result.interval]
    if getattr(result, "replacement", None) is not None:
        columns["total ±"] = [f"{error:.5f}" for error in result.total_error[:, 0]]
    for name, values in zip(("overturned left", "overturned right"), np.transpose(result.overturned), strict=True):
        columns[name] = [f"{value:z.5f}" for value in values]
    last, outcome = len(result.times) - 1, result.metadata.get("outcome", "")
    at = result.when(last) if seconds is None else f"{result.when(last)} ({seconds[last]:.4g} s)"
    made_by = f"{result.label}: {noise_text(result.scene.noise)}{', ' * bool(outcome)}{outcome}"
    return (
        f"{result.overturning_text()}, {at}\n{made_by}",
        text_table(columns, zip(*columns.values(), strict=True)),
        verdict_first(result.trust, *_account(result), *result.remarks),
    )


def probability_table(answer) -> tuple[str, Table, tuple[str, ...]]:
    """Return (title, table, sentences) of a `Probability`, with a row for each time."""
    columns = _times(answer)
    probabilities = {"survival": answer.survival, "overturned left": answer.left, "overturned right": answer.right}
    for (name, values), errors in zip(probabilities.items(), answer.errors.T, strict=True):
        columns[name] = [f"{value:z.5f} ± {error:.1g}" for value, error in zip(values, errors, strict=True)]
    closing = f"Seed {answer.seed}, {answer.seconds:.1f} s."
    return (
        answer.title,
        text_table(columns, zip(*columns.values(), strict=True)),
        verdict_first(answer.trust, *answer.remarks, closing),
    )


def _times(result):
    """Columns of the rows of a `RowResult`: cycles, with seconds where they are known, or times."""
    columns = {result.row_label.removeprefix("forcing "): [f"{time:.6g}" for time in result.row_values]}
    if result.cycles is not None and result.time_s is not None:
        columns["time, s"] = [f"{time:.4g}" for time in result.time_s]
    return columns


def _account(result):
    """Yield the error figures of a `SurvivalResult` beside that of the verdict, then seed, steps and seconds."""
    yield from (figure.message for figure in result.diagnostics if figure.value is not None and figure.message)
    settings = {} if result.deterministic else {"seed {}": result.metadata.get("seed")}
    if getattr(result, "method", "exact") != "exact":
        settings["{} steps a cycle"] = result.steps_per_cycle
    parts = [text.format(value) for text, value in settings.items() if value is not None]
    text = ", ".join([*parts, f"{result.wall_s:.1f} s."])
    yield text[0].upper() + text[1:]


def comparison_table(comparisons) -> tuple[str, Table, tuple[str, ...]]:
    """Return (title, table, sentences) of comparisons with one reference, cycle by cycle.

    For each cycle there is a row for the reference, the second result of each, and one for each result held against it.
    """
    names = "cycles", "result", "survival", "95 % interval", "z", "L1 (floor)", "Hellinger (floor)"
    table = text_table(names, *(_compared(comparisons, *place) for place in enumerate(comparisons[0].joint_cycles)))
    sentences = dict.fromkeys(sentence for compared in comparisons for sentence in compared.remarks)
    title = "Survival, and distance of the joint densities from the first row of each cycle"
    note = (
        "z: difference of survival over its standard error. L1, Hellinger: distances of the joint densities. Floor: "
        "the distance that sampling noise alone gives."
    )
    closing = (*_sizes(comparisons), note, *filter(None, [_melnikov(comparisons)]), *sentences)
    for compared in reversed(comparisons):
        verdict, *closing = verdict_first(compared.trust, *closing)
        label = f"{compared.names[0]} against {compared.names[1]}, " if len(comparisons) > 1 else ""
        closing = f"{label}{verdict}", *closing
    return title, table, closing


def _compared(comparisons, place, cycle):
    """Yield the rows of one cycle, the `place`-th of the cycles of joint densities: the reference, then each result."""
    yield str(cycle), *_survival_cells(comparisons[0], cycle, 1), "", "", ""
    for compared in comparisons:
        yield (
            "",
            *_survival_cells(compared, cycle, 0),
            "" if math.isnan(compared.z[cycle]) else f"{compared.z[cycle]:+.1f}",
            f"{compared.l1[place]:.4f} ({compared.l1_floor[place]:.4f})",
            f"{compared.hellinger[place]:.4f} ({compared.hellinger_floor[place]:.4f})",
        )


def verdict_first(trust, *sentences) -> tuple[str, ...]:
    """Return the verdict of a `Trust`, then those of `sentences` that are no reason of it."""
    return str(trust), *(sentence for sentence in sentences if sentence not in trust.reasons)


def text_table(names: Iterable[str], *groups: Iterable[Sequence[str]]) -> Table:
    """Return a table of texts below the names of its columns, with a line between groups of rows."""
    table = Table(box=box.SIMPLE_HEAD, show_edge=False, pad_edge=False, padding=(0, 1, 0, 0))
    sides = {"result": "left", "95 % interval": "center", "95 %": "center", "± estimate": "center"}
    for name in names:
        table.add_column(name, justify=sides.get(name, "right"))
    for rows in groups:
        for row in rows:
            table.add_row(*row)
        table.add_section()
    return table


def _sizes(comparisons) -> list[str]:
    """Sizes of the samples, as a list of at most one sentence."""
    sizes = {
        name: size
        for compared in comparisons
        for name, size in zip(compared.names, compared.realizations, strict=True)
        if size is not None
    }
    return [f"Realizations: {', '.join(f'{name} {size:,}' for name, size in sizes.items())}."] if sizes else []


def _melnikov(comparisons) -> str:
    """Sentence with the figures of the Melnikov process for each noise; empty where they are not defined."""
    first = comparisons[0]
    if first.melnikov_amplitude is None:
        return ""
    parts = {
        (f"{deviation:.4f}", f"{margin:+.4f}", f"{flux:.5f}")
        for compared in comparisons
        for deviation, margin, flux in zip(
            compared.melnikov_deviation, compared.melnikov_margin, compared.phase_flux, strict=True
        )
    }
    noisy = "; ".join(
        f"deviation σ_M = {d} by the noise, margin √(D_m² + σ_M²) - M = {m}, phase flux Φ = {f}"
        for d, m, f in sorted(parts)
    )
    loss = f"against the impact loss M = {first.melnikov_loss:.4f}"
    return f"Melnikov process: amplitude D_m = {first.melnikov_amplitude:.4f} by the forcing {loss}; {noisy}."


def _survival_cells(compared, cycle, which):
    """(engine, survival, 95 % interval), texts, of result 0 or 1 of a `Comparison` after a cycle."""
    limits = compared.interval[cycle, which]
    text = "" if math.isnan(limits[0]) else _limits(limits, 4)
    return compared.names[which], f"{compared.survival[cycle, which]:.4f}", text


def _limits(limits, digits) -> str:
    """Two limits as a text with a number of digits behind the point."""
    return f"{limits[0]:.{digits}f}–{limits[1]:.{digits}f}"


_SECONDS_BETWEEN_LINES = 10.0


@contextlib.contextmanager
def reporting(label: str) -> Iterator[Progress]:
    """Show the progress of one piece of work on standard error: ``with reporting("density") as progress: ...``.

    Yields the `progress` that engines accept, called with ``(done, total)``.

    Parameters
    ----------
    label : str
        Name of the work.

    Examples
    --------
    >>> from fpk_rocking import load_scene
    >>> from fpk_rocking.output.tables import reporting
    >>> from montecarlo import simulate
    >>> with reporting("paths") as progress:
    ...     ensemble = simulate(load_scene("main"), cycles=4, realizations=1000, progress=progress)
    """
    if sys.stderr.isatty():
        with _bar(label) as report:
            yield report
    else:
        yield _lines(label)


@contextlib.contextmanager
def _bar(label):
    """Yield a `progress` function that draws a bar on the terminal."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

    columns = (TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn(), TextColumn("left"))
    columns = (*columns, TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True)) as progress:
        task = progress.add_task(label, total=None)
        yield lambda done, total: progress.update(task, completed=done, total=total)


def _lines(label):
    """Return a `progress` function that prints a line from time to time."""
    started = last = time.monotonic()
    # Time and work done at the first report of any: machine code is compiled by then, work may go on from a file.
    first = 0.0, 0

    def report(done, total):
        nonlocal last, first
        now = time.monotonic()
        first = first if first[1] else (now, done)
        if now - last >= _SECONDS_BETWEEN_LINES and done < total:
            last = now
            text = f"{label}: {100.0 * done / total:.0f} % after {now - started:.0f} s"
            if done > first[1]:
                text += f", about {(now - first[0]) * (total - done) / (done - first[1]):.0f} s left"
            sys.stderr.write(text + "\n")

    return report
