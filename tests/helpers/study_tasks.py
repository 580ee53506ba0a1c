"""Tasks and scenes for sweeps in tests; a process or a cluster imports them from here."""

import os
import pathlib
import signal
import time

from fpk_rocking.scene import Block, Harmonic, NoNoise, Scene
from fpk_rocking.studies import grid

SCENE = Scene(block=Block(0.5), forcing=Harmonic(4.6, 2.7, 0.0), noise=NoNoise())
AMPLITUDES = 1.0, 2.0, 3.0, 4.0, 5.0
GRID = grid(SCENE, {"forcing.amplitude": AMPLITUDES})


def amplitude(scene, *, seed):
    """What the scene is, with its seed; refuses a negative phase."""
    if scene.forcing.phase < 0.0:
        raise ValueError(f"forcing.phase: got {scene.forcing.phase!r},\naccepted: a number >= 0")
    return {"amplitude": scene.forcing.amplitude, "seed": seed, "series": [0.0, 2.0 * scene.forcing.amplitude]}


def unwritable(scene, *, seed):
    return {"scene": scene, "seed": seed}


def infinite(scene, *, seed):
    return {"amplitude": scene.forcing.amplitude * float("inf"), "seed": seed}


def deadly(scene, *, seed, folder, times):
    """Kills its process at amplitude 3, the first `times` times; a file in the folder for each time it has begun."""
    begun = len(list(pathlib.Path(folder).glob("*")))
    if scene.forcing.amplitude == 3.0 and begun < times:
        (pathlib.Path(folder) / f"{begun}").touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return amplitude(scene, seed=seed)


def slow(scene, *, seed, seconds):
    time.sleep(seconds)
    return amplitude(scene, seed=seed)
