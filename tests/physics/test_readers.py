"""Record files of archives and programs: small files in their layouts, with own numbers, whole and broken."""

import gzip
import re

import numpy as np
import pytest

from fpk_rocking import Record
from fpk_rocking.physics.forcing.readers import reading
from fpk_rocking.physics.forcing.readers.components import Component
from fpk_rocking.physics.forcing.readers.terms import UNITS, is_vertical, unit_of

RNG = np.random.default_rng(11)
N = 47
SAMPLES = np.round(RNG.normal(size=N), 3)
OTHER = np.round(RNG.normal(size=N), 3)
UP = np.round(RNG.normal(size=N), 3)


def block(values, each, form):
    """Values in rows of `each`, in a format."""
    return "".join(
        "".join(form.format(value) for value in values[k : k + each]) + "\n" for k in range(0, len(values), each)
    )


def peak(values):
    return values[np.abs(values).argmax()]


def peer(samples=SAMPLES):
    head = "PEER STRONG MOTION DATABASE RECORD\nSOMEWHERE 1/2/03, TOWN HALL, 040 (OWN STATION 7)\n"
    third = f"ACCELERATION TIME HISTORY IN UNITS OF G. FILTER POINTS: HP=0.1 Hz LP=40.0 Hz\nNPTS= {N}, DT= .01000 SEC\n"
    return head + third + block(samples, 5, "{:15.7E}")


def knet(direction="E-W", counts=None):
    counts = np.round(1000.0 * np.resize(SAMPLES, 100) + 300).astype(int) if counts is None else counts
    shaken = (counts - counts.mean()) * 0.001
    fields = {
        "Origin Time": "2001/01/01 00:00:00",
        "Lat.": "40.0",
        "Long.": "140.0",
        "Depth. (km)": "9",
        "Mag.": "5.0",
        "Station Code": "OWN001",
        "Station Lat.": "40.1",
        "Station Long.": "140.1",
        "Station Height(m)": "3",
        "Record Time": "2001/01/01 00:00:09",
        "Sampling Freq(Hz)": "100Hz",
        "Duration Time(s)": "1",
        "Dir.": direction,
        "Scale Factor": "2000(gal)/2000000",
        "Max. Acc. (gal)": f"{np.abs(shaken).max():.3f}",
        "Last Correction": "2001/01/01 00:00:09",
        "Memo.": "",
    }
    return "".join(f"{name:18}{value}\n" for name, value in fields.items()) + block(counts, 8, "{:9d}")


def afad():
    head = {
        "EVENT_NAME": "X",
        "EVENT_ID": "1",
        "STATION_CODE": "0001",
        "SAMPLING_INTERVAL_S": "0.01",
        "NDATA": N,
        "STREAM": "HNE",
        "UNITS": "cm/s^2",
        "PGA_CM/S^2": f"{peak(SAMPLES):.3f}",
        "DATA_TYPE": "Acceleration",
    }
    lines = "".join(f"{name}: {value}\n" for name, value in head.items())
    return "AAD_Filtered_TADAS_FILE\nAAD_FILTER_ORDER: 1\n" + lines + block(SAMPLES, 1, "{}")


def afad_old():
    return (
        f"STRONG GROUND MOTION RECORDS OF TURKIYE\nPLACE : OWN\nNUMBER OF DATA          : {N}\n"
        f"SAMPLING INTERVAL (sec) : 0.01\nRAW PGA VALUES (gal)    : (N-S) 1. (E-W) 1. (U-D) 1.\n"
        "       N-S          E-W          U-D\n"
    ) + "".join(f"{a:14.6f}{b:14.6f}{c:14.6f}\n" for a, b, c in zip(OTHER, SAMPLES, UP, strict=True))


def cosmos():
    integers = block([-999] * 100, 10, "{:8d}")
    reals = np.full(100, -999.0)
    reals[[33, 61, 63]] = 0.005, 10.0, peak(SAMPLES)
    texts = "".join(f"line {k}\n" for k in range(7))
    return (
        f"Corrected acceleration    (Format v01.20 with 13 text lines)\nRecord of Own Earthquake\n{texts}"
        "Sta Cha:  1: 340 deg (Rcrdr Chan  1) Location: own\na\nb\nc\n"
        f" 100 Integer-header values follow on  10 lines, Format= (10I8)\n{integers}"
        f" 100 Real-header values follow on  17 lines, Format= (6F13.6)\n{block(reals, 6, '{:13.6f}')}"
        f"  1 Comment line(s) follow, each starting with a |\n| own\n"
        f"   {N}  acceleration pts, approx    1 secs, units=cm/sec2(04),Format=(8F10.5)\n"
        f"{block(SAMPLES, 8, '{:10.5f}')}"
        "End-of-data for Chan  1 acceleration\n"
    )


