"""What benchmarks have measured says what the scripts say: text that is edited in one place alone is found."""

import ast
import json
import pathlib

import pytest

ROOT = pathlib.Path(__file__).parents[2]
PAGES = [ROOT / "docs" / f"{name}.md" for name in ("benchmarks", "validation")]
SECTIONS = {
    kept["title"]: "\n".join(kept["text"])
    for kept in (json.loads(path.read_text(encoding="utf-8")) for path in sorted(ROOT.glob("docs/benchmarks/*.json")))
    if "text" in kept
}
LEAST = 200
"""Characters from which on a text with values in it is that of a section, not a cell or a line of progress."""


def paragraphs(path):
    """Text between the values and blank lines of a script's sections, in single spaces."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.JoinedStr):
            parts = [part.value for part in node.values if isinstance(part, ast.Constant)]
            if sum(map(len, parts)) >= LEAST:
                yield from (" ".join(text.split()) for part in parts for text in part.split("\n\n"))


def flat(texts):
    return " ".join(" ".join(texts).split())


SCRIPTS = [path for path in sorted(ROOT.glob("benchmarks/*.py")) if any(paragraphs(path))]


@pytest.mark.parametrize("path", SCRIPTS, ids=lambda path: path.stem)
def test_text_of_a_section_is_the_scripts(path):
    kept = flat(SECTIONS.values())
    assert [text for text in paragraphs(path) if text not in kept] == []


def test_sections_of_pages_begin_with_the_results_that_are_kept():
    for page in PAGES:
        for part in page.read_text(encoding="utf-8").split("\n## ")[1:]:
            title, _, text = part.partition("\n")
            result, link, _ = text.partition("[Method and tables]")
            if link:
                assert flat([result.partition("![")[0]]) in flat([SECTIONS[title]]), f"{page.name}: {title}"
