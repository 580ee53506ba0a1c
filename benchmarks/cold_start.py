"""The first answer on a new machine, and what a command takes once its machine code is there.

python benchmarks/cold_start.py            the table in docs/benchmarks
python benchmarks/cold_start.py --kernels  seconds of compiling by kernel, in one process
"""

import os
import resource
import subprocess
import sys
import tempfile
import time

from report import ROOT, table, write_section

SCENE = str(ROOT / "cases" / "scenes" / "main.toml")
COMMANDS = {
    "fpk": ["fpk", SCENE],
    "mc, exact": ["mc", SCENE],
    "mc, rk4": ["mc", SCENE, "--method", "rk4"],
    "mc, white": ["mc", SCENE, "--method", "white"],
    "compare": ["compare", SCENE],
    "--help": ["--help"],
}
WARM_ROUNDS = 5
OPERATOR = f"from fpk_rocking import *; CycleOperator(load_scene({SCENE!r}), tol=1e-3).survival(10)"

BY_KERNEL = """
import sys, time
from fpk_rocking import cli
from numba.core import event

class Clock(event.Listener):
    open, spent = [], {}
    def on_start(self, _):
        self.open.append([time.process_time(), 0.0])
    def on_end(self, compiled):
        begin, inner = self.open.pop()
        elapsed, kernel = time.process_time() - begin, compiled.data["dispatcher"].py_func
        name = f"{kernel.__module__}.{kernel.__name__}"
        self.spent[name] = self.spent.get(name, 0.0) + elapsed - inner
        if self.open:
            self.open[-1][1] += elapsed

event.register("numba:compile", Clock())
cli.main(sys.argv[1:])
for name, seconds in sorted(Clock.spent.items(), key=lambda item: -item[1])[:20]:
    print(f"{seconds:6.2f}  {name}", file=sys.stderr)
"""


def timed(command, cache):
    """Wall seconds and processor seconds, helpers included, of a command with a cache folder."""
    environment = os.environ | {"NUMBA_CACHE_DIR": cache}
    before, begin = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    subprocess.run(command, env=environment, check=True, capture_output=True)
    wall, after = time.perf_counter() - begin, resource.getrusage(resource.RUSAGE_CHILDREN)
    return wall, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def rows():
    """Cold and warm seconds of every command."""
    commands = {name: [sys.executable, "-m", "fpk_rocking", *rest] for name, rest in COMMANDS.items()}
    commands["operator"] = [sys.executable, "-c", OPERATOR]
    for name, command in commands.items():
        with tempfile.TemporaryDirectory() as cache:
            cold, spent = timed(command, cache)
            warm = min(timed(command, cache)[0] for _ in range(WARM_ROUNDS))
        yield [name, f"{cold:.1f}", f"{spent:.1f}", f"{warm:.2f}"]


def main():
    """Measure, and write the section."""
    if "--kernels" in sys.argv:
        for name in ("fpk", "mc, exact", "mc, rk4", "mc, white"):
            with tempfile.TemporaryDirectory() as cache:
                # One processor: no helpers take a part of the work away.
                print(name, file=sys.stderr)
                environment = os.environ | {"NUMBA_CACHE_DIR": cache}
                pinned = {"preexec_fn": lambda: os.sched_setaffinity(0, {0})}
                command = [sys.executable, "-c", BY_KERNEL, *COMMANDS[name]]
                subprocess.run(command, env=environment, check=True, stdout=subprocess.DEVNULL, **pinned)
        return
    lines = list(rows())
    write_section(
        "Cold start",
        f"""**Result.** The first `fpk` on a machine takes {lines[0][1]} s, a later one {lines[0][3]} s.

Main scene, 40 cycles, default settings. Seconds from the start of a process to its answer: the first time on a machine
(an empty cache of machine code), and once the machine code is there (least of {WARM_ROUNDS}). Processor seconds include
those of helpers that compile beside the first process.

{table(["command", "first, s", "first, processor s", "then, s"], lines)}
""",
        page=None,
    )


if __name__ == "__main__":
    main()
