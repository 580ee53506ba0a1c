"""Numbers in the prose of pages: each was measured into a file that the page names, or is printed by a tested block.

Held is a number if a file or block of the page's sources has one that rounds to it. Whole numbers below 100 count what
a reader sees on the page, and are left out, as are years, and what stands in code; shares in per cent are not.
"""

import functools
import importlib
import importlib.util
import json
import pathlib
import re

import pytest
from PIL import Image
from test_pages import PAGES

from fpk_rocking.results import pictures

ROOT = pathlib.Path(__file__).parents[2]
DOCS = ROOT / "docs"
SPEC = importlib.util.spec_from_file_location("gallery_of_numbers", ROOT / "cases" / "gallery.py")
GALLERY = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(GALLERY)

LONG = 100
"""A longer list in a JSON file is data, of which no page has a number: one of so many rounds to almost anything."""

# Where a page's numbers come from, beside the files that it links and its own blocks. What the gallery says is held
# below, picture by picture.
EQUAL = "docs/benchmarks/time_at_equal_error.json"
SOURCES = {
    "README.md": ["docs/tutorials/first_block.md", EQUAL, "docs/gallery.md"],
    "docs/engines.md": ["docs/benchmarks/physics_engines.json", "docs/benchmarks/shake_table_tests.json"],
    "docs/findings.md": [path.relative_to(ROOT).as_posix() for path in sorted(ROOT.glob("findings/*.sh"))],
    "docs/howto/large_and_rare.md": ["docs/benchmarks/monte_carlo_accuracy_of_the_engines.json"],
    "docs/index.md": ["docs/tutorials/first_block.md"],
    "docs/long_horizon.md": ["docs/benchmarks/one_cycle_operator.json"],
    "docs/numerics.md": ["docs/gallery/rest.json", "docs/benchmarks/density_solver_filtered_noise.json"],
    "docs/monte_carlo.md": ["docs/benchmarks/monte_carlo_accuracy_of_the_engines.json", "docs/gallery/fig07.json"],
    "docs/paper.md": [path.relative_to(ROOT).as_posix() for path in sorted(DOCS.glob("gallery/*.json"))],
    "docs/reference_values.md": [path.relative_to(ROOT).as_posix() for path in DOCS.glob("reference_values/*.toml")],
    "docs/results.md": ["fpk_rocking/results/trust.py"],
    "docs/tutorials/long_run.md": ["docs/benchmarks/one_cycle_operator.json"],
    "docs/tutorials/paper_fig06.md": ["docs/gallery/fig06.json"],
    "docs/validation.md": [EQUAL],
    "docs/world.md": ["docs/benchmarks/shake_table_tests.json"],
}
PAGES_OF_THE_PAPER = "volume and pages of the paper"
# Numbers that none of these holds, by page, and why they may stand there.
ALLOWED = {
    "README.md": {
        "92": "as docs/world.md, which is held",
        "3.11": "version of Python",
        **dict.fromkeys(("122", "719", "727"), PAGES_OF_THE_PAPER),
    },
    "docs/engines.md": {
        ".25": "product of two frictions of .5, in the code",
        **dict.fromkeys((".001", ".0005"), "settings, in the code"),
        "238": "as docs/world.md, phrases of tests/benchmarks/test_shake_table.py",
    },
    "docs/faq.md": {
        ".163": "the smallest restitution under white noise, docs/theory.md",
    },
    "docs/fragility.md": {
        ".37": "1 - .025^(1/8), the upper limit of Clopper and Pearson for none of eight",
        ".1": "step of the search, in the code",
    },
    "docs/howto/hazards.md": {
        "1.2": "default of pelicun, docs/benchmarks/openquake_and_pelicun.json runs without it",
        ".01": "shortest period, in the code",
    },
    "docs/howto/install.md": {"3.11": "version of Python"},
    "docs/howto/noise.md": {
        "100": "least number of harmonics, in the code",
        **dict.fromkeys(("40,000", "10,000"), "paths of a check, in the code"),
    },
    "docs/limits.md": {
        ".7": "usual friction",
        **dict.fromkeys((".95", ".97", ".67"), "ElGawady et al. 2011"),
    },
    "docs/numerics.md": {
        **dict.fromkeys(("108", "256"), "cells of the finest mesh, exploratory paths; in the code"),
        **dict.fromkeys((".42", "1.5"), "factors of the estimate, in the code"),
        "2.1": "title of docs/benchmarks/convergence.png",
    },
    "docs/howto/upper_floors.md": {"1.3": "first mode at the top of a building, usual"},
    "docs/howto/records.md": {".001": "bound of what is told, in the code"},
    "docs/howto/large_and_rare.md": {"1e-8": "reach of splitting, as docs/gallery/low_noise.json"},
    "docs/monte_carlo.md": {
        "1e-12": "bound in tests/montecarlo",
        "3.5e-5": ".35 in units of 1e-4 in the file that is linked",
        ".075": "length of an interval, in the code",
    },
    "docs/paper.md": {
        "727": PAGES_OF_THE_PAPER,
        "2.718": "Euler's number",
        ".04": "variance of the main scene",
        "200": "cycles of Fig. 7",
    },
    "docs/reference_values.md": {
        "4.8": "seconds of the record",
        "400,000": "paths of benchmarks/reference_values.py",
        "350": "false alarms of the rule",
        "1.5": "frequency of the shaking, Hz",
    },
    "docs/reliability.md": {
        **dict.fromkeys(("512", "2.5"), "limits of memory, in the code"),
        **dict.fromkeys(("130", "143"), "exit status of a command that a signal ends"),
    },
    "docs/results.md": {
        "2.718": "Euler's number",
        **dict.fromkeys(("2.43", ".865"), "example of a message"),
    },
    "docs/tutorials/fragility.md": {
        **dict.fromkeys(("0.1", "0.5"), "docs/tutorials/pgv.csv"),
        **dict.fromkeys(("1.15", "1.42"), "tests/cases/test_fema_p58.py"),
    },
    "docs/related.md": dict.fromkeys(("105087", "117", "125"), "volumes and pages of papers"),
    "docs/validation.md": {
        "1e-12": "docs/monte_carlo.md",
        "5e-8": "docs/benchmarks/one_cycle_operator.json, rounded",
    },
    "docs/world.md": {
        **dict.fromkeys(("582", ".76"), "Chen et al. 2024, and the repository that the page links"),
        **dict.fromkeys(("238", ".993", ".978", "2.8", "3.4"), "phrases of tests/benchmarks/test_shake_table.py"),
    },
}

