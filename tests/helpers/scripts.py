"""Scripts of the repository as modules."""

import importlib.util
import pathlib


def benchmark(name):
    """The script of a name in `benchmarks`."""
    path = pathlib.Path(__file__).parents[2] / "benchmarks" / f"{name}.py"
    spec = importlib.util.spec_from_file_location(name, path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module
