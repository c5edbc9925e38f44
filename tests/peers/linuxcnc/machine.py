"""The machine of both sides. Its limits hold for each axis alone: what bounds the path as a vector is raised by √3."""

import math
import re
from dataclasses import dataclass

AXES = "XYZ"
TRAVEL_MM = 1e6
# Far beyond what three axes reach together.
VECTOR_MM_S, VECTOR_MM_S2 = 1e5, 1e6


@dataclass(frozen=True)
class Machine:
    feed_mm_s: float
    accel_mm_s2: float
    jerk_mm_s3: float

    @property
    def snap_mm_s4(self):
        """As many times jerk² / acceleration as in the reference machine, which has 500, 5000 and 400000."""
        return 8 * self.jerk_mm_s3**2 / self.accel_mm_s2


MACHINES = {
    "reference": Machine(300.0, 500.0, 5000.0),
    # Full acceleration after 5 ms.
    "jerk5ms": Machine(300.0, 500.0, 500.0 / 0.005),
}


def machine_file(machine, reference):
    """`reference`, the text that `motion machine` prints, with the limits of `machine`."""
    limits = {
        "feed_mm_s": machine.feed_mm_s,
        "accel_mm_s2": machine.accel_mm_s2,
        "jerk_mm_s3": machine.jerk_mm_s3,
        "snap_mm_s4": machine.snap_mm_s4,
    }
    path = {key: value * math.sqrt(3) for key, value in limits.items()}
    path["accel_step_mm_s2"] = path["accel_mm_s2"]
    # Drives are not compared: no axis may fault because it follows badly.
    axis = limits | {"following_error_limit_mm": 1000.0}

    table = None
    lines = []
    for line in reference.splitlines():
        heading = re.match(r"\[+([\w.]+)\]+", line)
        table = heading.group(1) if heading else table
        key = line.split(" = ")[0]
        changed = {"path": path, "axis": axis}.get(table, {})
        lines.append(f"{key} = {changed[key]:.6f}" if key in changed else line)
    return "\n".join(lines) + "\n"


def ini(machine):
    sections = [
        ("EMC", {"VERSION": 1.1, "MACHINE": "peer", "DEBUG": 0}),
        ("DISPLAY", {"DISPLAY": "/tmp/display.py"}),
        ("TASK", {"TASK": "milltask", "CYCLE_TIME": 0.001}),
        ("RS274NGC", {"PARAMETER_FILE": "/tmp/machine.var"}),
        ("EMCMOT", {"EMCMOT": "motmod", "COMM_TIMEOUT": 1.0, "SERVO_PERIOD": 1000000}),
        ("EMCIO", {"EMCIO": "io", "CYCLE_TIME": 0.01, "TOOL_TABLE": "/tmp/tool.tbl"}),
        ("HAL", {"HALFILE": "/tmp/machine.hal"}),
        (
            "TRAJ",
            {
                "COORDINATES": "X Y Z",
                "LINEAR_UNITS": "mm",
                "ANGULAR_UNITS": "degree",
                "DEFAULT_LINEAR_VELOCITY": machine.feed_mm_s,
                "MAX_LINEAR_VELOCITY": VECTOR_MM_S,
                "MAX_LINEAR_ACCELERATION": VECTOR_MM_S2,
            },
        ),
        ("KINS", {"KINEMATICS": "trivkins coordinates=XYZ", "JOINTS": len(AXES)}),
    ]
    limits = {
        "MAX_VELOCITY": machine.feed_mm_s,
        "MAX_ACCELERATION": machine.accel_mm_s2,
        "MIN_LIMIT": -TRAVEL_MM,
        "MAX_LIMIT": TRAVEL_MM,
    }
    at_once = {"HOME_SEARCH_VEL": 0, "HOME_LATCH_VEL": 0, "HOME_SEQUENCE": 0}
    for joint, axis in enumerate(AXES):
        sections.append((f"AXIS_{axis}", limits))
        sections.append((f"JOINT_{joint}", {"TYPE": "LINEAR", **limits, "FERROR": 1000, "MIN_FERROR": 1000, **at_once}))
    return "\n".join(f"[{name}]\n" + "".join(f"{key} = {value}\n" for key, value in keys.items()) for name, keys in sections)


def hal():
    """Motors that stand where they are told to, and a sampler of their positions in µm: it prints six decimals."""
    lines = [
        "loadrt [KINS]KINEMATICS",
        "loadrt [EMCMOT]EMCMOT servo_period_nsec=[EMCMOT]SERVO_PERIOD num_joints=[KINS]JOINTS",
        f"loadrt scale count={len(AXES)}",
        "loadrt sampler depth=20000 cfg=" + "f" * len(AXES),
        "addf motion-command-handler servo-thread",
        "addf motion-controller servo-thread",
    ]
    for at in range(len(AXES)):
        lines += [
            f"addf scale.{at} servo-thread",
            f"setp scale.{at}.gain 1000",
            f"net position-{at} joint.{at}.motor-pos-cmd joint.{at}.motor-pos-fb scale.{at}.in",
            f"net sample-{at} scale.{at}.out sampler.0.pin.{at}",
        ]
    lines += [
        "addf sampler.0 servo-thread",
        "net enable iocontrol.0.user-enable-out iocontrol.0.emc-enable-in",
        "net tool-change iocontrol.0.tool-change iocontrol.0.tool-changed",
        "net tool-prepare iocontrol.0.tool-prepare iocontrol.0.tool-prepared",
    ]
    return "\n".join(lines) + "\n"