def geonet(names=("N10E", "N80W", "Up")):
    text = ""
    for name, values in zip(names, (SAMPLES, OTHER, UP), strict=True):
        head = [
            "Corrected accelerogram OWN  GNS Science",
            "Site OWN",
            "Own Town",
            "Instrument X",
            "",
            "",
            "",
            "",
            "Epicentre",
        ]
        head += [f"Number of points  {N}    Duration  0.46 sec", "Instrument corrected data at 0.010 sec intervals", ""]
        head += [f"Component {name}", f"Acceleration:  peak   {peak(values)} mm/s/s at  .2 sec     rms     1.0 mm/s/s"]
        head += ["Velocity:      peak  -1.0 mm/s", "Displacement:  peak  -1.0 mm rms 1.0"]
        integers = block([0] * 30 + [1, 1, 1, N, N, N, 0, 0, 0, 0], 10, "{:8d}")
        data = "".join(block(part, 10, "{:8.3f}") for part in (values, 10.0 * values, 20.0 * values))
        text += "\n".join(head) + "\n" + integers + block([0.0] * 60, 10, "{:8.3f}") + data
    return text


def smc(kind="2 CORRECTED ACCELEROGRAM", inclination=90):
    integers, reals = np.full(48, -32768), np.full(50, 1.7e38)
    integers[[12, 13, 15, 16]] = inclination, 45, 1, N
    reals[1] = 100.0
    texts = ["*", "OWN", "  2001  1  1  Own, CA", "Moment Mag=", "station = Own component= 45"]
    texts += [f"epicentral dist =     89.0       pk acc =   {peak(SAMPLES)}", "inst type=X", "*", "*", "*"]
    # Fields of ten characters: "-1.2345E+0", which run together.
    values = "".join(
        "".join(f"{v:11.4E}"[:9] + f"{v:.4E}"[-1] for v in SAMPLES[k : k + 8]) + "\n" for k in range(0, N, 8)
    )
    return (
        "\n".join([kind, *texts])
        + "\n"
        + block(integers, 8, "{:10d}")
        + block(reals, 5, "{:15.7E}")
        + "|own\n"
        + values
    )


HEADER = block([0] * 100, 16, "{:5d}") + block([0.0] * 50, 8, "{:10.3f}")


def csmip_1():
    text = ""
    for number, (name, values) in enumerate((("360 Deg", OTHER), ("Up", UP), ("90 Deg", SAMPLES)), 1):
        text += f"Uncorrected Accelerogram Data   Processed: 02/13/12\nRecord of own\nChan  {number}: {name}\n"
        text += f"No. of Points =  {N}  Record Length =   .470 sec\n{HEADER}"
        text += f"  {N} Accelerogram points at 100 pts/sec in units of g .      Format: (8f9.6)\n"
        text += block(values, 8, "{:9.6f}") + f"/&  ----------  End of Data for Channel  {number}  ----------\n"
    return text


def csmip_2():
    text = ""
    for number, (name, values) in enumerate((("90 DEG", SAMPLES), ("UP", UP), ("  0 DEG", OTHER)), 1):
        text += f"CORRECTED ACCELEROGRAM   OWN   CHAN  {number}: {name}  FROM\nOWN\nCHAN  {number}: {name}\n"
        text += f"PEAK ACCELERATION =  {peak(values)}    CM/SEC/SEC  AT   10.940   SEC.\n{HEADER}" + block(
            [0.0] * 50, 8, "{:10.3f}"
        )
        for what, unit, factor in (("ACCEL", "CM/SEC/SEC", 1.0), ("VELOC", "CM/SEC", 2.0), ("DISPL", "CM", 3.0)):
            text += f" {N} POINTS OF {what} DATA EQUALLY SPACED AT  .010 SEC.  (UNITS: {unit})\n"
            text += block(factor * values, 8, "{:10.3f}")
        text += f"/&  ----------  END OF DATA FOR CHANNEL  {number}  ----------\n"
    return text