# Pictures of the benchmarks, and the files of their numbers.
MEASURED = {
    "convergence.png": "density_solver_mesh_nodes_and_orders.json",
    "physics_engines.png": "physics_engines.json",
} | {f"shake_table_{name}.png": "shake_table_tests.json" for name in ("fragility", "missed", "reliability")}

FENCE = re.compile(r"^( *)```.*?^\1```$", re.MULTILINE | re.DOTALL)
NOT_PROSE = re.compile(r"`[^`\n]*`|!\[[^\]]*\]\([^)]*\)|\]\([^)]*\)|https?://\S+|\$[^$\n]+\$")
NUMBER = re.compile(r"(?<![\w.,])(?:(?:\d{1,3}(?:,\d{3})+|\d+)(?:\.\d+)?|\.\d+)(?:e[-+]?\d+)?(?!\w)")


def numbers(text):
    """Numbers of a text, as written, that are shares in per cent, or no whole numbers below 100 and no years.

    95 % is the level of an interval.
    """
    written = ((match[0], text.startswith(" %", match.end())) for match in NUMBER.finditer(text))
    return [
        number
        for number, share in written
        if "." in number or "e" in number or not _small(number) or (share and number != "95")
    ]


def _small(written):
    """Whether a whole number counts what is on the page, or is a year."""
    value = int(written.replace(",", ""))
    return value < 100 or value == 1000 or ("," not in written and 1900 < value < 2100)


