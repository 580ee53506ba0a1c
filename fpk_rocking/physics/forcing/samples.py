"""Samples of a record: checked once, and what follows from them whatever their scale and the block.

A study has many copies of a record, one for each scale. They share their samples, and so what is kept here.
"""

import functools
from collections.abc import Callable
from typing import Any, Self

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.base.checks import Array
from fpk_rocking.physics.forcing.files import MOST


class Samples(tuple[float, ...]):
    """Accelerations, 2 to 2^20 finite floats, in any unit: a tuple that keeps what is computed of it."""

    @classmethod
    def of(cls, value: Any) -> Self:
        """Return the samples in any sequence of numbers, or raise TypeError or ValueError."""
        if isinstance(value, cls):
            return value
        accepted = f"a list of 2 to {MOST} finite numbers"
        array = checks.array("forcing.samples", value, accepted)
        if array.ndim != 1 or not 2 <= array.size <= MOST:
            raise ValueError(checks.refusal("forcing.samples", f"an array of shape {array.shape}", accepted))
        wild = np.flatnonzero(~np.isfinite(array))
        if wild.size:
            raise ValueError(checks.refusal(f"forcing.samples[{wild[0]}]", float(array[wild[0]]), accepted))
        return cls(array.tolist())

    def __reduce__(self):
        return Samples, (tuple(self),)

    @functools.cached_property
    def array(self) -> Array:
        """The samples, shape (n,); not written to."""
        return np.array(self)

    @functools.cached_property
    def toml(self) -> str:
        """The samples as a TOML list; Python's shortest exact form of a float is TOML too."""
        return f"[{', '.join(map(repr, self))}]"

    @functools.cached_property
    def _kept(self) -> dict[Any, Any]:
        """Results of `once` by their key."""
        return {}

    def once(self, key: Any, compute: Callable[[], Any]) -> Any:
        """Return ``compute()``, which is called the first time that these samples are asked for a key (hashable)."""
        if key not in self._kept:
            self._kept[key] = compute()
        return self._kept[key]
