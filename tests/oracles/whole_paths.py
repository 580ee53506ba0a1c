"""A block as it is, followed by scipy's DOP853 from impact to impact; it must not come to rest."""

import math

import numpy as np
from scipy.integrate import solve_ivp


def followed(alpha, restitution, cutoff, force, start, times):
    """Return states (n, 2) at ascending times under a force of time, nan after overturning.

    `alpha` is the critical angle; `start` is angle and velocity, and from (0, 0) a block leaves to the side of the
    force.
    """
    (x, v), t, states = start, 0.0, np.full((len(times), 2), math.nan)
    side = math.copysign(1.0, x or v or force(0.0))

    def fall(time, y):
        angle = alpha * (1.0 - side * y[0])
        return y[1], -side * math.sin(angle) / alpha + force(time) * math.cos(angle)

    def land(time, y):
        # A flight begins at x = 0 and leaves it at once.
        return side * y[0] if time > t else 1.0

    def overturn(_, y):
        return cutoff - side * y[0]

    for event in (land, overturn):
        event.terminal, event.direction = True, -1
    for row, end in enumerate(times):
        while t < end:
            first = min(end - t, 1e-3)
            options = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-13, "max_step": 0.05, "first_step": first}
            path = solve_ivp(fall, (t, end), (x, v), events=(land, overturn), **options)
            t, (x, v) = path.t[-1], path.y[:, -1]
            if path.t_events[1].size:
                return states
            if path.t_events[0].size:
                x, v, side = 0.0, restitution * v, -side
        states[row] = x, v
    return states