def prose(page):
    """Text of a page without code, pictures, links and formulas."""
    return NOT_PROSE.sub("]", FENCE.sub("", page.read_text(encoding="utf-8")))


@functools.cache
def held(path):
    """Values of all numbers of a JSON file, or of the blocks of a page; of the gallery, of what its pictures say."""
    text = (ROOT / path).read_text(encoding="utf-8")
    if path.endswith(".json"):
        text = json.dumps(_without_data(json.loads(text)))
    if path.endswith(".md"):
        titles = map(_title_of, DOCS.glob("[bg]*/*.png")) if path == "docs/gallery.md" else ()
        text = "\n".join([*(match[0] for match in FENCE.finditer(text)), *titles])
    found = re.findall(r"\d*\.?\d+(?:e[-+]?\d+)?", re.sub(r"(?<=\d),(?=\d{3})", "", text))
    return {float(number) for number in found}


def _title_of(path):
    with Image.open(path) as picture:
        return GALLERY.title_of(picture)


def _without_data(entry):
    """Entry of a JSON file without its long lists."""
    if isinstance(entry, dict):
        return {name: _without_data(value) for name, value in entry.items()}
    if isinstance(entry, list):
        return [_without_data(value) for value in entry] if len(entry) <= LONG else []
    return entry


def passages(page):
    """Passages of a page, each with the files that its numbers come from: a row of a table, or the rest of a section.

    These are the files that the passage links, a case by the numbers of its picture, the blocks of the page and what
    `SOURCES` has; the last not for a row that links files of its own. References are left out.
    """
    name = page.relative_to(ROOT).as_posix()
    for section in FENCE.sub("", page.read_text(encoding="utf-8")).split("\n## "):
        if section.startswith("References"):
            continue
        rows = re.findall(r"^\|.*$", section, re.MULTILINE)
        rest = re.sub(r"^\|.*$", "", section, flags=re.MULTILINE)
        for text in (*rows, rest):
            own = _linked(page, text)
            shared = [] if own and text is not rest else [*_linked(page, section), *SOURCES.get(name, [])]
            yield text, [name, *own, *shared]


def _linked(page, text):
    """Files of numbers that a text links, from the root of the repository."""
    files = [(page.parent / link).resolve() for link in re.findall(r"\]\(([^)#\s]+\.(?:json|py))\)", text)]
    files = [
        DOCS / "gallery" / GALLERY.numbers_of(path.stem) if path.parent.name == "cases" else path for path in files
    ]
    return [path.relative_to(ROOT).as_posix() for path in files if path.suffix == ".json"]


def is_held(written, values, per_cent=False):
    """Whether a value rounds to a number as it is written, or, of a share in per cent, the value or what it leaves."""
    number = float(written.replace(",", ""))
    mantissa, _, exponent = written.replace(",", "").partition("e")
    digits = len(mantissa.partition(".")[2]) if "." in mantissa else -max(min(_zeros(mantissa), len(mantissa) - 2), 0)
    unit = 10.0 ** (int(exponent or 0) - digits)
    if per_cent:
        values = values | {100.0 * value for value in values} | {100.0 - 100.0 * value for value in values}
    return any(abs(value - number) <= 0.5000001 * unit for value in values)


def _zeros(whole):
    """Zeros at the end of a whole number, which may be rounded."""
    return len(whole) - len(whole.rstrip("0"))


def unheld(page):
    """Numbers of a page's prose that no source and no exception holds."""
    allowed, missing = ALLOWED.get(page.relative_to(ROOT).as_posix(), {}), []
    for text, files in passages(page):
        values, plain = set().union(*map(held, files)), NOT_PROSE.sub("]", text)
        missing += [n for n in numbers(plain) if n not in allowed and not is_held(n, values, f"{n} %" in plain)]
    return missing


# Pages that `make docs` makes of measured numbers are left out.
WRITTEN = [page for page in PAGES if page.name != "gallery.md" and page.parent.name not in {"cases", "evidence"}]


