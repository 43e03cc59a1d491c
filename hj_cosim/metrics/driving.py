"""How the robot drove among the others: headway, DRAC, RSS distances, V, and what it made the others do."""

import math

import numpy as np
from numba import njit

from hj_cosim.metrics.declared_paper import SAFE_TTC
from hj_cosim.metrics.jerk_and_turning import step_of
from hj_cosim.recording.record import RunRecord
from hj_cosim.settings import FilterSettings
from hj_cosim.vehicles.rss import lateral_distance, longitudinal_distance

HARD_BRAKE = -4.5  # m/s², what counts as a hard brake of another car
SLOWEST_HEADWAY = 1.0  # m/s, below this speed a time headway says nothing


def driving_metrics(record: RunRecord, settings: FilterSettings) -> dict[str, float]:
    """Return the metrics of the robot's driving among the others, by their names in `metrics.catalogue`.

    The leader is the nearest car ahead whose lateral extent overlaps the robot's; percentiles are samples.

    Args:
        record: the run.
        settings: of the filter: whose RSS distances count as violated, and from which ε a fall of V counts.
    """
    robot, traffic = record.robot, record.traffic
    states = np.column_stack([robot.x, robot.y, robot.heading, robot.speed])
    body = np.array([record.robot_length, record.robot_width])
    parameters = np.array(list(settings.rss.model_dump().values()))
    gap, drac = np.empty(len(states)), np.empty(len(states))
    violated = np.empty(len(states), np.bool_)
    imposed, counted = 0, np.zeros(len(traffic.names), np.bool_)
    for samples, cars, track in traffic.pieces():
        own, sizes = states[samples], (track.length, track.width)
        where = (track.present, track.x, track.y)
        gap[samples], drac[samples] = _following(own, body, *where, track.speed, *sizes)
        violated[samples] = _rss_violations(own, body, *where, track.heading, track.speed, *sizes, parameters)
        counted_here = counted[cars]
        imposed += _hard_brakes_behind(own, body, *where, track.acceleration, *sizes, counted_here)
        counted[:] = False  # who is not there does not brake
        counted[cars] = counted_here
    headway = np.where(robot.speed > SLOWEST_HEADWAY, gap / np.maximum(robot.speed, SLOWEST_HEADWAY), math.inf)
    return {
        "ttc_2d_ge_3": float(np.mean(record.threats.ttc_2d >= SAFE_TTC)),
        "headway_p10": float(np.percentile(headway, 10, method="lower")),
        "headway_min": float(headway.min()),
        "drac_p90": float(np.percentile(drac, 90, method="higher")),
        "drac_max": float(drac.max()),
        "min_gap_ahead": float(gap.min()),
        "hard_brakes_imposed": imposed,
        "time_value_le_0": round(step_of(record) * int(np.count_nonzero(robot.value <= 0.0)), 9),
        "value_fall": max(settings.epsilon - float(robot.value.min()), 0.0),
        "rss_violation_percent": 100.0 * float(violated.mean()),
        "off_road_samples": int(np.count_nonzero(_beyond_the_edge(record))),
    }


def _beyond_the_edge(record: RunRecord) -> np.ndarray:
    """Return (T,) bool, whether any corner of the robot's body is outside the outermost lanes."""
    robot, road = record.robot, record.road
    reach = 0.5 * (
        record.robot_length * np.abs(np.sin(robot.heading)) + record.robot_width * np.abs(np.cos(robot.heading))
    )
    lines = np.array([road.lane_lines(along)[[0, -1]] for along in robot.x.tolist()])
    return np.asarray((robot.y - reach < lines[:, 0]) | (robot.y + reach > lines[:, 1]))


