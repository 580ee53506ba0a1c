"""The problems that the peers are compared on, and what is read off their solutions; needs none of the peers."""

import dataclasses
import math

import numpy as np
from report import ROOT
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq

from fpk_rocking import load_scene
from fpk_rocking.scene import Block, Harmonic, Overturning, Scene, Start, WhiteNoise

BAND = load_scene(ROOT / "cases" / "scenes" / "main.toml")
MAIN = BAND.white_equivalent()
EDGES = np.linspace(-1.6, 1.6, 33), np.linspace(-3.2, 3.2, 65)

KRAMERS = Scene(
    Block(1.0),
    Harmonic(1.0, 2.7, 0.0),
    WhiteNoise(0.05),
    Start(0.2, 0.0, ((0.04, 0.0), (0.0, 0.09))),
    Overturning(),
)
"""An oscillator without impact: at a restitution of 1 the block passes x = 0 with its velocity unchanged."""

CALMER = dataclasses.replace(KRAMERS, noise=MAIN.noise)
"""The same with the noise of the main scene."""

KRAMERS_CYCLES = 4


def cell_bins(masses, lines, edges):
    """Return probabilities of bins from those of the cells of a uniform grid, by splines through cumulated sums.

    Parameters
    ----------
    masses : numpy.ndarray, (n_angle, n_velocity)
        Probability of each cell.
    lines, edges : (numpy.ndarray, numpy.ndarray)
        Grid lines and edges of bins, of the angle and of the velocity; a bin beyond the grid holds nothing.

    Returns
    -------
    numpy.ndarray
        (len(edges[0]) - 1, len(edges[1]) - 1); its error is of fourth order in the cells.
    """
    for axis in (0, 1):
        line, edge = lines[axis], np.clip(edges[axis], lines[axis][0], lines[axis][-1])
        below = np.concatenate([np.zeros_like(masses.take([0], axis)), masses.cumsum(axis)], axis)
        masses = np.diff(CubicSpline(line, below, axis=axis)(edge), axis=axis)
    return masses


def persistence_exponent(restitution):
    """Return λ, where impact speeds w have a rate density w^(λ-1) as w falls, with white noise.

    The root of e^(-λ) = 2 sin(π (2.5 - λ)/3) that is not trivial, positive above `CRITICAL_RESTITUTION`; Cornell,
    Swift and Bray 1998 (cond-mat/9804229).
    """
    return brentq(lambda x: restitution**-x - 2.0 * math.sin(math.pi * (2.5 - x) / 3.0), 1e-4, 2.4)


def fitted_exponent(speeds, low, high):
    """Return the likeliest λ of a density w^(λ-1) on [low, high), from speeds there."""
    logs, length = np.log(speeds[(speeds >= low) & (speeds < high)] / low), math.log(high / low)
    return brentq(lambda x: length / -math.expm1(-x * length) - 1.0 / x - logs.mean(), 1e-3, 20.0)
