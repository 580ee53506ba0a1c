"""The first answer on a new machine: what is compiled, by whom, and what a command loads."""

import importlib
import json
import os
import pathlib
import signal
import subprocess
import sys
import time

import pytest

from fpk_rocking import cli
from fpk_rocking.base import jit, precompilation
from fpk_rocking.base.precompilation import Compilation
from fpk_rocking.density.filtered import REST
from fpk_rocking.density.solver import DENSITY, FREE_FLIGHT
from fpk_rocking.scene.least import KINDS, kind_of, least_scenes
from fpk_rocking.studies.tasks import TASKS, kernels_of
from montecarlo.engines import engine_of, engines_for, exact_slender, rk4, white
from montecarlo.engines.batches import compilation_of

ROOT = pathlib.Path(__file__).parents[2]
CLI = (sys.executable, "-m", "fpk_rocking")

SCENE = """
block.restitution = 0.5
forcing = { amplitude = 4.6, frequency = 2.7, phase = 3.14 }
noise = { kind = "band", variance = 0.04, band = [0.0, 10.0], harmonics = 10 }
start = { angle = 0.0, velocity = 0.0 }
overturning.angle = 1.5707963267948966
"""

TOUCH = """
import sys
from numba.core.dispatcher import Dispatcher

compile_for, touched = Dispatcher.compile, []

def noted(self, signature):
    touched.append(f"{self.py_func.__module__}.{self.py_func.__qualname__}")
    return compile_for(self, signature)

Dispatcher.compile = noted
from fpk_rocking import cli
from fpk_rocking.base import precompilation

precompilation.run_compilation(precompilation.Compilation(sys.argv[1], 0))
assert touched, "the compilation is at work with no kernel"
touched.clear()
cli.main(sys.argv[2:])
sys.stderr.write(f"compiled or loaded {touched}")
"""
"""A compilation, and then a command: which kernels the command asks for that the compilation has not."""

COUNT = """
import sys
from fpk_rocking import cli
from numba.core import event

with event.install_recorder("numba:compile") as seen:
    cli.main(sys.argv[1:])
names = [data.data["dispatcher"].py_func.__name__ for _, data in seen.buffer]
sys.stderr.write(f"compiled {names}")
"""


@pytest.fixture
def scene(tmp_path):
    path = tmp_path / "scene.toml"
    path.write_text(SCENE, encoding="utf-8")
    return str(path)


def run(command, cache, check=True):
    environment = os.environ | {"NUMBA_CACHE_DIR": str(cache)}
    return subprocess.run(command, check=check, env=environment, capture_output=True, text=True, timeout=300)


@pytest.mark.parametrize("asked", ["--version", "--help"])
def test_what_the_command_line_is_loads_nothing_heavy(asked):
    heavy = ("numpy", "numba", "scipy", "matplotlib", "skfem", "rich", "fpk_rocking.scene")
    code = f"""
import sys
from fpk_rocking import cli
try:
    cli.main([{asked!r}])
except SystemExit as end:
    assert end.code == 0
sys.exit(str([name for name in {heavy!r} if name in sys.modules]))
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=False)
    assert done.stderr.strip() == "[]"
    assert "fpk-rocking" in done.stdout


@pytest.mark.slow
def test_a_density_loads_no_library_that_it_does_not_use(scene):
    # numba itself loads scipy.linalg, before its first kernel.
    heavy = ("scipy.integrate", "scipy.ndimage", "scipy.special", "scipy.stats", "matplotlib", "skfem")
    heavy += ("rich", "meshio")
    code = f"""
import sys
from fpk_rocking import load_scene, solve_fpk
solve_fpk(load_scene({scene!r}), cycles=1, tol=1e-2)
sys.exit(str([name for name in {heavy!r} if name in sys.modules]))
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=300, check=False)
    assert done.stderr.splitlines()[-1] == "[]"


BAND = least_scenes("slender")["band"]
WHITE = compilation_of(white.ENGINE, least_scenes("slender")["white"])


def runnable(compilation):
    module, function, *_ = compilation.name.split(":")
    return callable(getattr(importlib.import_module(module), function))


