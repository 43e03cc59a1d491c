"""What every rogue respects: the road, its car's limits, and everybody but the robot."""

import math
from typing import NamedTuple

import numpy as np

from hj_cosim.scene.observation import Observation
from hj_cosim.scene.road import Road
from hj_cosim.settings import RogueLimits
from hj_cosim.traffic.rogues.contract import CarInput
from hj_cosim.traffic.rogues.neighbours import acceleration_behind_all, car_ahead, room_beside
from hj_cosim.traffic.rogues.steering import LATERAL_RATE, LEAST_SPEED
from hj_cosim.vehicles.idm import DESIRED_SPEED, MAX_ACCELERATION, MINIMUM_GAP, TIME_HEADWAY, idm_acceleration

FASTEST = 40.0  # m/s, the largest speed of the game of `highway`
# A rogue follows others than the robot more closely than an ordinary driver does.
CLOSE_HEADWAY, CLOSE_GAP = 0.5, 2.0  # s, m
UNHURRIED = 1000.0  # m/s, a desired speed at which IDM is about the car ahead alone
SIDE_ROOM = 0.8  # m beside another car's side, which it leaves
END_ROOM = 2.0  # m before a lane's end


class OwnCar(NamedTuple):
    """A rogue's car among those of an observation."""

    row: int
    driver: np.ndarray  # (6,) IDM parameters, as of any other driver


def ordinary_input(observation: Observation, car: OwnCar, road: Road, robot_length: float) -> CarInput:
    """Return what an ordinary driver would do: along its lane's centre line, by IDM behind whoever is ahead.

    Args:
        observation: the robot and all cars.
        car: whose.
        road: the lanes.
        robot_length: m.
    """
    x, y, speed = (float(each[car.row]) for each in (observation.x, observation.y, observation.speed))
    reach = 0.5 * road.lane_width
    gap, lead_speed = car_ahead(observation.cars, car.row, reach)
    to_end = _to_end(observation, car.row, road)
    if to_end < gap:
        gap, lead_speed = to_end, 0.0
    robot_x, robot_y, _, robot_speed = observation.robot.tolist()
    robot_gap = robot_x - x - 0.5 * (robot_length + float(observation.length[car.row]))
    if robot_x > x and abs(robot_y - y) < reach and robot_gap < gap:
        gap, lead_speed = robot_gap, robot_speed
    across = LATERAL_RATE * (road.lane_centre(road.lane_at(y, x), x) - y)
    return CarInput(_heading(across, speed), float(idm_acceleration(speed, gap, lead_speed, car.driver)))


def restrained(wanted: CarInput, observation: Observation, car: OwnCar, road: Road, limits: RogueLimits) -> CarInput:
    """Return the nearest to what a rogue wants that keeps it on the road, within its limits and off other cars.

    Args:
        wanted: any finite input.
        observation: the robot and all cars; the robot counts for nothing here.
        car: whose.
        road: the lanes.
        limits: what its car can.
    """
    me = car.row
    x, y, speed = (float(each[me]) for each in (observation.x, observation.y, observation.speed))
    width = float(observation.width[me])
    heading = max(min(wanted.heading, limits.heading), -limits.heading)
    lines = road.lane_lines(x)
    lowest, highest = float(lines[0]) + 0.5 * width, float(lines[-1]) - 0.5 * width
    right, left = room_beside(observation.cars, me, CLOSE_GAP)
    lowest, highest = max(lowest, y - (right - SIDE_ROOM)), min(highest, y + (left - SIDE_ROOM))
    most, least = (_heading(LATERAL_RATE * (bound - y), speed) for bound in (highest, lowest))
    heading = max(min(heading, most), least) if least <= most else 0.0
    close = car.driver.copy()
    close[TIME_HEADWAY], close[MINIMUM_GAP] = CLOSE_HEADWAY, CLOSE_GAP
    close[DESIRED_SPEED], close[MAX_ACCELERATION] = UNHURRIED, limits.acceleration
    # Whoever stands, in the other of two lanes that it is in, counts for more than a nearer one who is fast.
    reach = 0.5 * (width + float(observation.width.max())) + 0.3
    followed = acceleration_behind_all(observation.cars, me, reach, _to_end(observation, me, road), close)
    acceleration = min(wanted.acceleration, followed)
    acceleration = max(min(acceleration, limits.acceleration), -limits.braking)
    return CarInput(max(min(heading, limits.heading), -limits.heading), acceleration)


def moved(state: np.ndarray, wanted: CarInput, limits: RogueLimits, step: float) -> tuple[np.ndarray, float]:
    """Return a rogue's state a step later, and its acceleration (m/s²) on the way.

    It moves across as the game's other car does, dp_y = v sin θ_o, and along as SUMO's do, dp_x = v, half a percent
    more than v cos θ_o at 0.1 rad. Its heading turns no faster than its limits say.

    Args:
        state: (4,) p_x, p_y (m), θ (rad), v (m/s), in the road frame.
        wanted: restrained.
        limits: what its car can.
        step: s.
    """
    x, y, heading, speed = state.tolist()
    turn = limits.turn_rate * step
    later_heading = heading + max(min(wanted.heading - heading, turn), -turn)
    later_speed = max(min(speed + wanted.acceleration * step, FASTEST), 0.0)
    way, direction = 0.5 * (speed + later_speed) * step, 0.5 * (heading + later_heading)
    later = np.array([x + way, y + way * math.sin(direction), later_heading, later_speed])
    return later, (later_speed - speed) / step


def _heading(across: float, speed: float) -> float:
    return math.asin(max(min(across / max(speed, LEAST_SPEED), 1.0), -1.0))


def _to_end(observation: Observation, me: int, road: Road) -> float:
    """Return how far it is to where the lane ends, m; inf where it does not."""
    x, y, length = (float(each[me]) for each in (observation.x, observation.y, observation.length))
    return road.lane_end(road.lane_at(y, x), x) - x - 0.5 * length - END_ROOM
