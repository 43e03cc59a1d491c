"""Speed limits that change along the road, for planners: who comes to a lower one has braked when it begins.

SUMO's IDM brakes for it as for an obstacle that stands there, to which it leaves no minimum gap, and when it is nearer
than the gap that IDM keeps at the limit, as its driver finds comfortable.
"""

import math

import numpy as np

from hj_cosim.kernels import kernel
from hj_cosim.scene.road import Road
from hj_cosim.vehicles.idm import COMFORTABLE_DECELERATION, MAX_ACCELERATION, TIME_HEADWAY, idm_acceleration

NO_LIMITS = np.zeros((0, 2))
SEEN_FROM = 300.0  # m, from where on IDM brakes for a limit that it is 10 m/s too fast for
ROBOTS_BRAKING = 2.0  # m/s², of the robot on its way to a lower limit


def limits_in_sight(road: Road, along: float, sensing_range: float) -> np.ndarray:
    """Return where speed limits begin, m ahead of s, and what they are, m/s, (L, 2); none where they do not change.

    Args:
        road: the limits.
        along: s of the robot, m.
        sensing_range: m, within which others are predicted.
    """
    found = road.speed_limits(along - sensing_range, along + sensing_range + SEEN_FROM)
    return NO_LIMITS if len(found) < 2 else np.ascontiguousarray(found - [along, 0.0])


def fastest_within_limits(road: Road, along: float, speed: float, reaction: float) -> float:
    """Return how fast the robot may plan to be, m/s, so that it is as slow as every limit ahead says where it begins.

    Args:
        road: the limits.
        along, speed: of the robot, m and m/s.
        reaction: s until it plans again.
    """
    reach = 0.5 * speed * speed / ROBOTS_BRAKING + speed * reaction
    limits = road.speed_limits(along, along + reach)
    ahead = np.maximum(limits[:, 0] - along - speed * reaction, 0.0)
    return float(np.sqrt(limits[:, 1] ** 2 + 2.0 * ROBOTS_BRAKING * ahead).min())


@kernel
def slowed(acceleration: float, front: float, speed: float, driver: tuple[float, ...], limits: np.ndarray) -> float:
    """Return the acceleration of a car that minds the limits, m/s²: no more than it would have without.

    Args:
        acceleration: without limits, m/s².
        front: of its body, m ahead of where `limits` are counted from.
        speed: m/s.
        driver: IDM parameters.
        limits: (L, 2) where they begin, m, ascending, and what they are, m/s.
    """
    max_acceleration, deceleration = driver[MAX_ACCELERATION], driver[COMFORTABLE_DECELERATION]
    touching = (driver[0], max_acceleration, deceleration, driver[TIME_HEADWAY], 0.0, driver[5])
    for each in range(len(limits) - 1, -1, -1):
        begins, limit = limits[each, 0], limits[each, 1]
        if front >= begins:  # the one that holds here
            return min(acceleration, 0.0) if speed >= limit else acceleration
        if speed > limit:
            kept = limit * driver[TIME_HEADWAY] + limit * limit / (2.0 * math.sqrt(max_acceleration * deceleration))
            if begins - front < kept:
                acceleration = min(acceleration, -deceleration)
            else:
                acceleration = min(acceleration, idm_acceleration(speed, begins - front, 0.0, touching))
    return acceleration
