"""Lists of blocks, each with a ceiling of feed, from rest to rest: a nonlinear program.

Each block has a time of its own and N cells of constant snap, all equally long. Unknown are the times and
jerk, acceleration and feed at the grid points. The formulas are those of `straight.py`, so again what is
found keeps every limit and every ceiling at every instant. The program is not convex. It is solved from
several starts on a coarse grid, and the best are refined. The least time is the best that was found, an
upper bound of the optimum.
"""

import random
from dataclasses import dataclass

import casadi as ca
import numpy as np

from law import full_change_mm_s, ramp_time_s
from machines import Motion, violation

KINDS = ("stairs up", "stairs down", "minimum", "hump")


def random_list(machine, kind, seed):
    """Blocks as (length, ceiling): ceilings around the change of feed that needs all acceleration, lengths
    around what a ramp from rest to the ceiling takes, so that ceilings matter and ramps span blocks.
    """
    rng = random.Random(f"{machine.name}/{kind}/{seed}")
    count = rng.randint(2 if kind.startswith("stairs") else 3, 5)

    def log(least, greatest):
        return least * (greatest / least) ** rng.random()

    feed = full_change_mm_s(machine)
    caps = sorted(log(0.15, 1.5) * feed for _ in range(count))
    if kind == "stairs down":
        caps.reverse()
    elif kind in ("minimum", "hump"):
        odd = caps.pop(0 if kind == "minimum" else -1)
        rng.shuffle(caps)
        caps.insert(rng.randint(1, count - 2), odd)
    blocks = []
    for cap in caps:
        length = 0.5 * cap * ramp_time_s(machine, cap) * log(0.1, 2.0)
        # Figures that are short in the file; the same ones are planned.
        blocks.append((float(f"{length:.4g}"), float(f"{cap:.4g}")))
    return blocks


