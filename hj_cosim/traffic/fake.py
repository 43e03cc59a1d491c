"""A world without SUMO, for tests: cars that keep their lanes and their speeds, whatever the robot does."""

from collections.abc import Sequence
from typing import Self

import numpy as np

from hj_cosim.scene.observation import Observation
from hj_cosim.scene.road import Road
from hj_cosim.settings import CarStart, DriverSettings, RobotSettings
from hj_cosim.traffic.settling import follow_lane, mean_driver, robot_driver
from hj_cosim.traffic.sources.placement import CAR_LENGTH, CAR_WIDTH


class FakeWorld:
    """Cars at constant speed on a straight road; its future is known in closed form."""

    def __init__(
        self,
        cars: Sequence[CarStart] = (),
        robot_start: np.ndarray | Sequence[float] = (0.0, 4.0, 0.0, 24.0),
        road: Road | None = None,
        robot: RobotSettings | None = None,
        step: float = 0.02,
    ):
        """Put everyone in place.

        Args:
            cars: the other cars, relative to the robot.
            robot_start: (4,) p_x, p_y (m), θ (rad), v (m/s).
            road: four lanes of 4 m when left out.
            robot: its body; the default one when left out.
            step: s.
        """
        self.road = road or Road(lane_count=4)
        self.vehicle_names: Sequence[str] = [f"car_{number}" for number in range(len(cars))]
        self.drivers = np.tile(mean_driver(DriverSettings()), (len(cars), 1))
        self._robot_body = robot or RobotSettings()
        self._step = step
        self._steps = 0
        self._robot = np.array(robot_start, dtype=float)
        self._robot_acceleration = 0.0
        self._lane = np.array([car.lane for car in cars], dtype=np.int64)
        self._speed = np.array([car.speed for car in cars], dtype=float)
        self._x = self._robot[0] + np.array([car.x for car in cars], dtype=float)

    def observe(self) -> Observation:
        """Return the robot and every car; see World.observe."""
        count = len(self._x)
        return Observation(
            time=self._steps * self._step,
            robot=self._robot.copy(),
            robot_acceleration=self._robot_acceleration,
            vehicle=np.arange(count),
            x=self._x.copy(),
            y=self._lane * self.road.lane_width,
            heading=np.zeros(count),
            speed=self._speed.copy(),
            acceleration=np.zeros(count),
            lane=self._lane.copy(),
            target_lane=self._lane.copy(),
            length=np.full(count, CAR_LENGTH),
            width=np.full(count, CAR_WIDTH),
        )

    def settle(self, seconds: float) -> None:
        """Let the cars drive on with the robot following its lane, then set the clock to 0; see World.settle."""
        driver = robot_driver(DriverSettings(), float(self._robot[3]))
        for _ in range(round(seconds / self._step)):
            self.step(*follow_lane(self.observe(), driver, self.road, self._robot_body.length, self._step))
        self._steps = 0

    def step(self, robot_state: np.ndarray, robot_acceleration: float) -> None:
        """Advance by one step; see World.step."""
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
