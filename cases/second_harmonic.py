"""Survival under a second harmonic.

The forcing is a cosine with a second harmonic,

    f(τ) = -A₁ cos(Ωτ + Ψ₁) - A₂ cos(2Ωτ + Ψ₂),

and the block starts from rest under white noise. A single cosine is in its second half cycle the mirror image of its
first, f(τ + T/2) = -f(τ) with T = 2π/Ω, so that in the long run a block overturns to the left as often as to the right.
A second harmonic ends that. What is left is a symmetry between two forcings:

    -f(τ + T/2)  is f with Ψ₂ + π in place of Ψ₂,          -f(τ)  is f with (Ψ₁ + π, Ψ₂ + π) in place of (Ψ₁, Ψ₂).

By the first, Ψ₂ + π has the same rate of overturning in the long run, with left and right exchanged. So the rates are
solved for Ψ₂ below π only; the samples are drawn for all Ψ₂. By the second, a block from rest has the same survival if
both phases are turned. If Ψ₂ alone is turned, the mirror image starts half a cycle later, with another survival.

Shown are the forcings; survival from rest after ten cycles against A₂; the shares that overturn to each side against
Ψ₂; and the rates of overturning to each side in the long run (`CycleOperator`), beside the Melnikov flux over the
saddle of that side (paper eq. 17, corrected, one saddle at a time). Points are Monte Carlo of the same white noise.

Source: eq. 17 of H. Lin and S. C. S. Yim, "Nonlinear rocking motions. I: Chaos under noisy periodic excitations",
J. Eng. Mech. 122(8), 719-727, 1996; the forcing with two harmonics is this project's.

Run time: about five minutes on 2 cores, once the kernels are compiled; half of it the rates in the long run.

    python cases/second_harmonic.py --out results/second_harmonic

Files: ``second_harmonic.png``, ``second_harmonic.json``.
"""

import math

import numpy as np
from command import command
from scipy.special import ndtr

from fpk_rocking import CycleOperator, Scene, load_scene, melnikov, solve_fpk
from fpk_rocking.output.tables import reporting
from fpk_rocking.results import pictures, storage
from fpk_rocking.results.sampling import wilson_interval
from montecarlo import overturning_rate, simulate

PHASES = {"0": 0.0, "π/2": 0.5 * math.pi, "π": math.pi, "3π/2": 1.5 * math.pi}
AMPLITUDES = tuple((0.125 * np.arange(17)).tolist())
PARTS = 24
CYCLES = 10
LONG_CYCLES = 60
SIDES = {"left": -1, "right": 1}
_PER_CYCLE = 2_000


def run(out, amplitudes=AMPLITUDES, parts=PARTS, cycles=CYCLES, realizations=20_000, tol=1e-2, seed=1) -> dict:
    """Compute, draw and write everything.

    Parameters
    ----------
    out : pathlib.Path
        Folder for the files; created if missing.
    amplitudes : sequence of float
        A₂, nondimensional.
    parts : int
        Into how many the circle of Ψ₂ is divided; an even number.
    cycles : int
        From rest, and of a long run those after which overturning counts.
    realizations : int
        Of each ensemble.
    seed : int
        Of the first ensemble of each panel; the next have the next seeds.
    tol : float
        Error of survival that the density solver and the operator aim at.

    Returns
    -------
    dict
        What ``second_harmonic.json`` holds.
    """
    scene, sampled = load_scene("second_harmonic"), (cycles, realizations, seed)
    circle = [2.0 * math.pi * part / parts for part in range(parts)]
    turned = [with_second(scene, scene.forcing.amplitudes[1], psi) for psi in circle]
    values = {
        "scene": scene.to_toml(),
        "cycles": cycles,
        "realizations": realizations,
        "amplitudes": list(amplitudes),
        "phases": [
            {"phase": name} | from_rest([with_second(scene, amplitude, psi) for amplitude in amplitudes], tol, *sampled)
            for name, psi in PHASES.items()
        ],
        "from_rest": {"phases": circle} | from_rest(turned, tol, *sampled),
        "long_run": {"phases": circle} | long_run(turned, tol, *sampled),
    }
    draw(out / "second_harmonic.png", values)
    storage.write_json(out / "second_harmonic.json", values)
    return values


