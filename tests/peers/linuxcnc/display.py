#!/usr/bin/python3
"""What LinuxCNC starts as its user interface: runs a program, records the position at every servo period, and writes
`outcome.json`. Works in the folder that it is started in."""

import json
import signal
import subprocess
import sys
import time

import linuxcnc

REST_S = 0.3
POLL_S = 0.02


def run(limit_s):
    command, status, errors = linuxcnc.command(), linuxcnc.stat(), linuxcnc.error_channel()

    def done():
        command.wait_complete(5)

    command.state(linuxcnc.STATE_ESTOP_RESET)
    done()
    command.state(linuxcnc.STATE_ON)
    done()
    command.home(-1)
    time.sleep(REST_S)
    command.mode(linuxcnc.MODE_AUTO)
    done()
    command.set_optional_stop(False)
    done()
    command.program_open("program.ngc")
    done()
    status.poll()
    if status.task_mode != linuxcnc.MODE_AUTO or not all(status.homed[:3]):
        return "not ready"
    command.auto(linuxcnc.AUTO_RUN, 0)
    begin = time.monotonic()
    while True:
        time.sleep(POLL_S)
        status.poll()
        error = errors.poll()
        if error and error[0] in (linuxcnc.OPERATOR_ERROR, linuxcnc.NML_ERROR):
            return error[1]
        if status.interp_state == linuxcnc.INTERP_PAUSED:
            return "pauses"
        if time.monotonic() - begin > limit_s:
            return "too long"
        begun = time.monotonic() - begin > REST_S
        if begun and status.interp_state == linuxcnc.INTERP_IDLE and status.state == linuxcnc.RCS_DONE and status.inpos:
            return None


def main():
    with open("samples.txt", "w") as samples:
        sampler = subprocess.Popen(["halsampler", "-t"], stdout=samples)
        time.sleep(REST_S)
        problem = run(float(open("limit_s").read()))
        time.sleep(REST_S)
        sampler.send_signal(signal.SIGTERM)
        sampler.wait()
    with open("outcome.json", "w") as outcome:
        json.dump({"problem": problem}, outcome)


main()
sys.exit(0)
