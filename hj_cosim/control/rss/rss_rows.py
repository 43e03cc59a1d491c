"""The RSS baseline: the proper response (Shalev-Shwartz, Shammah, Shashua 2017) as rows of the filter's problem.

A car is *dangerous* when both of its distances to the robot, bumper to bumper, are below the RSS distances
(`vehicles.rss`). Which direction responds is remembered per pair, as the ad-rss library does: of the last instant at
which the pair was not dangerous, each direction that was safe then responds now (it is the one that was lost); a pair
that is dangerous from its first sight on responds in both. Memory alone never brakes after a cut-in from the side, so
the longitudinal response is also given whenever the bodies overlap laterally.

The responses, with the robot's v_x = v cosθ and v_y = v sinθ, so that v̇_x = a cosθ − ω v sinθ and
v̇_y = a sinθ + ω v cosθ:

| response                            | demand           | row p ω + q a + c >= 0                       |
|-------------------------------------|------------------|----------------------------------------------|
| longitudinal, robot behind          | v̇_x <= −b_min    | p = v sinθ,  q = −cosθ, c = −b_min           |
| longitudinal, robot ahead           | v̇_x >= −b_max    | p = −v sinθ, q = cosθ,  c = b_max            |
| lateral, other on the left          | v̇_y <= −b_lat    | p = −v cosθ, q = −sinθ, c = −b_lat           |
| lateral, other on the right         | v̇_y >= b_lat     | p = v cosθ,  q = sinθ,  c = −b_lat           |

Near θ = 0 each bounds one control alone: RSS is a box, where the HJI rows are slanted half-planes. All four are in
m/s², so they share the slack t fairly. As in ad-rss the lateral response pushes away at b_lat from the start, also a
robot that has no lateral speed.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from hj_cosim.scene.observation import FARTHEST, Cars
from hj_cosim.settings import RssParameters
from hj_cosim.vehicles.rss import lateral_distance, longitudinal_distance

# What is remembered of a pair, as bits.
LONGITUDINALLY_SAFE = 1
LATERALLY_SAFE = 2
NEVER_SEEN = LONGITUDINALLY_SAFE | LATERALLY_SAFE  # both directions respond


class RssDistances(NamedTuple):
    """What the RSS distances depend on: `RssParameters` as kernels take them."""

    response_time: float
    acceleration: float
    brake_min: float
    brake_max: float
    lateral_acceleration: float
    lateral_brake: float
    lateral_margin: float

    @classmethod
    def of(cls, parameters: RssParameters) -> "RssDistances":
        """Return the parameters of a configuration."""
        return cls(**parameters.model_dump())


@njit(cache=True)
def pair_safety(robot: np.ndarray, robot_size: np.ndarray, cars: Cars, j: int, rss: RssDistances) -> int:
    """Return which directions are safe between the robot and a car: bits LONGITUDINALLY_SAFE, LATERALLY_SAFE.

    Args:
        robot: (4,) p_x, p_y (m), θ (rad), v (m/s).
        robot_size: (2,) length and width, m.
        cars: the other cars.
        j: the index of the one.
        rss: parameters, the same for both cars.
    """
    safe = 0
    d_x, d_y = robot[0] - cars.x[j], robot[1] - cars.y[j]
    speed, heading = cars.speed[j], cars.heading[j]
    robot_along, other_along = robot[3] * math.cos(robot[2]), speed * math.cos(heading)
    # At the same place the robot counts as the rear car, which has the duty to brake.
    rear, front = (other_along, robot_along) if d_x > 0.0 else (robot_along, other_along)
    needed = longitudinal_distance(rear, front, rss.response_time, rss.acceleration, rss.brake_min, rss.brake_max)
    if abs(d_x) - 0.5 * (robot_size[0] + cars.length[j]) > needed:
        safe |= LONGITUDINALLY_SAFE
    robot_across, other_across = robot[3] * math.sin(robot[2]), speed * math.sin(heading)
    # Speeds towards each other: the left car's to the right, the right car's to the left.
    left, right = (-robot_across, other_across) if d_y > 0.0 else (-other_across, robot_across)
    needed = lateral_distance(
        left,
        right,
        rss.response_time,
        rss.lateral_acceleration,
        rss.lateral_brake,
        rss.response_time,
        rss.lateral_acceleration,
        rss.lateral_brake,
        rss.lateral_margin,
    )
    if abs(d_y) - 0.5 * (robot_size[1] + cars.width[j]) > needed:
        safe |= LATERALLY_SAFE
    return safe


@njit(cache=True)
def rss_rows(
    robot: np.ndarray,
    robot_size: np.ndarray,
    cars: Cars,
    rss: RssDistances,
    memory: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, int]:
    """Return the proper response's rows and how many cars are dangerous; updates the memory.

    Args:
        robot: (4,) p_x, p_y (m), θ (rad), v (m/s).
        robot_size: (2,) length and width, m.
        cars: the other cars, all finite; their numbers are their places in the memory.
        rss: parameters.
        memory: (N,) int, which directions were safe when pair n was last not dangerous; written.

    Returns:
        (R,) int, the car of each row (a car has up to two); (3, R) the rows' p, q, c; the dangerous cars' number,
        −1 if a body is not possible.
    """
    x, y, length, width = cars.x, cars.y, cars.length, cars.width
    whose = np.empty(2 * len(x), dtype=np.int64)
    rows = np.empty((3, 2 * len(x)))
    count, dangerous = 0, 0
    cos, sin = math.cos(robot[2]), math.sin(robot[2])
    for j in range(len(x)):
        if not (0.0 <= length[j] <= FARTHEST and 0.0 <= width[j] <= FARTHEST):
            return whose[:0], rows[:, :0], -1
    for j in range(len(x)):
        safe = pair_safety(robot, robot_size, cars, j, rss)
        if safe != 0:
            memory[cars.vehicle[j]] = safe
            continue
        dangerous += 1
        before = memory[cars.vehicle[j]]
        d_y = robot[1] - y[j]
        overlapping = abs(d_y) < 0.5 * (robot_size[1] + width[j])
        if before & LONGITUDINALLY_SAFE or overlapping:
            sign = 1.0 if robot[0] > x[j] else -1.0
            whose[count] = j
            rows[0, count] = -sign * robot[3] * sin
            rows[1, count] = sign * cos
            rows[2, count] = rss.brake_max if sign > 0.0 else -rss.brake_min
            count += 1
        if before & LATERALLY_SAFE:
            sign = 1.0 if d_y > 0.0 else -1.0
            whose[count] = j
            rows[0, count] = sign * robot[3] * cos
            rows[1, count] = sign * sin
            rows[2, count] = -rss.lateral_brake
            count += 1
    return whose[:count], rows[:, :count], dangerous
