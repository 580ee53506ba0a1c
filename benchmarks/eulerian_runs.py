"""Runs of the Eulerian baseline on the main scene, and the orders in mesh and steps that they show."""

import time
from typing import NamedTuple

import numpy as np
from eulerian_operator import Operator
from eulerian_steps import CRANK_NICOLSON, GAUSS, March, Scheme
from report import ROOT

from fpk_rocking import load_scene
from fpk_rocking.density.evolution import Evolution
from fpk_rocking.density.space import Space, graded_lines
from fpk_rocking.density.tuning import TUNING
from fpk_rocking.results import sampling as distances

SCENE = load_scene(ROOT / "cases" / "scenes" / "main.toml").white_equivalent()
REFERENCE = np.load(ROOT / "tests" / "data" / "main_white.npz")
EDGES = REFERENCE["angle_edges"], REFERENCE["velocity_edges"]
FINE = np.linspace(-1.6, 1.6, 129), np.linspace(-3.2, 3.2, 257)


class Row(NamedTuple):
    """A run of the baseline: cells of angle and velocity, degree, steps a cycle, and the method of the steps."""

    angle_cells: int
    velocity_cells: int
    degree: int
    steps: int
    scheme: Scheme = GAUSS

    @property
    def mesh(self):
        """The cells, as text."""
        return f"{self.angle_cells} × {self.velocity_cells}"


REFINED = [Row(16, 28, 3, 192), Row(24, 40, 3, 288), Row(32, 56, 3, 384)]
LONGER = {GAUSS: (96, 128, 192), CRANK_NICOLSON: (384, 512, 768)}
CONVERGED = 512


class Run:
    """The baseline with the mesh and steps of a row.

    Parameters
    ----------
    row : Row
    start : fpk_rocking.density.density.Density
        Where it begins, at the end of a cycle; its mesh has the same extents.
    """

    def __init__(self, row, start):
        angle, velocity = start.mesh_lines
        self.space = Space(
            graded_lines(angle[-1], row.angle_cells, TUNING.angle_grading),
            graded_lines(velocity[-1], row.velocity_cells, TUNING.velocity_grading),
            row.degree,
        )
        begin = time.process_time()
        self.operator = Operator(self.space, SCENE)
        self.assembly = time.process_time() - begin
        self.march = March(self.operator, row.steps, row.scheme)
        self.density = self.space.transfer(start.coefficients, start.space).ravel()

    def cycle(self):
        """Advance by a cycle and return what left (3,)."""
        self.density, outflow = self.march.cycle(self.density)
        return outflow

    @property
    def mass(self):
        """Probability of not having overturned."""
        return self.operator.mass(self.density)

    def bins(self, edges):
        """Probabilities of the bins between edges."""
        return self.space.bin_integrals(self.density.reshape(self.space.shape), *edges)


def finer_meshes(truth):
    """Return lines of errors after one cycle on finer and finer meshes, and the order fitted to those of fine bins."""
    evolution, lines, errors = Evolution.load(truth), [], []
    for row in REFINED:
        run = Run(row, evolution.at(1))
        run.cycle()
        apart = [distances.l1(run.bins(edges), evolution.bin_probabilities(2, *edges)) for edges in (EDGES, FINE)]
        errors.append(apart[1])
        change = run.mass - evolution.survival[2]
        lines.append([row.mesh, row.steps, f"{change:+.0e}", *map("{:.4f}".format, apart)])
    return lines, order([(row.angle_cells * row.velocity_cells) ** -0.5 for row in REFINED], errors)


def shorter_steps(truth):
    """Return lines of each method's errors after one cycle on one mesh, and the order fitted to them."""
    start, lines = Evolution.load(truth).at(1), []

    def stepped(steps, scheme):
        """Probabilities of the fine bins after a cycle in so many steps by a scheme."""
        run = Run(Row(16, 28, 3, steps, scheme), start)
        run.cycle()
        return run.bins(FINE)

    converged = stepped(CONVERGED, GAUSS)
    for scheme, counts in LONGER.items():
        errors = [distances.l1(stepped(steps, scheme), converged) for steps in counts]
        fitted = order([1.0 / steps for steps in counts], errors)
        steps, apart = (", ".join(map(form.format, values)) for form, values in (("{}", counts), ("{:.4f}", errors)))
        lines.append([scheme.name, steps, apart, f"{fitted:.1f}"])
    return lines


def order(sizes, errors):
    """Return the fitted order of errors in sizes."""
    return np.polyfit(np.log(sizes), np.log(errors), 1)[0]