# Plain loops, as in metrics: a pair is dismissed by one comparison.
@njit(cache=True)
def _following(
    robot: np.ndarray,
    body: np.ndarray,
    present: np.ndarray,
    x: np.ndarray,
    y: np.ndarray,
    speed: np.ndarray,
    length: np.ndarray,
    width: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Return (T,) the gap to the leader (m; +inf without, 0 where they overlap) and (T,) DRAC (m/s²)."""
    samples, cars = x.shape
    leader_gap = np.full(samples, math.inf)
    drac = np.zeros(samples)
    for t in range(samples):
        for j in range(cars):
            ahead = x[t, j] - robot[t, 0]
            if not present[t, j] or ahead <= 0.0 or abs(y[t, j] - robot[t, 1]) >= 0.5 * (body[1] + width[j]):
                continue
            gap = max(ahead - 0.5 * (body[0] + length[j]), 0.0)
            leader_gap[t] = min(leader_gap[t], gap)
            closing = robot[t, 3] - speed[t, j]
            if closing > 0.0:
                drac[t] = max(drac[t], closing * closing / (2.0 * gap) if gap > 0.0 else math.inf)
    return leader_gap, drac


# Ten parameters: plain arrays, which Numba keeps in registers, and of which nothing of shape (T, J) has to be made.
@njit(cache=True)
def _rss_violations(
    robot: np.ndarray,
    body: np.ndarray,
    present: np.ndarray,
    x: np.ndarray,
    y: np.ndarray,
    heading: np.ndarray,
    speed: np.ndarray,
    length: np.ndarray,
    width: np.ndarray,
    rss: np.ndarray,
) -> np.ndarray:
    """Return (T,) bool, whether any car is nearer than d_long and d_lat at once; `rss` in RssParameters' order."""
    samples, cars = x.shape
    response, acceleration, brake_min, brake_max = rss[0], rss[1], rss[2], rss[3]
    lateral_acceleration, lateral_brake, margin = rss[4], rss[5], rss[6]
    violated = np.zeros(samples, np.bool_)
    for t in range(samples):
        robot_speed = robot[t, 3]
        robot_lateral = robot_speed * math.sin(robot[t, 2])
        for j in range(cars):
            if not present[t, j]:
                continue
            dx, dy = x[t, j] - robot[t, 0], y[t, j] - robot[t, 1]
            lateral_gap = abs(dy) - 0.5 * (body[1] + width[j])
            # At the same place the robot counts as the rear car, as it does to the RSS filter.
            rear_speed, front_speed = (robot_speed, speed[t, j]) if dx >= 0.0 else (speed[t, j], robot_speed)
            longitudinal_gap = abs(dx) - 0.5 * (body[0] + length[j])
            if longitudinal_gap >= longitudinal_distance(
                rear_speed, front_speed, response, acceleration, brake_min, brake_max
            ):
                continue
            other_lateral = speed[t, j] * math.sin(heading[t, j])
            # The left car's lateral speed counts to the right, the right car's to the left.
            left_speed, right_speed = (-other_lateral, robot_lateral) if dy > 0.0 else (-robot_lateral, other_lateral)
            if lateral_gap < lateral_distance(
                left_speed,
                right_speed,
                response,
                lateral_acceleration,
                lateral_brake,
                response,
                lateral_acceleration,
                lateral_brake,
                margin,
            ):
                violated[t] = True
                break
    return violated


# Nine parameters: as above.
@njit(cache=True)
def _hard_brakes_behind(
    robot: np.ndarray,
    body: np.ndarray,
    present: np.ndarray,
    x: np.ndarray,
    y: np.ndarray,
    acceleration: np.ndarray,
    length: np.ndarray,
    width: np.ndarray,
    counted: np.ndarray,
) -> int:
    """Return how many times a car braked harder than HARD_BRAKE with the robot as its leader, at least for a sample.

    One braking counts once, however often the robot leaves and enters the car's way meanwhile. Which cars were at it
    at the sample before, and have been counted, `counted` (J,), is changed to which are at the last one.
    """
    samples, cars = x.shape
    count = 0
    for t in range(samples):
        for j in range(cars):
            if not present[t, j] or acceleration[t, j] > HARD_BRAKE:
                counted[j] = False
                continue
            behind_robot = (
                x[t, j] < robot[t, 0]
                and abs(y[t, j] - robot[t, 1]) < 0.5 * (body[1] + width[j])
                and _nobody_between(j, x[t], y[t], width, present[t], robot[t, 0])
            )
            if behind_robot and not counted[j]:
                count += 1
                counted[j] = True
    return count


@njit(cache=True)
def _nobody_between(
    car: int, x: np.ndarray, y: np.ndarray, width: np.ndarray, present: np.ndarray, robot_x: float
) -> bool:
    for other in range(len(x)):
        between = present[other] and x[car] < x[other] < robot_x
        if between and abs(y[other] - y[car]) < 0.5 * (width[other] + width[car]):
            return False
    return True
