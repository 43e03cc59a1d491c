"""The robot before it takes over: a mean driver that keeps to its lane, so that the traffic settles around it."""

import math

import numpy as np

from hj_cosim.scene.observation import Observation
from hj_cosim.scene.road import Road
from hj_cosim.settings import DriverSettings
from hj_cosim.vehicles.idm import DESIRED_SPEED, idm_acceleration, mean_driver, within_limits


def robot_driver(settings: DriverSettings, desired_speed: float) -> np.ndarray:
    """Return the IDM parameters (6,) of the robot while the traffic settles: the mean ones, its own speed (m/s)."""
    driver = mean_driver(settings)
    driver[DESIRED_SPEED] = max(desired_speed, 0.1)  # IDM divides by it
    return driver


def follow_lane(
    observation: Observation, driver: np.ndarray, road: Road, length: float, step: float
) -> tuple[np.ndarray, float]:
    """Return the robot's state one step later, and its acceleration, when IDM drives it along its lane.

    Args:
        observation: the current instant.
        driver: (6,) the robot's IDM parameters.
        road: the road.
        length: of the robot, m.
        step: s.

    Returns:
        (4,) the next state, on the lane's centre line and along it, and the acceleration, m/s².
    """
    x, y, _, speed = observation.robot
    driver = within_limits(driver[np.newaxis], road.speed_limit(observation.robot[:1]))[0]
    lane = road.lane_at(y, x)
    distance = observation.x - x
    ahead = np.flatnonzero(((observation.lane == lane) | (observation.target_lane == lane)) & (distance > 0.0))
    if len(ahead):
        leader = ahead[np.argmin(distance[ahead])]
        gap = distance[leader] - 0.5 * (observation.length[leader] + length)
        acceleration = idm_acceleration(speed, gap, observation.speed[leader], driver)
    else:
        acceleration = idm_acceleration(speed, math.inf, 0.0, driver)
    next_speed = max(speed + acceleration * step, 0.0)
    next_x = x + next_speed * step / road.stretch_at(x, y)
    state = np.array([next_x, road.lane_centre(lane, next_x), 0.0, next_speed])
    return state, (next_speed - speed) / step
