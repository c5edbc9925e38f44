#!/usr/bin/env python3
"""Runs G-code in LinuxCNC and in this project under the same limits, and prints both times side by side."""

import argparse
import json
import math
import os
import sys
import tempfile
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import ours
import path
import peer
import recording
from machine import MACHINES
from program import NotRewritten, PathMode, rewritten

# LinuxCNC's own rounding, and chords in place of arcs.
DEVIATION_SLACK_MM = 0.001
END_MM = 0.001


def arguments():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path, help="programs: every .ngc in it and below")
    parser.add_argument("names", nargs="*", help="only these, relative to the folder")
    parser.add_argument("--motion", default="motion", help="the command to compare")
    parser.add_argument("--machine", choices=MACHINES, default="reference")
    parser.add_argument("--tolerance", type=float, default=0.05, help="P of G64 [mm]")
    parser.add_argument("--naive-cam", choices=["0", "=P"], help="Q of G64; without it, G64 has no Q")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--limit-s", type=float, default=120, help="leave out what takes LinuxCNC longer")
    parser.add_argument("--times-only", action="store_true", help="no jerk and deviation of this project's runs")
    parser.add_argument("--cache", type=Path, default=Path(tempfile.gettempdir(), "linuxcnc-runs"))
    parser.add_argument("--json", type=Path, help="write the figures here")
    return parser.parse_args()


def found(folder, names):
    """(name, text) of programs, and (name, reason) of those left out because they are copies."""
    files = [folder / name for name in names] or sorted(folder.rglob("*.ngc"))
    programs, copies, seen = [], [], {}
    for file in files:
        name, text = str(file.relative_to(folder)), file.read_bytes().decode("latin-1")
        if text in seen:
            copies.append({"name": name, "left_out": f"copy of {seen[text]}"})
        else:
            seen[text] = name
            programs.append((name, text))
    return programs, copies


def compared(name, text, options, motion):
    limits = MACHINES[options.machine]
    merge_mm = {None: None, "0": 0.0, "=P": options.tolerance}[options.naive_cam]
    try:
        text_ours = rewritten(text, PathMode(options.tolerance, merge_mm))
        # LinuxCNC takes P for a Q that is not there. Written out, both share a run.
        text_theirs = rewritten(text, PathMode(options.tolerance, options.tolerance if merge_mm is None else merge_mm))
        try:
            points, least_s = peer.programmed_path(text_theirs, limits)
        except peer.LeftOut:
            # What this project refuses is listed with its own reason, whatever the other says.
            motion.time_s(text_ours)
            raise
        if least_s > options.limit_s:
            raise peer.LeftOut(f"takes more than {options.limit_s:g} s")
        time_s = motion.time_s(text_ours)
        theirs = peer.positions(text_theirs, limits, options.limit_s, options.cache)
        theirs_s = recording.run_time_s(theirs)
        if theirs_s == 0:
            raise peer.LeftOut("nothing moves")
        if theirs_s > options.limit_s:
            raise peer.LeftOut(f"takes more than {options.limit_s:g} s")
        if math.dist(theirs[-1], points[-1]) > END_MM:
            raise peer.LeftOut(f"LinuxCNC ends at {theirs[-1]}, the program at {points[-1]}")
        result = {"name": name, "ours": {"time_s": time_s}, "theirs": {"time_s": theirs_s}}
        if not options.times_only:
            programmed = path.Path(points)
            mine, accelerations = motion.recorded(text_ours)
            result["ours"] |= {
                "jerk_mm_s3": recording.peak_jerk_of_accelerations_mm_s3(accelerations),
                "deviation_mm": programmed.greatest_distance(mine),
            }
            result["theirs"] |= {
                "jerk_mm_s3": recording.peak_jerk_mm_s3(theirs),
                "deviation_mm": programmed.greatest_distance(recording.moving(theirs)),
            }
        return result | {"ratio": time_s / theirs_s}
    except (NotRewritten, peer.LeftOut) as reason:
        return {"name": name, "left_out": str(reason)}
    except ours.Refused as reason:
        return {"name": name, "left_out": f"refused: {reason}"}


def row(cells, name):
    widths = (9, 9, 7, 12, 8, 12, 8)
    return "".join(f"{cell:>{width}}" for cell, width in zip(cells, widths)) + "  " + name


def figures(side):
    if "jerk_mm_s3" not in side:
        return ["–", "–"]
    return [f"{side['jerk_mm_s3']:.0f}", f"{side['deviation_mm'] * 1000:.1f}"]


def table(results):
    yield row(["time", "", "ratio", "ours:", "", "theirs:", ""], "")
    yield row(["ours s", "theirs s", "", "mm/s³", "µm", "mm/s³", "µm"], "program")
    for result in sorted(results, key=lambda result: -result["ratio"]):
        mine, other = result["ours"], result["theirs"]
        times = [f"{mine['time_s']:.3f}", f"{other['time_s']:.3f}", f"{result['ratio']:.3f}"]
        yield row([*times, *figures(mine), *figures(other)], result["name"])


def summary(results, left_out, allowed):
    if results:
        mean = math.exp(sum(math.log(result["ratio"]) for result in results) / len(results))
        worst = max(results, key=lambda result: result["ratio"])
        faster = sum(result["ratio"] < 1 for result in results)
        extreme = f"worst {worst['ratio']:.3f} ({worst['name']}), faster in {faster}"
        yield f"{len(results)} programs: geometric mean {mean:.3f}, {extreme}"
    for side, allowed_mm in allowed.items():
        far = [result for result in results if result[side].get("deviation_mm", 0) > allowed_mm + DEVIATION_SLACK_MM]
        listed = ", ".join(f"{result['name']} {result[side]['deviation_mm'] * 1000:.1f} µm" for result in far)
        yield f"farther from the path than {allowed_mm * 1000:.0f} µm, {side}: {len(far)}{': ' + listed if far else ''}"
    yield f"{len(left_out)} left out"
    for result in left_out:
        yield f"  {result['name']}: {result['left_out']}"


def main():
    options = arguments()
    if not peer.installed():
        sys.exit("compare.py: found no `linuxcnc`, expected Debian's package linuxcnc-uspace")
    if os.geteuid() != 0:
        sys.exit("compare.py: expected to be run by root: a run of LinuxCNC has namespaces of its own")
    programs, left_out = found(options.folder, options.names)
    with tempfile.TemporaryDirectory() as folder:
        motion = ours.Motion(options.motion, MACHINES[options.machine], folder)
        with ProcessPoolExecutor(options.jobs) as pool:
            tasks = [pool.submit(compared, name, text, options, motion) for name, text in programs]
            results = []
            for task in tasks:
                result = task.result()
                print("·", result["name"], result.get("ratio", result.get("left_out")), file=sys.stderr)
                (left_out if "left_out" in result else results).append(result)
    # Q comes on top of P. LinuxCNC has one even where none is written.
    allowed = {
        "ours": options.tolerance * (2 if options.naive_cam == "=P" else 1),
        "theirs": options.tolerance * (1 if options.naive_cam == "0" else 2),
    }
    print("\n".join([*table(results), "", *summary(results, left_out, allowed)]))
    if options.json:
        options.json.write_text(json.dumps({"results": results, "left_out": left_out}, indent=1) + "\n")


if __name__ == "__main__":
    main()
