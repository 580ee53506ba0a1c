"""A page for each script in cases/: its picture, what its docstring says, and its source.

The pictures are those of `make gallery`, kept in docs/gallery: to draw them takes half an hour, so a build runs none.
"""

import ast
import pathlib
import re
import sys

from bars import escaped
from PIL import Image

ROOT = pathlib.Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "cases"))

from gallery import PICTURES, numbers_of, title_of  # noqa: E402 - found by the line above


def _written(app):
    """Write the pages, each where it is new or has changed."""
    folder = pathlib.Path(app.srcdir) / "cases"
    folder.mkdir(exist_ok=True)
    pages = {f"{name}.rst": _page(name) for name in PICTURES} | {"index.rst": _index()}
    for file in folder.iterdir():
        if file.name not in pages:
            file.unlink()
    for name, text in pages.items():
        file = folder / name
        if not file.exists() or file.read_text(encoding="utf-8") != text:
            file.write_text(text, encoding="utf-8")


def _text(name):
    """Return the title and the paragraphs of a case's docstring, and the line at which its code begins."""
    module = ast.parse((ROOT / "cases" / f"{name}.py").read_text(encoding="utf-8"))
    title, _, rest = ast.get_docstring(module).partition("\n\n")
    return title.replace("\n", " ").rstrip("."), rest, module.body[0].end_lineno + 2


def _page(name):
    title, rest, line = _text(name)
    blocks = [_block(text) for text in rest.split("\n\n")]
    figures = [f".. figure:: ../gallery/{kept}\n   :alt: {_message(kept)}" for kept in PICTURES[name].values()]
    numbers = f"The numbers behind the picture: :download:`{numbers_of(name)} <../gallery/{numbers_of(name)}>`."
    source = f".. literalinclude:: ../../cases/{name}.py\n   :language: python\n   :lines: {line}-"
    parts = [_headed(escaped(title), "="), *figures, *blocks, numbers, _headed(f"cases/{name}.py", "-"), source]
    return "\n\n".join(parts) + "\n"


def _block(text):
    """Return a paragraph of a docstring as reStructuredText; what it indents is a command.

    A letter in brackets at the head of an item names a panel: it begins no list within the list.
    """
    return f".. code-block:: sh\n\n{text}" if text.startswith("    ") else escaped(text).replace("* (", "* \\(")


def _message(kept):
    """Return what a picture of the gallery says: its title."""
    with Image.open(ROOT / "docs" / "gallery" / kept) as picture:
        return title_of(picture)


def _index():
    intro = (
        "One script a figure or study. Each reads a scene, calls the engines and writes pictures, tables and VTK "
        "files; ``make gallery`` runs them all, in about half an hour."
    )
    entries = [_entry(name, *PICTURES[name].values()) for name in PICTURES]
    table = ".. list-table::\n   :widths: 40 60\n   :class: gallery\n\n" + "\n".join(entries)
    tree = ".. toctree::\n   :hidden:\n\n" + "\n".join(f"   {name}" for name in PICTURES)
    return "\n\n".join([_headed("Figures and studies", "="), intro, table, tree]) + "\n"


def _entry(name, first, *others):
    """Return the row of a case: its first picture, its page, and what each of its pictures says."""
    image = f"   * - .. image:: ../gallery/{first}\n          :target: {name}.html\n          :alt: {_message(first)}"
    messages = "".join(f"\n\n       {escaped(_message(kept))}." for kept in (first, *others))
    return f"{image}\n     - :doc:`{name}`{messages}"


def _headed(title, rule):
    return f"{title}\n{rule * 2 * len(title)}"


def _linked(_app, docname, source):
    """Have links to cases lead to pages, not to files, and pictures of the gallery say what they show."""
    depth = "../" * docname.count("/")
    for name in PICTURES:
        source[0] = source[0].replace(f"](../{depth}cases/{name}.py)", f"]({depth}cases/{name}.rst)")
    pictures = r"!\[cases/\w+\.py\]\(gallery/(\w+\.png)\)"
    source[0] = re.sub(pictures, lambda found: f"![{_message(found[1])}](gallery/{found[1]})", source[0])


def setup(app):
    """Register the steps."""
    app.connect("builder-inited", _written)
    app.connect("source-read", _linked)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
