"""Files of hazard curves: columns by their names, OpenQuake's export, and what is refused with what to write."""

import json
import math
import re
from xml.etree import ElementTree as ET

import numpy as np
import pytest
from suites import SIZE, record

from fpk_rocking import Block, NoNoise, Scene, cli
from fpk_rocking.risk import Hazard, study, synthetic_records

G = 9.80665
LAW = lambda im: 1e-3 * im**-2.0  # noqa: E731
LEVELS = np.array([0.1, 0.3, 1.0])

COMMENT = (
    "#,,,,,\"generated_by='OpenQuake engine 3.23.4', start_date='2026-11-01T10:00:00', checksum=1064, kind='mean', "
    "investigation_time=50.0, imt='PGA'\"\n"
)
SITES = "lon,lat,depth,poe-0.0050000,poe-0.1000000,poe-0.3000000,poe-1.0000000,poe-4.0000000\n"


def read(tmp_path, text, **options):
    file = tmp_path / "h.csv"
    file.write_text(text, encoding="utf-8")
    return Hazard.from_csv(file, **options)


@pytest.mark.parametrize(
    "text",
    [
        "im,rate\n0.1,1e-1\n1,1e-3\n", "# g\n0.1;1e-1\n\n1;1e-3", "0.1\t0.1\n1\t0.001\n", "\ufeff0.1 1e-1\n1 1e-3",
        "0,1;0,1\n1;0,001", "0,1 0,1\n1,0 0,001", "im;frequency\n1;0,001\n0,1;0,1\n",
    ],
    ids=["comma", "semicolon", "tab", "blank", "decimal comma", "decimal comma and blank", "named and descending"],
)  # fmt: skip
def test_hazards_are_read_from_two_columns(tmp_path, text):
    hazard = read(tmp_path, text)
    assert hazard(0.3) == pytest.approx(LAW(0.3), rel=1e-12)
    assert (hazard.measure, hazard.source) == ("", "h.csv")


@pytest.mark.parametrize(
    ("names", "measure", "factor"),
    [
        ("PGA (g)", "PGA", 1.0),
        ("pga_g", "PGA", 1.0),
        ("PGA [m/s2]", "PGA", G),
        ("PGA (m/s²)", "PGA", G),
        ("peak ground acceleration (cm/s^2)", "PGA", 100 * G),
        ("PGA (gal)", "PGA", 100 * G),
        ("PGA in %g", "PGA", 100.0),
        ("PGV (cm/s)", "PGV", 100.0),
        ("Peak Ground Velocity (m/sec)", "PGV", 1.0),
        ("PGV_m_per_s", "PGV", 1.0),
        ("im (cm/s)", "PGV", 100.0),
        ("PGA", "PGA", 1.0),
        ("ag (g)", "PGA", 1.0),
        ("a_g [m/s2]", "PGA", G),
        ("Sa(1.0) (g)", "Sa(1.0)", 1.0),
        ("SA(0.20) [m/s2]", "Sa(0.2)", G),
        ("PSA(T=1.5 s) (%g)", "Sa(1.5)", 100.0),
        ("Sa (.75s)", "Sa(0.75)", 1.0),
        ("PFA (m/s2)", "PFA", G),
        ("PFV (cm/s)", "PFV", 100.0),
    ],
)
def test_the_first_line_says_measure_and_unit(tmp_path, names, measure, factor):
    rows = "".join(f"{factor * im!r},{LAW(im)!r}\n" for im in LEVELS.tolist())
    hazard = read(tmp_path, f"{names},annual rate\n{rows}")
    assert hazard.measure == measure
    assert hazard.intensity == pytest.approx(LEVELS, rel=1e-9)
    assert hazard.rate == pytest.approx(LAW(LEVELS), rel=1e-12)
    unit = {"PGV": "m/s", "PFV": "m/s"}.get(measure, "g")
    assert f"The hazard's file gives {measure} in " in hazard.note
    assert (f"no unit, read in {unit}," in hazard.note) == (names in ("PGA", "Sa (.75s)"))


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("return period (years)", lambda rate: 1.0 / rate),
        ("T_R", lambda rate: 1.0 / rate),
        ("probability in 50 years", lambda rate: -np.expm1(-50.0 * rate)),
        ("poe % in 10 yr", lambda rate: -100.0 * np.expm1(-10.0 * rate)),
        ("annual probability of exceedance", lambda rate: -np.expm1(-rate)),
        ("exceedances per year", lambda rate: rate),
    ],
)
@pytest.mark.parametrize("first", [True, False])
def test_the_first_line_says_what_the_other_column_is(tmp_path, name, values, first):
    """Probabilities in 50 years, taken as annual rates, gave 22 to 47 times too many."""
    rows = np.stack([LEVELS, values(LAW(LEVELS))], axis=-1)[:, :: 1 if first else -1].tolist()
    head = f"PGA (g),{name}\n" if first else f"{name},PGA (g)\n"
    hazard = read(tmp_path, head + "".join(f"{a!r},{b!r}\n" for a, b in rows))
    assert hazard.rate == pytest.approx(LAW(LEVELS), rel=1e-9)
    assert hazard.intensity == pytest.approx(LEVELS, rel=1e-12)


