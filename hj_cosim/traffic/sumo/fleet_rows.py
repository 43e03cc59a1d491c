"""What the fleet knows of its cars, as arrays with a row for each."""

import math
from typing import NamedTuple

import numpy as np

from hj_cosim.traffic.sumo.between_steps import Motion


class FleetArrays(NamedTuple):
    """The J cars on the road, a row each, and in a last row the robot, which the others take for one of them."""

    number: np.ndarray  # (J + 1,) int, as World has it; the robot's means nothing
    turn: np.ndarray  # (J + 1,) int, when it decides, or NEVER_ITS_TURN
    x: np.ndarray  # (J + 1,) m, like all positions of its centre
    y: np.ndarray  # (J + 1,) m
    heading: np.ndarray  # (J + 1,) rad
    speed: np.ndarray  # (J + 1,) m/s
    acceleration: np.ndarray  # (J + 1,) m/s²
    lane: np.ndarray  # (J + 1,) int
    target_lane: np.ndarray  # (J + 1,) int, where a change in progress leads
    second_lane: np.ndarray  # (J + 1,) int, the other lane that it is in meanwhile
    length: np.ndarray  # (J + 1,) m
    width: np.ndarray  # (J + 1,) m
    driver: np.ndarray  # (J + 1, 6) IDM parameters; an estimate where the car is not ours
    mobil: np.ndarray  # (J + 1, 3) MOBIL's parameters; they mean nothing where the car decides elsewhere

    def only(self, stays: np.ndarray) -> "FleetArrays":
        """Return the rows of a mask (J + 1,)."""
        return FleetArrays(*(column[stays] for column in self))

    def motion(self) -> Motion:
        """Return how the cars move, in arrays that nobody changes."""
        return Motion(
            self.x[:-1],
            self.y[:-1].copy(),
            self.heading[:-1].copy(),
            self.speed[:-1],
            self.acceleration[:-1],
            self.lane[:-1].copy(),
        )

    def with_car(self, car: "FleetArrays") -> "FleetArrays":
        """Return the rows with one more (of one row) before the robot's."""
        return FleetArrays(
            *(np.concatenate([column[:-1], new, column[-1:]]) for column, new in zip(self, car, strict=True))
        )

    def is_beside_somebody(self, row: int) -> bool:
        """Return whether somebody lies alongside a row's vehicle in a lane that both are in."""
        distance = np.abs(self.x - self.x[row])
        distance[row] = math.inf
        lanes = {int(self.lane[row]), int(self.second_lane[row])}
        return any(
            not lanes.isdisjoint((int(self.lane[other]), int(self.second_lane[other])))
            for other in np.flatnonzero(distance < 0.5 * (self.length + self.length[row]))
        )
