"""Saved results from anything: damage of any kind is refused with the file's name, or changes nothing that is read.

What is damage to the archive: bits, cuts, bytes too many. What is a whole archive of other content: names, types,
shapes, pickles, headers; all of that has right checksums and has to be refused for what it is.
"""

import io
import json

import fuzz
import numpy as np
import pytest
from hypothesis import strategies as st

from fpk_rocking import Start
from fpk_rocking.density import Evolution
from fpk_rocking.results.sampling import Replacement
from fpk_rocking.studies import fragility
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
@fuzz.sizes(120, 4000)
def test_damaged_files_are_refused_or_read_unchanged(examples, kind, saved, tmp_path):
    cls, path, intact = saved[kind]
    expected = content(cls.load(path))
    spoiled = tmp_path / "spoiled.npz"

    def claim(damage):
        spoiled.write_bytes(damaged(intact, damage))
        loaded = loads(cls, spoiled)
        assert loaded is None or content(loaded) == expected

    fuzz.hold(examples, claim, damage=damages())


JSON = st.recursive(
    st.one_of(st.none(), st.booleans(), st.integers(), st.floats(), st.text(max_size=6)),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=6), inner, max_size=3),
    max_leaves=5,
)
OTHER_ARRAYS = st.one_of(
    st.sampled_from(["f4", "i8", "c16", "U3", "?", ">f8", "i4"]).map(lambda kind: lambda array: array.astype(kind)),
    st.just(lambda array: array[..., None]),
    st.just(lambda array: array[:-1]),
    st.just(lambda array: np.concatenate([array, array])),
    st.just(lambda array: array.reshape(-1)[0]),
    st.just(lambda array: array.astype(object)),
    st.just(lambda _: np.array([{"a": 1}, None], dtype=object)),
    st.just(lambda _: np.zeros((0, 0))),
)


@st.composite
def changes(draw, names, parts):
    """Another content of an archive: what to change, how, and to what."""
    kinds = ["array", "array", "gone", "added", "renamed", "header", "attribute", "lost attribute", "text"]
    kind = draw(st.sampled_from(kinds))
    return kind, draw(st.sampled_from(names)), draw(OTHER_ARRAYS), draw(st.sampled_from(parts)), draw(JSON)


def change_arrays(arrays, kind, name, other):
    """Change the arrays of an archive; return whether another type, shape or name came of it."""
    before = arrays.pop(name)
    if kind == "array":
        with np.errstate(invalid="ignore"):
            arrays[name] = other(before)
        return (before.dtype, before.shape) != (arrays[name].dtype, arrays[name].shape)
    if kind == "renamed":
        arrays[name + "_"] = before
    elif kind == "added":
        arrays |= {name: before, "extra": np.zeros(2)}
    return True


def change_header(header, kind, name, part, value):
    """Change the header of an archive; return whether it says something else now."""
    attributes = header["attributes"]
    if kind == "header":
        before, header[part] = header[part], value
        return before != value
    if kind == "attribute":
        key = sorted(attributes)[len(name) % len(attributes)]
        wanted = type(attributes[key])
        attributes[key] = value
        taken = isinstance(value, (int, float) if wanted is float else wanted)
        return not taken or (isinstance(value, bool) and wanted is not bool)
    attributes.popitem()
    return True


def changed(path, archive, change):
    """Write an archive of other content with right checksums; return whether it differs from a good one."""
    kind, name, other, part, value = change
    arrays = dict(archive)
    header = json.loads(str(arrays.pop("header")))
    if kind in {"header", "attribute", "lost attribute"}:
        differs = change_header(header, kind, name, part, value)
    else:
        differs = kind == "text" or change_arrays(arrays, kind, name, other)
    np.savez(path, header=np.array(json.dumps(value if kind == "text" else header)), **arrays)
    return differs


@pytest.mark.parametrize("kind", KINDS)
@fuzz.sizes(60, 1500)
def test_archives_of_other_content_are_refused(examples, kind, saved, tmp_path):
    cls, _, intact = saved[kind]
    with np.load(io.BytesIO(intact)) as archive:
        arrays = {name: archive[name] for name in archive.files}
    other = tmp_path / "other.npz"
    names = sorted(arrays.keys() - {"header"})

    def claim(change):
        if changed(other, arrays, change):
            assert loads(cls, other) is None

    fuzz.hold(examples, claim, change=changes(names, ["format", "kind", "scenes", "attributes"]))
