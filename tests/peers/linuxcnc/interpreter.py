#!/usr/bin/env python3
"""Compares what LinuxCNC's own interpreter and this project's reader make of programs, move by move."""

import argparse
import collections
import json
import re
import sys
import tempfile
import time
import tomllib
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import debian
import random_programs
import reading
import tools
from difference import Figures, compared
from steps import NotComparable, as_of_calls

HERE = Path(__file__).parent
SHOWN = 3


def arguments():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folders", nargs="*", type=Path, help="programs: every .ngc in them and below")
    parser.add_argument("--debian", action="store_true", help="the programs of Debian's source package, too")
    parser.add_argument("--random", type=int, default=0, metavar="COUNT", help="so many random programs, too")
    parser.add_argument("--seed", type=int, default=1, help="of the first of them")
    cache = Path(tempfile.gettempdir(), "linuxcnc-source")
    parser.add_argument("--cache", type=Path, default=cache, help="they are kept here")
    parser.add_argument("--motion", default="motion", help="the command to compare")
    parser.add_argument("--parameters", type=Path, help="parameter file, for both")
    parser.add_argument(
        "--tools", type=Path, help="tool table, for both, unless NAME.tbl is beside a program; without it 99 tools of 2 mm"
    )
    parser.add_argument("--machine", type=Path, help="machine file for `motion`; without it the reference machine with its probe and nine axes")
    parser.add_argument("--subroutines", type=Path, help="folder of subroutines, for both")
    parser.add_argument("--differences", type=Path, default=HERE / "differences.toml", help="differences with a reason")
    parser.add_argument("--refused", type=Path, default=HERE / "refused.toml", help="refused programs with a reason")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--json", type=Path, help="write the outcome of every program here")
    return parser.parse_args()


def found(folders):
    """(name, path) of programs of different content. A name begins with that of the folder given."""
    programs, seen = [], set()
    for folder in folders:
        for path in sorted(folder.rglob("*.ngc")):
            text = path.read_bytes()
            if text not in seen:
                seen.add(text)
                programs.append((str(path.relative_to(folder.parent)), path))
    return programs


def outcome(name, path, motion, given, unread):
    """What became of a program; `differences` are objects of `Difference`."""
    result = {"name": name}
    if path.with_suffix(".tbl").is_file():
        given = given | {"tools": path.with_suffix(".tbl")}
    for side, read in (("ours", lambda: reading.by_motion(motion, path, given)),
                       ("theirs", lambda: reading.by_linuxcnc(path, given))):
        try:
            result[side] = read()
        except reading.Refused as reason:
            result[f"{side}_refused"] = str(reason)
        except NotComparable as reason:
            result["not_comparable"] = str(reason)
    mine, other = result.pop("ours", None), result.pop("theirs", None)
    if mine is not None and other is not None:
        other, result["tells_all"] = other
        mine = mine if result["tells_all"] else as_of_calls(mine)
        result["probes"] = any(step.kind == "probe" for step in mine)
        result["unread"] = collections.Counter(step.kind for step in other if step.kind in unread)
        result["differences"], result["figures"] = compared(mine, [step for step in other if step.kind not in unread])
    return result


def reason_of(refusal):
    """A refusal without its place and without the numbers that differ from program to program."""
    text = re.sub(r"^.*?:\d+:\d+: ", "", refusal.removeprefix("motion: "))
    text = text.split(", expected")[0]
    return re.sub(r"(?<![GM\d.])([-+]?\d+(\.\d*)?|[-+]?\.\d+)(?!\.?\d)", "…", text)


def listed(result, known):
    """Splits the differences into those with an entry and those without. An entry without a line is for all lines."""
    def matches(difference, entry):
        places = entry.get("lines", [difference.line])
        return entry["program"] == result["name"] and entry["what"] == difference.what and difference.line in places

    without = []
    for difference in result.get("differences", []):
        entries = [at for at, entry in enumerate(known) if matches(difference, entry)]
        if entries:
            result.setdefault("entries", set()).update(entries)
        else:
            without.append(difference)
    return without


def refusals(results, known):
    """Faults of the list of refused programs: refused without an entry that says so, or accepted with one."""
    entries = {program: entry["found"] for entry in known for program in entry["programs"]}
    for result in results:
        name, refusal = result["name"], result.get("ours_refused")
        if refusal is not None and name not in entries:
            yield f"refused, and not listed: {name}: {refusal}"
        elif refusal is not None and entries[name] not in refusal:
            yield f"refused for another reason than listed: {name}: {refusal}"
        elif refusal is None and name in entries:
            yield f"listed as refused, but accepted: {name}"


def shortened(names):
    random = [name for name in names if name.startswith("random/")]
    told = [name for name in names if name not in random] + ([f"{len(random)} random programs"] if random else [])
    return ", ".join(told) or "none"


