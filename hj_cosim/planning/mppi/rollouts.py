"""Drives the robot by many sequences of controls at once, and says what each is worth (jitted)."""

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from hj_cosim.planning.mppi.others import Others
from hj_cosim.planning.mppi.shield import Shield, held_acceleration
from hj_cosim.planning.optimistic.reward import RewardModel, total_reward
from hj_cosim.reachability.table.lookup import value_at
from hj_cosim.reachability.table.size_classes import class_of, offsets_in_class
from hj_cosim.reachability.table.stack import TableStack, grid_in

# Cars are looked up in V ahead and behind, in the robot's own lane and those beside it: the nearest of each.
_PLACES = 6
_NO_CAR = -1


class RobotModel(NamedTuple):
    """What the robot can, and the road that it has to keep to."""

    length: float  # m
    width: float  # m
    omega_max: float  # rad/s
    acceleration_min: float  # m/s²
    acceleration_max: float  # m/s²
    lateral_acceleration_max: float  # m/s², of |v ω|
    speed_max: float  # m/s
    heading_max: float  # rad, beyond which no plan goes
    lane_width: float  # m
    lane_count: int


class Costs(NamedTuple):
    """What is subtracted from the reward, a second, in its own unit."""

    turning: float  # of (v ω)², m²/s⁴
    acceleration: float  # of a², m²/s⁴
    jerk: float  # of the change of a from one instant to the next, squared, m²/s⁴


class Outlook(NamedTuple):
    """What all samples of a plan have in common."""

    others: Others
    reward: RewardModel
    costs: Costs
    robot: RobotModel
    step: float  # s
    discount: float  # of a step


@njit(cache=True, error_model="numpy")
def held(controls: np.ndarray, speed: float, robot: RobotModel) -> tuple[float, float]:
    """Return ω and a of (2,), within what the robot and its tyres can at a speed (m/s)."""
    turning = min(robot.omega_max, robot.lateral_acceleration_max / max(speed, 1e-3))
    omega = min(max(controls[0], -turning), turning)
    return omega, min(max(controls[1], robot.acceleration_min), robot.acceleration_max)


@njit(cache=True, error_model="numpy")
def drive(state: np.ndarray, controls: np.ndarray, path: np.ndarray, robot: RobotModel, step: float) -> None:
    """Write the states (T + 1, 4) that controls (T, 2) lead to, held to what the robot can; `controls` is held too."""
    for axis in range(4):  # `path[0] = state` would take 3 s more to compile
        path[0, axis] = state[axis]
    for instant in range(len(controls)):
        _advance(path, controls, instant, robot, step)


@njit(cache=True, error_model="numpy")
def _advance(path: np.ndarray, controls: np.ndarray, instant: int, robot: RobotModel, step: float) -> None:
    x, y, heading, speed = path[instant]
    omega, acceleration = held(controls[instant], speed, robot)
    later_heading = min(max(heading + omega * step, -robot.heading_max), robot.heading_max)
    later = min(max(speed + acceleration * step, 0.0), robot.speed_max)
    way, direction = 0.5 * (speed + later) * step, 0.5 * (heading + later_heading)
    path[instant + 1, 0] = x + way * math.cos(direction)
    path[instant + 1, 1] = y + way * math.sin(direction)
    path[instant + 1, 2] = later_heading
    path[instant + 1, 3] = later
    controls[instant, 0] = (later_heading - heading) / step
    controls[instant, 1] = (later - speed) / step


@njit(cache=True, error_model="numpy")
def drive_shielded(
    state: np.ndarray, controls: np.ndarray, path: np.ndarray, outlook: Outlook, tables: TableStack, shield: Shield
) -> None:
    """Write the states as `drive` does, each acceleration held to what the rows of the nearest cars leave.

    Args:
        state, controls, path: as `drive` takes them.
        outlook: the robot and the others.
        tables: V.
        shield: what is kept.
    """
    for axis in range(4):
        path[0, axis] = state[axis]
    nearest, robot = np.empty(_PLACES, np.int64), outlook.robot
    for instant in range(len(controls)):
        here = path[instant]
        _find_nearest(here[0], here[1], outlook.others, instant, robot.lane_width, nearest)
        omega, asked = held(controls[instant], here[3], robot)
        controls[instant, 1] = held_acceleration(here, outlook.others, instant, nearest, omega, asked, tables, shield)
        _advance(path, controls, instant, robot, outlook.step)


