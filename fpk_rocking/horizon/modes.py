"""Leading eigenmodes of a linear map, high powers of the map by means of them, and survival after many cycles."""

import math
from typing import NamedTuple

import numpy as np
from scipy.linalg import block_diag
from scipy.sparse.linalg import ArpackError, LinearOperator, eigs

from fpk_rocking.base import checks
from fpk_rocking.density.tuning import TUNING


class Modes(NamedTuple):
    """Leading modes of a real linear map K, in real arithmetic: K basis = basis block.

    `values` (modes,) are eigenvalues, descending in modulus; `basis` (unknowns, modes) real eigenvectors of norm 1, for
    a conjugate pair the real and the imaginary part of one; `block` (modes, modes) is block diagonal; `residuals`
    (modes,) are norms of the columns of K basis - basis block.
    """

    values: np.ndarray
    basis: np.ndarray
    block: np.ndarray
    residuals: np.ndarray


def leading_modes(apply, start, count=TUNING.modes):
    """Return the `count` leading `Modes` of a map of vectors, by implicitly restarted Arnoldi iteration (ARPACK).

    Of a conjugate pair both or none are returned. ValueError where the iteration does not converge, or the leading
    eigenvalue is not real and positive: no density keeps its shape.
    """
    operator = LinearOperator((len(start), len(start)), apply, dtype=float)
    try:
        values, vectors = eigs(operator, k=count, v0=start, tol=TUNING.mode_precision, ncv=TUNING.subspace)
    except ArpackError as error:
        accepted = "a scene for which it converges"
        raise ValueError(
            checks.refusal("scene", f"no convergence of the eigenvalue solver ({error})", accepted)
        ) from error
    eigenvalues, columns, blocks = [], [], []
    for k in np.argsort(-np.abs(values), kind="stable"):
        value = values[k]
        if value.imag == 0.0:
            eigenvalues.append(value)
            columns.append(vectors[:, k].real)
            blocks.append([[value.real]])
        elif value.imag > 0.0 and value.conj() in values:
            eigenvalues += [value, value.conj()]
            columns += [vectors[:, k].real, vectors[:, k].imag]
            blocks.append([[value.real, value.imag], [-value.imag, value.real]])
    basis, block = np.stack(columns, axis=1), block_diag(*blocks)
    images = np.stack([apply(np.ascontiguousarray(column)) for column in basis.T], axis=1)
    residuals = np.linalg.norm(images - basis @ block, axis=0)
    leading = eigenvalues[0]
    if not (leading.imag == 0.0 < leading.real and residuals[0] <= TUNING.mode_residual * leading.real):
        accepted = f"one that is real and positive, with a residual up to {TUNING.mode_residual:g} of it"
        got = f"a leading eigenvalue {leading:.3g}, residual {residuals[0]:.1e}"
        raise ValueError(checks.refusal("scene", got, accepted))
    return Modes(np.array(eigenvalues), basis, block, residuals)


class Powers:
    """A vector after more and more applications of a map: step by step, then by the map's modes.

    `apply` is the map; `modes` is called without argument, after the first applications; `l1` bounds the integral of
    the absolute value of what a vector stands for; `leading_log` gives the logarithm of the leading eigenvalue, as
    exact as high powers want it.
    """

    def __init__(self, apply, modes, l1, leading_log, vector, tuning=TUNING):
        self._tuning = tuning
        self._apply, self._modes, self._l1, self._leading_log = apply, modes, l1, leading_log
        self._vector, self._count = vector, 0
        self._amplitudes, self._left_out = None, 0.0

    def after(self, count):
        """Return the vector after `count` applications, not fewer than were asked for before."""
        while self._count < count and self._amplitudes is None:
            self._advance()
        if self._amplitudes is None:
            return self._vector
        return self._by_modes(count - self._count)

    def total(self):
        """Return the sum of the vectors after every number of applications, 0 included."""
        total = np.zeros_like(self._vector)
        while self._amplitudes is None:
            before = self._vector
            self._advance()
            total += before if self._amplitudes is None else 0.0
        modes, log = self._modes(), self._leading_log()
        further = np.zeros_like(modes.block)
        further[0, 0] = -1.0 / np.expm1(log)
        further[1:, 1:] = np.linalg.inv(np.eye(len(further) - 1) - modes.block[1:, 1:])
        return total + modes.basis @ (further @ self._amplitudes)

    def left_out(self, count):
        """Return the L1 norm of the neglected part of a density after `count` applications of the operator.

        What a least-squares fit leaves holds a part of the leading mode: it falls like that mode, not like those that
        were not computed (derived in docs/theory, "One cycle as an operator").
        """
        if self._amplitudes is None:
            return 0.0
        return self._left_out * math.exp((count - self._count) * self._leading_log())

    def _advance(self):
        """Hand over to the modes where they leave next to nothing out, else apply the map once more."""
        if self._count == self._tuning.steps_until_modes:
            accepted = (
                f"one that {self._tuning.modes} modes represent after {self._tuning.steps_until_modes} half cycles"
            )
            raise ValueError(checks.refusal("scene", "a density with many slowly decaying modes", accepted))
        if self._count >= self._tuning.steps_before_modes:
            modes = self._modes()
            amplitudes = np.linalg.lstsq(modes.basis, self._vector, rcond=None)[0]
            left_out = self._l1(self._vector - modes.basis @ amplitudes)
            if left_out <= self._tuning.modes_left_out * self._l1(self._vector):
                self._amplitudes, self._left_out = amplitudes, left_out
                return
        self._vector, self._count = self._apply(self._vector), self._count + 1

    def _by_modes(self, further):
        """Return the vector `further` applications after that kept, by powers of the eigenvalues."""
        modes = self._modes()
        power = np.zeros_like(modes.block)
        power[0, 0] = np.exp(further * self._leading_log())
        power[1:, 1:] = np.linalg.matrix_power(modes.block[1:, 1:], further)
        return modes.basis @ (power @ self._amplitudes)


class SurvivalEstimate(NamedTuple):
    """Survival from the scene's start after given numbers of cycles, with error estimates.

    Parameters
    ----------
    cycles : ndarray of int, shape (n,)
        The numbers of cycles.
    survival : ndarray, shape (n,)
        Probability of not having overturned.
    left_out : ndarray, shape (n,)
        Estimated error from representing the density by its leading modes, where that is done.
    error_estimate : ndarray, shape (n,)
        Estimated error of survival: from the next coarser mesh and from the error of the escape rate, plus `left_out`.
    """

    cycles: np.ndarray
    survival: np.ndarray
    left_out: np.ndarray
    error_estimate: np.ndarray
