"""Pages made from what is kept elsewhere: what benchmarks measured, in docs/benchmarks, and the constants of the code.

The files hold a section's text as Markdown, with its tables. A constant is a name in capitals, with the text below it,
or a field of a class `Tuning`, with the text below it, the comment beside it, or its paragraph in that of the class.
"""

import ast
import itertools
import json
import pathlib
import re

ROOT = pathlib.Path(__file__).parents[2]
MEASURED = {path.stem: json.loads(path.read_text(encoding="utf-8")) for path in ROOT.glob("docs/benchmarks/*.json")}
SECTIONS = {name: kept for name, kept in sorted(MEASURED.items()) if "text" in kept}
PLACES = (
    "fpk_rocking/density",
    "fpk_rocking/horizon",
    "fpk_rocking/physics",
    "fpk_rocking/risk",
    "fpk_rocking/studies",
    "montecarlo",
)


def _written(app):
    """Write the pages, each where it is new or has changed."""
    folder = pathlib.Path(app.srcdir) / "evidence"
    folder.mkdir(exist_ok=True)
    pages = {f"{name}.md": _section(kept) for name, kept in SECTIONS.items()}
    pages |= {"index.md": _index(), "constants.md": _constants()}
    for file in folder.iterdir():
        if file.name not in pages:
            file.unlink()
    for name, text in pages.items():
        file = folder / name
        if not file.exists() or file.read_text(encoding="utf-8") != text:
            file.write_text(text, encoding="utf-8")


def _section(kept):
    """Return a section as a page; its links are those of a page one folder up."""
    return f"# {kept['title']}\n\n" + re.sub(r"\]\((?!https:)", "](../", "\n".join(kept["text"])) + "\n"


def _index():
    tree = "\n".join([*SECTIONS, "constants"])
    return f"# Tables and constants\n\nWhat each benchmark measured, and how.\n\n```{{toctree}}\n{tree}\n```\n"


def _constants():
    parts = [
        "# Constants of the code",
        "Numbers that were chosen, for those who change the code, as their modules state them.",
    ]
    for place in PLACES:
        for path in sorted((ROOT / place).rglob("*.py")):
            text = path.read_text(encoding="utf-8")
            body = ast.parse(text).body
            found = [*_documented(body), *_tuned(body, text.split("\n"))]
            if found:
                parts += [f"## {path.relative_to(ROOT).as_posix()}", *found]
    return "\n\n".join(parts) + "\n"


def _documented(body):
    """Each assignment to names in capitals with a text below it: what is assigned, and the text."""
    for node, below in itertools.pairwise(body):
        text = isinstance(below, ast.Expr) and isinstance(below.value, ast.Constant) and below.value.value
        names = isinstance(node, ast.Assign) and ast.unparse(node.targets[0])
        if text and names and names.strip("()").replace(", ", "").replace("_", "").isupper():
            value = ast.unparse(node.value)
            value = value[1:-1] if isinstance(node.value, ast.Tuple) else value
            names = names.strip("()")
            shown = f"`{names} = {value}`" if len(value) < 80 else f"`{names}`"
            yield f"{shown}: {' '.join(text.split()).replace('<', '&lt;')}"


def _tuned(body, lines):
    """Each field of a table of tuned numbers, with its text: below it, beside it, or in the docstring of the class."""
    for table in body:
        if isinstance(table, ast.ClassDef) and table.name == "Tuning":
            head, _, parameters = ast.get_docstring(table).partition("\n")
            yield head
            texts = re.findall(r"^(\w[\w, ]*) : .*\n((?:    .*\n?)+)", parameters, re.MULTILINE)
            texts = {name: text for names, text in texts for name in names.split(", ")}
            for node, below in itertools.pairwise([*table.body, None]):
                if isinstance(node, ast.AnnAssign):
                    name, beside = node.target.id, lines[node.end_lineno - 1][node.end_col_offset :].strip(" #")
                    text = below.value.value if isinstance(below, ast.Expr) else beside or texts.get(name, "")
                    yield f"`{name} = {ast.unparse(node.value)}`: {' '.join(text.split()).replace('<', '&lt;')}"


def _linked(_app, _docname, source):
    """Have links to the files lead to their pages."""
    for name in SECTIONS:
        source[0] = source[0].replace(f"](benchmarks/{name}.json)", f"](evidence/{name}.md)")


def setup(app):
    """Register the steps."""
    app.connect("builder-inited", _written)
    app.connect("source-read", _linked)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