def renadic():
    text = ""
    for number, (name, values) in enumerate((("EW", SAMPLES), ("NS", OTHER), ("V", UP)), 1):
        text += f"UNCORRECTED ACCELEROGRAM DATA\nOWN\n0911131\nCHAN  {number}: {name}       (STA CHN:  1)\n"
        text += f"NO. OF POINTS =   {N}  RECORD LENGTH = .470 SEC\n"
        text += f"UNITS OF UNCOR ACCEL ARE SEC AND G/10.     MAX  = -0.051 G, AT   3.910 SEC\n{HEADER}"
        pairs = np.column_stack([0.01 * np.arange(N), values]).ravel()
        text += block(pairs, 10, "{:7.3f}") + f"/&  ----------  END OF DATA FOR CHANNEL {number}  ----------\n"
    return text


def bhrc():
    text = ""
    for name, values in (("L1", SAMPLES), ("V2", UP), ("T3", OTHER)):
        text += f"* VOL1DS FILE:  0001/01\nCOMP {name}\nNO. OF POINTS =  {N}      DURATION =  {N / 100:.3f}\n"
        text += "UNITS ARE SECONDS AND G/10\n"
        text += HEADER + block(values, 12, "{:13.6E}")
    return text


def asa():
    keys = {
        "ORIENTACION C1-C6 (rumbo;orientacion)": "/N00E/V/N90E",
        "INTERVALO DE MUESTREO, C1-C6, (s)": "/0.01/0.01/0.01",
        "NUM. TOTAL DE MUESTRAS, C1-C6": f"/{N}/{N}/{N}",
        "ACEL. MAX.(Gal), C1-C6": f"/{peak(OTHER)}/{peak(UP)}/{peak(SAMPLES)}",
        "ACEL. MAX., C1-C6, EN LA MUESTRA": "/3/7/11",
        "UNIDADES DE LOS DATOS": "Gal",
        "FORMATO DATOS (FORTRAN,10 campos/dato)": "3F10.4",
    }
    lines = "".join(f"{name:39}: {value}\n" for name, value in keys.items())
    table = block(np.column_stack([OTHER, UP, SAMPLES]).ravel(), 3, "{:10.4f}")
    return f"ARCHIVO ESTANDAR DE ACELERACION:\n{lines}-----+-----\n      N00E         V      N90E\n-----+-----\n{table}"


def shake():
    text = ""
    for name, values in (("1   OUTCROPPING", SAMPLES), ("17  WITHIN", OTHER)):
        text += f" ACCE. TH AT TOP OF LAYER {name} - PROFILE:   own\n"
        text += f" N =  {N} DT =  0.010 AMAX= {np.abs(values).max():8.4f}  INPUT\n"
        text += block(values, 8, "{:10.6f}")
    return text


def csmnc():
    return (
        "051OWN010120080201\n0130420080246 2013-01-01 8:2:46 BTM\nSITE CONDITION: ROCK\nCOMP. EW\n"
        f"CORRECTED ACCELERATION    UNIT: CM/SEC/SEC\nNO. OF POINTS:  {N}  EQUALLY SPACED INTERVALS OF:  0.010  SEC\n"
        f"PEAK VALUE:    {peak(SAMPLES)}   AT   26.35 SEC    DURATION:  1 SEC\n\n"
    ) + block(SAMPLES, 8, "{:14.6E}")


def cwa():
    table = np.column_stack([0.01 * np.arange(N), UP, OTHER, SAMPLES])
    head = "#StationCode: OWN\n#RecordLength(sec): 0\n#SampleRate(Hz): 100\n#AmplitudeUnit:  gal. DCoffset(corr)\n"
    head += "#AmplitudeMAX. N:    2.034~   -2.931\n#DataSequence: Time U(+); N(+); E(+)\n#Data: 4F10.3\n"
    return head + block(table.ravel(), 4, "{:10.3f}")


def simbad():
    head = "Station Code / Name           : 1 / Own\nOrientation                   : EW\n"
    head += f"Time Increment (s)            : 0.01\nNumber of Data                : {N}\n"
    head += f"PGA (m/s/s)                   : {np.abs(SAMPLES).max():.7E}\nAccelaration time series in m/s/s\n"
    return head + block(SAMPLES, 5, "{:14.7E}")


def deepsoil():
    return f" {N}  0.01\n" + "".join(f" {0.01 * k:<12.6g}{a:.6E}\n" for k, a in enumerate(SAMPLES, 1))


