"""Scenes and calls with which `sensitivity.py` measures what the tuned numbers do."""

import functools
import importlib
import math
import re

import numpy as np

EDGES = np.linspace(-1.6, 1.6, 17), np.linspace(-3.2, 3.2, 33)
PATHS = 20000
GROUPS = {
    "physics": {
        "collocation_.*": ("exact rack", "exact record"),
    },
    "montecarlo": {
        "exact_.*": ("exact", "exact rack"),
        "envelope_order": ("exact enveloped",),
        "white_.*|finest_step|barrier_distance|bounce_time": ("white", "white rack"),
        "sure_arrival|longest_arrival|bounce_.*": ("white", "white at rest"),
        "filtered_(parts|margin|slowest)": ("filtered", "filtered rough"),
        "filtered_(fewest|rough)": ("filtered", "filtered soil", "filtered rough"),
        "filtered_(longest|smooth)": ("filtered smooth", "filtered slow"),
        "smallest_batch": ("exact", "exact record"),
        "foresight|score_.*": ("splitting",),
        "followed|batch_seconds|first_batch|impacts_per_cycle|most_.*|tally_.*|filtered_intervals|splitting_.*": (),
    },
    "density": {
        "nodes_beside|filter_turn|filtered_points": ("two states",),
        "moving_nodes|filtered_re.*": ("moving",),
        "resting_nodes|rest_spacing|rest_cell_.*": ("filtered at rest",),
        "rest_error_factor": ("block at rest", "filtered at rest"),
        "rest_(angle|velocity)|least_.*_range": ("main", "block at rest"),
        "patch_.*|free_patch_nodes|no_mass|visible_mass|missing_mass|closed_form_part": ("main", "rack", "pulse"),
        "strong_diffusion": ("strong",),
        "contact_(part|rim|angle_points)|low_restitution": ("rattling",),
        "resolved|barely_resolved|rattle_.*|(lifted|waiting|contact)_step": ("main", "block at rest", "pulse"),
        "exact_.*|bent_gaussian": ("rack",),
        "sticking_.*|layer_.*|hop_gain|forgetting_.*|faintest_.*|faded_.*|settled_.*": ("pulse", "block at rest"),
        "mode.*|subspace|steps_(before|until)_modes|smoothing_.*|least_(eigenvalue|rate)|reached_.*": ("operator",),
        "operator_.*": ("operator",),
        "most_contact_parts|finer_.*|largest_.*|bytes_.*|long_seconds|seconds_.*|spread.*": (),
        "negligible_mass|unresolved_negative_mass|negative_mass_ratio|.*_before|safety|bins_.*": (
            "main",
            "rack",
            "pulse",
        ),
        "exploratory_.*|main_.*|coarsest|tail_cells|moving_step": ("main", "rack", "pulse"),
        "far_motion|.*_step|long_rest|steps_per_harmonic": ("main", "block at rest", "rack"),
        "search_entries|chunks|spare|first_rings|mostly_standing|deviations|start_margin": ("main", "rack", "pulse"),
        ".*_grading|.*_growth|narrow_.*": ("main", "rack"),
        "chatter|.*_impact": ("main",),
        "least_(intensity|diffusion)": ("pulse",),
    },
}
"""Scenes that feel a number of a table: of the first pattern that fits it. None: a limit of memory or of time, beyond
which a call is refused, warned of, or repeated, which moves no result; or what only minutes a call would show."""


def scenes_of(name, field):
    """Names of the scenes that feel a field of a table; KeyError where it stands in no group."""
    for pattern, scenes in GROUPS[name].items():
        if re.fullmatch(pattern, field):
            return scenes
    raise KeyError(f"{name}: {field} is in no group of benchmarks/sensitivity_scenes.py")


