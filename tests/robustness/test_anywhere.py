"""The same bits from any number of threads, and the same program from its own wheel, away from the checkout."""

import os
import pathlib
import re
import subprocess
import sys
import sysconfig
import tarfile
import venv

import pytest

HERE = pathlib.Path(__file__).parent
ROOT = HERE.parents[1]

pytestmark = pytest.mark.slow


def run(*command, **options):
    """Run a command, and return its standard output."""
    done = subprocess.run(
        list(map(str, command)), capture_output=True, text=True, timeout=900, check=False, **{"cwd": ROOT} | options
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_every_engine_gives_the_same_bits_for_any_number_of_threads():
    """In processes of their own, the linear algebra library's threads included."""
    told = []
    for threads in ("1", "2", "3"):
        counts = {f"{library}_NUM_THREADS": threads for library in ("NUMBA", "OMP", "OPENBLAS", "MKL")}
        told.append(run(sys.executable, HERE / "engines_digest.py", env=os.environ | counts))
    assert told[0].count("\n") == 15
    assert told[1:] == told[:1] * 2


USE = """
import fpk_rocking, montecarlo, numpy
from fpk_rocking import load_scene, solve_fpk, __version__
from montecarlo import simulate
for package in (fpk_rocking, montecarlo):
    print(package.__file__)
assert load_scene("record").forcing.duration > 0
scene = load_scene("scene.toml")
density = solve_fpk(scene, cycles=2, tol=1e-2)
ensemble = simulate(scene, cycles=2, realizations=5000)
low, high = ensemble.survival_interval(0.9999)[2]
assert low - 0.01 < density.survival[2] < high + 0.01, (low, density.survival, high)
print(__version__)
"""


def test_the_wheel_of_the_sdist_runs_outside_the_checkout(tmp_path):
    """Built from the source distribution alone, installed beside the same dependencies, and run in another folder."""
    build = [sys.executable, "-m", "hatchling", "build"]
    run(*build, "-t", "sdist", "-d", tmp_path / "sdist")
    (archive,) = (tmp_path / "sdist").iterdir()
    with tarfile.open(archive) as packed:
        packed.extractall(tmp_path / "source", filter="data")
    (source,) = (tmp_path / "source").iterdir()
    # What an installation that points to the unpacked sources (pip install -e) finds there.
    found = run(
        sys.executable, "-c", "import fpk_rocking as f; print(f.load_scene('record').period, f.__file__)", cwd=source
    )
    assert found.split() == ["None", str(source / "fpk_rocking" / "__init__.py")]
    run(*build, "-t", "wheel", "-d", tmp_path / "wheel", cwd=source)
    (wheel,) = (tmp_path / "wheel").iterdir()

    place = tmp_path / "venv"
    venv.create(place, with_pip=False, symlinks=os.name != "nt")
    python = place / ("Scripts" if os.name == "nt" else "bin") / "python"
    run(sys.executable, "-m", "pip", "--python", python, "install", "--quiet", "--no-deps", "--no-index", wheel)
    packages = pathlib.Path(run(python, "-c", "import sysconfig; print(sysconfig.get_path('purelib'))").strip())
    # A folder that a .pth file names is searched, but its own .pth files are not: the checkout stays out of sight.
    (packages / "dependencies.pth").write_text(sysconfig.get_path("purelib") + "\n")

    folder = tmp_path / "elsewhere"
    folder.mkdir()
    (folder / "scene.toml").write_text((ROOT / "cases" / "scenes" / "second.toml").read_text(encoding="utf-8"))
    clean = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}
    lines = run(python, "-c", USE, cwd=folder, env=clean).splitlines()
    assert all(pathlib.Path(line).is_relative_to(place) for line in lines[:3]), lines
    assert re.fullmatch(r"\d+\.\d+\.\d+", lines[3])
    command = packages.parents[2] / "bin" / "fpk-rocking"
    asked = ["mc", "scene.toml", "--cycles", 2, "--realizations", 100, "--out", "out"]
    printed = run(command, *asked, cwd=folder, env=clean)
    assert "survival" in printed
    assert sorted(path.name for path in (folder / "out").iterdir()) == ["result.npz", "summary.json"]
