"""Implicit steps of the Eulerian baseline: Crank-Nicolson, or Gauss's method of two stages in one complex solve.

With the force held at its mean over a step, both advance d/dt M p = A p by a diagonal Padé approximation of the
exponential,

    (h A - z M) y = M p,    q = Re(c y),    M p' = M p + h A q,

with q the mean of the density over the step. The last equation makes the balance of mass independent of how well the
first one is solved.
"""

import math
import time
from typing import NamedTuple

import numpy as np
from scipy.sparse.linalg import LinearOperator, gmres

TOLERANCE = 1e-5
"""Residual of the linear equations, relative to their right-hand side: 3e-5 in L1 and 2e-6 in S after four cycles."""

RESTART, MOST = 60, 10

RENEWAL = 0.5
"""Change of the force at which the preconditioner is made anew."""


class Scheme(NamedTuple):
    """A Padé approximation: its name, the pole z in the upper half plane or on the real line, and the factor c."""

    name: str
    pole: complex
    factor: complex


CRANK_NICOLSON = Scheme("Crank-Nicolson", 2.0, -2.0)
"""Order 2."""

GAUSS = Scheme("Gauss, 2 stages", 3.0 + 1j * math.sqrt(3.0), -4j * math.sqrt(3.0))
"""Order 4, but 2 in the change of the force within a step, which is far smaller."""


class March:
    """Steps of equal duration over whole forcing cycles.

    Parameters
    ----------
    operator : Operator
    steps : int
        Steps a cycle.
    scheme : Scheme
    tolerance : float
        Relative, of the linear solver.

    Attributes
    ----------
    iterations : int
        Of the linear solver, so far.
    seconds : float
        Time spent on its preconditioner, so far.
    """

    def __init__(self, operator, steps, scheme=GAUSS, tolerance=TOLERANCE):
        self.operator, self.steps, self.scheme, self.tolerance = operator, steps, scheme, tolerance
        self.duration = operator.scene.period / steps
        self.iterations, self.seconds = 0, 0.0
        self._force, self._inverses = math.inf, None

    def cycle(self, density):
        """Advance a density (unknowns,) by a cycle from its begin; return it and what left (3,)."""
        outflow = np.zeros(3)
        for k in range(self.steps):
            force = mean_force(self.operator.scene.forcing, k * self.duration, self.duration)
            density, losses = self.step(density, force)
            outflow += losses
        return density, outflow

    def step(self, density, force):
        """Advance a density by a step under a constant force; return it and what left to the left, right, elsewhere.

        Raises
        ------
        RuntimeError
            The linear solver did not converge.
        """
        operator, h = self.operator, self.duration
        matrix, diagonal = operator.at(force)
        if abs(force - self._force) > RENEWAL:
            begin = time.process_time()
            masses = operator.areas.reshape(-1, operator.block, 1) * np.eye(operator.block)
            self._force, self._inverses = force, np.linalg.inv(h * diagonal - self.scheme.pole * masses)
            self.seconds += time.process_time() - begin
        mean = np.real(self.scheme.factor * self._solve(matrix, operator.areas * density))
        return density + h * (matrix @ mean) / operator.areas, h * operator.losses(mean, force)

    def _solve(self, matrix, right):
        """Solution y (unknowns,) of (h A - z M) y = right, A a block matrix and M the masses, by GMRES."""
        operator, h, pole = self.operator, self.duration, self.scheme.pole
        kind = np.result_type(pole)

        def applied(y):
            """Product of h A - z M with y (unknowns,)."""
            # Twice a real product: a complex copy of the matrix would take longer to make and to read.
            parts = np.ascontiguousarray(y, dtype=kind).view(float).reshape(len(y), -1)
            return h * (matrix @ parts).view(kind).ravel() - pole * operator.areas * y

        def preconditioned(y):
            """Product of the inverted blocks of the cells with y (unknowns,)."""
            return np.matmul(self._inverses, y.reshape(-1, operator.block, 1)).ravel()

        def count(_):
            """Count an iteration."""
            self.iterations += 1

        shape = matrix.shape
        solution, code = gmres(
            LinearOperator(shape, applied, dtype=kind), right.astype(kind), rtol=self.tolerance, restart=RESTART,
            maxiter=MOST, M=LinearOperator(shape, preconditioned, dtype=kind), callback=count, callback_type="pr_norm",
        )  # fmt: skip
        if code:
            raise RuntimeError(f"{self.steps} steps a cycle: no convergence within {RESTART * MOST} iterations")
        return solution


def mean_force(forcing, start, duration):
    """Mean of f = -A cos(Omega t + Psi) over a step."""
    first, last = (forcing.frequency * t + forcing.phase for t in (start, start + duration))
    return -forcing.amplitude * (math.sin(last) - math.sin(first)) / (last - first)
