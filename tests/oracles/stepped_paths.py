"""Blocks under filtered noise in small steps: the filter driven by pulses, and a leapfrog with impacts between them."""

import numpy as np
from scipy.linalg import expm, solve_continuous_lyapunov


def soil(frequency, damping, low_frequency, low_damping):
    """Drift, input and output of the Clough-Penzien filter: displacements and velocities of soil and second filter."""
    soil = [-(frequency**2), -2.0 * damping * frequency]
    second = [-(low_frequency**2), -2.0 * low_damping * low_frequency]
    ground = [-value for value in soil]
    drift = np.array([[0.0, 1.0, 0.0, 0.0], [*soil, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0], [*ground, *second]])
    return drift, np.array([0.0, 1.0, 0.0, 0.0]), drift[3]


def survival(matrices, variance, amplitude, frequency, restitution, cutoff, cycles, paths, steps, seed):
    """Return survival after each cycle (cycles,) of blocks that start at rest, under -A cos(Ω τ + π) and noise."""
    rng, (drift, source, output) = np.random.default_rng(seed), matrices
    covariance = solve_continuous_lyapunov(drift, -np.outer(source, source))
    output = output * np.sqrt(variance / (output @ covariance @ output))
    h = 2.0 * np.pi / (frequency * steps)
    phi, pulse = expm(drift * h), np.sqrt(h) * expm(drift * 0.5 * h) @ source
    states = np.linalg.cholesky(covariance) @ rng.standard_normal((len(drift), paths))
    x, v, alive, out = np.zeros(paths), np.zeros(paths), np.ones(paths, dtype=bool), []
    force = amplitude + output @ states
    side = np.sign(force)
    for k in range(1, cycles * steps + 1):
        states = phi @ states + np.outer(pulse, rng.standard_normal(paths))
        before, force = force, amplitude * np.cos(frequency * h * k) + output @ states
        a = x - side + before
        x_next = x + h * (v + 0.5 * h * a)
        v_next = v + 0.5 * h * (a + x_next - side + force)
        hit = x_next * side < 0.0
        part = np.where(hit, x / np.where(hit, x - x_next, 1.0), 0.0)
        speed, left = restitution * (v + part * (v_next - v)), (1.0 - part) * h
        side = np.where(hit, -side, side)
        x = np.where(hit, left * speed, x_next)
        v = np.where(hit, speed + left * (force - side), v_next)
        alive &= np.abs(x) < cutoff
        x, v = np.where(alive, x, 0.0), np.where(alive, v, 0.0)
        if k % steps == 0:
            out.append(alive.mean())
    return np.array(out)