class Program:
    """The nonlinear program for a number of blocks and cells; built once, solved for many lists."""

    def __init__(self, machine, blocks, cells, is_rough):
        self.machine, self.cells = machine, cells
        # Units: feed and time of a ramp that needs all acceleration.
        self.feed = full_change_mm_s(machine)
        self.time = ramp_time_s(machine, self.feed)
        accel, jerk = machine.accel_mm_s2, machine.jerk_mm_s3
        self.jerk = min(jerk, np.sqrt(accel * machine.snap_mm_s4))
        n = self.n = blocks * cells
        times = ca.MX.sym("times", blocks)
        j, a, v = (ca.MX.sym(name, n + 1) for name in "jav")
        caps, lengths = ca.MX.sym("caps", blocks), ca.MX.sym("lengths", blocks)
        # From blocks to their cells.
        spread = ca.DM(np.kron(np.eye(blocks), np.ones((cells, 1))))
        h, cap = spread @ times / cells, spread @ caps
        ja, av = self.jerk * self.time / accel, accel * self.time / self.feed
        jv = self.jerk * self.time**2 / self.feed
        j0, j1, a0, a1, v0, v1 = j[:-1], j[1:], a[:-1], a[1:], v[:-1], v[1:]
        snap = machine.snap_mm_s4 * self.time / self.jerk
        way = h * (v0 + v1) / 2 + h**2 * av * (a0 - a1) / 12
        way = ca.sum1(ca.reshape(way, cells, blocks)).T
        rows = [
            (a1 - a0 - ja * h * (j0 + j1) / 2, 0, 0),
            (v1 - v0 - av * h * (a0 + a1) / 2 - jv * h**2 * (j0 - j1) / 12, 0, 0),
            (way - lengths, 0, 0),
            (j1 - j0 - snap * h, -np.inf, 0),
            (j1 - j0 + snap * h, 0, np.inf),
            (a0 + ja * h * j0 / 2, -1, 1),
            (v0 + av * h * a0 / 3, 0, np.inf),
            (v1 - av * h * a1 / 3, 0, np.inf),
            (v0 + av * h * a0 / 3 - cap, -np.inf, 0),
            (v1 - av * h * a1 / 3 - cap, -np.inf, 0),
        ]
        self.low = np.concatenate([np.full(row.shape[0], float(low)) for row, low, _ in rows])
        self.high = np.concatenate([np.full(row.shape[0], float(high)) for row, _, high in rows])
        program = {
            "x": ca.vertcat(times, j, a, v),
            "p": ca.vertcat(caps, lengths),
            "f": ca.sum1(times),
            "g": ca.vertcat(*(row for row, _, _ in rows)),
        }
        options = {
            "print_time": False,
            "ipopt.print_level": 0,
            "ipopt.sb": "yes",
            "expand": True,
            # Attempts that take longer seldom end well.
            "ipopt.max_iter": 250 if is_rough else 400,
            "ipopt.max_cpu_time": 0.02 * n,
            "ipopt.tol": 1e-4 if is_rough else 1e-7,
            "ipopt.constr_viol_tol": 1e-6 if is_rough else 1e-9,
            "ipopt.bound_relax_factor": 0.0,
            "ipopt.mu_strategy": "adaptive",
        }
        self.solver = ca.nlpsol("list", "ipopt", program, options)

    def solve(self, blocks, start):
        """From `start`, times and states in mm and s; the time, the times, the states and the motion."""
        machine, n = self.machine, self.n
        caps = np.array([cap for _, cap in blocks]) / self.feed
        lengths = np.array([length for length, _ in blocks]) / (self.feed * self.time)
        most = np.concatenate([np.repeat(caps, self.cells), [0.0]])
        most[1:-1] = np.minimum(most[1:-1], most[:-2])
        most[0] = 0.0
        ends = np.r_[0.0, np.full(n - 1, np.inf), 0.0]
        jerk = np.minimum(machine.jerk_mm_s3 / self.jerk, ends)
        accel = np.minimum(1.0, ends)
        times, j, a, v = start
        found = self.solver(
            x0=np.concatenate([times / self.time, j / self.jerk, a / machine.accel_mm_s2, v / self.feed]),
            p=np.concatenate([caps, lengths]),
            lbx=np.concatenate([np.full(len(times), 1e-6), -jerk, -accel, np.zeros(n + 1)]),
            ubx=np.concatenate([np.full(len(times), np.inf), jerk, accel, most]),
            lbg=self.low,
            ubg=self.high,
        )
        x = np.array(found["x"]).ravel()
        times, rest = x[: len(times)] * self.time, x[len(times) :].reshape(3, n + 1)
        j, a, v = rest[0] * self.jerk, rest[1] * machine.accel_mm_s2, rest[2] * self.feed
        step = np.repeat(times / self.cells, self.cells)
        motion = Motion(step, np.diff(j) / step)
        ends = np.cumsum([length for length, _ in blocks])
        broken = violation(
            machine,
            motion,
            np.repeat(caps * self.feed, self.cells),
            [((block + 1) * self.cells, end) for block, end in enumerate(ends)],
        )
        return Solution(float(times.sum()), broken, self.cells, (times, j, a, v))


@dataclass
class Solution:
    """A motion that was found, and how far it breaks a limit, relative to it."""

    time_s: float
    violation: float
    cells: int
    states: tuple

    def refined(self, cells):
        """Its times and states on another grid."""
        times, *states = self.states

        def grid(cells):
            return np.concatenate([[0.0], np.cumsum(np.repeat(times / cells, cells))])

        return (times, *(np.interp(grid(cells), grid(self.cells), state) for state in states))


def _filtered(machine, blocks, lag_s, share):
    """Feed over time under `share` of the acceleration alone, filtered over `lag_s`: length, time, states."""
    accel = share * machine.accel_mm_s2
    ends = np.cumsum([0.0] + [length for length, _ in blocks])
    s = np.linspace(0.0, ends[-1], 4001)
    ceiling = np.full(len(s), np.inf)
    # A ceiling holds for the lag's way around its block.
    for (_, cap), start, end in zip(blocks, ends, ends[1:]):
        near = (s >= start - cap * lag_s / 2) & (s <= end + cap * lag_s / 2)
        ceiling[near] = np.minimum(ceiling[near], cap)
    square = ceiling**2
    square[[0, -1]] = 0.0
    step = 2.0 * accel * (s[1] - s[0])
    for i in range(1, len(s)):
        square[i] = min(square[i], square[i - 1] + step)
    for i in range(len(s) - 2, -1, -1):
        square[i] = min(square[i], square[i + 1] + step)
    v = np.sqrt(square)
    t = np.concatenate([[0.0], np.cumsum(2.0 * np.diff(s) / (v[1:] + v[:-1]))])
    even = np.linspace(-lag_s, t[-1] + lag_s, 4001)
    feed = np.interp(even, t, v, left=0.0, right=0.0)
    dt = even[1] - even[0]
    width = max(int(lag_s / dt / 2), 1)
    for _ in range(2):
        feed = np.convolve(feed, np.ones(width) / width, mode="same")
    return even, feed


