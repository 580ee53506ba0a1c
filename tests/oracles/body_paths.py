"""Bodies on two corners under noise in small steps, in metres and seconds: leapfrog with impacts between the steps."""

import math

import numpy as np

G = 9.80665


def overturned(lengths, fallen, base, noise, end, paths, steps, seed):
    """Return the shares (2,) of paths from rest that fall to the left and to the right.

    Parameters
    ----------
    lengths : tuple
        Height of the centre, its distances from the right and from the left corner, radius of gyration, metres.
    fallen : float
        Angle that counts as a fall, radians.
    base : callable
        Acceleration of the base at a time, m/s².
    noise : callable
        ``(rng, paths, step)``: a function that returns the impulses (paths,) of the random acceleration in the next
        step, m/s.
    end : float
        Seconds.
    paths, steps, seed : int
    """
    height, right, left, radius = lengths
    rng, step = np.random.default_rng(seed), end / steps
    next_impulses = noise(rng, paths, step)
    square = radius**2 + height**2
    kept = square - right * left
    to_left, to_right = kept / (square + left**2), kept / (square + right**2)

    def levers(side):
        """Distances (n,) of the corners of contact, with the signs of their sides, and inertia about them."""
        distance = np.where(side > 0, right, left)
        return side * distance, square + distance**2

    outcome, standing = np.zeros(paths, int), np.arange(paths)
    angle, rate, side = np.zeros(paths), np.zeros(paths), np.full(paths, 1 if base(0.0) > 0.0 else -1)
    lever, inertia = levers(side)
    for number in range(steps):
        moved = step * base((number + 0.5) * step) + next_impulses()[standing]
        angle += 0.5 * step * rate
        sine, cosine = np.sin(angle), np.cos(angle)
        x, y = height * sine - lever * cosine, height * cosine + lever * sine
        rate += (step * G * x + y * moved) / inertia
        angle += 0.5 * step * rate
        crossed = np.flatnonzero(side * angle < 0.0)
        e = np.where(side[crossed] > 0, to_left, to_right)
        angle[crossed] *= e
        rate[crossed] *= e
        side[crossed] *= -1
        lever[crossed], inertia[crossed] = levers(side[crossed])
        over = np.abs(angle) >= fallen
        if over.any():
            outcome[standing[over]] = side[over]
            standing, angle, rate, side, lever, inertia = (
                values[~over] for values in (standing, angle, rate, side, lever, inertia)
            )
    return np.mean(outcome == -1), np.mean(outcome == 1)


def white(intensity):
    """White noise of an intensity: the variance of its impulse over a second, m²/s³."""
    return lambda rng, paths, step: lambda: math.sqrt(intensity * step) * rng.standard_normal(paths)


def low_pass(variance, frequency, damping):
    """White noise through an oscillator from its stationary state: variance, (m/s²)², frequency, rad/s, damping."""

    def begin(rng, paths, step):
        states = math.sqrt(variance) * np.array([[1.0], [frequency]]) * rng.standard_normal((2, paths))
        spread = math.sqrt(4.0 * damping * frequency**3 * variance * step)

        def next_impulses():
            states[1] -= step * (frequency**2 * states[0] + 2.0 * damping * frequency * states[1])
            states[1] += spread * rng.standard_normal(paths)
            before = states[0].copy()
            states[0] += step * states[1]
            return 0.5 * step * (before + states[0])

        return next_impulses

    return begin
