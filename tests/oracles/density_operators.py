"""What a step of the density does, put together without its kernels: closed forms and numpy's quadrature.

Shape functions here are numpy's Legendre polynomials of degree 3.
"""

import itertools
import math

import numpy as np
from numpy.polynomial import legendre
from scipy.optimize import brentq

from fpk_rocking.scene import Block, Harmonic, Overturning, Scene, Start, WhiteNoise

GAUSS, GAUSS_WEIGHTS = legendre.leggauss(4)
NORMS = np.sqrt([1.0, 3.0, 5.0, 7.0])
REST = Start()


def affine(dynamics, start, duration, side):
    """Matrix and shift of a flight on one side, from x = s + P + two exponentials."""
    amplitude, frequency, phase = dynamics.forcing.amplitude, dynamics.forcing.frequency, dynamics.forcing.phase

    def particular(t):
        scale, angle = amplitude / (1.0 + frequency**2), frequency * t + phase
        return np.array([side + scale * math.cos(angle), -scale * frequency * math.sin(angle)])

    matrix = np.array([[math.cosh(duration), math.sinh(duration)], [math.sinh(duration), math.cosh(duration)]])
    return matrix, particular(start + duration) - matrix @ particular(start)


def impact_time(dynamics, point, side, start, end):
    """First time at which a flight comes back to x = 0, or None; a stay beyond it shorter than 1/40 is not seen."""

    def folded(time):
        matrix, shift = affine(dynamics, start, time - start, side)
        return side * (matrix @ point + shift)[0]

    below = [time for time in np.linspace(start, end, 41)[1:] if folded(time) < 0.0]
    return brentq(folded, start + 1e-9, below[0], xtol=1e-15) if below else None


def flow(dynamics, point, side, start, end):
    """Motion without noise, through impacts."""
    while (time := impact_time(dynamics, point, side, start, end)) is not None:
        matrix, shift = affine(dynamics, start, time - start, side)
        point = [0.0, dynamics.block.restitution * (matrix @ point + shift)[1]]
        side, start = -side, time
    matrix, shift = affine(dynamics, start, end - start, side)
    return matrix @ point + shift


def flight_noise(dynamics, duration):
    """Covariance of a flight from a point."""
    t = duration
    covariance = [[math.sinh(2.0 * t) / 2.0 - t, math.sinh(t) ** 2], [math.sinh(t) ** 2, t + math.sinh(2.0 * t) / 2.0]]
    return dynamics.diffusion * np.array(covariance)


def hermite_weights(long, short):
    """Weights (long * short,) of the nodes of the noise."""
    parts = [np.polynomial.hermite_e.hermegauss(count)[1] for count in (long, short)]
    return np.outer(*parts).ravel() / np.outer(*parts).sum()


def noise_offsets(dynamics, duration, long, short):
    """Nodes (long * short, 2) of the noise of a flight, along the eigenvectors of its covariance."""
    variances, vectors = np.linalg.eigh(flight_noise(dynamics, duration))
    axes = np.sqrt(variances) * vectors * np.sign(vectors[1])
    nodes = [np.polynomial.hermite_e.hermegauss(count)[0] for count in (long, short)]
    return np.array([p * axes[:, 1] + q * axes[:, 0] for p, q in itertools.product(*nodes)])


def gauss_points(mesh_lines, counts):
    """Gauss points (n, 2) and weights (n,) of all cells of a tensor mesh, by cell (angle, velocity)."""
    rules = [legendre.leggauss(count) for count in counts]
    for cell in itertools.product(*(range(len(line) - 1) for line in mesh_lines)):
        axes = []
        for line, index, (nodes, weights) in zip(mesh_lines, cell, rules, strict=True):
            half = 0.5 * (line[index + 1] - line[index])
            axes.append((line[index] + half * (nodes + 1.0), half * weights))
        (x, u), (v, w) = axes
        yield cell, np.array(list(itertools.product(x, v))), np.outer(u, w).ravel()


def basis_values(line, points):
    """Shape functions of all cells of a line at points: (points, cells * 4), 0 outside."""
    values = np.zeros((len(points), len(line) - 1, 4))
    for row, cell in enumerate(np.searchsorted(line, points) - 1):
        if 0 <= cell < len(line) - 1:
            xi = 2.0 * (points[row] - line[cell]) / (line[cell + 1] - line[cell]) - 1.0
            values[row, cell] = legendre.legvander([xi], 3)[0] * NORMS
    return values.reshape(len(points), -1)


