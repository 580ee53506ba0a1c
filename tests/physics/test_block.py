"""The speed at zero angle that just reaches the saddle, against the integral of the acceleration."""

import math

import numpy as np
import pytest
from scipy.integrate import quad

from fpk_rocking.physics.motion.equation import largest_correction, saddle_speed


@pytest.mark.parametrize("force", [0.0, 0.4, 0.9])
def test_the_speed_that_reaches_the_saddle_is_the_work_up_to_it(force):
    assert [saddle_speed(force, slender) for slender in (None, 0.0)] == pytest.approx([1.0 - force] * 2)
    assert saddle_speed(1.0, None) == saddle_speed(1.2, None) == 0.0
    for alpha in (1e-3, 0.3, 1.0):

        def pull(u, alpha=alpha):
            phi = alpha * (1.0 - u)
            return math.sin(phi) / alpha - force * math.cos(phi)

        work = quad(pull, 0.0, 1.0 - math.atan(alpha * force) / alpha, epsabs=0.0, epsrel=1e-12)[0]
        assert saddle_speed(force, alpha) == pytest.approx(math.sqrt(2.0 * work), rel=1e-8)
    assert saddle_speed(0.0, 0.8) == pytest.approx(2.0 * math.sin(0.4) / 0.8)


@pytest.mark.parametrize("force", [0.0, 0.7, 3.0])
def test_the_bound_of_what_an_exact_block_has_beyond_a_slender_one_is_reached(force):
    """At contact and at twice the critical angle, of all angles between."""
    alpha, y = 0.6, np.linspace(-1.0, 1.0, 201)
    beyond = [y - np.sin(alpha * y) / alpha - side * force * (1.0 - np.cos(alpha * y)) for side in (-1, 1)]
    assert largest_correction(force, alpha) == pytest.approx(np.abs(beyond).max(), rel=1e-12)
    assert largest_correction(force, None) == largest_correction(force, 0.0) == 0.0
