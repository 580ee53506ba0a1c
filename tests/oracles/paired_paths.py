"""White-noise paths of an exact and a slender block under the same noise: what the geometry changes, to a small error.

Drift, kick, drift: gravity, base and noise act half way through a step, and between these moments a block moves on
straight lines, so that impacts are met exactly. Next to zero angle a step is divided. Nothing of the project is used
but its way to compile. The error of either survival is of first order in the step near impacts; that of their
difference is smaller by the difference's size.
"""

import math

import numpy as np

from fpk_rocking.base.jit import kernel

PARTS = 8


@kernel
def _pushed(x, force, alpha):
    """Acceleration, and the part of the base's that turns the block."""
    side = 1.0 if x > 0.0 else -1.0
    if alpha == 0.0:
        return x - side + force, 1.0
    phi = alpha * (1.0 - side * x)
    part = math.cos(phi)
    return force * part - side * math.sin(phi) / alpha, part


@kernel
def _drifted(x, v, time, restitution):
    """Move on a straight line through an impact."""
    new = x + time * v
    if x * new < 0.0:
        left = time + x / v
        return restitution * v * left, restitution * v
    return new, v


@kernel
def _stepped(x, v, force, noise, time, alpha, restitution):
    x, v = _drifted(x, v, 0.5 * time, restitution)
    pull, part = _pushed(x, force, alpha)
    v += pull * time + part * noise
    return _drifted(x, v, 0.5 * time, restitution)


@kernel
def _followed(x, v, forces, noise, time, alpha, restitution, scale, draws):
    """Carry a block through a step with the force at its parts' middles."""
    if abs(x) > time * (abs(v) + 2.0 * scale):
        return _stepped(x, v, forces[PARTS], noise, time, alpha, restitution)
    part = time / PARTS
    own = draws.standard_normal(PARTS)
    own = (own - own.mean()) * scale / math.sqrt(PARTS) + noise / PARTS
    for k in range(PARTS):
        x, v = _stepped(x, v, forces[k], own[k], part, alpha, restitution)
    return x, v


@kernel
def _walk(paths, draws, start, forces, time, scales, alphas, restitution, cutoff, rows):
    """Survivors (2, rows) of both blocks, and paths (rows,) on which they differ."""
    steps = len(forces)
    standing, differ = np.zeros((2, rows), np.int64), np.zeros(rows, np.int64)
    for _ in range(paths):
        states, stands = np.zeros((2, 2)), np.ones(2, np.bool_)
        states[:] = start
        for n in range(rows * steps if forces.shape[0] else 0):
            k = n % steps
            noise = scales[n] * draws.standard_normal()
            for b in range(2):
                if stands[b]:
                    x, v = _followed(
                        states[b, 0], states[b, 1], forces[k], noise, time, alphas[b], restitution, scales[n], draws
                    )
                    states[b, 0], states[b, 1] = x, v
                    stands[b] = abs(x) < cutoff
            if k == steps - 1:
                for b in range(2):
                    standing[b, n // steps] += stands[b]
                differ[n // steps] += stands[0] != stands[1]
            if not (stands[0] or stands[1]):
                break
    return standing, differ


def paired_survival(scene, cycles, paths, seed, longest=0.02):
    """Survival of a scene with white noise after each cycle, exact less slender.

    Parameters
    ----------
    scene : Scene
        That repeats, with white noise and a critical angle.
    cycles, paths, seed : int
    longest : float
        Step far from impacts.

    Returns
    -------
    exact, slender : ndarray, shape (cycles + 1,)
        Survival.
    error : ndarray, shape (cycles + 1,)
        Standard error of the difference.
    """
    steps = math.ceil(scene.period / longest)
    time = scene.period / steps
    middles = time * (np.arange(PARTS) + 0.5) / PARTS
    forces = np.array([[scene.forcing.value(k * time + t) for t in (*middles, 0.5 * time)] for k in range(steps)])
    scales = np.full(cycles * steps, math.sqrt(2.0 * scene.noise.diffusion * time))
    alphas = np.array([scene.block.critical_angle, 0.0])
    start = np.array([scene.start.angle, scene.start.velocity])
    standing, differ = _walk(
        paths,
        np.random.default_rng(seed),
        start,
        forces,
        time,
        scales,
        alphas,
        scene.block.restitution,
        scene.overturning.angle,
        cycles,
    )
    exact, slender = np.concatenate([np.ones((2, 1)), standing / paths], axis=1)
    part = np.concatenate([[0.0], differ / paths])
    return exact, slender, np.sqrt(np.maximum(part - (exact - slender) ** 2, 0.0) / paths)
