"""The case of FEMA P-58, coarse: medians rise with the size, and are drawn where they belong."""

import json
import pathlib

import numpy as np
import pytest


@pytest.mark.slow
def test_medians_rise_with_the_size(case, tmp_path):
    module = case("fema_p58")
    coarse = {"motions": 5, "radii": (0.4, 4.0), "scales": np.geomspace(0.7, 7.0, 10)}
    values = module.run(tmp_path, **coarse, published=module.PUBLISHED[:1])
    (same, small, large, *_), published = values["blocks"], values["published"]
    assert published == [0.724]
    assert (same["width"], same["height"]) == pytest.approx((0.3207, 0.7366), abs=1e-4)
    assert module.seconds_of(same, 0.724) == pytest.approx(0.1696, abs=1e-4)
    assert small["height"] / small["width"] == pytest.approx(large["height"] / large["width"]) == pytest.approx(3.0)
    assert large["median"] > 1.5 * small["median"]  # about 3 times, by 30 motions
    assert json.loads((tmp_path / "fema_p58.json").read_text())["blocks"] == values["blocks"]
    assert (tmp_path / "fema_p58.png").stat().st_size > 10_000


def test_the_page_has_the_ratios_of_the_kept_numbers():
    docs = pathlib.Path(__file__).parents[2] / "docs"
    values = json.loads((docs / "gallery" / "fema_p58.json").read_text(encoding="utf-8"))
    ratios = [
        block["median"] / published for block, published in zip(values["blocks"], values["published"], strict=False)
    ]
    page = (docs / "tutorials" / "fragility.md").read_text(encoding="utf-8")
    assert f"{min(ratios):.2f} to {max(ratios):.2f} times these medians, under" in " ".join(page.split())
