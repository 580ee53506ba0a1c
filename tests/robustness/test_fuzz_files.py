"""Saved results from anything: damage of any kind is refused with the file's name, or changes nothing that is read.

Archives of other content, with right checksums, are those of tests/results/test_storage.py.
"""

import fuzz
import numpy as np
import pytest
from hypothesis import strategies as st

from fpk_rocking import Start
from fpk_rocking.density import Evolution
from fpk_rocking.results.replacement import Replacement
from fpk_rocking.risk import fragility
from montecarlo import histories, simulate, tally

WHITE = fuzz.scene(noise=fuzz.WhiteNoise(0.006), start=Start(0.3, -0.2, ((0.01, 0.0), (0.0, 0.01))))
EDGES = {"angle_edges": [-1.0, 0.0, 1.0], "velocity_edges": [-2.0, 0.0, 2.0]}
KINDS = "evolution", "ensemble", "tally", "histories", "fragility"
ASKED = {"scene": WHITE, "cycles": 2, "realizations": 6}


def evolution():
    """A small evolution that no solver made."""
    lines = np.linspace(-1.5, 1.5, 3)
    times, survival, overturned = WHITE.period * np.arange(3), np.array([1.0, 0.9, 0.8]), np.full((3, 2), 0.05)
    lost, at_rest, figures = np.zeros(3), np.full(3, 0.1), (1e-3, 1e-3, 0.0, 0.0, 0.0, 0.0, 0.1)
    coefficients = np.arange(48.0).reshape(3, 2, 2, 2, 2)
    check = Replacement(np.full((3, 3), 0.01), np.full((3, 3), 0.02), "exact", 100, 2, 0.1)
    return Evolution(
        WHITE, 0.006, "", 1e-2, times, survival, overturned, lost, at_rest, *figures, {"n": 1}, coefficients, lines,
        lines, False, check,
    )  # fmt: skip


def content(result):
    """Everything that a result holds, as bytes and text."""
    values = [getattr(result, name) for name in sorted(vars(result)) if not name.startswith("_")]
    if isinstance(result, Evolution):
        values += [*result.space.lines, result.replacement.difference, result.replacement.sampling_error]
    return [value.tobytes() if isinstance(value, np.ndarray) else repr(value) for value in values]


@pytest.fixture(scope="module")
def saved(tmp_path_factory):
    """Class, file and its bytes of a small result of every kind."""
    folder = tmp_path_factory.mktemp("saved")
    results = [evolution(), simulate(**ASKED), tally(**ASKED, **EDGES), histories(**ASKED, samples_per_cycle=2)]
    results.append(fragility(**ASKED, scale=(1.0, 2.0), levels=(0.5,)))
    files = {}
    for kind, result in zip(KINDS, results, strict=True):
        result.save(folder / f"{kind}.npz")
        files[kind] = (type(result), folder / f"{kind}.npz", (folder / f"{kind}.npz").read_bytes())
    return files


def loads(cls, path):
    """Return what is loaded, or None where the file is refused by its name."""
    try:
        return cls.load(path)
    except ValueError as error:
        assert type(error) is ValueError
        assert str(error).startswith(f"{path}: ")
        assert "\n" not in str(error)
        return None


@st.composite
def damages(draw):
    """What happens to the bytes of a file, places as parts of its length."""
    kind = draw(st.sampled_from(["flip", "flip", "flip", "cut", "lose", "insert", "zero", "append", "shuffle"]))
    return kind, draw(st.floats(0.0, 1.0)), draw(st.integers(0, 7)), draw(st.binary(min_size=1, max_size=40))


def damaged(content, damage):
    """Return the bytes after the damage."""
    kind, place, bit, other = damage
    content, k = bytearray(content), int(place * (len(content) - 1))
    if kind == "flip":
        content[k] ^= 1 << bit
    elif kind == "cut":
        del content[k:]
    elif kind == "lose":
        del content[k : k + 1 + 64 * bit]
    elif kind == "insert":
        content[k:k] = other
    elif kind == "zero":
        content[k : k + 512] = bytes(len(content[k : k + 512]))
    elif kind == "append":
        content += other
    else:
        content[k : k + len(other)] = other
    return bytes(content)


@pytest.mark.parametrize("kind", KINDS)
@fuzz.sizes(40, 4000)
def test_damaged_files_are_refused_or_read_unchanged(examples, kind, saved, tmp_path):
    cls, path, intact = saved[kind]
    expected = content(cls.load(path))
    spoiled = tmp_path / "spoiled.npz"

    def claim(damage):
        spoiled.write_bytes(damaged(intact, damage))
        loaded = loads(cls, spoiled)
        assert loaded is None or content(loaded) == expected

    fuzz.hold(examples, claim, damage=damages())
