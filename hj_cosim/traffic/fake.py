"""A world without SUMO, for tests: cars that keep their lanes and their speeds, whatever the robot does."""

import math
from collections.abc import Sequence
from typing import Self

import numpy as np

from hj_cosim.scene.observation import Observation
from hj_cosim.scene.road import Road, StraightRoad
from hj_cosim.settings import CarStart, DriverSettings, RobotSettings
from hj_cosim.traffic.road_end import require_road
from hj_cosim.traffic.settling import follow_lane, robot_driver
from hj_cosim.vehicles.car import CAR_LENGTH, CAR_WIDTH
from hj_cosim.vehicles.idm import mean_driver


class FakeWorld:
    """Cars at constant speed on a straight road; its future is known in closed form. A World."""

    def __init__(
        self,
        cars: Sequence[CarStart] = (),
        robot_start: np.ndarray | Sequence[float] = (0.0, 4.0, 0.0, 24.0),
        road: Road | None = None,
        robot: RobotSettings | None = None,
        step: float = 0.02,
        late: Sequence[tuple[float, CarStart]] = (),
    ):
        """Put everyone in place.

        Args:
            cars: the other cars, relative to the robot.
            robot_start: (4,) p_x, p_y (m), θ (rad), v (m/s).
            road: four lanes of 4 m when left out.
            robot: its body; the default one when left out.
            step: s.
            late: cars that enter after so many seconds (s since the robot took over), relative to where the robot is
                then. Nobody knows their drivers.
        """
        self.road = road or StraightRoad(lane_count=4)
        self.vehicle_names: list[str] = []
        self._robot_body = robot or RobotSettings()
        self._known_drivers = len(cars)
        self._late = sorted(late, key=lambda entry: entry[0])
        self._step = step
        self._steps = 0
        self._robot = np.array(robot_start, dtype=float)
        self._robot_acceleration = 0.0
        self._x, self._speed, self._lane = np.empty(0), np.empty(0), np.empty(0, np.int64)
        for car in cars:
            self._admit(car)

    def _admit(self, car: CarStart) -> None:
        self.vehicle_names.append(f"car_{len(self.vehicle_names)}")
        self._x = np.append(self._x, self._robot[0] + car.x)
        self._speed = np.append(self._speed, car.speed)
        self._lane = np.append(self._lane, car.lane)

    @property
    def drivers(self) -> np.ndarray:
        """The mean driver for each car that was there from the beginning, NaN for the late ones."""
        drivers = np.tile(mean_driver(DriverSettings()), (len(self.vehicle_names), 1))
        drivers[self._known_drivers :] = math.nan
        return drivers

    def observe(self) -> Observation:
        """Return the robot and every car whose front has not passed the end of the road; see World.observe."""
        here = np.flatnonzero(self._x + 0.5 * CAR_LENGTH <= self.road.length)
        count = len(here)
        return Observation(
            time=self._steps * self._step,
            robot=self._robot.copy(),
            robot_acceleration=self._robot_acceleration,
            vehicle=here,
            x=self._x[here],
            y=self.road.lane_centres(self._lane[here], self._x[here]),
            heading=np.zeros(count),
            speed=self._speed[here],
            acceleration=np.zeros(count),
            lane=self._lane[here],
            target_lane=self._lane[here],
            length=np.full(count, CAR_LENGTH),
            width=np.full(count, CAR_WIDTH),
        )

    def settle(self, seconds: float) -> None:
        """Let the cars drive on with the robot following its lane, then set the clock to 0; see World.settle."""
        driver = robot_driver(DriverSettings(), float(self._robot[3]))
        for _ in range(round(seconds / self._step)):
            self._advance(*follow_lane(self.observe(), driver, self.road, self._robot_body.length, self._step))
        self._steps = 0

    def step(self, robot_state: np.ndarray, robot_acceleration: float) -> None:
        """Advance by one step; see World.step."""
        self._advance(robot_state, robot_acceleration)
        while self._late and self._late[0][0] <= self._steps * self._step:
            self._admit(self._late.pop(0)[1])

    def _advance(self, robot_state: np.ndarray, robot_acceleration: float) -> None:
        front = robot_state[0] + 0.5 * self._robot_body.length * math.cos(robot_state[2])
        require_road(self.road, front, self._steps * self._step)
        self._x = self._x + self._speed * self._step
        self._robot = np.array(robot_state, dtype=float)
        self._robot_acceleration = float(robot_acceleration)
        self._steps += 1

    def close(self) -> None:
        """Do nothing: there is nothing to give back."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()
