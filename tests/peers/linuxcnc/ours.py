"""This project: the planned time of a program, and the motion that the kernel commands when it runs it."""

import csv
import json
import subprocess
import tempfile
from pathlib import Path

import recording
from machine import AXES, machine_file


class Refused(Exception):
    """`motion` does not plan the program; says why."""


class Motion:
    def __init__(self, command, limits, folder):
        """Writes the machine file into `folder`."""
        self.command = command
        self.machine = Path(folder, "machine.toml")
        reference = subprocess.run([command, "machine"], capture_output=True, text=True, check=True).stdout
        self.machine.write_text(machine_file(limits, reference))

    def called(self, verb, text, *options):
        with tempfile.TemporaryDirectory() as folder:
            program = Path(folder, "program.ngc")
            program.write_text(text, encoding="latin-1")
            command = [self.command, verb, program.name, "--machine", self.machine, *options]
            done = subprocess.run(command, capture_output=True, text=True, cwd=folder)
        if done.returncode != 0:
            raise Refused((done.stderr.strip().splitlines() or [f"status {done.returncode}"])[0])
        return done.stdout

    def time_s(self, text):
        return json.loads(self.called("plan", text, "--json"))["time_s"]

    def recorded(self, text):
        """Set positions [mm] and set accelerations [mm/s²] of all axes at LinuxCNC's servo periods. Positions of a trace are
        too coarse for a third difference."""
        with tempfile.TemporaryDirectory() as folder:
            trace = Path(folder, "trace.csv")
            self.called("run", text, "--trace", trace)
            with open(trace, newline="") as rows:
                return at_periods(csv.DictReader(rows))


def at_periods(rows):
    positions, accelerations = [], []
    for row in rows:
        periods = float(row["t_s"]) / recording.PERIOD_S
        if abs(periods - round(periods)) < 1e-6:
            positions.append(tuple(float(row[f"{axis}_set_mm"]) for axis in AXES))
            accelerations.append(tuple(float(row[f"{axis}_acc_mm_s2"]) for axis in AXES))
    return positions, accelerations
