"""What the benchmarks share: fair timing in one run, tables, and the sections of pages that they write."""

import json
import pathlib
import re
import statistics
import time

from fpk_rocking.results import storage

ROOT = pathlib.Path(__file__).parents[1]
PAGE = ROOT / "docs" / "benchmarks.md"
VALIDATION = ROOT / "docs" / "validation.md"
DATA = ROOT / "docs" / "benchmarks"
TABLE = re.compile(r"(?m)(?:^\|.*\|\n?)+")


def medians(functions, rounds=5):
    """Time calls in turn, several rounds after a first one that is dropped, so that whatever slows one slows all.

    Parameters
    ----------
    functions : dict of str to callable
        Without arguments.
    rounds : int
        Rounds that count.

    Returns
    -------
    dict of str to float
        Median seconds of each call.
    """
    seconds = {name: [] for name in functions}
    for call in functions.values():
        call()
    for _ in range(rounds):
        for name, call in functions.items():
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
    tables = []
    for block in TABLE.findall(body):
        head, _, *rows = ([cell.strip() for cell in line[2:-2].split(" | ")] for line in block.splitlines())
        tables.append({"columns": head, "rows": [[_number(entry) for entry in row] for row in rows]})
    return tables


def _number(text):
    """Entry of a table as a number, or the text that it is."""
    try:
        return float(text.replace(",", ""))
    except ValueError:
        return text


def write_section(title, body, page=PAGE, values=None):
    """Print a section, keep it as JSON in docs/benchmarks, and put its result into a page.

    On the page stand the first paragraph of the section, or the first two where that ends with a colon, its first
    picture, and a link to the file: in the place of the section of that title or at the end. The site shows all.

    Parameters
    ----------
    title, body : str
        Markdown.
    page : pathlib.Path or None
        By default docs/benchmarks.md; None: no page.
    values : dict, optional
        More that was measured, beside the tables of the body.
    """
    body = body.strip()
    print(f"## {title}\n\n{body}\n", flush=True)
    values_of_file = {"title": title, "text": body.split("\n"), "tables": tables_of(body), **(values or {})}
    storage.write_text(DATA / f"{slug(title)}.json", json.dumps(values_of_file, indent=1, ensure_ascii=False) + "\n")
    if page is None:
        return
    pictures = re.findall(r"(?m)^!\[.*$", body)[:1]
    section = "\n\n".join([f"## {title}", result_of(body), *pictures, ""])
    section += f"[Method and tables](benchmarks/{slug(title)}.json)\n"
    parts = re.split(r"(?m)^(?=## )", page.read_text(encoding="utf-8"))
    places = [i for i, part in enumerate(parts) if part.startswith(f"## {title}\n")]
    if places:
        parts[places[0]] = section
    else:
        parts.append(section)
    storage.write_text(page, "\n".join(part.strip() + "\n" for part in parts))


def result_of(body):
    """Return the result with which a section begins, as it stands on a page."""
    first, second, *_ = [*body.split("\n\n"), ""]
    return f"{first}\n\n{second}" if first.endswith(":") else first


def slug(title):
    """Name of a file for a title."""
    return re.sub(r"[^a-z0-9]+", "_", title.lower()).strip("_")
