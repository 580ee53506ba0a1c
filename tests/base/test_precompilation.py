"""The first answer on a new machine: what is compiled, by whom, and what a command loads."""

import importlib
import json
import os
import pathlib
import re
import signal
import subprocess
import sys
import time
import types

import pytest

from fpk_rocking import least_runs
from fpk_rocking.base import jit, precompilation
from fpk_rocking.density.resolution import RESOLUTIONS, USUAL
from fpk_rocking.scene import Block, Body, Harmonic, NoNoise, Scene
from fpk_rocking.studies.tasks import TASKS, kernels_of
from montecarlo import simulation
from montecarlo.engines import ENGINES, engine_of, exact_block, filtered, rk4, task_of, white

ROOT = pathlib.Path(__file__).parents[2]
CLI = (sys.executable, "-m", "fpk_rocking.cli")

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

precompilation.run_task(sys.argv[1])
assert touched, "the task is at work with no kernel"
touched.clear()
cli.main(sys.argv[2:])
sys.stderr.write(f"compiled or loaded {touched}")
"""
"""A task, and then a command: which kernels the command asks for that the task has not."""

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


WHITE, FLIGHT = "fpk_rocking.least_runs:white", "fpk_rocking.least_runs:free_flight"


def test_every_engine_and_every_call_has_its_task():
    blocks = Block(0.5), Block(0.5, critical_angle=0.3), Block(body=Body(1.0, 0.3, 0.4, 0.6))
    scenes = [Scene(block, Harmonic(1.0, 2.0), NoNoise()) for block in blocks]
    named = {task_of(engine, scenes[engine is exact_block.ENGINE]) for engine in ENGINES}
    others = rk4.ENGINE, white.ENGINE, filtered.ENGINE
    named |= {task_of(engine, scenes[1]) for engine in others}
    bodies = {task_of(engine, scenes[2]) for engine in (exact_block.ENGINE, *others)}
    bodies.update(kernels_of(TASKS["fpk"], scenes[2:], {"noise_replacement": "filtered"}))
    assert bodies == set(precompilation.BODY_TASKS)
    named.update(kernels_of(TASKS["fpk"], scenes[:2], {"noise_replacement": "filtered"}))
    for path in [*ROOT.glob("fpk_rocking/**/*.py"), *ROOT.glob("montecarlo/**/*.py")]:
        named.update(
            re.findall(
                r'precompilation\.(?:start_helpers|task_for_block)\("([\w.:]+)"', path.read_text(encoding="utf-8")
            )
        )
    assert named <= set(precompilation.TASKS)
    for task in precompilation.TASKS | precompilation.BODY_TASKS:
        module, name = task.split(":")
        assert callable(getattr(importlib.import_module(module), name))


def test_the_task_of_an_engine_simulates_what_needs_it(monkeypatch):
    seen = []
    monkeypatch.setattr(
        simulation, "simulate", lambda scene, method, **_: seen.append(task_of(engine_of(scene, method), scene))
    )
    every = precompilation.TASKS | precompilation.BODY_TASKS
    runs = {task: getattr(least_runs, task.rpartition(":")[2]) for task in every}
    tasks = [task for task, run in runs.items() if getattr(run, "func", None) is least_runs.paths]
    assert len(tasks) == 13
    for task in tasks:
        runs[task]()
    assert seen == tasks


@pytest.mark.parametrize(
    ("task", "asked"),
    [
        pytest.param(
            "fpk_rocking.least_runs:density",
            ["fpk", "--no-check", "--cycles", "2", "--tol", "1e-2"],
            marks=pytest.mark.slow,
        ),
        pytest.param(
            "fpk_rocking.least_runs:density_exact",
            ["fpk", "--no-check", "--cycles", "2", "--tol", "1e-2"],
            marks=pytest.mark.slow,
        ),
        (WHITE, ["mc", "--method", "white", "--cycles", "2"]),
        ("fpk_rocking.least_runs:exact", ["mc", "--method", "exact", "--cycles", "2"]),
        pytest.param("fpk_rocking.least_runs:rk4", ["mc", "--method", "rk4", "--cycles", "2"], marks=pytest.mark.slow),
    ],
)
def test_a_task_compiles_all_that_a_command_needs(task, asked, scene):
    """In one process, which asks for every kernel and signature once, be it on the disk or not."""
    if task.endswith("_exact"):
        pathlib.Path(scene).write_text(SCENE + "block.critical_angle = 0.1\n", encoding="utf-8")
    command = [sys.executable, "-c", TOUCH, task, asked[0], scene, *asked[1:]]
    done = subprocess.run(command, check=True, capture_output=True, text=True, timeout=300)
    assert done.stderr == "compiled or loaded []"


@pytest.mark.slow
def test_free_flight_is_compiled_as_the_solver_needs_it(scene, tmp_path):
    """Else a helper works in vain: what it has compiled must be what the solver calls."""
    code = f"from fpk_rocking.base import precompilation as p; p.run_task('{FLIGHT}')"
    run([sys.executable, "-c", code], tmp_path)
    done = run([sys.executable, "-c", COUNT, "fpk", scene, "--no-check", "--cycles", "1"], tmp_path)
    compiled = done.stderr.rpartition("compiled ")[2]
    assert "scatter" in compiled
    for name in (
        "first_angle_shear",
        "velocity_shear",
        "last_angle_shear",
        "fill_blocks",
        "blocks_to_point_values",
        "target_range",
    ):
        assert repr(name) not in compiled


def test_free_flight_is_compiled_for_the_degree_that_the_solver_ends_at(monkeypatch):
    seen = []

    def free_flight(space, *_):
        seen.append(space.degree)
        return types.SimpleNamespace(apply=lambda *_: None)

    monkeypatch.setattr("fpk_rocking.density.step.free_flight.FreeFlight", free_flight)
    least_runs.free_flight()
    assert seen == [RESOLUTIONS[USUAL[1e-3]].degree]


def test_one_process_compiles_a_kernel_and_others_wait_for_it(tmp_path):
    """As many at once as would collide: each answers, and the kernel is compiled once.

    The first of them says that it compiles; one more, later, has nothing to say.
    """
    code = """
