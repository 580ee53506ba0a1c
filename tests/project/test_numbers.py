"""Numbers in the prose of pages: each was measured into a JSON file that the page names, or is printed by a tested block.

Held is a number if a file or block of the page's sources has one that rounds to it. Whole numbers below 100 count what
a reader sees on the page, and are left out, as are years, section numbers, and what stands in code.
"""

import functools
import json
import pathlib
import re

import pytest

ROOT = pathlib.Path(__file__).parents[2]
DOCS = ROOT / "docs"

# Where a page's numbers come from beside the files that it links and its own blocks.
SOURCES = {
    "README.md": ["docs/tutorials/first_block.md", "docs/benchmarks/time_at_equal_error.json"],
    "docs/benchmarks.md": [],
    "docs/faq.md": [],
    "docs/index.md": ["docs/tutorials/first_block.md"],
    "docs/validation.md": [],
}
# Numbers that are none of measurement, by page, with the reason.
ALLOWED: dict[str, dict[str, str]] = {}

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
    """Values of all numbers of a JSON file, or of the blocks of a page."""
    text = (ROOT / path).read_text(encoding="utf-8")
    if path.endswith(".md"):
        text = "\n".join(match[0] for match in FENCE.finditer(text))
    found = re.findall(r"\d*\.?\d+(?:e[-+]?\d+)?", re.sub(r"(?<=\d),(?=\d{3})", "", text))
    return {float(number) for number in found}


def sources(page):
    """Files that hold the numbers of a page, from the root of the repository."""
    name = page.relative_to(ROOT).as_posix()
    links = re.findall(r"\]\(([^)#\s]+\.json)\)", page.read_text(encoding="utf-8"))
    linked = [(page.parent / link).resolve().relative_to(ROOT).as_posix() for link in links]
    return [name, *linked, *SOURCES.get(name, [])]


def is_held(written, values):
    """Whether a value rounds to a number as it is written, or to it in per cent."""
    number = float(written.replace(",", ""))
    mantissa, _, exponent = written.replace(",", "").partition("e")
    digits = len(mantissa.partition(".")[2])
    unit = 10.0 ** (int(exponent or 0) - digits)
    return any(abs(value * factor - number) <= 0.5000001 * unit for value in values for factor in (1.0, 100.0))


def unheld(page):
    """Numbers of a page's prose that no source and no exception holds."""
    values = set().union(*map(held, sources(page)))
    allowed = ALLOWED.get(page.relative_to(ROOT).as_posix(), {})
    return [number for number in numbers(prose(page)) if number not in allowed and not is_held(number, values)]


@pytest.mark.parametrize("name", SOURCES)
def test_numbers_of_a_page_are_measured_or_run(name):
    assert unheld(ROOT / name) == []
