"""The benchmark of the tuned numbers: it knows every table and every number in it, and what it would change."""

import importlib
import pathlib
import sys

import pytest

ROOT = pathlib.Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "benchmarks"))
sensitivity = importlib.import_module("sensitivity")
TABLES = sensitivity.tables()
SCENES = set(sensitivity.calls())


def test_every_table_of_the_packages_is_measured():
    assert {"physics", "montecarlo"} <= set(TABLES) <= set(sensitivity.GROUPS)
    for module, values in TABLES.values():
        own = importlib.import_module(module).TUNING
        assert own._asdict() == values
        assert values


@pytest.mark.parametrize("name", TABLES)
def test_every_number_is_in_a_group_and_changes(name):
    for field, value in TABLES[name][1].items():
        assert set(sensitivity.scenes_of(name, field)) <= SCENES, field
        assert sensitivity.times(value, 0.5) != value != sensitivity.times(value, 2.0), field


def test_numbers_that_kernels_read_are_told_from_those_that_they_do_not():
    module = TABLES["montecarlo"][0]
    assert sensitivity.when_read(module, "bounce_slowest") == "kernels"
    assert sensitivity.when_read(module, "batch_seconds") == "call"


def test_a_table_notes_which_numbers_are_read():
    numbers, read = sensitivity.recording(importlib.import_module(TABLES["density"][0]).TUNING)
    assert numbers.safety == TABLES["density"][1]["safety"]
    assert read == {"safety"}
    halved = sensitivity.changed(numbers, {"safety": 0.7})
    read.clear()
    assert (halved.safety, halved.resolved, type(halved)) == (0.7, numbers.resolved, type(numbers))
    assert read == {"safety", "resolved"}
