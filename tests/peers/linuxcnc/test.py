"""`python3 -m unittest test` in this folder. What needs LinuxCNC is skipped without it."""

import math
import os
import random
import subprocess
import sys
import unittest
from dataclasses import replace

import interpreter
import machine
import ours
import peer
import reading
import recording
import steps
import tools
from difference import compared
from path import Path, arc_points
from program import NotRewritten, PathMode, rewritten

XY, ZX = (0, 1, 2), (2, 0, 1)
SEED = 20


class Rewriting(unittest.TestCase):
    mode = PathMode(0.0508, None)

    def lines(self, text, mode=mode):
        return rewritten(text, mode).splitlines()

    def test_a_program_without_a_mode_gets_one(self):
        self.assertEqual(self.lines("G1 X1 F60\nM2"), ["G21 G64 P0.050800000", "G1 X1 F60", "M2"])

    def test_the_prologue_stands_behind_the_tape_mark(self):
        self.assertEqual(self.lines("%\nM2\n%"), ["%", "G21 G64 P0.050800000", "M2", "%"])

    def test_every_mode_is_replaced_in_the_units_of_its_line(self):
        text = "G64 P1 Q2 G20 G90\ng61.1 X1\nG21\nG061 x2\n(G20)\n; G20\nG64P.1q00.01"
        got = [line.split() for line in self.lines(text, PathMode(0.0508, 0.0254))[1:]]
        inch, mm = ["G64", "P0.002000000", "Q0.001000000"], ["G64", "P0.050800000", "Q0.025400000"]
        self.assertEqual(got, [[*inch, "G20", "G90"], [*inch, "X1"], ["G21"], [*mm, "x2"], ["(G20)"], [";", "G20"], mm])

    def test_other_words_and_comments_stay(self):
        text = "G4 P2\nG10 L2 P0\nG0 X6.4 (G64 P1) Y61 ; G61\nG640 X1\nG2 G17 P2 X1 I1"
        self.assertEqual(self.lines(text)[1:], text.splitlines())

    def test_a_tolerance_behind_a_comment_goes_too(self):
        self.assertEqual(self.lines("G64 (P1) P0.1 X1")[1].split(), ["G64", "P0.050800000", "(P1)", "X1"])

    def test_what_is_computed_or_shared_is_refused(self):
        for line in ("G64 P#1", "G64 P[1+1]", "G61 G4 P1"):
            with self.assertRaises(NotRewritten):
                rewritten(line, self.mode)


