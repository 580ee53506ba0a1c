"""The package as a whole: what importing it loads, what it exports, and that imports run downward only."""

import ast
import functools
import graphlib
import importlib
import importlib.metadata
import pathlib
import re
import subprocess
import sys
import tomllib

import pytest

import fpk_rocking

ROOT = pathlib.Path(__file__).parents[2]

# From the bottom up: a module imports from lower rows and from its own room, never sideways or upward.
LAYERS = [
    {"fpk_rocking.base", "fpk_rocking.console", "fpk_rocking.density.tuning", "montecarlo.tuning"},
    {"fpk_rocking.physics"},
    {"fpk_rocking.scene", "fpk_rocking.envelopes", "fpk_rocking.forcings"},
    {"fpk_rocking.results", "fpk_rocking.analytics"},
    {"fpk_rocking.compare", "fpk_rocking.density.space", "montecarlo.engines", "montecarlo.results"},
    {"fpk_rocking.density.step"},
    {"fpk_rocking.density", "montecarlo"},
    {"fpk_rocking.output", "fpk_rocking.horizon"},
    {"fpk_rocking.studies"},
    {"fpk_rocking.risk"},
    {"fpk_rocking.options"},
    {"fpk_rocking.cli"},
    {"fpk_rocking.__main__"},
]
HEAVY = {"numba", "skfem", "scipy", "matplotlib", "pyvista", "vtk", "vtkmodules", "meshio", "rich"}


def module_name(path):
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


PACKAGES = "fpk_rocking", "montecarlo"
MODULES = {module_name(path): path for package in PACKAGES for path in (ROOT / package).rglob("*.py")}


def imported(source, package="", modules=MODULES):
    """Names of the project's modules that a source imports anywhere in it, also inside functions."""
    imports = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            imports |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            base = ".".join(package.split(".")[: -node.level + 1 or None]) if node.level else ""
            base = ".".join(filter(None, (base, node.module)))
            # `from package import module` imports the module, `from package import name` the package.
            imports |= {f"{base}.{alias.name}" if f"{base}.{alias.name}" in modules else base for alias in node.names}
    return {name for name in imports if name.split(".")[0] in PACKAGES}


@functools.cache
def imports_of(name):
    path = MODULES[name]
    package = name if path.name == "__init__.py" else name.rpartition(".")[0]
    return imported(path.read_text(encoding="utf-8"), package)


def room(name):
    """Entry of LAYERS that a module belongs to: the longest of its packages, or itself, that is one."""
    parts = name.split(".")
    layers = set.union(*LAYERS)
    return next((".".join(parts[:n]) for n in range(len(parts), 0, -1) if ".".join(parts[:n]) in layers), name)


def level(name):
    levels = [number for number, rooms in enumerate(LAYERS) if room(name) in rooms]
    assert levels, f"{name} has no place in LAYERS"
    return levels[0]


def test_imports_run_downward():
    for name in sorted(MODULES.keys() - {"fpk_rocking"}):
        for other in imports_of(name):
            assert other != "fpk_rocking", f"{name}: import from the module that defines it, not from the front"
            assert room(other) == room(name) or level(other) < level(name), f"{name} imports {other}"


def test_no_module_imports_itself_through_others():
    graph = {name: imports_of(name) & MODULES.keys() for name in MODULES.keys() - {"fpk_rocking"}}
    assert len(list(graphlib.TopologicalSorter(graph).static_order())) >= len(graph)


def test_only_studies_risk_and_the_command_line_import_montecarlo():
    users = {name for name in MODULES if any(other.startswith("montecarlo") for other in imports_of(name))}
    above = "montecarlo", "fpk_rocking.studies", "fpk_rocking.risk"
    assert {name for name in users if not name.startswith(above)} <= {"fpk_rocking.cli"}


def test_the_core_knows_nothing_of_the_earthquake_wing():
    """Only the command line imports it, and no module of the core speaks of hazards or intensities of motions."""
    for name, path in MODULES.items():
        if not name.startswith(("fpk_rocking.risk", "fpk_rocking.cli", "fpk_rocking.options")):
            assert not any(other.startswith("fpk_rocking.risk") for other in imports_of(name)), name
            assert not re.search(r"\b(hazard|fragility|intensity measure)\b", path.read_text("utf-8"), re.I), name


