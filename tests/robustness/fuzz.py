"""What all fuzzed tests share: how examples are run, values that nobody should give, and texts and scenes made of them.

Every property is held against a few examples in the suite and against many more in the slow part (`sizes`). Examples
are derandomized: they follow from the sources, not from chance. One that takes longer than `LONGEST` fails, and one
that never ends is ended by pytest (faulthandler_timeout).
"""

import decimal
import fractions
import math
import re
import time

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from fpk_rocking import (
    BandNoise,
    Block,
    Dimensions,
    Harmonic,
    NoNoise,
    Overturning,
    Pulse,
    Record,
    Scene,
    Start,
    WhiteNoise,
)
from fpk_rocking.envelopes import Exponential, Table, Trapezoid
from fpk_rocking.physics.forcing.pulse import SHAPES

LONGEST = 20.0
"""Seconds of all threads together; a machine that pauses does not count."""


def sizes(few, many):
    """Parametrize a test by the number of its examples."""
    slow = pytest.param(many, marks=pytest.mark.slow, id="many")
    return pytest.mark.parametrize("examples", [pytest.param(few, id="few"), slow])


def hold(examples, claim, **strategies):
    """Hold a claim, a function of what the strategies make, against a number of examples."""
    rules = settings(
        max_examples=examples,
        derandomize=True,
        database=None,
        deadline=None,
        suppress_health_check=list(HealthCheck),
        print_blob=False,
    )

    def example(values):
        # A first call may compile; what is too long is so twice.
        for _ in range(2):
            began = time.process_time()
            claim(**values)
            if time.process_time() - began < LONGEST:
                return
        raise AssertionError("too long")

    rules(given(st.fixed_dictionaries(strategies))(example))()


def refused(call, *names):
    """Return whether a call is refused; if so, the message must begin with one of the names, and say what was got."""
    try:
        call()
    except (TypeError, ValueError) as error:
        message = str(error)
        assert type(error) in {TypeError, ValueError}, message
        accepted_names = "|".join(re.escape(name) + (r"\w*" if name.endswith(".") else "") for name in names)
        named = re.match(rf"({accepted_names})(\[(\d|'.*')\])*[:, ]", message)
        assert named, f"{message!r} does not begin with one of {names}"
        assert re.search(r": got |: missing|: unknown|, accepted: ", message), message
        return True
    return False


class Odd:
    """An object that is nothing in particular."""

    def __repr__(self):
        return "Odd()"


NOT_FINITE = st.sampled_from([math.nan, math.inf, -math.inf, 10**400, -(10**400)])
NOT_NUMBERS = st.one_of(
    st.none(),
    st.booleans(),
    st.text(max_size=8),
    st.binary(max_size=4),
    st.lists(st.floats(), max_size=3),
    st.tuples(st.integers()),
    st.dictionaries(st.text(max_size=2), st.integers(), max_size=2),
    st.complex_numbers(),
    st.builds(Odd),
    st.sampled_from([decimal.Decimal("0.5"), np.array(0.5), np.array([0.5]), np.bool_(True), np.datetime64("2020")]),
    st.just(int),
)
"""What no parameter takes that wants a number."""

NOT_COUNTS = st.one_of(
    NOT_NUMBERS, NOT_FINITE.filter(lambda x: x != 10**400), st.floats(), st.integers(max_value=0),
    st.sampled_from([np.float64(2.0), fractions.Fraction(2), np.int64(-3)]),
)  # fmt: skip
"""What no parameter takes that wants a whole number of 1 or more."""

NUMBERS = st.one_of(
    st.floats(),
    st.integers(-3, 12),
    st.floats(0.0, 1.0),
    st.floats(-20.0, 20.0),
    st.sampled_from([0.0, -0.0, 5e-324, 1e-308, 1e308, -1e308, math.pi / 2, 1.0]),
    st.sampled_from([np.float32(0.3), fractions.Fraction(1, 3)]),
)
ANYTHING = st.one_of(NUMBERS, NOT_FINITE, NOT_NUMBERS, st.lists(NUMBERS, min_size=2, max_size=2))
PULSES = st.sampled_from(sorted(SHAPES))


def logarithmic(low, high):
    """Numbers between two powers of ten, every power as likely."""
    return st.floats(low, high).map(lambda power: 10.0**power)


SEVERAL = st.lists(st.floats(0.0, 3.0) | NUMBERS, max_size=4)

TABLES = {"band": "noise", "white": "noise", "pulse": "forcing", "record": "forcing"} | dict.fromkeys(
    ("trapezoid", "exponential", "table"), "noise.envelope"
)
"""Tables of a scene file in which parts of these names stand, where they are not called so."""

