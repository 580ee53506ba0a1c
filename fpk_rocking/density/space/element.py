"""The scikit-fem element of the densities: products of Legendre polynomials, discontinuous from cell to cell."""

import numpy as np
from numpy.polynomial import legendre
from skfem.element import ElementH1
from skfem.refdom import RefQuad


class ElementQuadLegendre(ElementH1):
    """Products of orthonormal Legendre polynomials, all unknowns inside the cell: the mass matrix is the Jacobian."""

    refdom = RefQuad

    def __init__(self, degree):
        self.degree = degree
        self.maxdeg = 2 * degree
        self.interior_dofs = (degree + 1) ** 2
        self.dofnames = ["u"] * self.interior_dofs
        self.doflocs = np.full((self.interior_dofs, 2), 0.5)

    def lbasis(self, X, i):
        """Value and gradient of shape function i; on a tensor mesh the first reference axis is the velocity."""
        a, b = divmod(i, self.degree + 1)
        along = [legendre.Legendre.basis(k, domain=[0.0, 1.0]) * np.sqrt(2.0 * k + 1.0) for k in (b, a)]
        values = along[0](X[0]), along[1](X[1])
        return values[0] * values[1], np.array([along[0].deriv()(X[0]) * values[1], values[0] * along[1].deriv()(X[1])])