def with_second(scene, amplitude, phase):
    """Return a scene whose second harmonic has another amplitude (nondimensional) and phase (rad)."""
    first, psi = scene.forcing.amplitudes[0], scene.forcing.phases[0]
    return scene.varied(forcing={"amplitudes": (first, amplitude), "phases": (psi, phase)})


def from_rest(scenes, tol, cycles, realizations, seed):
    """Survival after some cycles of scenes and probabilities (scenes, 2) of overturning to each side.

    By the density, and by Monte Carlo with a seed for each scene, the first of which is `seed`.
    """
    densities, ensembles = [], []
    with reporting("survival from rest") as progress:
        for k, scene in enumerate(scenes):
            densities.append(solve_fpk(scene, cycles=cycles, tol=tol))
            ensembles.append(simulate(scene, cycles=cycles, realizations=realizations, seed=seed + k))
            progress(k + 1, len(scenes))
    counts = [np.rint(ensemble.overturned[-1] * realizations) for ensemble in ensembles]
    return {
        "survival": [float(density.survival[-1]) for density in densities],
        "overturned": [density.overturned[-1].tolist() for density in densities],
        "error_estimate": [density.error_estimate for density in densities],
        "sampled_survival": [float(ensemble.survival[-1]) for ensemble in ensembles],
        "sampled_survival_interval": [ensemble.survival_interval()[-1].tolist() for ensemble in ensembles],
        "sampled_overturned": [ensemble.overturned[-1].tolist() for ensemble in ensembles],
        "sampled_overturned_interval": [wilson_interval(count, realizations).tolist() for count in counts],
    }


def long_run(turned, tol, cycles, realizations, seed):
    """Rates of overturning to each side once the start is forgotten, by operators and Monte Carlo, and Melnikov fluxes.

    All are per cycle. The scenes go once around the circle of Ψ₂; operators are solved for the first half of them.
    """
    solved, errors, samples = [], [], []
    with reporting("rates in the long run") as progress:
        for k, scene in enumerate(turned):
            if k < len(turned) // 2:
                operator = CycleOperator(scene, tol=tol)
                solved.append(side_rates(operator))
                errors.append(operator.escape_rate * operator.escape_error)
            ensemble = simulate(scene, cycles=LONG_CYCLES, realizations=realizations, seed=seed + k)
            samples.append([overturning_rate(ensemble, cycles, side=side) for side in SIDES.values()])
            progress(k + 1, len(turned))
    alone = with_second(turned[0], 0.0, 0.0)
    return {
        "rate": [*solved, *(rate[::-1] for rate in solved)],
        "error_estimate": [*errors, *errors],
        "sampled": [[measure.rate for measure in sides] for sides in samples],
        "interval": [[measure.interval.tolist() for measure in sides] for sides in samples],
        "flux_per_cycle": [side_fluxes(scene) for scene in turned],
        "rate_without": side_rates(CycleOperator(alone, tol=tol)),
        "flux_per_cycle_without": side_fluxes(alone),
    }


def side_rates(operator):
    """Rates per cycle of overturning to the left and to the right in the long run, which sum to the escape rate.

    Their shares are those of a cycle from τ = 0. As fewer stand in its second half, a cycle from another time has other
    shares, by a relative difference below the escape rate: so much do the sides differ at A₂ = 0.
    """
    return (operator.escape_rate * operator.leakage / operator.leakage.sum()).tolist()