def counted(reasons):
    counts = collections.Counter(map(reason_of, reasons))
    return [f"  {count:4}  {reason}" for reason, count in counts.most_common()]


def report(results, known, unread):
    """Prints the outcome; whether there is nothing but what is listed."""
    both = [result for result in results if "differences" in result]
    apart = [result for result in results if "not_comparable" in result and "ours_refused" not in result]
    theirs = [result for result in results if "ours_refused" in result and "theirs_refused" not in result]
    mine = [result for result in results if "theirs_refused" in result and "ours_refused" not in result]
    neither = [result for result in results if "ours_refused" in result and "theirs_refused" in result]
    figures = Figures()
    used, new = set(), []
    for result in both:
        figures.add(result["figures"])
        new += [(result["name"], difference) for difference in listed(result, known)]
        used |= result.get("entries", set())
    print(f"{len(results)} different programs: {len(both) + len(mine) + len(apart)} accepted, {len(both)} compared")
    print(f"accepted by LinuxCNC only: {len(theirs)}")
    print("\n".join(counted(result["ours_refused"] for result in theirs)))
    print(f"accepted by neither: {len(neither)}")
    print("\n".join(counted(result["ours_refused"] for result in neither)))
    print(f"accepted by this project only: {len(mine)}")
    print("\n".join(counted(result["theirs_refused"] for result in mine)))
    print(f"not comparable: {len(apart)}")
    print("\n".join(f"  {result['name']}: {result['not_comparable']}" for result in apart))
    print("compared up to the first probing move, which LinuxCNC's interpreter alone knows no end of: "
          + (", ".join(result["name"] for result in both if result["probes"]) or "none"))
    print("compared without path modes and outputs, as `rs274` knows six axes: "
          + shortened([result["name"] for result in both if not result["tells_all"]]))
    skipped = sum((result["unread"] for result in both), collections.Counter())
    for kind, reason in unread.items():
        print(f"not compared: {skipped[kind]} of {kind} ({reason})")
    print(f"{figures.moves} moves and {figures.others} other steps compared. Farthest apart: end points "
          f"{figures.end_mm:.3g} mm, curves {figures.curve_mm:.3g} mm, feeds {figures.feed_share:.3g} of themselves")
    for at in sorted(used):
        print(f"listed: {known[at]['program']}: {known[at]['what']}: {known[at]['reason']}")
    names = {result["name"] for result in both}
    stale = [entry for at, entry in enumerate(known) if at not in used and entry["program"] in names]
    for entry in stale:
        print(f"listed, but there is none: {entry['program']}: {entry['what']}")
    programs = collections.Counter(name for name, _ in new)
    print(f"{len(new)} differences that are not listed, in {len(programs)} programs")
    shown = collections.Counter()
    for name, difference in new:
        shown[name] += 1
        if shown[name] <= SHOWN:
            print(f"  {name}: {difference}")
    return not new and not stale


def main():
    options = arguments()
    if not reading.installed():
        sys.exit("interpreter.py: found no `rs274`, expected Debian's package linuxcnc-uspace")
    begin = time.monotonic()
    folders = options.folders + (debian.folders(options.cache) if options.debian else [])
    programs = found(folders)
    if not programs and not options.random:
        sys.exit("interpreter.py: found no .ngc, expected a folder with programs, --debian or --random")
    with open(options.differences, "rb") as file:
        listing = tomllib.load(file)
    unread = {entry["kind"]: entry["reason"] for entry in listing.get("unread", [])}
    given = {name: getattr(options, name) for name in ("parameters", "tools", "subroutines", "machine")}
    with ProcessPoolExecutor(options.jobs) as pool, tempfile.TemporaryDirectory() as folder:
        if options.random:
            made = Path(folder, "random")
            made.mkdir()
            random_programs.write(made, options.random, options.seed)
            programs += found([made])
        if given["tools"] is None:
            given["tools"] = Path(folder, "tools.tbl")
            given["tools"].write_text(tools.alike(count=99, diameter=2))
        if given["machine"] is None:
            given["machine"] = Path(folder, "machine.toml")
            given["machine"].write_text(reading.with_all(options.motion))
        tasks = [pool.submit(outcome, name, path, options.motion, given, unread) for name, path in programs]
        results = [task.result() for task in tasks]
    is_right = report(results, listing.get("difference", []), unread)
    with open(options.refused, "rb") as file:
        faults = list(refusals(results, tomllib.load(file)["refused"]))
    print("\n".join([*faults, f"{len(faults)} faults of the list of refused programs"]))
    is_right = is_right and not faults
    print(f"{time.monotonic() - begin:.0f} s")
    if options.json:
        options.json.write_text(json.dumps(results, default=str, indent=1) + "\n")
    sys.exit(0 if is_right else 1)


if __name__ == "__main__":
    main()
