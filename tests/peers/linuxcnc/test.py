"""`python3 -m unittest test` in this folder. Needs no LinuxCNC."""

import math
import random
import unittest

import machine
import ours
import peer
import recording
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


if __name__ == "__main__":
    unittest.main()
