#!/usr/bin/env bash
# Response spectra: of a pulse without zeros behind it, no library of three gives the right one at long periods.
#
# One would guess: the spectral acceleration of a half sine of .3 s is the largest response of the oscillator, which
# comes after the pulse where the period is longer than about twice its length, and libraries agree to a per cent.
# What happens: eqsig and gmprocess's core (esi-core) end with the last sample: at 4 s both give .25 of the exact value.
# pyrotd multiplies Fourier transforms, so what is left of the response comes in again at the beginning: at 4 s
# it gives 2.3 times, at .5 s .57 times. With 20 s of zeros behind the pulse eqsig is exact, and pyrotd at short periods.
# Seen with eqsig 1.2.17, pyRotd 0.6.1 and esi-core 1.2.9.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
pip() { "$folder/venv/bin/pip" --quiet --disable-pip-version-check "$@"; }
pip install eqsig==1.2.17 numpy==2.4.6 pyrotd==0.6.1 scipy==1.17.1
pip install --no-deps esi-core==1.2.9
cd "$folder"
"$folder/venv/bin/python" - <<'PYTHON'
import importlib.metadata

import eqsig
import numpy as np
import pyrotd
from esi_core.gmprocess.metrics import oscillators
from scipy.integrate import solve_ivp

STEP, LENGTH, DAMPING = 0.005, 0.3, 0.05
PERIODS = np.array([0.2, 0.5, 1.0, 2.0, 4.0])
time = np.arange(round(LENGTH / STEP) + 1) * STEP
PULSE = 3.0 * np.sin(np.pi * time / LENGTH)  # m/s2


def exact(period):
    """Largest pseudo-acceleration by a fine integration to two periods after the pulse."""
    w = 2.0 * np.pi / period

    def rate(t, y):
        return y[1], -np.interp(t, time, PULSE, right=0.0) - 2.0 * DAMPING * w * y[1] - w**2 * y[0]

    path = solve_ivp(rate, (0.0, LENGTH + 2.0 * period), (0.0, 0.0), max_step=STEP, rtol=1e-9, atol=1e-12)
    return w**2 * np.abs(path.y[0]).max()


def by_eqsig(pulse):
    signal = eqsig.AccSignal(pulse, STEP)
    signal.generate_response_spectrum(response_times=PERIODS, xi=DAMPING)
    return np.asarray(signal.s_a)


def by_pyrotd(pulse):
    return pyrotd.calc_spec_accels(STEP, pulse, 1.0 / PERIODS, DAMPING).spec_accel


def by_esi_core(pulse):
    """The core's largest relative displacement, as a pseudo-acceleration."""
    rows = [oscillators.calculate_spectrals(pulse, pulse.size, STEP, 1.0 / STEP, t, DAMPING)[2] for t in PERIODS]
    return np.array([np.abs(row).max() for row in rows]) * (2.0 * np.pi / PERIODS) ** 2


print(*(f"{name} {importlib.metadata.version(name)}" for name in ("eqsig", "pyrotd", "esi-core")), sep=", ")
right = np.array([exact(period) for period in PERIODS])
ends, wraps, core = by_eqsig(PULSE) / right, by_pyrotd(PULSE) / right, by_esi_core(PULSE) / right
longer = np.pad(PULSE, (0, 4000))
print("periods, s:", *PERIODS)
for name, ratio in (("eqsig", ends), ("esi-core", core), ("pyrotd", wraps)):
    print(f"{name}, times the exact value:", *np.round(ratio, 3))
print("with 20 s of zeros, eqsig:", *np.round(by_eqsig(longer) / right, 3))
print("with 20 s of zeros, pyrotd:", *np.round(by_pyrotd(longer) / right, 3))
assert abs(ends[-1] - 0.248) < 0.01
assert abs(core[-1] - 0.248) < 0.01
assert abs(wraps[-1] - 2.31) < 0.05
assert abs(wraps[1] - 0.57) < 0.02
assert np.abs(by_eqsig(longer) / right - 1.0).max() < 2e-3
assert np.abs(by_pyrotd(longer) / right - 1.0)[:3].max() < 2e-3
PYTHON