class Distance(unittest.TestCase):
    def test_a_quarter_turn_lies_on_its_circle(self):
        points = [(2.0, 0.0, 5.0), *arc_points((2.0, 0.0, 5.0), (0.0, 2.0, 5.0), (0.0, 0.0), 1, XY)]
        self.assertTrue(all(abs(math.hypot(x, y) - 2) < 1e-12 and z == 5 for x, y, z in points))
        self.assertAlmostEqual(sum(map(math.dist, points, points[1:])), math.pi, delta=1e-3)
        self.assertLess(max(map(math.dist, points, points[1:])) ** 2 / (8 * 2), 1.01e-4)

    def test_clockwise_is_the_other_way_round(self):
        points = arc_points((2.0, 0.0, 0.0), (0.0, 2.0, 0.0), (0.0, 0.0), -1, XY)
        self.assertLess(points[1][1], 0)
        self.assertAlmostEqual(sum(map(math.dist, points, points[1:])), 3 * math.pi, delta=0.1)

    def test_a_full_turn_and_a_helix_of_two(self):
        start = (0.0, 0.0, 3.0)
        one = [start, *arc_points(start, start, (0.0, 0.0), 1, ZX)]
        self.assertAlmostEqual(sum(map(math.dist, one, one[1:])), 6 * math.pi, delta=1e-2)
        two = [start, *arc_points(start, (0.0, 4.0, 3.0), (0.0, 0.0), 2, ZX)]
        self.assertAlmostEqual(sum(map(math.dist, two, two[1:])), math.hypot(12 * math.pi, 4), delta=1e-2)

    def test_a_cut_corner_is_as_far_as_its_middle(self):
        path = Path([(0.0, 0.0, 0.0), (10.0, 0.0, 0.0), (10.0, 10.0, 0.0)])
        cut = [(9 + at / 100, at / 100, 0.0) for at in range(101)]
        self.assertAlmostEqual(path.greatest_distance(cut), 0.5, delta=1e-3)
        self.assertAlmostEqual(path.greatest_distance([(-3.0, 0.0, 4.0)]), 5, delta=1e-2)

    def test_it_is_what_all_pieces_tell(self):
        print(f"seed {SEED}")
        source = random.Random(SEED)
        points = [(0.0, 0.0, 0.0)]
        for _ in range(40):
            points.append(tuple(value + source.uniform(-1, 1) for value in points[-1]))
        path = Path(points)
        near = [tuple(value + source.gauss(0, 0.05) for value in point) for point in points]

        def distance(position, a, b):
            # Ternary search: the distance along a line is convex.
            low, high = 0.0, 1.0
            at = lambda part: math.dist(position, [p + part * (q - p) for p, q in zip(a, b)])
            for _ in range(80):
                third = (high - low) / 3
                low, high = (low, high - third) if at(low + third) < at(high - third) else (low + third, high)
            return at(low)

        expected = max(min(distance(position, a, b) for a, b in zip(points, points[1:])) for position in near)
        self.assertAlmostEqual(path.greatest_distance(near), expected, delta=1.1e-3 * expected)

    def test_a_position_that_jumps_along_the_path_is_found_again(self):
        path = Path([(float(at), 0.0, 0.0) for at in range(1000)])
        self.assertLess(path.greatest_distance([(900.0, 0.0, 0.0), (3.0, 0.0, 0.0), (500.0, 0.01, 0.0)]), 0.0101)