def test_the_earthquake_wing_uses_public_names_of_the_core_alone():
    for name, path in MODULES.items():
        if name.startswith("fpk_rocking.risk"):
            nodes = [node for node in ast.walk(ast.parse(path.read_text("utf-8"))) if isinstance(node, ast.ImportFrom)]
            private = [alias.name for node in nodes for alias in node.names if alias.name.startswith("_")]
            assert private == [], name


def test_montecarlo_never_imports_the_density_solver():
    for name in MODULES:
        if name.startswith("montecarlo"):
            assert not any(other.startswith("fpk_rocking.density") for other in imports_of(name)), name


def test_the_front_imports_nothing():
    assert imports_of("fpk_rocking") == set()


def test_imports_are_found_in_every_form():
    source = "import fpk_rocking.cli\ndef f():\n    from fpk_rocking import cli, Scene\n    from ..scene import Scene\n"
    imports = imported(source, package="fpk_rocking.density")
    assert imports == {"fpk_rocking.cli", "fpk_rocking", "fpk_rocking.scene"}


def test_importing_the_package_loads_nothing_heavy():
    source = "import sys, fpk_rocking; fpk_rocking.load_scene; print(*{name.split('.')[0] for name in sys.modules})"
    done = subprocess.run([sys.executable, "-c", source], capture_output=True, text=True, check=True, cwd=ROOT)
    loaded = set(done.stdout.split())
    assert "fpk_rocking" in loaded
    assert loaded & HEAVY == set()


def test_every_exported_name_is_there():
    assert set(fpk_rocking.__all__) <= set(dir(fpk_rocking))
    assert [name for name in fpk_rocking.__all__ if getattr(fpk_rocking, name) is None] == []


def test_solver_is_loaded_on_first_use():
    density = importlib.import_module("fpk_rocking.density")
    assert fpk_rocking.solve_fpk is density.solve_fpk
    assert fpk_rocking.Evolution is density.Evolution


def test_version_is_the_installed_one():
    assert fpk_rocking.__version__ == importlib.metadata.version("fpk-rocking")


def test_version_stands_in_one_place_and_the_others_agree():
    version = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["version"]
    citation, changes, install = (
        (ROOT / name).read_text(encoding="utf-8") for name in ("CITATION.cff", "CHANGELOG.md", "docs/howto/install.md")
    )
    assert re.findall(r"^version: (.+)$", citation, re.MULTILINE) == [version]
    number, date = re.findall(r"^## \[([\d.]+)\] - ([\d-]+)$", changes, re.MULTILINE)[0]
    assert number == version
    assert f'date-released: "{date}"' in citation
    assert set(re.findall(r"fpk_rocking-([\d.]+)-py3", install)) == {version}


def test_unknown_names_are_refused_as_usual():
    with pytest.raises(AttributeError, match=r"module 'fpk_rocking' has no attribute 'solve'"):
        fpk_rocking.solve  # noqa: B018


def names_asked_of_the_project(path):
    """Module and name of all that a script imports from the project or from a script beside it."""
    nodes = [node for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))) if isinstance(node, ast.ImportFrom)]
    beside = {other.stem for other in path.parent.glob("*.py")}
    ours = [node for node in nodes if node.module.split(".")[0] in {*PACKAGES} | beside]
    return [(node.module, alias.name) for node in ours for alias in node.names]


def defined_in(path):
    """Names that a script defines or imports at its top, read from its text: what it imports may not be installed."""
    defined = set()
    for node in ast.parse(path.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.ClassDef | ast.FunctionDef):
            defined.add(node.name)
        elif isinstance(node, ast.Import | ast.ImportFrom):
            defined |= {alias.asname or alias.name for alias in node.names}
        elif isinstance(node, ast.Assign):
            defined |= {name.id for target in node.targets for name in ast.walk(target) if isinstance(name, ast.Name)}
    return defined


@pytest.mark.parametrize("path", sorted(ROOT.glob("benchmarks/*.py")), ids=lambda path: path.stem)
def test_what_a_benchmark_imports_is_there(path):
    """Also of those that need packages which are not installed."""
    for module, name in names_asked_of_the_project(path):
        beside = path.parent / f"{module}.py"
        if beside.exists():
            assert name in defined_in(beside), (module, name)
        else:
            assert f"{module}.{name}" in MODULES or hasattr(importlib.import_module(module), name), (module, name)
