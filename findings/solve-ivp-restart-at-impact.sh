#!/usr/bin/env bash
# SciPy: solve_ivp, started again where a terminal event ended it, ends there at once.
#
# One would guess: with the terminal event "the angle is zero", a call from the state after an impact, with the velocity
# lowered, runs to the next impact.
# What happens: the state at which a call ends is zero only to rounding. Where it lies before zero, the event is passed
# again at once: the next call takes no time and returns success, so do all after it, and the loop over impacts never
# leaves the first ones. Within six calls this befalls nine blocks of ten and more, by every method; with the side
# times the angle as a falling event (`direction = -1`) none.
# Seen with SciPy 1.17.1.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check numpy==2.4.6 scipy==1.17.1
cd "$folder"
"$folder/venv/bin/python" - <<'PYTHON'
import numpy as np
import scipy
from scipy.integrate import solve_ivp

STARTS, CALLS, RESTITUTION = 20, 6, 0.9


def flight(t, state, side):
    """Rate of angle and velocity of a slender block that rocks on one side, angle in critical angles."""
    return state[1], state[0] - side


def upright(t, state, side):
    return state[0]


def landing(t, state, side):
    return side * state[0]


upright.terminal = landing.terminal = True
landing.direction = -1


def lengths(event, angle, method):
    """Time that each of the calls took."""
    t, side, state, taken = 0.0, 1.0, (angle, 0.0), []
    for _ in range(CALLS):
        path = solve_ivp(flight, (t, t + 20.0), state, method, events=event, args=(side,), rtol=1e-8, atol=1e-10)
        assert path.success
        taken.append(path.t[-1] - t)
        t, state, side = path.t[-1], (path.y[0, -1], RESTITUTION * path.y[1, -1]), -side
    return taken


print("scipy", scipy.__version__)
angles = np.random.default_rng(1).uniform(0.2, 0.9, STARTS)
for method in ("RK45", "DOP853", "Radau"):
    plain, falling = (np.array([lengths(event, angle, method) for angle in angles]) for event in (upright, landing))
    stuck = (plain[:, 1:] < 1e-12).any(axis=1).mean()
    print(f"{method}: {stuck:.2f} of the blocks stop at an impact; with a direction {(falling < 1e-12).mean():.2f}")
    assert stuck > 0.8
    assert (falling > 0.1).all()
PYTHON
