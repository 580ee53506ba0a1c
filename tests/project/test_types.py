"""Types of the public API: all that the reference shows has them, and a type checker takes the pages' examples."""

import ast
import functools
import importlib
import inspect
import os
import pathlib
import re
import subprocess
import sys
import tomllib

import pytest
from test_pages import PAGES, blocks

import fpk_rocking
from fpk_rocking import melnikov

ROOT = pathlib.Path(__file__).parents[2]


def shown():
    """Module, name and options of every function and class of the reference."""
    for page in sorted((ROOT / "docs" / "reference").glob("*.rst")):
        module = None
        for entry in re.split(r"\n(?=\.\. )", page.read_text(encoding="utf-8")):
            module = entry.split()[2] if entry.startswith(".. currentmodule::") else module
            if match := re.match(r"\.\. auto(?:function|class):: (\w+)", entry):
                yield module, match[1], entry


def functions_of(cls, inherited):
    """Functions behind the public methods and properties of a class, as far as the reference shows them."""
    for owner in cls.__mro__ if inherited else [cls]:
        for name, member in vars(owner).items():
            if owner.__module__.split(".")[0] in {"fpk_rocking", "montecarlo"} and not name.startswith("_"):
                for inner in ("fget", "__func__", "func"):
                    member = getattr(member, inner, member)  # noqa: PLW2901
                if inspect.isfunction(member):
                    yield member


def without_types(function):
    signature = inspect.signature(function)
    bare = [name for name, parameter in signature.parameters.items() if parameter.annotation is parameter.empty]
    bare += ["return"] if signature.return_annotation is signature.empty else []
    return [name for name in bare if name not in {"self", "cls"}]


@pytest.mark.parametrize(("module", "name", "entry"), list(shown()), ids=lambda value: value.split("\n")[0])
def test_what_the_reference_shows_has_types(module, name, entry):
    thing = getattr(melnikov if module == "fpk_rocking.melnikov" else importlib.import_module(module), name)
    members = functions_of(thing, ":inherited-members:" in entry) if ":members:" in entry else ()
    for function in [inspect.unwrap(thing)] if inspect.isfunction(thing) else members:
        assert without_types(function) == [], function.__qualname__


def test_a_lack_of_types_is_found():
    def bare(self, first, two: int = 2):
        return self, first, two

    assert without_types(bare) == ["first", "return"]
    own, inherited = (set(functions_of(fpk_rocking.Evolution, inherited)) for inherited in (False, True))
    assert own < inherited


def checked_files():
    """Files that mypy checks in `make lint`."""
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["mypy"]
    for pattern in settings["files"]:
        for path in ROOT.glob(pattern):
            yield from path.rglob("*.py") if path.is_dir() else [path]


def bare_functions(body):
    """Names of public functions that lack a type, those of public classes too; kernels have none."""
    for node in body:
        if isinstance(node, ast.ClassDef | ast.FunctionDef) and node.name.startswith("_"):
            continue
        if isinstance(node, ast.ClassDef):
            yield from bare_functions(node.body)
        elif isinstance(node, ast.FunctionDef) and not any(
            "kernel" in ast.unparse(argument) for argument in node.decorator_list
        ):
            arguments = [
                argument
                for argument in ast.walk(node.args)
                if isinstance(argument, ast.arg) and argument.arg not in {"self", "cls"}
            ]
            if node.returns is None or any(argument.annotation is None for argument in arguments):
                yield node.name


def test_public_functions_of_what_mypy_checks_have_types():
    files, packages = list(checked_files()), (ROOT / "fpk_rocking", ROOT / "montecarlo")
    assert len(files) > 0.6 * sum(len(list(package.rglob("*.py"))) for package in packages)
    bare = {str(path): list(bare_functions(ast.parse(path.read_text(encoding="utf-8")).body)) for path in files}
    assert {name: untyped for name, untyped in bare.items() if untyped} == {}


def test_a_bare_function_is_found():
    text = (
        "class A:\n    @property\n    def one(self): ...\ndef two(x, y: int) -> int: ...\n@kernel\ndef three(x): ...\n"
    )
    assert list(bare_functions(ast.parse(text).body)) == ["one", "two"]


def test_the_front_is_stubbed():
    """It loads names on first use, which a type checker cannot see."""
    stub = (ROOT / "fpk_rocking" / "__init__.pyi").read_text(encoding="utf-8")
    assert set(re.findall(r" as (\w+)$", stub, re.MULTILINE)) == set(fpk_rocking.__all__)
    for module, name in re.findall(r"^from ([\w.]+) import (\w+)", stub, re.MULTILINE):
        assert getattr(importlib.import_module(module), name) is getattr(fpk_rocking, name)
    assert all((ROOT / package / "py.typed").exists() for package in ("fpk_rocking", "montecarlo"))


WRONG = """
from fpk_rocking import load_scene, solve_fpk
from montecarlo import simulate
solve_fpk("main", cycles=10)
simulate(load_scene("main"), cycles=10, realizations="many")
solve_fpk(load_scene("main"), cycles=10).survived
"""


@pytest.mark.site
def test_a_type_checker_takes_the_examples_and_refuses_wrong_ones(tmp_path):
    """What may be None, or one of several noises, is asked for without a check in examples."""
    for number, page in enumerate(PAGES):
        text = "\n".join(text for language, text in blocks(page) if language == "python")
        (tmp_path / f"page_{number}.py").write_text(text, encoding="utf-8")
    (tmp_path / "wrong.py").write_text(WRONG, encoding="utf-8")
    options = ["--ignore-missing-imports", "--follow-imports=silent", "--no-strict-optional"]
    options += ["--disable-error-code=union-attr"]
    check = [sys.executable, "-m", "mypy", "--cache-dir", str(ROOT / ".mypy_cache"), *options]
    run = functools.partial(
        subprocess.run, capture_output=True, text=True, cwd=tmp_path, env=os.environ | {"MYPYPATH": str(ROOT)}
    )
    done = run([*check, *sorted(path.name for path in tmp_path.glob("*.py"))], check=False)
    lines = done.stdout.splitlines()
    assert [re.findall(r"^wrong\.py:(\d+)|$", line)[0] for line in lines[:-1]] == ["4", "5", "6"], done.stdout
