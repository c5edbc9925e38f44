"""What a program makes a machine do, in one form for both readers: moves to machine coordinates [mm and °], dwells, stops.

`of_linuxcnc` makes steps of the canonical calls (`calls.py`), `of_motion` of what `motion read --json` prints."""

import math
import re
from dataclasses import dataclass, replace

INCH_MM = 25.4
# Indices of first axis, second axis and normal.
PLANES = {1: (0, 1, 2), 2: (1, 2, 0), 3: (2, 0, 1), "XY": (0, 1, 2), "YZ": (1, 2, 0), "ZX": (2, 0, 1)}
ROTARY = (3, 4, 5)
NOWHERE = (0.0,) * 9
# A move to where the machine is; below every difference that is looked for.
NO_LENGTH_MM = 1e-7
# LinuxCNC takes arcs of less for full turns.
LEAST_ARC_RAD = 1e-12
# Pieces in which LinuxCNC's Python module makes lines of a cubic curve.
PIECES_OF_CUBIC = 60

MOVES = {"STRAIGHT_TRAVERSE": "straight_traverse", "STRAIGHT_FEED": "straight_feed", "ARC_FEED": "arc_feed",
         "STRAIGHT_PROBE": "straight_probe", "RIGID_TAP": "rigid_tap", "DWELL": "dwell", "CHANGE_TOOL": "change_tool"}
# Kinds of steps that calls in full doubles make.
CALLED = ("move", "probe", "tap", "dwell", "tool")
# Calls that come in the order of `rs274` alone, by kind.
OUTPUTS = {
    "orient": "ORIENT_SPINDLE",
    "output": "SET_MOTION_OUTPUT_BIT CLEAR_MOTION_OUTPUT_BIT SET_AUX_OUTPUT_BIT CLEAR_AUX_OUTPUT_BIT "
    "SET_MOTION_OUTPUT_VALUE SET_AUX_OUTPUT_VALUE",
    "override": "ENABLE_FEED_OVERRIDE DISABLE_FEED_OVERRIDE ENABLE_SPEED_OVERRIDE DISABLE_SPEED_OVERRIDE "
    "ENABLE_ADAPTIVE_FEED DISABLE_ADAPTIVE_FEED ENABLE_FEED_HOLD DISABLE_FEED_HOLD",
    "stop": "PROGRAM_STOP OPTIONAL_PROGRAM_STOP",
}
KINDS = {name: kind for kind, names in OUTPUTS.items() for name in names.split()}
# Calls that switch spindle or coolant: what of `Outputs` they set, and to what; none: to their argument.
SWITCHES = {"START_SPINDLE_CLOCKWISE": ("spindle", "clockwise"), "MIST_ON": ("mist", True), "MIST_OFF": ("mist", False),
            "START_SPINDLE_COUNTERCLOCKWISE": ("spindle", "counterclockwise"), "STOP_SPINDLE_TURNING": ("spindle", None),
            "FLOOD_ON": ("flood", True), "FLOOD_OFF": ("flood", False), "SET_SPINDLE_SPEED": ("speed", None)}
# A number that counts, a line number of the program, the call.
ORDERED = re.compile(r"\s*\d+ (?:N[\d.]*\s+)?([A-Z][A-Z0-9_.]*)\((.*)\)\s*")


def only_rotary(start, end):
    moved = [at for at in range(9) if abs(end[at] - start[at]) > NO_LENGTH_MM]
    return bool(moved) and all(at in ROTARY for at in moved)


class NotComparable(Exception):
    """LinuxCNC's two voices do not agree, or say too little; says why."""


@dataclass(frozen=True)
class Arc:
    """`centre` stands at the height of the end. `sweep_rad` is counter-clockwise positive, seen from the normal's end."""

    centre: tuple
    normal: tuple
    sweep_rad: float


