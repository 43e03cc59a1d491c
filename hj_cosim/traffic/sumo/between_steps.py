"""The cars between two steps of SUMO, where the robot's clock is finer than the traffic's.

SUMO integrates ballistically then: a car's acceleration is constant for the whole step, so that where it is within the
step is known to rounding, and its position and its speed are continuous from one step to the next. Sideways SUMO moves
cars at a constant rate.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from hj_cosim.scene.road import Road


class Motion(NamedTuple):
    """How J cars move at one instant; road frame, centres, SI."""

    x: np.ndarray  # (J,) m
    y: np.ndarray  # (J,) m
    heading: np.ndarray  # (J,) rad
    speed: np.ndarray  # (J,) m/s
    acceleration: np.ndarray  # (J,) m/s²
    lane: np.ndarray  # (J,) int


class BetweenSteps:
    """The motion of J cars from the beginning to the end of one step of SUMO."""

    def __init__(
        self, before: Motion, after: Motion, duration: float, road: Road, beside: np.ndarray | None = None
    ) -> None:
        """Take what SUMO says of the two ends.

        Where position and speed of the ends belong to no constant acceleration, as on the way from one edge to the
        next, the acceleration changes linearly: position and speed stay continuous. A car that stops within the step
        brakes evenly until it stands.

        Args:
            before: at the step's beginning.
            after: at its end, of the same cars.
            duration: of the step, s.
            road: which lane is nearest, while a car crosses from one to another.
            beside: the indices of those on other roads, which need not run along this one: they advance evenly.
        """
        self._before, self._after, self._duration, self._road = before, after, duration, road
        self._course = _course(before.x, before.speed, after.x, after.speed, duration)
        if beside is not None and len(beside):
            _advance_evenly(self._course, beside, before, after, duration)
        self._sideways = after.y - before.y
        self._turning = np.remainder(after.heading - before.heading + np.pi, 2.0 * np.pi) - np.pi
        self._crossing = np.flatnonzero(after.lane != before.lane)

    def at(self, elapsed: float) -> Motion:
        """Return the motion at `elapsed` s after the step's beginning, less than its duration."""
        before, after, share = self._before, self._after, elapsed / self._duration
        x, y, heading, speed = _at(
            self._course, before.x, before.y, before.heading, self._sideways, self._turning, elapsed, share
        )
        lane = after.lane
        if len(self._crossing):
            lane = lane.copy()
            crossing = self._crossing
            lane[crossing] = self._road.nearest_lanes(y[crossing], x[crossing])
        return Motion(x, y, heading, speed, after.acceleration, lane)


@njit(cache=True)
def _course(
    x_before: np.ndarray, speed_before: np.ndarray, x_after: np.ndarray, speed_after: np.ndarray, duration: float
) -> np.ndarray:
    """Return what each of J cars does, (J, 7): its way is a t + b t² + c t³, its speed v + d t + e t².

    The columns are a, b, c, v, d, e, and the time at which it stands, s, or the step's end.
    """
    course = np.empty((len(x_before), 7))
    for car in range(len(x_before)):
        start, stop = speed_before[car], speed_after[car]
        way = x_after[car] - x_before[car]
        mean = way / duration
        end = duration
        quadratic = (3.0 * mean - 2.0 * start - stop) / duration
        cubic = (start + stop - 2.0 * mean) / duration**2
        # One that stands before the step ends has made less way than one that stops just then.
        if stop == 0.0 and 2.0 * mean < start:
            cubic = 0.0
            if way > 0.0:
                end = 2.0 * way / start
                quadratic = -0.5 * start / end
            else:
                start, quadratic = 0.0, 0.0
        course[car, 0], course[car, 1], course[car, 2] = start, quadratic, cubic
        course[car, 3], course[car, 4], course[car, 5] = start, 2.0 * quadratic, 3.0 * cubic
        course[car, 6] = end
    return course


def _advance_evenly(course: np.ndarray, cars: np.ndarray, before: Motion, after: Motion, duration: float) -> None:
    """Let some cars, whose speed is not that along this road, go their way evenly, and their speed change so."""
    way, gain, speed = after.x - before.x, after.speed - before.speed, before.speed
    course[cars, 0], course[cars, 4] = way[cars] / duration, gain[cars] / duration
    course[cars, 1] = course[cars, 2] = course[cars, 5] = 0.0
    course[cars, 3], course[cars, 6] = speed[cars], duration


# Eight parameters: arrays as they are, for a NamedTuple costs more to hand over than the loop takes.
@njit(cache=True)
def _at(
    course: np.ndarray,
    x_before: np.ndarray,
    y_before: np.ndarray,
    heading_before: np.ndarray,
    sideways: np.ndarray,
    turning: np.ndarray,
    elapsed: float,
    share: float,
) -> np.ndarray:
    """Return x, y (m), heading (rad) and speed (m/s) of J cars, (4, J), at `elapsed` s, that `share` of the step."""
    found = np.empty((4, len(course)))
    for car in range(len(course)):
        time = min(elapsed, course[car, 6])
        found[0, car] = x_before[car] + time * (course[car, 0] + time * (course[car, 1] + time * course[car, 2]))
        found[1, car] = y_before[car] + share * sideways[car]
        found[2, car] = heading_before[car] + share * turning[car]
        found[3, car] = max(course[car, 3] + time * (course[car, 4] + time * course[car, 5]), 0.0)
    return found


def foreseen(state: np.ndarray, turn_rate: float, acceleration: float, later: float, road: Road) -> np.ndarray:
    """Return where the robot will be `later` s from now if it goes on as it does.

    Args:
        state: (4,) p_x, p_y (m), θ (rad), v (m/s), in the road frame.
        turn_rate: against the road, rad/s.
        acceleration: m/s².
        later: s.
        road: the frame.
    """
    x, y, heading, speed = state.tolist()
    later_speed = max(speed + acceleration * later, 0.0)
    way, direction = 0.5 * (speed + later_speed) * later, heading + 0.5 * turn_rate * later
    along = x + way * math.cos(direction) / road.stretch_at(x, y)
    return np.array([along, y + way * math.sin(direction), heading + turn_rate * later, later_speed])
