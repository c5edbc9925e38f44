"""What a motion recorded at every servo period tells: run time and peak jerk."""

PERIOD_S = 0.001


def moving(positions):
    """The positions from the last one at rest before the motion to the first one at rest after it."""
    first, last = 0, len(positions) - 1
    while first < last and positions[first + 1] == positions[0]:
        first += 1
    while last > first and positions[last - 1] == positions[-1]:
        last -= 1
    return positions[first : last + 1]


def run_time_s(positions):
    return (len(moving(positions)) - 1) * PERIOD_S


def peak_jerk_mm_s3(positions):
    """The greatest third difference of any axis' positions. The ends are at rest."""
    greatest = 0.0
    for axis in zip(*positions):
        axis = (axis[0],) * 3 + axis + (axis[-1],) * 3
        for a, b, c, d in zip(axis, axis[1:], axis[2:], axis[3:]):
            greatest = max(greatest, abs(d - 3 * c + 3 * b - a))
    return greatest / PERIOD_S**3


def peak_jerk_of_accelerations_mm_s3(accelerations):
    """The same where accelerations are known: their greatest difference. It smooths less than a third difference does."""
    greatest = 0.0
    for axis in zip(*accelerations):
        axis = (0.0, *axis, 0.0)
        greatest = max(greatest, *(abs(b - a) for a, b in zip(axis, axis[1:])))
    return greatest / PERIOD_S
