"""Scripts of `findings/`: their form, and the page that lists them. They are run by hand."""

import pathlib
import re
import subprocess

import pytest

ROOT = pathlib.Path(__file__).parents[2]
SCRIPTS = sorted((ROOT / "findings").iterdir())
PROGRAM = re.compile(r"<<'PYTHON'\n(.*)^PYTHON\n\Z", re.MULTILINE | re.DOTALL)
OPTIONS = {"install", "--quiet", "--disable-pip-version-check", "--no-deps"}


def installed(text):
    """Packages that the `pip install` lines of a script name."""
    lines = re.findall(r"^.*pip\"? (?:.*)?install (.*)$", text.replace("\\\n", " "), re.MULTILINE)
    return [word.strip("'") for line in lines for word in line.split() if word not in OPTIONS]


def faults(text):
    """Parts of the form that the text of a script lacks."""
    head, program = text.partition("\nset -")[0], PROGRAM.search(text)
    found = {
        "head": all(said in head for said in ("#!/usr/bin/env bash\n# ", "# One would guess: ", "# What happens: ")),
        "versions": bool(re.search(r"^# Seen with .*\d\.\d.*\.$", head, re.MULTILINE)),
        "stops at an error": "\nset -euo pipefail\n" in text,
        "cleans up": "\nfolder=$(mktemp -d)\ntrap 'rm -rf \"$folder\"' EXIT\n" in text,
        "own environment": '\npython3 -m venv "$folder/venv"\n' in text and '\ncd "$folder"\n' in text,
        "pins": bool(installed(text)) and all(re.search(r"==|^setuptools<", name) for name in installed(text)),
        "alone": not re.search(r"fpk_rocking|montecarlo", text),
        "decides": program is not None and "assert " in program[1],
    }
    return [name for name, right in found.items() if not right]


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda path: path.stem)
def test_a_finding_installs_pinned_versions_and_decides(script):
    text = script.read_text(encoding="utf-8")
    assert script.suffix == ".sh"
    assert faults(text) == []
    assert subprocess.run(["bash", "-n", script], check=False).returncode == 0
    compile(PROGRAM.search(text)[1], script.name, "exec")


def test_what_lacks_its_form_is_seen():
    text = SCRIPTS[0].read_text(encoding="utf-8")
    assert faults(text.replace("==", ">=", 1)) == ["pins"]
    assert faults(text.replace("One would guess", "Guess")) == ["head"]
    assert faults(text.replace("import numpy", "import fpk_rocking\nimport numpy", 1)) == ["alone"]
    assert faults(text.replace("assert ", "print ")) == ["decides"]


def test_the_page_lists_every_finding_once():
    page = (ROOT / "docs" / "findings.md").read_text(encoding="utf-8")
    assert sorted(re.findall(r"^\| `([\w-]+)` \|", page, re.MULTILINE)) == [path.stem for path in SCRIPTS]
