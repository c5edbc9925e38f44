"""Motion on a straight without ceilings, in least time: linear programs.

Snap is constant in each of N cells. For a given duration every constraint is linear in jerk,
acceleration and feed at the grid points, so a linear program decides; the duration is found by iteration.
Between grid points acceleration is quadratic and feed cubic. Bernstein's coefficients bound them there, so
what is found is a motion within all limits at every instant. Its time is an upper bound of the optimum,
which falls to it as the grid gets finer.
"""

import numpy as np
from scipy.optimize import linprog
from scipy.sparse import coo_matrix

from machines import Motion


class Rows:
    """Rows of a sparse matrix with their right-hand sides."""

    def __init__(self):
        self.entries, self.right, self.count = [], [], 0

    def add(self, terms, right):
        """`terms`: (columns, coefficients), one for each row or one for all of them."""
        n = max(np.size(columns) for columns, _ in terms)
        rows = self.count + np.arange(n)
        for columns, coefficient in terms:
            self.entries.append((rows, np.broadcast_to(columns, n), np.broadcast_to(coefficient, n)))
        self.right.append(np.broadcast_to(right, n))
        self.count += n

    def matrix(self, width):
        rows, columns, values = (np.concatenate(part) for part in zip(*self.entries))
        return coo_matrix((values, (rows, columns)), shape=(self.count, width)).tocsr()


# Limits of acceleration may be exceeded by this part: a state just below its limit has less room than a cell
# can show.
ROOM = 2e-7


def equal(cells):
    """The cells' parts of the duration."""
    return np.full(cells, 1.0 / cells)


def graded(cells):
    """Short cells first: a state in motion may be near a limit and must soon turn away from it."""
    first = cells // 4
    parts = np.concatenate([np.geomspace(0.02, 1.0, first), np.ones(cells - first)])
    return parts / parts.sum()


class Horizon:
    """The program for one duration. Feed is in units of `v_scale`, acceleration and jerk in their limits."""

    def __init__(self, machine, parts, duration_s, v_scale_mm_s, has_peak=False):
        cells, self.h, self.v_scale, self.machine = len(parts), parts * duration_s, v_scale_mm_s, machine
        accel, jerk = machine.accel_mm_s2, machine.jerk_mm_s3
        points = cells + 1
        self.j, self.a, self.v = (np.arange(points) + part * points for part in range(3))
        self.width = 3 * points + int(has_peak)
        h = self.h
        # Integrals of polynomials by the ends' values and slopes, exact up to the third degree.
        ja, av = h * jerk / accel, h * accel / v_scale_mm_s
        jv = h * h * jerk / v_scale_mm_s
        j, a, v = self.j, self.a, self.v
        self.equal, self.less = Rows(), Rows()
        self.equal.add([(a[1:], 1), (a[:-1], -1), (j[1:], -ja / 2), (j[:-1], -ja / 2)], 0)
        slopes = [(j[1:], jv / 12), (j[:-1], -jv / 12)]
        self.equal.add([(v[1:], 1), (v[:-1], -1), (a[1:], -av / 2), (a[:-1], -av / 2), *slopes], 0)
        change = h * machine.snap_mm_s4 / jerk
        for sign in (1, -1):
            self.less.add([(j[1:], sign), (j[:-1], -sign)], change)
            self.less.add([(a[:-1], sign), (j[:-1], sign * ja / 2)], 1 + ROOM)
        self.less.add([(v[:-1], -1), (a[:-1], -av / 3)], 0)
        self.less.add([(v[1:], -1), (a[1:], av / 3)], 0)
        if has_peak:
            peak = self.width - 1
            self.less.add([(v, 1), (peak, -1)], 0)
            self.less.add([(v[:-1], 1), (a[:-1], av / 3), (peak, -1)], 0)
            self.less.add([(v[1:], 1), (a[1:], -av / 3), (peak, -1)], 0)
        self.cost = np.zeros(self.width)
        limits = np.repeat([1.0, 1.0 + ROOM], points)
        self.low = np.concatenate([-limits, np.zeros(points + int(has_peak))])
        self.high = np.concatenate([limits, np.full(points + int(has_peak), np.inf)])

    def fix(self, column, value):
        self.low[column] = self.high[column] = value

    def start(self, v, a, j):
        machine = self.machine
        self.fix(self.v[0], v / self.v_scale)
        self.fix(self.a[0], a / machine.accel_mm_s2)
        self.fix(self.j[0], j / machine.jerk_mm_s3)

    def solved(self):
        found = linprog(
            self.cost,
            A_ub=self.less.matrix(self.width),
            b_ub=np.concatenate(self.less.right),
            A_eq=self.equal.matrix(self.width),
            b_eq=np.concatenate(self.equal.right),
            bounds=np.column_stack([self.low, self.high]),
            method="highs-ds",
            options={"primal_feasibility_tolerance": 1e-9, "dual_feasibility_tolerance": 1e-9},
        )
        return found if found.status == 0 else None

    def snap(self, x):
        return np.diff(x[self.j]) * self.machine.jerk_mm_s3 / self.h