from fpk_rocking.base import precompilation
from fpk_rocking.physics.motion.equation import KernelBlock
from fpk_rocking.physics.motion.impact import chatter_time
precompilation.TASKS["fpk_rocking.physics.motion.impact:chatter_time"] = 7
precompilation.start_helpers("fpk_rocking.physics.motion.impact:chatter_time")
answer = chatter_time(0.25, 1, 0.0, KernelBlock(0.0, 1.5))
print(answer, *(sum(made.stats.cache_misses.values()) for made in chatter_time.for_types.values()))
"""
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)}
    where = {"env": environment, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    runs = [subprocess.Popen([sys.executable, "-c", code], **where) for _ in range(3)]
    answers, said = zip(*(process.communicate(timeout=120) for process in runs), strict=True)
    assert sorted(answers) == ["0.5 0\n", "0.5 0\n", "0.5 1\n"]
    assert "compiling machine code for this machine, once: about 7 s\n" in said
    later = run([sys.executable, "-c", code], tmp_path)
    assert (later.stdout, later.stderr) == ("0.5 0\n", "")


@pytest.mark.slow
def test_two_cold_commands_side_by_side_on_one_cache_answer(scene, tmp_path):
    """The first of them says that it compiles; a third, later, has nothing to say."""
    asked = [*CLI, "mc", scene, "--method", "white", "--cycles", "1", "--realizations", "9", "--json"]
    says = f"compiling machine code for this machine, once: about {precompilation.TASKS[WHITE]} s\n"
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


def test_warmup_runs_all_tasks_and_says_which_failed(monkeypatch, capsys):
    from fpk_rocking import cli

    monkeypatch.setattr(precompilation, "TASKS", {"json:dumps": 1, "fpk_rocking.base.checks:nothing": 1})
    assert cli.main(["warmup"]) == 2
    said = capsys.readouterr().err.splitlines()
    assert said[0].startswith("compiling machine code for this machine: about")
    assert sum(line.startswith("fpk-rocking warmup: not compiled: ") for line in said) == 2
    assert said[-1].startswith("fpk-rocking warmup: 2 of 2 parts were not compiled")


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


@pytest.mark.parametrize(("processors", "started"), [(1, []), (2, [("b", "c")]), (3, [("b",), ("c",)])])
def test_helpers_take_on_what_a_call_will_need_and_what_is_not_done(monkeypatch, capsys, processors, started):
    seen = []
    monkeypatch.setattr(precompilation, "_helpers", [])
    monkeypatch.setattr(precompilation, "_queued", [])
    monkeypatch.setattr(precompilation, "TASKS", {"a": 3})
    monkeypatch.setattr(precompilation, "_is_compiled", lambda task: task == "d")
    monkeypatch.setattr(precompilation, "_mark_compiled", lambda task: None)  # noqa: ARG005
    monkeypatch.setattr(precompilation, "processors", lambda: processors)
    monkeypatch.setattr(precompilation, "start_process", lambda *tasks: seen.append(tasks))
    precompilation.queue_for_helpers("c")
    precompilation.queue_for_helpers("d")
    precompilation.start_helpers("a", "b")
    assert seen == started
    assert capsys.readouterr().err == "compiling machine code for this machine, once: about 3 s\n"
