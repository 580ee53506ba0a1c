"""From the arrays of a result to every place where somebody reads them, for every kind of result, row by row."""

import base64
import csv
import importlib
import json
import math
import pkgutil
import re

import made_results
import meshio
import numpy as np
import pytest
from made_results import KINDS, SAMPLES, WITH_ROWS, equal, kind

import fpk_rocking
import montecarlo
from fpk_rocking import studies
from fpk_rocking.compare import compare
from fpk_rocking.output import report, tables, vtk
from fpk_rocking.results.result import Result
from fpk_rocking.risk.picture import fragility_table

CURVES = ["fragility", "fragility by density", "surface"]


def test_no_kind_is_missing():
    """Every class of results is among those made here, but for those that test_calibration reads."""

    def below(cls):
        return {cls}.union(*map(below, cls.__subclasses__()))

    packages = fpk_rocking, montecarlo, studies
    for package in packages:
        for module in pkgutil.walk_packages(package.__path__, package.__name__ + "."):
            importlib.import_module(module.name)
    names = tuple(package.__name__ for package in packages)
    classes = {cls for cls in below(Result) if cls.__module__.startswith(names)}
    classes -= {cls for cls in classes if cls.__module__ == "fpk_rocking.risk.calibration"}
    abstract = {cls for cls in classes if any(other in classes for other in cls.__subclasses__())}
    assert classes - abstract == {type(kind(name).result) for name in KINDS}


@pytest.mark.parametrize("name", [name for name in KINDS if name != "operator"])
def test_the_made_rows_tell_mistakes_apart(name):
    """More rows than a film has frames; left is not right, and no row is like the one before it."""
    columns = kind(name).columns
    assert len(next(iter(columns.values()))) > report._FRAMES
    for first, second in (("overturned_left", "overturned_right"), ("survival_low", "survival_high")):
        if first in columns:
            pair = np.array([columns[first], columns[second]])
            assert np.mean(pair[0] != pair[1]) > 0.95
            assert np.mean(np.abs(np.diff(pair)).max(axis=0) > 0.0) > 0.5


@pytest.mark.parametrize("name", KINDS)
def test_columns_are_the_arrays(name):
    table, wanted = kind(name).result.table(), kind(name).columns
    assert list(table) == list(wanted)
    for column, values in wanted.items():
        equal(table[column], values, column)


@pytest.mark.parametrize("name", KINDS)
def test_datasets_and_data_frames_are_the_arrays(name):
    result, columns, variables, places = kind(name)
    arrays, coordinates = result.variables, result.coordinates
    assert (arrays.keys(), coordinates.keys()) == (variables.keys(), places.keys())
    for variable, (dims, values) in variables.items():
        dimensions, array = arrays[variable]
        assert dimensions == dims, variable
        equal(array() if callable(array) else array, values, variable)
    for place, values in places.items():
        equal(coordinates[place][1], values, place)
    pytest.importorskip("xarray")
    data = result.to_xarray()
    assert data.attrs["trust"] == result.trust.verdict
    for variable, (_, values) in variables.items():
        equal(data[variable].values, values, variable)
    if "side" in places and "overturned" in variables:
        equal(data.overturned.sel(side="left").values, columns["overturned_left"])
    frame = result.to_dataframe()
    assert list(frame.columns) == list(columns)
    for column, values in columns.items():
        equal(frame[column].to_numpy(values.dtype), values, column)


@pytest.mark.parametrize("name", [name for name in KINDS if type(kind(name).result).kind])
def test_every_file_comes_back(name, tmp_path):
    result = kind(name).result
    result.save(tmp_path / "result.npz")
    loaded = type(result).load(tmp_path / "result.npz")
    assert repr(loaded) == repr(result)
    for column, values in kind(name).columns.items():
        equal(loaded.table()[column], values, column)


def test_a_class_without_files_says_so(tmp_path):
    with pytest.raises(TypeError, match="Sweep: results of this class have no files"):
        kind("sweep").result.save(tmp_path / "sweep.npz")


