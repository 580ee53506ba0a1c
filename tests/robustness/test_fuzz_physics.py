"""Scenes to the ends of the engines' range: finite, consistent and in time, or refused by name.

What a result must be whatever the scene: every state of a standing block finite and within the cut-off, overturning at
a time within the run and never undone, survival from 1 down. A density may miss that by its own error estimate.
"""

import math
import warnings

import fuzz
import numpy as np
import pytest
from hypothesis import strategies as st

from fpk_rocking import solve_fpk
from montecarlo import histories, simulate, split, tally
from montecarlo.engines import exact_slender

RANGE = ("forcing.", "noise.", "start.", "overturning.", "block.")
FEW = {"cycles": 2, "realizations": 3}
BAND = fuzz.extreme_scenes(fuzz.BAND_NOISES)
WHITE = fuzz.extreme_scenes(fuzz.WHITE_NOISES)
QUIET = fuzz.extreme_scenes(st.just(fuzz.NoNoise()))
METHODS = {"exact": BAND | QUIET, "rk4": BAND | QUIET, "white": WHITE}


def check(ensemble):
    """Assert what holds for every ensemble."""
    cutoff, period, cycles = ensemble.scene.overturning.angle, ensemble.scene.period, ensemble.cycles
    standing = np.isfinite(ensemble.angle)
    assert np.array_equal(standing, np.isfinite(ensemble.velocity))
    assert np.all(standing[:, :-1] >= standing[:, 1:])
    assert np.all(np.abs(ensemble.angle[standing]) <= cutoff * (1.0 + 1e-12))
    overturned = ensemble.overturn_side != 0
    assert np.array_equal(overturned, np.isfinite(ensemble.overturn_time))
    assert np.all(standing[~overturned])
    assert np.all(ensemble.overturn_time[overturned] <= cycles * period * (1.0 + 1e-9))
    assert np.all(ensemble.overturn_time[overturned] >= 0.0)
    assert ensemble.survival[0] <= 1.0
    assert ensemble.survival[-1] >= 0.0
    assert np.all(np.diff(ensemble.survival) <= 0.0)
    assert np.allclose(ensemble.survival + ensemble.overturned.sum(axis=1), 1.0, rtol=0.0, atol=1e-15)


@pytest.mark.parametrize("method", METHODS)
@fuzz.sizes(20, 1200)
def test_extreme_scenes_are_simulated_consistently_or_refused(examples, method):
    simulate(fuzz.scene(noise=fuzz.WhiteNoise(0.006) if method == "white" else fuzz.NoNoise()), method=method, **FEW)

    def claim(scene, steps):
        ensembles, asked = [], FEW | {"method": method, "steps_per_cycle": steps}
        if not fuzz.refused(lambda: ensembles.append(simulate(scene, **asked)), *RANGE):
            check(ensembles[0])

    fuzz.hold(examples, claim, scene=METHODS[method], steps=st.sampled_from([8, 200]))


def test_a_cycle_too_long_to_look_ahead_is_refused():
    scene = fuzz.scene(noise=fuzz.WhiteNoise(0.006), forcing=fuzz.Harmonic(4.6, 0.01))
    with pytest.raises(ValueError, match=r"forcing.frequency: got 0\.01, accepted: a cycle of 2000 intervals or fewer"):
        split(scene, cycles=1, walkers=10, repeats=2)


def test_a_state_that_is_no_number_raises(monkeypatch):
    """Whatever an engine did wrong, a missing state does not pass as an overturned block."""
    scene = fuzz.scene(noise=fuzz.BandNoise(0.01, (0.0, 9.0), 10))

    def spoil(keys, first, cycle, parameters, angle, velocity, *others):
        computed(keys, first, cycle, parameters, angle, velocity, *others)
        if first <= 1 < first + len(velocity):
            velocity[1 - first, 1] = math.nan

    computed = exact_slender.ENGINE.simulate
    monkeypatch.setitem(vars(exact_slender.ENGINE), "simulate", spoil)
    for call in (simulate, tally, histories):
        with pytest.raises(FloatingPointError, match=r"realization 1 of method 'exact', seed 1: \d+ finite states"):
            call(scene, **FEW)


