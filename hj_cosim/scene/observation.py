"""What the robot sees at one instant, as arrays in the road frame, and what it means to do."""

import math
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

# m, rad and m/s: no road reaches farther, and nothing is faster. What is beyond is as broken as NaN.
FARTHEST = 1e7
NOBODY = -1  # in place of a car's number or index


class Cars(NamedTuple):
    """The J cars around the robot, as kernels take them; the arrays of an Observation."""

    vehicle: np.ndarray  # (J,) int, each car's number
    x: np.ndarray  # (J,) m
    y: np.ndarray  # (J,) m
    heading: np.ndarray  # (J,) rad
    speed: np.ndarray  # (J,) m/s
    length: np.ndarray  # (J,) m
    width: np.ndarray  # (J,) m


@dataclass(frozen=True)
class Observation:
    """The robot and the J cars around it at one instant; road frame, SI, positions are body centres.

    Cars keep their place in the arrays for as long as they are on the road, but may be in any order.
    """

    time: float  # s since the robot took over
    robot: np.ndarray  # (4,) p_x, p_y, θ, v (paper, z_r)
    robot_acceleration: float  # m/s²
    vehicle: np.ndarray  # (J,) int, each car's number; names are the world's business
    x: np.ndarray  # (J,) m
    y: np.ndarray  # (J,) m
    heading: np.ndarray  # (J,) rad
    speed: np.ndarray  # (J,) m/s
    acceleration: np.ndarray  # (J,) m/s²
    lane: np.ndarray  # (J,) int
    target_lane: np.ndarray  # (J,) int, where a change in progress leads; the lane itself otherwise
    length: np.ndarray  # (J,) m
    width: np.ndarray  # (J,) m
    # (J, 6) what can be expected of each driver by its vehicle, IDM's parameters in the order of vehicles.idm; None
    # where nothing tells them apart.
    expected_driver: np.ndarray | None = None

    @cached_property
    def cars(self) -> Cars:
        """Where the cars are, how they move and how large they are; the same arrays, together."""
        return Cars(self.vehicle, self.x, self.y, self.heading, self.speed, self.length, self.width)

    def within(self, distance: float) -> "Observation":
        """Return it with those cars alone that are within a distance of the robot, m, from centre to centre."""
        near = np.hypot(self.x - self.robot[0], self.y - self.robot[1]) <= distance
        return self if near.all() else self.only(near)

    def only(self, cars: np.ndarray) -> "Observation":
        """Return it with some cars alone, by a mask (J,)."""
        per_car = {each.name: getattr(self, each.name)[cars] for each in fields(self) if each.name not in _NOT_OF_CARS}
        expected = None if self.expected_driver is None else self.expected_driver[cars]
        return replace(self, **per_car, expected_driver=expected)


_NOT_OF_CARS = ("time", "robot", "robot_acceleration", "expected_driver")


@dataclass(frozen=True, slots=True)
class CarValues:
    """V of the J cars of an observation, looked up once a step for all who want it."""

    value: np.ndarray  # (J,) m; +inf for a car that is not within the table
    gradient: np.ndarray  # (J, 5) ∂V/∂(p_x, p_y, θ_r, v_r, v_o); 0 for a car that is not within the table
    least: float  # m, the least of them; +inf without cars, NaN where the observation or the table gives no number
    nearest: int  # the index of the car that has it; NOBODY if none is within the table

    @property
    def is_known(self) -> bool:
        """Whether the observation and the table gave numbers; else nothing about the cars can be said."""
        return not math.isnan(self.least)


@dataclass(frozen=True)
class Target:
    """The planner state that the tracking controller follows: x_r = (s_p, l_p, v_p) of the paper."""

    lane: int  # l_p
    speed: float  # v_p, m/s


@dataclass(frozen=True)
class Control:
    """A low-level control of the robot."""

    omega: float  # rad/s, ω_r, how fast it turns against the road: its yaw rate on a straight one
    acceleration: float  # m/s², a_r
