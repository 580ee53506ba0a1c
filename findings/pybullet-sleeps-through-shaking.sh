#!/usr/bin/env bash
# PyBullet: a block that has fallen asleep stands under any shaking, by gravity or by a force.
#
# One would guess: sleeping saves time for bodies at rest, and whatever would move one wakes it, as contacts do.
# What happens: after 5 s at rest neither a gravity that is turned (the usual way to shake a base) nor
# applyExternalForce wakes the block: under 4 times g width/height it stands still, while the same block without sleep
# falls in both ways. An activation state set to wake up, before the shaking, makes it fall.
# Seen with PyBullet 3.2.7.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check pybullet==3.2.7 numpy==2.4.6
cd "$folder"
"$folder/venv/bin/python" - <<'PYTHON'
import importlib.metadata
import math

import pybullet

MASS, STEP, LENGTH, PEAK = 1000.0, 1e-3, 0.8, 4.0 * 9.81 / 3.0


def largest_tilt(sleeping, way, wake=False):
    """Largest tilt, rad, within 3 s of a block of .6 x 1.8 m that stood for 5 s, under a sine pulse of .8 s."""
    client = pybullet.connect(pybullet.DIRECT)
    pybullet.setTimeStep(STEP)
    pybullet.setGravity(0.0, 0.0, -9.81)
    ground = pybullet.createMultiBody(0.0, pybullet.createCollisionShape(pybullet.GEOM_PLANE))
    box = pybullet.createCollisionShape(pybullet.GEOM_BOX, halfExtents=[0.3, 0.3, 0.9])
    block = pybullet.createMultiBody(MASS, box, basePosition=[0.0, 0.0, 0.9])
    for body in (ground, block):
        pybullet.changeDynamics(body, -1, lateralFriction=1.0, linearDamping=0.0, angularDamping=0.0)
    if sleeping:
        pybullet.changeDynamics(block, -1, activationState=pybullet.ACTIVATION_STATE_ENABLE_SLEEPING)
    for _ in range(round(5.0 / STEP)):
        pybullet.stepSimulation()
    if wake:
        pybullet.changeDynamics(block, -1, activationState=pybullet.ACTIVATION_STATE_WAKE_UP)
    tilt = 0.0
    for step in range(round(3.0 / STEP)):
        time = step * STEP
        push = PEAK * math.sin(2.0 * math.pi * time / LENGTH) if time < LENGTH else 0.0
        place, turn = pybullet.getBasePositionAndOrientation(block)
        if way == "gravity":
            pybullet.setGravity(-push, 0.0, -9.81)
        else:
            pybullet.applyExternalForce(block, -1, [-MASS * push, 0.0, 0.0], place, pybullet.WORLD_FRAME)
        pybullet.stepSimulation()
        tilt = max(tilt, math.acos(min(1.0, pybullet.getMatrixFromQuaternion(turn)[8])))
    pybullet.disconnect(client)
    return tilt


print("pybullet", importlib.metadata.version("pybullet"))
for way in ("gravity", "force"):
    awake, asleep, woken = largest_tilt(False, way), largest_tilt(True, way), largest_tilt(True, way, wake=True)
    print(f"{way}: largest tilt {awake:.3f} without sleep, {asleep:.1e} with it, {woken:.3f} woken before")
    assert awake > 1.0
    assert asleep < 1e-3
    assert woken > 1.0
PYTHON
