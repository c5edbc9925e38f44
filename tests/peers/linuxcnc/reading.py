"""What LinuxCNC's interpreter and this project's reader make of a program."""

import json
import os
import re
import shutil
import subprocess
import tempfile
from pathlib import Path

import steps
import tools

HERE = Path(__file__).parent
PYTHON = "/usr/bin/python3"
LIMIT_S = 60
INCH_MM = 25.4
UNKNOWN_AXIS = re.compile("Bad character '[uvw]' used")
INI = """[EMC]
VERSION = 1.1
[DISPLAY]
PROGRAM_PREFIX = {program_folder}
[RS274NGC]
SUBROUTINE_PATH = {subroutines}
"""


class Refused(Exception):
    """A reader does not accept the program; says why."""


def installed():
    return shutil.which("rs274") is not None


def called(command, **options):
    try:
        return subprocess.run(command, capture_output=True, text=True, errors="replace", timeout=LIMIT_S, **options)
    except subprocess.TimeoutExpired:
        raise Refused(f"no end within {LIMIT_S} s") from None


def by_linuxcnc(program, given):
    """Steps of LinuxCNC's own interpreter, and whether they tell all: `rs274` knows six axes. `given`: paths of `parameters`, `tools`, `subroutines`, or None for each."""
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder)
        table = given["tools"].read_text()
        (folder / "tools.tbl").write_text(table)
        # `rs274` takes its tables in inches, whatever the program says.
        (folder / "inch.tbl").write_text("".join(tool.line(INCH_MM) for tool in tools.read(table)))
        for name in ("order.var", "calls.var"):
            (folder / name).write_text(given["parameters"].read_text() if given["parameters"] else "")
        (folder / "machine.ini").write_text(
            INI.format(program_folder=program.parent.resolve(), subroutines=given["subroutines"] or program.parent.resolve())
        )
        (folder / "end.ngc").write_text("M2\n")
        (folder / "order.ngc").write_text(with_beginning(program.read_bytes().decode("latin-1")), encoding="latin-1")
        # The tool table in memory is a file of the home folder. A run of `rs274` makes it, and may change it.
        options = {"env": os.environ | {"HOME": str(folder), "INI_FILE_NAME": str(folder / "machine.ini")}, "cwd": folder}
        rs274 = ["rs274", "-g", "-i", "machine.ini"]
        order = called([*rs274, "-t", "inch.tbl", "-v", "order.var", "order.ngc"], **options)
        called([*rs274, "-t", "tools.tbl", "-v", "calls.var", "end.ngc"], **options)
        (folder / "calls.var").write_text(given["parameters"].read_text() if given["parameters"] else "")
        done = called([PYTHON, HERE / "calls.py", program.resolve(), "calls.var", "tools.tbl"], **options)
    lines = done.stdout.splitlines()
    calls = [json.loads(line) for line in lines if line.endswith("]")]
    if not calls or calls[-1][0] not in ("done", "error"):
        raise Refused("LinuxCNC's interpreter ends: " + (done.stderr.strip().splitlines() or ["without a word"])[-1])
    *calls, (outcome, *reason) = calls
    if outcome == "error":
        raise Refused(reason[1].splitlines()[0])
    if UNKNOWN_AXIS.search(order.stderr):
        return steps.of_calls(calls), False
    return steps.of_linuxcnc(calls, order.stdout), True


def with_beginning(text):
    """The program behind what `calls.py` executes before it."""
    lines = text.splitlines(keepends=True)
    first = 1 if lines and lines[0].strip() == "%" else 0
    lines.insert(first, "G21\nG53 G0 X0 Y0 Z0\nG80 (begin)\n")
    return "".join(lines)


def with_all(motion):
    """The reference machine's file with its probe, which is commented there, and with nine axes."""
    file = subprocess.run([Path(motion).resolve(), "machine"], capture_output=True, text=True, check=True).stdout
    before, probe, after = file.partition("#[[probe.box]]")
    touch, blank, after = after.partition("\n\n")
    file = before + probe[1:] + touch.replace("\n#low_mm", "\nlow_mm").replace("\n#high_mm", "\nhigh_mm") + blank + after
    last = file[file.rindex("[[axis]]"):]
    return file + "".join(last.replace('name = "Z"', f'name = "{letter}"') for letter in "ABCUVW")


def by_motion(motion, program, given):
    """Steps of this project's reader."""
    options = [word for name, path in given.items() if path for word in (f"--{name}", path.resolve())]
    # LinuxCNC's two voices read lines that begin with `/`.
    command = [Path(motion).resolve(), "read", program.name, "--json", "--block-delete", "false", *options]
    done = called(command, cwd=program.parent)
    if done.returncode != 0:
        raise Refused((done.stderr.strip().splitlines() or [f"status {done.returncode}"])[0])
    return steps.of_motion([json.loads(line) for line in done.stdout.splitlines()])
