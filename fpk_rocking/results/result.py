"""What every result has, of whichever engine or study: verdict, card, dataset, files, frames, summary."""

import dataclasses
import functools
import html
import textwrap
from typing import TYPE_CHECKING, Any

import numpy as np

from fpk_rocking.base.types import Array, File
from fpk_rocking.results.dataset import Dataset, optional
from fpk_rocking.results.remarks import scene_diagnostics, scene_remarks
from fpk_rocking.results.storage import plain, write_csv
from fpk_rocking.results.trust import DIAGNOSTICS, Diagnostic, Trust, assess, verdict
from fpk_rocking.scene.scene import Scene

__all__ = ["Dataset", "Result"]


class Result:
    """A result: its subclass says what it holds, and all that a user does with a result derives from that.

    A subclass is a frozen dataclass with a `title`, a `dataset` and a `plot`. Its numbers and texts are its `metadata`;
    those of a name in `fpk_rocking.results.trust.DIAGNOSTICS` are judged. With `Saved` it can also be saved.

    Examples
    --------
    A result of one's own, for a rate that was measured several times:

    >>> import dataclasses
    >>> from typing import Annotated, ClassVar
    >>> from fpk_rocking import Scene, load_scene
    >>> from fpk_rocking.base.types import Array
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

    if TYPE_CHECKING:  # here alone, as a property would be the default value of a field of its name

        @property
        def scene(self) -> Scene:
            """The scene that was given; a result of several overrides what reads it."""

        @property
        def title(self) -> str:
            """The most important figures, as a line of text."""

        def dataset(self) -> Dataset:
            """Named arrays, of which tables, files and frames are made."""

        def plot(self) -> Any:
            """Draw the result; returns a matplotlib figure."""

    @property
    def diagnostics(self) -> list[Diagnostic]:
        """All by which this result is judged: what is known about the model, and its error figures with their limits."""
        asked = {name: getattr(self, name) for name in ("tol", "bins_tol") if hasattr(self, name)}
        return [*self.model_diagnostics(), *assess(self.error_figures, **asked)]

    def model_diagnostics(self) -> list[Diagnostic]:
        """What is known about the model that speaks for or against this result, whatever its own errors."""
        return scene_diagnostics(self.scene, getattr(self, "noise_replacement", ""))

    @property
    def error_figures(self) -> dict[str, Any]:
        """Error figures, numbers or arrays: the attributes that have a name in `DIAGNOSTICS` and are not None."""
        values = {name: getattr(self, name, None) for name in DIAGNOSTICS}
        return {name: value for name, value in values.items() if value is not None}

    @property
    def reason_if_ok(self) -> str:
        """Reason of the verdict "ok" where no error figure has a limit; empty where there has to be one."""
        return ""

    @functools.cached_property
    def trust(self) -> Trust:
        """Verdict with its reasons: "ok", "caution" or "do not use"."""
        return verdict(self.diagnostics, self.reason_if_ok)

    @property
    def metadata(self) -> dict[str, Any]:
        """Settings, sizes and error figures: plain values by name."""
        names = [field.name for field in dataclasses.fields(self)] if dataclasses.is_dataclass(self) else []
        own = {name: getattr(self, name) for name in names}
        found = {name: value for name, value in own.items() if isinstance(value, str | int | float)}
        return found | {one.name: one.value for one in self.diagnostics if one.value is not None}

    @property
    def remarks(self) -> tuple[str, ...]:
        """Sentences that a reader of this result needs: about the scene, its noise, and what is not to be trusted."""
        known = (one.message for one in self.diagnostics if one.value is None)
        return tuple(dict.fromkeys((*scene_remarks(self), *known)))

    def summary(self) -> dict[str, Any]:
        """Metadata, arrays of the table by name, verdict and remarks as plain values, for JSON."""
        arrays = {name: values for name, _, values in self.dataset().in_rows()}
        return plain(self.metadata | arrays | {"trust": self.trust.plain, "remarks": self.remarks})

    def __repr__(self) -> str:
        reason = textwrap.shorten(self.trust.reasons[0], 100, placeholder=" ...")
        return f"<{self.heading}; trust: {self.trust.verdict}. {reason}>"

    @property
    def heading(self) -> str:
        """Class and `title`."""
        return f"{type(self).__name__}: {self.title}"

    def _repr_html_(self) -> str:
        from fpk_rocking.results.pictures import picture_html

        shown = {
            name: value for name, value in self.metadata.items() if isinstance(value, str | int | float | np.integer)
        }
        rows = "".join(
            f"<tr><th style='text-align:left'>{html.escape(name.replace('_', ' '))}</th>"
            f"<td>{html.escape(f'{value:.4g}' if isinstance(value, float) else str(value))}</td></tr>"
            for name, value in shown.items()
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
        return optional("pandas").DataFrame({name: np.array(values) for name, values in self.table().items()})

    def to_xarray(self) -> Any:
        """Return the arrays of `dataset` as an `xarray.Dataset`; needs ``pip install 'fpk-rocking[frames]'``.

        Single numbers and texts of `metadata`, the verdict "trust" and its "reasons" are attributes of the dataset.
        """
        told = {name: value for name, value in self.metadata.items() if isinstance(value, str | int | float)}
        about = told | {"trust": self.trust.verdict, "reasons": " ".join(self.trust.reasons)}
        return self.dataset().to_xarray(about)
