"""Tool tables in LinuxCNC's format: a tool a line, `T1 P1 Z50 D6 ; remark`; lengths in the machine's units."""

import re
from dataclasses import dataclass

WORD = re.compile(r"([TPDXYZABCUVWIJQ])\s*([-+]?[\d.]+)", re.I)
AXES = "XYZABCUVW"


@dataclass(frozen=True)
class Tool:
    number: int
    pocket: int
    offsets: tuple
    diameter: float = 0.0
    front_deg: float = 0.0
    back_deg: float = 0.0
    orientation: int = 0

    def entry(self):
        """What LinuxCNC's Python module takes for a tool."""
        return (self.number, *self.offsets, self.diameter, self.front_deg, self.back_deg, self.orientation)

    def line(self, unit):
        """The tool's line, in units of `unit` machine units. LinuxCNC takes at most 255 characters."""
        lengths = {axis: value / (1 if axis in "ABC" else unit) for axis, value in zip(AXES, self.offsets)}
        words = lengths | {"D": self.diameter / unit, "I": self.front_deg, "J": self.back_deg, "Q": self.orientation}
        words = " ".join(f"{letter}{value:.9f}" for letter, value in words.items() if value and letter != "Q")
        return f"T{self.number} P{self.pocket} Q{self.orientation} {words}\n"


EMPTY = Tool(-1, 0, (0.0,) * 9)


def read(text):
    """The tools of a table, in its order."""
    table = []
    for line in text.splitlines():
        words = {letter.upper(): float(number) for letter, number in WORD.findall(line.split(";")[0])}
        if "T" in words:
            offsets = tuple(words.get(axis, 0.0) for axis in AXES)
            shape = [words.get(letter, 0.0) for letter in "DIJ"]
            number = int(words["T"])
            table.append(Tool(number, int(words.get("P", number)), offsets, *shape, int(words.get("Q", 0))))
    return table


def alike(count, diameter):
    """The text of a table of tools of no length and one diameter."""
    return "".join(f"T{number} P{number} D{diameter}\n" for number in range(1, count + 1))
