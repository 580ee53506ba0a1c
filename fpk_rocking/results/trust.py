"""Whether the numbers of a result may be used: its diagnostics, and the one verdict that follows from them.

`assess` holds error figures against their limits, and `verdict` takes the largest severity. A result joins what is
judged in `Result.diagnostics`: these figures, remarks on the model of its scene (`remarks.scene_diagnostics`), and what
its kind adds (`model_diagnostics`).
"""

import html
import math
from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np

CAUTION, UNUSABLE = 1, 2
"""Severity of a diagnostic that speaks against a result."""

VERDICTS = "ok", "caution", "do not use"
"""Verdict by the largest severity."""

USELESS = 0.1
"""Possible error of a probability above which it is not to be used."""

UNASKED = 0.05
"""Possible error of a probability above which there is caution where no tolerance was asked for, as of a sample."""

SMALL = 0.4
"""Relative error of a probability of overturning above which there is caution."""

NEGLIGIBLE = 1e-3
"""Error of a density, in parts of the wanted one and of `REPLACED`, that needs no caution however small P is."""

NEGATIVE = 0.01
"""Negative mass of a density above which there is caution."""

REPLACED = 0.01
"""Total error of a density's probabilities, the measured replacement of its noise included, that needs no caution; the
tolerance that was asked for, where that is larger."""


class Diagnostic(NamedTuple):
    """An observation by which a result is judged: an error figure with its limit, or what is known about the model.

    Parameters
    ----------
    severity : int
        0 where it does not speak against the result, else `CAUTION` or `UNUSABLE`.
    message : str
        A sentence with the figure and the limit; empty for a figure that has no limit.
    name : str
        Name of the figure (one of `DIAGNOSTICS`), or of the kind of observation: where many results are shown together,
        one of each kind is shown. Observations without a name are shown if their messages differ.
    value : float, optional
        The error figure; None for an observation about the model.

    Examples
    --------
    >>> from fpk_rocking import Scene
    >>> from montecarlo import simulate
    >>> rack = Scene.from_block(0.5, 1.8, "0.4 g", "1.5 Hz", slender=True)
    >>> print([(one.severity, one.name) for one in simulate(rack, cycles=2).diagnostics])
    [(1, 'slender')]
    """

    severity: int
    message: str
    name: str = ""
    value: float | None = None

    @property
    def kind(self) -> str:
        """What diagnostics of one kind share: the name, or the message where there is none."""
        return self.name or self.message


class Trust(NamedTuple):
    """The verdict on a result, with its reasons.

    Parameters
    ----------
    verdict : {"ok", "caution", "do not use"}
        "caution": a figure misses its limit, or the model has a known error here. "do not use": an error may be as
        large as the numbers, or the model was found wrong for scenes like this one.
    reasons : tuple of str
        Sentences, the weightiest first.

    Examples
    --------
    >>> from fpk_rocking import Scene
    >>> from montecarlo import simulate
    >>> trust = simulate(Scene.from_block(0.5, 1.8, "0.4 g", "1.5 Hz", slender=True), cycles=2).trust
    >>> print(trust.verdict, [reason.split(":")[0] for reason in trust.reasons])
    caution ['Slender block']
    """

    verdict: str
    reasons: tuple[str, ...]

    def __str__(self):
        return f"trust: {self.verdict}. {' '.join(self.reasons)}"

    @property
    def plain(self) -> dict[str, Any]:
        """For JSON: "verdict", a text, and "reasons", a list of texts."""
        return {"verdict": self.verdict, "reasons": list(self.reasons)}

    @property
    def html(self) -> str:
        """Verdict and reasons as a paragraph of HTML."""
        colour = {"ok": "#00704a", "caution": "#9a5b00"}.get(self.verdict, "#b00020")
        reasons = html.escape(" ".join(self.reasons))
        return f"<p><strong style='color:{colour}'>trust: {html.escape(self.verdict)}</strong>. {reasons}</p>"


