"""Bifurcation diagram and boundary crisis.

The main scene without noise, with the amplitude A of the forcing as parameter. Shown are the Poincaré velocities of the
motion that a slowly growing and a slowly falling amplitude carry along and of the motion from rest, each in a panel of
its own; the symmetric orbits with one impact in each half cycle, in closed form; and how long blocks stand beyond the
crisis. Where the
symmetric orbit loses its stability a pair of orbits is born, each the other's mirror image, so that the three motions
need not agree; the pair doubles its period, turns chaotic and merges.

The boundary crisis ends the bounded attractor. It is bracketed to 1e-3 by bisection on this criterion: 64 blocks, begun
at as many successive Poincaré points of the attractor at A = 4.6, all stand for 20,000 cycles. An amplitude just above
the crisis can pass by chance, as blocks stand ever longer there: that is what the last panel is for, in which the mean
number of cycles is shown against the distance from the upper end of the bracket. A second cut-off, at twice the angle,
tells whether the end of the attractor depends on what is called overturning.

Run time: about twenty seconds on 2 cores, once the kernels are compiled.

    python cases/bifurcation.py --out results/bifurcation

Files: ``bifurcation.png``, ``bifurcation.json``.
"""

import math

import motion
import numpy as np
from command import command

from fpk_rocking import NoNoise, load_scene
from fpk_rocking.analytics.orbits import symmetric_orbits
from fpk_rocking.results import pictures, storage
from montecarlo import simulate

AMPLITUDES = tuple(np.round(np.arange(2.5, 4.8, 0.005), 4).tolist())
BLOCKS = 64
BRACKET = (4.6, 4.9)
WIDTH = 1e-3
BEYOND = (0.002, 0.004, 0.008, 0.016, 0.032, 0.064)
TRANSIENT, KEPT = 300, 100
_AMPLITUDE = "amplitude A of the forcing, nondimensional"


def run(out, amplitudes=AMPLITUDES, cycles=20_000) -> dict:
    """Compute, draw and write everything.

    Parameters
    ----------
    out : pathlib.Path
        Folder for the files; created if missing.
    amplitudes : sequence of float
        A of the diagram, ascending, nondimensional.
    cycles : int
        That all blocks have to stand where the attractor is called bounded.

    Returns
    -------
    dict
        What ``bifurcation.json`` holds.
    """
    scene = load_scene("main").varied(noise=NoNoise())
    points = {
        "from rest": [_settled(scene, amplitude, (0.0, 0.0)) for amplitude in amplitudes],
        "falling amplitude": continued(scene, amplitudes[::-1])[::-1],
        "growing amplitude": continued(scene, amplitudes),
    }
    cutoffs = [scene.overturning.angle, 2.0 * scene.overturning.angle]
    crises = [crisis(scene.varied(overturning={"angle": cutoff}), cycles) for cutoff in cutoffs]
    values = {
        "scene": scene.to_toml(),
        "amplitudes": list(amplitudes),
        "crisis": list(crises[0]),
        "crisis_at_twice_the_cutoff": list(crises[1]),
        "criterion": f"{BLOCKS} blocks begun on the attractor of A = {BRACKET[0]:g} all stand for {cycles} cycles",
        "rest_overturns": [a for a, settled in zip(amplitudes, points["from rest"], strict=True) if not len(settled)],
        "symmetric_orbit_stable_up_to": _stable_up_to(scene),
        "beyond": [_lifetime(scene, crises[0][1] + distance, cycles) for distance in BEYOND],
    }
    _draw(out / "bifurcation.png", scene, points, values)
    storage.write_json(out / "bifurcation.json", values)
    return values


def continued(scene, amplitudes):
    """Poincaré points (n, 2) at each amplitude, begun where the one before ended; n is 0 where the block overturned."""
    attractors, start = [], (0.0, 0.0)
    for amplitude in amplitudes:
        attractors.append(_settled(scene, amplitude, start))
        start = tuple(attractors[-1][-1]) if len(attractors[-1]) else (0.0, 0.0)
    return attractors


