"""The Fokker-Planck equation of a rocking block discretised in place: upwind discontinuous Galerkin forms.

For every test function w, with the acceleration a = x - s + f (docs/theory.md, section 5):

    d/dt (p, w) = (v p, dw/dx) + (a p - D dp/dv, dw/dv) - sum over facets of (flux, jump of w).

The flux is upwind across mesh lines x = const, local Lax-Friedrichs with symmetric interior penalty across those
v = const, and outside the mesh the density is 0. At x = 0 what flows out of one side at the velocity v flows into the
other at e v, which is p(0+, v) = e^-2 p(0-, v/e).
"""

import math

import numpy as np
from scipy import sparse
from skfem import BilinearForm, FacetBasis, asm

from fpk_rocking.base import checks
from fpk_rocking.base.basis import gauss_legendre
from fpk_rocking.density.space import Space


@BilinearForm
def still(p, w, at):
    """Return what flows inside a cell without forcing; the parameter `side` is s."""
    x, v = at.x
    return v * p * w.grad[0] + (x - at.side) * p * w.grad[1] - at.diffusion * p.grad[1] * w.grad[1]


@BilinearForm
def push(p, w, _):
    """Return what a unit force moves inside a cell."""
    return p * w.grad[1]


@BilinearForm
def across_angle(p, w, at):
    """Return the upwind flux across a line x = const, from the trace on side idx[0] to the test on side idx[1]."""
    own, other = at.idx
    speed = at.x[1] * at.n[0]
    upwind = np.minimum(speed, 0.0) if own else np.maximum(speed, 0.0)
    return -upwind * p * (-1) ** other * w


@BilinearForm
def across_velocity(p, w, at):
    """Return the central flux without forcing and the interior penalty across a line v = const."""
    own, other = at.idx
    normal, jump = at.n[1], (-1) ** other * w
    drift = -0.5 * (at.x[0] - at.side) * normal * p * jump
    symmetric = 0.5 * at.diffusion * normal * (p.grad[1] * jump + (-1) ** own * p * w.grad[1])
    return drift + symmetric - at.penalty * (-1) ** own * p * jump


@BilinearForm
def push_across(p, w, at):
    """Return the central flux of a unit force across a line v = const."""
    return -0.5 * at.n[1] * p * (-1) ** at.idx[1] * w


@BilinearForm
def jumps(p, w, at):
    """Return half the product of the jumps across a line v = const."""
    return 0.5 * (-1) ** sum(at.idx) * p * w


