"""A slender block under band noise with an envelope, η(τ) g(τ); method "exact".

As `exact_slender`, but the state is (angle, velocity): homogeneous flight plus the tabulated response to noise and
forcing within the interval. The envelope g has kinks, so that the product is not band-limited, and the particular
solution starts from zero in every interval. All that concerns events and rest is `exact.PIECEWISE`.
"""

import math
from typing import NamedTuple

import numpy as np

from fpk_rocking.base.jit import kernel
from fpk_rocking.physics.motion import TERMS
from fpk_rocking.physics.motion.flight import homogeneous_flight
from fpk_rocking.physics.motion.slender import forced_response, particular_at, particular_series
from fpk_rocking.physics.noise.band import WIDTH
from montecarlo.engines.band_noise import CHUNK
from montecarlo.engines.engine import Engine
from montecarlo.engines.exact import PIECEWISE, has_envelope, in_closed_form, is_eventless, tables_of_scene


class Response(NamedTuple):
    """Angle and velocity that noise and forcing add to a homogeneous flight over an interval."""

    noise: np.ndarray  # (order, 2, WIDTH), by the interpolant's polynomials times powers of the time
    forcing: np.ndarray  # (m, 2)


def parameters_of(scene, _steps_per_cycle, times=None):
    tables = tables_of_scene(scene, times)
    half, polynomials, order = 0.5 * tables.grid.spacing, tables.polynomials[0], tables.envelope.strength.shape[1]

    def over_an_interval(particular):
        return np.stack(
            forced_response(*particular_at(particular, -half), *particular_at(particular, half), 2.0 * half)
        )

    powers = [np.pad(polynomials, ((0, 0), (k, 0)))[:, :TERMS] for k in range(order)]
    noise = np.stack([over_an_interval(particular_series(0.0, 0.0, power)) for power in powers])
    return tables._replace(flight=Response(noise, over_an_interval(tables.forced).T.copy()))


@kernel(fastmath={"contract"}, forceinline=True)
def _respond_to_force(x, v, side, j, k, parameters, workspace):
    """Return (angle, velocity) at the end of interval j without an event; k is its number in the chunk of samples."""
    h, samples, response = parameters.grid.spacing, workspace.samples.values, parameters.flight.noise
    strength = parameters.envelope.strength[parameters.envelope.first[j]]
    push, kick = parameters.flight.forcing[j, 0], parameters.flight.forcing[j, 1]
    for n in range(strength.size):
        a, b = 0.0, 0.0
        for i in range(WIDTH):
            a += response[n, 0, i] * samples[k + i]
            b += response[n, 1, i] * samples[k + i]
        push += strength[n] * a
        kick += strength[n] * b
    y, v = homogeneous_flight(x - side, v, math.cosh(h), math.sinh(h))
    return side + y + push, v + kick


@kernel(inline="always")
def _try_step(state, side, number, j, parameters, workspace):
    """Whether interval j surely has no event, and the state at its end; never with a kink of the envelope in it."""
    x, v = state
    if side == 0:
        return parameters.stays[j], state
    if parameters.envelope.first[j + 1] > parameters.envelope.first[j] + 1:
        return False, state
    end = _respond_to_force(x, v, side, j, number % CHUNK, parameters, workspace)
    return is_eventless(side * x, side * end[0], side, j, parameters), end


@kernel(fastmath={"contract"}, forceinline=True)
def _build_noise(number, _j, parameters, workspace):
    """Write the noise, without its envelope, to `workspace.noise` (TERMS,), by the time since the interval's middle."""
    k, samples, polynomials = number % CHUNK, workspace.samples.values, parameters.polynomials[0]
    for n in range(TERMS):
        value = 0.0
        for i in range(WIDTH):
            value += samples[k + i] * polynomials[i, n]
        workspace.noise[n] = value


ENGINE = Engine(
    takes=lambda scene: has_envelope(scene) and in_closed_form(scene),
    parameters_of=parameters_of,
    try_step=_try_step,
    build_force=_build_noise,
    **PIECEWISE,
)
