"""What every result has, of whichever engine or study: verdict, card, dataset, files, frames, summary."""

import dataclasses
import functools
import html
import importlib
import itertools
import textwrap
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from fpk_rocking.base.checks import Array, File
from fpk_rocking.results.remarks import scene_diagnostics, scene_remarks
from fpk_rocking.results.storage import plain, write_csv
from fpk_rocking.results.trust import DIAGNOSTICS, Diagnostic, Trust, assess, verdict


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

    Examples
    --------
    >>> from fpk_rocking import load_scene, solve_fpk
    >>> dataset = solve_fpk(load_scene("main"), cycles=4, tol=1e-2).dataset()
    >>> print(dataset.rows, dataset.table()["survival"].round(2))
    ('time',) [1.   1.   1.   0.96 0.86]
    """

    variables: dict[str, Any]
    coordinates: dict[str, Any]
    rows: tuple[str, ...]

    def in_rows(self) -> Iterator[tuple[str, tuple[str, ...], Array]]:
        """Yield (name, dimensions, values) of each variable in the table: str, tuple of names, ndarray.

        These have at least one dimension of the rows, and no others but such as have texts for coordinates.
        """
        for name, variable in self.variables.items():
            dims, values = _pair(name, variable)
            columns = [dim for dim in dims if dim not in self.rows]
            if len(columns) < len(dims) and all(self._labels(dim) for dim in columns):
                yield name, dims, _computed(values)

    def table(self) -> dict[str, Array]:
        """Return the columns of the table, a dict of arrays (rows,) by name: coordinates, then variables.

        Of a variable with a dimension beside the rows each label has a column, as "overturned_left"; that of an
        "x_interval" is "x_low".
        """
        places = [(name, *_pair(name, values)) for name, values in self.coordinates.items()]
        sizes = [len(self.coordinates[dim]) for dim in self.rows]
        columns = {}
        for name, dims, values in [*(entry for entry in places if set(entry[1]) <= set(self.rows)), *self.in_rows()]:
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

    def _labels(self, dim):
        """Return a list of the coordinates of a dimension `dim`, its name, if these are texts; else an empty list."""
        labels = list(self.coordinates.get(dim, ()))
        return labels if all(isinstance(label, str) for label in labels) else []


class Result:
    """A result: its subclass says what it holds, and all that a user does with a result derives from that.

    A subclass is a frozen dataclass with a `title`, a `dataset` and a `plot`. Its numbers and texts are its `metadata`;
    those of a name in `fpk_rocking.results.trust.DIAGNOSTICS` are judged. With `Saved` it can also be saved.

    Examples
    --------
    A result of one's own, for a rate that was measured several times:

    >>> import dataclasses
    >>> from typing import Annotated, ClassVar
    >>> import numpy as np
    >>> from fpk_rocking import Scene, load_scene
    >>> from fpk_rocking.base.checks import Array
    >>> from fpk_rocking.results.pictures import figure_of
    >>> from fpk_rocking.results.result import Dataset, Result
    >>> from fpk_rocking.results.storage import Saved
    >>> @dataclasses.dataclass(frozen=True, eq=False, repr=False)
    ... class Rates(Saved, Result):
    ...     kind: ClassVar = "rates"  # in its file
    ...     scene: Scene
    ...     method: str  # metadata
    ...     tol: float
    ...     error_estimate: float  # metadata, and judged against tol
    ...     rate: Annotated[Array, "f8 n 2"]  # an array; its form in a file
    ...     @property
    ...     def title(self):
    ...         return f"{len(self.rate)} rates by {self.method}"
    ...     def dataset(self):
    ...         places = {"day": np.arange(len(self.rate)), "side": ["left", "right"]}
    ...         return Dataset({"rate": (("day", "side"), self.rate)}, places, rows=("day",))
    ...     def plot(self):
    ...         return figure_of(lambda _, axes: axes.plot(self.rate))
    >>> rates = Rates(load_scene("second").white_equivalent(), "hand", 0.01, 0.002, np.array([[0.1, 0.2], [0.3, 0.4]]))
    >>> rates
    <Rates: 2 rates by hand; trust: ok. The estimated error of the probabilities is 0.002, within 0.01.>
    >>> print(list(rates.dataset().table()), rates.summary()["rate"])
    ['day', 'rate_left', 'rate_right'] [[0.1, 0.2], [0.3, 0.4]]
    """

    if TYPE_CHECKING:  # a property of the base would be the default value of a field of its name
        scene: Any

        @property
        def title(self) -> str:
            """What this is a result of, as a line of text."""

        def dataset(self) -> Dataset:
            """Return the `Dataset`, a named tuple of the arrays with their dimensions."""

        def plot(self) -> Any:
            """Draw the result; returns a matplotlib figure."""

    @property
    def diagnostics(self) -> list[Diagnostic]:
        """All observations by which this result is judged: on the model, then error figures with their limits."""
        tolerances = {name: getattr(self, name) for name in ("tol", "bins_tol") if hasattr(self, name)}
        return [*self.model_diagnostics(), *assess(self.error_figures, **tolerances)]

    def model_diagnostics(self) -> list[Diagnostic]:
        """Return a list of `Diagnostic`: known errors of the model for this scene, whatever those of the method."""
        return scene_diagnostics(self.scene, getattr(self, "noise_replacement", ""))

    @property
    def error_figures(self) -> dict[str, Any]:
        """Error figures, numbers or arrays by name: the attributes named in `DIAGNOSTICS` that are not None."""
        values = {name: getattr(self, name, None) for name in DIAGNOSTICS}
        return {name: value for name, value in values.items() if value is not None}

    @property
    def reason_if_ok(self) -> str:
        """Reason of the verdict "ok", a sentence, if no error figure has a limit; empty where there has to be one."""
        return ""

    @functools.cached_property
    def trust(self) -> Trust:
        """The named tuple `Trust`: `verdict`, "ok", "caution" or "do not use", and `reasons`, sentences."""
        return verdict(self.diagnostics, self.reason_if_ok)

    @property
    def metadata(self) -> dict[str, Any]:
        """Settings, sizes and error figures: plain values by name."""
        fields: Any = dataclasses.fields(self) if dataclasses.is_dataclass(self) else ()
        values = {field.name: getattr(self, field.name) for field in fields}
        plain_fields = {name: value for name, value in values.items() if isinstance(value, str | int | float)}
        return plain_fields | {figure.name: figure.value for figure in self.diagnostics if figure.value is not None}

    @property
    def remarks(self) -> tuple[str, ...]:
        """Sentences beside this result: about the scene, its noise, and diagnostics of the model."""
        observations = (diagnostic.message for diagnostic in self.diagnostics if diagnostic.value is None)
        return tuple(dict.fromkeys((*scene_remarks(self), *observations)))

    def summary(self) -> dict[str, Any]:
        """Return a dict for JSON: metadata and arrays of the table by name, "trust" (verdict, reasons), "remarks"."""
        arrays = {name: values for name, _, values in self.dataset().in_rows()}
        return plain(self.metadata | arrays | {"trust": self.trust.plain, "remarks": self.remarks})

    def __repr__(self) -> str:
        reason = textwrap.shorten(self.trust.reasons[0], 100, placeholder=" ...")
        return f"<{self.heading}; trust: {self.trust.verdict}. {reason}>"

    @property
    def heading(self) -> str:
        """Name of the class and `title`, as a line of text."""
        return f"{type(self).__name__}: {self.title}"

    def _repr_html_(self) -> str:
        """Return the result as HTML (str) for a notebook: title, figures, verdict and picture."""
        from fpk_rocking.results.pictures import picture_html

        rows = "".join(
            f"<tr><th style='text-align:left'>{html.escape(name.replace('_', ' '))}</th>"
            f"<td>{html.escape(f'{value:.4g}' if isinstance(value, float) else str(value))}</td></tr>"
            for name, value in self._figures().items()
        )
        return (
            f"<div><p><strong>{html.escape(self.heading)}</strong></p>"
            f"{self.trust.html}{picture_html(self.plot(), self.title, dots=72)}"
            f"<details><summary>Figures</summary><table>{rows}</table></details></div>"
        )

    def table(self) -> dict[str, Array]:
        """Columns of the table of `dataset` by name, each of shape (rows,)."""
        return self.dataset().table()

    def to_csv(self, path: File) -> None:
        """Write the `table` as a CSV file.

        Parameters
        ----------
        path : str or pathlib.Path
            File to write.
        """
        columns = self.table()
        write_csv(path, columns, zip(*(column.tolist() for column in columns.values()), strict=True))

    def to_dataframe(self) -> Any:
        """Return the `table` as a `pandas.DataFrame`; needs ``pip install 'fpk-rocking[frames]'``."""
        return _optional("pandas").DataFrame({name: np.array(values) for name, values in self.table().items()})

    def to_xarray(self) -> Any:
        """Return the arrays of `dataset` as an `xarray.Dataset`; needs ``pip install 'fpk-rocking[frames]'``.

        Single numbers and texts of `metadata`, the verdict "trust" and its "reasons" are attributes of the dataset.
        """
        about = self._figures() | {"trust": self.trust.verdict, "reasons": " ".join(self.trust.reasons)}
        groups = [{name: _pair(name, values) for name, values in group.items()} for group in self.dataset()[:2]]
        copies = [
            {name: (dims, np.array(_computed(values))) for name, (dims, values) in group.items()} for group in groups
        ]
        return _optional("xarray").Dataset(*copies, about)

    def _figures(self):
        """Return a dict of the single numbers and texts among the metadata, by name."""
        return {name: value for name, value in self.metadata.items() if isinstance(value, str | int | float)}


def _optional(name):
    """Import pandas or xarray, by `name`, and return the module; ModuleNotFoundError says how to install it."""
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError as error:
        if error.name != name:
            raise
        needed = f"{name} is not installed: pip install 'fpk-rocking[frames]' installs it"
        raise ModuleNotFoundError(needed, name=name) from None


def _pair(name, variable):
    """Return (dimensions, values) of an entry `variable` of a `Dataset`: a tuple of names, and an array or a function.

    `variable` is such a pair, dimensions being a name or a tuple of names, or the values of a coordinate, which has
    one dimension, of its own name `name`.
    """
    dims, values = variable if isinstance(variable, tuple) else (name, variable)
    return ((dims,) if isinstance(dims, str) else dims), values


def _computed(values):
    """Return the array of `values`, which are an array or a function without arguments that computes it."""
    return values() if callable(values) else values
