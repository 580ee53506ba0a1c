"""The numbers of the density solver that are tuned: what each does, its unit, and how it came about.

Where nothing else is said a number has no unit, and was chosen by trial on the scenes of tests and benchmarks.
"""

from typing import NamedTuple


class Tuning(NamedTuple):
    """Tuned numbers of mesh, step, solver, start-up, propagators and one-cycle operator; kernels read them too."""

    # Regions that count as rest, and what is compared in bins.
    rest_angle: float = 0.005
    """Angle within which a block counts as being at rest, nondimensional. No mesh is made for less."""
    rest_velocity: float = 0.1
    """Velocity within which a block counts as being at rest: at x ~ v² of the angle above."""
    least_angle_range: float = 0.1
    """Least width of the range of the angle in which two solutions are compared: less counts as being at rest."""
    least_velocity_range: float = 0.5
    """The same of the velocity."""

    # Tolerance and refinement.
    negligible_mass: float = 1e-6
    """Mass over `tol` that a cell must have held to be active: 1e4 cells together truncate a hundredth of `tol`."""
    first_rings: int = 3
    """Rings of cells about those of more mass that are active too, where no coarser solution told them: they are set up
    in fewer parts."""
    mostly_standing: float = 0.6
    """Part of the exploratory paths that do not overturn from which on solutions begin coarser: of fewer, survival
    needs the finer ones."""
    safety: float = 1.4
    """Factor of `safe_difference`, of both distances; benchmarks/estimates.py holds it against true errors."""
    difference_before: float = 0.3
    """Factor of the distance of the solution before the one before: errors fall at least so much over two solutions."""
    bins_before: float = 0.4
    """The same for the binned density."""
    bins_last: float = 0.6
    """Least estimate of the error of the binned density over its last difference, in scenes with white noise that
    repeat; else 1. benchmarks/estimates.py holds it against true errors."""
    bins_at_most: float = 1.5
    """Most that the distance before raises the error of the binned density, over the last distance."""
    bins_part: float = 0.01
    """Least estimate of the error in survival over that of the binned density."""
    rest_error_factor: float = 4.0
    """Error of the last solution over its difference from the one before, where blocks rest under piecewise constant
    noise, or come to rest and are lifted off again: cells decide which of them rest by then, of first order or less.
    2.5 would be an error of first order; with smooth noise it falls more slowly (docs/numerics.md, "Filtered
    noise")."""
    unresolved_negative_mass: float = 0.05
    """Negative mass above which a density counts as not resolved."""
    negative_mass_ratio: float = 0.8
    """Negative mass over that of the solution before, at most, that finer ones are taken to have: soon after a start it
    may stay as large over two solutions and then fall by ten."""
    operator_negative_ratio: float = 0.7
    """Negative mass of the operator's density over that on the mesh before, above which finer meshes do not help."""

    # Memory, bytes.
    finer_white: float = 3e9
    """Bytes that a finer solution under white noise may be expected to need."""
    finer_filtered: float = 4e9
    """The same under filtered noise."""
    finer_operator: float = 8e9
    """The same for the one-cycle operator; every cell of it is active."""
    largest_white: float = 8e9
    """Bytes above which a solution under white noise is refused."""
    largest_filtered: float = 4e9
    """The same under filtered noise."""
    bytes_per_unknown: float = 2.0
    """Bytes that a solution takes, about, for each unknown of a density and each path of a step."""

    # Time, seconds on one core of 2024, for the part of the mesh that usually holds something.
    long_seconds: float = 20.0
    """Seconds from which on a call says how long it will take."""
    seconds_path: float = 1.2e-7
    """Seconds for a path of a slender block."""
    seconds_exact_path: float = 2.4e-7
    """Seconds for a path of an exact block."""
    seconds_deposit: float = 1e-8
    """Seconds for the mass of a path."""
    seconds_preparation: float = 6e-7
    """Seconds for an unknown in a step to be set up."""
    seconds_flight: float = 5e-8
    """Seconds for an unknown in a step to be taken."""
    seconds_integral: float = 1e-8
    """Seconds for a number of the matrices of a remap."""
    seconds_contact_part: float = 8e-3
    """Seconds for a part of a step through slow impacts to be set up."""
    seconds_startup: float = 0.18
    """Seconds from the start to the first density that the mesh resolves."""

    # Exploratory paths.
    exploratory_paths: int = 256
    """Number of paths, even: their ranges scatter by some per cent."""
    exploratory_cycles: int = 12
    """Most cycles that they are followed for."""
    exploratory_step: float = 0.12
    """Longest step, in τ; the shortest period of the forcing has at least 6."""

    # Resolutions: they are made for the main scene, with these values of it, rounded.
    main_diffusion: float = 0.00628
    """Diffusion of the main scene."""
    main_period: float = 2.33
    """Its period, in τ."""
    main_cutoff: float = 1.57
    """Its cut-off."""
    main_speed: float = 1.78
    """Its `StateRange.velocity`."""
    coarsest: float = 0.5
    """Cells an axis over those for the main scene, at least, where stronger noise would allow fewer."""
    far_motion: float = 0.6
    """A motion that usually goes this part of the way to the cut-off has a mesh that is not made for less."""
    tail_cells: float = 32.0
    """With up to so many cells an axis for the motion, others grow by `tail_growth`; else by less."""
    moving_step: float = 2.33 / 16
    """Longest step, in τ, at 16 steps a cycle, where impacts are fast: that of the main scene."""
    resting_step: float = 0.07
    """The same where impacts are slow for long."""
    long_rest: float = 0.5
    """Time τ with |f| ≤ 1 from which on impacts are slow for long."""
    noisy_step: float = 0.03
    """Longest step in which noise does not move a block by more than a quarter of its usual speed, times D / speed²."""
    steps_per_harmonic: float = 6.0
    """Least steps in a period of the forcing's highest harmonic: it is a polynomial to 1e-13 in each."""

    # Mesh.
    angle_grading: float = 1.5
    """Exponent of `graded_lines` in the angle: cells are small where impacts are slow."""
    velocity_grading: float = 1.3
    """The same in the velocity."""
    cell_growth: float = 1.15
    """Size of a cell over that of the one before, beyond the velocity that blocks from rest reach."""
    tail_growth: float = 1.3
    """The same beyond the usual motion of a block; 1.6 is unstable in one practical block of 24."""
    deviations: float = 8.0
    """Standard deviations of the noise that a velocity bound leaves room for: a Gaussian has 6e-16 beyond."""
    start_margin: float = 1.2
    """Velocity bound over the speed of the start, at least."""
    search_entries: int = 2**16
    """Most entries of a table that finds the cell of a point; more than the finest mesh has."""

    # Time step.
    least_intensity: float = 1e-3
    """Least g² of a diffusion D g², g being 1 at its peak: no mesh resolves a density without noise."""
    least_diffusion: float = 1e-3
    """Most that `least_intensity` may make of strong noise: D g² itself moves the block, be D large or small."""
    chatter: float = 0.03
    """Part of a step within which chatter has to end to be summed in closed form, where noise is two kicks of the
    velocity."""
    linear_impact: float = 2.0
    """Speed of an impact over sqrt(2 D h) above which noise is carried by the saltation matrix."""
    low_restitution: float = 0.7
    """Restitution up to which slow impacts are followed in parts of a step: at .8 survival is off by .0003 without."""
    contact_part: float = 0.15
    """Longest part, at 12 steps a cycle, over D^(1/3)/(1-e²): survival is then within .0004, without parts within .006,
    for D from .004 to .04. It falls like the square of the steps, so that two solutions differ by most of the error."""
    most_contact_parts: int = 16
    """Most parts of a step."""
    contact_rim: int = 3
    """Cells of the small mesh of these parts beyond where paths go: less than 1e-8 of the mass leaves it in a step."""
    contact_angle_points: float = 1.6
    """Gauss points in angle of a cell over those of the resolution, where steps have parts: so weak a noise spreads
    angles far less than a cell within a step, and survival would be off by up to .0009."""
    smooth_impact: float = 5.0
    """The same above which it is also carried by the expansion about the path without noise: survival is then within
    1.7e-5 of that by whole paths."""
    strong_diffusion: float = 0.1
    """Least D with which noise acts through slow impacts as two kicks within the step. With kicks at its ends survival
    of three scenes with D of 2.7 to 3 was off by up to .0028, with these by .0003 or less."""
    narrow_nodes: int = 3
    """Gauss-Hermite nodes of a diffusion far narrower than a cell: moments up to the fifth are exact."""
    narrow_part: float = 0.25
    """Part of the velocity's variance that `narrow_nodes` may stand for."""
    chunks: int = 8
    """Parts of a mesh, each with a buffer of its own: as many threads at most. Results depend on it by rounding."""
    spare: float = 2.0
    """Space for the paths of later cells, over what is needed now: memory that is not written to costs nothing."""

    # Start-up on moving patches; steps are in units of `PatchSettings.growth` where that is said.
    patch_nodes: tuple[int, int] = (5, 2)
    """Nodes of the noise, along its long and its short axis, in a step between patches."""
    free_patch_nodes: tuple[int, int] = (9, 3)
    """The same in a step without events."""
    no_mass: float = 1e-13
    """Mass below which nothing is left in a cell of a patch, or of a patch."""
    visible_mass: float = 1e-10
    """Mass of a node of the noise below which a patch need not contain it."""
    missing_mass: float = 1e-5
    """Most that the projection of a Gaussian on its patch may miss of its mass."""
    resolved: float = 0.2
    """The mesh resolves a Gaussian whose conditional standard deviations are at least this part of its cells."""
    barely_resolved: float = 0.15
    """The same, where the patches would otherwise have to follow the density through an event."""
    closed_form_part: float = 0.75
    """Part of the time to the main mesh, or of a cycle, up to which an undisturbed Gaussian is taken in closed form."""
    rattle_step: float = 0.25
    """Longest step next to rest, over growth, in units of the time in which noise lifts the block off."""
    lifted_step: float = 0.4
    """The same in units of the time since the forcing lifted the block off."""
    waiting_step: float = 0.1
    """The same in units of the time until the forcing lifts the block off."""
    contact_step: float = 0.5
    """Least spread of the velocity by noise in a step next to x = 0, over a cell, for a block that began to move."""
    rattle_steps: float = 320.0
    """Most steps, over growth, of a cycle in which a block rattles."""
    patch_steps_per_harmonic: float = 16.0
    """Least steps of a patch in the forcing's shortest period."""
    exact_flight: float = 0.3
    """Longest flight τ of an exact block between patches, over growth."""
    bent_gaussian: float = 1e-4
    """Most that the curvature of its acceleration may shift the mean of an exact block as a Gaussian, over growth."""

    # Sticking at rest under white noise.
    sticking_interval: float = 0.02
    """Longest interval of τ in which force and diffusion are taken as constant."""
    layer_inside: float = 8.0
    """Scales w of the layer at rest that have to be within `rest_velocity` and the speed up to which hops die out, so
    that all of the layer sticks."""
    layer_safe: float = 25.0
    """Scales w that have to be within the least speed over the saddle: noise alone overturns exp(-25)."""
    hop_gain: float = 0.5
    """Part of the speed which impacts take that a changing force may give back, where hops are to die out. This part
    falls like the square of the speed, so that they take a quarter longer."""
    forgetting_growth: float = 1.4
    """What a block must forget before it may stick, -log of what it remembers, over that at the resolution before."""
    faintest_ratio: float = 0.5
    """Least diffusion that stands for noise that has faded, over that at the resolution before."""
    faded_noise: float = 0.05
    """Diffusion over that at the peak of g below which only survival is held to a tolerance: the density shrinks to
    rest."""
    settled_part: float = 0.5
    """Part of a re-injected mass that is at rest again, from which on it is taken over to stick."""

    # Filtered noise: values by the number of the resolution, from coarse to fine.
    moving_nodes: tuple[int, ...] = (4, 5, 6, 8, 10, 12, 14)
    """Nodes in y1, the noise itself."""
    resting_nodes: tuple[int, ...] = (6, 8, 10, 12, 14, 16, 18)
    """The same where the noise decides when a block is lifted off: the density is narrow after that."""
    nodes_beside: tuple[int, ...] = (2, 3, 3, 4, 5, 6, 7)
    """Nodes in y2. With as many as in y1 survival and bins are the same to 1e-4."""
    filtered_points: tuple[int, ...] = (5, 5, 6, 6, 8, 8, 8)
    """Gauss points of a cell, an axis."""
    filter_turn: tuple[float, ...] = (2.0, 1.6, 1.2, 0.9, 0.7, 0.5, 0.35)
    """Longest step times the frequency at which a filter swings."""
    rest_spacing: tuple[float, ...] = (0.25, 0.23, 0.21, 0.19, 0.17, 0.155, 0.14)
    """Spacing, in standard deviations of the noise, of the places of the mass at rest."""
    rest_cell_velocity: float = 0.35
    """Velocity of the cells at rest over the speed from which a block comes to rest within a step."""
    rest_cell_angle: float = 10.0
    """Angle of the cells at rest over the square of their velocity."""
    filtered_reach: float = 8.0
    """Standard deviations within which nothing may happen to a Gaussian that is taken in closed form."""
    filtered_resolved: float = 0.3
    """As `resolved`, for the Gaussian at a node of the filter's states."""
    spreading_time: float = 2.33
    """Least time τ that filtered noise has to spread a density, where it is judged as too slow."""
    spread_left_of_one: float = 0.6
    """Least part of the angle's spread that is left then where the state of a filter of one state is known."""
    spread_left_of_two: float = 0.95
    """The same for a filter of two states."""

    # One-cycle operator.
    modes: int = 6
    """Modes that are computed: those left out have fallen to 1e-9 within some ten cycles in the main scene."""
    subspace: int = 30
    """Vectors of the Arnoldi iteration."""
    mode_precision: float = 1e-11
    """Relative residual that is asked of the iteration."""
    mode_residual: float = 1e-8
    """Largest relative residual of a leading mode; and most by which the leading eigenvalues of the map and of its
    adjoint may differ."""
    steps_before_modes: int = 40
    """Applications of the map for which no modes are asked."""
    steps_until_modes: int = 4000
    """Applications within which the modes have to take over."""
    modes_left_out: float = 1e-10
    """Part of a vector that the modes may leave out, in L1, when they take over."""
    smoothing_periods: int = 10
    """Symmetry periods after the iteration, which leave the tails of the quasi-stationary density to the map itself."""
    least_eigenvalue: float = 1e-6
    """Least probability of surviving a cycle in the long run for which there is an operator to speak of."""
    least_rate: float = 1e-15
    """Least escape rate a cycle that is looked for on ever finer meshes."""
    reached_part: float = 1e-6
    """Part of the largest product of reach and survival below which a cell does not count for the velocity bound."""


TUNING = Tuning()
"""The values that are used."""
