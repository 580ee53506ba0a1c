"""`CycleOperator`: the map of densities over one forcing cycle, and what it says about the long run."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.sparse.linalg import LinearOperator

from fpk_rocking.base import checks
from fpk_rocking.base.checks import Array, ArrayLike, Progress
from fpk_rocking.base.precompilation import Compilation
from fpk_rocking.density.density import Density, PlaneMap
from fpk_rocking.density.resolution import USUAL
from fpk_rocking.density.solver import refuse_unsolvable
from fpk_rocking.density.space import Space
from fpk_rocking.horizon.mesh_operator import MeshOperator, refine_operator
from fpk_rocking.horizon.modes import SurvivalEstimate
from fpk_rocking.physics.forcing import periodic, refuse_transient
from fpk_rocking.physics.noise.equivalence import equivalent_diffusion
from fpk_rocking.physics.noise.kinds import refuse_envelope
from fpk_rocking.results.pictures import shown_edges
from fpk_rocking.results.remarks import describe_replacement
from fpk_rocking.results.result import Result
from fpk_rocking.scene.axes import joint_edges
from fpk_rocking.scene.least import least_scenes
from fpk_rocking.scene.parts import Start
from fpk_rocking.scene.scene import Scene


class CycleOperator(Result, LinearOperator):
    """The operator that maps the density at one whole forcing cycle to the density at the next.

    It is the transfer (Perron-Frobenius) operator under white noise, made of the steps of `solve_fpk`, and a SciPy
    linear operator: ``matvec`` carries a density forward over a cycle; ``rmatvec`` (the Koopman operator) gives the
    mean of a function after a cycle, by the state before it. `vector` and `density` convert; the Euclidean product of
    two vectors is the integral of the product of their functions.

    Parameters
    ----------
    scene : Scene
        Under periodic forcing with white noise, or band noise, which white noise of equal Melnikov variance replaces.
    tol : float
        Wanted error of survival after any number of cycles, at least 1e-4: the mesh is refined until the estimated
        relative error of the escape rate is at most exp(1) times that.
    progress : callable, optional
        Called as ``progress(done, total)`` after each mesh; `total` grows with every refinement.

    Attributes
    ----------
    scene, tol, diffusion, noise_replacement
        As in `Evolution`.
    escape_rate, escape_error : float
        Long-run rate of overturning per cycle, -ln of the leading eigenvalue, and its estimated relative error.
    refinement : list of (int, float)
        Number of unknowns and escape rate on every mesh, from coarse to fine.
    leakage : ndarray, shape (2,)
        Probability of overturning within a cycle from `quasi_stationary`, to the left and to the right.
    truncated : float
        Probability that leaves the mesh in a cycle, to velocities beyond its largest one.
    eigenvalues : ndarray of complex
        Leading eigenvalues, descending in modulus.
    residuals : ndarray
        L2 norms of the residuals of the modes.
    negative_mass : float
        Integral of max(-p, 0) over the quasi-stationary density p.
    settings : dict
        Mesh, polynomial degree, quadrature and time steps.

    Warns
    -----
    RuntimeWarning
        The estimated error on the finest mesh that fits into memory is larger than wanted.

    Raises
    ------
    TypeError, ValueError
        A parameter is refused; or the scene has no noise, filtered noise, or a restitution of at most
        exp(-π/√3) = 0.163; nearly every block overturns within a cycle, or too few for a rate above the error; or the
        finest mesh does not resolve the quasi-stationary density.

    Examples
    --------
    >>> from fpk_rocking import CycleOperator, WhiteNoise, load_scene
    >>> operator = CycleOperator(load_scene("main").varied(noise=WhiteNoise(0.04)), tol=1e-2)
    >>> print(f"{operator.escape_rate:.3f} per cycle, {operator.mean_cycles:.1f} cycles on average")
    0.254 per cycle, 4.5 cycles on average
    >>> print(operator.leakage.round(3))
    [0.106 0.119]
    """

    def __init__(self, scene: Scene, tol: float = 1e-3, progress: Progress | None = None) -> None:
        checks.instance("scene", scene, Scene)
        refuse_transient(scene.forcing, "the operator of a cycle")
        refuse_envelope(scene.noise, "the operator of a cycle")
        if scene.noise.kind == "filtered":
            takes = "solve_fpk() takes filters of up to 2 states"
            accepted = (
                f"'band' or 'white', as the one-cycle operator has no states of a filter; {takes}, and "
                "scene.white_equivalent() replaces filtered noise by white noise, under which no block rests"
            )
            raise ValueError(checks.refusal("noise.kind", scene.noise.kind, accepted))
        self.scene, self._white = scene, scene.white_equivalent()
        refuse_unsolvable(self._white)
        self.noise_replacement = describe_replacement(scene, self._white)
        self.diffusion = equivalent_diffusion(self._white.noise)
        self.tol = checks.number("tol", tol, at_least=min(USUAL))
        refined = refine_operator(self._white, self.tol, progress)
        (self._coarse, self._fine), self.escape_error = refined.solutions[-2:], refined.error
        self.refinement = [(solution.space.unknowns, solution.rate) for solution in refined.solutions]
        fine = self._fine
        self.escape_rate, self.leakage, self.truncated = fine.rate, fine.leaks[:2], float(fine.leaks[2])
        self.eigenvalues = fine.modes.values**fine.periods
        self.residuals, self.negative_mass = fine.modes.residuals, fine.negative_mass
        self.settings = fine.settings
        super().__init__(float, (fine.space.unknowns, fine.space.unknowns))

    def _matvec(self, vector):
        return self._repeated(self._fine.matvec, vector)

    def _rmatvec(self, vector):
        return self._repeated(self._fine.rmatvec, vector)

    def _repeated(self, apply, vector):
        """Apply a map over a symmetry period for a cycle, that is once or twice."""
        vector = np.ascontiguousarray(vector, dtype=float).ravel()
        for _ in range(self._fine.periods):
            vector = apply(vector)
        return vector

    @property
    def residual(self) -> float:
        """Largest of the `residuals`."""
        return float(np.max(self.residuals))

    @property
    def title(self) -> str:
        """The escape rate per cycle and its relative error, as a line of text."""
        return f"escape rate {self.escape_rate:.4g} per cycle, relative error {self.escape_error:.1g}"

    row_dims = ("mode",)
    more_metadata = ("escape_rate", "mean_cycles", "forgetting_cycles", "tol", "diffusion")

    def places(self) -> dict[str, Any]:
        """Numbers of the modes, and the middles of the bins."""
        middles = (0.5 * (line[1:] + line[:-1]) for line in self._shown_edges())
        return super().places() | dict(zip(("bin_angle", "bin_velocity"), middles, strict=True))

    def derived(self) -> dict[str, Any]:
        """Leading eigenvalues, leakage to either side, and the binned quasi-stationary density."""
        values = self.eigenvalues
        return {
            "modulus": ("mode", np.abs(values)),
            "real": ("mode", values.real),
            "imaginary": ("mode", values.imag),
            "leakage": ("side", self.leakage),
            "bin_probability": (
                "bin_angle bin_velocity",
                self.quasi_stationary.bin_probabilities(*self._shown_edges()),
            ),
        }

    def plot(self) -> Any:
        """Draw the quasi-stationary density and the leading eigenvalues; returns a matplotlib Figure."""
        from fpk_rocking.results.pictures import figure_of, function_panel

        def density(figure, axes):
            function_panel(figure, axes, self.quasi_stationary, self._shown_edges(), "quasi-stationary density")

        def eigenvalues(_, axes):
            turn = np.exp(2j * math.pi * np.linspace(0.0, 1.0, 201))
            axes.plot(turn.real, turn.imag, color="black", linewidth=0.8)
            axes.plot(self.eigenvalues.real, self.eigenvalues.imag, "o", markersize=5.0)
            axes.set(xlabel="real part", ylabel="imaginary part", title="eigenvalues of a cycle", aspect="equal")

        return figure_of(density, eigenvalues)

    def _shown_edges(self):
        """Edges in angle and velocity of the bins of the drawn density."""
        edges = joint_edges(self.scene)
        return shown_edges(edges, self.quasi_stationary.bin_probabilities(*edges), 64)

    @property
    def space(self) -> Space:
        """Mesh and polynomial degree."""
        return self._fine.space

    def vector(self, coefficients: Array) -> Array:
        """Return the vector (unknowns,) of a function.

        Parameters
        ----------
        coefficients : ndarray, shape (angle cells, velocity cells, degree + 1, degree + 1)
            As of a `Density` on the same mesh.
        """
        if np.shape(coefficients) != self.space.shape:
            got = f"an array of shape {np.shape(coefficients)}"
            raise ValueError(checks.refusal("coefficients", got, f"the shape {self.space.shape} of `space`"))
        return self._fine.vector(coefficients)

    def density(self, vector: Array) -> Density:
        """Return the density that a vector stands for.

        Parameters
        ----------
        vector : array_like, shape (unknowns,)
        """
        return Density(self.space, self._fine.coefficients(np.asarray(vector, dtype=float)))

    @property
    def quasi_stationary(self) -> Density:
        """Density of mass 1 at whole cycles that keeps its shape while blocks overturn."""
        return Density(self.space, self._fine.quasi_stationary)

    @property
    def forgetting_cycles(self) -> float:
        """Number of cycles in which the influence of the start falls by a factor exp(1)."""
        first, second = np.abs(self.eigenvalues[:2])
        return float(-1.0 / math.log(second / first))

    @property
    def mean_cycles(self) -> float:
        """Mean index (1, 2, ...) of the cycle in which a block distributed like `quasi_stationary` overturns.

        The cycle of overturning counts as a whole one: the mean time by `mean_cycles_map` is about half a cycle less.
        """
        return -1.0 / math.expm1(-self.escape_rate)

    def modes(self, adjoint: bool = False) -> tuple[Array, list[Array]]:
        """Return the leading eigenvalues and eigenfunctions.

        Parameters
        ----------
        adjoint : bool
            Whether to return those of the adjoint operator.

        Returns
        -------
        eigenvalues : ndarray of complex, shape (modes,)
        functions : list of ndarray, shape ``space.shape``
            Coefficients, of L2 norm 1; of a conjugate pair the real and the imaginary part of one eigenfunction.
        """
        modes = self._fine.left_modes if adjoint else self._fine.modes
        return modes.values**self._fine.periods, [self._fine.coefficients(column) for column in modes.basis.T]

    def survival(self, cycles: ArrayLike) -> Array:
        """Probability of not having overturned after some numbers of cycles, from the scene's start.

        Parameters
        ----------
        cycles : int or sequence of int
            At least 0, without upper limit.
        """
        shape = np.shape(cycles)
        return self.estimate_survival(np.ravel(cycles)).survival.reshape(shape)

    def estimate_survival(self, cycles: Sequence[int] | Array) -> SurvivalEstimate:
        """Compute survival from the scene's start with error estimates, for long times by the leading modes.

        Parameters
        ----------
        cycles : sequence of int
            At least 0, without upper limit.
        """
        counts = np.array([checks.count("cycles", count, at_least=0) for count in cycles], dtype=np.int64)
        survival, left_out = self._fine.survival(counts, self._white.start)
        rough, _ = self._coarse.survival(counts, self._white.start)
        slope = np.abs(survival) * -np.expm1(-counts * self.escape_rate * self.escape_error)
        error = np.maximum(np.abs(survival - rough), slope) + left_out
        return SurvivalEstimate(counts, survival, left_out, error)

    def survival_map(self, cycles: int, phase: float | None = None) -> PlaneMap:
        """Probability of not overturning within some cycles, as a function of the start: (angle, velocity).

        At rest, and at the scene's own start where that is a point, the value is that of `survival`.

        Parameters
        ----------
        cycles : int
            At least 0, without upper limit.
        phase : float, optional
            Forcing phase Ψ (of the first harmonic) at the start, radians; by default the scene's.
        """
        cycles = checks.count("cycles", cycles, at_least=0)
        return self._map(
            lambda mesh: mesh.backward_powers().after(mesh.periods * cycles),
            phase,
            lambda survival: survival(cycles)[0],
        )

    def first_passage_map(self, cycle: int, phase: float | None = None) -> PlaneMap:
        """Probability of overturning in one cycle, numbered from 1, as a function of the start: (angle, velocity).

        Parameters
        ----------
        cycle : int
        phase : float, optional
            As of `survival_map`.
        """
        cycle = checks.count("cycle", cycle)

        def passage(mesh):
            powers = mesh.backward_powers()
            before = powers.after(mesh.periods * (cycle - 1))
            return before - powers.after(mesh.periods * cycle)

        return self._map(passage, phase, lambda survival: -np.diff(survival(cycle - 1, cycle))[0])

    def mean_cycles_map(self, phase: float | None = None) -> PlaneMap:
        """Mean time until overturning, in cycles, as a function of the start: (angle, velocity).

        Parameters
        ----------
        phase : float, optional
            As of `survival_map`.
        """
        return self._map(MeshOperator.mean_time, phase)

    def _map(self, function, phase, from_start=None):
        """`PlaneMap` of a vector by `function` of a mesh; of single starts by `from_start` of their survival."""
        own = periodic(self.scene.forcing).phase
        phase = own if phase is None else checks.number("phase", phase)
        meshes = [self._fine, self._coarse]
        if phase != own:
            meshes = [mesh.at_phase(phase) for mesh in meshes]
        fine, coarse = (mesh.coefficients(function(mesh)) for mesh in meshes)
        space = meshes[0].space
        difference = fine - space.transfer(coarse, meshes[1].space)
        error = space.absolute_mass(difference) / space.masses(fine).sum()
        starts = self._values_at_starts(meshes[0], from_start) if from_start else ()
        return PlaneMap(space, fine, phase, float(error), starts)

    def _values_at_starts(self, mesh, function):
        """Return (angle, velocity, value) at rest and at the scene's start, where these are points; see `_map`."""
        starts, values = {Start(), self._white.start}, []
        for start in (start for start in starts if start.covariance is None):
            value = function(lambda *cycles, start=start: mesh.survival(np.array(cycles), start)[0])
            values.append((start.angle, start.velocity, float(value)))
        return tuple(values)


OPERATOR = Compilation(f"{__name__}:compile_operator", 12)


def compile_operator() -> None:
    """Find the leading mode of a scene that is easy to resolve, which needs all kernels of the operator."""
    CycleOperator(least_scenes("slender")["white"], tol=1e-2).survival(1)
