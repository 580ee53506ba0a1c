"""What the tuned numbers do: each one halved and doubled, against the code as it is; writes files in docs/benchmarks.

A number is changed in its table in a process beside that of the code as it is. Where a kernel reads it, that is a new
process, and kernels are compiled anew, into a folder that is removed; elsewhere machine code is the same.

python benchmarks/sensitivity.py --table physics                     # also montecarlo, density; or all of them
python benchmarks/sensitivity.py --table physics --only touch        # a regular expression; other rows are kept
python benchmarks/sensitivity.py --only none                         # the pages anew, nothing measured
python benchmarks/sensitivity.py --table density --missing           # only rows that are not in the file yet

The file is written after every number, so that a run may be interrupted and go on with `--missing`.
"""

import argparse
import ast
import contextlib
import importlib.util
import itertools
import json
import math
import os
import re
import select
import subprocess
import sys
import tempfile
import time
import warnings

import numpy as np
from report import DATA, ROOT, slug, table, write_section
from sensitivity_scenes import GROUPS, calls, scenes_of

ROUNDING, DRAWN, SECONDS, ANEW, TWICE, LIMIT_S = 1e-9, 1e-3, 0.03, 0.1, 0.15, 240
ROUNDS = {"physics": 4, "montecarlo": 4, "density": 1}
SINGLE = 0.3
RESULTS = "survival", "estimate", "bins", "paths"
REFERENCES, PART = {"density": ("main", "rack", "pulse", "block at rest")}, 0.1
NEWLINE = "\n"
UNCHANGED = "unchanged code, compiled anew"
OF_SECONDS = """Seconds count from 3 % on, and from 10 % on where kernels are compiled anew: the same change compiled
twice differed by that much."""


def tables():
    """Tables of tuned numbers: {name of the folder: (module, {field: default})}."""
    numbers = {}
    for path in sorted(path for package in ("fpk_rocking", "montecarlo") for path in (ROOT / package).rglob("*.py")):
        if "\nTUNING = Tuning()" in path.read_text(encoding="utf-8"):
            *folders, file = path.relative_to(ROOT).with_suffix("").parts
            module = ".".join([*folders, file])
            numbers[folders[:2][-1]] = module, loaded(module).TUNING._asdict()
    return numbers


def loaded(module):
    """Load the module of a table without anything else of the project."""
    spec = importlib.util.spec_from_file_location(module, ROOT.joinpath(*module.split(".")).with_suffix(".py"))
    made = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(made)
    return made


def times(value, factor):
    """Return a number of a table, or each number of a tuple, times a factor; integers are rounded and at least 1."""
    if isinstance(value, tuple):
        return tuple(times(part, factor) for part in value)
    return max(1, round(value * factor)) if isinstance(value, int) else value * factor


def when_read(module, field):
    """Say when a field is read: at a "call" of plain functions, at "import", or by "kernels", which compile it."""
    times_read = {"call"}
    for path in sorted(path for package in ("fpk_rocking", "montecarlo") for path in (ROOT / package).rglob("*.py")):
        text = path.read_text(encoding="utf-8")
        match = re.search(rf"from {re.escape(module)} import TUNING(?: as (\w+))?", text)
        if match:
            tree = ast.parse(text)
            name = f"{match[1] or 'TUNING'}.{field}"
            plain = [node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef) and _is_plain(node)]
            inside = {part for node in plain for line in node.body for part in ast.walk(line)}
            heads = {part for node in plain for part in ast.walk(node)} - inside
            uses = {node for node in ast.walk(tree) if isinstance(node, ast.Attribute) and ast.unparse(node) == name}
            times_read |= {"import" if node in heads else "kernels" for node in uses - inside}
    return max(times_read, key=("call", "import", "kernels").index)


def _is_plain(function):
    plain = {"property", "classmethod", "staticmethod", "functools.cached_property", "abc.abstractmethod"}
    return {*map(ast.unparse, function.decorator_list)} <= plain