def printed(table):
    """Texts of a table by their header; of two equal headers as a list of columns."""
    texts_of = {}
    for column in table.columns:
        texts_of.setdefault(column.header, []).append([str(cell) for cell in column.cells])
    return {name: texts[0] if len(texts) == 1 else texts for name, texts in texts_of.items()}


def limits(low, high, digits):
    return [f"{a:.{digits}f}–{b:.{digits}f}" for a, b in zip(low, high, strict=True)]


@pytest.mark.parametrize("name", WITH_ROWS)
def test_every_printed_row(name):
    result, columns, _, _ = kind(name)
    counted = {"cycles": [f"{k}" for k in range(made_results.CYCLES + 1)]}
    if result.scene.period is None:
        counted = {"time τ": [f"{time:g}" for time in columns["time"]]}
    wanted = counted | {"survival": [f"{value:.5f}" for value in columns["survival"]]}
    if name in SAMPLES:
        wanted |= {"95 % interval": limits(columns["survival_low"], columns["survival_high"], 5)}
    for side in ("left", "right"):
        wanted |= {f"overturned {side}": [f"{value:.5f}" for value in columns[f"overturned_{side}"]]}
    assert printed(tables.result_table(result)[1]) == wanted


def test_every_printed_row_of_comparisons():
    """Two samples against one density: a row of the reference and one of each sample, cycle by cycle."""
    reference, samples = kind("density"), [kind("comparison"), None]
    other = made_results.ensemble(seed=6)
    samples[1] = compare(other.result, reference.result, made_results.JOINT)
    first = kind("ensemble").columns
    shown = printed(tables.comparison_table([kind("comparison").result, samples[1]])[1])
    assert shown["cycles"] == [text for cycle in made_results.JOINT for text in (str(cycle), "", "")]
    survival, bounds, scores, distances = [], [], [], []
    for place, cycle in enumerate(made_results.JOINT):
        survival.append(f"{reference.columns['survival'][cycle]:.4f}")
        bounds.append("")
        scores.append("")
        distances.append(("", ""))
        for columns, compared in ((first, kind("comparison").result), (other.columns, samples[1])):
            survival.append(f"{columns['survival'][cycle]:.4f}")
            bounds += limits(columns["survival_low"][[cycle]], columns["survival_high"][[cycle]], 4)
            scores.append(f"{compared.z[cycle]:+.1f}")
            texts = (
                f"{getattr(compared, distance)[place]:.4f} ({getattr(compared, distance + '_floor')[place]:.4f})"
                for distance in ("l1", "hellinger")
            )
            distances.append(tuple(texts))
    assert (shown["survival"], shown["95 % interval"], shown["z"]) == (survival, bounds, scores)
    assert list(zip(shown["L1 (floor)"], shown["Hellinger (floor)"], strict=True)) == distances
    assert shown["result"] == ["Fokker-Planck density", "Monte Carlo rk4", "Monte Carlo rk4"] * len(made_results.JOINT)


@pytest.mark.parametrize("name", CURVES)
def test_every_printed_row_of_curves(name):
    result, columns, _, _ = kind(name)
    shown = printed(fragility_table(result)[1])
    first = columns["event"] == "overturned"
    places = columns[result.axis][first]
    if result.axis == "scene":
        assert shown.pop("motion") == places.tolist()
    else:
        assert shown.pop(result.axis) == [f"{value:g}" for value in places]
    assert shown.pop("scale") == [f"{value:.4g}" for value in columns["scale"][first]]
    for head, column in (("PGA, g", "pga_g"), ("PGV, m/s", "pgv_m_per_s")):
        assert shown.pop(head) == [f"{value:.3f}" for value in columns[column][first]]
    bounds = shown.pop("95 %" if result.realizations else "± estimate")
    assert list(shown) == ["overturned", "|Θ| ≥ 0.5", "|Θ| ≥ 1.1"]
    for which, texts in enumerate(shown.values()):
        low, high, values = (columns[column][which::3] for column in ("low", "high", "probability"))
        computed = np.isfinite(values)
        assert texts == [f"{value:.4f}" if there else "-" for value, there in zip(values, computed, strict=True)]
        intervals = limits(low, high, 4)
        assert bounds[which] == [text if there else "-" for text, there in zip(intervals, computed, strict=True)]


