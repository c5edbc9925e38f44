"""Writes the committed results: `python make.py optimum` and `python make.py stops` (see README.md)."""

import json
import random
import sys
from pathlib import Path

from law import Ramp, full_change_mm_s
from lists import KINDS, Solver, random_list
from machines import MACHINES, violation
from straight import least_stop, least_time_of_move

FOLDER = Path(__file__).parent
LENGTHS_MM = (0.1, 1.0, 3.0, 10.0, 30.0, 100.0)
LISTS = 24
STOPS = 200
# Cells of a half move and of a stop, and the coarser grids they are compared with.
MOVE_CELLS = (400, 800)
STOP_CELLS = (60, 120)
STOP_SLACK = 1e-4
VIOLATION_MAX = 1e-6


def moves(machine):
    for length in LENGTHS_MM:
        (coarse_s, _), (time_s, motion) = (least_time_of_move(machine, cells, length) for cells in MOVE_CELLS)
        cells = len(motion.step_s)
        broken = violation(machine, motion, [float("inf")] * cells, [(cells, length)])
        assert broken <= VIOLATION_MAX, (machine, length, broken)
        yield {
            "length_mm": length,
            "time_s": round(time_s, 9),
            "coarse_s": round(coarse_s, 9),
            "violation": float(f"{broken:.1e}"),
        }


def lists(machine, before):
    """`before`: what an earlier run found. A list keeps it if it is faster: all are upper bounds."""
    solver = Solver(machine)
    for number in range(LISTS):
        kind, seed = KINDS[number % len(KINDS)], number // len(KINDS)
        blocks = random_list(machine, kind, seed)
        row = {
            "kind": kind,
            "seed": seed,
            "blocks": [{"length_mm": length, "cap_mm_s": cap} for length, cap in blocks],
        }
        kept = [old for old in before if all(old[key] == value for key, value in row.items())]
        found = solver.best(blocks, seed)
        if found:
            best, middle_s, solved = found
            row |= {
                "time_s": round(best.time_s, 9),
                "cells": best.cells,
                "middle_s": round(middle_s, 9),
                "starts_solved": solved,
                "violation": float(f"{best.violation:.1e}"),
            }
            kept.append(row)
        fastest = min(kept, key=lambda one: one["time_s"])
        print(machine.name, kind, seed, [one["time_s"] for one in kept], file=sys.stderr)
        yield fastest


def stops(machine):
    rng = random.Random(f"stops/{machine.name}")
    most = 1.5 * full_change_mm_s(machine)
    count = 0
    while count < STOPS:
        ends = (rng.uniform(0.0, most), rng.uniform(0.0, most))
        ramp = Ramp(machine, *ends)
        at_s = rng.random() * ramp.time_s
        state = ramp.at(at_s)
        if state[0] < 1.0:
            continue
        time_s, peak, motion = least_stop(machine, STOP_CELLS[1], state, STOP_SLACK)
        v_scale = max(state[0], machine.accel_mm_s2**2 / machine.jerk_mm_s3 / 2)
        broken = violation(machine, motion, [peak] * len(motion.step_s), v_scale_mm_s=v_scale)
        assert broken <= VIOLATION_MAX, (machine, state, broken)
        row = {
            "from_mm_s": ends[0],
            "to_mm_s": ends[1],
            "at_s": at_s,
            "v_mm_s": state[0],
            "a_mm_s2": state[1],
            "j_mm_s3": state[2],
            "time_s": round(time_s, 8),
            "peak_mm_s": max(round(peak, 6), state[0]),
            "violation": float(f"{broken:.1e}"),
        }
        if count % 10 == 0:
            coarse_s, coarse_mm_s, _ = least_stop(machine, STOP_CELLS[0], state, STOP_SLACK)
            row |= {"coarse_s": round(coarse_s, 8), "coarse_mm_s": round(coarse_mm_s, 6)}
            print(machine.name, count, state, time_s, coarse_s, peak, coarse_mm_s, file=sys.stderr)
        yield row
        count += 1


def write(name, machines):
    """One case a line."""
    lines = []
    for machine, groups in machines:
        head = ", ".join(f'"{key}": {json.dumps(value)}' for key, value in machine.as_json().items())
        body = ",\n".join(
            f' "{group}": [\n' + ",\n".join("  " + json.dumps(row) for row in rows) + "\n ]"
            for group, rows in groups.items()
        )
        lines.append("{" + head + ",\n" + body + "}")
    (FOLDER / name).write_text("[\n" + ",\n".join(lines) + "\n]\n")


if __name__ == "__main__":
    if sys.argv[1:] == ["optimum"]:
        path = FOLDER / "optimum.json"
        found = json.loads(path.read_text()) if path.exists() else []
        before = {machine["name"]: machine["lists"] for machine in found}
        write(
            path.name,
            [(m, {"moves": list(moves(m)), "lists": list(lists(m, before.get(m.name, [])))}) for m in MACHINES],
        )
    elif sys.argv[1:] == ["stops"]:
        write("stops.json", [(m, {"stops": list(stops(m))}) for m in MACHINES])
    else:
        sys.exit(__doc__)
