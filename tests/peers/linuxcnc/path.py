"""The programmed path as points joined by straight lines, and how far positions are from it."""

import math

# Chords of arcs stay this close to them.
CHORD_MM = 1e-4
# Pieces around the last nearest one where the next position is looked for first.
BEHIND, AHEAD = 8, 64
# A greatest distance is found to this share of itself.
SHARE = 1e-3
STEP_MM = 1e-6


def arc_points(start, end, centre, turns, plane):
    """Points of an arc or helix after its start. `plane`: the indices of first, second and third axis. `turns`: positive
    counterclockwise, ±1 is up to one turn, ±2 one turn more. The radius goes evenly from the start's to the end's."""
    first, second, third = plane
    from_x, from_y = start[first] - centre[0], start[second] - centre[1]
    to_x, to_y = end[first] - centre[0], end[second] - centre[1]
    from_angle, to_angle = math.atan2(from_y, from_x), math.atan2(to_y, to_x)
    sweep = (to_angle - from_angle) * (1 if turns > 0 else -1) % math.tau
    if sweep < 1e-9:
        sweep += math.tau
    sweep += math.tau * (abs(turns) - 1)
    if turns < 0:
        sweep = -sweep
    from_radius, to_radius = math.hypot(from_x, from_y), math.hypot(to_x, to_y)
    radius = max(from_radius, to_radius, CHORD_MM)
    angle_max = 2 * math.acos(1 - min(CHORD_MM / radius, 1))
    count = max(1, math.ceil(abs(sweep) / angle_max))
    points = []
    for at in range(1, count):
        part = at / count
        angle = from_angle + sweep * part
        reach = from_radius + (to_radius - from_radius) * part
        point = [0.0, 0.0, 0.0]
        point[first] = centre[0] + reach * math.cos(angle)
        point[second] = centre[1] + reach * math.sin(angle)
        point[third] = start[third] + (end[third] - start[third]) * part
        points.append(tuple(point))
    points.append(tuple(end))
    return points


class Path:
    def __init__(self, points):
        self.pieces = []
        for start, end in zip(points, points[1:]):
            along = tuple(b - a for a, b in zip(start, end))
            square = sum(d * d for d in along)
            if square > 0:
                self.pieces.append((*start, *along, 1 / square))
        if not self.pieces:
            self.pieces.append((*points[0], 0.0, 0.0, 0.0, 0.0))

    def nearest(self, position, begin, end):
        """(square of the distance, index) of the nearest piece among those from `begin` up to `end`."""
        x, y, z = position
        best, best_at = math.inf, begin
        for at in range(max(begin, 0), min(end, len(self.pieces))):
            a, b, c, u, v, w, inverse = self.pieces[at]
            p, q, r = x - a, y - b, z - c
            part = (p * u + q * v + r * w) * inverse
            part = 0.0 if part < 0 else 1.0 if part > 1 else part
            p, q, r = p - part * u, q - part * v, r - part * w
            square = p * p + q * q + r * r
            if square < best:
                best, best_at = square, at
        return best, best_at

    def greatest_distance(self, positions):
        """The greatest distance of any position from the path. A position is near where the last one was, so there it is
        looked for first; all pieces are asked only where that leaves it farther than the greatest so far."""
        greatest, last = 0.0, 0
        for position in positions:
            square, at = self.nearest(position, last - BEHIND, last + AHEAD)
            if square > (greatest * (1 + SHARE) + STEP_MM) ** 2:
                square, at = self.nearest(position, 0, len(self.pieces))
                greatest = max(greatest, math.sqrt(square))
            last = at
        return greatest
