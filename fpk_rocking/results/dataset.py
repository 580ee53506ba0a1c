"""Named arrays over named dimensions: the one form of a result from which tables, files and frames are made."""

import importlib
import itertools
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from fpk_rocking.base.types import Array


class Dataset(NamedTuple):
    """The arrays of a result.

    Parameters
    ----------
    variables : dict of str to (dimensions, values)
        As in ``{"overturned": (("time", "side"), overturned)}``. The dimensions are a name or a tuple of names; the
        values an array, or a function without parameters that computes it, for arrays that take long.
    coordinates : dict
        Values along each dimension by its name, as in ``{"side": ["left", "right"]}``; by other names (dimensions,
        values) as of a variable.
    rows : tuple of str
        Dimensions that the rows of the table stand for, the last one running fastest; each has a coordinate.
    """

    variables: dict[str, Any]
    coordinates: dict[str, Any]
    rows: tuple[str, ...]

    def in_rows(self) -> Iterator[tuple[str, tuple[str, ...], Array]]:
        """Yield name, dimensions and values of the variables in the table.

        These have at least one dimension of the rows, and no others but such as have texts for coordinates.
        """
        for name, variable in self.variables.items():
            dims, values = _pair(name, variable)
            others = [dim for dim in dims if dim not in self.rows]
            if len(others) < len(dims) and all(self._labels(dim) for dim in others):
                yield name, dims, _computed(values)

    def table(self) -> dict[str, Array]:
        """Columns (rows,) by name: coordinates, then variables.

        Of a variable with a dimension beside the rows each label has a column, as "overturned_left"; that of an
        "x_interval" is "x_low".
        """
        places = [(name, *_pair(name, values)) for name, values in self.coordinates.items()]
        sizes = [len(self.coordinates[dim]) for dim in self.rows]
        columns = {}
        for name, dims, values in [*(one for one in places if set(one[1]) <= set(self.rows)), *self.in_rows()]:
            ordered = sorted(dims, key=lambda dim: self.rows.index(dim) if dim in self.rows else len(self.rows))
            array = np.transpose(np.asarray(values), [dims.index(dim) for dim in ordered])
            labels = [self._labels(dim) for dim in ordered if dim not in self.rows]
            array = array.reshape(
                [size if dim in dims else 1 for dim, size in zip(self.rows, sizes, strict=True)] + [-1]
            )
            array = np.broadcast_to(array, [*sizes, array.shape[-1]])
            for place, texts in enumerate(itertools.product(*labels)):
                columns["_".join([name.removesuffix("_interval"), *texts])] = array[..., place].ravel()
        return columns

    def to_xarray(self, attributes: dict[str, Any]) -> Any:
        """Return an `xarray.Dataset` of copies, with attributes."""
        groups = (self.variables, self.coordinates)
        copied = [
            {name: (dims, np.array(_computed(values))) for name, (dims, values) in _pairs(group)} for group in groups
        ]
        return optional("xarray").Dataset(*copied, attributes)

    def _labels(self, dim):
        """Coordinates of a dimension where these are texts."""
        labels = list(self.coordinates.get(dim, ()))
        return labels if all(isinstance(label, str) for label in labels) else []


def optional(name: str) -> Any:
    """Import pandas or xarray, or say how to install it."""
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError as error:
        if error.name != name:
            raise
        needed = f"{name} is not installed: pip install 'fpk-rocking[frames]' installs it"
        raise ModuleNotFoundError(needed, name=name) from None


def _pair(name, variable):
    """Dimensions and values of a variable, or of the coordinate of a dimension of that name."""
    dims, values = variable if isinstance(variable, tuple) else (name, variable)
    return ((dims,) if isinstance(dims, str) else dims), values


def _pairs(group):
    return ((name, _pair(name, variable)) for name, variable in group.items())


def _computed(values):
    return values() if callable(values) else values
