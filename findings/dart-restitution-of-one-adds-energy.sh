#!/usr/bin/env bash
# DART: the restitution of a contact does not set that of rocking, and 1 makes a rocking block gain energy.
#
# One would guess: a block of .6 x 1.8 m that falls back from half its critical angle loses less at its impacts the
# larger the coefficient of restitution is, and keeps its energy at 1.
# What happens: from 0 to .9 it has .52 of its energy after 1.5 s, whatever the coefficient: the impact is that of a block
# that turns about its other edge. At 1 the energy grows at every impact and has doubled after 8 s.
# Seen with dartpy 6.20.0.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check dartpy==6.20.0 numpy==2.4.6
cd "$folder"
"$folder/venv/bin/python" - <<'PYTHON'
import importlib.metadata

import dartpy as dart
import numpy as np

HALF_WIDTH, HALF_HEIGHT, MASS, STEP = 0.3, 0.9, 1000.0, 0.001


def body(joint_and_body, size, restitution):
    """Give a body its box, friction 1 and restitution."""
    shape = joint_and_body[1].createShapeNode(dart.dynamics.BoxShape(size))
    shape.createCollisionAspect()
    contact = shape.createDynamicsAspect()
    contact.setFrictionCoeff(1.0)
    contact.setRestitutionCoeff(restitution)
    return joint_and_body


def energies(restitution):
    """Energy above that at rest every half second for 8 s, over that at the start."""
    world = dart.simulation.World("world")
    world.setTimeStep(STEP)
    world.setGravity([0.0, 0.0, -9.81])
    ground, block = dart.dynamics.Skeleton("ground"), dart.dynamics.Skeleton("block")
    joint, _ = body(ground.createWeldJointAndBodyNodePair(), [20.0, 20.0, 1.0], restitution)
    place = dart.math.Isometry3()
    place.set_translation([0.0, 0.0, -0.5])
    joint.setTransformFromParentBodyNode(place)
    box = 2.0 * np.array([HALF_WIDTH, HALF_WIDTH, HALF_HEIGHT])
    joint, solid = body(block.createFreeJointAndBodyNodePair(), box.tolist(), restitution)
    solid.setMass(MASS)
    solid.setMomentOfInertia(*(MASS / 12.0 * (box @ box - box**2)))
    tilt = 0.5 * np.arctan2(HALF_WIDTH, HALF_HEIGHT)
    c, s = np.cos(tilt), np.sin(tilt)
    turn = np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])
    place = dart.math.Isometry3()
    place.set_translation(turn @ [-HALF_WIDTH, 0.0, HALF_HEIGHT] + [HALF_WIDTH, 0.0, 0.0])
    place.set_rotation(turn)
    joint.setRelativeTransform(place)
    world.addSkeleton(ground)
    world.addSkeleton(block)
    energy = []
    for _ in range(round(8.0 / STEP)):
        energy.append(block.computeKineticEnergy() + block.computePotentialEnergy() - MASS * 9.81 * HALF_HEIGHT)
        world.step()
    return np.array(energy[:: round(0.5 / STEP)]) / energy[0]


print("dartpy", importlib.metadata.version("dartpy"))
for restitution in (0.0, 0.5, 0.9):
    left = energies(restitution)
    print(f"restitution {restitution}: energy after 1.5 s {left[3]:.3f}, after 4 s {left[8]:.3f}")
    assert abs(left[3] - 0.52) < 0.02
    assert left[8] < 0.03
left = energies(1.0)
print(f"restitution 1: energy after 1.5 s {left[3]:.3f}, after 7.5 s {left[-1]:.3f}")
assert left[3] > 1.05
assert left[-1] > 1.7
PYTHON
