"""Blocks as they are under white noise in small steps: leapfrog with impacts between them, and one extrapolation."""

import numpy as np


def survival(block, cutoff, forcing, diffusion, start, cycles, paths, steps, seed):
    """Return survival (2, cycles) in steps of T/n and of twice that, along the same realizations.

    Parameters
    ----------
    block : tuple
        Critical angle α > 0 and restitution.
    cutoff : float
    forcing : tuple
        A, Ω and Ψ of f = -A cos(Ωτ + Ψ).
    diffusion : float
    start : tuple
        Angle and velocity; from rest a block leaves to the side of f(0).
    cycles, paths, steps, seed : int
        `steps`, n, is even.
    """
    (alpha, restitution), (amplitude, frequency, phase) = block, forcing
    rng, h = np.random.default_rng(seed), 2.0 * np.pi / (frequency * steps)

    def push(x, side, time):
        angle = alpha * (1.0 - side * x)
        return -side * np.sin(angle) / alpha - amplitude * np.cos(frequency * time + phase) * np.cos(angle)

    def move(state, time, span, first, second):
        """Take states through a step, by its increment of W and the first moment of it."""
        x, v, side, alive, a = state
        x_mid = x + 0.5 * span * v
        noise = np.sqrt(2.0 * diffusion) * np.cos(alpha * (1.0 - side * x_mid))
        x_next = x + span * (v + 0.5 * span * a) + noise * second
        a_next = push(x_next, side, time + span)
        v_next = v + 0.5 * span * (a + a_next) + noise * first
        hit = np.flatnonzero(x_next * side < 0.0)
        part = x[hit] / (x[hit] - x_next[hit])
        speed, left = restitution * (v[hit] + part * (v_next[hit] - v[hit])), (1.0 - part) * span
        side[hit] = -side[hit]
        x_next[hit] = left * speed
        v_next[hit] = speed + left * push(0.0, side[hit], time + span)
        a_next[hit] = push(x_next[hit], side[hit], time + span)
        alive &= np.abs(x_next) < cutoff
        # Those that have overturned wait where they do no harm.
        return np.where(alive, x_next, 0.5 * side), np.where(alive, v_next, 0.0), side, alive, a_next

    def begin():
        x, v = (np.full(paths, float(value)) for value in start)
        side = np.sign(np.where(x != 0.0, x, np.where(v != 0.0, v, -amplitude * np.cos(phase))))
        return x, v, side, np.ones(paths, dtype=bool), push(x, side, 0.0)

    fine, coarse, shares = begin(), begin(), []
    for k in range(0, cycles * steps, 2):
        increments = np.sqrt(h) * rng.standard_normal((2, paths))
        moments = 0.5 * h * increments + h**1.5 / np.sqrt(12.0) * rng.standard_normal((2, paths))
        fine = move(fine, k * h, h, increments[0], moments[0])
        fine = move(fine, (k + 1) * h, h, increments[1], moments[1])
        coarse = move(coarse, k * h, 2.0 * h, increments.sum(axis=0), moments.sum(axis=0) + h * increments[0])
        if (k + 2) % steps == 0:
            shares.append((fine[3].mean(), coarse[3].mean()))
    return np.array(shares).T
