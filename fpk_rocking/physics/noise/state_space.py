"""White noise through a linear filter of any order: its state space, and all of the noise that follows from it.

A filter of n states is dz = A z dτ + b dW, η = c z, with the standard Wiener process W. It is stationary, and P is the
covariance of its states at any one time: A P + P Aᵀ + b bᵀ = 0. With R the autocovariance of η (docs/theory, "Noise"),

    R(t) = c e^(A|t|) P cᵀ,    G(ω) = |c (iω - A)⁻¹ b|²/π = (2/π) Re c (iω - A)⁻¹ P cᵀ,
    σ_M² = 2 ∫ R(t) (1 + t) e^(-t) dt = 2 c [(I - A)⁻¹ + (I - A)⁻²] P cᵀ.

All quantities are nondimensional. A scene imports this module, so scipy is imported where it is used.
"""

import math
from typing import NamedTuple, Self

import numpy as np

from fpk_rocking.base import checks
from fpk_rocking.base.basis import gauss_legendre
from fpk_rocking.base.checks import Array, ArrayLike, Number


class StateSpace(NamedTuple):
    """Stationary noise η of variance 1 out of n states: dz = drift z dτ + input dW, η = output z; nondimensional.

    Each state is scaled to the standard deviation 1. `stationary` makes a state space from any matrices.

    Parameters
    ----------
    drift : ndarray, shape (n, n)
        A, per time.
    input, output : ndarray, shape (n,)
        b and c.
    correlation : ndarray, shape (n, n)
        P, correlation of the states at the same time.

    Examples
    --------
    >>> from fpk_rocking import StateSpace
    >>> space = StateSpace.stationary(drift=[[-2.0]], source=[1.0], output=[1.0])
    >>> print(space.autocovariance([0.0, 0.5]).round(3), f"{space.spectral_density(2.0):.4f}")
    [1.    0.368] 0.1592
    """

    drift: np.ndarray
    input: np.ndarray
    output: np.ndarray
    correlation: np.ndarray

    @classmethod
    def stationary(cls, drift: ArrayLike, source: ArrayLike, output: ArrayLike) -> Self:
        """State space of a filter dz = drift z dτ + source dW, η = output z; each state and η are scaled to variance 1.

        Parameters
        ----------
        drift : array_like, shape (n, n)
            A; its eigenvalues have real parts below 0.
        source, output : array_like, shape (n,)
            b and c, of any size.

        Raises
        ------
        ValueError
            An eigenvalue of the drift has no real part below 0, the white noise does not drive the states independently
            of each other, or they have no effect on η.
        """
        from scipy.linalg import matrix_balance, solve_continuous_lyapunov

        rate, (scale, _) = matrix_balance(np.asarray(drift, dtype=float), permute=False, separate=True)
        reach, observed = np.asarray(source) / scale, np.asarray(output) * scale
        rates = np.linalg.eigvals(rate)
        if not rates.real.max() < 0.0:
            accepted = "a matrix whose eigenvalues all have a real part below 0, so that the noise is stationary"
            raise ValueError(checks.refusal("noise.filter.drift", np.asarray(drift).tolist(), accepted))
        fastest = np.abs(rates).max()
        size = np.abs(reach).max() or 1.0
        covariance = solve_continuous_lyapunov(rate / fastest, -np.outer(reach, reach) / size**2)
        spread = np.sqrt(np.maximum(np.diag(covariance), 0.0))
        if spread.min() > 0.0:
            correlation = 0.5 * (covariance + covariance.T) / np.outer(spread, spread)
            np.fill_diagonal(correlation, 1.0)
            weights = observed * spread
            strength = math.sqrt(max(weights @ correlation @ weights, 0.0))
            # With a least eigenvalue below 1e-10 one state follows from the others.
            if np.linalg.eigvalsh(correlation)[0] > 1e-10 and strength > 0.0:
                reach = reach * math.sqrt(fastest) / (size * spread)
                return cls(rate * spread / spread[:, None], reach, weights / strength, correlation)
        accepted = "a filter whose white noise reaches every state, and whose states reach the output"
        matrices = f"input {np.asarray(source).tolist()} and output {np.asarray(output).tolist()}"
        raise ValueError(f"noise.filter: got {matrices}, accepted: {accepted}")

    @property
    def order(self) -> int:
        """Number n of states."""
        return len(self.input)

    @property
    def rates(self) -> Array:
        """Eigenvalues (n,) of the drift; each has a real part below 0."""
        return np.linalg.eigvals(self.drift)

    @property
    def fastest(self) -> float:
        """Absolute value of the fastest eigenvalue: noise is sampled in parts of 1/fastest."""
        return float(np.abs(self.rates).max())

    @property
    def smooth(self) -> bool:
        """Whether η has a derivative, which is c A z: c b is 0."""
        size = np.linalg.norm(self.output) * np.linalg.norm(self.input)
        return bool(abs(self.output @ self.input) <= 1e-9 * size)

    def autocovariance(self, lag: ArrayLike) -> Number:
        """Mean of η(τ) η(τ + lag), of the shape of `lag`.

        Parameters
        ----------
        lag : array_like
            Time of either sign.
        """
        from scipy.linalg import expm

        transition = expm(self.drift * np.abs(np.asarray(lag, dtype=float))[..., None, None])
        return (transition @ self._covariance @ self.output)[()]

    def spectral_density(self, frequency: ArrayLike) -> Number:
        """One-sided spectral density G, whose integral over all ω > 0 is the variance 1, of the shape of `frequency`.

        Parameters
        ----------
        frequency : array_like
            Angular frequency ω, at least 0.
        """
        omega = np.asarray(frequency, dtype=float)[..., None, None]
        states = np.linalg.solve(1j * omega * np.eye(self.order) - self.drift, self.input[:, None])
        return (np.square(np.abs(states[..., 0] @ self.output)) / math.pi)[()]

    @property
    def peak_density(self) -> float:
        """Largest value of `spectral_density` over all ω."""
        fastest = self.fastest
        drift, feedback = self.drift / fastest, np.outer(self.input, self.output)
        poles = np.poly(drift)
        # det(s - A + b c) - det(s - A) = c adj(s - A) b
        zeros = np.poly(drift - feedback / np.abs(feedback).max()) - poles
        above, below = np.poly1d(_squared(zeros)), np.poly1d(_squared(poles))
        roots = (above.deriv() * below - above * below.deriv()).roots
        return float(np.max(self.spectral_density(fastest * np.sqrt(np.maximum(np.append(roots.real, 0.0), 0.0)))))

    @property
    def melnikov_variance(self) -> float:
        """Variance of a slender block's Melnikov process, ∫ 4 G/(1 + ω²)² dω, for η of variance 1."""
        return self.variance_along(np.ones(1), np.ones(1))

    def variance_along(self, weights: Array, rates: Array) -> float:
        """Variance of ∫ K(τ) η(τ) dτ with the kernel K = Σ w_i exp(-m_i |τ|).

        With R̂ the Laplace transform of the autocovariance, a pair of terms contributes 2 w² [R̂(m)/m - R̂'(m)] where
        it is one term twice, else 4 w_i w_j [m_j R̂(m_i) - m_i R̂(m_j)]/(m_j² - m_i²).

        Parameters
        ----------
        weights, rates : ndarray, shape (terms,)
            w_i, and m_i above 0, all different.
        """
        total = 0.0
        laplace: list[tuple[float, float, float]] = []
        for weight, rate in zip(weights.tolist(), rates.tolist(), strict=True):
            inverse = rate * np.eye(self.order) - self.drift
            once = np.linalg.solve(inverse, self._covariance)
            total += float(2.0 * self.output @ (once / rate + np.linalg.solve(inverse, once))) * weight * weight
            value = float(self.output @ once)
            for other, slower, before in laplace:
                total += 8.0 * weight * other * (rate * before - slower * value) / (rate * rate - slower * slower)
            laplace.append((weight, rate, value))
        return total

    @property
    def inward_variance(self) -> float:
        """Variance of the stationary solution q of q' = -q - η, by which η moves a flight inward; η of variance 1."""
        return float(self.output @ np.linalg.solve(np.eye(self.order) - self.drift, self._covariance))

    @property
    def _covariance(self):
        """Covariance (n,) of the states with η."""
        return self.correlation @ self.output


