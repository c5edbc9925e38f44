"""Random programs over the dialect that both readers know: moves, arcs, planes, offsets, rotation, tool lengths, cycles, units,
subroutines and loops. A seed makes the same program every time.

Pairs of features of which LinuxCNC's interpreter is known to make something else (the list in `host/src/gcode/mod.rs`) are
in no program together."""

import math
import random

HEADER = "G21 G17 G90 G94 G61 G40 G49 G80 G98 G91.1 G8 F300"
TOOLS = "".join(f"T{number} P{number} X{number % 3} Z{5 * number} D2\n" for number in range(1, 10))
AXES = {"G17": "XYZ", "G18": "ZXY", "G19": "YZX"}
OFFSETS = {"X": "I", "Y": "J", "Z": "K"}
FEATURES = ("arcs", "planes", "systems", "rotation", "shifts", "tools", "cycles", "units", "flow", "feeds", "places", "polar",
            "modes", "diameter", "rotary", "beside")
APART = (("rotation", "shifts"), ("units", "tools"), ("units", "cycles"), ("modes", "tools"), ("modes", "units"),
         # Of U, V and W one voice of LinuxCNC knows nothing, and the other does not tell the units.
         ("units", "beside"))
# Such programs are compared without path modes and outputs, so they are few.
BESIDE_SHARE = 0.2


