"""Types that public names are annotated with."""

import os
from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike

__all__ = ["Array", "ArrayLike", "File", "Number", "Progress", "known"]

_T = TypeVar("_T")

Array = np.ndarray[Any, np.dtype[Any]]

Number = float | Array
"""A scalar, or an array whose shape the result has."""

File = str | os.PathLike[str]
"""Path of a file or a folder."""

Progress = Callable[[int, int], object]
"""Called with what is done and the whole."""


def known(value: _T | None) -> _T:
    """Return a value that is not None here, as something else says; it tells a type checker so."""
    if value is None:
        raise TypeError("got None, accepted: a value")
    return value
