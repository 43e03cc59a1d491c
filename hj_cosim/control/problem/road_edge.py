"""Staying on the road: the headings from which a robot can straighten up before its body is beyond the outermost lines.

No row is about the road's edge, for V knows of cars alone: to keep away from one beside, a filter would turn off the
road. From the heading θ, turning back with ω at the speed v, the robot's centre still moves sideways by R (1 − cos θ),
R = v/ω, and its front corner is (l/2) sin θ farther out. Together that is most, √(R² + l²/4) − R cos θ, where the
heading has come down to tan φ = l/(2 R). To brake meanwhile only makes it less.

Where a lane ends that the body is partly in, the road's edge comes across its way: a robot that others do not let out
of that lane, and that does not turn out of it, stops before the lane does.
"""

import math
from collections.abc import Sequence

from hj_cosim.scene.road import Road

SPARE = 0.05  # m, of which the control of a step may be wrong
BRAKING = 4.0  # m/s², with which it stops before the end of a lane
STOPPED_BEFORE = 1.0  # m, from the front bumper to that end


class RoadEdge:
    """Where the road ends to both sides of a robot.

    Args:
        road: the lanes.
        length, width: of the robot's body, m.
        step: s, until a robot can begin to turn back.
    """

    def __init__(self, road: Road, length: float, width: float, step: float) -> None:
        self._road, self._front, self._half_width, self._step = road, 0.5 * length, 0.5 * width, step
        self._lines = self._lines_at(0.0) if road.is_straight else None

    def _lines_at(self, along: float) -> tuple[float, float]:
        lines = self._road.lane_lines(along)
        return float(lines[0]), float(lines[-1])

    def speed_within(self, robot: Sequence[float]) -> float:
        """Return the highest speed, m/s, a step from now, from which it can stop before the lane that it is in ends.

        inf where none ends, or where it will have left the lane by then if it goes on as it is headed.

        Args:
            robot: p_x, p_y (m), θ (rad), v (m/s).
        """
        along, lateral, heading, speed = robot
        if self._lines is not None:
            return math.inf
        front, road = along + self._front, self._road
        reach = self._reach(along, speed)
        if road.lane_lines(along) is road.lane_lines(reach):  # one section of a route: no lane ends in between
            return math.inf
        fastest, half = math.inf, self._half_width + self._front * abs(math.sin(heading))  # of the body as it is turned
        for lane in road.lanes_overlapped(lateral, 2.0 * self._half_width, along):
            end = road.lane_end(lane, along)
            if end > reach:
                continue
            rightmost, leftmost = self._lines_at(end)
            then = lateral + (end - along) * math.tan(heading)
            if not rightmost + half <= then <= leftmost - half:
                room = end - front - speed * self._step - STOPPED_BEFORE
                fastest = min(fastest, math.sqrt(2.0 * BRAKING * max(room, 0.0)))
        return fastest

    def _reach(self, along: float, speed: float) -> float:
        """Return how far its front comes before it can have stopped, m of s."""
        return along + self._front + speed * self._step + 0.5 * speed * speed / BRAKING + STOPPED_BEFORE

    def _lines_to_keep(self, along: float, lateral: float, speed: float) -> tuple[float, float]:
        """Return the outermost lines here, or those of where it could stop, once the body is between these."""
        rightmost, leftmost = self._lines_at(along)
        right, left = self._lines_at(self._reach(along, speed))
        if right + self._half_width <= lateral <= left - self._half_width:
            return max(rightmost, right), min(leftmost, left)
        return rightmost, leftmost

    def headings_within(self, robot: Sequence[float], omega: float) -> tuple[float, float]:
        """Return the lowest and the highest heading from which it stays on the road, rad; 0 is between them.

        Who has left a lane that ends too soon to stop in it does not come back into it.

        Args:
            robot: p_x, p_y (m), θ (rad), v (m/s).
            omega: rad/s, with which it can turn back.
        """
        along, lateral, heading, speed = robot
        rightmost, leftmost = self._lines or self._lines_to_keep(along, lateral, speed)
        drift, radius = speed * math.sin(heading) * self._step, speed / omega
        left = leftmost - lateral - max(drift, 0.0) - self._half_width
        right = lateral + min(drift, 0.0) - rightmost - self._half_width
        lowest = max(-_steepest(right - SPARE, radius, self._front), -self._tail_within(left))
        return lowest, min(_steepest(left - SPARE, radius, self._front), self._tail_within(right))

    def _tail_within(self, room: float) -> float:
        """Return the greatest heading, rad, away from a line `room` m beside it that keeps its tail within that."""
        return math.asin(min(max(room, SPARE) / self._front, 1.0))


def _steepest(room: float, radius: float, front: float) -> float:
    """Return the greatest heading at which no more than `room` (m) is needed, in [0, π/2]."""
    if room <= 0.0:
        return 0.0
    at_once = math.asin(min(room / front, 1.0))
    if math.tan(at_once) * radius <= front:  # it is never farther out than now
        return at_once
    cosine = (math.hypot(radius, front) - room) / radius
    return math.acos(max(cosine, 0.0))
