"""The robot's motion: a bicycle in the world, told what to do in the road frame.

A control's ω is how fast the robot is to turn against the road, dθ/dt, everywhere: in planner, tracking, filter and
record. The wheels turn it against the world, so the road's own turning is added here, and nowhere else.
"""

import math

import numpy as np

from hj_cosim.scene.road import Road
from hj_cosim.settings import RobotSettings
from hj_cosim.vehicles.bicycle import bicycle_step


def yaw_rate(state: np.ndarray, omega: float, road: Road) -> float:
    """Return how fast the robot turns in the world, rad/s, to turn at `omega` against the road.

    Args:
        state: (4,) p_x, p_y (m), θ (rad), v (m/s) in the road frame.
        omega: rad/s.
        road: whose bend counts.
    """
    if road.is_straight:
        return omega
    along, lateral, heading, speed = state.tolist()
    return omega + road.bend_rate(along, lateral, speed * math.cos(heading))


def moved(
    state: np.ndarray, steering: float, acceleration: float, road: Road, robot: RobotSettings, step: float
) -> np.ndarray:
    """Return the robot's state (4,) in the road frame after a step of constant steering (rad) and acceleration (m/s²).

    Args:
        state: (4,) p_x, p_y (m), θ (rad), v (m/s) in the road frame.
        steering, acceleration: of the bicycle.
        road: the frame.
        robot: its wheelbase and top speed.
        step: s.
    """
    if road.is_straight:
        return np.asarray(bicycle_step(state, steering, acceleration, robot.wheelbase, robot.speed_max, step))
    along, lateral, heading, speed = state.tolist()
    world = np.array([*road.to_world(along, lateral, heading), speed])
    x, y, direction, speed = bicycle_step(
        world, steering, acceleration, robot.wheelbase, robot.speed_max, step
    ).tolist()
    return np.array([*road.from_world(x, y, direction, along), speed])
