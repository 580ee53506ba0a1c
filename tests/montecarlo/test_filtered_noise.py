"""Filtered noise of the engine `filtered`: its law at grid times, in parts of intervals, and with an envelope."""

import dataclasses
import itertools
import math

import filter_formulas as formulas
import numpy as np
import pytest
from filtered_paths import interval, noise_of, parts_of, with_intervals
from filtered_scenes import LOW_PASS, NOISES, SOIL, THIRD, scene_of

from fpk_rocking import FilteredNoise
from fpk_rocking.envelopes import Table, Trapezoid
from fpk_rocking.results.remarks import noise_text
from montecarlo.engines import filtered
from montecarlo.engines.engine import TimeGrid
from montecarlo.engines.random import open_stream, stream_keys

drawn = pytest.mark.parametrize("noise", [*NOISES, SOIL, THIRD], ids=lambda noise: noise_text(noise)[:30])


@drawn
@pytest.mark.parametrize("n", [20_000, pytest.param(100_000, marks=pytest.mark.slow)])
def test_sampled_noise_has_the_autocovariance(noise, n):
    """The noise at four grid times and the flights between them, n paths; false alarm 6 x 6e-4.

    Of n paths a sample covariance has the variance (c_ii c_jj + c_ij²)/n. The largest of 55 entries is below 4.5
    standard errors but for a probability of 4e-4.
    """
    scene, grid = scene_of(noise), 4
    parameters = with_intervals(scene, 24)
    values, flights = noise_of(parameters, grid, n)
    h, nodes = parameters.grid.spacing, np.polynomial.legendre.leggauss(48)
    time, weight = 0.5 * h * (1.0 + nodes[0]), 0.5 * h * nodes[1]
    output = noise.space.output * math.sqrt(noise.variance)
    times, kernels = [], []
    for k in range(grid):
        times.append(np.array([k * h]))
        kernels.append(np.ones((1, 1)))
        if k < grid - 1:
            times.append(k * h + time)
            kernels.append(weight * np.stack([np.sinh(h - time), np.cosh(h - time)]))
    parts = [[a @ _mean(noise, s, t) @ b.T for t, b in zip(times, kernels, strict=True)]
             for s, a in zip(times, kernels, strict=True)]  # fmt: skip
    truth = np.block(parts)
    eta = values @ output
    sampled = [
        column for k in range(grid) for column in (eta[:, k : k + 1], *([flights[:, k]] if k < grid - 1 else []))
    ]
    data = np.concatenate(sampled, axis=1)
    error = np.sqrt((np.outer(np.diag(truth), np.diag(truth)) + truth**2) / n)
    assert np.abs((data.T @ data / n - truth) / error).max() < 4.5


def _mean(noise, first, second):
    """Autocovariance between times, shape (first, second); its kink at lag 0 is within the quadrature's error."""
    if noise in (SOIL, THIRD):
        return noise.variance * formulas.own_autocovariance(noise.filter, first[:, None] - second)
    return formulas.autocovariance(noise, first[:, None] - second)


@drawn
@pytest.mark.parametrize("intervals", [24, pytest.param(400, marks=pytest.mark.slow)])
def test_the_polynomial_moves_a_flight_by_what_was_drawn(noise, intervals):
    """A flight by the polynomial ends where the drawn one does, to rounding, and the polynomial has the drawn noise."""
    parameters = with_intervals(scene_of(noise), intervals)
    workspace, stream = filtered.workspace_of(parameters), open_stream(stream_keys(1), 0)
    filtered.draw_first_states(stream, parameters.noise, workspace.noise)
    output, rate = noise.space.output, noise.space.output @ noise.space.drift
    n, sigma = output.size, math.sqrt(noise.variance)
    for j in range(intervals):
        filtered.draw_next_interval(stream, parameters.noise, workspace.noise)
        drawn = interval(0.8, 0.1, 1, 0, j, parameters, workspace, False)[:2]
        bernstein = workspace.noise.bernstein.copy()
        end = interval(0.8, 0.1, 1, j, j, parameters, workspace, True)[:2]
        assert end == pytest.approx(drawn, abs=1e-13)
        ends = [sigma * (output @ workspace.noise.drawn[:n]), sigma * (output @ workspace.noise.drawn[n : 2 * n])]
        assert bernstein[[0, -1]] == pytest.approx(ends, abs=1e-14)
        if noise in (LOW_PASS, THIRD):
            slopes = (bernstein.size - 1) * np.diff(bernstein)[[0, -1]]
            assert slopes == pytest.approx(
                parameters.grid.spacing * sigma * workspace.noise.drawn[: 2 * n].reshape(2, n) @ rate, abs=1e-12
            )