class Recorded(unittest.TestCase):
    def test_time_is_from_the_first_to_the_last_move(self):
        x = [0, 0, 0, 1, 2, 2, 2, 3, 3, 3]
        self.assertAlmostEqual(recording.run_time_s([(float(value), 0.0, 0.0) for value in x]), 0.005)
        self.assertEqual(recording.run_time_s([(1.0, 2.0, 3.0)] * 9), 0)

    def test_jerk_is_the_third_difference(self):
        # Those of a step of 1 mm are 1, −2 and 1.
        self.assertAlmostEqual(recording.peak_jerk_mm_s3([(0.0, 0.0, 0.0)] * 5 + [(0.0, 1.0, 0.0)] * 5) / 2e9, 1)

    def test_jerk_of_accelerations(self):
        rows = [(0.0, 0.0, 0.0), (2.0, 0.0, -5.0), (4.0, 0.0, 0.0), (0.5, 0.0, 0.0)]
        self.assertAlmostEqual(recording.peak_jerk_of_accelerations_mm_s3(rows), 5000)
        # Rest is before the first and after the last.
        self.assertAlmostEqual(recording.peak_jerk_of_accelerations_mm_s3([(0.0, 9.0, 0.0), (0.0, 2.0, 0.0)]), 9000)
        self.assertAlmostEqual(recording.peak_jerk_of_accelerations_mm_s3([(0.0, 2.0, 0.0), (0.0, 9.0, 0.0)]), 9000)

    def test_both_jerks_agree_where_jerk_is_smooth(self):
        # From rest to rest: acceleration is 1 − cos, then the negative of it.
        omega, count = math.tau / 0.4, 400
        times = [at * recording.PERIOD_S for at in range(count)]
        gained = [t * t / 2 + (math.cos(omega * t) - 1) / omega**2 for t in times]
        half_s = count * recording.PERIOD_S
        x = gained + [half_s**2 / 2 + half_s * t - g for t, g in zip(times, gained)] + [half_s**2]
        a = [1 - math.cos(omega * t) for t in times]
        accelerations = a + [-value for value in a] + [0.0]
        for jerk in (
            recording.peak_jerk_mm_s3([(0.0, value, 0.0) for value in x]),
            recording.peak_jerk_of_accelerations_mm_s3([(0.0, value, 0.0) for value in accelerations]),
        ):
            self.assertAlmostEqual(jerk / omega, 1, delta=1e-3)

    def test_samples_that_are_missing_are_noticed(self):
        self.assertEqual(peer.samples("7 1.0 2.0 3.0\n8 1.5 2.0 3.0\n"), [[1.0, 2.0, 3.0], [1.5, 2.0, 3.0]])
        for text in ("7 1.0 2.0 3.0\n9 1.5 2.0 3.0\n", "7 1.0 2.0 3.0\noverrun\n"):
            with self.assertRaises(peer.LeftOut):
                peer.samples(text)

    def test_a_stall_is_a_long_rest_in_a_run_that_was_given_up(self):
        moving, resting = [[float(at), 0.0, 0.0] for at in range(40000)], [[0.0, 0.0, 0.0]] * 40000
        self.assertTrue(peer.stalled({"problem": "too long", "um": moving + resting}))
        self.assertFalse(peer.stalled({"problem": "too long", "um": resting + moving}))
        self.assertFalse(peer.stalled({"problem": None, "um": moving + resting}))

    def test_a_trace_is_read_at_whole_periods(self):
        rows = [
            {"t_s": f"{at * 0.0005:.9f}", **{f"{a}_set_mm": at for a in "XYZ"}, **{f"{a}_acc_mm_s2": -at for a in "XYZ"}}
            for at in range(5)
        ]
        self.assertEqual(ours.at_periods(rows), ([(0.0,) * 3, (2.0,) * 3, (4.0,) * 3], [(-0.0,) * 3, (-2.0,) * 3, (-4.0,) * 3]))


class Limits(unittest.TestCase):
    def test_snap_is_in_proportion(self):
        self.assertEqual(machine.MACHINES["reference"].snap_mm_s4, 400000)
        self.assertEqual(machine.MACHINES["jerk5ms"].snap_mm_s4, 1.6e8)

    def test_path_limits_are_raised_and_axis_limits_are_not(self):
        reference = "[path]\nfeed_mm_s = 1.0\nsnap_mm_s4 = 1.0\n[[axis]]\njerk_mm_s3 = 1.0\n[axis.drive]\njerk_mm_s3 = 1.0\n"
        self.assertEqual(
            machine.machine_file(machine.MACHINES["jerk5ms"], reference).splitlines(),
            ["[path]", "feed_mm_s = 519.615242", "snap_mm_s4 = 277128129.211020", "[[axis]]", "jerk_mm_s3 = 100000.000000",
             "[axis.drive]", "jerk_mm_s3 = 1.0"],
        )