class Operator:
    """The right-hand side of the discretised equation, as matrices that are assembled once.

    Parameters
    ----------
    space : Space
        Mesh and degree; x = 0 and v = 0 are mesh lines.
    scene : Scene
        With white noise.

    Attributes
    ----------
    areas : ndarray, shape (unknowns,)
        The mass matrix, which is diagonal.
    unit : ndarray, shape (unknowns,)
        Coefficients of the test function 1.

    Raises
    ------
    ValueError
        x = 0 or v = 0 is not among the mesh lines.
    """

    def __init__(self, space: Space, scene):
        for name, lines in (("angle_lines", space.angle_lines), ("velocity_lines", space.velocity_lines)):
            if 0.0 not in lines:
                raise ValueError(checks.refusal(name, lines, "mesh lines with 0.0 among them"))
        self.space, self.scene = space, scene
        cells, self.block = math.prod(space.shape[:2]), math.prod(space.shape[2:])
        self.areas = np.repeat(space.areas.ravel(), self.block)
        self.unit = np.tile(np.eye(1, self.block)[0], cells)
        self._assemble(space.basis(2 * space.degree + 1))
        lines = space.angle_lines
        sides = np.sign(lines[1:] + lines[:-1])
        # The largest |a| on a facet is found at one of its ends, as a is linear in the angle.
        self._ends = lines[:-1] - sides, lines[1:] - sides

    def _assemble(self, basis):
        """Assemble the three parts of the operator, and what leaves the mesh, from a basis of skfem with quadrature."""
        mesh, lines = basis.mesh, self.space.velocity_lines
        middle = mesh.p[:, mesh.facets].mean(axis=1)
        upright = np.ptp(mesh.p[0][mesh.facets], axis=0) == 0.0
        inside = mesh.f2t[1] >= 0
        size = np.diff(lines)[mesh.f2t % (len(lines) - 1)].min(axis=0)
        strength = (self.space.degree + 1) ** 2 * self.scene.noise.diffusion / size

        def on(form, facets):
            """Matrix of a form over facets, numbers (n,) of the mesh."""
            sides = [FacetBasis(mesh, basis.elem, facets=facets, side=k) for k in range(1 + inside[facets[0]])]
            side, penalty = np.sign(middle[0][facets])[:, None], strength[facets][:, None]
            return asm(form, sides, sides, side=side, penalty=penalty, diffusion=self.scene.noise.diffusion)

        between, ends = np.flatnonzero(upright & inside & (middle[0] != 0.0)), np.flatnonzero(upright & ~inside)
        rungs, caps = np.flatnonzero(~upright & inside), np.flatnonzero(~upright & ~inside)
        side = np.sign(mesh.p[0][mesh.t].mean(axis=0))[:, None]
        out = on(across_angle, ends)
        away = [on(form, caps) for form in (across_velocity, push_across, jumps)]
        still_parts = [
            asm(still, basis, side=side, diffusion=self.scene.noise.diffusion),
            on(across_angle, between), on(across_velocity, rungs), out, away[0], impact(basis, self.space, self.scene),
        ]  # fmt: skip
        push_parts = [asm(push, basis), on(push_across, rungs), away[1]]
        self._set_blocks(sum(still_parts), sum(push_parts), on(jumps, rungs) + away[2])
        passed = -(out.T @ self.unit).reshape(self.space.shape[0], -1)
        left = np.arange(len(passed))[:, None] < self.space.first_positive
        self._passed = np.stack([np.where(left, passed, 0.0).ravel(), np.where(left, 0.0, passed).ravel()])
        self._lost = [-(matrix.T @ self.unit) for matrix in away]

    def _set_blocks(self, *matrices):
        """Keep the three parts of the operator as blocks of one sparsity, so that they can be added as arrays."""
        blocks = [matrix.tobsr((self.block, self.block)) for matrix in matrices]
        pattern = sum(abs(matrix) for matrix in blocks).tobsr((self.block, self.block))
        pattern.sort_indices()
        self._rows = np.repeat(np.arange(len(pattern.indptr) - 1), np.diff(pattern.indptr))
        self._pattern = pattern.indices, pattern.indptr
        keys = self._rows * pattern.shape[1] + pattern.indices
        self._parts = []
        for matrix in blocks:
            rows = np.repeat(np.arange(len(matrix.indptr) - 1), np.diff(matrix.indptr))
            data = np.zeros_like(pattern.data)
            data[np.searchsorted(keys, rows * pattern.shape[1] + matrix.indices)] = matrix.data
            self._parts.append(data)

    def _dissipation(self, force):
        """Largest |a| in each angle cell, for each of its blocks (cells,)."""
        fastest = np.maximum(*(np.abs(end + force) for end in self._ends))
        return np.repeat(fastest, self.space.shape[1])

    def at(self, force):
        """Return the operator under a force as a block matrix (unknowns, unknowns), and its blocks on the diagonal."""
        unforced, pushed, jumping = self._parts
        data = unforced + force * pushed
        data -= self._dissipation(force)[self._rows, None, None] * jumping
        matrix = sparse.bsr_matrix((data, *self._pattern), shape=2 * (len(self.areas),))
        return matrix, data[self._rows == self._pattern[0]]

    def losses(self, density, force):
        """Rates at which a density overturns to the left and to the right, and leaves through the velocity bound."""
        unforced, pushed, jumping = self._lost
        weights = unforced + force * pushed - np.repeat(self._dissipation(force), self.block) * jumping
        return np.append(self._passed @ density, weights @ density)

    def mass(self, density):
        """Integral of a density."""
        return float((self.areas * self.unit) @ density)


def impact(basis, space: Space, scene):
    """Return the matrix of the flux through x = 0: it leaves one side at the velocity v and enters the other at e v.

    What leaves is what enters, as both are sums over the same points; between the lines v and v/e of the mesh both
    traces are polynomials, for which the sums are exact.
    """
    lines, restitution = space.velocity_lines, scene.block.restitution
    nodes, weights = gauss_legendre(space.degree + 2)
    total = 0.0
    for direction in (1, -1):
        breaks = np.union1d(lines, lines / restitution)
        breaks = breaks[(direction * breaks >= 0.0) & (breaks >= lines[0]) & (breaks <= lines[-1])]
        sizes = np.diff(breaks)[:, None]
        velocity, lengths = (breaks[:-1, None] + sizes * nodes).ravel(), (sizes * weights).ravel()
        before = space.first_positive - (direction > 0)
        after = space.first_positive - (direction < 0)
        leaving = trace(basis, space, before, velocity)
        entering = trace(basis, space, after, restitution * velocity)
        total += (entering - leaving).T @ sparse.diags(lengths * np.abs(velocity)) @ leaving
    return total


def trace(basis, space: Space, column, velocity):
    """Return the matrix (points, unknowns) that evaluates a density at x = 0, seen from one column of cells."""
    cells = column * space.shape[1] + np.searchsorted(space.velocity_lines, velocity) - 1
    points = basis.mapping.invF(np.stack([np.zeros_like(velocity), velocity])[:, :, None], tind=cells)
    values = [np.asarray(basis.elem.gbasis(basis.mapping, points, i, tind=cells)[0])[:, 0] for i in range(basis.Nbfun)]
    rows = np.tile(np.arange(len(velocity)), basis.Nbfun)
    entries = np.concatenate(values), (rows, basis.element_dofs[:, cells].ravel())
    return sparse.csr_matrix(entries, shape=(len(velocity), basis.N))
