"""Types that public names are annotated with."""

import os
from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike

__all__ = ["Array", "ArrayLike", "File", "Number", "Progress", "not_none"]

_T = TypeVar("_T")

Array = np.ndarray[Any, np.dtype[Any]]

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