def longest_mm(machine, cells, duration_s):
    """How far from rest to rest in the time, and the motion.

    Half of it: the mean of a motion and of the same run backwards keeps every limit, so one of the best is
    symmetric.
    """
    v_scale = machine.accel_mm_s2 * duration_s / 2
    half = Horizon(machine, equal(cells), duration_s / 2, v_scale)
    half.start(0.0, 0.0, 0.0)
    half.fix(half.a[-1], 0.0)
    # Length in units of v_scale and duration; the halves' feeds and slopes, as above.
    length = np.full(cells + 1, 1.0 / cells)
    length[[0, -1]] /= 2
    half.cost[half.v] = -length
    found = half.solved()
    snap = half.snap(found.x)
    slopes = (found.x[half.a[0]] - found.x[half.a[-1]]) * machine.accel_mm_s2 * half.h[0] ** 2 / 6
    motion = Motion(np.concatenate([half.h, half.h]), np.concatenate([snap, -snap[::-1]]))
    return -found.fun * v_scale * duration_s + slopes, motion


def least_time_of_move(machine, cells, length_mm, relative=1e-9):
    """The least time from rest to rest over a length, and the motion."""
    # With snap alone T⁴ = 384·L/DJ; every further limit makes it longer.
    time_s = (384.0 * length_mm / machine.snap_mm_s4) ** 0.25
    time_s = max(time_s, 2.0 * (length_mm / machine.accel_mm_s2) ** 0.5)
    before = None
    for _ in range(60):
        reached, motion = longest_mm(machine, cells, time_s)
        if abs(reached / length_mm - 1.0) < relative:
            return time_s, motion
        # Secant in logarithms, where length is a power of time between 2 and 4.
        point = (np.log(time_s), np.log(reached / length_mm))
        power = 3.0 if before is None else (point[1] - before[1]) / (point[0] - before[0])
        power = min(max(power, 1.5), 5.0)
        time_s, before = time_s * np.exp(-point[1] / power), point
    raise RuntimeError(f"no time for {length_mm} mm on {machine}")


def _stop(machine, cells, duration_s, state, v_scale):
    """The least final feed of a motion that ends with a = j = 0, or None."""
    horizon = Horizon(machine, graded(cells), duration_s, v_scale)
    horizon.start(*state)
    horizon.fix(horizon.a[-1], 0.0)
    horizon.fix(horizon.j[-1], 0.0)
    horizon.cost[horizon.v[-1]] = 1.0
    return horizon, horizon.solved()


def least_stop(machine, cells, state, slack=1e-4, relative=3e-5):
    """The least time to rest, then the least peak of feed in that time and a slack, and that motion."""
    v_scale = max(state[0], machine.accel_mm_s2**2 / machine.jerk_mm_s3 / 2)
    zero = 1e-9
    low, high = 0.0, 2.0 * state[0] / machine.accel_mm_s2 + 8.0 * (v_scale / machine.snap_mm_s4) ** (1 / 3)
    while True:
        found = _stop(machine, cells, high, state, v_scale)[1]
        if found is not None and found.fun <= zero:
            break
        low, high = high, 1.5 * high
        if high > 1e3:
            raise RuntimeError(f"no stop from {state} on {machine}")
    points = []
    while high - low > relative * high:
        middle = 0.5 * (low + high)
        if len(points) >= 2 and points[-1][1] < points[-2][1]:
            (t0, g0), (t1, g1) = points[-2:]
            guess = t1 + g1 * (t1 - t0) / (g0 - g1) + 0.3 * relative * high
            if low < guess < high:
                middle = guess
        found = _stop(machine, cells, middle, state, v_scale)[1]
        if found is not None and found.fun <= zero:
            high = middle
            if middle - low > 4 * relative * high:
                # The secant was right or not far above: look closely below it.
                points = points[-2:]
                close = middle - 0.9 * relative * high
                found = _stop(machine, cells, close, state, v_scale)[1]
                if found is not None and found.fun <= zero:
                    high, points = close, []
                else:
                    low = close
                    if found is not None:
                        points.append((close, found.fun))
        else:
            low = middle
            if found is not None:
                points.append((middle, found.fun))
    time_s = high
    horizon = Horizon(machine, graded(cells), time_s * (1.0 + slack), v_scale, has_peak=True)
    horizon.start(*state)
    for column in (horizon.v[-1], horizon.a[-1], horizon.j[-1]):
        horizon.fix(column, 0.0)
    horizon.cost[-1] = 1.0
    found = horizon.solved()
    if found is None:
        raise RuntimeError(f"no stop from {state} in {time_s} s on {machine}")
    peak = max(found.fun * v_scale, state[0])
    motion = Motion(horizon.h, horizon.snap(found.x), state)
    return time_s, peak, motion