def starts(machine, blocks, cells, rng, more):
    """Where the solver starts from: filtered plans from bold to slow, and `more` at random."""
    lag = ramp_time_s(machine, full_change_mm_s(machine)) / 2
    shares = [(0.5, 0.9), (1.0, 0.6), (2.0, 0.3)]
    shares += [(rng.uniform(0.2, 3.0), rng.uniform(0.1, 1.0)) for _ in range(more)]
    for lags, share in shares:
        t, feed = _filtered(machine, blocks, lags * lag, share)
        dt = t[1] - t[0]
        s = np.concatenate([[0.0], np.cumsum((feed[1:] + feed[:-1]) / 2) * dt])
        ends = np.cumsum([length for length, _ in blocks])
        s *= ends[-1] / s[-1]
        rising = np.maximum.accumulate(s) + np.arange(len(s)) * 1e-12 * ends[-1]
        first, last = np.searchsorted(s, 1e-6 * ends[-1]), np.searchsorted(s, (1 - 1e-6) * ends[-1])
        cuts = np.concatenate([[t[first]], np.interp(ends[:-1], rising, t), [t[last]]])
        parts = [np.linspace(low, high, cells + 1) for low, high in zip(cuts, cuts[1:])]
        grid = np.concatenate([[cuts[0]]] + [part[1:] for part in parts])
        v = np.interp(grid, t, feed)
        a = np.interp(grid, t, np.gradient(feed, dt)).clip(-machine.accel_mm_s2, machine.accel_mm_s2)
        j = np.gradient(a, grid).clip(-machine.jerk_mm_s3, machine.jerk_mm_s3)
        yield np.diff(cuts), j, a, v


class Solver:
    """Solves lists of one machine; keeps the programs it has built."""

    # Cells of a block. Where the first of the fine grids fails, the next is tried.
    COARSE, MIDDLE, FINE = 20, 50, (100, 90, 110, 80)
    # The relative violation of a limit up to which a motion counts: on the coarse grid, and as a result.
    ROUGH_MAX, VIOLATION_MAX = 1e-3, 1e-6

    def __init__(self, machine):
        self.machine, self.programs = machine, {}

    def _solve(self, blocks, cells, starts):
        """What was found from the starts, the fastest first."""
        is_rough = cells == self.COARSE
        key = (len(blocks), cells)
        if key not in self.programs:
            self.programs[key] = Program(self.machine, *key, is_rough)
        found = (self.programs[key].solve(blocks, start) for start in starts)
        most = self.ROUGH_MAX if is_rough else self.VIOLATION_MAX
        return sorted((one for one in found if one.violation <= most), key=lambda one: one.time_s)

    def best(self, blocks, seed, more=3, refine=2):
        """The best motion found, the time on the middle grid, and from how many starts a motion was found."""
        rng = random.Random(f"starts/{seed}")
        coarse = self._solve(blocks, self.COARSE, starts(self.machine, blocks, self.COARSE, rng, more))
        # Solutions that are alike are refined once.
        apart = [one for n, one in enumerate(coarse) if n == 0 or one.time_s > coarse[n - 1].time_s * 1.0001]
        middle = self._solve(blocks, self.MIDDLE, [one.refined(self.MIDDLE) for one in apart[:refine]])
        fine = []
        for cells in self.FINE:
            fine = fine or self._solve(blocks, cells, [one.refined(cells) for one in middle])
        if not middle:
            return None
        best = min(middle + fine, key=lambda one: one.time_s)
        return best, middle[0].time_s, len(coarse)