def _settled(scene, amplitude, start):
    """Poincaré points (KEPT + 1, 2) after `TRANSIENT` cycles from a start (angle, velocity); (0, 2) if it overturns."""
    angle, velocity = map(float, start)
    begun = scene.varied(forcing={"amplitude": amplitude}, start={"angle": angle, "velocity": velocity})
    block = simulate(begun, cycles=TRANSIENT + KEPT, realizations=1)
    points = np.stack([block.angle[0, TRANSIENT:], block.velocity[0, TRANSIENT:]], axis=1)
    return points if block.survivors[-1] else points[:0]


def crisis(scene, cycles):
    """Two amplitudes at most `WIDTH` apart between which the attractor of a scene without noise ends.

    At the first all of `BLOCKS` blocks stand for so many cycles, at the second not all of them.
    """
    low, high = BRACKET
    while high - low > WIDTH:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if np.isfinite(_overturned(scene, middle, cycles)).any() else (middle, high)
    return low, high


def _overturned(scene, amplitude, cycles):
    """Cycles (BLOCKS,) after which blocks overturn under an amplitude, nan for those that stand for `cycles`.

    They begin on the attractor of the lower end of `BRACKET`.
    """
    starts = _settled(scene, BRACKET[0], (0.0, 0.0))[-BLOCKS:]
    pushed = scene.varied(forcing={"amplitude": amplitude})
    begun = (pushed.varied(start={"angle": float(x), "velocity": float(v)}) for x, v in starts)
    times = [simulate(scene, cycles=cycles, realizations=1).overturn_time[0] for scene in begun]
    return np.array(times) / scene.period


def _lifetime(scene, amplitude, cycles):
    """Mean number of cycles that blocks stand, as if overturning came at a constant rate, and a 95 % interval."""
    times = _overturned(scene, amplitude, cycles)
    overturned = np.count_nonzero(np.isfinite(times))
    lifetime = {"amplitude": amplitude, "overturned": int(overturned), "cycles": None, "interval": None}
    if overturned:
        mean, factor = (
            float(np.nan_to_num(times, nan=cycles).sum() / overturned),
            math.exp(1.96 / math.sqrt(overturned)),
        )
        lifetime |= {"cycles": mean, "interval": [mean / factor, mean * factor]}
    return lifetime


def _orbits(scene, amplitude):
    """Return the symmetric orbits of a scene's block under another amplitude."""
    block = scene.block
    frequency, angle = scene.forcing.frequency, block.critical_angle
    return symmetric_orbits(amplitude, frequency, block.restitution, critical_angle=angle)


def _stable_up_to(scene):
    """Amplitude at which the stable symmetric orbit of the lowest amplitude loses its stability, to 1e-9."""
    low, high = AMPLITUDES[0], BRACKET[0]
    while high - low > 1e-9:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if any(orbit.stable for orbit in _orbits(scene, middle)) else (low, middle)
    return low


def _draw(path, scene, points, values):
    """Draw the diagrams of Poincaré points by their names, lists over the amplitudes, and the lifetimes."""
    note = (
        "Every diagram: Poincaré velocities after each of 100 cycles, 300 cycles after the start or the last amplitude."
    )
    stable, crisis = values["symmetric_orbit_stable_up_to"], np.mean(values["crisis"])
    title = (
        f"Without noise the symmetric orbit is stable up to A = {stable:.2f}; the attractor ends at A = {crisis:.2f}"
    )
    with pictures.page(path, (12.0, 9.0), title, [note]) as figure:
        panels = figure.subplot_mosaic([["growing", "growing", "beyond"], list(points)])
        _diagram(panels["growing"], scene, points["growing amplitude"], values, markersize=1.2)
        title = f"(a) Growing amplitude, Ω = {scene.forcing.frequency:g}, e = {scene.block.restitution:g}"
        panels["growing"].set_title(title)
        _orbits_named(panels["growing"], scene, values)
        for letter, name in zip("cde", points, strict=True):
            _diagram(panels[name], scene, points[name], values, markersize=0.8)
            panels[name].set(title=f"({letter}) {name.capitalize()}", xlim=(4.0, values["amplitudes"][-1] + 0.03))
            panels[name].sharey(panels["growing"])
        _beyond(panels["beyond"], values)