# What both print of `G21 G64 P0.05 / F600 G1 X10 / G2 X20 I5 / M0 / G4 P.5 / G0 X0 / M2`.
CALLS = [
    ["set_g5x_offset", 0, 1, *[0.0] * 9],
    ["straight_traverse", 0, *[0.0] * 9],
    ["begin", 0],
    ["set_feed_rate", 2, 600 / 25.4],
    ["straight_feed", 2, 10 / 25.4, *[0.0] * 8],
    ["arc_feed", 3, 20 / 25.4, 0.0, 15 / 25.4, 0.0, -1, *[0.0] * 7],
    ["dwell", 5, 0.5],
    ["straight_traverse", 6, *[0.0] * 9],
    ["set_feed_rate", 7, 0.0],
]
ORDER = """    1 N..... USE_LENGTH_UNITS(CANON_UNITS_MM)
    2 N..... STRAIGHT_TRAVERSE(0.0000, 0.0000, 0.0000, 0.0000, 0.0000, 0.0000)
    3 N..... COMMENT("begin")
    4 N..... SET_MOTION_CONTROL_MODE(CANON_CONTINUOUS, 0.050000)
    5 N..... SET_NAIVECAM_TOLERANCE(0.0500)
    6 N..... SET_FEED_RATE(600.0000)
    7 N..... STRAIGHT_FEED(10.0000, 0.0000, 0.0000, 0.0000, 0.0000, 0.0000)
    8 N20    ARC_FEED(20.0000, 0.0000, 15.0000, 0.0000, -1, 0.0000, 0.0000, 0.0000, 0.0000)
    9 PROGRAM_STOP()
   10 N..... DWELL(0.5000)
   11 N..... STRAIGHT_TRAVERSE(0.0000, 0.0000, 0.0000, 0.0000, 0.0000, 0.0000)
   12 N..... SET_FEED_RATE(0.0000)
   13 N..... PROGRAM_END()
"""
BLEND = {"path": "blend", "tolerance_mm": 0.05, "merging_mm": None}
OBJECTS = [
    {"line": 2, "kind": "line", "from_mm": [0, 0, 0], "to_mm": [10, 0, 0], "feed_mm_min": 600.0, **BLEND},
    {"line": 3, "kind": "arc", "from_mm": [10, 0, 0], "to_mm": [20, 0, 0], "feed_mm_min": 600.0, **BLEND,
     "plane": "XY", "turn_deg": 0.0, "centre_mm": [15, 0], "sweep_rad": -math.pi},
    {"line": 4, "kind": "stop"},
    {"line": 5, "kind": "dwell", "dwell_s": 0.5},
    {"line": 6, "kind": "line", "from_mm": [20, 0, 0], "to_mm": [0, 0, 0], "feed_mm_min": None, **BLEND},
    {"line": 7, "kind": "end"},
]


