"""LinuxCNC: the path that it reads in a program, and the positions that it commands when it runs it.

A run is real time. It has namespaces of its own for processes, shared memory, network and /tmp, so that runs beside each
other do not meet. What a run gave is kept under a hash of everything that it was given."""

import gzip
import hashlib
import json
import os
import shutil
import subprocess
import tempfile
from pathlib import Path

import machine
import recording

HERE = Path(__file__).parent
PYTHON = "/usr/bin/python3"
# Start and end of LinuxCNC itself.
AROUND_S = 60
# A rest this long at the end of a run that was given up is a stall, which another run need not have.
STALL_S = 30
ATTEMPTS = 3
# The mounts are seen by this run alone. Realtime code does not run as root.
INSIDE = """
mount -t proc proc /proc && mount --bind "$1" /tmp && ip link set lo up && cd /tmp &&
HOME=/tmp RTAPI_UID=65534 exec linuxcnc /tmp/machine.ini
"""


class LeftOut(Exception):
    """The program can't be compared; says why."""


def installed():
    return shutil.which("linuxcnc") is not None


def programmed_path(text, limits):
    """(points, least time) of the program's own path."""
    with tempfile.TemporaryDirectory() as folder:
        program = Path(folder, "program.ngc")
        program.write_text(text, encoding="latin-1")
        done = subprocess.run(
            [PYTHON, HERE / "canon.py", program, str(limits.feed_mm_s)], capture_output=True, text=True
        )
    if done.returncode != 0:
        raise LeftOut("LinuxCNC's interpreter: " + (done.stderr.strip().splitlines() or ["ended"])[-1])
    read = json.loads(done.stdout)
    if "error" in read:
        raise LeftOut("LinuxCNC: " + read["error"])
    return [tuple(point) for point in read["points"]], read["least_s"]


def positions(text, limits, limit_s, cache):
    """[mm] The position at every servo period of LinuxCNC's run of `text`."""
    given = {"program.ngc": text, "machine.ini": machine.ini(limits), "machine.hal": machine.hal()}
    display = (HERE / "display.py").read_text()
    key = hashlib.sha256(json.dumps([given, display]).encode()).hexdigest()[:32]
    kept = cache / f"{key}.json.gz"
    if kept.exists():
        result = json.loads(gzip.decompress(kept.read_bytes()))
        # A run that was given up says nothing about a longer limit.
        if result["problem"] != "too long" or result["limit_s"] >= limit_s:
            return judged(result, limit_s)
    for _ in range(ATTEMPTS):
        result = run(given, limit_s) | {"limit_s": limit_s}
        if not stalled(result):
            break
    else:
        raise LeftOut("LinuxCNC stalls")
    cache.mkdir(parents=True, exist_ok=True)
    part = kept.with_suffix(f".{os.getpid()}")
    part.write_bytes(gzip.compress(json.dumps(result).encode(), 6))
    part.rename(kept)
    return judged(result, limit_s)


def judged(result, limit_s):
    if result["problem"] == "too long":
        raise LeftOut(f"takes more than {limit_s:g} s")
    if result["problem"]:
        raise LeftOut("LinuxCNC: " + result["problem"])
    return [tuple(value / 1000 for value in row) for row in result["um"]]


def stalled(result):
    """LinuxCNC now and then stops in the middle of a program and never goes on."""
    last = result["um"][-int(STALL_S / recording.PERIOD_S) :]
    return result["problem"] == "too long" and all(row == last[0] for row in last)


def run(given, limit_s):
    """What LinuxCNC did: `problem`, and positions `um` [µm] of all periods."""
    folder = Path(tempfile.mkdtemp(prefix="peer-"))
    try:
        # LinuxCNC's realtime part is another user there.
        folder.chmod(0o1777)
        for name, text in given.items():
            (folder / name).write_text(text, encoding="latin-1")
        shutil.copy(HERE / "display.py", folder)
        (folder / "display.py").chmod(0o755)
        (folder / "limit_s").write_text(str(limit_s))
        for name in ("machine.var", "tool.tbl"):
            (folder / name).touch()
        command = ["unshare", "--ipc", "--net", "--mount", "--pid", "--fork", "--kill-child", "sh", "-c", INSIDE]
        with open(folder / "log", "w") as log:
            try:
                subprocess.run([*command, "sh", folder], stdout=log, stderr=log, timeout=limit_s + AROUND_S)
            except subprocess.TimeoutExpired:
                raise LeftOut("LinuxCNC does not end") from None
        if not (folder / "outcome.json").exists():
            raise LeftOut("LinuxCNC does not start: " + (folder / "log").read_text()[-400:])
        outcome = json.loads((folder / "outcome.json").read_text())
        return outcome | {"um": samples((folder / "samples.txt").read_text())}
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def samples(text):
    """Rows of `halsampler -t`: a number that counts periods, then the positions."""
    rows = []
    begin = None
    for line in text.splitlines():
        words = line.split()
        begin = int(words[0]) if begin is None else begin
        if words[0] == "overrun" or int(words[0]) - begin != len(rows):
            raise LeftOut("samples were lost")
        rows.append([float(word) for word in words[1:]])
    return rows