@pytest.mark.parametrize("name", [*CURVES, "sweep", "list"])
def test_every_row_of_a_csv_file(name, tmp_path):
    result, columns, _, _ = kind(name)
    result.to_csv(tmp_path / "rows.csv")
    rows = list(csv.DictReader((tmp_path / "rows.csv").open(encoding="utf-8")))
    if name in CURVES:
        assert list(rows[0]) == list(columns)
    else:
        assert rows[0].keys() == columns.keys() | {"seed"}
        assert [int(row["seed"]) for row in rows] == [row["seed"] for row in result.rows]
    for column, values in columns.items():
        texts = [row[column] for row in rows]
        if values.dtype.kind == "U":
            assert [text or "" for text in texts] == np.where(values == "nan", "", values).tolist()
        else:
            equal([float(text or "nan") for text in texts], values.astype(float), column)


TABLE = re.compile(r"<table>(.*?)</table>", re.DOTALL)


@pytest.fixture
def written(tmp_path):
    """Header and rows of a report's table, and its film, as a function of the result."""

    def read(result, films=()):
        report.write_report(tmp_path / "report.html", result, {}, films=films)
        text = (tmp_path / "report.html").read_text(encoding="utf-8")
        rows = re.findall("<tr>(.*?)</tr>", TABLE.search(text)[1])
        head, *body = (re.findall("<t[hd][^>]*>(.*?)</t[hd]>", row) for row in rows)
        film = re.search(r"id='film'>(.*?)</script>", text)
        return head, body, json.loads(film[1]) if film else None

    return read


@pytest.mark.parametrize("name", KINDS)
def test_every_row_of_a_report(name, written):
    result, columns, _, _ = kind(name)
    head, rows, _ = written(result)
    filled = {
        column: values for column, values in columns.items() if values.dtype.kind != "f" or not np.isnan(values).all()
    }
    units = {"time": "time τ", "wall_s": "wall, s", "level_deg": "level, degrees", "pga_g": "pga, g"}
    units |= {"pgv_m_per_s": "pgv, m/s", "overturn_s": "overturn, s", "PGV_m_per_s": "PGV, m/s"}
    assert head == [units.get(column, column.replace("_", " ")) for column in filled]
    assert len(rows) == len(next(iter(columns.values())))
    for texts, values in zip(zip(*rows, strict=True), filled.values(), strict=True):
        if values.dtype.kind == "f":
            assert list(texts) == [f"{value:.6g}" if math.isfinite(value) else "" for value in values]
        else:
            assert list(texts) == [str(value) for value in values.tolist()]


@pytest.mark.parametrize("name", WITH_ROWS)
def test_every_frame_of_a_report(name, written):
    """121 of 151 rows, each with its own time, survival, sides and bins."""
    result, columns, _, _ = kind(name)
    film = written(result, [result])[2]
    rows = np.floor(np.linspace(0.0, made_results.CYCLES, report._FRAMES) + 1e-9).astype(int)
    when = [f"after {k} cycle{'s' * (k != 1)}" for k in rows.tolist()]
    if result.scene.period is None:
        when = [f"τ = {time:.4g}" for time in columns["time"][rows]]
    assert film["when"] == when
    (shown,) = film["films"]
    equal(shown["survival"], columns["survival"][rows])
    equal(shown["overturned"], np.stack([columns["overturned_left"], columns["overturned_right"]], axis=1)[rows])
    edges = [np.array(film[axis]) for axis in ("angle", "velocity")]
    areas = np.multiply.outer(*map(np.diff, edges))
    for frame in (1, 2, 60, 120):
        density = np.maximum(result.bin_probabilities(int(rows[frame]), *edges) / areas, 0.0)
        codes = np.frombuffer(base64.b64decode(shown["codes"][frame]), np.uint8).reshape(areas.shape)
        assert film["most"][frame] == pytest.approx(density.max())
        assert np.abs(codes - 255.0 * np.sqrt(density / density.max())).max() < 0.501


