"""A block without forcing, which is a ball bouncing on an inelastic wall under white noise, against published laws."""

import dataclasses
import math

import numpy as np
from peers_problems import fitted_exponent, persistence_exponent
from report import table

from fpk_rocking.scene import Block, Harmonic, Scene, WhiteNoise
from montecarlo import histories

SETTLED = 1.0
BALL = Scene(Block(0.5), Harmonic(0.0, 2.0 * math.pi / 16.0), WhiteNoise(0.01))
"""It bounces for a period of 16 and hardly ever overturns."""

BALL_PATHS, BALL_SAMPLES = 2000, 64
STRONG = Scene(Block(0.5), Harmonic(0.0, 2.0 * math.pi), WhiteNoise(0.5))
"""Noise that rules the impacts slower than 0.5, over a period of 1."""

STRONG_PATHS, STRONG_STEPS, STARTED = {0.3: 20_000, 0.5: 100_000, 0.7: 200_000}, 40_000, 0.2
SPEEDS, GROUPS = (0.004, 0.04), 10


def balances():
    """Return lines of the three balances of the bouncing ball: law, mean of each side, and their difference."""
    run = histories(BALL, cycles=1, realizations=BALL_PATHS, seed=1, samples_per_cycle=BALL_SAMPLES)
    restitution, diffusion = BALL.block.restitution, BALL.noise.diffusion
    late, duration = run.impact_time > SETTLED, BALL.period - SETTLED
    owner, speed = run.impact_realization[late], np.abs(run.impact_velocity[late])

    def moment(power):
        """Sum of a power of the impact speeds of each path, per unit of time (paths,)."""
        return np.bincount(owner, speed**power, minlength=BALL_PATHS) / duration

    after = run.time >= SETTLED
    angle, velocity = np.abs(run.angle[:, after]), run.velocity[:, after]
    sides = {
        "(1+e) n [w] = 1 - ⟨u⟩": ((1.0 + restitution) * moment(1), 1.0 - angle.mean(axis=1)),
        "(1-e²) n [w²] = 2 D": ((1.0 - restitution**2) * moment(2), np.full(BALL_PATHS, 2.0 * diffusion)),
        "⟨v²⟩ = ⟨u(1-u)⟩": ((velocity**2).mean(axis=1), (angle * (1.0 - angle)).mean(axis=1)),
    }
    lines = []
    for name, (left, right) in sides.items():
        error = (left - right).std() / math.sqrt(BALL_PATHS)
        lines.append([name, f"{left.mean():.4g}", f"{right.mean():.4g}", f"{(left - right).mean():+.1e} ± {error:.1e}"])
    return lines


def exponents():
    """Return lines of the exponents of slow impacts: restitution, published, measured."""
    lines = []
    for restitution, paths in STRONG_PATHS.items():
        scene = dataclasses.replace(STRONG, block=Block(restitution))
        run = histories(scene, cycles=1, realizations=paths, seed=1, samples_per_cycle=1, steps_per_cycle=STRONG_STEPS)
        late = run.impact_time > STARTED
        speed, group = np.abs(run.impact_velocity[late]), run.impact_realization[late] % GROUPS
        # Impacts of one path come in bursts, so the error is that of groups of paths.
        error = np.std([fitted_exponent(speed[group == k], *SPEEDS) for k in range(GROUPS)], ddof=1) / math.sqrt(GROUPS)
        published, fitted = persistence_exponent(restitution), fitted_exponent(speed, *SPEEDS)
        lines.append([restitution, f"{published:.3f}", f"{fitted:.3f} ± {error:.3f}"])
    return lines


def section():
    """Return the body of the section."""
    return f"""Path integration has been published for oscillators with an inelastic wall under white noise: the step
matrix method of Sykora, Kuske and Yurchenko (Nonlinear Dynamics 2024, doi 10.1007/s11071-024-09513-y) treats a linear
oscillator with one barrier and a nonlinear one between two. These have a restoring force towards a rest position,
damping, or walls on both sides. A scene has v' = x - sgn x + f and its wall in the middle. It **cannot state** them, so
there is no figure to compare. Their PathIntegrationMethod.jl is in Julia, has no Python package, and is not run here.

A scene can state the block without forcing. With u = |x| this is a ball that bounces on an inelastic wall under white
noise in the field 1 - u (Burkhardt and Kotsev 2006 treat a constant field). Two things are known of it.

**Balances** of momentum, energy and virial ([theory.md](theory.md), section 5) are exact as long as escape is
negligible. n is the number of impacts in a unit of time, and [w], [w²] are means over their speeds w. They are measured
with e = {BALL.block.restitution:g}, D = {BALL.noise.diffusion:g} on {BALL_PATHS:,} paths of the white-noise engine over
a time of {BALL.period - SETTLED:g}. How the error of the second one falls with the shortest step is in
[benchmarks.md](benchmarks.md#white-noise-paths-order-of-the-time-step).

{table(["", "left", "right", "difference"], balances())}

**Slow impacts**: the number of impacts at speeds near w goes like w^(λ-1), with the exponent λ of Cornell, Swift and
Bray (1998). It is fitted to speeds from {SPEEDS[0]:g} to {SPEEDS[1]:g}, under D = {STRONG.noise.diffusion:g} with
{STRONG_STEPS:,} steps a cycle, from τ = {STARTED:g} to 1.

{table(["e", "λ, published", "λ, measured"], exponents())}
"""
