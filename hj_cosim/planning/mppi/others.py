"""What the cars around the robot will do during a plan, once for all samples: IDM, in the lanes that they drive to.

They react to each other, and to the robot as it last planned to drive: a prediction for each sample of its own would
cost as many times as much. Nobody begins to change lanes; who sees nobody ahead keeps its speed, as in the tree search.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from hj_cosim.vehicles.idm import idm_acceleration

HARDEST_BRAKING = 9.0  # m/s², as in the tree search's prediction


class Others(NamedTuple):
    """The J cars at the instants of a plan, (T + 1, J), and their bodies, (J,)."""

    x: np.ndarray  # m
    y: np.ndarray  # m
    speed: np.ndarray  # m/s
    length: np.ndarray  # m
    width: np.ndarray  # m


class Habits(NamedTuple):
    """How the others are taken to drive."""

    drivers: np.ndarray  # (J, 6) IDM's parameters, as far as they can be known
    lateral_speed: float  # m/s, while they change lanes
    notice: float  # m between the lines of travel, nearer than which one follows another


@njit(cache=True, error_model="numpy")
def predict_others(
    now: Others, target_y: np.ndarray, robot: np.ndarray, robot_length: float, habits: Habits, step: float
) -> None:
    """Fill in the cars' motion from their first row on.

    Args:
        now: whose first rows say where they are.
        target_y: (J,) m, the centre lines that they drive to.
        robot: (T + 1, 4) p_x, p_y, θ, v, as it last planned to drive.
        robot_length: m.
        habits: how they drive.
        step: s, between two instants.
    """
    x, y, speed = now.x, now.y, now.speed
    for instant in range(len(x) - 1):
        for car in range(x.shape[1]):
            gap, lead_speed = math.inf, 0.0
            for other in range(x.shape[1]):
                ahead = x[instant, other] - x[instant, car]
                if ahead <= 0.0 or abs(y[instant, other] - y[instant, car]) >= habits.notice:
                    continue
                room = ahead - 0.5 * (now.length[other] + now.length[car])
                if room < gap:
                    gap, lead_speed = room, speed[instant, other]
            ahead = robot[instant, 0] - x[instant, car]
            if ahead > 0.0 and abs(robot[instant, 1] - y[instant, car]) < habits.notice:
                room = ahead - 0.5 * (robot_length + now.length[car])
                if room < gap:
                    gap, lead_speed = room, robot[instant, 3]
            acceleration = 0.0
            if gap < math.inf:
                wanted = idm_acceleration(speed[instant, car], gap, lead_speed, habits.drivers[car])
                acceleration = max(wanted, -HARDEST_BRAKING)
            later = max(speed[instant, car] + acceleration * step, 0.0)
            x[instant + 1, car] = x[instant, car] + 0.5 * (speed[instant, car] + later) * step
            speed[instant + 1, car] = later
            way = habits.lateral_speed * step
            here = y[instant, car]
            y[instant + 1, car] = min(max(target_y[car], here - way), here + way)
