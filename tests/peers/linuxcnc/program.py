"""A program with one path mode from its first line to its last, so that both sides round corners alike."""

import re
from dataclasses import dataclass

INCH_MM = 25.4
COMMENT = re.compile(r"(\([^)]*\)|;.*)")
UNITS = re.compile(r"G\s*0*(20|21)(?![\d.])", re.I)
MODE = re.compile(r"G\s*0*(?:61(?:\.1)?|64)(?![\d.])", re.I)
OTHER_USER_OF_P = re.compile(r"G\s*0*(?:4|5|5\.[123]|10|33|73|76|8[1-9])(?![\d.])", re.I)
TOLERANCE = re.compile(r"[PQ]\s*([-+]?[\d.]+)", re.I)
TOLERANCE_COMPUTED = re.compile(r"[PQ]\s*[-+]?[#\[]", re.I)


class NotRewritten(Exception):
    """The program sets its path mode in a way that is not rewritten."""


@dataclass(frozen=True)
class PathMode:
    """G64 with its tolerances. `merge_mm` is Q; without one, each side does what it does without a Q."""

    tolerance_mm: float
    merge_mm: float | None

    def words(self, inches):
        unit_mm = INCH_MM if inches else 1.0
        # Nine decimals are exact in inches too.
        words = f"G64 P{self.tolerance_mm / unit_mm:.9f}"
        return words if self.merge_mm is None else f"{words} Q{self.merge_mm / unit_mm:.9f}"


def rewritten(text, mode):
    """`text` with `mode` at its start and in place of every G61, G61.1 and G64."""
    inches = False
    result = []
    for line in text.splitlines():
        # Comments stand at odd places.
        parts = COMMENT.split(line)
        code = " ".join(parts[0::2])
        for word in UNITS.finditer(code):
            inches = word.group(1) == "20"
        if MODE.search(code):
            if OTHER_USER_OF_P.search(code) or TOLERANCE_COMPUTED.search(code):
                raise NotRewritten(f"path mode in {line.strip()!r}")
            # Units of a line hold for its path mode, wherever they stand in it.
            words = mode.words(inches)
            for at in range(0, len(parts), 2):
                parts[at] = MODE.sub(f" {words} ", TOLERANCE.sub(" ", parts[at]))
        result.append("".join(parts))
    first = 1 if result and result[0].strip() == "%" else 0
    result.insert(first, "G21 " + mode.words(inches=False))
    return "\n".join(result) + "\n"