@st.composite
def solvable_scenes(draw):
    """Scenes with white noise about those that the solver is for, hard ones among them, none that takes minutes."""
    scene = draw(WHITE)
    return scene.varied(
        forcing={"frequency": draw(fuzz.logarithmic(-0.5, 1)), "amplitude": draw(st.floats(1.2, 20.0))},
        noise={"diffusion": draw(fuzz.logarithmic(-3, 0))},
        start=fuzz.Start(draw(st.sampled_from([0.0, 0.3, -0.49])), draw(st.sampled_from([0.0, 0.0, 0.7, -3.0]))),
        overturning={"angle": draw(st.floats(0.5, 3.0))},
    )


@pytest.mark.slow
def test_extreme_scenes_are_solved_consistently_or_refused():
    def claim(scene):
        densities = []
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", "not within the tolerance", RuntimeWarning)
            if fuzz.refused(lambda: densities.append(solve_fpk(scene, cycles=2, tol=1e-2)), *RANGE, "scene", "cycles"):
                return
        result, slack = densities[0], 2.0 * densities[0].error_estimate + 1e-6
        assert result.mass_defect < 1e-11
        assert result.negative_mass <= 0.05
        assert result.survival[0] == 1.0
        assert np.all(np.diff(result.survival) <= slack)
        assert -slack <= result.survival.min() <= result.survival.max() <= 1.0 + slack
        assert np.all(np.diff(result.overturned, axis=0) >= -slack)

    fuzz.hold(40, claim, scene=solvable_scenes())


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"forcing": {"amplitude": 2e4}}, r"forcing\.amplitude: got 20000\.0, .* value from 0 to 10000 "),
        (
            {"forcing": {"frequency": 1e-4}},
            r"forcing\.frequency: got 0\.0001, .* an absolute value from 0\.001 to 10000 ",
        ),
        ({"forcing": {"phase": 1e16}}, r"forcing\.phase: got 1e\+16"),
        ({"noise": fuzz.WhiteNoise(1e-13)}, r"noise\.diffusion: got 1e-13, .* value from 1e-12 to 10000, or 0"),
        ({"noise": fuzz.BandNoise(1e7, (0, 1), 3)}, r"noise\.variance: got 1"),
        ({"noise": fuzz.BandNoise(0.04, (0, 2e4), 3)}, r"noise\.band: got \(0\.0, 20000\.0\)"),
        ({"noise": fuzz.BandNoise(0.04, (0, 9e3), 3), "forcing": {"frequency": 0.01}}, r"noise\.band: got"),
        ({"noise": fuzz.BandNoise(0.04, (0, 1), 10**6)}, r"noise\.harmonics: got 1000000"),
        ({"start": {"velocity": -1e17}}, r"start\.velocity: got -1e\+17"),
        ({"start": {"angle": 1e-120}}, r"start\.angle: got 1e-120"),
        ({"start": fuzz.Start(0.0, 0.0, ((1e-60, 0.0), (0.0, 1.0)))}, r"start\.covariance: got"),
        ({"overturning": {"angle": 1e-3}}, r"overturning\.angle: got 0\.001"),
        ({"block": {"restitution": 1.0}, "start": {"velocity": 1e-9}}, r"start\.velocity: got 1e-09, .* without end"),
    ],
)
def test_what_no_engine_can_carry_is_refused_by_all(changed, message):
    scene = fuzz.scene().varied(**changed)
    for call in (simulate, tally, histories):
        with pytest.raises(ValueError, match=message):
            call(scene, **FEW)
    if scene.noise.kind != "band" and scene.block.restitution < 1.0:
        with pytest.raises(ValueError, match=message):
            solve_fpk(scene.white_equivalent(), cycles=1, tol=1e-2)
