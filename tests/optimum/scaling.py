"""What a stop takes that slows down the plan's clock: `python scaling.py`, a table (decision 39).

The rate of the clock falls from 1 to 0 by one smooth pulse, of which all derivatives up to the third are
continuous, in the shortest time in which feed, acceleration, jerk and snap keep their limits. The plan goes
on behind the ramp at its final feed. Each state is one of `stops.json`, and so is the least time it is
compared with.
"""

import json
from math import cos, pi, sin
from pathlib import Path

import numpy as np

from law import Ramp
from machines import Machine

STEPS = 300
# Times tried, over the least one: up to this, in steps of this.
MOST = 12.0
STEP = 1.03
ROUNDING = 1e-3


def snap(ramp, t):
    """The snap of a ramp."""
    pulse, edge = ramp.pulse_s, ramp.edge_s
    left = ramp.time_s - t
    near, sign = (t, 1.0) if t <= pulse else (left, 1.0)
    if near < 0.0 or near > pulse or edge <= 0.0:
        return 0.0
    peak = ramp.peak_jerk_mm_s3 * pi / (2.0 * edge)
    if near <= edge:
        value = peak * sin(pi * near / edge)
    elif near < pulse - edge:
        value = 0.0
    else:
        value = -peak * sin(pi * (pulse - near) / edge)
    return ramp.sign * sign * value


def plan(ramp, to_mm_s, t):
    if t >= ramp.time_s:
        return to_mm_s, 0.0, 0.0, 0.0
    return (*ramp.at(t), snap(ramp, t))


def keeps_limits(machine, ramp, to_mm_s, start_s, time_s):
    step, clock = time_s / STEPS, start_s
    for number in range(STEPS):
        x = (number + 0.5) / STEPS
        rate = 1.0 - (x - sin(2.0 * pi * x) / (2.0 * pi))
        first = -(1.0 - cos(2.0 * pi * x)) / time_s
        second = -2.0 * pi * sin(2.0 * pi * x) / time_s**2
        third = -((2.0 * pi) ** 2) * cos(2.0 * pi * x) / time_s**3
        clock += step * rate
        v, a, j, s = plan(ramp, to_mm_s, clock)
        accel = rate**2 * a + first * v
        jerk = rate**3 * j + 3.0 * rate * first * a + second * v
        snap_now = (
            rate**4 * s
            + 6.0 * rate**2 * first * j
            + (3.0 * first**2 + 4.0 * rate * second) * a
            + third * v
        )
        over = max(
            abs(accel) / machine.accel_mm_s2,
            abs(jerk) / machine.jerk_mm_s3,
            abs(snap_now) / machine.snap_mm_s4,
        )
        if over > 1.0 + ROUNDING:
            return False
    return True


def times(entry):
    """The time by the clock over the least one, for each state; infinite where there is none."""
    machine = Machine(*(entry[key] for key in ("name", "accel_mm_s2", "jerk_mm_s3", "snap_mm_s4")))
    for state in entry["stops"]:
        ramp = Ramp(machine, state["from_mm_s"], state["to_mm_s"])
        factor = 1.0
        while factor < MOST:
            if keeps_limits(machine, ramp, state["to_mm_s"], state["at_s"], factor * state["time_s"]):
                break
            factor *= STEP
        yield factor if factor < MOST else float("inf")


def printed(value):
    return "–" if np.isinf(value) else f"{value:.2f}"


def main():
    entries = json.loads((Path(__file__).parent / "stops.json").read_text())
    print("| machine | median | 90 % | none up to 12 times |")
    print("|---|---:|---:|---:|")
    for entry in entries:
        found = np.sort(list(times(entry)))
        none = np.mean(np.isinf(found))
        median, most = (printed(found[int(share * (len(found) - 1))]) for share in (0.5, 0.9))
        print(f"| {entry['name']} | {median} | {most} | {100 * none:.0f} % |")


if __name__ == "__main__":
    main()
