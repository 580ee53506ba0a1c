#!/usr/bin/env bash
# ObsPy: a K-NET record that is calibrated and saved as SAC is calibrated again when it is read.
#
# One would guess: read(..., apply_calib=True) gives m/s2 for K-NET's counts. Written as SAC, and read in the same way,
# it is the same motion.
# What happens: the samples are multiplied, but the trace keeps its factor; SAC takes it along as SCALE. The next read
# with apply_calib=True multiplies again: .497 m/s2 arrive as 3.2e-6. MiniSEED has no place for the factor and is right.
# Seen with ObsPy 1.5.1.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check numpy==2.4.6 obspy==1.5.1 scipy==1.17.1
cd "$folder"
"$folder/venv/bin/python" - <<'PYTHON'
import pathlib
import warnings

import numpy as np
import obspy

warnings.simplefilter("ignore")
GAL, COUNTS, PEAK = 3920, 6182761, 50.0
HEADER = f"""\
Origin Time       2020/01/01 00:00:00
Lat.              41.0
Long.             142.0
Depth. (km)       30
Mag.              6.0
Station Code      XYZ001
Station Lat.      41.5
Station Long.     141.0
Station Height(m) 4
Record Time       2020/01/01 00:00:30
Sampling Freq(Hz) 100Hz
Duration Time(s)  10
Dir.              E-W
Scale Factor      {GAL}(gal)/{COUNTS}
Max. Acc. (gal)   {PEAK:.3f}
Last Correction   2020/01/01 00:00:15
Memo.
"""
time = np.arange(1000) * 0.01
motion = PEAK * np.sin(2.0 * np.pi * time) * np.sin(0.1 * np.pi * time) ** 2  # gal
counts = np.round(motion * COUNTS / GAL).astype(int)
lines = ["".join(f"{count:9d}" for count in counts[i : i + 8]) for i in range(0, counts.size, 8)]
pathlib.Path("motion.EW").write_text(HEADER + "\n".join(lines) + "\n")
record = obspy.read("motion.EW", apply_calib=True)
peaks = {"K-NET": np.abs(record[0].data).max()}
for form in ("SAC", "MSEED"):
    record.write(f"motion.{form}", format=form)
    peaks[form] = np.abs(obspy.read(f"motion.{form}", apply_calib=True)[0].data).max()
print("obspy", obspy.__version__)
print("largest acceleration, m/s2:", *(f"{form} {peak:.4g}" for form, peak in peaks.items()))
right = 0.01 * np.abs(motion).max()
assert abs(peaks["K-NET"] / right - 1.0) < 1e-3
assert abs(peaks["MSEED"] / right - 1.0) < 1e-3
assert abs(peaks["SAC"] / (0.01 * GAL / COUNTS * right) - 1.0) < 1e-3
PYTHON
