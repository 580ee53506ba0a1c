"""VTK series: read back by other programs, complete or not there."""

import dataclasses
import math
import xml.etree.ElementTree as ET

import fakes
import meshio
import numpy as np
import pytest

from fpk_rocking import BandNoise, Block, Harmonic, Scene, Start
from fpk_rocking.density.density import Density
from fpk_rocking.density.space import Space
from fpk_rocking.output import vtk

MAIN = Scene(Block(0.5), Harmonic(4.6, 2.7, math.pi), BandNoise(0.04, (0.0, 10.0), 100))
DENSITY = fakes.FakeEvolution(MAIN)
ENSEMBLE = fakes.FakeEnsemble(MAIN, realizations=2_000)


class SignedEvolution(fakes.FakeEvolution):
    """After a cycle a density on a mesh of the solver's own kind, with negative parts."""

    negative_mass = 0.05

    def at(self, cycle):
        space = Space(np.linspace(-1.5, 1.5, 5), np.linspace(-2.0, 2.0, 4), 3)
        coefficients = np.random.default_rng(cycle).normal(0.0, 0.02, space.shape)
        coefficients[..., 0, 0] = 1.0 / 12.0
        coefficients[1, 1, 0, 0] = -0.01
        return Density(space, coefficients)


def areas(points, quads):
    """Half the cross product of the diagonals: positive where the corners run anticlockwise."""
    first, second = (points[quads[:, end], :2] - points[quads[:, start], :2] for start, end in ((0, 2), (1, 3)))
    return 0.5 * (first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0])


def test_density_file_read_by_meshio(tmp_path):
    vtk.write_series(tmp_path, "jpdf", DENSITY, [4])
    mesh = meshio.read(tmp_path / "jpdf_0004.vtu")
    quads, law = mesh.cells_dict["quad"], DENSITY.at(4)
    # 8 x 10 elements of degree 3: 3 x 3 pieces each, 4 x 4 points of its own.
    assert (len(quads), len(mesh.points)) == (80 * 9, 80 * 16)
    area = areas(mesh.points, quads)
    assert area.min() > 0.0
    # Cell means integrate to what the mesh covers of the survival, exactly; velocities end at 4.
    covered = DENSITY.bin_probabilities(4, [-2.0, 2.0], [-4.0, 4.0]).sum()
    assert mesh.cell_data_dict["density"]["quad"] @ area == pytest.approx(covered, rel=1e-12)
    assert mesh.cell_data_dict["probability"]["quad"].sum() == pytest.approx(covered, rel=1e-12)
    by_element = mesh.cell_data_dict["element_density"]["quad"].reshape(80, 9)
    probability = mesh.cell_data_dict["probability"]["quad"].reshape(80, 9).sum(axis=1)
    expected = probability / area.reshape(80, 9).sum(axis=1)
    np.testing.assert_allclose(by_element, np.repeat(expected[:, None], 9, axis=1), rtol=1e-9)
    away = mesh.points[:, 0] != 0.0
    x, v, z = mesh.points[away].T
    np.testing.assert_allclose(mesh.point_data["density"][away], law(x, v), rtol=1e-12)
    assert np.all(z == 0.0)
    fields = {name: float(value[0]) for name, value in mesh.field_data.items()}
    assert fields["cycle"] == 4.0
    assert fields["tau"] == 4.0 * MAIN.period
    assert fields["survival"] == DENSITY.survival[4]
    assert (fields["overturned_left"], fields["overturned_right"]) == tuple(DENSITY.overturned[4])


def test_a_function_is_written_at_all_points_of_its_degree(tmp_path):
    law = DENSITY.at(4)
    mesh = meshio.read(vtk.write_function(tmp_path / "density.vtu", law, "density"))
    assert (len(mesh.cells_dict["quad"]), len(mesh.points)) == (80 * 9, 80 * 16)
    np.testing.assert_array_equal(mesh.point_data["density"], law.cell_values(4).ravel())


def test_both_sides_of_upright_are_kept(tmp_path):
    vtk.write_series(tmp_path, "jpdf", DENSITY, [1])
    mesh, law = meshio.read(tmp_path / "jpdf_0001.vtu"), DENSITY.at(1)
    corners = mesh.points[mesh.cells_dict["quad"]]
    used = np.unique(mesh.cells_dict["quad"])
    assert used.size == len(mesh.points)
    for side, inside in enumerate((corners[:, :, 0].mean(axis=1) < 0.0, corners[:, :, 0].mean(axis=1) > 0.0)):
        mine = mesh.cells_dict["quad"][inside].ravel()
        upright = mine[mesh.points[mine, 0] == 0.0]
        expected = law.on_side(side, 0.0, mesh.points[upright, 1])
        np.testing.assert_allclose(mesh.point_data["density"][upright], expected, rtol=1e-12)


def test_series_read_by_pyvista(tmp_path):
    import pyvista  # takes a second to import, in every process that collects tests

    listing = vtk.write_series(tmp_path, "jpdf", DENSITY, [0, 1, 10])
    entries = [entry.attrib for entry in ET.parse(listing).iter("DataSet")]
    assert [entry["file"] for entry in entries] == ["jpdf_0000.vtu", "jpdf_0001.vtu", "jpdf_0010.vtu"]
    reader = pyvista.get_reader(listing)
    assert reader.time_values == [0.0, MAIN.period, 10.0 * MAIN.period]
    reader.set_active_time_value(10.0 * MAIN.period)
    mesh = reader.read()[0]
    sized = mesh.compute_cell_sizes(length=False, volume=False)
    covered = DENSITY.bin_probabilities(10, [-2.0, 2.0], [-4.0, 4.0]).sum()
    assert sized.cell_data["Area"] @ sized.cell_data["density"] == pytest.approx(covered, rel=1e-12)
    assert mesh.field_data["cycle"][0] == 10.0


