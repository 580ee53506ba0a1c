"""The cases of Figs. 2 to 4, re-run coarse."""

import json
import math

import matplotlib.image
import numpy as np
import pytest

from fpk_rocking import BandNoise, melnikov

COARSE = {
    "fig02_phase_portrait": {},
    "fig03_critical_amplitude": {},
    "fig04_phase_flux": {"strata": 64, "realizations": 500},
}


@pytest.fixture(scope="module")
def coarse(case, tmp_path_factory):
    """Folder and numbers of each case."""
    runs = {}
    for name, options in COARSE.items():
        module, folder = case(name), tmp_path_factory.mktemp(name)
        runs[name] = folder, module.run(folder, **options), module
    return runs


@pytest.mark.parametrize("name", COARSE)
def test_their_files_hold_numbers_and_pictures(coarse, name):
    folder, values, _ = coarse[name]
    assert {path.name for path in folder.iterdir()} == {f"{name[:5]}.png", f"{name[:5]}.json"}
    assert json.loads((folder / f"{name[:5]}.json").read_text(encoding="utf-8")) == values
    pixels = matplotlib.image.imread(folder / f"{name[:5]}.png")[..., :3]
    assert min(pixels.shape[:2]) > 900
    assert np.unique((255 * pixels[::4, ::4]).astype(int).reshape(-1, 3), axis=0).shape[0] > 100


def test_orbits_of_the_free_block_have_their_energy_and_area(coarse):
    _, values, module = coarse["fig02_phase_portrait"]
    assert values["barrier"] == 0.5
    assert values["energy_of_the_heteroclinic_orbit"] == pytest.approx([0.5, 0.5], abs=1e-15)
    assert values["area_inside"] == pytest.approx(2.0)
    assert values["transfer_by_quadrature"] == pytest.approx(values["transfer"], abs=1e-10)
    assert values["transfer"][:3] == pytest.approx([2.0, 1.6, 1.0])
    for energy in (0.1, 0.4, 0.65):
        angle, velocity = module.free_orbit(energy)
        assert 0.5 * velocity**2 + module.potential(angle) == pytest.approx(np.full(angle.shape, energy))
        assert angle[0] == pytest.approx(0.0, abs=1e-12)
        assert velocity[0] == pytest.approx(math.sqrt(2.0 * energy))
        assert angle[-1] == pytest.approx(0.0 if energy < 0.5 else math.pi / 2, abs=1e-12)


def test_critical_amplitudes_of_fig03_are_the_known_ones(coarse):
    values = coarse["fig03_critical_amplitude"][1]
    place = values["frequencies"].index(4.0)
    assert [row[place] for row in values["without_noise"]] == pytest.approx([3.8675, 3.1875, 2.1675, 0.8075])
    assert [row[place] for row in values["exact_without_noise"]] == pytest.approx(
        [3.8548, 3.4, 2.4509, 0.8755], abs=1e-4
    )
    assert values["variance"] == 0.286
    assert [row[place] for row in values["with_noise"]] == pytest.approx([2.9101, 1.9161, 0.0, 0.0], abs=1e-4)
    assert values["amplitude_by_band_at_4"][1][1] == values["with_noise"][1][place]
    root = math.sqrt(2.0)
    assert values["mean_square_without_noise"][0] == pytest.approx(
        [root * amplitude for amplitude in values["without_noise"][0]]
    )


def test_sampled_fluxes_of_fig04_agree_with_the_corrected_ones(coarse):
    """Sampled values within six standard errors: Student's t of 15, false alarm 2e-5 each (processes: 2e-9)."""
    values = coarse["fig04_phase_flux"][1]
    corrected, noise = np.array(values["corrected"]), BandNoise(0.16, (0.0, 10.0), 100)
    assert corrected[1] == pytest.approx(melnikov.phase_flux((4.0, 4.0), values["restitutions"], noise), rel=1e-15)
    sampled, error = np.array(values["sampled"]), np.array(values["sampled_standard_error"])
    assert np.all(np.abs(sampled - corrected) < 6.0 * error)
    assert np.all(error < 3e-4)
    processes, error = np.array(values["processes"]), np.array(values["processes_standard_error"])
    assert np.all(np.abs(processes - corrected[1]) < 6.0 * error)
    assert np.all(error < 2e-3)
    assert values["corrected_by_band"][1] == values["corrected"][1]
    assert values["printed_17"][0] == values["corrected"][0]
    assert np.all(np.array(values["printed_17"][1]) < 0.95 * corrected[1])