def test_a_comment_may_name_the_columns_or_the_measure(tmp_path):
    named = read(tmp_path, "# site 3\n# PGA (m/s2), return period (years)\n1,475\n2,2475\n")
    assert (named.intensity.tolist(), named.measure) == (pytest.approx([1 / G, 2 / G]), "PGA")
    assert named.rate.tolist() == [1 / 475, 1 / 2475]
    told = read(tmp_path, "# PGA at Pavia\n0.1,3e-3\n0.3,2e-4\n")
    assert (told.measure, told.note) == (
        "PGA",
        "Its file names no columns: they were read as PGA in g, and annual rates.",
    )
    assert read(tmp_path, "# SA(2.0) at Pavia\n0.1,3e-3\n0.3,2e-4\n").measure == "Sa(2.0)"
    assert read(tmp_path, "# PGA and SA(2.0)\n0.1,3e-3\n0.3,2e-4\n").measure == ""
    with pytest.raises(ValueError, match=r"got 0\.003, .*, while a comment speaks of return periods or prob.*accepted"):
        read(tmp_path, "# probabilities in 50 years\n0.1,3e-3\n0.3,2e-4\n")
    with pytest.raises(ValueError, match="unit of the intensity: got 'cm/s', accepted: g, "):
        read(tmp_path, "# PGA (cm/s), annual rate\n0.1,3e-3\n0.3,2e-4\n")


def test_two_points_of_a_national_map(tmp_path):
    hazard = read(tmp_path, "return period (years);PGA (g)\n475;0,16\n2475;0,31\n")
    assert (hazard.intensity.tolist(), hazard.rate.tolist()) == ([0.16, 0.31], [1 / 475, 1 / 2475])
    assert hazard.note == "The hazard's file gives PGA in g and return periods."
    yearly = read(tmp_path, "PGA (g),annual probability\n0.16,2.1e-3\n0.31,4e-4\n")
    assert yearly.note == "The hazard's file gives PGA in g and probabilities in 1 year."
    rare = read(tmp_path, "PGA,annual rate\n0.5,1e-3\n4,1e-6\n")
    assert rare.intensity.tolist() == [0.5, 4.0]


def test_a_time_may_stand_in_a_comment(tmp_path):
    hazard = read(tmp_path, "# investigation_time = 50\nPGA (g),poe\n0.1,0.1\n0.3,0.02\n1,1e-3\n")
    assert hazard.rate == pytest.approx(-np.log1p([-0.1, -0.02, -1e-3]) / 50.0, rel=1e-12)
    certain = read(tmp_path, "PGA (g),poe in 50 years\n0.01,1\n0.1,0.1\n0.3,0.02\n1,0\n")
    assert (certain.intensity.tolist(), certain.end) == ([0.1, 0.3, 1.0], 1.0)
    assert certain.note.endswith("probabilities in 50 years; those equal to 1 (1) give no rate and are left out.")


