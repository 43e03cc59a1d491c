"""Staged situations: the robot and a few cars on a four-lane road, for figures that no run needs to reach."""

from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes

from hj_cosim.analysis.figures.road_view import body_corners, draw_cars, draw_road, draw_robot
from hj_cosim.analysis.values import value_field
from hj_cosim.analysis.view import View
from hj_cosim.reachability.table.table import ValueTable
from hj_cosim.scene.observation import Observation
from hj_cosim.scene.road import Road, StraightRoad
from hj_cosim.vehicles.car import CAR_LENGTH, CAR_WIDTH


@dataclass(frozen=True)
class Situation:
    """The robot at x = 0 and J cars around it."""

    robot: np.ndarray  # (4,) p_x, p_y, θ, v
    x: np.ndarray  # (J,) m
    y: np.ndarray  # (J,) m
    speed: np.ndarray  # (J,) m/s
    road: Road

    @classmethod
    def of(cls, lane: int, speed: float, cars: list[tuple[float, int, float]]) -> "Situation":
        """Return the robot in the middle of a lane at a speed (m/s), and cars (x in m, lane, speed in m/s)."""
        road = StraightRoad(lane_count=4)
        x, lanes, speeds = (np.array(column, float) for column in zip(*cars, strict=True))
        robot = np.array([0.0, road.lane_centre(lane, 0.0), 0.0, speed])
        return cls(robot, x, road.lane_centres(lanes, x), speeds, road)

    @property
    def observation(self) -> Observation:
        """What the robot sees: all cars at constant speed in their lanes."""
        count = len(self.x)
        lane = self.road.nearest_lanes(self.y, self.x)
        return Observation(
            time=0.0,
            robot=self.robot,
            robot_acceleration=0.0,
            vehicle=np.arange(count),
            x=self.x,
            y=self.y,
            heading=np.zeros(count),
            speed=self.speed,
            acceleration=np.zeros(count),
            lane=lane,
            target_lane=lane,
            length=np.full(count, CAR_LENGTH),
            width=np.full(count, CAR_WIDTH),
        )

    def values(self, table: ValueTable) -> np.ndarray:
        """Return V of each car, (J,), m."""
        count = len(self.x)
        states = np.column_stack(
            [
                self.robot[0] - self.x,
                self.robot[1] - self.y,
                np.full(count, self.robot[2]),
                np.full(count, self.robot[3]),
                self.speed,
            ]
        )
        return table.value(states)

    def field(self, table: ValueTable, along: np.ndarray, aside: np.ndarray) -> np.ndarray:
        """Return the least V if the robot were elsewhere, (len(aside), len(along)), m."""
        return value_field(table, along, aside, self.robot[2], self.robot[3], self.x, self.y, self.speed)

    def draw(self, axes: Axes, start: float, stop: float, car_colours: object) -> None:
        """Draw the road between two arc lengths (m), the cars and the robot."""
        lines = self.road.lane_lines(start)
        draw_road(axes, View(self.road, start), start, stop, (float(lines[0]), float(lines[-1])))
        sizes = np.full(len(self.x), CAR_LENGTH), np.full(len(self.x), CAR_WIDTH)
        draw_cars(axes, body_corners(self.x, self.y, np.zeros(len(self.x)), *sizes), car_colours)
        draw_robot(axes, self.robot[0], self.robot[1], self.robot[2], CAR_LENGTH, CAR_WIDTH)

    def rows(self, table: ValueTable) -> list[dict[str, object]]:
        """Return a row for the robot and for each car, with its value."""
        x, y, _, speed = self.robot
        cars = zip(self.x, self.y, self.speed, self.values(table), strict=True)
        everyone = [("robot", x, y, speed, np.nan), *((f"car {number}", *car) for number, car in enumerate(cars, 1))]
        return [dict(zip(("vehicle", "x", "y", "speed", "value"), each, strict=True)) for each in everyone]