def one_column():
    return f"own-motion\n{N} 0.0100\n" + block(SAMPLES, 1, "{:.2E}".replace("2E", "5E"))


def csv():
    rows = zip(0.01 * np.arange(N), OTHER, SAMPLES, UP, strict=True)
    return "time,acc_NS(gal),acc_EW(gal),acc_UD(gal)\n" + "".join(f"{t:.2f},{a},{b},{c}\n" for t, a, b, c in rows)


FILES = {
    "peer": (peer, None, "g", "040"),
    "afad": (afad, None, "cm/s2", "HNE"),
    "afad_old": (afad_old, "EW", "cm/s2", "E-W"),
    "cosmos": (cosmos, None, "cm/s2", "340 deg"),
    "geonet": (geonet, "N10E", "mm/s2", "N10E"),
    "smc": (smc, None, "cm/s2", "45 Deg"),
    "csmip_1": (csmip_1, "90 DEG", "g", "90 Deg"),
    "csmip_2": (csmip_2, 1, "cm/s2", "90 DEG"),
    "renadic": (renadic, "EW", "g/10", "EW"),
    "bhrc": (bhrc, "L1", "g/10", "L1"),
    "asa": (asa, "N90E", "cm/s2", "N90E"),
    "shake": (shake, 1, "g", "TOP OF LAYER 1 OUTCROPPING"),
    "csmnc": (csmnc, None, "cm/s2", "EW"),
    "cwa": (cwa, "E", "cm/s2", "E(+)"),
    "simbad": (simbad, None, "m/s2", "EW"),
    "deepsoil": (deepsoil, None, "", ""),
    "one_column": (one_column, None, "", ""),
    "csv": (csv, "EW", "cm/s2", "acc_EW(gal)"),
}


@pytest.mark.parametrize("name", FILES)
def test_files_of_a_family_are_read(name, tmp_path):
    """Also with other ends of lines, in UTF-16 and packed, and under any name."""
    make, component, unit, called = FILES[name]
    path = tmp_path / "motion.dat"
    for data in (
        make().encode(),
        make().replace("\n", "\r\n").encode(),
        make().encode("utf-16"),
        gzip.compress(make().encode()),
    ):
        path.write_bytes(data)
        record = Record.from_file(path, component=component, units=None if unit else "g")
        assert record.samples == pytest.approx(SAMPLES, abs=1e-4)
        assert record.interval == pytest.approx(0.01, rel=1e-9)
        assert record.units == (unit or "g")
        assert record.note == ""
    found = reading(path).components
    names = [one.name for one in found]
    assert called in names
    assert sum(bool(one.objection) for one in found) == sum(map(is_vertical, names)) == (len(found) in (3,))
    if len(found) > 1:
        with pytest.raises(ValueError, match=rf"got {len(found)} components, accepted: one of them by component"):
            Record.from_file(path, units=None if unit else "g")


def test_k_net_keeps_its_offset_and_says_a_borehole(tmp_path):
    path = tmp_path / "OWN001.EW"
    path.write_text(knet())
    record = Record.from_file(path)
    assert record.samples == pytest.approx(np.resize(SAMPLES, 100) + 0.3, abs=1e-3)
    assert (record.units, record.note) == ("cm/s2", "")
    path.write_text(knet("2"))
    assert Record.from_file(path).note == "It is of a borehole, below the ground."
    assert any("borehole" in sentence for sentence in Record.from_file(path).implausible)
    for direction in ("U-D", "3", "6"):
        path.write_text(knet(direction))
        with pytest.raises(ValueError, match="got the vertical component 'UD"):
            Record.from_file(path)