@pytest.mark.parametrize(
    ("comment", "rates", "asked"),
    [("# 50 years", (0.4, 0.02), True), ("# T = 1 year", (0.4, 0.02), False), ("# 475-yr map", (2.0, 0.02), False),
     ("#", (1.0, 1.0, 0.02), True), ("#", (1.0, 0.02), False)],
)  # fmt: skip
def test_rates_that_look_like_probabilities_draw_a_question(tmp_path, comment, rates, asked):
    rows = "".join(f"{0.1 * k},{rate}\n" for k, rate in enumerate(rates, 1))
    hazard = read(tmp_path, f"{comment}\nPGA (g),annual rate\n{rows}")
    question = " Are they not probabilities in several years?" * asked
    assert hazard.note == f"The hazard's file gives PGA in g and annual rates.{question}"


NAMES = r"accepted: two numbers, or two names as in 'PGA \(g\),annual rate', 'PGV \(cm/s\),return period.* \(line 1\)"
ASKED = r"accepted: a first line that names the columns, as 'PGA \(g\),annual rate', "


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", r"h\.csv: got no numbers"),
        ("0.1,1e-2\nx,1\n", r"h\.csv: got 'x', accepted: finite numbers \(line 2\)"),
        ("0.1,1e-2\n1\n", r"got '1', accepted: an intensity and a rate, two plain numbers \(line 2\)"),
        ("0.1,1e-2\n0.2,1e-3,3\n", r"got '0.2,1e-3,3', accepted: an intensity and a rate, .* \(line 2\)"),
        # A first line is never dropped.
        ("0.1,5e-2,note\n0.2,1e-3\n0.3,1e-4\n", f"got '0.1,5e-2,note', {NAMES}"),
        ("0.1 g,5e-2\n0.2,1e-3\n0.3,1e-4\n", f"got '0.1 g,5e-2', {NAMES}"),
        ("x,y\n0.2,1e-3\n0.3,1e-4\n", f"got 'x,y', {NAMES}"),
        ("spectral acceleration (g),rate\n0.2,1e-3\n0.3,1e-4\n", f"got 'spectral .*', {NAMES}"),
        ("PGA (g),exceedance\n0.2,1e-3\n0.3,1e-4\n", f"got 'PGA .g.,exceedance', {NAMES}"),
        ("PGA rate,PGV rate\n0.2,1e-3\n0.3,1e-4\n", f"got 'PGA rate,PGV rate', {NAMES}"),
        ("SA,rate\n0.2,1e-3\n0.3,1e-4\n", f"got 'SA.*', {NAMES}"),
        ("Sv(1.0),rate\n0.2,1e-3\n0.3,1e-4\n", f"got 'Sv.*', {NAMES}"),
        ("PGV*,rate\n0.2,1e-3\n0.3,1e-4\n", f"got 'PGV.*', {NAMES}"),
        ("SA(99),rate\n0.2,1e-3\n0.3,1e-4\n", r"measure: got 'sa\(99\)', accepted: .* a period of 0\.01 to 20 s"),
        ("PGA (cm/s),rate\n0.2,1e-3\n", r"unit of the intensity: got 'cm/s', accepted: g, m/s², cm/s², %g"),
        ("PGA (g),poe\n0.2,1e-1\n", "got 'PGA .g.,poe', accepted: its time too, as in 'probability in 50 y"),
        ("PGA (g),poe in 50 years\n0.2,10\n0.3,2\n", r"probability: got 10\.0, accepted: 0 to 1, or a name of the"),
        # No map has 18 g in 475 years.
        ("PGA,return period\n18,475\n34,2475\n", r"got PGA in no unit, up to 34 at 0\.0004 a y.*, 'PGA \(%g\)'$"),
        ("PGV,return period\n9,475\n17,2475\n", r"got PGV in no unit, up to 17 at .*'PGV \(m/s\)', 'PGV \(cm/s\)'"),
        ("PGA (g),return period\n475,0.15\n2475,0.32\n", r"got PGA in g, up to 2475 at 0\.0004 a year, .* exchanged"),
        ("PGA (g),return period\n0.2,0\n0.3,2\n", r"return period: got 0\.0, accepted: years above 0"),
        # Without names, what may be something else is asked.
        ("0.1,475\n0.3,2475\n", rf"got 475, 2475, \.\.\. in .* column, that rise, as return periods do, {ASKED}"),
        ("0.16,0.1\n0.31,0.02\n", rf"got 0\.1, 0\.02, .*, of which maps are drawn as prob.* in 50 years, {ASKED}"),
        ("0.16,10\n0.31,2\n", rf"got 10, 2, \.\.\. in the second column, of which maps are drawn as .*, {ASKED}"),
        ("0.01,.93\n0.1,.4\n1,.003", rf"got 0\.93, 0\.4, .*, from 0\.93 down, as of probabilities in .*, {ASKED}"),
        ("1;2,475\n2;4,975\n", r"got '1;2,475', accepted: an intensity and a rate, .* \(line 1\)"),
        ("0.1,1e-2\n0.1,1e-3\n", r"h\.csv: hazard\.intensity\[1\]: got 0\.1, accepted: values that rise"),
        ("0.1,3e-3\n0.2,3e-3\n", r"hazard\.rate\[1\]: got 0\.003, accepted: a rate that falls to the last point"),
        ("0.1,1e-2\n0.2,-1\n", r"hazard\.rate: got"),
        ("0.1,1e-2\n", r"hazard\.intensity: got"),
        ("PGA (g),rate\n0.1,1e-2\n0.2,nan\n", r"got 'nan', accepted: finite numbers \(line 3\)"),
    ],
)  # fmt: skip
def test_what_is_no_hazard_is_refused_with_what_to_write(tmp_path, text, said):
    with pytest.raises(ValueError, match=said):
        read(tmp_path, text)