def verdict(diagnostics: Iterable[Diagnostic], reason: str = "") -> Trust:
    """Return the verdict that follows from diagnostics: the largest severity, with the messages that speak against.

    `reason` is that of the verdict "ok" where no figure has a limit. Without one, a result that has no such figure gets
    "caution": nothing says how large its error is.
    """
    diagnostics = list(dict.fromkeys(diagnostics))
    judged = [diagnostic for diagnostic in diagnostics if diagnostic.value is not None and diagnostic.message]
    if not (judged or reason):
        diagnostics.append(Diagnostic(CAUTION, "No error is estimated.", "unjudged"))
    against = sorted(filter(lambda d: d.severity, diagnostics), key=lambda d: -d.severity)
    if against:
        return Trust(VERDICTS[against[0].severity], tuple(diagnostic.message for diagnostic in against))
    return Trust(VERDICTS[0], (judged[0].message if judged else reason,))


def assess(values: Mapping[str, Any], tol: float = UNASKED, bins_tol: float = math.inf) -> list[Diagnostic]:
    """Hold error figures against their limits.

    `values` has numbers, or arrays with an entry for each time, by the names of `DIAGNOSTICS`; other names are passed
    over. Of an array the largest counts; where its last entry alone could be used there is caution at most. `tol` and
    `bins_tol` are the errors of survival and of the binned density that were asked for.
    """
    diagnostics = []
    for name, (figure, caution, unusable) in _limits(tol, bins_tol, values).items():
        if np.size(values.get(name, ())) == 0:
            continue
        value = float(np.max(values[name]))
        if math.isinf(caution):
            diagnostics.append(Diagnostic(0, "", name, value))
        elif value <= caution:  # written so that nan is not within a limit
            text = f"The {figure} is {_beside(value, caution)}, within {caution:.2g}."
            diagnostics.append(Diagnostic(0, text, name, value))
        else:
            last = float(np.max(values[name][-1])) if np.ndim(values[name]) else value
            limit = caution if value <= unusable else unusable
            severity = CAUTION if value <= unusable or last <= unusable else UNUSABLE
            text = f"The {figure} is {_beside(value, limit)}, above {limit:.2g}."
            text += f" At the last time it is {last:.2g}." * (last <= limit)
            diagnostics.append(Diagnostic(severity, text, name, value))
    return diagnostics


def _beside(value, limit):
    """A value as a text, with the two to six digits that distinguish it from a limit."""
    texts = (f"{value:.{digits}g}" for digits in range(2, 7))
    return next((text for text in texts if float(text) != limit), f"{value:.2g}")


def _limits(tol, bins_tol, values=()):
    """(description, limit of "ok", limit of "caution") of each error figure by its name; inf for no limit."""
    useless, never = max(USELESS, tol), (math.inf, math.inf)
    below = "integral of the density where it is below 0"
    values = dict(values)
    errors = [np.max(values[name]) for name in ("total_error", "error_estimate") if np.size(values.get(name, ()))]
    overturning = never if errors and errors[0] <= NEGLIGIBLE * min(tol, REPLACED) else (SMALL, math.inf)
    # Mass at rest rattles below the mesh and may be negative there; a solver that knows the rest is judged by that.
    negative = never if "moving_negative_mass" in values else (NEGATIVE, useless)
    return {
        "total_error": (
            "largest total error of all times, with the replacement of the noise,",
            max(REPLACED, tol),
            useless,
        ),
        "error_estimate": ("estimated error of the probabilities", tol, useless),
        "half_width": ("half width of the 95 % interval of the probabilities", tol, useless),
        # .006 ± .003 says no more than that the probability is small.
        "overturning_error": ("relative error of the last probability of overturning", *overturning),
        # In survival a relative error of the rate counts exp(-1) times at most, after whatever number of cycles.
        "escape_error": ("estimated relative error of the escape rate", math.e * tol, math.e * useless),
        "relative_error": ("relative standard error of the probability", 0.2, 0.5),
        "rate_error": ("width of the 95 % limits of ln(rate) over 3.92 (more motions make it smaller)", 0.2, 0.5),
        "bins_error_estimate": ("estimated error of the binned density (L1)", bins_tol, math.inf),
        "rest_error_estimate": ("estimated error of the probability of being at rest", *never),
        "truncated": ("probability truncated beyond the largest velocity of the mesh", tol, useless),
        "mass_defect": ("mass defect (probability that the solver created or lost)", 1e-9, tol),
        "negative_mass": (f"negative mass ({below})", *negative),
        "moving_negative_mass": (f"negative mass ({below}, blocks at rest left out)", NEGATIVE, useless),
        "residual": ("residual of the modes", 1e-6, tol),
    }


DIAGNOSTICS = tuple(_limits(UNASKED, math.inf))
"""Names of all error figures. A result has those of which it has an attribute."""