def transition_and_factor(drift: Array, source: Array, duration: float) -> tuple[Array, Array]:
    """Transition matrix Φ and noise factor L, (n, n) each, of an exact step of dz = drift z dτ + source dW.

    L is lower triangular, and L Lᵀ = ∫ Φ(t) source sourceᵀ Φ(t)ᵀ dt is the covariance that the noise adds: by
    Gauss-Legendre quadrature over a part of the step in which nothing moves fast, then doubled. The covariance itself
    is never formed: over a short step it would be singular to rounding.
    """
    from scipy.linalg import expm

    rate = np.abs(np.linalg.eigvals(drift)).max()
    doublings = max(0, math.ceil(math.log2(max(rate * duration, 1.0))))
    short = duration / 2**doublings
    nodes, weights = gauss_legendre(20, -1.0, 1.0)
    responses = expm(drift * (0.5 * short * (1.0 + nodes))[:, None, None]) @ source
    factor = _triangular(responses.T * np.sqrt(0.5 * short * weights))
    phi = expm(drift * short)
    for _ in range(doublings):
        factor = _triangular(np.hstack([factor, phi @ factor]))
        phi = phi @ phi
    return phi, factor


def _triangular(factor):
    """Lower triangular L (n, n), its diagonal at least 0, with L Lᵀ = factor factorᵀ, of a factor (n, m)."""
    lower = np.transpose(np.linalg.qr(factor.T, mode="r"))
    return lower * np.where(np.diag(lower) < 0.0, -1.0, 1.0)


def _squared(polynomial):
    """p(iω) p(-iω) of a real polynomial p (n + 1,) of ω as one of ω²; the highest power comes first in both."""
    signs = (-1.0) ** np.arange(len(polynomial))[::-1]
    squares = np.convolve(polynomial, polynomial * signs)[::2]
    return squares * (-1.0) ** np.arange(len(squares))[::-1]