@pytest.mark.parametrize("page", WRITTEN, ids=lambda page: page.name)
def test_numbers_of_a_page_are_measured_or_run(page):
    assert unheld(page) == []


class TitleError(Exception):
    """The title of a picture, raised where the drawing would begin."""


def titles(monkeypatch):
    """Titles of the pictures that are drawn from what the repository keeps of their numbers, by their names there."""

    def page(*arguments):
        raise TitleError(arguments[2])

    def title_of(draw, *values):
        with pytest.raises(TitleError) as caught:
            draw("picture.png", *values)
        return str(caught.value)

    monkeypatch.setattr(pictures, "page", page)
    monkeypatch.syspath_prepend(ROOT / "benchmarks")
    equal, drawing = _numbers_in(ROOT / EQUAL), importlib.import_module("equal_pictures")
    yield "time_at_equal_error.png", title_of(drawing.draw_errors, equal["scenes"]["main"])
    yield "time_at_equal_error_growth.png", title_of(drawing.draw_growth, equal["noise"], equal["horizon"], 1e-2)
    (table,) = _numbers_in(DOCS / "benchmarks" / MEASURED["convergence.png"])["tables"]
    yield "convergence.png", title_of(importlib.import_module("convergence").draw, table)
    for name in GALLERY.DRAWN_FROM_NUMBERS:
        numbers, (picture,) = DOCS / "gallery" / GALLERY.numbers_of(name), GALLERY.PICTURES[name].values()
        yield picture, title_of(importlib.import_module(name).draw, _numbers_in(numbers))


def _numbers_in(path):
    return json.loads(path.read_text(encoding="utf-8"))


def test_what_pictures_say_follows_from_their_numbers(monkeypatch):
    """Of a picture not drawn from them alone, each number."""
    redrawn, missing = dict(titles(monkeypatch)), {}
    basins, tests = (_numbers_in(DOCS / file) for file in ("gallery/basins.json", "benchmarks/shake_table_tests.json"))
    (noisiest,) = (row for row in basins["erosion"] if row["variance"] == 0.04)
    left = {area / alone for area, (alone, _) in zip(noisiest["area"], basins["area_without_noise"], strict=True)}
    derived = {"basins.png": left, "shake_table_missed.png": {len(tests["tests"]["id"])}}
    cases = GALLERY.PICTURES.items()
    files = MEASURED | {picture: GALLERY.numbers_of(name) for name, drawn in cases for picture in drawn.values()}
    for path in sorted(DOCS.glob("gallery/*.png")) + sorted(DOCS.glob("benchmarks/*.png")):
        title = _title_of(path)
        if path.name in redrawn:
            assert title == redrawn[path.name], path.name
        else:
            values = held(f"docs/{path.parent.name}/{files[path.name]}") | derived.get(path.name, set())
            missing[path.name] = [n for n in numbers(title) if not is_held(n, values, f"{n} %" in title)]
    assert {name: some for name, some in missing.items() if some} == {}


def test_exceptions_are_needed():
    for name, allowed in ALLOWED.items():
        assert set(allowed) <= set(numbers(prose(ROOT / name))), name


def test_a_number_is_held_as_it_is_rounded():
    for written, value in ((".013", 0.01264), ("8,900", 8856.0), ("3.1e-9", 3.077e-9)):
        assert is_held(written, {value})
    assert is_held("9.6", {0.0957}, per_cent=True)
    for written, value in ((".014", 0.01264), ("8,856", 8857.0), ("3.1e-9", 3.2e-9), ("9.6", 0.0957)):
        assert not is_held(written, {value})


def test_what_is_no_number_of_measurement_is_left_out():
    text = "In 1996 the 24 blocks (S(10) = .480 ± .002) took 1,518 times 5e-4 s, see `tol=1e-3`"
    assert numbers(NOT_PROSE.sub("]", text)) == [".480", ".002", "1,518", "5e-4"]