def work(module, changes):
    """Answer calls from standard input, [scene, factor, changes of numbers that calls read]: results and seconds."""
    os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
    warnings.simplefilter("ignore")
    out, sys.stdout = os.fdopen(os.dup(1), "w"), sys.stderr
    own = sys.modules[module] = loaded(module)
    own.TUNING, read = recording(changed(own.TUNING, changes))
    first = own.TUNING
    own_calls = calls()
    for line in sys.stdin:
        name, factor, changes, *part = json.loads(line)
        for user in [user for user in sys.modules.values() if type(getattr(user, "TUNING", None)) is type(first)]:
            user.TUNING = changed(first, changes)
        read.clear()
        begin = time.process_time()
        try:
            result = own_calls[name](factor, *part)
            answer = {"seconds": time.process_time() - begin} | {key: np.ravel(v).tolist() for key, v in result.items()}
            answer["read"] = sorted(read)
        except Exception as error:  # noqa: BLE001  (whatever a number out of place leads to is what is asked for)
            answer = {"refused": f"{type(error).__name__}: {error}".split("\n")[0]}
        out.write(json.dumps(answer) + "\n")
        out.flush()


def recording(numbers):
    """Return a table that notes the names of the numbers that are read of it, and the set of these names."""
    read, kind = set(), type(numbers)

    class Recording(kind):
        def __getattribute__(self, name):
            if name in kind._fields:
                read.add(name)
            return super().__getattribute__(name)

    return Recording(*numbers), read


def changed(numbers, changes):
    """Return a table with other values, from JSON."""
    return numbers._replace(**{key: tuple(v) if isinstance(v, list) else v for key, v in changes.items()})


class Variant:
    """A process in which numbers of a table are others; in a folder, where given, for its machine code."""

    def __init__(self, module, changes, folder=None):
        environment = os.environ | {"PYTHONPATH": str(ROOT)} | ({"NUMBA_CACHE_DIR": folder} if folder else {})
        command = [sys.executable, __file__, "--work", module, json.dumps(changes)]
        pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.DEVNULL}
        self.process, self.changes = subprocess.Popen(command, env=environment, text=True, cwd=ROOT, **pipes), {}
        self.called, self.read, self.answers = set(), {}, {}

    def call(self, name, factor, *part):
        """Return the answer of `work` to a call, or why there is none; `part` is a factor of the tolerance."""
        self.called.add(name)
        with contextlib.suppress(BrokenPipeError):
            self.process.stdin.write(json.dumps([name, factor, self.changes, *part]) + "\n")
            self.process.stdin.flush()
        if not select.select([self.process.stdout], [], [], LIMIT_S)[0]:
            return {"refused": f"takes more than {LIMIT_S} s"}
        line = self.process.stdout.readline()
        answer = json.loads(line) if line else {"refused": "the process ended"}
        self.read.setdefault(name, set()).update(answer.get("read", ()))
        return answer

    def once(self, name):
        """Return the answer to the second call of a scene as it is, which compiles nothing; later calls repeat it."""
        if name not in self.answers:
            self.call(name, 1.0)
            self.answers[name] = self.call(name, 1.0)
        return self.answers[name]

    def end(self):
        """End the process."""
        self.process.kill()
        self.process.communicate()


def differences(base, variant):
    """Return how results differ: at most, bins in sum, nine paths in ten; and the standard error of sampling."""
    combine = {"survival": np.max, "estimate": np.max, "bins": np.sum, "paths": lambda parts: np.quantile(parts, 0.9)}
    both = {key: [np.nan_to_num(answer[key]) for answer in (base, variant)] for key in combine if key in base}
    largest = {
        key: float(combine[key](np.abs(a - b))) if a.size == b.size else math.inf for key, (a, b) in both.items()
    }
    return largest | {"sampling": max(base.get("sampling", [0.0]))}


def compare(base, variant, scenes, rounds, count, references):
    """Return the largest changes of results over scenes, and the ratio of seconds that is farthest from 1.

    `references` has survival of a finer solution by the name of a scene; where there is one, the errors of both, of the
    scene whose survival moves most, are "errors".

    That of a scene is the ratio of the least seconds or the median ratio, whichever is nearer to 1: other work on the
    machine moves one rather than both. The first call of a scene in a process, which may compile, is not timed.
    """
    changes = dict.fromkeys(("sampling", *RESULTS), 0.0) | {"seconds": 1.0}
    for name in scenes:
        seconds = []
        for turn in range({name} <= base.called & variant.called, rounds + 1):
            if rounds == 1:
                answers = [base.once(name), variant.call(name, 1.0)]
            else:
                factor = 1.0 - 1e-9 * next(count)
                answers = [process.call(name, factor) for process in (base, variant)]
            refused = [answer["refused"] for answer in answers if "refused" in answer]
            if refused:
                return changes | {"refused": f"{name}: {refused[0]}"}
            moved = differences(*answers)
            if name in references and moved["survival"] >= changes["survival"]:
                changes["errors"] = [max_difference(answer["survival"], references[name]) for answer in answers]
            changes |= {key: max(changes[key], value) for key, value in moved.items()}
            if turn:
                seconds.append([answer["seconds"] for answer in answers])
        own, others = np.transpose(seconds)
        ratio = min(np.median(others / own), others.min() / own.min(), key=_from_1)
        changes["seconds"] = float(max(changes["seconds"], ratio, key=_from_1))
    return changes


