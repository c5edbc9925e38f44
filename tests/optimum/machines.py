"""The machines, and the check that every result passes before it is written."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Machine:
    """Limits along the path."""

    name: str
    accel_mm_s2: float
    jerk_mm_s3: float
    snap_mm_s4: float

    def as_json(self):
        return {
            "name": self.name,
            "accel_mm_s2": self.accel_mm_s2,
            "jerk_mm_s3": self.jerk_mm_s3,
            "snap_mm_s4": self.snap_mm_s4,
        }


MACHINES = [
    Machine("reference", 500.0, 5e3, 4e5),
    Machine("light", 2000.0, 4e4, 2e6),
    Machine("low snap", 1000.0, 1e4, 1e5),
    Machine("low snap, high jerk", 3000.0, 1e6, 1e7),
]


@dataclass
class Motion:
    """Snap, constant in each cell, and where it starts from."""

    step_s: np.ndarray
    snap_mm_s4: np.ndarray
    start: tuple = (0.0, 0.0, 0.0)


def integrated(motion):
    """Length, feed, acceleration and jerk at the ends of the cells: nothing but Taylor's formula.

    The solvers use other formulas (see `straight.py`), so an error in those shows here.
    """
    states = np.zeros((len(motion.step_s) + 1, 4))
    states[0, 1:] = motion.start
    for cell, (h, snap) in enumerate(zip(motion.step_s, motion.snap_mm_s4)):
        s, v, a, j = states[cell]
        states[cell + 1] = (
            s + h * (v + h * (a / 2 + h * (j / 6 + h * snap / 24))),
            v + h * (a + h * (j / 2 + h * snap / 6)),
            a + h * (j + h * snap / 2),
            j + h * snap,
        )
    return states


def _within(states, motion):
    """Every point where feed or acceleration may be greatest: the ends of cells and the extrema in them.

    Returns cell, feed, acceleration.
    """
    found = []
    for cell, (h, snap) in enumerate(zip(motion.step_s, motion.snap_mm_s4)):
        _, v, a, j = states[cell]
        times = [0.0, h]
        if snap != 0.0:
            times.append(-j / snap)
        roots = np.roots([snap / 2, j, a]) if abs(snap) > 0.0 else ([-a / j] if j != 0.0 else [])
        times.extend(float(np.real(root)) for root in roots if abs(np.imag(root)) == 0.0)
        for t in times:
            if 0.0 <= t <= h:
                found.append((cell, v + t * (a + t * (j / 2 + t * snap / 6)), a + t * (j + t * snap / 2)))
    return found


def violation(machine, motion, cap_mm_s, lengths=(), end=(0.0, 0.0, 0.0), v_scale_mm_s=None):
    """The greatest violation of anything, relative to its limit.

    `cap_mm_s`: a ceiling for each cell. `lengths`: (index of a grid point, length there).
    """
    states = integrated(motion)
    v_scale = v_scale_mm_s or max(states[:, 1].max(), 1e-9)
    worst = np.max(np.abs(motion.snap_mm_s4)) / machine.snap_mm_s4 - 1.0
    worst = max(worst, np.max(np.abs(states[:, 3])) / machine.jerk_mm_s3 - 1.0)
    for cell, v, a in _within(states, motion):
        worst = max(worst, abs(a) / machine.accel_mm_s2 - 1.0, -v / v_scale, v / cap_mm_s[cell] - 1.0)
    for index, length in lengths:
        worst = max(worst, abs(states[index, 0] / length - 1.0))
    scales = (v_scale, machine.accel_mm_s2, machine.jerk_mm_s3)
    for found, expected, scale in zip(states[-1, 1:], end, scales):
        worst = max(worst, abs(found - expected) / scale)
    return float(max(worst, 0.0))