class Steps(unittest.TestCase):
    def whats(self, mine, other):
        return [difference.what for difference in compared(mine, other)[0]]

    def test_both_forms_are_the_same(self):
        mine, other = steps.of_motion(OBJECTS), steps.of_linuxcnc(CALLS, ORDER)
        self.assertEqual([step.kind for step in other], ["move", "move", "stop", "dwell", "move"])
        differences, figures = compared(mine, other)
        self.assertEqual(differences, [])
        self.assertEqual((figures.moves, figures.others), (3, 2))

    def test_every_difference_has_its_name(self):
        other = steps.of_linuxcnc(CALLS, ORDER)
        first, arc, _, dwell, last = other

        def changed(at, **changes):
            return [replace(step, **changes) if step is at else step for step in other]

        def bent(**changes):
            return changed(arc, arc=replace(arc.arc, **changes))

        for mine, what in (
            (changed(first, to=(10.000002, *first.to[1:])), "end"),
            (changed(first, feed_mm_min=600.001), "feed"),
            (changed(last, feed_mm_min=600.0), "feed"),
            (changed(last, path=()), "path"),
            (changed(dwell, value=0.6), "dwell"),
            (changed(dwell, kind="stop"), "kind"),
            (changed(arc, arc=None), "curve"),
            (bent(sweep_rad=math.pi), "turns"),
            (bent(sweep_rad=-math.pi + 1e-6), "centre"),
            (bent(centre=(15.0, 2e-6, 0.0)), "centre"),
            (bent(normal=(1.0, 0.0, 0.0)), "plane"),
            (other[:-1], "kind"),
        ):
            self.assertEqual(self.whats(mine, other), [what])
        swapped = [first, arc, dwell, other[2], last]
        self.assertEqual(self.whats(swapped, other), ["kind"])

    def test_offsets_and_rotation_lead_to_the_machine(self):
        offsets = steps.Offsets()
        offsets.g92, offsets.g5x, offsets.tool = (1.0, *[0.0] * 8), (0.0, 10.0, *[0.0] * 7), (0.0, 0.0, 5.0, 7.0, *[0.0] * 5)
        offsets.rotation_rad = math.radians(90)
        x, y, z, a, *_ = offsets.machine((2.0, 0.0, 0.0, 3.0, *[0.0] * 5))
        for value, expected in ((x, 0), (y, 13 * 25.4), (z, 5 * 25.4), (a, 10)):
            self.assertAlmostEqual(value, expected)

    def test_the_way_back_from_the_machine(self):
        offsets = steps.Offsets()
        offsets.g92, offsets.g5x, offsets.tool = (1.0, *[0.0] * 8), (0.0, 10.0, *[0.0] * 7), (0.0, 0.0, 5.0, 7.0, *[0.0] * 5)
        offsets.rotation_rad = 0.7
        point = (2.0, -3.0, 4.0, 5.0, *[0.0] * 5)
        for value, expected in zip(offsets.program(offsets.machine(point)), point):
            self.assertAlmostEqual(value, expected)

    def test_an_arc_behind_g92_begins_in_the_new_offsets(self):
        here = [15 / 25.4, *[0.0] * 8]
        # The position is called 0; half a turn round a centre that is where the position was called before.
        calls = [*CALLS[:5], ["set_g92_offset", 2, *here],
                 ["arc_feed", 3, -10 / 25.4, 0.0, -5 / 25.4, 0.0, -1, *[0.0] * 7]]
        calls[4] = ["straight_feed", 2, *here]
        _, arc = steps.of_linuxcnc(calls, "\n".join(ORDER.splitlines()[:8]))
        self.assertAlmostEqual(arc.arc.sweep_rad, -math.pi)
        self.assertLess(math.dist(arc.arc.centre, (10, 0, 0)), 1e-12)

    def test_an_arc_in_a_rotated_system_is_turned(self):
        calls = [*CALLS[:3], ["set_xy_rotation", 1, 90.0], *CALLS[3:6]]
        order = "\n".join(ORDER.splitlines()[:8])
        _, arc = steps.of_linuxcnc(calls, order)
        self.assertLess(math.dist(arc.arc.centre, (0, 15, 0)), 1e-12)
        self.assertAlmostEqual(arc.arc.sweep_rad, -math.pi)

    def test_full_turns_and_more(self):
        for end, rotation, expected in (((2, 0), 1, math.tau), ((2, 0), -2, -2 * math.tau), ((0, 2), -1, -0.75 * math.tau)):
            got = steps.sweep_rad((2, 0), end, (0, 0), XY, rotation)
            self.assertAlmostEqual(got, expected)

    def test_voices_that_do_not_agree_are_noticed(self):
        for calls, order in (
            (CALLS[:5] + CALLS[6:], ORDER),
            (CALLS + [["dwell", 8, 1.0]], ORDER),
            (CALLS[:-2], ORDER),
            ([*CALLS[:6], ["change_tool", 4, 1]], ORDER.replace("PROGRAM_STOP()", "CHANGE_TOOL(1)")),
        ):
            with self.assertRaises(steps.NotComparable):
                steps.of_linuxcnc(calls, order)

    def test_a_probing_move_ends_the_comparison(self):
        probe = {"line": 3, "kind": "probe", "end_mm": [25.4, 0, -25.4], "feed_mm_min": 60.0}
        mine = steps.of_motion([probe, {"line": 4, "kind": "dwell", "dwell_s": 1}])
        calls = [["begin", 0], ["set_feed_rate", 2, 60 / 25.4], ["straight_probe", 3, 1.0, 0.0, -1.0, *[0.0] * 6],
                 ["dwell", 4, 2.0]]
        order = '1 N.. COMMENT("begin")\n2 N.. STRAIGHT_PROBE(25.4, 0, -25.4)\n3 N.. DWELL(2.0)\n'
        other = steps.of_linuxcnc(calls, order)
        self.assertEqual([step.kind for step in mine + other], ["probe", "probe"])
        self.assertEqual(self.whats(mine, other), [])
        self.assertEqual(self.whats([replace(mine[0], to=other[0].to[:2] + (0.0,) * 7)], other), ["end"])

    def test_a_cubic_curve_is_compared_at_its_points(self):
        pieces = steps.pieces_of_curve(4)
        ends = {"from_mm": [0, 0, 0], "to_mm": [3, 0, 0], "controls_mm": [[1, 0], [-1, 0]], "feed_mm_min": 6.0}
        mine = steps.of_motion([{"line": 1, "kind": "cubic", **ends, **BLEND}])
        self.assertIn(pieces, (60, 61))
        for at, point in enumerate(mine[0].through, 1):
            self.assertAlmostEqual(point[0], at / 20)
        # G5.1 from 0, 0 by way of 1.5, 3 to 3, 0: as many points as of three control points.
        ends["controls_mm"] = [[1, 2], [-1, 2]]
        (mine,) = steps.of_motion([{"line": 1, "kind": "cubic", **ends, **BLEND}])
        pieces = steps.pieces_of_curve(3)
        self.assertEqual(len(mine.through), pieces - 1)
        for at, point in enumerate(mine.through, 1):
            u = at / pieces
            self.assertAlmostEqual(point[1], 6 * u * (1 - u))