@pytest.mark.parametrize("n", [10_000, pytest.param(40_000, marks=pytest.mark.slow)])
@pytest.mark.parametrize("noise", NOISES[1:], ids=lambda noise: f"{noise.filter}-{noise.damping}")
def test_parts_of_intervals_have_the_law_of_the_noise(noise, n):
    """Noise and flights over the parts of two intervals, n paths; false alarm 3 x 3e-3.

    Those of grid intervals as short have been compared with the autocovariance above. The largest of 4,656 differences
    of two sample covariances is below 5 standard errors but for a probability of 3e-3.
    """
    scene, count = scene_of(noise), filtered.TUNING.filtered_parts
    coarse, fine = with_intervals(scene, 24), with_intervals(scene, 24 * count)
    assert len(coarse.noise.parts.gain) == count
    states, flights = parts_of(coarse, 2, n)
    finer, shorter = noise_of(fine, 2 * count + 1, n, seed=2)
    output, covariances = noise.space.output, []
    for values, moves in ((states, flights), (finer[:, 1:], shorter[:, :-1])):
        data = np.concatenate([(values @ output)[..., None], moves], axis=2).reshape(n, -1)
        covariances.append(data.T @ data / n)
    size = np.diag(covariances[1])
    error = np.sqrt(2.0 * (np.outer(size, size) + covariances[1] ** 2) / n)
    assert np.abs((covariances[0] - covariances[1]) / error).max() < 5.0


KINKED = Table((0.3, 0.6, 2.0), (0.2, 1.5, 0.1))


def tables_over(scene, end):
    """The engine's tables for a time, in intervals of its default length at most."""
    spacing = filtered.parameters_of(scene, 200, np.array([end])).grid.spacing
    count = math.ceil(end / spacing - 1e-9)
    return filtered.parameters_on_grid(scene, TimeGrid(count, end / count, np.array([float(count)])))


def flown(parameters):
    """Covariance (2, 2) of angle and velocity of a flight without events, which the engine's draws and tables imply."""
    n = len(parameters.noise.stationary)
    covariance = np.zeros((n + 2, n + 2))
    covariance[:n, :n] = parameters.noise.stationary @ parameters.noise.stationary.T
    move, spread = parameters.noise.law.move, parameters.noise.law.spread
    states, drawn = np.vstack([np.eye(n), move]), np.vstack([np.zeros((n, n + 2)), spread])
    keep, swap = parameters.hyperbolic
    for response in parameters.envelope.response:
        moves = response @ parameters.noise.law.shape
        step, source = np.zeros((n + 2, n + 2)), np.vstack([spread[:n], moves @ drawn])
        step[:n, :n], step[n:, :n], step[n:, n:] = move[:n], moves @ states, [[keep, swap], [swap, keep]]
        covariance = step @ covariance @ step.T + source @ source.T
    return covariance[n:, n:]


def quadrature(noise, end):
    """Covariance (2, 2) of a flight by a double integral of the noise's covariance, in triangles between the kinks."""
    nodes, weights = np.polynomial.legendre.leggauss(32)
    kinks = noise.envelope.kinks
    edges = np.array([0.0, *kinks[(kinks > 0.0) & (kinks < end)], end])

    def kernels(times):
        return noise.envelope.value(times) * np.stack([np.sinh(end - times), np.cosh(end - times)])

    total = np.zeros((2, 2))
    for begin, stop in itertools.pairwise(edges):
        late = begin + 0.5 * (stop - begin) * (1.0 + nodes)
        for time, weight in zip(late, 0.5 * (stop - begin) * weights, strict=True):
            # The autocovariance has a kink at lag 0: earlier times only, up to this one.
            for first, last in itertools.pairwise([*edges[edges < time], time]):
                early = first + 0.5 * (last - first) * (1.0 + nodes)
                part = 0.5 * (last - first) * weights * formulas.autocovariance(noise, time - early)
                product = weight * np.outer(kernels(time), kernels(early) @ part)
                total += product + product.T
    return total


@pytest.mark.parametrize("envelope", [KINKED, Trapezoid(0.2, 0.3, 0.1), Trapezoid(0.0, 0.5, 0.0)], ids=str)
@pytest.mark.parametrize("noise", [FilteredNoise("low-pass", 0.04, 4.0, 0.6), *NOISES[1:3]], ids=lambda n: n.filter)
def test_kinks_and_jumps_of_an_envelope_are_in_the_variance_of_a_flight(noise, envelope):
    """At the default steps, whose intervals the kinks cut."""
    noise = dataclasses.replace(noise, envelope=envelope)
    variance = flown(tables_over(scene_of(noise), 0.7))
    assert variance == pytest.approx(quadrature(noise, 0.7), rel=1e-5)


def test_a_flight_through_the_pieces_of_an_envelope_is_the_flight_over_the_interval():
    """Far from every event the paths by pieces, to any time, and by the tables of whole intervals are the same."""
    noise = dataclasses.replace(LOW_PASS, envelope=Table((0.03, 0.31, 0.32, 0.6), (0.2, 1.5, 0.0, 1.0)))
    parameters = tables_over(scene_of(noise), 0.7)
    workspace, stream, cut = filtered.workspace_of(parameters), open_stream(stream_keys(1), 0), 0
    filtered.draw_first_states(stream, parameters.noise, workspace.noise)
    for j in range(len(parameters.envelope.response)):
        filtered.draw_next_interval(stream, parameters.noise, workspace.noise)
        end_by_tables = interval(0.8, 0.1, 1, 0, j, parameters, workspace, False)
        assert interval(0.8, 0.1, 1, 0, j, parameters, workspace, True) == pytest.approx(end_by_tables, abs=1e-13)
        pieces = range(parameters.envelope.first[j], parameters.envelope.first[j + 1])
        cut += len(pieces) > 1
        begins, values = parameters.envelope.begins[pieces], parameters.envelope.strength[pieces, 0]
        assert values == pytest.approx(noise.envelope.value(j * parameters.grid.spacing + begins + 1e-12), abs=1e-9)
    assert cut == 3
