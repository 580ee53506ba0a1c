"""What every result has, of whichever engine or study: arrays, numbers, verdict, files, tables, frames."""

import dataclasses
import functools
import html
import importlib
import itertools
import textwrap
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np

from fpk_rocking.base.checks import Array, File
from fpk_rocking.results import storage
from fpk_rocking.results.remarks import scene_diagnostics, scene_remarks
from fpk_rocking.results.trust import DIAGNOSTICS, Diagnostic, Trust, assess, verdict


class Result:
    """Named arrays with their dimensions, numbers and texts: the one value that every engine and study returns.

    A subclass is a frozen dataclass; its fields are saved and tabulated. It has a `title`, a `plot`, and `row_dims`,
    the dimensions that the rows of its table stand for. A field is one of these:

    * ``Annotated[Array, "f8 time side"]``, an array with its dtype and dimensions. A word is a dimension, of one length
      in all arrays; these arrays are the `variables`. An array named like its dimension, or in the plural, holds the
      places along it. An array with a letter or a number for a length, as in "f8 n 20k+1", is only saved. After
      construction nobody can write to an array.
    * float, int, bool, str, dict or list, of what JSON holds. Plain ones are the `metadata`; those of a name in
      `fpk_rocking.results.trust.DIAGNOSTICS` are judged.
    * `Scene`, or ``tuple[Scene, ...]``.
    * a NamedTuple or dataclass with such fields, or ``... | None``.

    The fields check each other in ``__post_init__``, where that raises ValueError.

    Examples
    --------
    A result of one's own, for a rate that was measured several times:

    >>> import dataclasses
    >>> from typing import Annotated, ClassVar
    >>> import numpy as np
    >>> from fpk_rocking import Scene, load_scene
    >>> from fpk_rocking.base.checks import Array
    >>> from fpk_rocking.results.pictures import figure_of
    >>> from fpk_rocking.results.result import Result
    >>> @dataclasses.dataclass(frozen=True, eq=False, repr=False)
    ... class Rates(Result):
    ...     kind: ClassVar = "rates"  # in its file
    ...     row_dims = ("day",)
    ...     scene: Scene
    ...     method: str  # metadata
    ...     tol: float
    ...     error_estimate: float  # metadata, and judged against tol
    ...     rate: Annotated[Array, "f8 day side"]
    ...     @property
    ...     def title(self):
    ...         return f"{len(self.rate)} rates by {self.method}"
    ...     def plot(self):
    ...         return figure_of(lambda _, axes: axes.plot(self.rate))
    >>> rates = Rates(load_scene("second").white_equivalent(), "hand", 0.01, 0.002, np.array([[0.1, 0.2], [0.3, 0.4]]))
    >>> rates
    <Rates: 2 rates by hand; trust: ok. The estimated error of the probabilities is 0.002, within 0.01.>
    >>> print(list(rates.table()), rates.summary()["rate"])
    ['day', 'rate_left', 'rate_right'] [[0.1, 0.2], [0.3, 0.4]]
    """

    kind: ClassVar[str] = ""
    """Name of the kind of result in its file; empty for a class without files."""

    more_metadata: ClassVar[tuple[str, ...]] = ()
    """Names of attributes that are metadata besides the fields."""

    if TYPE_CHECKING:  # a property of the base would be the default value of a field of its name
        scene: Any

        @property
        def title(self) -> str:
            """What this is a result of, as a line of text."""

        @property
        def row_dims(self) -> tuple[str, ...]:
            """Dimensions that the rows of the table stand for, the last one running fastest."""

        def plot(self) -> Any:
            """Draw the result; returns a matplotlib figure."""

    def __post_init__(self) -> None:
        for name, annotation in storage.fields_of(type(self)):
            if storage.form_of(annotation):
                getattr(self, name).flags.writeable = False

    def save(self, path: File) -> None:
        """Save the result to a file; TypeError where the class has no files or an attribute is not JSON.

        Parameters
        ----------
        path : str or pathlib.Path
            By custom with the suffix .npz; a missing folder is created. An interruption leaves no partial file.
        """
        storage.save(self, path)

    @classmethod
    def load(cls, path: File) -> Self:
        """Load a saved result of this class, whose checksum is verified.

        Parameters
        ----------
        path : str or pathlib.Path

        Raises
        ------
        FileNotFoundError, ValueError
            There is no such file; it is no result, is damaged, or holds another kind or format.
        """
        return storage.load(cls, path)

    def derived(self) -> dict[str, tuple[str | tuple[str, ...], Any]]:
        """Arrays besides the fields: (dimensions, values) by name, as in ``{"speed": ("time side", speeds)}``.

        The values may be a function that computes them, for an array that takes long. A field that is also named here
        stands at this place in the table.
        """
        return {}

    def places(self) -> dict[str, Any]:
        """Places along the dimensions by name, or (dimensions, places) by another name.

        By default a dimension of the rows has the field of its name, else numbers from 0.
        """
        own = {dims[0]: getattr(self, name) for name, dims, along in _array_fields(type(self)) if along}
        return {dim: own[dim] if dim in own else np.arange(self._size(dim)) for dim in self.row_dims}

    def _size(self, dim):
        """Length of a dimension, by the arrays that have it."""
        arrays = ((dims, values) for dims, values in self.variables.values() if dim in dims and not callable(values))
        return next(np.shape(values)[dims.index(dim)] for dims, values in arrays)

    @functools.cached_property
    def variables(self) -> dict[str, tuple[tuple[str, ...], Any]]:
        """All arrays: (dimensions, values) by name, those of the fields and then those of `derived`."""
        derived = {name: (_dims(dims), values) for name, (dims, values) in self.derived().items()}
        fields = [(name, dims) for name, dims, along in _array_fields(type(self)) if not (along or name in derived)]
        return {name: (dims, getattr(self, name)) for name, dims in fields} | derived

    @property
    def coordinates(self) -> dict[str, tuple[tuple[str, ...], Any]]:
        """(dimensions, places) by name: those of `places`, and "left" and "right" or the like where these occur."""
        occurring = {dim for dims, _ in self.variables.values() for dim in dims}
        labels = {dim: list(names) for dim, names in storage.LABELS.items() if dim in occurring}
        entries = (self.places() | labels).items()
        pairs = {name: entry if isinstance(entry, tuple) else (name, entry) for name, entry in entries}
        return {name: (_dims(dims), values) for name, (dims, values) in pairs.items()}

    @property
    def diagnostics(self) -> list[Diagnostic]:
        """Observations by which this result is judged: on the model, then error figures with their limits."""
        tolerances = {name: getattr(self, name) for name in ("tol", "bins_tol") if hasattr(self, name)}
        return [*self.model_diagnostics(), *assess(self.error_figures, **tolerances)]

    def model_diagnostics(self) -> list[Diagnostic]:
        """Return known errors of the model for this scene, whatever those of the method."""
        return scene_diagnostics(self.scene, getattr(self, "noise_replacement", ""))

    @property
    def error_figures(self) -> dict[str, Any]:
        """Error figures by name: the attributes named in `DIAGNOSTICS` that are not None."""
        values = {name: getattr(self, name, None) for name in DIAGNOSTICS}
        return {name: value for name, value in values.items() if value is not None}

    @property
    def reason_if_ok(self) -> str:
        """Reason of the verdict "ok" if no error figure has a limit; empty where one must have."""
        return ""

    @functools.cached_property
    def trust(self) -> Trust:
        """The verdict, "ok", "caution" or "do not use", with its reasons."""
        return verdict(self.diagnostics, self.reason_if_ok)

    @property
    def metadata(self) -> dict[str, Any]:
        """Settings, sizes and error figures: plain values by name."""
        fields: Any = dataclasses.fields(self) if dataclasses.is_dataclass(self) else ()
        values = {field.name: getattr(self, field.name) for field in fields}
        plain_fields = {name: value for name, value in values.items() if isinstance(value, str | int | float)}
        figures = {figure.name: figure.value for figure in self.diagnostics if figure.value is not None}
        return plain_fields | figures | {name: getattr(self, name) for name in self.more_metadata}

    @property
    def remarks(self) -> tuple[str, ...]:
        """Sentences beside this result: about the scene, its noise, and diagnostics of the model."""
        observations = (diagnostic.message for diagnostic in self.diagnostics if diagnostic.value is None)
        return tuple(dict.fromkeys((*scene_remarks(self), *observations)))

    def summary(self) -> dict[str, Any]:
        """Return a dict for JSON: metadata and arrays of the table by name, "trust" (verdict, reasons), "remarks"."""
        arrays = {name: values for name, (_, values) in self._in_rows().items()}
        return storage.plain(self.metadata | arrays | {"trust": self.trust.plain, "remarks": self.remarks})

    def __repr__(self) -> str:
        reason = textwrap.shorten(self.trust.reasons[0], 100, placeholder=" ...")
        return f"<{self.heading}; trust: {self.trust.verdict}. {reason}>"

    @property
    def heading(self) -> str:
        """Name of the class and `title`, as a line of text."""
        return f"{type(self).__name__}: {self.title}"

    def _repr_html_(self) -> str:
        """HTML for a notebook: title, verdict, picture and figures."""
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

    def _in_rows(self):
        """Variables of the table: those with a dimension of its rows, and no other but such as have texts as places."""
        named = {name for name, (_, places) in self.coordinates.items() if _are_texts(places)}
        return {
            name: (dims, values() if callable(values) else values)
            for name, (dims, values) in self.variables.items()
            if set(dims) & set(self.row_dims) and set(dims) <= {*self.row_dims, *named}
        }

    def table(self) -> dict[str, Array]:
        """Columns by name, each of shape (rows,): places of the rows, then variables.

        A variable with a dimension beside the rows has a column for each label, such as "overturned_left"; those of an
        "x_interval" are "x_low" and "x_high".
        """
        places, row_dims = self.coordinates, self.row_dims
        sizes = [len(places[dim][1]) for dim in row_dims]
        of_rows = {name: pair for name, pair in places.items() if set(pair[0]) <= set(row_dims)}
        columns = {}
        for name, (dims, values) in (of_rows | self._in_rows()).items():
            ordered = [*(dim for dim in row_dims if dim in dims), *(dim for dim in dims if dim not in row_dims)]
            array = np.transpose(np.asarray(values), [dims.index(dim) for dim in ordered])
            lengths = [size if dim in dims else 1 for dim, size in zip(row_dims, sizes, strict=True)]
            array = array.reshape([*lengths, -1])
            array = np.broadcast_to(array, [*sizes, array.shape[-1]])
            labels = [places[dim][1] for dim in ordered if dim not in row_dims]
            for place, texts in enumerate(itertools.product(*labels)):
                columns["_".join([name.removesuffix("_interval"), *texts])] = array[..., place].ravel()
        return columns

    def to_csv(self, path: File) -> None:
        """Write the `table` as a CSV file; arrays of more dimensions are in the files of `save` and in `to_xarray`.

        Parameters
        ----------
        path : str or pathlib.Path
        """
        storage.write_csv(path, self.table())

    def to_dataframe(self) -> Any:
        """Return the `table` as a `pandas.DataFrame`; needs ``pip install 'fpk-rocking[frames]'``."""
        return _optional("pandas").DataFrame({name: np.array(values) for name, values in self.table().items()})

    def to_xarray(self) -> Any:
        """Return `variables` and `coordinates` as an `xarray.Dataset`; needs ``pip install 'fpk-rocking[frames]'``.

        Single numbers and texts of `metadata`, the verdict "trust" and its "reasons" are attributes of the dataset.
        """
        about = self._figures() | {"trust": self.trust.verdict, "reasons": " ".join(self.trust.reasons)}
        arrays, places = (
            {name: (dims, np.array(values() if callable(values) else values)) for name, (dims, values) in group.items()}
            for group in (self.variables, self.coordinates)
        )
        return _optional("xarray").Dataset(arrays, places, about)

    def _figures(self):
        """Single numbers and texts among the metadata."""
        return {name: value for name, value in self.metadata.items() if isinstance(value, str | int | float)}


def _optional(name):
    """Import pandas or xarray; where it lacks, say how to install it."""
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError as error:
        if error.name != name:
            raise
        needed = f"{name} is not installed: pip install 'fpk-rocking[frames]' installs it"
        raise ModuleNotFoundError(needed, name=name) from None


def _array_fields(cls):
    """(name, dimensions, whether it holds the places along one) of each array field whose dimensions are words."""
    forms = ((name, storage.form_of(annotation)) for name, annotation in storage.fields_of(cls))
    words = ((name, tuple(form.split()[1:])) for name, form in forms if form)
    return [
        (name, dims, len(dims) == 1 and name in (dims[0], f"{dims[0]}s"))
        for name, dims in words
        if all(dim.isidentifier() and len(dim) > 1 for dim in dims)
    ]


def _dims(dims):
    """Tuple of dimensions that stand in a text, as in "time side"."""
    return tuple(dims.split()) if isinstance(dims, str) else dims


def _are_texts(values):
    """Whether all of some places are texts, so that each may name a column."""
    return len(values) > 0 and all(isinstance(value, str) for value in values)
