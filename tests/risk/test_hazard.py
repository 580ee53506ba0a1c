"""Hazard curves: read from files, refused by name, continued as power laws."""

import pytest

from fpk_rocking.risk import Hazard


@pytest.mark.parametrize(
    "text",
    ["im,rate\n0.1,1e-2\n1,1e-4\n", "# g\n0.1;1e-2\n\n1;1e-4", "0.1\t0.01\n1\t0.0001\n", "0.1 1e-2\n1 1e-4"],
    ids=["comma", "semicolon", "tab", "blank"],
)
def test_hazards_are_read_from_two_columns(tmp_path, text):
    file = tmp_path / "h.csv"
    file.write_text(text)
    assert Hazard.from_csv(file)(0.3) == pytest.approx(1e-2 * 3.0**-2.0, rel=1e-12)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "got no numbers"),
        ("0.1,1e-2\nx,1\n", "line 2: got 'x,1'"),
        ("0.1,1e-2\n1\n", "line 2: got '1'"),
        ("0.1,1e-2,3\n", "got no numbers"),
        ("0.1,1e-2\n0.1,1e-3\n", r"hazard\.intensity\[1\]: got 0\.1, accepted: values that rise"),
        ("0.1,1e-2\n0.2,1e-2\n", r"hazard\.rate\[1\]: got 0\.01, accepted: values that fall"),
        ("0.1,1e-2\n0.2,-1\n", r"hazard\.rate: got"),
        ("0.1,1e-2\n", r"hazard\.intensity: got"),
    ],
)
def test_what_is_no_hazard_is_refused_by_name(tmp_path, text, said):
    file = tmp_path / "h.csv"
    file.write_text(text)
    with pytest.raises(ValueError, match=said):
        Hazard.from_csv(file)