def side_fluxes(scene):
    """Melnikov flux over the left and over the right saddle, phase-space area per cycle: E[M⁺] T of either process."""
    forcing, loss = scene.forcing, melnikov.impact_loss(scene.block.restitution)
    sigma = math.sqrt(melnikov.noise_variance(scene.noise))
    times = forcing.period * (np.arange(_PER_CYCLE) + 0.5) / _PER_CYCLE
    work = melnikov.process_mean(forcing, scene.block.restitution, times) + loss
    fluxes = []
    for side in SIDES.values():
        mean = side * work - loss
        u = mean / sigma
        density = np.exp(-0.5 * u * u) / math.sqrt(2.0 * math.pi)
        fluxes.append(float(np.mean(sigma * density + mean * ndtr(u)) * forcing.period))
    return fluxes


def draw(path, values):
    """Draw the forcings, survival against A₂, and against Ψ₂ the shares from rest and the rates in the long run."""
    scene = Scene.from_toml(values["scene"])
    (first, second), later = scene.forcing.amplitudes, values["long_run"]
    forces = (
        f"f = -A₁ cos(Ωτ + Ψ₁) - A₂ cos(2Ωτ + Ψ₂), A₁ = {first:g}, A₂ = {second:g} but in (b), Ω = "
        f"{scene.forcing.frequency:g}, Ψ₁ = 0, T = 2π/Ω; e = {scene.block.restitution:g}, white noise of D = "
        f"{scene.noise.diffusion:g}."
    )
    engines = (
        f"Lines: density. Points: {values['realizations']:,} paths, 95 % intervals. (d) from cycle "
        f"{values['cycles']} to {LONG_CYCLES}, over the rate {later['rate_without'][0]:.2g} a cycle and side at A₂ = 0."
    )
    survival = values["from_rest"]["survival"]
    title = (
        f"The phase of a second harmonic decides: survival of {values['cycles']} cycles from {min(survival):.2f} to "
        f"{max(survival):.2f}, without it {values['phases'][0]['survival'][0]:.2f}"
    )
    with pictures.page(path, (10.5, 10.2), title, [forces, engines]) as figure:
        (force, amplitude), (rest, rates) = figure.subplots(2, 2)
        _forces(force, scene)
        _against_amplitude(amplitude, values)
        _shares(rest, values)
        _rates(rates, later)
        for axes in (rest, rates):
            axes.set(xlabel="phase Ψ₂ of the second harmonic, rad", xlim=(-0.1, 2.0 * math.pi + 0.1))
            axes.set_xticks(np.linspace(0.0, 2.0 * math.pi, 5), ("0", "π/2", "π", "3π/2", "2π"))


def _forces(axes, scene):
    """Draw the forcings over a cycle."""
    turns = np.linspace(0.0, 1.0, 401)
    for (name, psi), colour in zip(PHASES.items(), pictures.COLOURS, strict=True):
        forcing = with_second(scene, scene.forcing.amplitudes[1], psi).forcing
        force = [forcing.value(turn * forcing.period) for turn in turns]
        axes.plot(turns, force, color=colour, label=f"Ψ₂ = {name}")
    alone = with_second(scene, 0.0, 0.0).forcing
    axes.plot(turns, [alone.value(turn * alone.period) for turn in turns], color="black", linewidth=1.0, label="A₂ = 0")
    axes.set(
        title="(a) The forcing over one cycle",
        xlabel="time τ/T",
        ylabel="base acceleration f, nondimensional",
        xlim=(0.0, 1.0),
    )
    axes.set_ylim(top=4.3)
    axes.legend(loc="upper left")


def _against_amplitude(axes, values):
    """Draw survival against the amplitude of the second harmonic, by phase."""
    for curve, colour in zip(values["phases"], pictures.COLOURS, strict=True):
        axes.plot(values["amplitudes"], curve["survival"], color=colour)
        points = (values["amplitudes"], curve["sampled_survival"], curve["sampled_survival_interval"])
        pictures.error_bars(axes, *points, color=colour)
        place = (1.02 * values["amplitudes"][-1], curve["survival"][-1])
        axes.text(*place, f" Ψ₂ = {curve['phase']}", va="center", color=colour)
    axes.set(title=f"(b) From rest: survival after {values['cycles']} cycles", ylim=(0.0, 1.0))
    axes.set(xlabel="amplitude A₂ of the second harmonic, nondimensional", ylabel="P(not overturned)")
    axes.set_xlim(-0.03, 1.25 * values["amplitudes"][-1])
    axes.set_xticks(np.linspace(0.0, values["amplitudes"][-1], 5))


