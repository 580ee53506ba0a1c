"""Every benchmark uses names of the packages that exist, those that no other test runs too."""

import ast
import importlib
import pathlib

import pytest

BENCHMARKS = sorted((pathlib.Path(__file__).parents[2] / "benchmarks").glob("*.py"))
PACKAGES = "fpk_rocking", "montecarlo"


def missing_names(text):
    """Names "module.name" of the packages that a script imports, or reads of a module, and that are not there."""
    tree, modules, missing = ast.parse(text), {}, []
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.module.split(".")[0] in PACKAGES:
            for alias in node.names:
                try:
                    modules[alias.asname or alias.name] = importlib.import_module(f"{node.module}.{alias.name}")
                except ModuleNotFoundError:
                    if not hasattr(importlib.import_module(node.module), alias.name):
                        missing.append(f"{node.module}.{alias.name}")
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            module = modules.get(node.value.id)
            if module is not None and not hasattr(module, node.attr):
                missing.append(f"{module.__name__}.{node.attr}")
    return missing


@pytest.mark.parametrize("script", BENCHMARKS, ids=lambda path: path.stem)
def test_a_benchmark_uses_names_that_exist(script):
    assert missing_names(script.read_text(encoding="utf-8")) == []


def test_a_name_that_does_not_exist_is_noticed():
    text = "from montecarlo.engines import rk4, nothing\nrk4.CHUNKS_OF_NOTHING\nrk4.simulate_nothing()\n"
    expected = ["montecarlo.engines.nothing", "montecarlo.engines.rk4.CHUNKS_OF_NOTHING"]
    assert missing_names(text)[:2] == expected
