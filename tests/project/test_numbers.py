"""Numbers in the prose of pages: each was measured into a file that the page names, or is printed by a tested block.

Held is a number if a file or block of the page's sources has one that rounds to it. Whole numbers below 100 count what
a reader sees on the page, and are left out, as are years, and what stands in code.
"""

import functools
import importlib.util
import pathlib
import re

import pytest

ROOT = pathlib.Path(__file__).parents[2]
DOCS = ROOT / "docs"
SPEC = importlib.util.spec_from_file_location("gallery_of_numbers", ROOT / "cases" / "gallery.py")
GALLERY = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(GALLERY)

# Where a page's numbers come from, beside the files that it links and its own blocks. A page that is not here is not
# looked at: docs/gallery.md has the titles of pictures, docs/project/design.md what code that is gone once did.
EQUAL = "docs/benchmarks/time_at_equal_error.json"
SOURCES = {
    "README.md": ["docs/tutorials/first_block.md", EQUAL, "docs/gallery.md"],
    "docs/benchmarks.md": [],
    "docs/extending.md": [],
    "docs/faq.md": [],
    "docs/howto/install.md": [],
    "docs/howto/large_and_rare.md": ["docs/benchmarks/monte_carlo_accuracy_of_the_engines.json"],
    "docs/howto/pictures.md": [],
    "docs/howto/sweeps.md": [],
    "docs/index.md": ["docs/tutorials/first_block.md"],
    "docs/long_horizon.md": ["docs/benchmarks/one_cycle_operator.json"],
    "docs/monte_carlo.md": ["docs/benchmarks/monte_carlo_accuracy_of_the_engines.json", "docs/gallery/fig07.json"],
    "docs/paper.md": [path.relative_to(ROOT).as_posix() for path in sorted(DOCS.glob("gallery/*.json"))],
    "docs/reference_values.md": [path.relative_to(ROOT).as_posix() for path in DOCS.glob("reference_values/*.toml")],
    "docs/reliability.md": [],
    "docs/results.md": ["fpk_rocking/results/trust.py"],
    "docs/symbols.md": [],
    "docs/tutorials/first_block.md": [],
    "docs/tutorials/long_run.md": ["docs/benchmarks/one_cycle_operator.json"],
    "docs/tutorials/paper_fig06.md": ["docs/gallery/fig06.json"],
    "docs/validation.md": [EQUAL],
}
PAGES_OF_THE_PAPER = "volume and pages of the paper"
# Numbers that none of these holds, by page, and why they may stand there.
ALLOWED = {
    "README.md": {
        "238": "tests of docs/world.md",
        ".91": "as docs/world.md, which is held",
        "3.11": "version of Python",
        **dict.fromkeys(("122", "719", "727"), PAGES_OF_THE_PAPER),
    },
    "docs/faq.md": {
        ".163": "the smallest restitution under white noise, docs/theory.md",
        "1e4": "largest amplitude, in the code",
        ".01": "limit of a verdict, docs/results.md",
        **dict.fromkeys((".005", ".1"), "definition of rattling, docs/numerics.md"),
    },
    "docs/howto/install.md": {"3.11": "version of Python"},
    "docs/howto/large_and_rare.md": {"300": "MB of ten million paths, measured once", "1e-8": "as docs/monte_carlo.md"},
    "docs/howto/sweeps.md": dict.fromkeys((".05", "4.6"), "ms a scene, printed by benchmarks/sweeps.py"),
    "docs/long_horizon.md": {
        **dict.fromkeys(("1e-15", "6e-13"), "rounding, measured once"),
        **dict.fromkeys(("1e-8", "1e-10"), "limits in the code"),
    },
    "docs/monte_carlo.md": {
        **dict.fromkeys(
            ("1e-12", "6e-13", "6e-15", "1.2e-4", "1.4e-11", "224"), "measured once, bounds in tests/montecarlo"
        ),
        "3.5e-5": ".35 in units of 1e-4 in the file that is linked",
        ".016": "CHANGELOG: share at rest under rough noise",
        **dict.fromkeys(("1e-9", "300", "400"), "speed, flights and steps, stated where they stand"),
        ".075": "length of an interval, in the code",
        ".163": "the smallest restitution under white noise, docs/theory.md",
    },
    "docs/paper.md": {
        "727": PAGES_OF_THE_PAPER,
        **dict.fromkeys((".7633", ".7653", ".0502"), "formulas of the paper and samples of them, measured once"),
        **dict.fromkeys(("1e-15", "1e-11", "3e-15"), "rounding, measured once"),
        "2.718": "Euler's number",
        ".04": "variance of the main scene",
        "200": "cycles of Fig. 7",
    },
    "docs/reference_values.md": {
        **dict.fromkeys(("4.8", "3e-4"), "seconds of the record; largest error in values.csv"),
        **dict.fromkeys(("400,000", "7.5e-6"), "Runge-Kutta paths of benchmarks/reference_values.py; 3 over them"),
        **dict.fromkeys(("8e-4", "350"), "largest error in values.csv; false alarms of the rule"),
        "1.5": "frequency of the shaking, Hz",
    },
    "docs/reliability.md": {
        **dict.fromkeys(("84,000", "1,200", "20,000"), "examples that tests/robustness generates"),
        **dict.fromkeys(("512", "2.5"), "limits of memory, in the code"),
        **dict.fromkeys(("130", "143"), "exit status of a command that a signal ends"),
        ".1": "width of the bins of compare",
    },
    "docs/results.md": {
        **dict.fromkeys(("1.5e-5", "8e-5"), "example of a rule"),
        **dict.fromkeys(("2.718", ".2718"), "Euler's number, and a tenth of it"),
        **dict.fromkeys(("2.43", ".865"), "example of a message"),
        "1e-15": "difference of two starts",
    },
    "docs/validation.md": {
        **dict.fromkeys(("6e-13", "1e-12"), "docs/monte_carlo.md"),
        "500": "cycles of a hard case",
        "2.1": "title of docs/benchmarks/convergence.png",
        "5e-8": "docs/benchmarks/one_cycle_operator.json, rounded",
    },
}