def curves(*places, plateau=1.0):
    poes = ",".join(f"{poe:.6E}" for poe in [plateau, *-np.expm1(-50.0 * LAW(LEVELS)), 0.0])
    return COMMENT + SITES + "".join(f"{place},0.00000,{poes}\n" for place in places)


def test_a_hazard_curve_that_openquake_exports(tmp_path):
    hazard = read(tmp_path, curves("9.15000,45.16667"))
    assert hazard.intensity.tolist() == [0.1, 0.3, 1.0, 4.0]
    assert hazard.rate == pytest.approx([*LAW(LEVELS), 0.0], rel=1e-5)
    assert (hazard.measure, hazard.end) == ("PGA", 4.0)
    assert hazard.note.startswith(
        "It is OpenQuake's PGA at 9.15000,45.16667, from probabilities in 50 years; those equal to 1"
    )
    named = read(tmp_path, curves("a,9.15,45.17").replace("lon,", "custom_site_id,lon,").replace("PGA", "PGV"))
    assert named.intensity.tolist() == pytest.approx([0.001, 0.003, 0.01, 0.04])
    older = f'# mean, investigation_time=50.0, imt="PGA", checksum=3\n{curves("1,2").partition(chr(10))[2]}'
    assert read(tmp_path, older).rate.tolist() == hazard.rate.tolist()
    flat = read(tmp_path, curves("9,45", plateau=-math.expm1(-50.0 * LAW(0.1))))
    assert flat.exponents[0] == 0.0


