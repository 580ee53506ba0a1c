"""The synthetic record of the project: Kanai-Tajimi noise with an envelope, no recording of any earthquake.

White noise through a Kanai-Tajimi filter (ω = 15 rad/s, ζ = 0.6, firm ground) and a second filter that takes out what
is slower than 0.25 Hz, times an envelope that rises like t² in 4 s, holds for 10 s and dies away like exp(-0.25 t); the
peak is 0.35 g. 40 s in samples of 0.01 s, always the same ones. The record is under the project's own licence.

Run from the repository root, a second:

    .venv/bin/python cases/records/synthetic.py
"""

import math
import pathlib

import numpy as np

INTERVAL, COUNT, PEAK = 0.01, 4001, 0.35
GROUND, DAMPING, SLOWEST = 15.0, 0.6, 2.0 * math.pi * 0.25
PATH = pathlib.Path(__file__).with_name("synthetic.AT2")


def acceleration():
    """Acceleration of the base in g at the samples, shape (4001,)."""
    rng, size = np.random.default_rng(1960), 2 * COUNT
    omega = 2.0 * math.pi * np.fft.rfftfreq(size, INTERVAL)
    soil = (GROUND**2 + 2j * DAMPING * GROUND * omega) / (GROUND**2 - omega**2 + 2j * DAMPING * GROUND * omega)
    fast = -(omega**2) / (SLOWEST**2 - omega**2 + 2j * DAMPING * SLOWEST * omega)
    steady = np.fft.irfft(np.fft.rfft(rng.standard_normal(size)) * soil * fast, size)[COUNT:]
    time = INTERVAL * np.arange(COUNT)
    envelope = np.minimum(1.0, (time / 4.0) ** 2) * np.exp(-0.25 * np.maximum(0.0, time - 14.0))
    motion = steady[:COUNT] * envelope
    return PEAK * motion / np.abs(motion).max()


def text(samples):
    """Text of a PEER file with samples in g."""
    rows = ["".join(f"{value:15.7E}" for value in samples[k : k + 5]) for k in range(0, len(samples), 5)]
    head = (
        "SYNTHETIC RECORD, NOT OF ANY EARTHQUAKE (cases/records/synthetic.py)",
        "Kanai-Tajimi noise with an envelope, BSD 3-Clause as the project",
        "ACCELERATION TIME SERIES IN UNITS OF G",
        f"NPTS=  {len(samples)}, DT=   {INTERVAL:.4f} SEC",
    )
    return "\n".join([*head, *rows]) + "\n"


if __name__ == "__main__":
    PATH.write_text(text(acceleration()), encoding="utf-8")
