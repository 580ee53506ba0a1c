"""Checks of parameters, and the types that public names are annotated with.

Every refusal names the parameter, what was got and what is accepted. Names are the dotted names of a scene file
(``noise.variance``), also where a value was built in Python.
"""

import dataclasses
import difflib
import math
import numbers
import os
import pathlib
from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

_T = TypeVar("_T")

Array = np.ndarray[Any, np.dtype[Any]]

ArrayLike = npt.ArrayLike

Number = float | Array
"""A scalar, or an array whose shape the result has."""

File = str | os.PathLike[str]
"""Path of a file or a folder."""

Progress = Callable[[int, int], object]
"""Called with the number of rows that are done, and that of all."""


def not_none(value: _T | None) -> _T:
    """Return a value, or raise TypeError where it is None: for a type checker, where other checks exclude None."""
    if value is None:
        raise TypeError("got None, accepted: a value")
    return value


_LONGEST = 500


def refusal(name, got, accepted):
    """Return the text "NAME: got GOT, accepted: ACCEPTED" of a refusal."""
    try:
        text = repr(got)
    except ValueError:  # Python writes no integer of more than 4300 digits
        text = f"{type(got).__name__} of very many digits"
    return f"{name}: got {text if len(text) <= _LONGEST else text[:_LONGEST] + '...'}, accepted: {accepted}"


def number(name, value, *, at_least=None, above=None, at_most=None):
    """Return a finite float within bounds after a check; a bool is no number, `above` is a strict bound."""
    bounds = {">=": at_least, ">": above, "<=": at_most}
    accepted = " and ".join(f"{sign} {bound}" for sign, bound in bounds.items() if bound is not None)
    accepted = f"a finite number {accepted}".rstrip()
    if isinstance(value, bool) or not isinstance(value, numbers.Real):
        raise TypeError(refusal(name, value, accepted))
    try:
        converted = float(value)
    except OverflowError:
        converted = math.inf
    inside = (
        math.isfinite(converted)
        and (at_least is None or converted >= at_least)
        and (above is None or converted > above)
        and (at_most is None or converted <= at_most)
    )
    if not inside:
        raise ValueError(refusal(name, value, accepted))
    return converted


def keep(value, **checked):
    """Set fields of a frozen dataclass, in its `__post_init__`, to checked values."""
    for name, checked_value in checked.items():
        object.__setattr__(value, name, checked_value)


def keep_numbers(value, prefix, *names, **bounds):
    """Check fields of a frozen dataclass as `number` does, and keep them as floats; `prefix` is for the message."""
    for name in names:
        keep(value, **{name: number(f"{prefix}.{name}", getattr(value, name), **bounds)})


def part(name, value):
    """Return a float above 0 and below 1 after a check."""
    fraction = number(name, value, above=0.0)
    if fraction >= 1.0:
        raise ValueError(refusal(name, value, "a number above 0 and below 1"))
    return fraction


def count(name, value, at_least=1, at_most=None):
    """Return an int within bounds after a check; a bool and 100.0 are no integers."""
    accepted = f"a whole number {f'>= {at_least}' if at_most is None else f'from {at_least} to {at_most}'}"
    if isinstance(value, bool) or not isinstance(value, numbers.Integral):
        raise TypeError(refusal(name, value, accepted))
    if value < at_least or (at_most is not None and value > at_most):
        raise ValueError(refusal(name, value, accepted))
    return int(value)


def array(name, value, accepted):
    """Return an array_like as an array of floats; TypeError where one is no real number."""
    try:
        numbers = np.asarray(value)
    except ValueError:
        raise TypeError(refusal(name, value, accepted)) from None
    if numbers.dtype.kind not in "fiu":
        raise TypeError(refusal(name, value, accepted))
    return numbers.astype(float)