FENCE = re.compile(r"^( *)```.*?^\1```$", re.MULTILINE | re.DOTALL)
NOT_PROSE = re.compile(r"`[^`\n]*`|!\[[^\]]*\]\([^)]*\)|\]\([^)]*\)|https?://\S+|\$[^$\n]+\$")
NUMBER = re.compile(r"(?<![\w.,])(?:(?:\d{1,3}(?:,\d{3})+|\d+)(?:\.\d+)?|\.\d+)(?:e[-+]?\d+)?(?!\w)")


def numbers(text):
    """Numbers of a text, as written, that are no whole numbers below 100 and no years."""
    written = (match[0] for match in NUMBER.finditer(text))
    return [number for number in written if "." in number or "e" in number or not _small(number)]


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
    if path.endswith(".md"):
        titles = re.findall(r"^\*.*\*", text, re.MULTILINE) if path == "docs/gallery.md" else []
        text = "\n".join([match[0] for match in FENCE.finditer(text)] + titles)
    found = re.findall(r"\d*\.?\d+(?:e[-+]?\d+)?", re.sub(r"(?<=\d),(?=\d{3})", "", text))
    return {float(number) for number in found}


def passages(page):
    """Passages of a page, each with the files that its numbers come from: a row of a table, or the rest of a section.

    These are the files that the passage links, a case by the numbers of its picture, the blocks of the page and what
    `SOURCES` has; the last not for a row that links files of its own.
    """
    name = page.relative_to(ROOT).as_posix()
    for section in FENCE.sub("", page.read_text(encoding="utf-8")).split("\n## "):
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
    """Whether a value rounds to a number as it is written, or to it in per cent."""
    number = float(written.replace(",", ""))
    mantissa, _, exponent = written.replace(",", "").partition("e")
    digits = len(mantissa.partition(".")[2]) if "." in mantissa else -max(min(_zeros(mantissa), len(mantissa) - 2), 0)
    unit = 10.0 ** (int(exponent or 0) - digits)
    factors = (1.0, 100.0) if per_cent else (1.0,)
    return any(abs(value * factor - number) <= 0.5000001 * unit for value in values for factor in factors)


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


@pytest.mark.parametrize("name", SOURCES)
def test_numbers_of_a_page_are_measured_or_run(name):
    assert unheld(ROOT / name) == []


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
