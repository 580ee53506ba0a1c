"""Paths under measured motions against an integration that shares nothing with the engines; rates by 8 to 48 points.

FILE is an .npz with `ids` (n,), `dt`, seconds, and for each id `a<id>`, the acceleration in 1e-4 g. The repository
holds no copy of measured motions. Ten minutes on one processor:

    python benchmarks/records_against_integration.py --motions FILE.npz
"""

import argparse
import math

import numpy as np
from baseline import motions_of
from report import table, write_section
from scipy.integrate import solve_ivp

from fpk_rocking import Record, Scene
from fpk_rocking.risk import Hazard, critical_intensities, study

WIDTH, HEIGHT, G = 0.5, 1.8, 9.80665
MOTIONS, FACTORS = 30, (1.5, 2.5, 4.0, 7.0, 12.0)
RATE_MOTIONS, COUNTS = 14, (8, 24, 48)
ALPHA = math.atan2(WIDTH, HEIGHT)
RATE = math.sqrt(3.0 * G / (2.0 * math.hypot(WIDTH, HEIGHT)))
BOUNCE = 1.0 - 1.5 * math.sin(ALPHA) ** 2
FALLEN = 0.5 * math.pi * ALPHA
SLOW, ERROR = 1e-9, 1e-12


class Motion:
    """A free-standing rectangle under accelerations of its base in g, linear between samples, by scipy's DOP853.

    Its state is the side (0 at rest), the angle and its rate; `peak` is the largest |angle| so far, radians.
    """

    def __init__(self, samples, step):
        self.step, self.side, self.state, self.peak = step, 0, [0.0, 0.0], 0.0
        self.samples = np.append(samples, np.zeros(math.ceil(10.0 / RATE / step)))

    def outcome(self):
        """Largest |θ|/α, and seconds (nan) and side (0) of overturning."""
        for number in range(self.samples.size - 1):
            self.begin, self.first = number * self.step, self.samples[number]
            self.slope = (self.samples[number + 1] - self.first) / self.step
            time, end = self.begin, self.begin + self.step
            while time < end - 1e-13:
                time = self.fly(time, end) if self.side else self.rest(time, end)
                if abs(self.state[0]) >= FALLEN:
                    return FALLEN / ALPHA, time, self.side
        return self.peak / ALPHA, math.nan, 0

    def base(self, time):
        """Acceleration of the base in g."""
        return self.first + self.slope * (time - self.begin)

    def rest(self, time, end):
        """Return the time at which the block at rest lifts off, or the end."""
        level, now = math.tan(ALPHA), self.base(time)
        if abs(now) <= level:
            rising = (math.copysign(level, self.slope) - now) / self.slope if self.slope else math.inf
            time += rising + 1e-12
            if time >= end:
                return end
        self.side, self.state = (1 if self.base(time) > 0.0 else -1), [0.0, 0.0]
        return time

    def fly(self, time, end):
        """Follow a flight up to its impact, its fall or the end, and return when that is."""

        def pull(t, state):
            """Rates of angle and angular velocity."""
            lean = ALPHA - side * state[0]
            return [state[1], RATE**2 * (-side * math.sin(lean) + self.base(t) * math.cos(lean))]

        def impact(_, state):
            """Angle on the flight's side."""
            return side * state[0]

        def fall(_, state):
            """Angle beyond that of falling."""
            return side * state[0] - FALLEN

        def turn(_, state):
            """Angular velocity, which changes its sign at a peak."""
            return side * state[1]

        side, events = self.side, (impact, fall, turn)
        impact.terminal = fall.terminal = True
        impact.direction, fall.direction, turn.direction = -1, 1, -1
        flight = solve_ivp(pull, (time, end), self.state, "DOP853", events=events, rtol=ERROR, atol=1e-3 * ERROR)
        self.state = flight.y[:, -1].tolist()
        self.peak = max([self.peak, abs(self.state[0]), *(abs(state[0]) for state in flight.y_events[2])])
        if flight.y_events[1].size:
            self.state[0] = side * FALLEN * (1.0 + 1e-15)
            return flight.t_events[1][0]
        if flight.y_events[0].size:
            # On to the other side; one too slow to leave the floor rests, and may be lifted off anew.
            self.state = [0.0, BOUNCE * flight.y_events[0][0][1]]
            self.side = -side if abs(self.state[1]) > SLOW * RATE else 0
            return flight.t_events[0][0]
        return flight.t[-1]


