"""Whether the numbers of a result may be used: one verdict for all kinds of results, from their error figures."""

import math
from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np

__all__ = ["CAUTION", "UNUSABLE", "Doubt", "Trust", "trust_of", "verdict"]

CAUTION, UNUSABLE = 1, 2
"""How much a doubt weighs."""

VERDICTS = "ok", "caution", "do not use"

USELESS = 0.1
"""Possible error of a probability above which it is not to be used."""

UNASKED = 0.05
"""Possible error of a probability above which there is caution where no tolerance was asked for, as of a sample."""

REPLACED = 0.01
"""Total error of a density's probabilities, the measured replacement of its noise included, that needs no caution; the
tolerance that was asked for, where that is larger."""

_MASS, _NEGATIVE, _RESIDUAL = 1e-9, 1e-2, 1e-6


class Doubt(NamedTuple):
    """What speaks against a result.

    Parameters
    ----------
    weight : int
        `CAUTION` or `UNUSABLE`.
    sentence : str
        What it is, with the figure and the limit.
    code : str
        Name of its kind: where many results are shown together, one of each kind is told. Without a code a doubt is
        told wherever its sentence is another.

    Examples
    --------
    >>> from fpk_rocking import Scene
    >>> from fpk_rocking.studies import fragility
    >>> rack = Scene.from_block(0.5, 1.8, "0.4 g", "1.5 Hz", slender=True)
    >>> print([(doubt.weight, doubt.code) for doubt in fragility(rack, scale=[1.0, 1.5], cycles=2).doubts])
    [(1, 'slender')]
    """

    weight: int
    sentence: str
    code: str = ""

    @property
    def kind(self) -> str:
        """What doubts of one kind share: the code, or the sentence where there is none."""
        return self.code or self.sentence


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
        """Verdict and reasons as a dict, for JSON."""
        return {"verdict": self.verdict, "reasons": list(self.reasons)}


def verdict(doubts: Iterable[Doubt], otherwise: str) -> Trust:
    """Return the verdict of all doubts, and the reason `otherwise` where there is none."""
    doubts = sorted(dict.fromkeys(doubts), key=lambda doubt: -doubt.weight)
    weight = doubts[0].weight if doubts else 0
    return Trust(VERDICTS[weight], tuple(doubt.sentence for doubt in doubts) or (otherwise,))


def trust_of(facts: dict[str, Any], doubts: Iterable[Doubt] = (), otherwise: str = "") -> Trust:
    """Judge a result by its own figures, each against two limits, and by doubts that are known beside them.

    Parameters
    ----------
    facts : dict
        Figures by the names below, numbers or lists of them of which the largest counts; others are passed over.
        "tol" is the error that was asked for.
    doubts : iterable of Doubt
        What else speaks against it, such as `fpk_rocking.results.remarks.doubts`.
    otherwise : str
        Reason where nothing speaks against it and no figure is judged. Without one, a result that has no figure is
        doubted: nothing says how large its error is.

    Returns
    -------
    Trust
    """
    found, within, judged = list(doubts), [], bool(otherwise)
    for name, (what, caution, unusable) in _limits(facts.get("tol", UNASKED), facts).items():
        values = np.asarray(facts.get(name, ()), float)
        if values.size == 0 or math.isinf(caution):
            continue
        value, judged = float(values.max()), True
        # Written so that nan is not within a limit.
        if value <= caution:
            within.append(f"The {what} is {_beside(value, caution)}, within {caution:.2g}.")
        else:
            weight = CAUTION if value <= unusable else UNUSABLE
            limit = caution if weight == CAUTION else unusable
            found.append(Doubt(weight, f"The {what} is {_beside(value, limit)}, above {limit:.2g}.", name))
    if not judged:
        found.append(Doubt(CAUTION, "No error is estimated.", "unjudged"))
    return verdict(found, within[0] if within else otherwise)


def _beside(value, limit):
    """Write a value with as many digits as tell it from a limit, at least two and at most six."""
    texts = (f"{value:.{digits}g}" for digits in range(2, 7))
    return next((text for text in texts if float(text) != limit), f"{value:.2g}")


def _limits(tol, facts):
    """Return by the name of a figure what it is, and above which values there is caution and no use."""
    useless, bins_tol = max(USELESS, tol), facts.get("bins_tol", math.inf)
    # Mass at rest rattles below the mesh and may be negative there; a solver that knows the rest is judged by that.
    negative = "moving_negative_mass" if "moving_negative_mass" in facts else "negative_mass"
    below = "integral of the density where it is below 0" + ", blocks at rest left out" * (negative != "negative_mass")
    return {
        "total_error": (
            "largest total error of all times, with the replacement of the noise,",
            max(REPLACED, tol),
            useless,
        ),
        "error_estimate": ("estimated error of the probabilities", tol, useless),
        "half_width": ("half width of the 95 % interval of the probabilities", tol, useless),
        # In survival a relative error of the rate counts exp(-1) times at most, after whatever number of cycles.
        "escape_error": ("estimated relative error of the escape rate", math.e * tol, math.e * useless),
        "relative_error": ("relative standard error of the probability", 0.2, 0.5),
        "bins_error_estimate": ("estimated error of the binned density (L1)", bins_tol, math.inf),
        "lost": ("probability lost beyond the largest velocity of the mesh", tol, useless),
        "mass_defect": ("mass defect (probability that the solver created or lost)", _MASS, tol),
        negative: (f"negative mass ({below})", _NEGATIVE, useless),
        "residual": ("residual of the modes", _RESIDUAL, tol),
    }
