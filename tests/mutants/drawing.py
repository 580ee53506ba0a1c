"""One-line mistakes in a source: what can be changed in a statement, and a mutant drawn at random over many files."""

import ast
import copy
from typing import NamedTuple

OPPOSITE = {ast.Lt: ast.LtE, ast.LtE: ast.Lt, ast.Gt: ast.GtE, ast.GtE: ast.Gt, ast.Eq: ast.NotEq, ast.NotEq: ast.Eq}
OPPOSITE |= {ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult, ast.Pow: ast.Mult}
OPPOSITE |= {ast.And: ast.Or, ast.Or: ast.And, ast.Is: ast.IsNot, ast.IsNot: ast.Is, ast.In: ast.NotIn}
NAMES = {"min": "max", "minimum": "maximum", "all": "any", "sin": "cos", "sinh": "cosh", "floor": "ceil"}
NAMES |= {other: one for one, other in NAMES.items()}
BODIES = {"body", "orelse", "finalbody", "handlers"}
NOTES = {"annotation", "returns", "decorator_list"}


class Mutant(NamedTuple):
    """A mistake: the file and the function it is in (qualified; "": none), the line before and after it."""

    file: str
    function: str
    line: int
    before: str
    after: str
    source: str


def drawn(rng, texts):
    """Yield a `Mutant` after the other of the sources by file, which are drawn in proportion to their statements."""
    places = {file: statements(ast.parse(text)) for file, text in texts.items()}
    while True:
        file = rng.choices(list(places), [len(found) for found in places.values()])[0]
        statement, function = rng.choice(places[file])
        possible = [(*where, change) for where in own(statement) for change in changes(where[0])]
        if not possible:
            continue
        source = changed(texts[file], *rng.choice(possible))
        lines = zip(texts[file].splitlines(), source.splitlines(), strict=False)
        line, before, after = next((n, *pair) for n, pair in enumerate(lines, 1) if pair[0] != pair[1])
        yield Mutant(file, function, line, before.strip(), after.strip(), source)


def statements(tree):
    """Return every statement that does something (no docstring, import or bare `pass`), with its function's name."""
    found = []

    def walk(node, function, prefix):
        for child in ast.iter_child_nodes(node):
            inside = function, prefix
            if isinstance(child, ast.ClassDef):
                inside = function, f"{prefix}{child.name}."
            elif isinstance(child, ast.FunctionDef):
                inside = f"{prefix}{child.name}", f"{prefix}{child.name}.<locals>."
            text = isinstance(child, ast.Expr) and isinstance(child.value, ast.Constant)
            if isinstance(child, ast.stmt) and not (text or isinstance(child, ast.Import | ast.ImportFrom | ast.Pass)):
                found.append((child, inside[0]))
            walk(child, *inside)

    walk(tree, "", "")
    return found


def own(statement):
    """Yield the nodes of a statement without those of statements in it, each with the node whose text is replaced.

    That is the node itself, but for what is within an f-string: there the parser knows no places.
    """
    todo = [(statement, None)]
    while todo:
        node, whole = todo.pop()
        whole = whole or (node if isinstance(node, ast.JoinedStr) else None)
        if isinstance(node, ast.expr | ast.AugAssign):
            yield node, whole or node
        for name, value in ast.iter_fields(node):
            if name not in NOTES and (name not in BODIES or isinstance(node, ast.expr)):
                parts = value if isinstance(value, list) else [value]
                todo += [(one, whole) for one in parts if isinstance(one, ast.AST)]


def changes(node):
    """Yield functions that change a copy of a node, one for each mistake that can be made there."""
    yield from _in_operators(node)
    if isinstance(node, ast.Constant) and type(node.value) in {bool, int, float}:
        yield lambda one: setattr(one, "value", _other(one.value))
    if isinstance(node, ast.Tuple) and len(node.elts) == 2 and not any(isinstance(one, ast.Slice) for one in node.elts):
        yield lambda one: one.elts.reverse()
    if isinstance(node, ast.Call) and len(node.args) == 2 and not isinstance(node.args[0], ast.Constant):
        yield lambda one: one.args.reverse()
    if isinstance(node, ast.IfExp):
        yield lambda one: vars(one).update(body=one.orelse, orelse=one.body)
    for name, cls in (("id", ast.Name), ("attr", ast.Attribute)):
        if isinstance(node, cls) and getattr(node, name) in NAMES and isinstance(node.ctx, ast.Load):
            yield lambda one, name=name: setattr(one, name, NAMES[getattr(one, name)])


def _in_operators(node):
    if isinstance(node, ast.Compare) and type(node.ops[0]) in OPPOSITE:
        yield lambda one: one.ops.__setitem__(0, OPPOSITE[type(one.ops[0])]())
    if isinstance(node, ast.BinOp | ast.BoolOp | ast.AugAssign) and type(node.op) in OPPOSITE:
        yield lambda one: setattr(one, "op", OPPOSITE[type(one.op)]())
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
        yield lambda one: setattr(one, "op", ast.UAdd())
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not):
        yield lambda one: setattr(one, "operand", ast.UnaryOp(ast.Not(), one.operand))


def _other(value):
    if isinstance(value, bool):
        return not value
    return value + 1 if isinstance(value, int) else 2.0 * value or 1.0


def changed(text, node, whole, change):
    """Return a source in which a node is changed and the text of `whole`, which contains it, is written anew."""
    place = next(n for n, one in enumerate(ast.walk(whole)) if one is node)
    made = copy.deepcopy(whole)
    change(next(one for n, one in enumerate(ast.walk(made)) if n == place))
    new = ast.unparse(made) if isinstance(whole, ast.stmt) else f"({ast.unparse(made)})"
    lines = text.encode().splitlines(keepends=True)  # the parser counts columns in bytes
    first, last = whole.lineno - 1, whole.end_lineno - 1
    new = lines[first][: whole.col_offset] + new.encode() + lines[last][whole.end_col_offset :]
    return b"".join([*lines[:first], new, *lines[last + 1 :]]).decode()