PARTS = {
    "block": (Block, {"restitution": ANYTHING, "dimensions": st.one_of(st.none(), ANYTHING)}),
    "block.dimensions": (Dimensions, {"width": ANYTHING, "height": ANYTHING, "gravity": ANYTHING}),
    "forcing": (Harmonic, {"amplitude": ANYTHING, "frequency": ANYTHING, "phase": ANYTHING}),
    "band": (BandNoise, {"variance": ANYTHING, "band": ANYTHING, "harmonics": ANYTHING}),
    "white": (WhiteNoise, {"diffusion": ANYTHING}),
    "start": (
        Start,
        {"angle": ANYTHING, "velocity": ANYTHING, "covariance": st.one_of(ANYTHING, st.lists(ANYTHING, max_size=3))},
    ),
    "overturning": (Overturning, {"angle": ANYTHING}),
    "pulse": (
        Pulse,
        {"shape": ANYTHING | PULSES, "amplitude": ANYTHING, "frequency": ANYTHING, "cycles": ANYTHING},
    ),
    "record": (
        Record,
        {"interval": ANYTHING, "samples": ANYTHING | st.lists(NUMBERS, max_size=4),
         "units": ANYTHING | st.sampled_from(["g", "m/s2", "cm/s2"]), "scale": ANYTHING},
    ),
    "trapezoid": (Trapezoid, {"rise": ANYTHING, "hold": ANYTHING, "decay": ANYTHING}),
    "exponential": (Exponential, {"peak": ANYTHING}),
    "table": (Table, {"times": ANYTHING | SEVERAL, "values": ANYTHING | SEVERAL}),
}  # fmt: skip
"""Class and strategies of the parameters of every part of a scene."""

GOOD = {
    "block": {"restitution": 0.5},
    "block.dimensions": {"width": 0.4, "height": 1.7},
    "forcing": {"amplitude": 4.6, "frequency": 2.7},
    "band": {"variance": 0.04, "band": (0.0, 10.0), "harmonics": 3},
    "white": {"diffusion": 0.006},
    "start": {},
    "overturning": {},
    "pulse": {"shape": "one-sine", "amplitude": 2.0, "frequency": 3.0},
    "record": {"interval": 0.01, "samples": (0.1, -0.3, 0.2), "units": "g"},
    "trapezoid": {"rise": 1.0, "hold": 2.0, "decay": 0.5},
    "exponential": {"peak": 2.0},
    "table": {"times": (0.0, 1.0), "values": (0.5, 1.0)},
}


def sound_part(part):
    """Return a part in which nothing is wrong."""
    return PARTS[part][0](**GOOD[part])


def scene(**parts):
    """Return a scene in which nothing is wrong, but for what is given."""
    return Scene(**{"block": Block(0.5), "forcing": Harmonic(4.6, 2.7, math.pi), "noise": NoNoise()} | parts)


@st.composite
def extreme_scenes(draw, noises):
    """Scenes within the range of the engines, to its ends: every value of any size that `ranges` allows.

    `noises` is a strategy for the noise. Some starts are next to the cut-off, some restitutions next to 0 and 1.
    """
    restitution = draw(st.one_of(st.sampled_from([0.1631, 1.0]), st.floats(0.164, 1.0), _near_one()))
    noise = draw(noises)
    if noise.kind != "white":
        restitution = draw(st.one_of(st.sampled_from([0.0, restitution]), st.floats(0.0, 1.0), logarithmic(-12, -1)))
    amplitude = draw(st.one_of(st.sampled_from([0.0, 1.0]), _near_one(), st.floats(0.0, 10.0), logarithmic(-12, 4)))
    frequency = draw(st.one_of(logarithmic(-1, 1), logarithmic(-3, 4)))
    if noise.kind == "band":
        low, width = draw(st.one_of(st.just(0.0), logarithmic(-3, 0))), draw(logarithmic(-6, 3))
        noise = BandNoise(noise.variance, (low, low + min(width, 1e4 * frequency)), noise.harmonics)
    cutoff = draw(st.one_of(st.just(math.pi / 2), logarithmic(-2, 4)))
    angle = cutoff * draw(st.sampled_from([0.0, 0.0, 1e-20, 0.5, -0.9, 1.0 - 1e-15, 1e-15 - 1.0]))
    velocity = draw(st.sampled_from([-1.0, 0.0, 1.0])) * draw(st.one_of(st.floats(0.1, 5.0), logarithmic(-30, 4)))
    spread = draw(st.one_of(st.none(), st.none(), st.tuples(logarithmic(-24, 2), logarithmic(-24, 2))))
    covariance = spread and ((spread[0], 0.0), (0.0, spread[1]))
    phase = draw(st.floats(-7.0, 7.0))
    return Scene(
        Block(restitution), Harmonic(amplitude, frequency, phase), noise, Start(angle, velocity, covariance),
        Overturning(cutoff),
    )  # fmt: skip


def _near_one():
    return logarithmic(-12, -1).map(lambda gap: 1.0 - gap)


BAND_NOISES = st.builds(
    BandNoise,
    st.one_of(st.just(0.0), st.floats(0.0, 1.0), logarithmic(-12, 6)),
    st.just((0.0, 1.0)),
    st.sampled_from([1, 2, 7, 30, 100]),
)
WHITE_NOISES = st.builds(WhiteNoise, st.one_of(logarithmic(-4, 0), logarithmic(-12, 4)))
