"""Fig. 2: phase portrait and heteroclinic orbits.

Without forcing the block d²Θ/dτ² = Θ - s, where s = ±1 is the side on which it rocks, has the energy H = v²/2 + V with
v = dΘ/dτ and V = |Θ| - Θ²/2: a cusped well between two saddles Θ = ±1 of height 1/2, joined by two heteroclinic orbits
v = ±(1 - |Θ|). Shown are

* (a) the potential with the saddles and the cut-off ±π/2,
* (b) orbits without loss at several energies, the heteroclinic ones in bold, and one path that loses speed at each
  impact,
* (c) angle and velocity on the heteroclinic orbit against time,
* (d) the transform 2/(1 + ω²) of that velocity (paper eq. 16), in closed form and by quadrature over the orbit.

Source: H. Lin and S. C. S. Yim, "Nonlinear rocking motions. I: Chaos under noisy periodic excitations", J. Eng. Mech.
122(8), 719-727, 1996, Fig. 2.

Run time: about two seconds.

    python cases/fig02_phase_portrait.py --out results/fig02

Files: ``fig02.png``, ``fig02.json``.
"""

import math

import motion
import numpy as np
from command import command
from scipy.integrate import quad

from fpk_rocking import melnikov
from fpk_rocking.results import pictures, storage

CUTOFF = math.pi / 2
INSIDE = (0.1, 0.2, 0.3, 0.4)
OUTSIDE = (0.65, 0.85)
IMPACTS = 12


def run(out, restitution=0.7, frequencies=(0.0, 0.5, 1.0, 2.0, 2.7, 4.0, 8.0)) -> dict:
    """Compute, draw and write everything.

    Parameters
    ----------
    out : pathlib.Path
        Folder for the files; created if missing.
    restitution : float
        Of the path with impacts.
    frequencies : sequence of float
        At which the transform is taken by quadrature.

    Returns
    -------
    dict
        What ``fig02.json`` holds.
    """
    work = [quadrature(frequency) for frequency in frequencies]
    angle, velocity = melnikov.heteroclinic_orbit(np.linspace(-30.0, 30.0, 2001))
    energies = 0.5 * velocity**2 + potential(angle)
    values = {
        "figure": "Fig. 2 of Lin and Yim, J. Eng. Mech. 122(8), 1996",
        "barrier": float(potential(1.0)),
        "energy_of_the_heteroclinic_orbit": [float(energies.min()), float(energies.max())],
        "area_inside": 2.0 * quad(lambda x: 1.0 - abs(x), -1.0, 1.0, points=[0.0])[0],
        "impact_loss": float(melnikov.impact_loss(restitution)),
        "restitution": restitution,
        "frequencies": list(frequencies),
        "transfer": np.atleast_1d(melnikov.transfer(frequencies)).tolist(),
        "transfer_by_quadrature": work,
    }
    draw(out / "fig02.png", values)
    storage.write_json(out / "fig02.json", values)
    return values


def potential(angle):
    """V = |x| - x²/2, nondimensional."""
    return np.abs(angle) - 0.5 * np.square(angle)


def quadrature(frequency) -> float:
    """Work of cos ωτ along the heteroclinic orbit, from its velocity; what is left beyond |τ| = 40 is below 1e-17."""
    push = {"weight": "cos", "wvar": frequency, "epsabs": 1e-13, "limit": 200}
    return 2.0 * quad(lambda time: melnikov.heteroclinic_orbit(time)[1], 0.0, 40.0, **push)[0]


def free_orbit(energy, count=200):
    """Angle and velocity of the flight x >= 0 through x = 0 with an energy, from impact to impact or to the cut-off.

    (1 - u)² - w² is constant in a free flight: a hyperbola, closed below the height 1/2 of the saddles.
    """
    size = math.sqrt(abs(1.0 - 2.0 * energy))
    if energy < 0.5:
        time = np.linspace(-1.0, 1.0, count) * math.acosh(1.0 / size)
        return 1.0 - size * np.cosh(time), -size * np.sinh(time)
    time = np.linspace(-math.asinh(1.0 / size), math.asinh((CUTOFF - 1.0) / size), count)
    return 1.0 + size * np.sinh(time), size * np.cosh(time)


def draw(path, values):
    """Draw what the JSON file holds, and the curves in closed form."""
    title = "Paper Fig. 2: free blocks rock inside the heteroclinic orbits and overturn outside"
    with pictures.page(path, (10.5, 8.4), title) as figure:
        (well, portrait), (orbit, transform) = figure.subplots(2, 2)
        _well(well)
        _portrait(portrait, values["restitution"])
        _orbit(orbit)
        _transform(transform, values["frequencies"], values["transfer_by_quadrature"])