def _diagram(axes, scene, attractors, values, markersize):
    """Draw Poincaré velocities of attractors, one list of points (n, 2) an amplitude, and the symmetric orbits."""
    amplitudes = np.array(values["amplitudes"])
    places, velocity = np.repeat(amplitudes, [len(points) for points in attractors]), np.concatenate(attractors)[:, 1]
    axes.plot(places, velocity, ".", markersize=markersize, color=pictures.COLOURS[0], rasterized=True)
    for line, orbit in zip(("-", "--"), _symmetric(scene, amplitudes), strict=True):
        axes.plot(amplitudes, orbit, line, color="black", linewidth=1.2)
    axes.axvline(np.mean(values["crisis"]), color=pictures.OVERTURNED, linewidth=1.0)
    axes.set(xlabel=_AMPLITUDE, ylabel=motion.VELOCITY)


def _symmetric(scene, amplitudes):
    """Velocities (2, amplitudes) on the stable and on the unstable symmetric orbit, nan where there is none."""
    velocities = np.full((2, amplitudes.size), np.nan)
    for place, amplitude in enumerate(amplitudes):
        for orbit in _orbits(scene, amplitude):
            velocities[0 if orbit.stable else 1, place] = orbit.state(scene.forcing.phase)[1]
    return velocities


def _orbits_named(axes, scene, values):
    """Name the two parts of the symmetric orbit above themselves, and the crisis at the foot of its line."""
    amplitudes = np.array(values["amplitudes"])
    for name, orbit in zip(("stable", "unstable"), _symmetric(scene, amplitudes), strict=True):
        places = np.flatnonzero(np.isfinite(orbit))
        if places.size:
            point = amplitudes[places[0]], orbit[places[0]]
            offset = (0.0, 8.0) if name == "stable" else (60.0, 14.0)
            pictures.named(axes, f"symmetric orbit, {name}", point, "black", offset)
    foot = np.mean(values["crisis"]), -0.35
    pictures.named(axes, "boundary crisis", foot, pictures.OVERTURNED, offset=(5.0, 0.0), rotation=90)


def _beyond(axes, values):
    """Draw the mean lifetimes beyond the crisis."""
    lifetimes = [row for row in values["beyond"] if row["overturned"]]
    end = values["crisis"][1]
    columns = ([row[name] for row in lifetimes] for name in ("cycles", "interval"))
    pictures.error_bars(axes, [row["amplitude"] - end for row in lifetimes], *columns, color=pictures.COLOURS[0])
    axes.set(xscale="log", yscale="log", xlabel=f"A - {end:.4f}, nondimensional", ylabel="mean number of cycles")
    axes.set_xticks(BEYOND, [f"{distance:g}" for distance in BEYOND])
    axes.tick_params(axis="x", which="minor", labelbottom=False)
    axes.set_title(f"(b) Until overturning beyond the crisis\n{BLOCKS} blocks, 95 % intervals")


def report(values):
    """Print the crisis."""
    print(f"Symmetric orbit stable up to A = {values['symmetric_orbit_stable_up_to']:.6f}")
    print(f"Boundary crisis between A = {values['crisis'][0]:.5f} and {values['crisis'][1]:.5f}: {values['criterion']}")
    low, high = values["crisis_at_twice_the_cutoff"]
    print(f"With twice the cut-off: between {low:.5f} and {high:.5f}")
    print(f"From rest overturned within {TRANSIENT + KEPT} cycles at A = {values['rest_overturns']}")
    for row in values["beyond"]:
        mean = row["cycles"] or math.inf
        print(f"A = {row['amplitude']:.5f}: {row['overturned']} of {BLOCKS} overturned, mean {mean:.3g} cycles")


if __name__ == "__main__":
    command(
        run,
        "results/bifurcation",
        "bifurcation.png",
        "bifurcation.json",
        report=report,
        cycles="of the bisection",
    )
