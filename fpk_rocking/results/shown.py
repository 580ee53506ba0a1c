"""What every result offers to the hand: a line, a card for notebooks, a picture, tables of pandas and xarray."""

import base64
import html
import importlib
import io
import textwrap
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from fpk_rocking.base.types import Array
from fpk_rocking.results.replacement import Replacement
from fpk_rocking.results.trust import Trust

__all__ = ["Shown", "picture_html", "trust_html"]

_COLOURS = {"ok": "#00704a", "caution": "#9a5b00", "do not use": "#b00020"}
_SHORT = 100


class Provided(Protocol):
    """What a subclass of `Shown` provides."""

    @property
    def trust(self) -> Trust:
        """Verdict with its reasons."""

    @property
    def headline(self) -> str:
        """The most important figures as a line of text."""

    @property
    def facts(self) -> dict[str, Any]:
        """Further figures, as plain values by name."""

    def plot(self) -> Any:
        """Draw a picture, a matplotlib figure."""

    def columns(self) -> dict[str, Array]:
        """Return a table: arrays (n,) by column name."""

    def grids(self) -> tuple[dict[str, Any], dict[str, Any]]:
        """Return (dimensions, array) by name, and coordinates, as `xarray.Dataset` takes them."""


# For the type checker alone: in fact inherited, these properties would forbid a field of the same name.
if TYPE_CHECKING:
    _Provided = Provided
else:
    _Provided = object


class Shown(_Provided):
    """How a result is shown; a subclass has all of `Provided`."""

    # What only some results have.
    atom: bool = False
    replacement: Replacement | None = None

    @property
    def check(self) -> str:
        """How the replacement of the noise was measured, as a sentence; empty where it was not."""
        return ""

    @property
    def unresolved(self) -> str:
        """What is not resolved, as a sentence; empty where everything is."""
        return ""

    @property
    def unjudged(self) -> str:
        """At how many times only some of the result is judged, as a sentence; empty where at none."""
        return ""

    def __repr__(self) -> str:
        reason = textwrap.shorten(self.trust.reasons[0], _SHORT, placeholder=" ...")
        return f"<{self.title}; trust: {self.trust.verdict}. {reason}>"

    @property
    def title(self) -> str:
        """Class of the result and its `headline`."""
        return f"{type(self).__name__}: {self.headline}"

    def _repr_html_(self) -> str:
        rows = "".join(
            f"<tr><th style='text-align:left'>{html.escape(name.replace('_', ' '))}</th>"
            f"<td>{html.escape(text)}</td></tr>"
            for name, text in self._said()
        )
        return (
            f"<div><p><strong>{html.escape(self.title)}</strong></p>"
            f"{trust_html(self.trust)}{picture_html(self.plot(), self.headline, dots=72)}"
            f"<details><summary>Figures</summary><table>{rows}</table></details></div>"
        )

    def _said(self):
        """Yield the names and texts of facts that are one number or text."""
        for name, value in self.facts.items():
            if isinstance(value, str | int | np.integer):
                yield name, str(value)
            elif isinstance(value, float):
                yield name, f"{value:.4g}"

    def to_dataframe(self) -> Any:
        """Return the table of `columns` as a `pandas.DataFrame`; needs ``pip install 'fpk-rocking[frames]'``."""
        return _library("pandas").DataFrame({name: np.array(values) for name, values in self.columns().items()})

    def to_xarray(self) -> Any:
        """Return the arrays of this result as an `xarray.Dataset`; needs ``pip install 'fpk-rocking[frames]'``.

        Single numbers and texts of `facts`, the verdict "trust" and its "reasons" are attributes of the dataset.
        """
        variables, coordinates = self.grids()
        copied = {name: (dims, np.array(values)) for name, (dims, values) in variables.items()}
        told = {name: value for name, value in self.facts.items() if isinstance(value, str | int | float)}
        about = told | {"trust": self.trust.verdict, "reasons": " ".join(self.trust.reasons)}
        places = {name: np.array(values) for name, values in coordinates.items()}
        return _library("xarray").Dataset(copied, places, about)


def _library(name):
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError as error:
        if error.name != name:
            raise
        needed = f"{name} is not installed: pip install 'fpk-rocking[frames]' installs it"
        raise ModuleNotFoundError(needed, name=name) from None


def trust_html(trust: Trust) -> str:
    """Return a verdict as a paragraph of HTML."""
    colour, reasons = _COLOURS[trust.verdict], html.escape(" ".join(trust.reasons))
    return f"<p><strong style='color:{colour}'>trust: {html.escape(trust.verdict)}</strong>. {reasons}</p>"


def picture_html(figure: Any, meaning: str, dots: int = 110) -> str:
    """Return a figure as an image of HTML that holds its own data.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
    meaning : str
        Text for those who do not see it.
    dots : int
        An inch.
    """
    picture = io.BytesIO()
    figure.savefig(picture, format="png", dpi=dots)
    data = base64.b64encode(picture.getvalue()).decode("ascii")
    return f"<img alt='{html.escape(meaning)}' src='data:image/png;base64,{data}'>"
