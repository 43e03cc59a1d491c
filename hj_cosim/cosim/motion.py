"""The robot's motion: a bicycle in the world, told what to do in the road frame.

A control's ω is how fast the robot is to turn against the road, dθ/dt, everywhere: in planner, tracking, filter and
record. The wheels turn it against the world, so the road's own turning κ ds/dt is added here, and nowhere else.

So nobody else has to know of bends: on a bend the game of straight roads is played, with the same box |ω| <= ω̄ and
|v ω| <= what the tyres hold. In the world that is [−ω̄ + κ v, ω̄ + κ v], which the robot has if its own limits exceed
those that the table was solved for by |κ| v and |κ| v²: `robot.bend_rate_max` and `robot.bend_acceleration_max` say by
how much they do, and a road that asks for more is refused.
"""

import math

import numpy as np

from hj_cosim.errors import NetworkError
from hj_cosim.scene.observation import Target
from hj_cosim.scene.road import Road
from hj_cosim.settings import RobotSettings
from hj_cosim.vehicles.bicycle import bicycle_step

LEAVE_BEFORE = 4.0  # s before a lane ends, a robot that was to stay in it is told to leave it


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


def in_existing_lane(target: Target, state: np.ndarray, road: Road) -> Target:
    """Return the target itself, or the nearest lane in its place where its own does not exist, or ends in a moment.

    Args:
        target: of a planner, which may know nothing of lanes that end.
        state: (4,) p_x, p_y (m), θ (rad), v (m/s) in the road frame.
        road: the lanes.
    """
    along, ahead = float(state[0]), float(state[3]) * LEAVE_BEFORE
    if target.lane in road.lanes_at(along) and road.lane_end(target.lane, along) > along + ahead:
        return target
    first, last = road.lasting_lanes(state[:1], ahead)[0].tolist()
    if first > last:
        return target
    return Target(min(max(target.lane, first), last), target.speed)


def require_bends(road: Road, robot: RobotSettings, where: str) -> None:
    """Check that the robot can take a road's bends at its top speed, and still do all that its value table knows.

    Args:
        road: the road.
        robot: what it keeps for bends.
        where: what is to be named, the network.

    Raises:
        NetworkError: if a bend is too sharp.
    """
    fastest, sharpest = robot.speed_max, road.sharpest
    if sharpest == 0.0:
        return
    allowed = min(robot.bend_rate_max / sharpest, math.sqrt(robot.bend_acceleration_max / sharpest))
    if fastest > allowed:
        raise NetworkError(
            f"{where} has a bend of radius {1.0 / sharpest:.0f} m: at robot.speed_max = {fastest:g} m/s that takes"
            f" {sharpest * fastest:.3f} rad/s and {sharpest * fastest**2:.1f} m/s², but the value table leaves"
            f" {robot.bend_rate_max:g} rad/s and {robot.bend_acceleration_max:g} m/s² for bends (robot.bend_rate_max,"
            f" robot.bend_acceleration_max); take a robot.speed_max of {allowed:.1f} m/s or less, or another route"
        )