class Interpreter(unittest.TestCase):
    def test_reasons_lose_their_places_and_numbers(self):
        for refusal, reason in (
            ("motion: a.ngc:2:5: found T12, expected one of", "found T…"),
            ("motion: a.ngc:2:5: found G43.1, expected one of", "found G43.1"),
            ("motion: a.ngc:2:5: found X-.5 without a motion mode, expected", "found X… without a motion mode"),
        ):
            self.assertEqual(interpreter.reason_of(refusal), reason)

    @unittest.skipUnless(reading.installed() and "MOTION" in os.environ, "needs LinuxCNC, and MOTION: the command to compare")
    def test_our_own_programs_are_read_alike(self):
        here = reading.HERE
        command = [sys.executable, here / "interpreter.py", here / "programs", "--motion", os.environ["MOTION"]]
        done = subprocess.run(command, capture_output=True, text=True)
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)

    def test_the_list_of_refused_programs_is_whole(self):
        known = [{"found": "a probe", "reason": "…", "programs": ["a", "b", "c"]}]
        results = [
            {"name": "a", "ours_refused": "a.ngc:1:1: found G38.2, which needs a probe"},
            {"name": "b", "ours_refused": "b.ngc:1:1: found A1"},
            {"name": "c"},
            {"name": "d", "ours_refused": "d.ngc:1:1: found G38.2, which needs a probe"},
            {"name": "e"},
        ]
        faults = [fault.split(": ")[:2] for fault in interpreter.refusals(results, known)]
        self.assertEqual(faults, [
            ["refused for another reason than listed", "b"],
            ["listed as refused, but accepted", "c"],
            ["refused, and not listed", "d"],
        ])

    def test_the_beginning_stands_behind_the_tape_mark(self):
        self.assertEqual(reading.with_beginning("%\nM2\n").splitlines()[::4], ["%", "M2"])
        self.assertTrue(reading.with_beginning("M2\n").startswith("G21\n"))

    def test_tool_tables(self):
        [tool] = tools.read("T3 P1 Z50.8 D25.4 Q2 ; an end mill\n; none\n")
        self.assertEqual((tool.number, tool.pocket, tool.offsets[2], tool.diameter, tool.orientation), (3, 1, 50.8, 25.4, 2))
        self.assertEqual(tools.read(tool.line(25.4))[0], replace(tool, offsets=(0, 0, 2.0, *[0.0] * 6), diameter=1.0))


if __name__ == "__main__":
    unittest.main()