@pytest.mark.parametrize("name", WITH_ROWS)
def test_a_summary_is_the_arrays(name):
    result, columns, _, _ = kind(name)
    values = json.loads(json.dumps(result.summary(), allow_nan=False))
    equal(values["survival"], columns["survival"])
    equal(values["overturned"], np.stack([columns["overturned_left"], columns["overturned_right"]], axis=1))
    if result.scene.period is None:
        equal(values["times"], columns["time"])
    else:
        assert values["cycles"] == made_results.CYCLES
    if name in SAMPLES:
        bounds = np.stack([columns["survival_low"], columns["survival_high"]], axis=1)
        equal(values["interval"], bounds)
        assert values["half_width"] == pytest.approx(0.5 * (bounds[:, 1] - bounds[:, 0]).max())
    for column in {"truncated", "at_rest"} & columns.keys():
        equal(values[column], columns[column])


@pytest.mark.parametrize("name", CURVES)
def test_a_summary_of_curves_is_the_arrays(name):
    result, _, variables, places = kind(name)
    values = json.loads(json.dumps(result.summary(), allow_nan=False))
    probability, low, high = (variables[variable][1] for variable in ("probability", "low", "high"))

    def plain(array):
        return np.where(np.isnan(array), None, array).tolist()

    assert (values["overturned"], values["reached"]) == (plain(probability[:, 0]), plain(probability[:, 1:]))
    interval = np.array(values["interval"], float)
    equal(interval[..., 0], low)
    equal(interval[..., 1], high)
    assert (values["place"], values["scale"], values["level"]) == (
        result.place.tolist(),
        list(places["scale"]),
        list(places["level"][1:]),
    )


def test_a_summary_of_a_comparison_is_the_arrays():
    result, _, variables, places = kind("comparison")
    values = result.summary()
    for variable, (dims, array) in variables.items():
        wanted = array[made_results.JOINT] if variable.startswith(("l1", "hellinger")) else array
        equal(
            np.array(values[variable.removeprefix("survival_") if "limit" in dims else variable], float),
            wanted,
            variable,
        )
    assert (values["cycles"], values["joint_cycles"]) == (places["cycle"].tolist(), made_results.JOINT)
    assert values["names"] == ["Monte Carlo rk4", "Fokker-Planck density"]
    assert values["realizations"] == [made_results.PATHS, None]


@pytest.mark.parametrize("name", WITH_ROWS)
def test_vtk_files_are_the_arrays(name, tmp_path):
    result, columns, _, _ = kind(name)
    vtk.write_series(tmp_path, "jpdf", result, [1, 149])
    for row in (1, 149):
        mesh = meshio.read(tmp_path / f"jpdf_{row:04d}.vtu")
        fields = {field: float(value[0]) for field, value in mesh.field_data.items()}
        assert fields["cycle"] == row
        assert fields["tau"] == pytest.approx(columns["time"][row])
        for field in ("survival", "overturned_left", "overturned_right"):
            assert fields[field] == pytest.approx(columns[field][row], rel=1e-12)
        quads = mesh.cells_dict["quad"]
        left = mesh.points[quads][:, :, 0].mean(axis=1) < 0.0
        probability = mesh.cell_data_dict["probability"]["quad"]
        angles, velocities = made_results.SPACE.lines if name.startswith("density") else result.bin_edges
        halves = result.bin_probabilities(row, [angles[0], 0.0, angles[-1]], velocities[[0, -1]])
        at_zero = columns["at_rest"][row] if name == "density with rest" else 0.0
        assert probability[left].sum() == pytest.approx(halves[0].sum(), rel=1e-9)
        assert probability[~left].sum() == pytest.approx(halves[1].sum() - at_zero, rel=1e-9)