@pytest.mark.parametrize("result", [SignedEvolution(MAIN), ENSEMBLE], ids=["density", "sample"])
@pytest.mark.parametrize("cycle", [0, 3])
def test_a_viewer_first_shows_means_over_elements(tmp_path, result, cycle):
    """Point values of a discontinuous solution swing far below 0 where it is steep."""
    import pyvista

    vtk.write_series(tmp_path, "jpdf", result, [cycle])
    mesh = pyvista.read(tmp_path / f"jpdf_{cycle:04d}.vtu")
    assert mesh.active_scalars_name == "element_density"
    assert mesh.cell_data.active_scalars_name == "element_density"
    assert mesh.point_data.active_scalars_name is None
    assert mesh.active_scalars_info.association == pyvista.FieldAssociation.CELL


def test_a_cycle_that_is_named_twice_is_one_entry(tmp_path):
    listing = vtk.write_series(tmp_path, "jpdf", DENSITY, [2, 4, 2, np.int64(4)])
    entries = [entry.attrib["file"] for entry in ET.parse(listing).iter("DataSet")]
    assert entries == ["jpdf_0002.vtu", "jpdf_0004.vtu"]


@pytest.mark.parametrize(("result", "named"), [(np.zeros(3), "result"), (None, "result"), (MAIN, "result")])
def test_what_is_no_result_is_refused_before_a_file_is_written(tmp_path, result, named):
    with pytest.raises(TypeError, match=f"^{named}: got .*, accepted: SurvivalResult"):
        vtk.write_series(tmp_path, "jpdf", result, [1])
    with pytest.raises(ValueError, match=r"^cycles: got 99"):
        vtk.write_series(tmp_path, "jpdf", DENSITY, [1, 99])
    assert not list(tmp_path.iterdir())


def test_point_start_is_one_vertex_of_probability_one(tmp_path):
    scene = dataclasses.replace(MAIN, start=Start(0.2, -0.1))
    vtk.write_series(tmp_path, "jpdf", fakes.FakeEvolution(scene), [0])
    mesh = meshio.read(tmp_path / "jpdf_0000.vtu")
    (vertex,) = mesh.cells_dict["vertex"].ravel()
    assert mesh.points[vertex].tolist() == [0.2, -0.1, 0.0]
    assert mesh.cell_data_dict["probability"]["vertex"].tolist() == [1.0]
    assert mesh.cell_data_dict["probability"]["quad"].sum() == 0.0


def test_histogram_of_an_ensemble(tmp_path):
    vtk.write_series(tmp_path, "jpdf_rk4", ENSEMBLE, [2])
    mesh = meshio.read(tmp_path / "jpdf_rk4_0002.vtu")
    quads = mesh.cells_dict["quad"]
    heights = mesh.cell_data_dict["density"]["quad"]
    assert heights @ areas(mesh.points, quads) == pytest.approx(ENSEMBLE.survival[2], rel=1e-12)
    np.testing.assert_allclose(mesh.point_data["density"][quads], np.repeat(heights[:, None], 4, axis=1), rtol=1e-12)


def test_negative_parts_are_written_as_they_are(tmp_path):
    result = SignedEvolution(MAIN)
    vtk.write_series(tmp_path, "jpdf", result, [0, 3])
    mesh, law = meshio.read(tmp_path / "jpdf_0003.vtu"), result.at(3)
    np.testing.assert_array_equal(mesh.point_data["density"], law.cell_values(4).ravel())
    assert mesh.point_data["density"].min() < -1e-3
    probability = mesh.cell_data_dict["probability"]["quad"]
    assert probability.min() < -1e-5
    assert probability.sum() == pytest.approx(law.moment(0, 0), rel=1e-13)
    assert mesh.field_data["negative_mass"] == 0.05
    start = meshio.read(tmp_path / "jpdf_0000.vtu")
    assert start.point_data.keys() == mesh.point_data.keys()
    assert start.cell_data.keys() == mesh.cell_data.keys()


def test_an_ensemble_has_no_negative_mass(tmp_path):
    vtk.write_series(tmp_path, "jpdf_rk4", ENSEMBLE, [0, 2])
    for cycle in (0, 2):
        mesh = meshio.read(tmp_path / f"jpdf_rk4_000{cycle}.vtu")
        assert set(mesh.point_data) == {"density"}
        assert set(mesh.cell_data) == {"density", "probability", "element_density"}
        assert "negative_mass" not in mesh.field_data


def test_a_series_that_ends_early_leaves_whole_files_and_no_listing(tmp_path):
    (tmp_path / "jpdf_0002.vtu").mkdir()
    with pytest.raises(IsADirectoryError):
        vtk.write_series(tmp_path, "jpdf", DENSITY, [1, 2, 4])
    assert {path.name for path in tmp_path.iterdir()} == {"jpdf_0001.vtu", "jpdf_0002.vtu"}