def test_every_call_has_its_task():
    for kind in KINDS:
        scenes = least_scenes(kind)
        assert {kind_of(scene.block) for scene in scenes.values()} == {kind}
        named = set(kernels_of(TASKS["fpk"], scenes.values(), {}))
        assert named == {DENSITY[kind], REST[kind]}
        named.update(kernels_of(TASKS["mc"], scenes.values(), {}))
        assert len(named) == (6 if kind == "slender" else 5)
        assert all(map(runnable, named))
    assert all(map(runnable, cli.warmup_compilations()))


@pytest.mark.parametrize("kind", KINDS)
def test_every_engine_that_takes_a_kind_of_block_has_a_least_scene(kind):
    """The compilation of an engine simulates the first scene that it takes, which must not be one of another engine."""
    scenes = least_scenes(kind).values()
    engines = {engine for scene in scenes for engine in engines_for(scene)}
    assert len(engines) == (5 if kind == "slender" else 4)
    for engine in engines:
        scene = next(scene for scene in scenes if engine.takes(scene))
        assert engine_of(scene, engine.method) is engine
        assert kind == "unequal" or compilation_of(engine, scene) in cli.warmup_compilations()


@pytest.mark.parametrize(
    ("compilation", "asked"),
    [
        pytest.param(
            DENSITY["slender"],
            ["fpk", "--no-check", "--cycles", "2", "--tol", "1e-2"],
            marks=pytest.mark.slow,
        ),
        pytest.param(
            DENSITY["exact"],
            ["fpk", "--no-check", "--cycles", "2", "--tol", "1e-2"],
            marks=pytest.mark.slow,
        ),
        (WHITE, ["mc", "--method", "white", "--cycles", "2"]),
        (compilation_of(exact_slender.ENGINE, BAND), ["mc", "--method", "exact", "--cycles", "2"]),
        pytest.param(
            compilation_of(rk4.ENGINE, BAND), ["mc", "--method", "rk4", "--cycles", "2"], marks=pytest.mark.slow
        ),
    ],
)
def test_a_compilation_compiles_all_that_a_command_needs(compilation, asked, scene):
    """In one process, which asks for every kernel and signature once, be it on the disk or not."""
    if compilation.name.endswith("exact"):
        pathlib.Path(scene).write_text(SCENE + "block.critical_angle = 0.1\n", encoding="utf-8")
    command = [sys.executable, "-c", TOUCH, compilation.name, asked[0], scene, *asked[1:]]
    done = subprocess.run(command, check=True, capture_output=True, text=True, timeout=300)
    *warned, told = done.stderr.splitlines()
    assert told == "compiled or loaded []"
    assert len(warned) == sum(" was replaced by white noise " in line for line in warned) <= 1


@pytest.mark.slow
def test_free_flight_is_compiled_as_the_solver_needs_it(scene, tmp_path):
    """Else a helper works in vain: what it has compiled must be what the solver calls."""
    code = f"from fpk_rocking.base import precompilation as p; p.run_compilation(p.Compilation{tuple(FREE_FLIGHT)})"
    run([sys.executable, "-c", code], tmp_path)
    done = run([sys.executable, "-c", COUNT, "fpk", scene, "--no-check", "--cycles", "1"], tmp_path)
    compiled = done.stderr.rpartition("compiled ")[2]
    assert "scatter" in compiled
    for name in (
        "shear_coefficients",
        "shear_velocity",
        "shear_values",
        "fill_blocks",
        "blocks_to_point_values",
        "target_range",
    ):
        assert repr(name) not in compiled