class Program:
    def __init__(self, seed):
        self.random = random.Random(seed)
        wanted = self.random.sample(FEATURES, self.random.randint(3, len(FEATURES)))
        for one, other in APART:
            if one in wanted and other in wanted:
                wanted.remove(self.random.choice((one, other)))
        if "beside" in wanted and self.random.random() > BESIDE_SHARE:
            wanted.remove("beside")
        self.features = sorted(wanted)
        self.plane, self.unit = "G17", 1.0
        self.others = ("ABC" if "rotary" in wanted else "") + ("UVW" if "beside" in wanted else "")
        self.label = 0
        self.lines = [HEADER, "#1=0 #2=0.5 #<a>=3"]
        if "rotation" in wanted:
            # Before the system is in force: then its zero does not turn under the machine.
            self.lines += [f"G10 L2 P{system} X{self.number(20)} Y{self.number(20)} R{self.random.choice((90, 30, -45.5))}"
                           for system in (1, 2)] + ["G55", "G54"]
        if "flow" in wanted:
            self.lines += ["o<step> sub", "G91 G0 X[#1*#2] Y-#3", "G90", "o<step> endsub [#1+1]"]
        self.block(self.random.randint(15, 45), depth=0)
        self.lines.append("M2")

    def text(self):
        return "\n".join(self.lines) + "\n"

    def number(self, most):
        """A length in the units in force."""
        value = round(self.random.uniform(-most, most) / self.unit, self.random.choice((0, 1, 3, 4)))
        return f"{value:g}"

    def word(self, letter, most=40):
        value = self.number(most)
        if self.random.random() < 0.1:
            value = self.random.choice((f"[{value}+#2]", f"[#<a>*{value}]", f"[sin[30]*{value}]", "#<a>"))
        return letter + value

    def axes(self, most=40):
        letters = [letter for letter in "XYZ" if self.random.random() < 0.6] or ["X"]
        letters += [letter for letter in self.others if self.random.random() < 0.3]
        return " ".join(self.word(letter, most) for letter in letters)

    def block(self, count, depth):
        kinds = ["move", "move", "move", *(name for name in self.features if name not in ("rotation",))]
        for _ in range(count):
            kind = self.random.choice(kinds)
            if depth and kind in ("units", "planes", "diameter"):
                kind = "move"
            getattr(self, kind)(*([depth] if kind == "flow" else []))

    def say(self, *lines):
        self.lines += lines

    def move(self):
        choice = self.random.random()
        if choice < 0.3:
            self.say(f"G0 {self.axes()}")
        elif choice < 0.8:
            self.say(f"G1 {self.axes()}")
        elif choice < 0.9:
            self.say("G91", f"G{self.random.randint(0, 1)} {self.axes(9)}", "G90")
        else:
            self.say(self.random.choice(("G4 P0.25", "G61", "G61.1", "G64 P0.05", "M0")))

    def arcs(self):
        """Relative, so that the start does not matter."""
        first, second, normal = AXES[self.plane]
        i, j = self.random.uniform(1, 20) / self.unit, self.random.uniform(-20, 20) / self.unit
        turn = self.random.uniform(-math.pi, math.pi)
        end = [i - i * math.cos(turn) + j * math.sin(turn), j - i * math.sin(turn) - j * math.cos(turn)]
        code = f"G{self.random.choice((2, 3))}"
        height = f" {normal}{self.number(5)}" if self.random.random() < 0.3 else ""
        turns = f" P{self.random.randint(1, 3)}" if self.random.random() < 0.2 else ""
        centre = f"{OFFSETS[first]}{i:.5f} {OFFSETS[second]}{j:.5f}"
        if "diameter" in self.features:
            # X is a diameter, I is not.
            self.say("G8")
        chord, radius = math.hypot(*end), math.hypot(i, j)
        if self.random.random() < 0.2:
            self.say("G91", f"{code} {centre}{height}{turns}", "G90")
        elif self.random.random() < 0.3 and 1 / self.unit < chord < 1.9 * radius:
            sign = self.random.choice(("", "-"))
            self.say("G91", f"{code} {first}{end[0]:.5f} {second}{end[1]:.5f} R{sign}{radius:.5f}{height}", "G90")
        else:
            self.say("G91", f"{code} {first}{end[0]:.5f} {second}{end[1]:.5f} {centre}{height}{turns}", "G90")
        self.say(f"G1 {self.axes()}")

    def rotary(self):
        """A move of rotary axes alone, and an arc that takes one along."""
        self.say(f"G1 {self.word(self.random.choice('ABC'), 400)}")
        if self.plane == "G17":
            self.say("G91", f"G2 X2 I1 J0 {self.word('A', 90)}", "G90")

    def beside(self):
        self.say(f"G{self.random.randint(0, 1)} {self.word(self.random.choice('UVW'))}")

    def planes(self):
        self.plane = self.random.choice(tuple(AXES))
        self.say(self.plane)

    def systems(self):
        system = self.random.randint(1, 9)
        word = f"G{53 + system}" if system <= 6 else f"G59.{system - 6}"
        self.say(self.random.choice((word, f"G10 L20 P0 {self.axes(9)}", f"G10 L2 P{self.random.randint(3, 9)} {self.axes(20)}",
                                     f"{word} G0 {self.axes()}")))

    def shifts(self):
        self.say(self.random.choice((f"G92 {self.axes(9)}", f"G52 {self.axes(9)}", "G92.1", "G92.2", "G92.3")))

    def tools(self):
        number = self.random.randint(1, 9)
        self.say(self.random.choice((f"G43 H{number}", f"G43.1 Z{self.number(9)}", f"G43.2 H{number}", "G49",
                                     f"G10 L1 P{number} Z{self.number(9)} R3", f"G43 H{number} G0 {self.axes()}")))

    def cycles(self):
        first, second, normal = AXES[self.plane]
        code = self.random.choice(("G73 Q1.3", "G81", "G82 P0.1", "G83 Q0.7", "G85", "G89 P0.2"))
        ends = f"{normal}{self.random.uniform(-9, -1):.3f} R{self.random.uniform(1, 5):.3f}"
        point = f"{first}{self.number(20)} {second}{self.number(20)}"
        retract = self.random.choice(("G98", "G99"))
        if self.random.random() < 0.4:
            self.say("G91", f"{retract} {code} {point} {ends} L{self.random.randint(1, 3)}", "G90 G80")
        else:
            self.say(f"G0 {normal}9", f"{retract} {code} {point} {ends}", f"{first}{self.number(20)}", "G80")
        self.say(f"G0 {self.axes()}")

    def units(self):
        code, self.unit = self.random.choice((("G20", 25.4), ("G21", 1.0)))
        self.say(code, f"F{300 / self.unit:.4f}")

    def flow(self, depth):
        self.label += 1
        label = f"o{self.label}"
        choice = self.random.randint(0, 3) if depth < 2 else 3
        if choice == 0:
            self.say(f"{label} repeat [{self.random.randint(0, 3)}]")
            self.block(3, depth + 1)
            self.say(f"{label} endrepeat")
        elif choice == 1:
            counter = f"#{100 + self.label}"
            self.say(f"{counter}={self.random.randint(1, 3)}", f"{label} while [{counter} gt 0]", f"{counter}=[{counter}-1]")
            self.block(2, depth + 1)
            self.say(f"{label} endwhile")
        elif choice == 2:
            self.say(f"{label} if [#5420 {self.random.choice(('gt', 'le'))} {self.number(20)}]")
            self.block(2, depth + 1)
            self.say(f"{label} else")
            self.block(2, depth + 1)
            self.say(f"{label} endif")
        else:
            self.say(f"o<step> call [{self.number(3)}] [{self.number(3)}] [2]", f"G0 {self.random.choice('XYZ')}#<_value>")

    def feeds(self):
        # A feed of less than 0.1 would be raised by LinuxCNC.
        self.say(*self.random.choice((("G93 G91", f"G1 X{self.random.uniform(5, 9) / self.unit:.4f} F2.5", "G90 G94", f"F{200 / self.unit:.3f}"),
                                      (f"F{self.random.uniform(50, 900) / self.unit:.3f}",))))

    def places(self):
        self.say(self.random.choice(("G28.1", "G30.1", "G28", f"G30 {self.axes()}", f"G53 G0 {self.axes()}",
                                     f"G28 {self.axes()}")))

    def polar(self):
        self.say("G17", f"G0 @{self.random.uniform(1, 20) / self.unit:.3f} ^{self.random.randint(-180, 180)}", self.plane)

    def modes(self):
        self.say("M70", "G91 G64 P0.1", f"G1 {self.axes(5)}", "M72", f"G1 {self.axes()}")

    def diameter(self):
        self.say("G7", f"G0 {self.axes()}", "G8")


def write(folder, count, seed):
    """`count` programs, each with a table of its tools."""
    for index in range(count):
        path = folder / f"{seed + index}.ngc"
        path.write_text(Program(seed + index).text())
        path.with_suffix(".tbl").write_text(TOOLS)
