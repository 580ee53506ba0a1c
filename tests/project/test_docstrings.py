"""Docstrings of the public API: what it is, every parameter, and examples that run.

A class shown without a constructor, as ``Study()``, is the result of a function, whose example it is.
"""

import doctest
import importlib
import inspect
import re

import pytest
from test_pages import SOLVED
from test_types import functions_of, shown

import fpk_rocking
from fpk_rocking import melnikov
from fpk_rocking.studies import tasks

SECTION = re.compile(r"^(Parameters|Attributes)\n-+\n(.*?)(?=^\w[\w ]*\n-+$|\Z)", re.MULTILINE | re.DOTALL)


def described(thing):
    """Names that the sections of parameters and attributes of a docstring describe."""
    sections = [body for _, body in SECTION.findall(inspect.getdoc(thing) or "")]
    lines = [line for body in sections for line in body.splitlines() if line[:1].strip()]
    return {name.strip(" *") for line in lines for name in line.split(" : ")[0].split(",")}


def undescribed(thing):
    return [name for name in inspect.signature(thing).parameters if name not in described(thing) | {"self", "cls"}]


def public(module, name):
    return getattr(melnikov if module == "fpk_rocking.melnikov" else importlib.import_module(module), name)


def things():
    """Everything that the reference shows: functions, classes and their members, by name."""
    for module, name, entry in shown():
        thing = public(module, name)
        yield f"{module}.{name}", thing
        if inspect.isclass(thing) and (members := re.search(r":members:(.*)", entry)):
            kept = members[1].replace(",", " ").split()
            for member in functions_of(thing, ":inherited-members:" in entry):
                if member.__name__ in (kept or [member.__name__]):
                    yield f"{module}.{member.__qualname__}", member


def failures(thing, needed=True):
    """Say what the examples of a docstring print otherwise than it shows, or that there are none where it needs one."""
    examples = doctest.DocTestParser().get_doctest(thing.__doc__, {}, thing.__name__, None, 0)
    messages = ["no example"] if needed and not examples.examples else []
    doctest.DocTestRunner(verbose=False).run(examples, out=messages.append)
    return "".join(messages)


def test_everything_public_has_a_docstring():
    assert [name for name, thing in things() if not inspect.getdoc(thing)] == []


def test_every_parameter_is_described():
    lacking_of = {name: undescribed(thing) for name, thing in things() if not getattr(thing, "_is_protocol", False)}
    assert {name: lacking for name, lacking in lacking_of.items() if lacking} == {}
    assert len(lacking_of) > 200


def test_nothing_but_parameters_is_described():
    functions = {name: thing for name, thing in things() if inspect.isroutine(thing)}
    strange_of = {
        name: described(function) - inspect.signature(function).parameters.keys()
        for name, function in functions.items()
    }
    assert {name: strange for name, strange in strange_of.items() if strange} == {}


def test_classes_of_public_results_are_in_the_reference():
    """What a public function returns, and what a public class holds, is described too."""
    documented = {name.rpartition(".")[2] for name, thing in things() if inspect.isclass(thing)}
    named = set()
    for _, thing in things():
        annotation = str(inspect.signature(thing).return_annotation) if inspect.isroutine(thing) else ""
        named |= set(re.findall(r"(?:fpk_rocking|montecarlo)[\w.]*\.([A-Z]\w+)", annotation))
    assert named - documented == set()


def test_a_parameter_without_description_is_found():
    def bare(first, second, third):
        """Do it.

        Parameters
        ----------
        first, third : int
            Numbers.

        Returns
        -------
        second : int
        """
        return first, second, third

    assert undescribed(bare) == ["second"]
    assert described(bare) == {"first", "third"}


@pytest.mark.site
@pytest.mark.parametrize(("module", "name", "entry"), list(shown()), ids=lambda value: value.split("\n")[0])
def test_examples_print_what_they_show(module, name, entry, tmp_path, monkeypatch):
    """All together 9 s of one processor: many show the same density, which is solved once."""
    monkeypatch.chdir(tmp_path)
    for solver, solved in SOLVED.items():
        monkeypatch.setattr(fpk_rocking, solver, solved)
    monkeypatch.setattr(tasks, "solve_fpk", SOLVED["solve_fpk"])
    assert failures(public(module, name), needed=f":: {name}()" not in entry) == ""


def test_examples_that_lack_or_fail_are_found():
    def bare():
        """Do it."""

    def wrong():
        """Do it.

        >>> print(1 + 1)
        3
        """

    def broken():
        """Do it.

        >>> absent
        """

    assert failures(bare) == "no example"
    assert failures(bare, needed=False) == ""
    assert re.search(r"Expected:\n    3\nGot:\n    2", failures(wrong))
    assert "NameError: name 'absent'" in failures(broken)