WRONG = {
    "spectra": (csmip_2().replace("CORRECTED ACC", "Response and Fourier amplitude spectra", 1), "response spectra"),
    "counts": (
        cosmos().replace("acceleration pts", "raw accel. pts").replace("cm/sec2(04)", "counts(50)"),
        "raw counts",
    ),
    "cut behind the accelerations": (geonet(["N10E"] * 3)[:-60], "16 lines of text, 24 of numbers, accepted: 16"),
    "cut before the numbers": ("\n".join(geonet().splitlines()[: 2 * 41 + 16]), "got 0 samples, accepted: the 10 that"),
    "no data": (csmip_1()[: csmip_1().rindex("(8f9.6)") + 8], f"got 0 samples, accepted: the {N}"),
    "a kind of SMC": (smc("0 UNKNOWN"), "a column whose name says no acceleration"),
    "uncorrected": (smc("1 UNCORRECTED ACCELEROGRAM"), "an uncorrected record"),
    "smc velocity": (smc("3 VELOCITY"), "got a velocity"),
    "smc vertical": (smc(inclination=0), "the vertical component"),
    "cosmos vertical": (cosmos().replace("| own", "|<SCNL>OWN.BNZ.AK.--"), "the vertical component 'BNZ 340 deg'"),
    "peer vertical": (peer().replace(", 040 (", ", UP ("), "the vertical component 'UP'"),
    "peer channel": (peer().replace(", 040 (", ", BHZ00 ("), "the vertical component 'BHZ00'"),
    "peer velocity": (peer().replace("ACCELERATION", "VELOCITY").replace("OF G.", "OF CM/S."), "a velocity '040'"),
    "velocity": ("time (s), Velocity (m/s)\n0,1\n1,2\n", "a velocity 'Velocity .m/s.'"),
    "displacement": ("t;disp [cm]\n0;1\n1;2\n", "a displacement 'disp .cm.'"),
    "strain": ("# Shear Strain Time Series\n# Time (s),S-1\n0,1\n1,2\n", "a strain 'S-1'"),
    "spectrum": ("T (s),Sa (g)\n0,1\n1,2\n", "a response spectrum"),
    "periods": ("Period (s),acc (g)\n0,1\n1,2\n", "a response spectrum"),
    "frequencies": ("freq (Hz),acc (g)\n0,1\n1,2\n", "a response spectrum"),
    "vertical column": ("time,acc_UD_g\n0,1\n1,2\n", "the vertical component 'acc_UD_g'"),
    "vertical words": ("time,Acceleration Z (m/s2)\n0,1\n1,2\n", "the vertical component 'Acceleration Z"),
    "vertical header": ("El Centro, vertical\n0 1\n1 2\n", "the vertical component"),
    "seismometer": ("time,BHE\n0,1\n1,2\n", "a seismometer's velocity 'BHE'"),
    "unknown unit": ("time,acc (mGal)\n0,1\n1,2\n", "the unknown unit 'mGal'"),
    "unknown column": ("time,theta\n0,1\n1,2\n", "a column whose name says no acceleration"),
    "unknown times": ("time (h),acc (g)\n0,1\n1,2\n", "times in 'h', accepted: s"),
    "two intervals": ("# dt = 0.01\n# Time Step: 0.02\n1\n2\n3\n", "header with '= 0.01' and ': 0.02' for one thing"),
    "times and interval": ("# dt = 0.02\n0.00 1\n0.01 2\n0.02 3\n", "times at 0.01 s, accepted: the 0.02 s"),
    "two units": ("# Acceleration (g)\n# units: m/s2\n1\n2\n", "a header with the units g and m/s2"),
    "a comment between": ("# dt=.01\n1\n2\n# NS\n1\n2\n", r"a comment or a blank line between samples, .* \(line 4\)"),
    "numbers and times": ("1 .00 3\n2 .01 4\n3 .02 3\n", "2 columns that rise, without names"),
    "a blank line": ("1\n2\n\n2\n", r"a comment or a blank line between samples, .* \(line 3\)"),
    "run together": ("0.0 1.2E-022.5E-03\n0.1 1.0\n", "got 0 samples|'1.2E-022.5E-03', accepted: finite numbers"),
    "columns for rows": (
        "\n".join(" ".join(f"{k + 9 * j}" for j in range(6)) for k in (5, 4, 3, 4, 5, 6)),
        "6 columns without",
    ),
    "lines for a count": ("npts = 4\n0 1\n1 2\n2 3\n", "3 lines of numbers, accepted: the 4"),
    "other names": ("time acc_x acc_y\n0 1\n1 2\n", "got 2 columns, accepted: the 3 that the line of names has"),
}


