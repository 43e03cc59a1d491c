"""Which controls a filter may choose from: what the tyres hold, and what leads neither off a table nor off the road."""

import numpy as np

from hj_cosim.control.problem.nearest_control import Grip
from hj_cosim.control.problem.road_edge import RoadEdge
from hj_cosim.control.problem.safety_problem import available_controls
from hj_cosim.scene.road import Road
from hj_cosim.settings import FilterSettings, RobotSettings


class Availability:
    """The controls that a robot has, by where it is.

    Args:
        settings: whether it stays on the road.
        robot: limits and body.
        road: the lanes.
        headings: rad, the lowest and the highest that it may turn to.
        step: s, the time for which a control is held.
    """

    def __init__(
        self,
        settings: FilterSettings,
        robot: RobotSettings,
        road: Road,
        headings: tuple[float, float],
        step: float,
    ) -> None:
        self._edge = RoadEdge(road, robot.length, robot.width, step) if settings.keep_on_road else None
        self._grip, self._step = Grip(robot), step
        # What the bicycle turns in a step at a changing speed differs from ω step, by less than the largest of these.
        turn = robot.omega_max * step
        self._bounds = np.array([headings[0] + turn, headings[1] - turn, 0.0, robot.speed_max])
        # Within these, no control leads beyond the bounds in one step, and the limits themselves are available.
        self._free_heading = (self._bounds[0] + turn, self._bounds[1] - turn)
        self._free_speed = (-robot.acceleration_min * step, robot.speed_max - robot.acceleration_max * step)

    def prepare(self) -> None:
        """Compile what is needed near a bound."""
        available_controls(self._grip.limits_at(0.0), 0.0, 0.0, self._bounds, self._step)

    def at(self, robot: np.ndarray) -> np.ndarray:
        """Return what is available, (4,) lower and upper ω (rad/s), lower and upper a (m/s²).

        Args:
            robot: (4,) p_x, p_y (m), θ (rad), v (m/s).
        """
        place = robot.tolist()
        heading, speed = place[2], place[3]
        limits = self._grip.limits_at(speed)
        if self._edge is not None:
            fastest = self._edge.speed_within(place)
            if fastest < speed + limits[3] * self._step:
                limits = limits.copy()
                limits[3] = max((fastest - speed) / self._step, limits[2])
            turn = float(limits[1])
            lowest, highest = self._edge.headings_within(place, turn)
            if not lowest + turn * self._step <= heading <= highest - turn * self._step:
                bounds, limits = self._bounds.copy(), limits.copy()
                limits[3] = min(limits[3], 0.0)  # the faster it is, the wider it turns back
                bounds[0], bounds[1] = max(bounds[0], lowest), min(bounds[1], highest)
                return available_controls(limits, heading, speed, bounds, self._step)
        if (
            self._free_heading[0] <= heading <= self._free_heading[1]
            and self._free_speed[0] <= speed <= self._free_speed[1]
        ):
            return limits
        return available_controls(limits, heading, speed, self._bounds, self._step)
