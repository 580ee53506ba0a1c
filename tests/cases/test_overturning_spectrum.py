"""The case `overturning_spectrum` against the closed condition for overturning without impact."""

import numpy as np
import pytest
from scipy import integrate, optimize

FREQUENCIES = np.array([1.5, 4.0, 6.0])


def least_without_impact(frequency):
    """Amplitude at which the unstable coordinate is 0 after lift-off at τ_0: ∫ exp(τ_0-τ) A sin Ωτ dτ = 1."""

    def excess(amplitude):
        start, end = np.arcsin(1.0 / amplitude) / frequency, 2.0 * np.pi / frequency
        return amplitude * integrate.quad(lambda t: np.exp(start - t) * np.sin(frequency * t), start, end)[0] - 1.0

    return optimize.brentq(excess, 1.0 + 1e-9, 30.0, xtol=1e-12)


def test_least_amplitudes_and_modes(case, tmp_path):
    spectrum = case("overturning_spectrum")
    amplitudes = np.geomspace(1.05, 12.0, 40)
    modes, bounds = spectrum.spectrum(FREQUENCIES, amplitudes)
    # Found by bisection between amplitudes 6 % apart, 20 times.
    wanted = [least_without_impact(frequency) for frequency in FREQUENCIES]
    assert bounds[:, 1] == pytest.approx(wanted, rel=1e-6)
    # An impact helps to overturn, and there is a gap between both modes at high frequencies.
    assert (bounds[:, 0] < bounds[:, 1]).all()
    last = modes[2].tolist()
    assert last.index(spectrum.STANDS, last.index(1)) < last.index(0)
    spectrum.draw(tmp_path / "spectrum.png", FREQUENCIES, amplitudes, modes, bounds, {0.2: 1.1 * bounds})
    assert (tmp_path / "spectrum.png").stat().st_size > 10_000
