"""Types that public names are annotated with."""

import os
from collections.abc import Callable
from typing import Any, ClassVar, Protocol

import numpy as np
from numpy.typing import ArrayLike

__all__ = ["Array", "ArrayLike", "File", "Noise", "Number", "Progress"]

Array = np.ndarray[Any, np.dtype[Any]]

Number = float | Array
"""A scalar, or an array whose shape the result has."""

File = str | os.PathLike[str]
"""Path of a file or a folder."""

Progress = Callable[[int, int], object]
"""Called with what is done and the whole."""


class Noise(Protocol):
    """Noise of any kind."""

    kind: ClassVar[str]