def _well(axes):
    """Draw the potential, saddles and cut-off."""
    x = np.linspace(-1.75, 1.75, 701)
    axes.plot(x, potential(x), color=pictures.COLOURS[0])
    axes.plot([-1.0, 1.0], [0.5, 0.5], "o", color="black", markersize=5)
    axes.annotate("saddle", (1.0, 0.5), xytext=(0, 7), textcoords="offset points", ha="center")
    axes.annotate("rest", (0.0, 0.0), xytext=(0, -14), textcoords="offset points", ha="center")
    _cutoff(axes, -0.08, 0.55)
    axes.text(CUTOFF - 0.03, 0.02, "cut-off π/2", rotation=90, ha="right", color=pictures.OVERTURNED)
    axes.set(title="(a) Potential |Θ| - Θ²/2", xlabel=motion.ANGLE, ylabel="energy, nondimensional", ylim=(-0.08, 0.62))


def _portrait(axes, restitution):
    """Draw orbits without loss, and a path that loses speed at impacts of a restitution."""
    label = "free orbits, e = 1"
    for energy in (*INSIDE, *OUTSIDE):
        x, v = free_orbit(energy)
        for side in (1.0, -1.0):
            axes.plot(side * x, side * v, "--", color="#999999", linewidth=1.0, label=label)
            label = None
            if energy > 0.5:
                axes.plot(side * x, -side * v, "--", color="#999999", linewidth=1.0)
                axes.plot(-side * x, side * v, "--", color="#999999", linewidth=1.0)
    x = np.array([-CUTOFF, 0.0, CUTOFF])
    for side in (1.0, -1.0):
        axes.plot(side * x, side * (1.0 - np.abs(x)), color=pictures.COLOURS[0], linewidth=2.4)
        axes.annotate("", (side * 0.62, side * 0.38), (side * 0.5, side * 0.5), arrowprops=_arrow(pictures.COLOURS[0]))
    axes.plot([], [], color=pictures.COLOURS[0], linewidth=2.4, label="heteroclinic, e = 1")
    speed, side = 0.97, 1.0
    for _ in range(IMPACTS):
        u, w = free_orbit(0.5 * speed**2)
        axes.plot(side * u, side * w, color=pictures.COLOURS[1])
        # The flight arrives at x = 0 as fast as it left.
        axes.plot([0.0, 0.0], [-side * speed, -side * restitution * speed], ":", color=pictures.COLOURS[1])
        speed, side = restitution * speed, -side
    axes.plot([], [], color=pictures.COLOURS[1], label=f"e = {restitution:g}, dotted: impacts")
    axes.plot([-1.0, 0.0, 1.0], [0.0, 0.0, 0.0], "o", color="black", markersize=5, zorder=3)
    _cutoff(axes, -1.5, 1.4)
    axes.set(
        title="(b) Phase portrait: saddles at ±1, centre at 0",
        xlabel=motion.ANGLE,
        ylabel=motion.VELOCITY,
        xlim=(-1.75, 1.75),
        ylim=(-1.5, 2.0),
    )
    axes.legend(loc="upper center", ncols=2, fontsize=9)


def _orbit(axes):
    """Draw angle and velocity of the heteroclinic orbit."""
    time = np.linspace(-6.0, 6.0, 601)
    for values, colour, label, line in zip(
        melnikov.heteroclinic_orbit(time), pictures.COLOURS, ("angle Θ", "velocity dΘ/dτ"), ("-", "--"), strict=False
    ):
        axes.plot(time, values, line, color=colour)
        pictures.named(
            axes, label, (time[-1], values[-1]), colour, offset=(-4.0, -14.0 if values[-1] > 0.5 else 14.0), ha="right"
        )
    axes.set(title="(c) Heteroclinic orbit from left to right; impact at τ = 0")
    axes.set(xlabel=motion.TIME, ylabel="angle and velocity, nondimensional")


def _transform(axes, frequencies, work):
    """Draw the transform of the velocity, and the values of the quadrature at some frequencies."""
    omega = np.linspace(0.0, 8.0, 401)
    axes.plot(omega, melnikov.transfer(omega), color=pictures.COLOURS[0], label="2/(1 + ω²), paper (16)")
    points = {"color": pictures.COLOURS[1], "markerfacecolor": "white", "label": "quadrature over the orbit"}
    axes.plot(frequencies, work, "o", **points)
    axes.set(title="(d) Transform of the velocity on the orbit", ylim=(0.0, None))
    axes.set(xlabel="frequency ω, nondimensional", ylabel="work of cos ωτ, nondimensional")
    axes.legend()


def _cutoff(axes, low, high):
    """Draw the cut-offs as vertical lines between two heights."""
    axes.vlines([-CUTOFF, CUTOFF], low, high, color=pictures.OVERTURNED, linewidth=0.9, linestyle="--")


def _arrow(colour):
    """Properties of an arrow of a colour."""
    return {"arrowstyle": "-|>", "color": colour, "linewidth": 2.0, "mutation_scale": 18}


def report(values):
    """Print the barrier and the area inside."""
    for name in ("barrier", "area_inside"):
        print(f"{name.replace('_', ' ')}: {values[name]:.12g}")


if __name__ == "__main__":
    command(run, "results/fig02", "fig02.png", "fig02.json", report=report, restitution="of the path drawn")
