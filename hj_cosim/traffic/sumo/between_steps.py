"""The cars between two steps of SUMO, where the robot's clock is finer than the traffic's.

SUMO integrates ballistically then: a car's acceleration is constant for the whole step, so that where it is within the
step is known to rounding, and its position and its speed are continuous from one step to the next. Sideways SUMO moves
cars at a constant rate.
"""

import math
from typing import NamedTuple

import numpy as np

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
        self._beside = beside if beside is not None else np.empty(0, dtype=np.int64)
        self._before, self._after, self._duration, self._road = before, after, duration, road
        way = after.x - before.x
        mean_speed = way / duration
        self._quadratic = (3.0 * mean_speed - 2.0 * before.speed - after.speed) / duration
        self._cubic = (before.speed + after.speed - 2.0 * mean_speed) / duration**2
        # A car that stands before the step ends has made less way than one that stops just then.
        stops = (after.speed == 0.0) & (2.0 * mean_speed < before.speed)
        self._braking_time = np.full(len(way), duration)
        self._braking_time[stops] = np.maximum(2.0 * way[stops] / before.speed[stops], 0.0)
        with np.errstate(divide="ignore", invalid="ignore"):
            braking = before.speed / self._braking_time
        self._quadratic[stops] = np.where(way[stops] > 0.0, -0.5 * braking[stops], 0.0)
        self._cubic[stops] = 0.0
        self._start_speed = np.where(stops & (way <= 0.0), 0.0, before.speed)
        self._sideways = after.y - before.y
        self._turning = np.remainder(after.heading - before.heading + np.pi, 2.0 * np.pi) - np.pi
        self._crossing = np.flatnonzero(after.lane != before.lane)

    def at(self, elapsed: float) -> Motion:
        """Return the motion at `elapsed` s after the step's beginning, less than its duration."""
        before, after, share = self._before, self._after, elapsed / self._duration
        time = np.minimum(elapsed, self._braking_time)
        quadratic, cubic = self._quadratic * time, self._cubic * time * time
        x = before.x + time * (self._start_speed + quadratic + cubic)
        speed = np.maximum(self._start_speed + 2.0 * quadratic + 3.0 * cubic, 0.0)
        if len(self._beside):
            there = self._beside
            x[there] = before.x[there] + share * (after.x[there] - before.x[there])
            speed[there] = before.speed[there] + share * (after.speed[there] - before.speed[there])
        y = before.y + share * self._sideways
        lane = after.lane
        if len(self._crossing):
            lane = lane.copy()
            crossing = self._crossing
            lane[crossing] = self._road.nearest_lanes(y[crossing], x[crossing])
        return Motion(x, y, before.heading + share * self._turning, speed, after.acceleration, lane)


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
