"""Interruptions that C code swallows: they come again, and stand for the error that came of them."""

import sys
import types

import pytest

from fpk_rocking import console


def swallow(*kinds, error=None):
    for kind in kinds:
        sys.unraisablehook(types.SimpleNamespace(exc_type=kind))
    if error:
        raise error


@pytest.mark.parametrize(
    "kinds", [(KeyboardInterrupt,), (console.Terminated,), (KeyboardInterrupt, console.Terminated)]
)
@pytest.mark.parametrize("error", [None, ZeroDivisionError])
def test_an_interruption_that_was_swallowed_is_raised_at_the_end(monkeypatch, kinds, error):
    """The last of several, and in place of an error that came in between."""
    monkeypatch.setattr(console, "_AGAIN_S", 60.0)  # not while the block lasts
    hook = sys.unraisablehook
    with pytest.raises(KeyboardInterrupt) as result, console.insistent():
        swallow(*kinds, error=error)
    assert result.type is kinds[-1]
    assert isinstance(result.value.__cause__, error or type(None))
    assert sys.unraisablehook is hook


def test_what_else_is_swallowed_is_told_as_before(monkeypatch):
    ignored_types = []
    monkeypatch.setattr(sys, "unraisablehook", lambda ignored: ignored_types.append(ignored.exc_type))
    with console.insistent():
        swallow(ValueError)
    assert ignored_types == [ValueError]
    with pytest.raises(ZeroDivisionError), console.insistent():
        raise ZeroDivisionError