def max_difference(values, reference):
    """Largest difference of two lists of numbers."""
    return float(np.abs(np.subtract(values, reference)).max())


def _from_1(ratio):
    return abs(math.log(ratio))


def verdict(change, chance=SECONDS):
    """Say in a word what a change moves, if seconds of unchanged code differ by such a part."""
    if "refused" in change:
        return "refused"
    largest = max(change[key] for key in RESULTS)
    within = change["survival"] <= 3.0 * math.sqrt(2.0) * change["sampling"]
    drawn = within and change["sampling"] and (change["paths"] > DRAWN or change["paths"] <= ROUNDING)  # most, or few
    results = max(change[key] for key in RESULTS if key != "estimate") > ROUNDING
    words = [] if largest <= ROUNDING else ["draws"] if drawn else ["accuracy" if results else "estimate"]
    words += ["speed"] if abs(change["seconds"] - 1.0) > chance else []
    return ", ".join(words) or ("rounding" if largest > 0.0 else "nothing")


def measure(name, pattern, rows, missing=False):
    """Measure the numbers of a table that a pattern fits, into {field: [value, {factor: change}]}; write after each.

    With `missing` those that are in `rows` are left out. A scene in which a number is not read is not run for it.
    """
    module, values = tables()[name]
    wanted = [field for field in values if re.fullmatch(pattern, field) and scenes_of(name, field)]
    wanted = [field for field in wanted if not (missing and field in rows)]
    if not wanted:
        return
    base, other, count = Variant(module, {}), Variant(module, {}), itertools.count(1)
    every = dict.fromkeys(scene for field in wanted for scene in scenes_of(name, field))
    finer = [scene for scene in every if scene in REFERENCES.get(name, ())]
    references = {scene: base.call(scene, 1.0, PART)["survival"] for scene in finer}
    base.read.clear()
    anew = any(when_read(module, field) == "kernels" for field in values)
    with tempfile.TemporaryDirectory() as folder:
        same = Variant(module, {}, folder if anew else None)
        rows[UNCHANGED] = ["", {"1": compare(base, same, every, ROUNDS[name], count, references)}]
        same.end()
    for field in wanted:
        read, changes = when_read(module, field), {}
        scenes = [scene for scene in scenes_of(name, field) if read != "call" or field in base.read[scene]]
        for factor in (0.5, 2.0) if scenes else ():
            change = {field: times(values[field], factor)}
            with tempfile.TemporaryDirectory() as folder:
                if read == "call":
                    variant, other.changes = other, change
                else:
                    variant = Variant(module, change, folder if read == "kernels" else None)
                measured = compare(base, variant, scenes, ROUNDS[name], count, references)
                if (
                    ROUNDS[name] > 1 and SECONDS < abs(measured["seconds"] - 1.0) < TWICE
                ):  # by chance? then hardly twice
                    again = compare(base, variant, scenes, ROUNDS[name], count, references)
                    measured = min(measured, again, key=lambda change: _from_1(change["seconds"])) | {"series": 2}
                changes[f"{factor:g}"] = measured | {"scenes": scenes}
                if variant is not other or "refused" in measured:
                    variant.end()
                if variant is other and "refused" in measured:
                    other = Variant(module, {})
            print(change, measured, verdict(measured), flush=True)
        rows[field] = [values[field], changes]
        write(name, rows)
    base.end()
    other.end()