@dataclass(frozen=True)
class Step:
    kind: str
    line: int
    to: tuple | None = None
    # None: rapid.
    feed_mm_min: float | None = None
    # (tolerance, tolerance for merging) [mm] of G64; () of G61; None: not programmed.
    path: tuple | None = None
    arc: Arc | None = None
    # Points between start and end, at equal parts of the parameter.
    through: tuple = ()
    value: float | str | None = None


@dataclass(frozen=True)
class Outputs:
    """What spindle and coolant do; without turning a spindle has no speed."""

    spindle: str | None = None
    speed: float = 0.0
    # G96: `speed` is one of the surface.
    surface: bool = False
    mist: bool = False
    flood: bool = False

    def shown(self):
        return self if self.spindle else replace(self, speed=0.0, surface=False)


def rotated(x, y, angle_rad):
    return x * math.cos(angle_rad) - y * math.sin(angle_rad), x * math.sin(angle_rad) + y * math.cos(angle_rad)


class Offsets:
    """The offsets in force [inch and °]; `machine` is where a point of the program is on the machine [mm and °]."""

    def __init__(self):
        self.g5x = self.g92 = self.tool = NOWHERE
        self.rotation_rad = 0.0

    def machine(self, point):
        point = [a + b for a, b in zip(point, self.g92)]
        point[0], point[1] = rotated(point[0], point[1], self.rotation_rad)
        inches = [a + b + c for a, b, c in zip(point, self.g5x, self.tool)]
        return tuple(value * (1 if at in ROTARY else INCH_MM) for at, value in enumerate(inches))

    def program(self, position):
        """The point of the program at a position of the machine."""
        inches = [value / (1 if at in ROTARY else INCH_MM) for at, value in enumerate(position)]
        point = [a - b - c for a, b, c in zip(inches, self.g5x, self.tool)]
        point[0], point[1] = rotated(point[0], point[1], -self.rotation_rad)
        return tuple(a - b for a, b in zip(point, self.g92))


def sweep_rad(start, end, centre, plane, rotation):
    """The angle of an arc in the plane of the program. `rotation`: ±1 is up to one turn, ±2 one turn more."""
    first, second, _ = plane
    begin = math.atan2(start[second] - centre[second], start[first] - centre[first])
    angle = math.atan2(end[second] - centre[second], end[first] - centre[first]) - begin
    if rotation < 0 and angle + LEAST_ARC_RAD >= 0:
        angle -= math.tau
    if rotation > 0 and angle - LEAST_ARC_RAD <= 0:
        angle += math.tau
    return angle + math.tau * (rotation - math.copysign(1, rotation))


def ordered(text):
    """(name, arguments) of the calls that `rs274` prints, from the comment `begin` on. Their lengths have four decimals."""
    calls, begun = [], False
    for line in text.splitlines():
        found = ORDERED.fullmatch(line)
        if found and found.groups() == ("COMMENT", '"begin"'):
            begun = True
        elif found and begun:
            calls.append(found.groups())
    return calls


