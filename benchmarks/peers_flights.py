"""Band noise in diffrax: a solve with events for each flight, on the very realizations of the exact engine."""

import functools

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
import optimistix
from peers_problems import BAND
from report import medians, table

from fpk_rocking.physics.noise import band
from montecarlo import simulate
from montecarlo.engines import band_noise, rk4
from montecarlo.engines.random import open_stream, stream_keys

CYCLES, PATHS, TOLS = (1, 4), 200, (1e-5, 1e-8)
TINY = 1e-14
MOST_FLIGHTS = 1000

E, CUTOFF, PERIOD = BAND.block.restitution, BAND.overturning.angle, BAND.period


def realizations(count, seed=1):
    """Return frequencies, phases and amplitudes of the forcing of realizations (count, 3, harmonics + 1)."""
    parameters, rows = rk4.parameters_of(BAND, 8), []
    omega, phase, amplitude = BAND.forcing.frequency, BAND.forcing.phase, BAND.forcing.amplitude
    for number in range(count):
        drawn = band.allocate_realization(parameters.band.harmonics, 1)
        stream, size = open_stream(stream_keys(seed), number), parameters.band.harmonics
        band_noise.draw_start_and_noise(stream, parameters.start, parameters.band, drawn)
        ratios, phases, weights = (row[:size] for row in (drawn.ratios, drawn.phases, drawn.weights))
        rows.append(
            [np.append(omega * ratios, omega), np.append(2 * np.pi * phases, phase), np.append(weights, -amplitude)]
        )
    return np.array(rows)


def force(time, harmonics):
    """Sum of the harmonics."""
    frequencies, phases, weights = harmonics
    return jnp.sum(weights * jnp.cos(frequencies * time + phases))


def field(time, state, args):
    """Rate of change of angle and velocity."""
    (x, v), (side, harmonics) = state, args
    return v, x - side + force(time, harmonics)


def to_impact(t, y, args, **_):  # noqa: ARG001
    """Distance from x = 0."""
    return y[0] * args[0]


def to_overturning(t, y, args, **_):  # noqa: ARG001
    """Distance from the cut-off, negative inside."""
    return y[0] * args[0] - CUTOFF


@functools.partial(jax.jit, static_argnames=("cycles", "tol"))
def follow(harmonics, cycles, tol):
    """Return angle, velocity and whether overturned, (paths,) each, after whole cycles."""
    event = diffrax.Event([to_impact, to_overturning], optimistix.Newton(1e-10, 1e-10), [False, True])
    until = cycles * PERIOD

    def fly(carry, rows):
        time, (x, v), side, _, count = carry
        # Finished paths wait for the others of the batch; whatever they would do is thrown away.
        solution = diffrax.diffeqsolve(
            diffrax.ODETerm(field), diffrax.Tsit5(), time, until, None, (x, v), (side, rows),
            stepsize_controller=diffrax.PIDController(tol, tol), event=event, max_steps=10_000, throw=False,
        )  # fmt: skip
        (x,), (v,) = solution.ys
        hit, over = solution.event_mask
        after_impact = jnp.where(hit, -side * TINY, x), jnp.where(hit, E * v, v)
        return solution.ts[-1], after_impact, jnp.where(hit, -side, side), over, count + 1

    def path(rows):
        side = jnp.sign(force(0.0, rows))
        carry = 0.0, (side * TINY, 0.0), side, False, 0
        _, state, _, over, _ = jax.lax.while_loop(
            lambda c: (c[0] < until) & ~c[3] & (c[4] < MOST_FLIGHTS), lambda c: fly(c, rows), carry
        )
        return *state, over

    return jax.vmap(path)(harmonics)


def rows():
    """Return the lines of the table, and the times over the engine's by cycles and tolerance."""
    with jax.enable_x64(True):
        harmonics, lines, ratios = jnp.asarray(realizations(PATHS)), [], {}
        for cycles in CYCLES:
            solvers = {tol: lambda tol=tol, c=cycles: jax.block_until_ready(follow(harmonics, c, tol)) for tol in TOLS}
            solvers["exact"] = lambda c=cycles: simulate(BAND, cycles=c, realizations=100 * PATHS, method="exact")
            seconds = medians(solvers, rounds=3)
            unit = seconds["exact"] / (100 * PATHS)
            exact = simulate(BAND, cycles=cycles, realizations=PATHS, seed=1, method="exact")
            for tol in TOLS:
                x, v, over = map(np.asarray, follow(harmonics, cycles, tol))
                apart = np.hypot(x - exact.angle[:, -1], v - exact.velocity[:, -1])[~over]
                differ = int((over != np.isnan(exact.angle[:, -1])).sum())
                ratios[cycles, tol] = seconds[tol] / PATHS / unit
                lines.append([cycles, f"{tol:g}", f"{np.nanmedian(apart):.0e}", differ,
                              f"{1e6 * seconds[tol] / PATHS:,.0f}", f"{1e6 * unit:.1f}",
                              f"{ratios[cycles, tol]:,.0f}"])  # fmt: skip
    return lines, ratios


def section():
    """Return the body of the section, and the ratio at the finest tolerance after most cycles."""
    lines, ratios = rows()
    head = ["cycles", "tolerance", "median error", "overturned otherwise", "diffrax, μs", "exact, μs", "ratio"]
    return (
        f"""Main scene, {PATHS} realizations of 100 harmonics, the same ones for both. In diffrax the method is `Tsit5`
with `PIDController` and `Event` (impact and cut-off, by Newton's method), with a solve for each flight in a loop,
`vmap` over realizations, 64 bits. A batch waits for its slowest path. The error is the distance in angle and velocity
from the exact engine. "Overturned otherwise" counts the realizations for which the two disagree about overturning.
Times are for one realization.

{table(head, lines)}
""",
        ratios[CYCLES[-1], TOLS[-1]],
    )
