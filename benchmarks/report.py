"""What the benchmarks share: fair timing in one run, tables, and the sections of pages that they write."""

import json
import pathlib
import re
import statistics
import time

from fpk_rocking.results import storage

ROOT = pathlib.Path(__file__).parents[1]
PAGE = ROOT / "docs" / "benchmarks.md"
HEAD = """# Benchmarks

Each section is written by a script in `benchmarks/` (`make bench`), on 2 cores. S is survival, the probability of not
having overturned, and S(k) that after k cycles. dS is the largest error in survival over the cycles. L1 of the bins is
the sum of |difference| of the probabilities of bins of angle and velocity. *tol* is the error in survival that is asked
of the density solver. The *main scene* and the *second scene* come with the package (`load_scene`); for the density
solver, and where white noise is said, band noise is replaced by the equivalent white noise. Times in a table are
comparable with each other, because the methods took turns in one run; a first call that compiles is never timed. The
tables are also in `benchmarks/` beside this page, as JSON.
"""
TABLE = re.compile(r"(?m)(?:^\|.*\|\n?)+")


def medians(calls, rounds=5):
    """Time calls in turn, several rounds after a first one that is dropped, so that whatever slows one slows all.

    Parameters
    ----------
    calls : dict of str to callable
        Without arguments.
    rounds : int
        Rounds that count.

    Returns
    -------
    dict of str to float
        Median seconds of each call.
    """
    seconds = {name: [] for name in calls}
    for call in calls.values():
        call()
    for _ in range(rounds):
        for name, call in calls.items():
            begin = time.perf_counter()
            call()
            seconds[name].append(time.perf_counter() - begin)
    return {name: statistics.median(values) for name, values in seconds.items()}


def table(head, rows):
    """Return a Markdown table; entries are text or numbers."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(map(str, line)) + " |" for line in lines)


def tables_of(body):
    """Tables of a section: columns and rows, numbers where an entry is nothing but one."""
    found = []
    for block in TABLE.findall(body):
        head, _, *rows = ([cell.strip() for cell in line[2:-2].split(" | ")] for line in block.splitlines())
        found.append({"columns": head, "rows": [[_number(entry) for entry in row] for row in rows]})
    return found


def _number(text):
    try:
        return float(text.replace(",", ""))
    except ValueError:
        return text


def write_section(title, body, page=PAGE, head=HEAD, values=None):
    """Print a section and put it into a page, in the place of the one with the same title or at the end.

    What was measured goes into a JSON file of that title, in a folder that is named as the page.

    Parameters
    ----------
    title, body : str
        Markdown.
    page : pathlib.Path
        By default docs/benchmarks.md.
    head : str
        What a new page begins with.
    values : dict, optional
        What was measured; by default the tables of the body.
    """
    section = f"## {title}\n\n{body.strip()}\n"
    print(section, flush=True)
    text = page.read_text(encoding="utf-8") if page.exists() else head
    parts = re.split(r"(?m)^(?=## )", text)
    places = [i for i, part in enumerate(parts) if part.startswith(f"## {title}\n")]
    if places:
        parts[places[0]] = section
    else:
        parts.append(section)
    storage.write_text(page, "\n".join(part.strip() + "\n" for part in parts))
    folder = page.with_suffix("")
    folder.mkdir(exist_ok=True)
    values = {"tables": tables_of(section)} if values is None else values
    storage.write_text(folder / f"{slug(title)}.json", json.dumps(values, indent=1, ensure_ascii=False) + "\n")


def slug(title):
    """Name of a file for a title."""
    return re.sub(r"[^a-z0-9]+", "_", title.lower()).strip("_")