class Merging:
    """Both voices of LinuxCNC: the calls in full doubles, and all calls in their order."""

    def __init__(self, calls):
        self.calls = calls
        self.at = 0
        self.steps = []
        self.offsets = Offsets()
        self.plane = PLANES[1]
        # In a minute; after G95, in a revolution.
        self.feed_mm = None
        self.per_revolution, self.speed_rev_min = False, 0.0
        # What calls have made of spindle and coolant, and what the last step did.
        self.outputs = self.switched = Outputs()
        self.path = None
        # What is executed before a program says G21.
        self.unit_mm = 1.0
        self.point = NOWHERE
        self.position = NOWHERE
        # The Python module does not know where an arc ends, nor what new units or offsets make of its position.
        self.is_position_known = True

    def move(self, call, kind="move", **more):
        _, line, *arguments = call
        point = tuple(arguments)
        feed_mm_min = None if call[0] == "straight_traverse" or self.feed_mm is None else self.feed_mm
        if feed_mm_min is not None and self.per_revolution:
            feed_mm_min *= self.speed_rev_min
        position = self.offsets.machine(point)
        if feed_mm_min is not None and only_rotary(self.position, position):
            # Degrees are degrees in inches, too.
            feed_mm_min /= self.unit_mm
        self.position = position
        self.point = point
        self.steps.append(Step(kind, line, self.position, feed_mm_min, self.path, **more))

    def straight_traverse(self, call):
        self.move(call)
        self.is_position_known = True

    straight_feed = straight_traverse

    def straight_probe(self, call):
        self.move(call, "probe")
        # It stops before and behind it, whatever the path mode.
        self.steps[-1] = replace(self.steps[-1], path=None)

    def rigid_tap(self, call):
        name, line, *xyz = call
        self.move([name, line, *xyz, *self.point[3:]], "tap")

    def arc_feed(self, call):
        name, line, first_end, second_end, first_centre, second_centre, rotation, height, *others = call
        first, second, normal = self.plane
        end, centre, direction = [0.0] * 3, [0.0] * 3, [0.0] * 3
        end[first], end[second], end[normal] = first_end, second_end, height
        centre[first], centre[second], centre[normal] = first_centre, second_centre, height
        direction[normal] = 1.0
        direction[:2] = rotated(*direction[:2], self.offsets.rotation_rad)
        # Offsets may have changed since the move before.
        angle_rad = sweep_rad(self.offsets.program(self.position), end, centre, self.plane, rotation)
        on_machine = self.offsets.machine((*centre, *others))[:3]
        self.move([name, line, *end, *others], arc=Arc(on_machine, tuple(direction), angle_rad))
        self.is_position_known = False

    def dwell(self, call):
        self.steps.append(Step("dwell", call[1], value=call[2]))

    def change_tool(self, call):
        if not self.is_position_known:
            raise NotComparable("a tool change where LinuxCNC's Python module does not know the position")
        self.steps.append(Step("tool", call[1], value=call[2]))

    def set_feed_rate(self, call):
        self.feed_mm = call[2] * INCH_MM

    def set_plane(self, call):
        self.plane = PLANES[call[2]]

    def set_g5x_offset(self, call):
        self.moved(g5x=tuple(call[3:]))

    def set_g92_offset(self, call):
        self.moved(g92=tuple(call[2:]))

    def set_xy_rotation(self, call):
        self.moved(rotation_rad=math.radians(call[2]))

    def tool_offset(self, call):
        self.moved(tool=tuple(call[2:]))

    def moved(self, **offsets):
        """The offsets change, the machine stays where it is."""
        for name, value in offsets.items():
            if getattr(self.offsets, name) != value:
                setattr(self.offsets, name, value)
                self.is_position_known = False

    def begin(self, call):
        """Everything before was the beginning that all programs are given."""
        self.steps = []
        self.path, self.feed_mm = None, None
        self.is_position_known = True

    def user_defined(self, call):
        raise NotComparable(f"M{100 + call[2]} is a program of the user's")

    def until(self, wanted):
        """Takes calls up to and with the next one that is a step."""
        while self.at < len(self.calls):
            call = self.calls[self.at]
            self.at += 1
            if call[0] in MOVES.values() and call[0] != wanted:
                raise NotComparable(f"line {call[1]}: {call[0]} in full doubles, {wanted} in order")
            getattr(self, call[0])(call)
            if call[0] == wanted:
                return
        raise NotComparable(f"no {wanted} in full doubles")

    def curve(self, count):
        """A curve of `count` control points, which the Python module makes lines of."""
        if not self.is_position_known:
            raise NotComparable("a curve where LinuxCNC's Python module does not know the height")
        first = len(self.steps)
        for _ in range(pieces_of_curve(count)):
            self.until("straight_feed")
        *points, last = self.steps[first:]
        del self.steps[first:]
        self.steps.append(Step("move", last.line, last.to, last.feed_mm_min, last.path,
                               through=tuple(point.to for point in points)))

    def switch(self):
        """A step, if spindle or coolant are to do something else than before."""
        to = self.outputs.shown()
        if to != self.switched:
            line = self.calls[min(self.at, len(self.calls) - 1)][1]
            self.steps.append(Step("switch", line, value=to))
            self.switched = to

    def all_off(self):
        """A `%` may end a file without M2, for LinuxCNC with the spindle on; this project's reader ends it as with M2."""
        for off in ({"spindle": None}, {"mist": False}, {"flood": False}):
            self.outputs = replace(self.outputs, **off)
            self.switch()

    def in_order(self, name, arguments):
        if name == "SET_SPINDLE_MODE":
            # G96 or G97: with the speed that follows it is one change.
            self.outputs = replace(self.outputs, surface=float(arguments.split()[1]) > 0)
        elif name in SWITCHES:
            what, value = SWITCHES[name]
            if what == "speed":
                value = self.speed_rev_min = float(arguments.split(",")[1])
            self.outputs = replace(self.outputs, **{what: value})
            self.switch()
        else:
            if name in MOVES or name in KINDS:
                self.switch()
            self.other_in_order(name, arguments)

    def other_in_order(self, name, arguments):
        if name in MOVES:
            self.until(MOVES[name])
        elif name == "NURBS_FEED":
            self.curve(int(arguments.split(",")[0]))
        elif name == "USE_LENGTH_UNITS":
            unit_mm = 1.0 if arguments == "CANON_UNITS_MM" else INCH_MM
            self.is_position_known &= unit_mm == self.unit_mm or self.point == NOWHERE
            self.unit_mm = unit_mm
        elif name == "SET_MOTION_CONTROL_MODE":
            mode, *tolerance = arguments.split(", ")
            self.path = (float(tolerance[0]) * self.unit_mm, 0.0) if mode == "CANON_CONTINUOUS" else ()
        elif name == "SET_NAIVECAM_TOLERANCE" and self.path:
            self.path = (self.path[0], float(arguments) * self.unit_mm)
        elif name == "SET_FEED_MODE":
            self.per_revolution = arguments.split(",")[1].strip() == "1"
        elif name in KINDS:
            line = self.calls[min(self.at, len(self.calls) - 1)][1]
            value = None if KINDS[name] == "stop" else f"{name}({arguments})"
            self.steps.append(Step(KINDS[name], line, value=value))


