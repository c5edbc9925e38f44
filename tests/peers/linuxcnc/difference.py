"""Differences between the steps that two readers make of a program."""

import math
from dataclasses import dataclass

END_MM = 1e-6
FEED_SHARE = 1e-9
DWELL_S = 1e-9
# LinuxCNC's `rs274` prints tolerances with four to six decimals of an inch or a millimetre.
TOLERANCE_MM = 2e-3


@dataclass(frozen=True)
class Difference:
    line: int
    # kind, end, centre, turns, curve, feed, path, dwell, value.
    what: str
    ours: object
    theirs: object

    def __str__(self):
        return f"line {self.line}: {self.what}: ours {self.ours}, LinuxCNC {self.theirs}"


@dataclass
class Figures:
    """How much was compared, and how far apart it was at most."""

    moves: int = 0
    others: int = 0
    end_mm: float = 0.0
    curve_mm: float = 0.0
    feed_share: float = 0.0

    def add(self, other):
        self.moves += other.moves
        self.others += other.others
        self.end_mm = max(self.end_mm, other.end_mm)
        self.curve_mm = max(self.curve_mm, other.curve_mm)
        self.feed_share = max(self.feed_share, other.feed_share)


def compared(ours, theirs):
    """(differences, figures). Nothing is looked at after steps of two kinds: what follows is shifted."""
    differences, figures = [], Figures()
    start = (0.0,) * 9
    for mine, other in zip(ours, theirs):
        if mine.kind != other.kind:
            differences.append(Difference(other.line, "kind", shown(mine), shown(other)))
            return differences, figures
        found = of_move(mine, other, start, figures) if mine.to else of_others(mine, other, figures)
        differences += [Difference(other.line, *entry) for entry in found]
        start = other.to or start
    if len(ours) != len(theirs):
        longer, at = (ours, "ours") if len(ours) > len(theirs) else (theirs, "theirs")
        first = longer[min(len(ours), len(theirs))]
        one, two = (shown(first), "nothing") if at == "ours" else ("nothing", shown(first))
        differences.append(Difference(first.line, "kind", one, two))
    return differences, figures


def shown(step):
    where = "" if step.to is None else " to " + " ".join(f"{value:.6f}" for value in step.to[:3])
    return f"{step.kind} of line {step.line}{where}" + ("" if step.value is None else f" {step.value}")


def of_others(mine, other, figures):
    figures.others += 1
    if mine.kind == "dwell":
        if abs(mine.value - other.value) > DWELL_S:
            yield "dwell", mine.value, other.value
    elif mine.value != other.value:
        yield "value", mine.value, other.value


def of_move(mine, other, start, figures):
    figures.moves += 1
    apart_mm = math.dist(mine.to, other.to)
    if not apart_mm <= END_MM:
        yield "end", mine.to, other.to
    else:
        figures.end_mm = max(figures.end_mm, apart_mm)
    yield from of_curve(mine, other, start, figures)
    if (mine.feed_mm_min is None) != (other.feed_mm_min is None):
        yield "feed", mine.feed_mm_min or "rapid", other.feed_mm_min or "rapid"
    elif mine.feed_mm_min is not None:
        share = abs(mine.feed_mm_min - other.feed_mm_min) / max(mine.feed_mm_min, other.feed_mm_min)
        if not share <= FEED_SHARE:
            yield "feed", mine.feed_mm_min, other.feed_mm_min
        else:
            figures.feed_share = max(figures.feed_share, share)
    # Before a program says how corners are passed, each side has its own choice.
    if other.path is not None and not same_path(mine.path, other.path):
        yield "path", mine.path, other.path


def same_path(mine, other):
    return len(mine) == len(other) and all(abs(a - b) <= TOLERANCE_MM for a, b in zip(mine, other))


def of_curve(mine, other, start, figures):
    if (mine.arc is None, len(mine.through)) != (other.arc is None, len(other.through)):
        yield "curve", curve_name(mine), curve_name(other)
    elif mine.arc:
        yield from of_arc(mine, other, start, figures)
    elif mine.through:
        apart_mm = max(map(math.dist, mine.through, other.through))
        figures.curve_mm = max(figures.curve_mm, apart_mm)
        if not apart_mm <= END_MM:
            yield "curve", f"{apart_mm:.9f} mm apart", ""


def curve_name(step):
    return "arc" if step.arc else f"{len(step.through)} points" if step.through else "straight"


def of_arc(mine, other, start, figures):
    """Where both arcs are half way tells a wrong centre and a wrong angle in the unit of an end point."""
    if math.dist(mine.arc.normal, other.arc.normal) > 1e-9:
        yield "plane", mine.arc.normal, other.arc.normal
        return
    if abs(mine.arc.sweep_rad - other.arc.sweep_rad) > math.pi:
        yield "turns", f"{mine.arc.sweep_rad:.9f} rad", f"{other.arc.sweep_rad:.9f} rad"
        return
    apart_mm = max(math.dist(half_way(start, mine.arc), half_way(start, other.arc)),
                   math.dist(mine.arc.centre, other.arc.centre))
    figures.curve_mm = max(figures.curve_mm, apart_mm)
    if not apart_mm <= END_MM:
        yield "centre", (mine.arc.centre, mine.arc.sweep_rad), (other.arc.centre, other.arc.sweep_rad)


def half_way(start, arc):
    """The start turned about the centre by half the angle; at the height of the centre."""
    x, y, z = arc.normal
    radius = [a - b for a, b in zip(start, arc.centre)]
    height = sum(a * b for a, b in zip(radius, arc.normal))
    u, v, w = (a - height * b for a, b in zip(radius, arc.normal))
    cosine, sine = math.cos(arc.sweep_rad / 2), math.sin(arc.sweep_rad / 2)
    turned = (cosine * u + sine * (y * w - z * v), cosine * v + sine * (z * u - x * w), cosine * w + sine * (x * v - y * u))
    return tuple(a + b for a, b in zip(arc.centre, turned))
