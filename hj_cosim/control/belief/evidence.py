"""What a car does against what an ordinary driver would do in its place (jitted).

An ordinary driver follows by IDM and changes lanes where MOBIL lets it. Of a car there are two things to be seen: its
acceleration, of which IDM with the parameters expected of its driver leaves a residual, and its motion across the road,
which is either none, or a change that those behind have room for, or one that takes their room.
"""

import math

import numpy as np
from numba import njit

from hj_cosim.scene.observation import Cars
from hj_cosim.vehicles.idm import idm_acceleration

# What a car does across the road.
KEEPS_LANE, CHANGES, AT_ODD_PACE, TAKES_ROOM = range(4)
MOVING = 0.25  # m/s across the road, from which on a car does not keep its lane
USUAL_PACE = (0.7, 1.6)  # m/s across the road, of a change of lane: of 3.5 m in 2 to 5 s
NOTICE = 0.6  # of a lane's width between two lines of travel, nearer than which one follows the other
BESIDE, REACH = 0.3, 1.1  # of a lane's width, between which to its side a change concerns others
FARTHEST_BEHIND = 100.0  # m
HARDEST_BRAKING = 9.0  # m/s², what SUMO's cars brake with at the most
SAFE_BRAKING = 4.0  # m/s², MOBIL's b_safe: no change asks more of who is behind


@njit(cache=True, error_model="numpy")
def evidence_of(
    robot: np.ndarray, robot_length: float, cars: Cars, acceleration: np.ndarray, drivers: np.ndarray, lane_width: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return what is seen of each car: its acceleration less IDM's, (J,) m/s², and what it does across the road, (J,).

    Args:
        robot: (4,) p_x, p_y, θ, v; cars follow it, and make room for it, as they do for each other.
        robot_length: m.
        cars: as observed.
        acceleration: (J,) m/s², as observed.
        drivers: (J + 1, 6) what is expected of the cars' drivers, in the order of `vehicles.idm`; the last row is of
            one in the robot's place.
        lane_width: m.
    """
    count = len(cars.x)
    residual, across = np.empty(count), np.zeros(count, np.int64)
    x, y, speed, length = cars.x, cars.y, cars.speed, cars.length
    notice = NOTICE * lane_width
    for j in range(count):
        gap, lead_speed = math.inf, 0.0
        if robot[0] > x[j] and abs(robot[1] - y[j]) < notice:
            gap, lead_speed = robot[0] - x[j] - 0.5 * (robot_length + length[j]), robot[3]
        for i in range(count):
            ahead = x[i] - x[j]
            if ahead > 0.0 and abs(y[i] - y[j]) < notice:
                room = ahead - 0.5 * (length[i] + length[j])
                if room < gap:
                    gap, lead_speed = room, speed[i]
        expected = max(idm_acceleration(speed[j], gap, lead_speed, drivers[j]), -HARDEST_BRAKING)
        residual[j] = acceleration[j] - expected
        sideways = speed[j] * math.sin(cars.heading[j])
        if abs(sideways) >= MOVING:
            braking = _braking_asked(j, sideways, robot, robot_length, cars, drivers, lane_width)
            usual = USUAL_PACE[0] <= abs(sideways) <= USUAL_PACE[1]
            across[j] = TAKES_ROOM if braking > SAFE_BRAKING else CHANGES if usual else AT_ODD_PACE
    return residual, across


@njit(cache=True, error_model="numpy")
def _braking_asked(
    j: int,
    sideways: float,
    robot: np.ndarray,
    robot_length: float,
    cars: Cars,
    drivers: np.ndarray,
    lane_width: float,
) -> float:
    """Return how hard those to whose line a car moves have to brake for it, at the most, m/s²."""
    asked = 0.0
    count = len(cars.x)
    for i in range(count + 1):
        if i == j:
            continue
        if i == count:
            x, y, speed, length = robot[0], robot[1], robot[3], robot_length
        else:
            x, y, speed, length = cars.x[i], cars.y[i], cars.speed[i], cars.length[i]
        ahead, aside = x - cars.x[j], y - cars.y[j]
        if aside * sideways <= 0.0 or not BESIDE * lane_width <= abs(aside) < REACH * lane_width:
            continue
        room = abs(ahead) - 0.5 * (length + cars.length[j])
        if room <= 0.0:
            return HARDEST_BRAKING
        if ahead < 0.0 and room < FARTHEST_BEHIND:
            asked = max(asked, -idm_acceleration(speed, room, cars.speed[j], drivers[i]))
    return asked