def pieces_of_curve(count):
    """As many as LinuxCNC's own loop makes: rounding decides whether there is a last short one."""
    part, u, pieces = 1.0 / (15 * count), 0.0, 1
    while u + part < 1.0:
        u, pieces = u + part, pieces + 1
    return pieces


def of_linuxcnc(calls, order):
    """Steps of the calls that `calls.py` prints and of the text that `rs274` prints, up to the first probing move: where it trips
    and rests neither voice knows."""
    merging = Merging(calls)
    while merging.at < len(calls) and calls[merging.at][0] != "begin":
        getattr(merging, calls[merging.at][0])(calls[merging.at])
        merging.at += 1
    merging.begin(None)
    merging.at += 1
    for name, arguments in ordered(order):
        if name in ("PROGRAM_END", "FINISH"):
            break
        merging.in_order(name, arguments)
        if merging.steps and merging.steps[-1].kind == "probe":
            return with_length(merging.steps)
    merging.all_off()
    rest = [call[0] for call in calls[merging.at :] if call[0] in MOVES.values()]
    if rest:
        raise NotComparable(f"{len(rest)} calls in full doubles after the end")
    return with_length(merging.steps)


def of_calls(calls):
    """Steps of the calls in full doubles alone: moves without their path mode, dwells and tools."""
    merging = Merging(calls)
    for call in calls:
        getattr(merging, call[0])(call)
        if merging.steps and merging.steps[-1].kind == "probe":
            break
    return with_length(merging.steps)


def as_of_calls(steps):
    """Steps with no more than `of_calls` knows."""
    return [replace(step, path=None) for step in steps if step.kind in CALLED]