@pytest.mark.parametrize("name", WRONG)
def test_what_is_no_horizontal_acceleration_is_refused_by_name(name, tmp_path):
    text, says = WRONG[name]
    path = tmp_path / "motion.txt"
    path.write_text(text)
    with pytest.raises(ValueError, match=rf"forcing.file: '.*motion.txt': .*{says}"):
        Record.from_file(path, units="g", interval=0.01)


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("RSN1.VT2", "velocity"),
        ("RSN1.DT2", "displacement"),
        ("velocityHistory.txt", "velocity"),
        ("IV.X..HNE.DIS.MP.txt", "displacement"),
        ("Christchurch_UP.dat", "vertical component"),
        ("OWN001.UD", "vertical component"),
        ("a-strainTs.csv", "strain"),
        ("IU.CCM.00.BHE.txt", "seismometer's velocity"),
        ("CI.MIKB..HNZ.txt", "vertical component"),
    ],
)
def test_a_name_of_a_file_tells_where_its_text_does_not(name, says, tmp_path):
    (tmp_path / name).write_text("0 1\n1 2\n2 1\n")
    with pytest.raises(ValueError, match=f"got a {says}, as the name of the file says, accepted: a horizontal acc"):
        Record.from_file(tmp_path / name, units="g")
    for motion in ("UPLAND_spectrum_matched.txt", "SA-station.txt"):
        (tmp_path / motion).write_text("0 1\n1 2\n2 1\n")
        assert Record.from_file(tmp_path / motion, units="g").samples == (1.0, 2.0, 1.0)


def test_an_smc_file_of_unknown_kind_is_what_its_user_says(tmp_path):
    path = tmp_path / "motion.smc"
    path.write_text(smc("0 UNKNOWN"))
    record = Record.from_file(path, units="g", component=1)
    assert (record.units, record.interval) == ("g", 0.01)
    assert record.samples == pytest.approx(SAMPLES, abs=1e-4)


def test_what_a_file_leaves_open_is_asked_for_and_what_it_says_stands(tmp_path):
    path = tmp_path / "motion.th"
    path.write_text(block(SAMPLES, 1, "{}"))
    with pytest.raises(ValueError, match=r"units: missing, .*; forcing.interval: missing, .* --units and --interval\)"):
        Record.from_file(path)
    with pytest.raises(ValueError, match=r"forcing.interval: got 0.0"):
        Record.from_file(path, units="g", interval=0.0)
    record = Record.from_file(path, units="%g", interval=0.02)
    assert (record.interval, record.units, record.samples) == (0.02, "%g", tuple(SAMPLES))
    rows = tmp_path / "motion.acc"
    rows.write_text(block(SAMPLES, 5, "{:10.3f}"))
    assert Record.from_file(rows, units="g", interval=0.02).samples == tuple(SAMPLES)
    path.write_text(peer())
    with pytest.raises(
        ValueError, match=r"forcing.interval: got 0.02, accepted: 0.01, as the file .* says, or nothing"
    ):
        Record.from_file(path, interval=0.02)
    assert Record.from_file(path, interval=0.02, units="gal", where_unstated=True).interval == 0.01


def test_a_peak_that_the_file_states_and_does_not_have_is_told(tmp_path):
    path = tmp_path / "motion.asc"
    path.write_text(afad().replace(f"{peak(SAMPLES):.3f}", "9.9", 1))
    assert (
        Record.from_file(path).note == f"The file states a peak of 9.9, its samples have {np.abs(SAMPLES).max():.4g}."
    )


def test_numbers_of_lines_are_no_times(tmp_path):
    path = tmp_path / "motion.txt"
    path.write_text("".join(f"{k} {a}\n" for k, a in enumerate(np.resize(SAMPLES, 60), 1)))
    with pytest.raises(ValueError, match=r"forcing.interval: missing"):
        Record.from_file(path, units="g")
    assert Record.from_file(path, units="g", interval=0.02).samples == tuple(np.resize(SAMPLES, 60))


def test_zeros_behind_the_last_sample_are_left_out(tmp_path):
    path = tmp_path / "motion.dat"
    text = f"% own\n%  {N}    1.00000E-02  0  0  0.\n" + block([*SAMPLES, 0.0], 6, "{:12.5E}")
    path.write_text(text)
    record = Record.from_file(path, units="gal")
    assert record.samples == pytest.approx(SAMPLES)
    assert record.note == "1 zeros behind the last sample are left out."


def test_times_with_five_digits_are_equally_spaced(tmp_path):
    path = tmp_path / "motion.dat"
    lines = [f"{0.005 * k:.5g} {k % 7 - 3}\n" for k in range(40_000)]
    path.write_text("".join(lines))
    assert Record.from_file(path, units="g").interval == pytest.approx(0.005, rel=1e-4)
    del lines[900]
    path.write_text("".join(lines))
    with pytest.raises(ValueError, match=r"got the time 4.505 for 4.5, accepted: equally spaced"):
        Record.from_file(path, units="g")


