"""A leg of the forcing cycle as a linear map of densities, and its adjoint: the solver's own steps, one by one.

Where the forcing is its own mirror image half a cycle later, (x, v) -> (-x, -v), the leg is that half: with H the
map over it and R the turn about the origin, a cycle is R H R H = K^2, K = R H. Else it is the whole cycle, K = H.
"""

import numpy as np

from fpk_rocking.density.run.periodic import PeriodicRun
from fpk_rocking.density.space.space import reflected

_NOTHING = np.zeros(3)


class CycleLeg:
    """The map K of densities over a leg of a cycle on one mesh; half a cycle is turned at its end.

    Parameters
    ----------
    white : Scene
        With white noise.
    grid : Grid
        Mesh and steps.

    Attributes
    ----------
    run : PeriodicRun
        Of the scene, every cell active, so that nothing is lost but beyond the velocity bound.
    space : Space
    count : int
        Legs in a cycle, 1 or 2.
    """

    def __init__(self, white, grid):
        self.run = PeriodicRun(white, grid, negligible=0.0)
        self.space, self.count = self.run.space, self.run.legs
        self._root = np.sqrt(self.space.areas)[:, :, None, None]
        everything = np.ones(self.space.shape[:2], dtype=bool)
        for step in self.run.leg:
            step.activate(everything)

    @property
    def one(self):
        """Coefficients of the function 1."""
        coefficients = np.zeros(self.space.shape)
        coefficients[:, :, 0, 0] = 1.0
        return coefficients

    def vector(self, coefficients):
        """Vector (unknowns,) whose Euclidean products are the integrals of products of functions."""
        return (coefficients * self._root).ravel()

    def coefficients(self, vector):
        """Coefficients of the function that a real vector stands for."""
        return vector.reshape(self.space.shape) / self._root

    def turned(self, coefficients):
        """Coefficients of a function at the end of a leg as the next one begins with them."""
        return reflected(coefficients) if self.count == 2 else coefficients

    def forward(self, coefficients):
        """Density after the leg, turned, and the masses (3,) that went left, right and were lost in it."""
        gone = np.zeros(3)
        for step in self.run.leg:
            coefficients, sinks = step.apply(coefficients)
            gone += sinks
        return self.turned(coefficients), gone

    def backward(self, values):
        """Return the mean, before the leg, of a function of the turned state after it."""
        values = self.turned(values)
        for step in reversed(self.run.leg):
            values = step.apply_adjoint(values, _NOTHING)
        return values

    def time_inside(self):
        """Mean time until overturning or the end of the leg, in cycles, from every state.

        Coefficients of a function; by the trapezoidal rule over the steps.
        """
        half_step = 0.5 / self.run.steps * self.one
        spent = np.zeros(self.space.shape)
        for step in reversed(self.run.leg):
            spent = half_step + step.apply_adjoint(half_step + spent, _NOTHING)
        return spent

    def matvec(self, vector):
        """K, of vectors."""
        return self.vector(self.forward(self.coefficients(vector))[0])

    def rmatvec(self, vector):
        """Its transpose."""
        return self.vector(self.backward(self.coefficients(vector)))

    def l1(self, vector):
        """Bound on the integral of the absolute value of a function, by Schwarz in every cell."""
        squares = np.sum(vector.reshape(self.space.shape) ** 2, axis=(2, 3))
        return float(np.sqrt(squares * self.space.areas).sum())
