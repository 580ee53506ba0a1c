"""One-line mistakes in a source: what can be changed in a statement, and a mutant drawn at random over many files."""

import ast
import copy
from typing import NamedTuple

OPPOSITE = {ast.Lt: ast.LtE, ast.LtE: ast.Lt, ast.Gt: ast.GtE, ast.GtE: ast.Gt, ast.Eq: ast.NotEq, ast.NotEq: ast.Eq}
OPPOSITE |= {ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult, ast.Pow: ast.Mult}
OPPOSITE |= {ast.And: ast.Or, ast.Or: ast.And, ast.Is: ast.IsNot, ast.IsNot: ast.Is, ast.In: ast.NotIn}
NAMES = {"min": "max", "minimum": "maximum", "all": "any", "sin": "cos", "sinh": "cosh", "floor": "ceil"}
NAMES |= {other: first for first, other in NAMES.items()}
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
        file = rng.choices(list(places), [len(statements_of_file) for statements_of_file in places.values()])[0]
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
    pairs = []

    def walk(node, function, prefix):
        for child in ast.iter_child_nodes(node):
            inside = function, prefix
            if isinstance(child, ast.ClassDef):
                inside = function, f"{prefix}{child.name}."
            elif isinstance(child, ast.FunctionDef):
                inside = f"{prefix}{child.name}", f"{prefix}{child.name}.<locals>."
            text = isinstance(child, ast.Expr) and isinstance(child.value, ast.Constant)
            if isinstance(child, ast.stmt) and not (text or isinstance(child, ast.Import | ast.ImportFrom | ast.Pass)):
                pairs.append((child, inside[0]))
            walk(child, *inside)

    walk(tree, "", "")
    return pairs


def own(statement):
    """Yield the nodes of a statement without those of statements in it, each with the node whose text is replaced.

    That is the node itself, but for what is within an f-string: there the parser knows no places.
    """
    todo = [(statement, None)]
    while todo:
        node, text = todo.pop()
        text = text or (node if isinstance(node, ast.JoinedStr) else None)
        if isinstance(node, ast.expr | ast.AugAssign):
            yield node, text or node
        for name, value in ast.iter_fields(node):
            if name not in NOTES and (name not in BODIES or isinstance(node, ast.expr)):
                parts = value if isinstance(value, list) else [value]
                todo += [(part, text) for part in parts if isinstance(part, ast.AST)]


def changes(node):
    """Yield functions that change a copy of a node, one for each mistake that can be made there."""
    yield from _in_operators(node)
    if isinstance(node, ast.Constant) and type(node.value) in {bool, int, float}:
        yield lambda target: setattr(target, "value", _other(target.value))
    if (
        isinstance(node, ast.Tuple)
        and len(node.elts) == 2
        and not any(isinstance(target, ast.Slice) for target in node.elts)
    ):
        yield lambda target: target.elts.reverse()
    if isinstance(node, ast.Call) and len(node.args) == 2 and not isinstance(node.args[0], ast.Constant):
        yield lambda target: target.args.reverse()
    if isinstance(node, ast.IfExp):
        yield lambda target: vars(target).update(body=target.orelse, orelse=target.body)
    for name, cls in (("id", ast.Name), ("attr", ast.Attribute)):
        if isinstance(node, cls) and getattr(node, name) in NAMES and isinstance(node.ctx, ast.Load):
            yield lambda target, name=name: setattr(target, name, NAMES[getattr(target, name)])


def _in_operators(node):
    if isinstance(node, ast.Compare) and type(node.ops[0]) in OPPOSITE:
        yield lambda target: target.ops.__setitem__(0, OPPOSITE[type(target.ops[0])]())
    if isinstance(node, ast.BinOp | ast.BoolOp | ast.AugAssign) and type(node.op) in OPPOSITE:
        yield lambda target: setattr(target, "op", OPPOSITE[type(target.op)]())
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
        yield lambda target: setattr(target, "op", ast.UAdd())
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not):
        yield lambda target: setattr(target, "operand", ast.UnaryOp(ast.Not(), target.operand))


def _other(value):
    if isinstance(value, bool):
        return not value
    return value + 1 if isinstance(value, int) else 2.0 * value or 1.0


def changed(text, node, root, change):
    """Return a source in which a node is changed and the text of `whole`, which contains it, is written anew."""
    place = next(n for n, candidate in enumerate(ast.walk(root)) if candidate is node)
    altered = copy.deepcopy(root)
    change(next(candidate for n, candidate in enumerate(ast.walk(altered)) if n == place))
    new = ast.unparse(altered) if isinstance(root, ast.stmt) else f"({ast.unparse(altered)})"
    lines = text.encode().splitlines(keepends=True)  # the parser counts columns in bytes
    first, last = root.lineno - 1, root.end_lineno - 1
    new = lines[first][: root.col_offset] + new.encode() + lines[last][root.end_col_offset :]
    return b"".join([*lines[:first], new, *lines[last + 1 :]]).decode()
