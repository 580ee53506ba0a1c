"""Modes of a linear map, and high powers by them, against what is known in closed form."""

import math

import numpy as np
import pytest
from scipy.linalg import block_diag

from fpk_rocking import Harmonic
from fpk_rocking.density.space import Space
from fpk_rocking.density.step.dynamics import Dynamics
from fpk_rocking.density.step.step import Characteristics, Quadrature, Step
from fpk_rocking.density.tuning import TUNING
from fpk_rocking.horizon.modes import Powers, leading_modes
from fpk_rocking.physics.motion.equation import KernelBlock

LEADING, FEW = 1.0 - 1e-9, TUNING.steps_before_modes


@pytest.fixture(scope="module")
def matrix_and_modes():
    """A matrix of 60 with known modes, two of them a conjugate pair, and a basis that is not orthogonal."""
    rng = np.random.default_rng(3)
    pair = 0.7 * np.array([[math.cos(1.0), math.sin(1.0)], [-math.sin(1.0), math.cos(1.0)]])
    diagonal = block_diag(LEADING, -0.9, pair, 0.5, np.diag(rng.uniform(-0.2, 0.2, 55)))
    basis = np.linalg.qr(rng.normal(size=(60, 60)))[0] @ (np.eye(60) + 0.01 * rng.normal(size=(60, 60)))
    return basis @ diagonal @ np.linalg.inv(basis), basis, diagonal


def powers_of(matrix, vector, **tuned):
    """Powers of a matrix with its own modes; the leading logarithm is given as it is known."""
    start = np.random.default_rng(4).random(len(vector))
    leading = leading_modes(lambda x: matrix @ x, start)
    own = lambda: leading, lambda x: np.abs(x).sum(), lambda: math.log(LEADING)
    return Powers(lambda x: matrix @ x, *own, vector, TUNING._replace(**tuned))


def test_modes_of_a_known_matrix_from_two_starts(matrix_and_modes):
    """Eigenvalues to 1e-10 whatever the start, half of a conjugate pair never, residuals as they say."""
    matrix, _, diagonal = matrix_and_modes
    expected = np.sort_complex(np.linalg.eigvals(diagonal[:5, :5]))
    for seed in (1, 2):
        leading = leading_modes(lambda x: matrix @ x, np.random.default_rng(seed).random(60), count=5)
        assert np.sort_complex(leading.values) == pytest.approx(expected, abs=1e-10)
        assert np.abs(matrix @ leading.basis - leading.basis @ leading.block).max() < 1e-10
        residuals = np.linalg.norm(matrix @ leading.basis - leading.basis @ leading.block, axis=0)
        assert leading.residuals == pytest.approx(residuals)
    three = leading_modes(lambda x: matrix @ x, np.random.default_rng(1).random(60), count=3)
    assert len(three.values) == 2


def test_powers_step_by_step_and_by_modes(matrix_and_modes):
    """A vector after 1 to 1e9 applications: exact powers of the diagonal; the change-over is not seen."""
    matrix, basis, diagonal = matrix_and_modes
    vector = np.random.default_rng(5).random(60)
    powers, amplitudes = powers_of(matrix, vector), np.linalg.solve(basis, vector)
    for count in (1, FEW - 1, FEW, FEW + 1, 100, 1000, 10**6, 10**9):
        expected = basis @ np.linalg.matrix_power(diagonal, count) @ amplitudes
        assert np.linalg.norm(powers.after(count) - expected) < 1e-7 * LEADING**count
        assert powers.left_out(count) <= TUNING.modes_left_out * np.abs(vector).sum()


def test_what_the_modes_leave_out_falls_like_the_leading_mode():
    """A random walk on 60 sites that leaks, modes that take over early: the figure is above the error, and near it.

    The remainder of a least-squares fit is orthogonal to the modes computed, not free of them: as the last of them it
    would seem to fall to 1e-14 of the error within 100 applications.
    """
    rng = np.random.default_rng(8)
    matrix = rng.random((60, 60)) ** 8 + 0.5 * np.eye(60)
    matrix *= rng.uniform(0.9, 0.98, 60) / matrix.sum(axis=0)
    vector = rng.random(60)
    leading = leading_modes(lambda x: matrix @ x, np.ones(60))
    log = math.log(leading.values[0].real)
    early = TUNING._replace(steps_before_modes=5, modes_left_out=0.05)
    powers = Powers(lambda x: matrix @ x, lambda: leading, lambda x: np.abs(x).sum(), lambda: log, vector, early)
    at_hand = np.linalg.matrix_power(matrix, 5) @ vector
    remainder = at_hand - leading.basis @ np.linalg.lstsq(leading.basis, at_hand, rcond=None)[0]
    for count in range(1, 200):
        error = np.abs(powers.after(count) - np.linalg.matrix_power(matrix, count) @ vector).sum()
        if count <= 5:
            assert powers.left_out(count) == 0.0
        else:
            expected = np.abs(remainder).sum() * math.exp(log * (count - 5))
            assert powers.left_out(count) == pytest.approx(expected, rel=1e-9)
            assert 0.01 * expected < error < expected


def test_total_is_the_inverse(matrix_and_modes):
    """The sum of all powers is (I - K)^-1, whose norm is 1e9 here."""
    matrix, *_ = matrix_and_modes
    vector = np.random.default_rng(6).random(60)
    expected = np.linalg.solve(np.eye(60) - matrix, vector)
    assert powers_of(matrix, vector).total() == pytest.approx(expected, rel=1e-5)


def test_modes_that_never_take_over_are_refused():
    """A map with as many equal modes as it has unknowns has none that say all."""
    matrix = np.diag(np.linspace(0.9, 0.95, 60))
    with pytest.raises(ValueError, match=r"^scene: got 'a density with many slowly decaying modes'"):
        powers_of(matrix, np.ones(60), steps_until_modes=50).after(100)


@pytest.mark.parametrize("matrix", [-np.diag(np.linspace(0.1, 0.9, 60)), np.zeros((60, 60))])
def test_no_positive_leading_eigenvalue_is_refused(matrix):
    with pytest.raises(ValueError, match=r"^scene: got"):
        leading_modes(lambda x: matrix @ x, np.ones(60))


@pytest.mark.parametrize("transposed", [False, True])
def test_spectrum_of_the_linear_saddle(transposed):
    """Without impact the flow about x = 1 is a saddle with noise: eigenvalues e^(-(m + 1) t - n t), m, n = 0, 1, ...

    Along the outward direction the noise leaves a uniform density that thins by e^-t, along the inward one a Gaussian.
    The first three are tested, of which two coincide; the three of e^-3t are as exact as the mesh's edge lets them be.
    """
    duration, diffusion = 0.5, 0.004
    dynamics = Dynamics(Harmonic(0.0, 1.0, 0.0), diffusion, KernelBlock(0.5, 50.0))
    space = Space(np.linspace(0.2, 1.8, 25), np.linspace(-0.8, 0.8, 25), 3)
    step = Step(Characteristics(space, 0.0, duration, dynamics, Quadrature(5, 5, 5, 2)), space)

    def apply(vector):
        coefficients = vector.reshape(space.shape)
        moved = step.apply_adjoint(coefficients, np.zeros(3)) if transposed else step.apply(coefficients)[0]
        return moved.ravel()

    leading = leading_modes(apply, np.random.default_rng(1).random(space.unknowns))
    assert -np.log(np.abs(leading.values[:3])) / duration == pytest.approx([1.0, 2.0, 2.0], abs=2e-5)