def several(name, value, *, most, **bounds):
    """Return a tuple of 1 to `most` floats from a sequence, each within the bounds of `number`, after a check."""
    accepted = f"a list of 1 to {most} numbers"
    items = sequence(name, value, accepted)
    if not 1 <= len(items) <= most:
        raise ValueError(refusal(name, value, accepted))
    return tuple(number(f"{name}[{i}]", item, **bounds) for i, item in enumerate(items))


def vector(name, value, accepted):
    """Return two finite floats from a sequence after a check."""
    items = sequence(name, value, accepted)
    if len(items) != 2:
        raise ValueError(refusal(name, value, accepted))
    return number(f"{name}[0]", items[0]), number(f"{name}[1]", items[1])


def sequence(name, value, accepted):
    """Return the items of a sequence or array as a tuple; TypeError for a text and for what has none."""
    if isinstance(value, str | bytes) or not hasattr(value, "__iter__") or getattr(value, "ndim", 1) == 0:
        raise TypeError(refusal(name, value, accepted))
    return tuple(value)


def interval(name, value):
    """Return the floats (lowest, highest) of a band of frequencies, 0 <= lowest < highest, after a check."""
    accepted = "two numbers [lowest, highest] with 0 <= lowest < highest"
    low, high = vector(name, value, accepted)
    if not 0.0 <= low < high:
        raise ValueError(refusal(name, value, accepted))
    return low, high


def sentence(name, value):
    """Return a text of one line that can be printed after a check."""
    accepted = "a text of one line that can be printed"
    if not isinstance(value, str):
        raise TypeError(refusal(name, value, accepted))
    if not value.isprintable():
        raise ValueError(refusal(name, value, accepted))
    return value


def path(name, value):
    """Return a `pathlib.Path` of a text or path after a check."""
    if not isinstance(value, str | os.PathLike):
        raise TypeError(refusal(name, value, "a path"))
    if "\0" in str(value):
        raise ValueError(refusal(name, value, "a path without null characters"))
    return pathlib.Path(value)


def report(value):
    """Return the parameter `progress`, None or a callable that takes (done, total), after a check."""
    if value is not None and not callable(value):
        raise TypeError(refusal("progress", value, "None, or a callable that takes (done, total)"))
    return value


def instance(name, value, *kinds):
    """Return a value after a check that it is an instance of one of some classes."""
    if not isinstance(value, kinds):
        raise TypeError(refusal(name, value, " or ".join(kind.__name__ for kind in kinds)))
    return value


def table(name, value):
    """Return a parsed TOML table; TypeError where something else stands under its dotted name."""
    if not isinstance(value, dict):
        raise TypeError(refusal(name, value, f"a table [{name}]"))
    return value


def arguments(name, value, cls):
    """Return the entries of a TOML table after a check that a dataclass takes these keys, and needs no others."""
    prefix = f"{name}." if name else ""
    accepted = [field.name for field in dataclasses.fields(cls)]
    required = [field.name for field in dataclasses.fields(cls) if field.default is dataclasses.MISSING]
    for key in table(name, value):
        if key not in accepted:
            close = difflib.get_close_matches(key, accepted, n=1)
            hint = f"; did you mean {prefix}{close[0]}?" if close else ""
            raise ValueError(f"{prefix}{key}: unknown, accepted: {', '.join(accepted) or 'no key'}{hint}")
    for key in required:
        if key not in value:
            raise ValueError(f"{prefix}{key}: missing, required: {', '.join(required)}")
    return dict(value)


ENGINES = " (the range of the engines)"
"""What is said of a range in which engines can carry values."""


def sizes(name, values, low, high, or_none=False):
    """Raise ValueError for a number, or one of a tuple, whose size is not from `low` to `high`; None passes.

    With `or_none` 0 is accepted too.
    """
    none = low > 0.0 and or_none
    for value in values if isinstance(values, tuple) else (values,):
        if value is not None and not (low <= abs(value) <= high or (none and value == 0.0)):
            accepted = f"an absolute value from {low:g} to {high:g}" + (", or 0" if none else "") + ENGINES
            raise ValueError(refusal(name, value, accepted))