def test_units_by_their_spellings():
    for text, unit in {
        "CM/SEC/SEC": "cm/s2",
        "cm/sec2.": "cm/s2",
        "mm/s/s": "mm/s2",
        "Gal": "cm/s2",
        "ft/s^2": "ft/s2",
        "m s-2": "m/s2",
        "G/10": "g/10",
        "% g": "%g",
        "mg": "mg",
        "in/sec**2": "in/s2",
        "inches/s2": "in/s2",
        "m/s²": "m/s2",
        "cm/s": None,
        "mGal": None,
        "kg": None,
        "s2": None,
        "m/s3": None,
        "cm": None,
        "": None,
    }.items():
        assert unit_of(text) == unit
    assert UNITS["g/10"] == pytest.approx(0.1 * UNITS["g"])


def test_an_event_names_the_chosen_component_whatever_letters_its_text_has(tmp_path):
    """A name stands at the end of the text, or is added; the letter N stands in OWN too."""
    for file, names in (("geonet", ("N", "E", "Up")), ("other", ("N10E", "N80W", "Up"))):
        (tmp_path / file).write_text(geonet(names))
        for name in names[:2]:
            assert Record.from_file(tmp_path / file, component=name).event == f"Site OWN, Own Town, {name}"


def test_azimuths():
    for name, azimuth in {
        "N08W": 352.0,
        "S74E": 106.0,
        "360 Deg": 360.0,
        "090": 90.0,
        "EW1": 90.0,
        "N-S": 0.0,
        "acc_EW(gal)": 90.0,
        "column 3": None,
        "Up": None,
        "L1": None,
        "HNN": 0.0,
        "W": 270.0,
        "S": 180.0,
        "acc_m/s2": None,
        "S-1": None,
        "BNE 400 deg": 90.0,
    }.items():
        assert Component(name, SAMPLES).azimuth == azimuth


def broken(rng, text):
    """A text that is cut, has lost a column or a word, has another line in its header, or another unit or count."""
    lines = text.splitlines()
    first = next(k for k, line in enumerate(lines) if re.fullmatch(r"[-+\d.,eE\s]+", line))
    kind = rng.integers(6)
    if kind == 0:
        return "\n".join(lines[: rng.integers(first + 1, len(lines) - 1)]) + "\n"
    if kind == 1:
        place = rng.integers(first, len(lines))
        lines[place] = re.sub(r"[\s,]*[-+.\dEe]+\s*$", "", lines[place])
    if kind == 2:
        lines = [re.sub(r"[\s,]+[-+.\dEe]+\s*$", "", line) if k >= first else line for k, line in enumerate(lines)]
    if kind == 3:
        lines.insert(
            rng.integers(0, max(first, 1)), rng.choice(["another line", "REMARK: 3 of 4", "# note", "12 34 words"])
        )
    if kind == 4:
        unit = rng.choice(["parsec", "xyz", "km/h", "cm", "mm/s"])
        return re.sub(r"\b(G/10|cm/s\^2|cm/sec2|CM/SEC/SEC|mm/s/s|m/s/s|gal|Gal|G|g)(?=\W)", unit, text)
    if kind == 5:
        return re.sub(rf"\b{N}\b", str(N + rng.integers(-3, 4)), text)
    return "\n".join(lines) + "\n"


def test_of_300_broken_files_none_is_read_with_other_numbers(tmp_path):
    """Each is refused or read as the whole one is; a table without a count may end early, and is not cut here."""
    rng, path, refusals = np.random.default_rng(20), tmp_path / "motion.dat", []
    names = [name for name in FILES if name not in ("csv", "cwa")]
    for case in range(300):
        name = names[case % len(names)]
        make, component, unit, _ = FILES[name]
        text = broken(rng, make())
        path.write_text(text)
        try:
            record = Record.from_file(path, component=component, units=None if unit else "g")
        except ValueError as error:
            refusals.append(str(error))
            continue
        assert len(record.samples) == N, (name, text[:600])
        assert record.samples == pytest.approx(SAMPLES, abs=1e-4), name
        assert record.interval == pytest.approx(0.01, rel=1e-6), name
        assert record.units == (unit or "g"), name
    assert all(text.startswith("forcing.") for text in refusals)
    assert 100 <= len(refusals) <= 270