def compared(motions):
    """Return differences of peaks (n,) and of times (m,), and how many sides are equal, of how many."""
    peaks, times, equal, count = [], [], 0, 0
    for record in motions:
        samples = np.array(record.samples)
        unit = math.tan(ALPHA) / np.abs(samples).max()
        scaled = [Record(record.interval, record.samples, "g", factor * unit) for factor in FACTORS]
        block = Scene.from_block(WIDTH, HEIGHT, record=scaled[0])
        # A range below the lift-off ends the search at once.
        critical = critical_intensities(block, scaled, measure="scale", highest=1e-6)
        seconds = critical.table()["overturn_s"]
        for number, factor in enumerate(FACTORS):
            peak, time, side = Motion(factor * unit * samples, record.interval).outcome()
            count, equal = count + 1, equal + (side == critical.overturn_side[number])
            if not side:
                peaks.append(abs(critical.peak[number] - peak))
            elif critical.overturn_side[number]:
                times.append(abs(seconds[number] - time))
        print(record.source, max(peaks, default=0.0), max(times, default=0.0), equal, count, flush=True)
    return np.array(peaks), np.array(times), equal, count


def rate_of(motions, count):
    """Return the annual rate under motions without noise, with a number of intensities asked for."""
    block = Scene.from_block(WIDTH, HEIGHT, record=motions[0])
    hazard = Hazard.power_law(rate=1e-4, exponent=2.5)
    return study(block, motions, hazard, np.geomspace(0.2, 4.0, count), baseline="high-pass").risk.rate


def main():
    """Measure, and write the section."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--motions", required=True, metavar="FILE", help=".npz of the measured motions")
    motions = motions_of(parser.parse_args().motions)
    rates = {count: rate_of(motions[:: len(motions) // RATE_MOTIONS][:RATE_MOTIONS], count) for count in COUNTS}
    peaks, times, equal, count = compared(motions[:: len(motions) // MOTIONS][:MOTIONS])
    rows = [
        ["peak rotation", peaks.size, f"{np.median(peaks):.1e}", f"{peaks.max():.1e}"],
        ["time of overturning, s", times.size, f"{np.median(times):.1e}", f"{times.max():.1e}"],
    ]
    spread = max(rates.values()) / min(rates.values()) - 1.0
    assert equal == count
    assert max(peaks.max(), times.max()) < 1e-4
    assert spread < 0.02
    body = (
        f"Under {MOTIONS} measured motions at {len(FACTORS)} scales each, {equal} of {count} outcomes and sides are "
        f"those of an independent integration; peak rotations differ by {peaks.max():.0e} θ_cr at most, times of "
        f"overturning by {times.max():.0e} s. The annual rate under {RATE_MOTIONS} motions is the same for "
        f"{', '.join(map(str, COUNTS))} intensities (to {spread:.0e}).\n\n"
        f"Block of {WIDTH} m by {HEIGHT} m, motions of a shake table as measured, scaled to "
        f"{', '.join(map(str, FACTORS))} times the peak that lifts the block off. The integration is scipy's DOP853 "
        f"with events over each interval of the samples, relative tolerance {ERROR:g}, of the equation of the "
        "rectangle in radians and seconds. Rates are without noise, after a high-pass correction, "
        "hazard 1e-4 im^-2.5, PGV 0.2 to 4 m/s.\n\n"
    )
    body += table(["difference of", "paths", "median", "largest"], rows) + "\n\n"
    body += table(["intensities", "annual rate"], [[number, f"{rate:.6e}"] for number, rate in rates.items()])
    write_section("Measured records against integration", body, page=None, values={"rates": list(rates.values())})


if __name__ == "__main__":
    main()
