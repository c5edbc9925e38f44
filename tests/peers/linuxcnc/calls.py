"""The canonical calls that LinuxCNC's own interpreter makes for a program, in full doubles: `python3 calls.py PROGRAM
PARAMETERS TOOLS` prints a JSON list a line. Runs with the Python that LinuxCNC is installed for.

A call is its name, the line that makes it, and its arguments; lengths are in inches, whatever the program's units are. The
last list is `done`, or `error`, the line and the reason. PARAMETERS is a parameter file, and is written to. TOOLS is a
tool table; LinuxCNC's `rs274` has made it known in the home folder before."""

import ctypes
import json
import sys

import gcode

import tools

# The machine's units are millimetres; its position is 0 at the start, whatever the offsets of the parameter file.
BEFORE = ["G21", "G53 G0 X0 Y0 Z0", "G80 (begin)"]
ALL_AXES = 0x1FF


class Canon:
    """What the interpreter calls. Comments, spindle, coolant and the like come to nothing here."""

    def __init__(self, parameter_file, table):
        self.parameter_file = parameter_file
        self.by_index = [tools.EMPTY, *table]
        self.line = 0

    def __getattr__(self, name):
        return lambda *arguments: None

    def next_line(self, state):
        self.line = state.sequence_number

    def comment(self, text):
        if text == "begin":
            self.tell("begin")

    def tell(self, name, *arguments):
        json.dump([name, self.line, *arguments], sys.stdout)
        print()

    def change_tool(self, index):
        self.change_tool_number(index)
        # Without a tool, T0.
        self.tell("change_tool", max(self.by_index[0].number, 0))

    def change_tool_number(self, index):
        self.by_index[0] = self.by_index[index] if index else tools.EMPTY

    def get_tool(self, index):
        return (self.by_index[index] if index < len(self.by_index) else tools.EMPTY).entry()

    def get_external_length_units(self):
        return 1.0

    def get_external_angular_units(self):
        return 1.0

    def get_axis_mask(self):
        return ALL_AXES

    def get_block_delete(self):
        return False

    def check_abort(self):
        return False

    def user_defined_function(self, number, *arguments):
        self.tell("user_defined", number)


def told(name):
    return lambda self, *arguments: self.tell(name, *arguments)


for name in (
    "straight_traverse straight_feed straight_probe rigid_tap arc_feed dwell set_feed_rate set_plane "
    "set_g5x_offset set_g92_offset set_xy_rotation tool_offset"
).split():
    setattr(Canon, name, told(name))


def main():
    program, parameter_file, table = sys.argv[1:]
    # Without it, the interpreter ends in a bad access at the first tool.
    ctypes.CDLL("libtooldata.so.0")._Z14tool_mmap_userv()
    status, line = gcode.parse(program, Canon(parameter_file, tools.read(open(table).read())), BEFORE)
    if status > gcode.MIN_ERROR:
        json.dump(["error", line, gcode.strerror(status)], sys.stdout)
    else:
        json.dump(["done", line], sys.stdout)
    print()


main()
