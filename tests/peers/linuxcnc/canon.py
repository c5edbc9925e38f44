"""The programmed path of a program as LinuxCNC's own interpreter reads it: `python3 canon.py PROGRAM` prints JSON. Runs
with the Python that LinuxCNC is installed for.

Prints `points` [mm] and `least_s`, the time of its feeds and dwells without any acceleration, or `error`."""

import json
import math
import os
import sys

import gcode

from path import arc_points

INCH_MM = 25.4
PLANES = {1: (0, 1, 2), 2: (1, 2, 0), 3: (2, 0, 1)}


class Canon:
    """What the interpreter calls. Lengths come in inches, whatever the program's units are."""

    def __init__(self, parameter_file, axis_max_mm_s):
        self.parameter_file = parameter_file
        self.axis_max_mm_s = axis_max_mm_s
        self.points = [(0.0, 0.0, 0.0)]
        self.plane = PLANES[1]
        self.feed_mm_s = 0.0
        self.least_s = 0.0

    def __getattr__(self, name):
        # Spindle, comments, tools: nothing that moves.
        return lambda *arguments: None

    def go(self, points, feed_mm_s):
        for point in points:
            start = self.points[-1]
            self.points.append(point)
            length = math.dist(start, point)
            axis_s = max(abs(b - a) for a, b in zip(start, point)) / self.axis_max_mm_s
            self.least_s += max(length / feed_mm_s, axis_s) if feed_mm_s > 0 else axis_s

    def straight_traverse(self, x, y, z, *others):
        self.go([(x * INCH_MM, y * INCH_MM, z * INCH_MM)], math.inf)

    def straight_feed(self, x, y, z, *others):
        self.go([(x * INCH_MM, y * INCH_MM, z * INCH_MM)], self.feed_mm_s)

    def arc_feed(self, first, second, first_centre, second_centre, turns, third, *others):
        end = [0.0, 0.0, 0.0]
        for axis, value in zip(self.plane, (first, second, third)):
            end[axis] = value * INCH_MM
        centre = (first_centre * INCH_MM, second_centre * INCH_MM)
        self.go(arc_points(self.points[-1], end, centre, turns, self.plane), self.feed_mm_s)

    def set_plane(self, plane):
        self.plane = PLANES[plane]

    def set_feed_rate(self, inch_min):
        self.feed_mm_s = inch_min * INCH_MM / 60

    def dwell(self, seconds):
        self.least_s += seconds

    def get_external_length_units(self):
        return 1 / INCH_MM

    def get_external_angular_units(self):
        return 1.0

    def get_axis_mask(self):
        return 7

    def get_block_delete(self):
        return False

    def check_abort(self):
        return False

    def get_tool(self, pocket):
        return (-1,) + (0.0,) * 12 + (0,)

    def user_defined_function(self, *arguments):
        raise ValueError("user-defined M code")


def main():
    program, axis_max_mm_s = sys.argv[1], float(sys.argv[2])
    canon = Canon(os.path.join(os.path.dirname(program), "canon.var"), axis_max_mm_s)
    open(canon.parameter_file, "a").close()
    status, line = gcode.parse(program, canon, "G21", "")
    if status > gcode.MIN_ERROR:
        json.dump({"error": f"line {line}: {gcode.strerror(status)}"}, sys.stdout)
    else:
        json.dump({"points": canon.points, "least_s": canon.least_s}, sys.stdout)


main()
