#!/usr/bin/env bash
# MuJoCo: at an impact the default contact takes the more speed from a rocking block the smaller the block is.
#
# One would guess: blocks of one shape rock alike, only slower or faster. Falling from edge to edge, one that is 8 times
# as high as wide keeps .977 of its angular velocity (Housner), and an engine meets that for every size or for none.
# What happens: a block .5 m wide keeps .97, one of 35 mm only .87, so that it comes to rest several times sooner. The
# default solref is a time, .02 s, in which the contact gives way. With ".002 1" and a step of .0005 s both keep .98.
# Seen with MuJoCo 4.0.0.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check mujoco==4.0.0 numpy==2.4.6
cd "$folder"
"$folder/venv/bin/python" - <<'PYTHON'
import math

import mujoco
import numpy as np

ANGLE = math.atan(1.0 / 8.0)  # critical angle of a block 8 times as high as wide
HOUSNER = 1.0 - 1.5 * math.sin(ANGLE) ** 2
SCENE = """<mujoco><option timestep="{step}" cone="elliptic"/><worldbody>
<geom type="plane" size="0 0 1" solref="{solref}"/>
<body pos="{x} 0 {z}" quat="{c} 0 {s} 0"><freejoint/>
<geom type="box" size="{half} {half} {high}" density="2700" solref="{solref}"/></body>
</worldbody></mujoco>"""


def kept(width, solref, step):
    """Part of the angular velocity kept at the first impact, from the energies of the swings before and after it."""
    half, tilt = 0.5 * width, 0.6 * ANGLE
    high, c, s = 8.0 * half, math.cos(tilt), math.sin(tilt)
    place = {"x": half - half * c + high * s, "z": half * s + high * c, "half": half, "high": high}
    values = place | {"c": math.cos(0.5 * tilt), "s": math.sin(0.5 * tilt), "solref": solref, "step": step}
    model = mujoco.MjModel.from_xml_string(SCENE.format(**values))
    data, tilts = mujoco.MjData(model), []
    while data.time < 8.0 * math.sqrt(width / 0.5):
        mujoco.mj_step(model, data)
        tilts.append(2.0 * math.atan2(data.qpos[5], data.qpos[3]))
    tilts = np.array(tilts)
    swings = np.split(tilts, np.flatnonzero(tilts[1:] * tilts[:-1] < 0.0) + 1)[:2]
    before, after = (math.cos(ANGLE - np.abs(swing).max()) - math.cos(ANGLE) for swing in swings)
    return math.sqrt(after / before)


print("mujoco", mujoco.__version__, f"Housner {HOUSNER:.3f}")
for width, default in ((0.5, 0.97), (0.035, 0.87)):
    soft, stiff = kept(width, "0.02 1", 0.002), kept(width, "0.002 1", 0.0005)
    print(f"{1000 * width:.0f} mm: {soft:.3f} by default, {stiff:.3f} with solref .002")
    assert abs(soft - default) < 0.01
    assert abs(stiff - HOUSNER) < 0.005
PYTHON