def test_the_site_is_chosen_and_never_guessed(tmp_path):
    text = curves("9.15,45.16", "-70.5,-33.25").replace("4.877058E-02", "1.000000E-02", 1)
    first, second = (read(tmp_path, text, site=site) for site in (1, "-70.5, -33.251"))
    assert first.rate[2] == pytest.approx(-math.log1p(-0.01) / 50.0)
    assert second.rate[2] == pytest.approx(LAW(1.0), rel=1e-5)
    assert "at -70.5,-33.25," in second.note
    listed = r"accepted: 'lon,lat' to \.01°, or a number, of 1: 9\.15,45\.16; 2: -70\.5,-33\.25$"
    for site in (None, 3, 0, "9.15,45.2", "Pavia"):
        with pytest.raises(ValueError, match=rf"site: got {re.escape(repr(site))}, {listed}"):
            read(tmp_path, text, site=site)
    with pytest.raises(ValueError, match=r"2: 1,2; .*; \.\.\. 12 in all$"):
        read(tmp_path, curves(*["1,2"] * 12))
    with pytest.raises(ValueError, match="site: got 1, accepted: none, as the file has one site"):
        read(tmp_path, "0.1,1e-2\n1,1e-4\n", site=1)
    for lost in ("imt='PGA'", "investigation_time=50.0, "):
        with pytest.raises(
            ValueError, match=r"OpenQuake: got 'imt=.*nothing.*accepted: imt='PGA', 'PGV' or 'SA.T.' and invest"
        ):
            read(tmp_path, curves("1,2").replace(lost, ""))
    with pytest.raises(ValueError, match=r"kind=std', accepted: .*, any kind but the deviation 'std'"):
        read(tmp_path, curves("1,2").replace("mean", "std"))
    with pytest.raises(ValueError, match="got 'imt=IA"):
        read(tmp_path, curves("1,2").replace("'PGA'", "'IA'"))
    with pytest.raises(ValueError, match="got 1 lines below the names, accepted: sites with 8 columns each"):
        read(tmp_path, curves("1"))


def test_the_command_takes_measure_and_site_of_the_file(tmp_path, capsys):
    scene = Scene(Block(0.9, SIZE), record(0), NoNoise())
    (tmp_path / "rack.toml").write_text(scene.to_toml())
    (tmp_path / "h.csv").write_text(curves("9.15,45.16", "-70.5,-33.25"))
    words = ["risk", str(tmp_path / "rack.toml"), "--synthetic", "5", "--hazard", str(tmp_path / "h.csv")]
    assert cli.main(words) == 2
    assert "site: got None, accepted: 'lon,lat' to .01°, or a number, of 1: 9.15,45.16; 2: " in capsys.readouterr().err
    words.append("--site=-70.5,-33.25")
    assert cli.main(words) == 2
    said = "measure of the hazard: got 'PGA', accepted: PGV, as for the curve; measure='PGA' (--measure) "
    assert said in capsys.readouterr().err
    assert cli.main([*words, "--measure", "PGA", "--json", "--out", str(tmp_path / "out")]) == 0
    values = json.loads(capsys.readouterr().out)
    hazard = Hazard.from_csv(tmp_path / "h.csv", site=2)
    shaken = study(scene, synthetic_records(5), hazard, measure="PGA")
    assert values["risk"]["rate"] == pytest.approx(shaken.risk.rate, rel=1e-12)
    note = "It is OpenQuake's PGA at -70.5,-33.25, from probabilities in 50 years; those equal to 1 (1) give no rate "
    assert note in (tmp_path / "out" / "risk.txt").read_text(encoding="utf-8")
    about = ET.parse(tmp_path / "out" / "rocking_block.xml").getroot()[0][0].text
    assert "OpenQuake takes a hazard at its levels alone: its classical_damage gives the rate " in about
    assert f" from the {hazard.intensity.size} levels of this study, and " in about
    assert "levels 5 % apart from " in about