def with_length(steps):
    """Without moves to where the machine is, but with full turns, and without changes to the tool that there is."""
    position, tool, kept = NOWHERE, 0, []
    for step in steps:
        is_straight = step.kind == "move" and not step.arc and not step.through
        if is_straight and math.dist(step.to, position) < NO_LENGTH_MM or step.kind == "tool" and step.value == tool:
            continue
        kept.append(step)
        position = step.to or position
        tool = step.value if step.kind == "tool" else tool
    return kept


def nine(point):
    return (*point, *(0.0,) * (9 - len(point)))


def of_motion(objects):
    """Steps of the objects that `motion read --json` prints, up to the first probing move."""
    steps = []
    for found in objects:
        kind, line = found["kind"], found["line"]
        if kind in ("line", "arc", "cubic", "through"):
            to = nine(found["to_mm"])
            tolerance_mm, merging_mm = found["tolerance_mm"] or 0.0, found["merging_mm"]
            # LinuxCNC takes P for a Q that is not there.
            path = (tolerance_mm, tolerance_mm if merging_mm is None else merging_mm) if found["path"] == "blend" else ()
            curve = {"arc": arc_of_motion, "cubic": cubic_of_motion}.get(kind, lambda found: {})(found)
            steps.append(Step("through" if kind == "through" else "move", line, to, found["feed_mm_min"], path, **curve))
        elif kind == "probe":
            steps.append(Step("probe", line, nine(found["end_mm"]), found["feed_mm_min"]))
            break
        elif kind == "dwell":
            steps.append(Step("dwell", line, value=found["dwell_s"]))
        elif kind == "tool":
            steps.append(Step("tool", line, value=found["tool"]))
        elif kind == "switch":
            # `rs274` prints speeds with four decimals.
            speed = round(found["speed"], 4)
            to = Outputs(found["spindle"], speed, found["surface"], found["mist"], found["flood"])
            steps.append(Step("switch", line, value=to))
        elif kind not in ("end", "notice", "message"):
            steps.append(Step(kind, line, value=found.get("value")))
    return with_length(steps)


def arc_of_motion(found):
    first, second, normal = PLANES[found["plane"]]
    centre, direction = [0.0] * 3, [0.0] * 3
    centre[first], centre[second] = found["centre_mm"]
    turn_rad = math.radians(found["turn_deg"])
    end = [*rotated(*found["to_mm"][:2], -turn_rad), found["to_mm"][2]]
    centre[normal], direction[normal] = end[normal], 1.0
    for vector in (centre, direction):
        vector[:2] = rotated(*vector[:2], turn_rad)
    return {"arc": Arc(tuple(centre), tuple(direction), found["sweep_rad"])}


def is_quadratic(controls):
    """Whether a cubic curve is one of G5.1, which has three control points in LinuxCNC: it has no third difference, but a second."""
    of_axes = [[control[axis] for control in controls] for axis in (0, 1)]
    third = max(abs(d - 3 * c + 3 * b - a) for a, b, c, d in of_axes)
    second = max(abs(c - 2 * b + a) for a, b, c, _ in of_axes)
    return third < 1e-9 < second


def cubic_of_motion(found):
    """Points of a cubic curve in XY where LinuxCNC's Python module has them."""
    start, end = found["from_mm"], nine(found["to_mm"])
    (i, j), (p, q) = found["controls_mm"]
    controls = [start[:2], (start[0] + i, start[1] + j), (end[0] + p, end[1] + q), end[:2]]
    through = []
    pieces = pieces_of_curve(3) if is_quadratic(controls) else PIECES_OF_CUBIC
    for at in range(1, pieces):
        u = at / pieces
        weights = ((1 - u) ** 3, 3 * u * (1 - u) ** 2, 3 * u * u * (1 - u), u**3)
        x, y = (sum(weight * control[axis] for weight, control in zip(weights, controls)) for axis in (0, 1))
        through.append((x, y, *end[2:]))
    return {"through": tuple(through)}
