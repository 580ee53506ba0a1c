"""The case on equivalent white noise."""

import json

import numpy as np
import pytest


@pytest.mark.slow
def test_equivalence_study_divides_the_difference(case, tmp_path):
    """The case, coarse: parts sum to the whole; few harmonics stand longer.

    S(20) of N = 30 is .209 (100,000 realizations), .174 of the density: 4.7 standard errors, a false alarm of 1e-6.
    """
    module = case("equivalence")
    coarse = {"restitutions": (0.5,), "harmonics": (30, 1000), "diffusions": (0.0045, 0.0065, 0.015)}
    findings = module.run(tmp_path, noises=(((0.0, 10.0), 0.2), ((1.0, 6.0), 0.3)), realizations=3000, **coarse)
    assert json.loads((tmp_path / "equivalence.json").read_text(encoding="utf-8"))["budget"] == findings["budget"]
    assert (tmp_path / "equivalence.png").stat().st_size > 10_000
    (row, low), parts = findings["noises"], findings["budget"]
    divided = np.sum([parts[name] for name in ("finite N", "band", "discretization")], axis=0)
    assert divided == pytest.approx(parts["whole"], abs=1e-12)
    assert row["density"][:3] == pytest.approx([0.8627, 0.4696, 0.1739], abs=4e-3)
    assert row["sampled"][0][2] > row["density"][2]
    assert low["relative_variance"] < 0.2 < row["relative_variance"]
    assert list(module.worst([[0.1, -0.3], [0.2, 0.1]])) == [-0.3, 0.2]