def _shares(axes, values):
    """Draw the shares that stand and overturn to each side against the phase."""
    shares = values["from_rest"]
    phases, (left, right) = _closed(shares["phases"]), _closed(shares["overturned"]).T
    sampled, interval = _closed(shares["sampled_overturned"]), _closed(shares["sampled_overturned_interval"])
    look = {"alpha": 0.25, "linewidth": 0.0}
    for border, edge, sign, k in ((left, 0.0, 1.0, 0), (1.0 - right, 1.0, -1.0, 1)):
        axes.fill_between(phases, edge, border, color=pictures.COLOURS[k], **look)
        axes.plot(phases, border, color=pictures.COLOURS[k])
        limits = np.sort(edge + sign * interval[:, k], axis=1)
        pictures.error_bars(axes, phases, edge + sign * sampled[:, k], limits, color=pictures.COLOURS[k])
    middle = {"ha": "center", "va": "center"}
    axes.text(0.65 * math.pi, 0.85, "overturned to the right", **middle)
    axes.text(1.5 * math.pi, 0.5, "standing", **middle)
    axes.text(0.6 * math.pi, 0.04, "overturned to the left", **middle)
    axes.set(title=f"(c) From rest: the state after {values['cycles']} cycles", ylim=(0.0, 1.0), ylabel="probability")


def _rates(axes, curves):
    """Draw rates and fluxes of each side, over those without a second harmonic, against the phase."""
    phases = _closed(curves["phases"])
    rate, sampled, interval, flux = (
        _closed(curves[name]) for name in ("rate", "sampled", "interval", "flux_per_cycle")
    )
    for k, (name, colour) in enumerate(zip(SIDES, pictures.COLOURS, strict=False)):
        alone, flux_alone = curves["rate_without"][k], curves["flux_per_cycle_without"][k]
        axes.plot(phases, rate[:, k] / alone, color=colour, label=f"rate of overturning, {name}")
        axes.plot(phases, flux[:, k] / flux_alone, "--", color=colour, label=f"Melnikov flux, {name}")
        pictures.error_bars(axes, phases, sampled[:, k] / alone, interval[:, k] / alone, color=colour)
    axes.set(title="(d) In the long run: each side over A₂ = 0", ylabel="ratio to A₂ = 0", ylim=(0.0, 4.3))
    axes.legend(loc="upper center", ncols=2, fontsize=9)


def _closed(column):
    """Repeat the first of the values on the circle at its end; of phases, a turn later."""
    column = np.asarray(column, dtype=float)
    return np.concatenate([column, column[:1] + (2.0 * math.pi if column.ndim == 1 else 0.0)])


def report(values):
    """Print survival and rates."""
    for curve in values["phases"]:
        print(f"Ψ₂ = {curve['phase']}: survival after {values['cycles']} cycles against A₂, density | Monte Carlo")
        for row in zip(values["amplitudes"], curve["survival"], curve["sampled_survival"], strict=True):
            print("  {:<6g} {:.4f} | {:.4f}".format(*row))
    print("Ψ₂/π: rates per cycle in the long run, to the left and to the right; Melnikov fluxes")
    later = values["long_run"]
    for psi, rate, flux in zip(later["phases"], later["rate"], later["flux_per_cycle"], strict=True):
        print("  {:.3f}  {:.5f} {:.5f}  {:.4f} {:.4f}".format(psi / math.pi, *rate, *flux))


if __name__ == "__main__":
    command(
        run,
        "results/second_harmonic",
        "second_harmonic.png",
        "second_harmonic.json",
        report=report,
        realizations="of an ensemble",
        tol="tolerance of the densities",
        seed="of the ensembles",
    )