def moved(line, shift, nodes, weights, clamped):
    """Projection (unknowns, unknowns) after moving a line by `shift` and nodes, and what leaves (2, unknowns).

    At an end that is `pressed` what would leave is set down on it.
    """
    sizes, unknowns = np.diff(line).repeat(4), 4 * (len(line) - 1)
    matrix, ends = np.zeros((unknowns, unknowns)), np.zeros((2, unknowns))
    for node, weight in zip(shift + nodes, weights / weights.sum(), strict=True):
        cuts = np.union1d(line, line - node)
        cuts = cuts[(cuts >= line[0]) & (cuts <= line[-1])]
        points = (0.5 * (cuts[1:] + cuts[:-1])[:, None] + 0.5 * np.diff(cuts)[:, None] * GAUSS).ravel()
        parts = weight * (0.5 * np.diff(cuts)[:, None] * GAUSS_WEIGHTS).ravel()
        source = parts[:, None] * basis_values(line, points)
        matrix += basis_values(line, points + node).T @ source / sizes[:, None]
        ends += source[points + node < line[0]].sum(axis=0), source[points + node > line[-1]].sum(axis=0)
    for end in np.flatnonzero(clamped):
        cell = slice(-4, None) if end else slice(0, 4)
        edge = NORMS if end else NORMS * (-1.0) ** np.arange(4)
        matrix[cell] += np.outer(edge / sizes[cell], ends[end])
        ends[end] = 0.0
    return matrix, ends


def move_along_velocity(density, mesh_lines, shift_of, nodes, weights, clamped):
    """Move every line of Gauss points of the angle along the velocity: coefficients, and what leaves (2,)."""
    out, left = np.zeros(density.shape), np.zeros(2)
    for i, (low, high) in enumerate(itertools.pairwise(mesh_lines[0])):
        for point, part in zip(0.5 * (GAUSS + 1.0), 0.5 * GAUSS_WEIGHTS, strict=True):
            x = low + point * (high - low)
            shapes = basis_values(np.array([low, high]), np.array([x]))[0]
            matrix, ends = moved(mesh_lines[1], shift_of(x), nodes, weights, clamped)
            line = np.einsum("vab,a->vb", density[i], shapes).ravel()
            out[i] += np.einsum("a,vb->vab", part * shapes, (matrix @ line).reshape(-1, 4))
            left += part * (high - low) * (ends @ line)
    return out, left


def move_along_angle(density, mesh_lines, *movement):
    """Move every line of Gauss points of the velocity along the angle: coefficients, and what leaves (2,)."""
    out, left = move_along_velocity(density.transpose(1, 0, 3, 2), mesh_lines[::-1], *movement)
    return out.transpose(1, 0, 3, 2), left


def free_flight(density, mesh_lines, dynamics, start, duration, side):
    """Blurred shears of angle, velocity and angle of the density on one side: coefficients, and what leaves by axis."""
    _, (dx, dv) = affine(dynamics, start, duration, side)
    shear, sinh, cosh = math.tanh(0.5 * duration), math.sinh(duration), math.cosh(duration)
    small = dynamics.diffusion * shear * (1.0 - duration / sinh)
    large = dynamics.diffusion * (sinh + duration * cosh)
    many, few = np.polynomial.hermite_e.hermegauss(15), np.polynomial.hermite_e.hermegauss(3)
    fine, wide = (math.sqrt(small) * few[0], few[1]), (math.sqrt(large) * many[0], many[1])
    leave, over = (False, False), (side > 0, side < 0)

    def drift(v):
        return shear * v + 0.5 * (dx - shear * dv)

    def kick(x):
        return sinh * x + dv - 0.5 * sinh * (dx - shear * dv)

    now, early = move_along_angle(density, mesh_lines, drift, *fine, over)
    now, first = move_along_velocity(now, mesh_lines, kick, np.zeros(1), np.ones(1), leave)
    now, second = move_along_velocity(now, mesh_lines, lambda _: 0.0, *wide, leave)
    now, late = move_along_angle(now, mesh_lines, drift, *fine, over)
    return now, early + late, first + second


def scene_of(amplitude=4.6, phase=math.pi, start=REST, diffusion=0.02, cutoff=math.pi / 2, frequency=2.7):
    """Scene with white noise: the main one but for what is named, with more noise."""
    forcing = Harmonic(amplitude, frequency, phase)
    return Scene(Block(0.5), forcing, WhiteNoise(diffusion), start, Overturning(cutoff))