@njit(cache=True, error_model="numpy")
def worth(path: np.ndarray, controls: np.ndarray, outlook: Outlook, tables: TableStack) -> float:
    """Return the sum of discounted rewards of a path, less what its controls cost; nothing comes after a crash.

    Args:
        path: (T + 1, 4) states.
        controls: (T, 2) ω, a that lead along it.
        outlook: the others, and what counts.
        tables: V, not looked up where the reward has no part of it.
    """
    robot, others, step = outlook.robot, outlook.others, outlook.step
    lowest = -0.5 * (robot.lane_width - robot.width)
    highest = (robot.lane_count - 1) * robot.lane_width - lowest
    looks, numbers = outlook.reward.gamma_r < 1.0, tables.numbers
    grid, tabled = grid_in(numbers, 0), 0
    nearest = np.empty(_PLACES, np.int64)
    total, weight, before = 0.0, step, controls[0, 1]
    for instant in range(1, len(path)):
        x, y, heading, speed = path[instant]
        if y < lowest or y > highest or _touches(x, y, others, instant, robot):
            return total
        least = math.inf
        if looks:
            _find_nearest(x, y, others, instant, robot.lane_width, nearest)
            for place in range(_PLACES):
                car = nearest[place]
                if car != _NO_CAR:
                    length, width = others.length[car], others.width[car]
                    kind = class_of(numbers, length, width)
                    if kind != tabled:
                        grid, tabled = grid_in(numbers, kind), kind
                    p_x, p_y = offsets_in_class(
                        numbers, kind, x - others.x[instant, car], y - others.y[instant, car], length, width
                    )
                    value = value_at(tables.flat, grid, p_x, p_y, heading, speed, others.speed[instant, car])
                    least = min(least, value)
        omega, acceleration = controls[instant - 1]
        change = acceleration - before
        before = acceleration
        cost = (
            outlook.costs.turning * (speed * omega) ** 2
            + outlook.costs.acceleration * acceleration**2
            + outlook.costs.jerk * change**2
        )
        reward = total_reward(speed, y / robot.lane_width, False, least, outlook.reward)
        total += weight * (reward - cost)
        weight *= outlook.discount
    return total


@njit(cache=True, error_model="numpy")
def _touches(x: float, y: float, others: Others, instant: int, robot: RobotModel) -> bool:
    for car in range(others.x.shape[1]):
        if (
            abs(others.x[instant, car] - x) < 0.5 * (others.length[car] + robot.length)
            and abs(others.y[instant, car] - y) < 0.5 * (others.width[car] + robot.width)
        ):  # fmt: skip
            return True
    return False


@njit(cache=True, error_model="numpy")
def _find_nearest(x: float, y: float, others: Others, instant: int, lane_width: float, nearest: np.ndarray) -> None:
    """Write the nearest car ahead and behind in the robot's lane and beside it, _NO_CAR where there is none."""
    nearest[:] = _NO_CAR
    for car in range(others.x.shape[1]):
        aside = (others.y[instant, car] - y) / lane_width
        if abs(aside) >= 1.5:
            continue
        ahead = others.x[instant, car] - x
        place = 2 * (1 + (1 if aside > 0.5 else -1 if aside < -0.5 else 0)) + (1 if ahead > 0.0 else 0)
        if nearest[place] == _NO_CAR or abs(ahead) < abs(others.x[instant, nearest[place]] - x):
            nearest[place] = car


@njit(cache=True, error_model="numpy", nogil=True)
def judge(
    state: np.ndarray,
    controls: np.ndarray,
    outlook: Outlook,
    tables: TableStack,
    shield: Shield,
    worths: np.ndarray,
    ends: np.ndarray,
) -> None:
    """Drive all samples, and write what each is worth, and the lane in which it ends.

    Args:
        state: (4,) of the robot now.
        controls: (K, T, 2) ω (rad/s) and a (m/s²) of each sample; held to what the robot can.
        outlook: what all have in common.
        tables: V.
        shield: what the samples are held to, if to anything.
        worths: (K,) to be written.
        ends: (K,) int, to be written.
    """
    path = np.empty((controls.shape[1] + 1, 4))
    robot = outlook.robot
    for sample in range(len(controls)):
        if len(shield.numbers) > 0:
            drive_shielded(state, controls[sample], path, outlook, tables, shield)
        else:
            drive(state, controls[sample], path, robot, outlook.step)
        worths[sample] = worth(path, controls[sample], outlook, tables)
        lane = math.floor(path[-1, 1] / robot.lane_width + 0.5)
        ends[sample] = min(max(lane, 0), robot.lane_count - 1)


@njit(cache=True, error_model="numpy")
def follow_lanes(
    state: np.ndarray, lanes: np.ndarray, speeds: np.ndarray, robot: RobotModel, step: float, controls: np.ndarray
) -> None:
    """Write controls (N, T, 2) that lead to lanes (N,) and speeds (N,), m/s: what samples are drawn around."""
    for sample in range(len(controls)):
        y, heading, speed = state[1], state[2], state[3]
        for instant in range(controls.shape[1]):
            off_centre = y - lanes[sample] * robot.lane_width
            across = min(max(-1.2 * off_centre, -2.5), 2.5)
            wanted = math.asin(min(max(across / max(speed, 1.0), -0.3), 0.3))
            controls[sample, instant, 0] = 2.0 * (wanted - heading)
            controls[sample, instant, 1] = 0.8 * (speeds[sample] - speed)
            omega, acceleration = held(controls[sample, instant], speed, robot)
            later, later_heading = max(speed + acceleration * step, 0.0), heading + omega * step
            y += 0.5 * (speed + later) * step * math.sin(0.5 * (heading + later_heading))
            heading, speed = later_heading, later
