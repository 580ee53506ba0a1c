"""The cases of fragility, re-run coarse.

Seeds are fixed. The bound of a difference of two probabilities is 4.5 standard errors, a false alarm of 7e-6 each for
another seed.
"""

from types import SimpleNamespace

import numpy as np
import pytest
from test_cases_montecarlo import written


@pytest.mark.slow
def test_paths_and_density_of_blocks_agree(case, tmp_path, monkeypatch):
    """Paths and density under the same white noise, in the first .6 s of the motion."""
    module = case("fragility_of_blocks")
    monkeypatch.setattr(module, "END", module.BEGIN + 0.6)
    scales = {"bookcase": (3.0, 3.5)}
    values = module.run(tmp_path, blocks=("bookcase",), scales=scales, realizations=400, tol=5e-2)
    block = values["blocks"]["bookcase"]
    paths, density = (np.array(block[engine]["overturned"][0]) for engine in ("white", "density"))
    assert (paths.shape, density.shape) == ((2,), (1,))
    apart, estimate = paths[::2] - density, np.array(block["density"]["error_estimate"])[0, 0]
    assert np.all(np.abs(apart) < 4.5 * np.sqrt(density * (1.0 - density) / 400) + estimate)
    largest = block["largest_difference"]
    assert abs(largest["difference"]) == np.abs(apart).max()
    assert largest["interval"][0] < largest["difference"] < largest["interval"][1]
    assert written(tmp_path, "blocks", values)


def test_the_largest_difference_is_told(case):
    """Of the scales at which the density is known, with the interval of the paths and the estimate of the density."""
    interval = np.arange(8.0).reshape(1, 1, 4, 2)
    paths = SimpleNamespace(
        scale=np.arange(1.0, 5.0), overturned=np.array([[0.1, 0.9, 0.6, 0.8]]), interval=lambda: interval
    )
    density = SimpleNamespace(
        scale=np.array([1.0, 3.0, 4.0]), overturned=np.array([[0.2, 0.8, np.nan]]), error_estimate=np.ones((1, 1, 3))
    )
    density.error_estimate[0, 0, 1] = 0.01
    largest = case("fragility_of_blocks").difference(paths, density)
    assert largest["difference"] == pytest.approx(-0.2)
    assert (largest["scale"], largest["error_estimate"]) == (3.0, 0.01)
    assert largest["interval"] == pytest.approx([4.0 - 0.8, 5.0 - 0.8])


def test_larger_blocks_stand_better_and_slender_ones_worse(case, tmp_path):
    coarse = {
        "sizes": (0.4, 1.0, 2.0),
        "slendernesses": (3.0, 5.0, 8.0),
        "scales": (0.7, 1.5, 4.0),
        "realizations": 300,
    }
    values = case("fragility_surface").run(tmp_path, **coarse)
    overturned, spread = np.array(values["overturned"]), 4.5 * np.sqrt(2.0 * 0.25 / 300)
    # Larger blocks stand better, slender ones worse.
    assert np.all(np.diff(overturned, axis=0) < spread)
    assert np.all(np.diff(overturned, axis=1) > -spread)
    assert np.ptp(overturned) > 0.9
    assert written(tmp_path, "surface", values)