def calls():
    """Return for each scene a function of a factor of its noise's intensity: near 1, the work is the same, uncached.

    Of a density it takes a second factor, of its tolerance.
    """
    import fpk_rocking as fpk
    import montecarlo as mc

    main, band = fpk.load_scene("main"), fpk.load_scene("rest")
    white = main.varied(block={"restitution": 0.7}, forcing={"amplitude": 3.0}, noise=fpk.WhiteNoise(0.012))
    rack = fpk.Scene.from_block(0.5, 1.8, "0.5 g", "1.5 Hz", noise_rms_acceleration=0.5, noise_band_hz=(0, 5))
    white_rack = rack.varied(noise=fpk.WhiteNoise(0.01))
    record = fpk.load_scene("record").varied(noise=fpk.BandNoise(0.05, (0.0, 10.0), 20))
    pulse = white.varied(forcing=fpk.Pulse("one-sine", 1.5, 1.1), noise=fpk.WhiteNoise(0.06))
    enveloped = main.varied(noise={"envelope": importlib.import_module("fpk_rocking.envelopes").Exponential(3.0)})
    soil = fpk.FilteredNoise(fpk.CloughPenzien(9.0, 0.6, 1.5, 0.4), 0.04)
    smooth = fpk.FilteredNoise("low-pass", 0.04, 30.0, 0.7)
    slow = fpk.Scene(fpk.Block(0.6), fpk.Harmonic(1.5, 1.2), fpk.FilteredNoise("low-pass", 0.04, 1.0, 0.7))
    resting = fpk.Scene(
        fpk.Block(0.5),
        fpk.Harmonic(0.9, 6.0),
        fpk.FilteredNoise("exponential", 0.04, 3.0),
        overturning=fpk.Overturning(0.03),
    )
    rattling = fpk.Scene(
        fpk.Block(0.423), fpk.Harmonic(1.05, 1.356, 3.77), fpk.WhiteNoise(0.00376), fpk.Start(0.1, -0.1)
    )
    moving = fpk.Scene(fpk.Block(0.6), fpk.Harmonic(3.0, 2.7, math.pi), fpk.FilteredNoise("exponential", 0.05, 5.0))

    def simulated(scene, cycles, paths=PATHS, **options):
        ensemble = mc.simulate(scene, **({"cycles": cycles} if cycles else {}), realizations=paths, **options)
        bins = ensemble.bin_probabilities(len(ensemble.survival) - 1, *EDGES)
        return {
            "survival": ensemble.survival,
            "bins": bins,
            "paths": np.stack([ensemble.angle, ensemble.velocity])[:, :200],
        } | _sampling(ensemble)

    def split(scene):
        splitting = mc.split(scene, cycles=2, walkers=100, repeats=20)
        repeats = splitting.repeat_probability[:, -1] / splitting.probability[-1]
        return {"survival": splitting.survival, "paths": repeats, "sampling": splitting.standard_error}

    def solved(scene, cycles, **options):
        own = {"cycles": cycles} if cycles else {}
        evolution = fpk.solve_fpk(scene, noise_replacement="white", **own, **options)
        bins = evolution.bin_probabilities(len(evolution.survival) - 1, *EDGES)
        estimates = [evolution.error_estimate, evolution.bins_error_estimate]
        return {"survival": evolution.survival, "bins": bins, "estimate": np.nan_to_num(estimates, posinf=0.0)}

    def operated(scene, tol):
        operator = fpk.CycleOperator(scene, tol=tol)
        estimates, bins = [operator.escape_error], operator.quasi_stationary.bin_probabilities(*EDGES)
        return {"survival": operator.survival([1, 10, 200]), "bins": bins, "estimate": estimates}

    rows = {
        "exact": (main, simulated, 8),
        "exact at rest": (band, simulated, 10, 1500),
        "exact rack": (rack, simulated, 6, 8000),
        "exact record": (record, simulated, 0, 600),
        "exact enveloped": (enveloped, simulated, 5, 10000),
        "white": (white, simulated, 4, 16000),
        "white at rest": (band.white_equivalent(), simulated, 6, 4000),
        "white rack": (white_rack, simulated, 4, 8000),
        "filtered": (moving, simulated, 4, 6000),
        "filtered soil": (main.varied(noise=soil), simulated, 4, 4000),
        "filtered smooth": (main.varied(noise=smooth), simulated, 3, 3000),
        "filtered slow": (slow, simulated, 4, 6000),
        "filtered rough": (resting, simulated, 6, 3000),
        "splitting": (main.varied(noise={"variance": 0.03}).white_equivalent(), split),
        "main": (main, solved, 4, {"tol": 1e-2}),
        "block at rest": (band, solved, 2, {"tol": 3e-2}),
        "rattling": (rattling, solved, 2, {"tol": 2e-2}),
        "strong": (fpk.Scene(fpk.Block(0.52), fpk.Harmonic(0.6, 2.0), fpk.WhiteNoise(0.12)), solved, 2, {"tol": 2e-2}),
        "rack": (white_rack, solved, 3, {"tol": 2e-2}),
        "pulse": (pulse, solved, 0, {"times": [2.0, 4.0, 6.0], "tol": 2e-2}),
        "two states": (
            moving.varied(noise=fpk.FilteredNoise("low-pass", 0.05, 6.0, 0.7)),
            solved,
            1,
            {"tol": 0.1, "bins_tol": math.inf},
        ),
        "moving": (moving, solved, 1, {"tol": 0.1, "bins_tol": math.inf}),
        "filtered at rest": (
            resting.varied(forcing={"frequency": 12.0}),
            solved,
            1,
            {"tol": 0.1, "bins_tol": math.inf},
        ),
        "operator": (white.varied(noise=fpk.WhiteNoise(0.04)), operated, {"tol": 5e-2}),
    }

    def call(name, factor, part=1.0):
        scene, function, *rest = rows[name]
        field = "diffusion" if scene.noise.kind == "white" else "variance"
        options = dict(rest.pop()) if rest and isinstance(rest[-1], dict) else {}
        if part != 1.0:
            options["tol"] = max(part * options["tol"], 1e-4)
        return function(scene.varied(noise={field: factor * getattr(scene.noise, field)}), *rest, **options)

    return {name: functools.partial(call, name) for name in rows}


def _sampling(ensemble):
    return {"sampling": np.sqrt(ensemble.survival * (1.0 - ensemble.survival) / ensemble.realizations)}
