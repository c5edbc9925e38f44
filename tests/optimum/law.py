"""The plateau law in closed form, written from docs/decisions/38-plateau.md and not from the code."""

from math import cos, pi, sin, sqrt


class Ramp:
    """The fastest ramp of the law between two feeds."""

    def __init__(self, machine, from_mm_s, to_mm_s):
        accel, jerk, snap = machine.accel_mm_s2, machine.jerk_mm_s3, machine.snap_mm_s4
        change = abs(to_mm_s - from_mm_s)
        self.from_mm_s, self.sign = from_mm_s, 1.0 if to_mm_s >= from_mm_s else -1.0
        # As the table of the decision: what decides is what gives the least jerk.
        edge = (pi * change / (4.0 * snap)) ** (1.0 / 3.0)
        plateau = hold = 0.0
        peak = min(jerk, sqrt(2.0 * accel * snap / pi))
        if 2.0 * snap * edge / pi > peak:
            edge = pi * peak / (2.0 * snap)
            plateau = sqrt(change / peak + edge**2 / 4.0) - 1.5 * edge
            most = max(accel / peak - edge, 0.0)
            if plateau > most:
                plateau = most
                hold = max(change / accel - (plateau + 2.0 * edge), 0.0)
        self.peak_jerk_mm_s3 = 2.0 * snap * edge / pi
        self.edge_s, self.plateau_s, self.hold_s = edge, plateau, hold
        self.pulse_s = plateau + 2.0 * edge
        self.time_s = 2.0 * self.pulse_s + hold

    def _edge(self, t):
        e, peak = self.edge_s, self.peak_jerk_mm_s3
        turn = pi * t / e
        # 1 − cos without its loss of digits.
        return (
            0.5 * peak * (t * t / 2.0 - 2.0 * (e / pi * sin(turn / 2.0)) ** 2),
            0.5 * peak * (t - e / pi * sin(turn)),
            peak * sin(turn / 2.0) ** 2,
        )

    def _pulse(self, t):
        """Feed, acceleration, jerk gained in the first pulse."""
        e, p, peak = self.edge_s, self.plateau_s, self.peak_jerk_mm_s3
        if t <= e:
            return self._edge(t)
        accel = peak * (p + e)
        if t <= e + p:
            v, a, j = self._edge(e)
            t -= e
            return v + t * (a + 0.5 * peak * t), a + peak * t, j
        left = self.pulse_s - t
        v, a, j = self._edge(left)
        return accel * self.pulse_s / 2.0 - accel * left + v, accel - a, j

    def at(self, t):
        """Feed, acceleration, jerk at a time."""
        half = self._pulse(self.pulse_s)
        if t <= self.pulse_s:
            v, a, j = self._pulse(t)
        elif t <= self.pulse_s + self.hold_s:
            v, a, j = half[0] + half[1] * (t - self.pulse_s), half[1], 0.0
        else:
            v, a, j = self._pulse(self.time_s - t)
            v, j = 2.0 * half[0] + half[1] * self.hold_s - v, -j
        return self.from_mm_s + self.sign * v, self.sign * a, self.sign * j


def ramp_time_s(machine, change_mm_s):
    return Ramp(machine, 0.0, change_mm_s).time_s


def full_change_mm_s(machine):
    """The change of feed from which on a ramp reaches the limit of acceleration."""
    peak = min(machine.jerk_mm_s3, sqrt(2.0 * machine.accel_mm_s2 * machine.snap_mm_s4 / pi))
    return machine.accel_mm_s2 * (machine.accel_mm_s2 / peak + pi * peak / (2.0 * machine.snap_mm_s4))