def write(name, measured):
    """Write the section of a table; `measured` also has numbers that have left it."""
    module, values = tables()[name]
    measured = {field: measured[field] for field in {UNCHANGED: None, **values, **measured} if field in measured}
    limits = [field for field in values if not scenes_of(name, field) and field not in measured]
    left = [field for field in values if scenes_of(name, field) and field not in measured]
    unread = [field for field, (_, changes) in measured.items() if not changes]
    gone = [f"`{field}`" for field in measured if field != UNCHANGED and field not in values]
    rows, idle, refused, finer = [], [], [], name in REFERENCES
    for field, (value, changes) in measured.items():
        chance = ANEW if field not in values or when_read(module, field) == "kernels" else SECONDS
        chance = SINGLE if ROUNDS[name] == 1 else chance
        verdicts = {factor: verdict(change, chance) for factor, change in changes.items()}
        if field != UNCHANGED and changes and set(verdicts.values()) <= {"nothing", "rounding"}:
            idle.append(f"`{field}`")
        for factor, change in changes.items():
            numbers = [f"{change[key]:.1e}" if change[key] else "0" for key in RESULTS[: -1 if finer else None]]
            numbers += [f"{error:.1e}" for error in change.get("errors", [0.0, 0.0])] if finer else []
            rows.append(
                [
                    field if field == UNCHANGED else f"`{field}`",
                    value,
                    factor,
                    *numbers,
                    f"{change['seconds']:.2f}",
                    verdicts[factor],
                ]
            )
            if "refused" in change:
                refused.append(f"* `{field}` times {factor}: {change['refused']}")
    of_these = f"In the code where they are used, and no longer in the table: {', '.join(gone)}." if gone else ""
    of_these = (
        "They stand in the code where they are used, no longer in the table." if idle and gone == idle else of_these
    )
    compared = ["error before", "error"] if finer else ["paths"]
    head = ["number", "value", "times", "survival", "estimate", "bins", *compared, "seconds", "moves"]
    scenes = sorted({scene for field in measured if field in values for scene in scenes_of(name, field)})
    twice = sum(change.get("series", 1) == 2 for _, changes in measured.values() for change in changes.values())
    of_paths = """the change below which 90 % of the angles and velocities
of the paths of the same seed stay (of splitting: of its repeats, over the probability; near saddles rounding grows
exponentially)"""
    single, count = ROUNDS[name] == 1, len(measured) - 1 - len(unread)
    turns = "one call" if single else f"{ROUNDS[name]} calls in turn"
    of_seconds = f"Seconds count from {100 * SINGLE:.0f} % on: less is chance." if single else OF_SECONDS
    of_errors = f"""the error of survival before and after, against a solution to {PART:g} of the tolerance
(in that of the scenes {", ".join(REFERENCES.get(name, ()))} whose survival moves most)"""
    body = f"""**Result.** {len(idle)} of {count} numbers move neither a result beyond rounding nor
the seconds, halved or doubled.

{", ".join(idle)}{"." if idle else ""}
{of_these}

Each number of `{module}` is halved and doubled in turn, integers rounded, tuples in all their parts, and the
scenes that feel it are run beside the code as it is. Stated are the largest change of survival and of the error
estimate, the sum of the changes of the probabilities in bins, {of_errors if finer else of_paths},
and the ratio of the processor seconds that is farthest from 1, of {turns} on one
core{f"; of {twice} rows the nearer to 1 of two such series" if twice else ""}. Changes up to {ROUNDING:g} are rounding;
"draws" says that other random numbers are drawn, and that survival moves by less than 3 of its standard errors.
{of_seconds}

{table(head, rows)}

Scenes: {", ".join(scenes)}. Not measured, since they are limits of memory or of time beyond which a call is refused,
warned of or parted, or since only calls of minutes feel them: {", ".join(f"`{field}`" for field in limits) or "none"}.
{f"Read in none of these scenes: {', '.join(f'`{field}`' for field in unread)}." if unread else ""}
{f"Still to be measured (`--missing`): {', '.join(f'`{field}`' for field in left)}." if left else ""}

{NEWLINE.join(["Refused:", "", *refused]) if refused else ""}
"""
    write_section(f"Sensitivity: {name}", body, page=None, values={"measured": measured})


def main():
    """Measure what is asked for, and write it beside what was measured before."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--table", choices=[*GROUPS], action="append", help="by default all")
    parser.add_argument("--only", default=".*", metavar="FIELD", help="a regular expression")
    parser.add_argument("--missing", action="store_true", help="only numbers that the file does not have")
    parser.add_argument("--work", nargs=2, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.work:
        work(options.work[0], json.loads(options.work[1]))
        return
    for name in options.table or tables():
        file = DATA / f"{slug(f'Sensitivity: {name}')}.json"
        measured = json.loads(file.read_text(encoding="utf-8"))["measured"] if file.exists() else {}
        try:
            measure(name, options.only, measured, options.missing)
        finally:
            if measured:
                write(name, measured)


if __name__ == "__main__":
    main()
