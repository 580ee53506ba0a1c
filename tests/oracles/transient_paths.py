"""Pulses and records for tests, and a block under them followed by scipy's DOP853 (see `oracle`)."""

import bisect
import math

import numpy as np
import oracle

from fpk_rocking.scene import Block, Dimensions, NoNoise, Overturning, Pulse, Record, Scene, Start

SHAPES = ("one-sine", "one-cosine", "n-sine", "symmetric-ricker", "antisymmetric-ricker")


def pulse_force(pulse):
    """Force of a pulse as a function of time, its kinks and its end, from the formulas of the literature."""
    a, w = pulse.amplitude, pulse.frequency
    if pulse.shape in ("one-sine", "n-sine"):
        end = 2.0 * math.pi * (pulse.cycles or 1) / w
        return (lambda t: a * math.sin(w * t)), [end]
    if pulse.shape == "one-cosine":
        return (lambda t: a * math.cos(w * t)), [2.0 * math.pi / w]
    if pulse.shape == "symmetric-ricker":
        centre = 6.5 * math.sqrt(2.0) / w

        def bell(t):
            square = 0.5 * (w * (t - centre)) ** 2
            return a * (1.0 - square) * math.exp(-0.5 * square)
    else:
        centre = 6.5 * math.sqrt(3.0) / w
        peak = math.sqrt(18.0 - 6.0 * math.sqrt(6.0)) * math.exp(0.5 * math.sqrt(6.0) - 1.5)

        def bell(t):
            y = w * (t - centre) / math.sqrt(3.0)
            return a / peak * (y * y - 3.0) * y * math.exp(-0.5 * y * y)

    return bell, [2.0 * centre]


def record_force(record, size):
    """Force of a record as a function of time, and its kinks, from metres and seconds."""
    unit = math.sqrt(3.0 * size.gravity / (2.0 * math.hypot(size.width, size.height))) * record.interval
    scale = record.scale * (9.80665 if record.units == "g" else 1.0)
    forces = [scale * a / (size.gravity * math.atan2(size.width, size.height)) for a in record.samples]
    kinks = [unit * k for k in range(1, len(forces))]

    def linear(t):
        k = min(int(t / unit), len(forces) - 2)
        part = t / unit - k
        return (1.0 - part) * forces[k] + part * forces[k + 1]

    return linear, kinks


class ForcedBlock(oracle.Block):
    """A block under a force of any form with kinks at known times, the last of which is its end."""

    def __init__(self, force, kinks, restitution, cutoff, x, v, critical_angle=0.0):
        side = int(math.copysign(1, x or v)) if x or v else 0
        super().__init__(math.nan, math.nan, math.nan, restitution, cutoff, x, v, side, critical_angle=critical_angle)
        self.course, self.kinks, self.low = force, kinks, 0.0
        self.amplitude = max(abs(force(t)) for t in np.linspace(0.0, kinks[-1], 4001)[:-1])
        self.frequency = 1.0

    def force(self, t):
        # Within a piece the force goes on smoothly, also where an integrator or a root looks beyond.
        return 0.0 if self.low >= self.kinks[-1] - 1e-12 else self.course(min(max(t, self.low), self.high))

    def advance(self, end):
        while self.t < end and not self.overturned:
            self.low = self.t
            k = bisect.bisect_right(self.kinks, self.t + 1e-12)
            piece = self.kinks[k] if k < len(self.kinks) else math.inf
            self.high = math.nextafter(min(piece, end), 0.0)
            super().advance(min(piece, end))

    def _rest(self, end):
        uplift = self._uplift(end)
        if uplift is None:
            self.t = end
            return
        self.t, self.x, self.v, self.bound = uplift, 0.0, 0.0, 2 * oracle.ROUNDING
        self.side = 1 if self.force(uplift) > 0.0 else -1
        self.events.append((uplift, "uplift"))

    def _uplift(self, end):
        grid = np.linspace(self.t, end, 201)
        above = np.array([abs(self.force(t)) > self.level for t in grid])
        if not above.any():
            return None
        k = int(np.argmax(above))
        if k == 0:
            return self.t
        low, high = grid[k - 1], grid[k]
        for _ in range(80):
            middle = 0.5 * (low + high)
            low, high = (low, middle) if abs(self.force(middle)) > self.level else (middle, high)
        return float(high)


def random_scene(number, slender=True):
    """One of a sequence of random scenes without noise: shapes of pulses in turn, and records."""
    rng = np.random.default_rng([19, number])
    start = Start(*rng.uniform([-0.4, -0.5], [0.4, 0.5])) if rng.random() < 0.5 else Start()
    kind = number % 7
    if kind < 5:
        cycles = int(rng.integers(1, 4)) if SHAPES[kind] == "n-sine" else None
        pulse = Pulse(SHAPES[kind], rng.uniform(0.9, 6.0), rng.uniform(0.7, 7.0), cycles)
        block = Block(rng.uniform(0.3, 0.97), critical_angle=0.0 if slender else rng.uniform(0.05, 0.5))
        return Scene(block, pulse, NoNoise(), start)
    width = rng.uniform(0.3, 1.2)
    size = Dimensions(width, width * rng.uniform(2.5, 6.0))
    interval, count = rng.choice([0.005, 0.01, 0.02]), int(rng.integers(60, 160))
    times = interval * np.arange(count)
    waves = rng.uniform(0.5, 8.0, 12), rng.uniform(0.0, 6.28, 12)
    samples = np.sin(2.0 * math.pi * np.outer(times, waves[0]) + waves[1]).sum(axis=1) + 0.3 * rng.normal(size=count)
    scale = rng.uniform(0.08, 0.4)
    units = rng.choice(["g", "m/s2"])
    record = Record(interval, samples * (1.0 if units == "g" else 9.80665), str(units), scale)
    return Scene(Block(None, size, slender=slender), record, NoNoise(), start, Overturning())


def followed(scene, times):
    """States (n, 2) at the times by the oracle, nan after overturning; its bounds of rounding, and the path."""
    forcing, block = scene.forcing, scene.block
    force, kinks = record_force(forcing, block.dimensions) if forcing.kind == "record" else pulse_force(forcing)
    start, cutoff = scene.start, scene.overturning.angle
    path = ForcedBlock(force, kinks, block.restitution, cutoff, start.angle, start.velocity, block.critical_angle)
    rows, bounds = [], []
    for time in times:
        path.advance(time)
        rows.append((path.x, path.v) if not path.overturned else (math.nan, math.nan))
        bounds.append(path.bound)
    return np.array(rows), np.array(bounds), path
