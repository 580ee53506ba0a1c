"""Pages that benchmarks write say what the scripts say: text that is edited in one place alone is found."""

import ast
import pathlib

import pytest

ROOT = pathlib.Path(__file__).parents[2]
PAGES = [ROOT / "docs" / f"{name}.md" for name in ("benchmarks", "hard_cases", "peers")]
LEAST = 200
"""Characters from which on a text with values in it is that of a section, not a cell or a line of progress."""


def paragraphs(path):
    """Text between the values and blank lines of a script's sections, in single spaces."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.JoinedStr):
            parts = [part.value for part in node.values if isinstance(part, ast.Constant)]
            if sum(map(len, parts)) >= LEAST:
                yield from (" ".join(text.split()) for part in parts for text in part.split("\n\n"))


SCRIPTS = [path for path in sorted(ROOT.glob("benchmarks/*.py")) if any(paragraphs(path))]


@pytest.mark.parametrize("path", SCRIPTS, ids=lambda path: path.stem)
def test_text_of_a_section_stands_on_its_page(path):
    pages = " ".join(" ".join(page.read_text(encoding="utf-8").split()) for page in PAGES)
    assert [text for text in paragraphs(path) if text not in pages] == []
