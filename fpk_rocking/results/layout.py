"""Types and shapes that the arrays and attributes of a saved result must have."""

import math
import re
from typing import Any, NamedTuple

import numpy as np

from fpk_rocking.base.types import Array, known


class Layout(NamedTuple):
    """What a kind of result holds.

    `arrays`: dtype and lengths of each by name, as in ``{"angle": "f8 n k+1", "side": "i1 n"}``; a letter is one
    length in all arrays, and may have a factor in front and 1 added. `attributes`: the class of each by name; float
    takes whole numbers too.
    """

    arrays: dict[str, str]
    attributes: dict[str, type]

    def of(self, result: Any) -> tuple[dict[str, Any], dict[str, Any]]:
        """Return the arrays and the attributes of a result that has them all under these names."""
        arrays, attributes = ({name: getattr(result, name) for name in names} for names in self)
        return arrays, attributes

    def check(self, arrays: dict[str, Array], attributes: dict[str, Any]) -> None:
        """Raise ValueError where arrays and attributes are others, or of another form."""
        for kind, found, wanted in (("arrays", arrays, self.arrays), ("attributes", attributes, self.attributes)):
            if found.keys() != wanted.keys():
                raise ValueError(f"{kind}: got {', '.join(sorted(found))}, accepted: {', '.join(sorted(wanted))}")
        for name, cls in self.attributes.items():
            value = attributes[name]
            if isinstance(value, bool) != (cls is bool) or not isinstance(value, (int, float) if cls is float else cls):
                raise ValueError(f"{name}: got {value!r}, accepted: {cls.__name__}")
        lengths: dict[str, int] = {}
        for name, form in self.arrays.items():
            code, *dims = form.split()
            values = arrays[name]
            fits = values.dtype == np.dtype(code) and values.ndim == len(dims)
            if not fits or not all(_fits(*pair, lengths) for pair in zip(values.shape, dims, strict=True)):
                known = ", ".join(f"{letter} = {length}" for letter, length in lengths.items())
                raise ValueError(f"{name}: got {values.dtype} of shape {values.shape}, accepted: {form!r} with {known}")


def _fits(length, dim, lengths):
    """Whether an array's length is as stated, such as "2", "n" or "20k+1"; a letter's first length is kept."""
    factor, letter, one = known(re.fullmatch(r"(\d*)([a-z]?)(\+1)?", dim)).groups()
    length, factor = length - bool(one), int(factor or 1)
    if not letter:
        return length == factor
    return length % factor == 0 and length >= 0 and lengths.setdefault(letter, length // factor) == length // factor


def plain(value: Any) -> Any:
    """Return lists in place of arrays and tuples, and None in place of nan."""
    if isinstance(value, dict):
        return {name: plain(one) for name, one in value.items()}
    if isinstance(value, list | tuple):
        return [plain(one) for one in value]
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    return None if isinstance(value, float) and not math.isfinite(value) else value