def test_one_process_compiles_a_kernel_and_others_wait_for_it(tmp_path):
    """As many at once as would collide, eight: each answers, and the kernel is compiled once.

    The first of them says that it compiles; one more, later, has nothing to say.
    """
    code = """
from fpk_rocking.base import precompilation
from fpk_rocking.physics.motion.equation import KernelBlock
from fpk_rocking.physics.motion.impact import chatter_time
precompilation.start_helpers(precompilation.Compilation("fpk_rocking.physics.motion.impact:chatter_time", 7))
answer = chatter_time(0.25, 1, 0.0, KernelBlock(0.0, 1.5))
precompilation.mark_announced()
print(answer, *(sum(made.stats.cache_misses.values()) for made in chatter_time.for_types.values()))
"""
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)}
    where = {"env": environment, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    runs = [subprocess.Popen([sys.executable, "-c", code], **where) for _ in range(8)]
    answers, said = zip(*(process.communicate(timeout=120) for process in runs), strict=True)
    assert sorted(answers) == ["0.5 0\n"] * 7 + ["0.5 1\n"]
    assert "compiling machine code for this machine, once: about 7 s\n" in said
    later = run([sys.executable, "-c", code], tmp_path)
    assert (later.stdout, later.stderr) == ("0.5 0\n", "")


@pytest.mark.slow
def test_two_cold_commands_side_by_side_on_one_cache_answer(scene, tmp_path):
    """The first of them says that it compiles; a third, later, has nothing to say."""
    asked = [*CLI, "mc", scene, "--method", "white", "--cycles", "1", "--realizations", "9", "--json"]
    says = f"compiling machine code for this machine, once: about {WHITE.seconds} s\n"
    for k in range(20):
        environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path / str(k))}
        pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
        both = [subprocess.Popen(asked, env=environment, **pipes) for _ in range(2)]
        answers = [process.communicate(timeout=300) for process in both]
        assert [process.returncode for process in both] == [0, 0], answers
        later = run(asked, tmp_path / str(k))
        assert {said for _, said in answers} <= {says, ""}
        assert (says in (said for _, said in answers), later.stderr) == (True, "")
        printed = [*(out for out, _ in answers), later.stdout]
        assert len({json.dumps(json.loads(out)["survival"]) for out in printed}) == 1


@pytest.mark.usefixtures("interruptible")
def test_an_interrupted_warmup_ends_at_once_with_its_helpers(tmp_path):
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)}
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    warmup = subprocess.Popen([*CLI, "warmup"], env=environment, **pipes)
    # Helpers hold the locks of the kernels that they compile.
    while not list(tmp_path.rglob("*.lock")) and warmup.poll() is None:
        time.sleep(0.05)
    warmup.send_signal(signal.SIGINT)
    begin = time.monotonic()
    out, err = warmup.communicate(timeout=60)
    assert (warmup.returncode, out) == (130, "")
    assert err.splitlines()[-1] == "fpk-rocking: interrupted; no result was written"
    assert time.monotonic() - begin < 5.0


def test_warmup_runs_all_tasks_and_says_which_failed(capsys):
    compilations = [
        Compilation("fpk_rocking.scene.least:kind_of", 1),
        Compilation("math:sqrt:4", 1),
        Compilation("platform:node", 1),
    ]
    with pytest.raises(OSError, match="2 of 3 parts were not compiled"):
        cli.compile_ahead(compilations)
    said = capsys.readouterr().err.splitlines()
    assert said[0].startswith("compiling machine code for this machine: about")
    failed = {line.removeprefix("fpk-rocking warmup: not compiled: ") for line in said[1:]}
    assert failed == {"fpk_rocking.scene.least:kind_of", "math:sqrt:4"}


def test_a_kernel_that_another_calls_can_be_called_from_python_too():
    @jit.kernel
    def inner(x):
        return 2.0 * x

    @jit.kernel
    def outer(x):
        return inner(x) + 1.0

    assert outer(3.0) == 7.0
    assert inner(3.0) == 6.0
    assert outer(3) == 7.0


def test_helpers_share_what_a_call_will_need():
    compilations = [Compilation(name, 1) for name in "abc"]
    assert precompilation.shares(compilations, 0) == []
    assert precompilation.shares(compilations, 1) == [compilations]
    assert precompilation.shares(compilations, 2) == [[compilations[0], compilations[2]], [compilations[1]]]
    assert precompilation.shares(compilations[:1], 9) == [compilations[:1]]


def test_a_process_says_once_that_it_compiles(tmp_path):
    """And only until one on the machine has come to its end: an interrupted one has compiled a part at most."""
    begin = """
from fpk_rocking.base.precompilation import Compilation, mark_announced, start_helpers
for name in ("processors", "start_no_helpers"):
    start_helpers(Compilation(f"fpk_rocking.base.precompilation:{name}", 3))
"""
    for _ in range(2):
        interrupted = run([sys.executable, "-c", begin + "raise SystemExit(130)"], tmp_path, check=False)
        assert interrupted.stderr == "compiling machine code for this machine, once: about 3 s\n"
    code = begin + "mark_announced()"
    said = [run([sys.executable, "-c", code], tmp_path).stderr for _ in range(3)]
    assert said[0] == "compiling machine code for this machine, once: about 3 s\n"
    assert said[1:] == [said[0], ""]
