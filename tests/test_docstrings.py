"""Docstrings of the public API: everything that the reference shows says what it is and describes every parameter."""

import importlib
import inspect
import re

import pytest
from test_types import functions_of, shown

from fpk_rocking import melnikov

SECTION = re.compile(r"^(Parameters|Attributes)\n-+\n(.*?)(?=^\w[\w ]*\n-+$|\Z)", re.MULTILINE | re.DOTALL)


def described(thing):
    """Names that the sections of parameters and attributes of a docstring describe."""
    sections = [body for _, body in SECTION.findall(inspect.getdoc(thing) or "")]
    lines = [line for body in sections for line in body.splitlines() if line[:1].strip()]
    return {name.strip(" *") for line in lines for name in line.split(" : ")[0].split(",")}


def undescribed(thing):
    return [name for name in inspect.signature(thing).parameters if name not in described(thing) | {"self", "cls"}]


def things():
    """Everything that the reference shows: functions, classes and their members."""
    for module, name, entry in shown():
        thing = getattr(melnikov if module == "fpk_rocking.melnikov" else importlib.import_module(module), name)
        yield name, thing
        if inspect.isclass(thing) and ":members:" in entry:
            for member in functions_of(thing, ":inherited-members:" in entry):
                yield member.__qualname__, member


@pytest.mark.parametrize("thing", [pytest.param(thing, id=name) for name, thing in things()])
def test_every_parameter_is_described(thing):
    assert inspect.getdoc(thing)
    assert undescribed(thing) == []


@pytest.mark.parametrize(
    "thing", [pytest.param(thing, id=name) for name, thing in things() if inspect.isroutine(thing)]
)
def test_no_other_parameter_is_described(thing):
    assert described(thing) <= inspect.signature(thing).parameters.keys()


def test_a_parameter_without_description_is_found():
    def bare(one, two, three):
        """Do it.

        Parameters
        ----------
        one, three : int
            Numbers.

        Returns
        -------
        two : int
        """

    assert undescribed(bare) == ["two"]
