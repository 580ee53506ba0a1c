"""Scenes from anything: TOML text and Python values are taken, and come back equal, or are refused by name."""

import json
import math
import re

import fuzz
import pytest
from hypothesis import strategies as st

from fpk_rocking import Scene, Start

NAMES = ("block", "block.dimensions", "forcing", "noise", "noise.envelope", "start", "overturning")
TEXTS = [
    fuzz.scene().to_toml(),
    fuzz.scene(noise=fuzz.WhiteNoise(0.006), start=Start(0.3, -0.2, ((0.01, 0.002), (0.002, 0.02)))).to_toml(),
    fuzz.scene(block=fuzz.Block(0.7, fuzz.Dimensions(0.4, 1.7)), noise=fuzz.BandNoise(0.04, (0.0, 10.0), 9)).to_toml(),
    fuzz.scene(forcing=fuzz.sound_part("pulse"), noise=fuzz.WhiteNoise(0.01, fuzz.sound_part("trapezoid"))).to_toml(),
    fuzz.scene(
        block=fuzz.Block(dimensions=fuzz.Dimensions(0.4, 1.7)),
        forcing=fuzz.sound_part("record"),
        noise=fuzz.BandNoise(0.04, (0.0, 10.0), 9, envelope=fuzz.sound_part("table")),
    ).to_toml(),
]
VALUES = st.one_of(
    st.sampled_from(
        ["nan", "inf", "-inf", "1e999", "-1", "0", "0.0", "-0.0", "1e-320", "1e308", "true", '"0.5"', '""', "[]", "[1]"]
    ),
    st.sampled_from(
        ["[[0.01, 0], [0, 0.01]]", "[[1, 2], [2, 1]]", "[0, 1]", "[1, 0]", "[nan, 1]", "{}", "{a = 1}", "2020-01-01"]
    ),
    st.sampled_from(
        ["0x1F", "1_000", "9" * 400, "9" * 5000, "[" * 3000, "'''", "\\u0000", "١", "½", "0.5 # σ", '"\\uD800"', "1."]
    ),
    st.floats().map(repr),
    st.integers().map(repr),
    st.lists(st.floats(), max_size=3).map(repr),
    st.text(max_size=12).map(json.dumps),
    st.text(max_size=12),
)
KEYS = st.one_of(st.text("abcdefghijklmnop.-_", max_size=9), st.text(max_size=10), st.text(max_size=5).map(json.dumps))


def claim_text(text):
    """What `from_toml` takes it writes again, and reads as an equal scene; what it refuses it names."""
    try:
        scene = Scene.from_toml(text)
    except (TypeError, ValueError) as error:
        assert type(error) in {TypeError, ValueError}
        refusal = rf"(({'|'.join(NAMES)})(\.\w+)?(\[\d\])*: (got|missing)|.*: (unknown|missing), |not valid TOML: )"
        assert re.match(refusal, str(error), re.DOTALL), str(error)
    else:
        assert Scene.from_toml(scene.to_toml()) == scene
        assert 0.0 <= scene.block.restitution <= 1.0
        assert abs(scene.start.angle) < scene.overturning.angle < math.inf


@st.composite
def spoiled_texts(draw):
    """A good text with lines lost, doubled, swapped or with other values, and perhaps cut off."""
    lines = draw(st.sampled_from(TEXTS)).splitlines()
    for _ in range(draw(st.sampled_from([1, 1, 1, 2]))):
        k = draw(st.integers(0, len(lines) - 1))
        kind = draw(st.sampled_from([*4 * ["value"], "key", "again", "any", "case", "gone", "gone"]))
        if kind == "value":
            lines[k] = lines[k].partition("=")[0] + "= " + draw(VALUES)
        elif kind == "key":
            lines[k] = draw(KEYS) + " = " + lines[k].partition("=")[2]
        elif kind == "again":
            lines.insert(k, lines[draw(st.integers(0, len(lines) - 1))])
        elif kind == "any":
            lines[k] = draw(st.text(max_size=30))
        elif kind == "case":
            lines[k] = lines[k].swapcase()
        elif len(lines) > 1:
            del lines[k]
    text = "\n".join(lines)
    return text[: draw(st.sampled_from([None] * 6 + [len(text) // 2, len(text) - 3]))]


@fuzz.sizes(100, 12000)
def test_spoiled_texts_are_read_as_equal_scenes_or_refused_by_name(examples):
    fuzz.hold(examples, claim_text, text=spoiled_texts())


@pytest.mark.parametrize("part", fuzz.PARTS)
@fuzz.sizes(20, 1600)
def test_parts_take_or_name_any_value(examples, part):
    """One parameter after another, and all at once: refused by its own name, or finite in the end."""
    cls, strategies = fuzz.PARTS[part]
    table = fuzz.TABLES.get(part, part)

    def claim(values):
        parts = []
        # What an envelope refuses of all its times together bears the envelope's name; some shapes take cycles.
        names = [f"{table}.{name}" for name in values] + [table] * (part == "trapezoid")
        names += ["forcing.cycles"] * (part == "pulse")
        if not fuzz.refused(lambda: parts.append(cls(**fuzz.GOOD[part] | values)), *names):
            assert repr(parts[0]).count("nan") == repr(parts[0]).count("inf") == 0

    one_value = st.sampled_from(sorted(strategies)).flatmap(
        lambda name: st.fixed_dictionaries({name: strategies[name]})
    )
    fuzz.hold(examples, claim, values=one_value | st.fixed_dictionaries(strategies))


def test_a_number_that_python_does_not_write_is_refused_by_name():
    """Python writes no integer of more than 4300 digits, and raises where a message would show it."""
    for value in (10**5000, -(10**5000)):
        with pytest.raises(ValueError, match=r"^forcing\.amplitude: got int of very many digits, accepted: a finite"):
            fuzz.Harmonic(value, 2.7)
