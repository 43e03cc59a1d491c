"""What background traffic is like: flow, density, speed, lane changes, time headways, TTC; the robot is left out.

Flow, density and speed are Edie's, distance and time travelled in a region over its area (Edie 1963), where the region
moves with the middle four fifths of the cars: beyond these a platoon thins out, as no traffic does.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np

from hj_cosim.scene.observation import Observation
from hj_cosim.scene.road import Road

MIDDLE = (0.1, 0.9)  # of the cars, from rear to front
FOLLOWING = 100.0  # m, who has another within this gap ahead is following it
CRITICAL_TTC = 3.0  # s, the paper's
SHORT_HEADWAY = 0.9  # s
_ROBOT = -1
_LANES_EVERY = 5.0  # m of a road, for how many lanes it has there


@dataclass(frozen=True)
class TrafficMeasures:
    """The measures of some traffic; NaN where nobody followed anybody."""

    flow: float  # vehicles/h and lane
    density: float  # vehicles/km and lane
    speed: float  # m/s, distance over time travelled
    lane_changes: float  # per vehicle-km
    headway_median: float  # s from the front bumper to the rear one ahead, of those who follow
    short_headway_percent: float  # share of those below SHORT_HEADWAY
    ttc_p1: float  # s, the 1st percentile of those who follow and close in
    critical_ttc_percent: float  # share of those who follow whose TTC is below CRITICAL_TTC


@dataclass
class _Sums:
    time: float = 0.0  # vehicle-seconds in the region
    distance: float = 0.0  # vehicle-metres in the region
    area: float = 0.0  # lane-metre-seconds
    driven: float = 0.0  # vehicle-metres anywhere
    changes: int = 0
    headways: list[np.ndarray] = field(default_factory=list)
    times_to_collision: list[np.ndarray] = field(default_factory=list)


@dataclass(frozen=True)
class Lanes:
    """How much lane there is up to each of some places on a road, where lanes may begin and end."""

    along: np.ndarray  # (N,) m of s, ascending
    metres: np.ndarray  # (N,) lane-metres up to there

    @classmethod
    def of(cls, road: Road) -> "Lanes":
        """Return a road's; on a closed one cars may be up to a lap behind s = 0."""
        along = np.arange(-road.lap, road.length + _LANES_EVERY, _LANES_EVERY)
        there = np.array([len(road.lanes_at(min(place, road.length))) for place in along[:-1] + 0.5 * _LANES_EVERY])
        return cls(along, np.append(0.0, np.cumsum(there * _LANES_EVERY)))

    def between(self, rear: float, front: float) -> float:
        """Return the lane-metres between two places, m of s."""
        first, last = np.interp([rear, front], self.along, self.metres)
        return float(last - first)


def measure_traffic(drives: Iterable[Iterable[Observation]], step: float, road: Road) -> TrafficMeasures:
    """Return the measures of one or several drives together.

    Args:
        drives: each one's observations, evenly spaced, with two cars or more.
        step: s from one to the next.
        road: the drives'.
    """
    sums, lanes = _Sums(), Lanes.of(road)
    for observations in drives:
        lane_before: dict[int, int] = {}
        for now in observations:
            _add_region(sums, now, step, lanes)
            _add_lanes(sums, now, step, lane_before)
            _add_pairs(sums, now, road)
    headways = np.concatenate(sums.headways)
    ttc = np.concatenate(sums.times_to_collision)
    closing = ttc[np.isfinite(ttc)]
    nobody = len(headways) == 0
    return TrafficMeasures(
        flow=3600.0 * sums.distance / sums.area,
        density=1000.0 * sums.time / sums.area,
        speed=sums.distance / sums.time,
        lane_changes=1000.0 * sums.changes / sums.driven,
        headway_median=float("nan") if nobody else float(np.median(headways)),
        short_headway_percent=float("nan") if nobody else 100.0 * float(np.mean(headways < SHORT_HEADWAY)),
        ttc_p1=float(np.percentile(closing, 1.0)) if len(closing) else float("nan"),
        critical_ttc_percent=float("nan") if nobody else 100.0 * float(np.mean(ttc < CRITICAL_TTC)),
    )


def _add_region(sums: _Sums, now: Observation, step: float, lanes: Lanes) -> None:
    rear, front = np.quantile(now.x, MIDDLE)
    inside = (now.x >= rear) & (now.x <= front)
    sums.area += lanes.between(rear, front) * step
    sums.time += step * int(inside.sum())
    sums.distance += step * float(now.speed[inside].sum())


def _add_lanes(sums: _Sums, now: Observation, step: float, lane_before: dict[int, int]) -> None:
    for vehicle, lane in zip(now.vehicle.tolist(), now.lane.tolist(), strict=True):
        sums.changes += lane_before.get(vehicle, lane) != lane
        lane_before[vehicle] = lane
    sums.driven += step * float(now.speed.sum())


def _add_pairs(sums: _Sums, now: Observation, road: Road) -> None:
    """Add everybody's headway to, and TTC with, the car ahead in its lane; where that is the robot, nothing."""
    number = np.append(now.vehicle, _ROBOT)
    robot_x, robot_y, _, robot_speed = now.robot.tolist()
    lane = np.append(now.lane, road.lane_at(robot_y, robot_x))
    x, length = np.append(now.x, robot_x), np.append(now.length, 0.0)
    speed = np.append(now.speed, robot_speed)
    order = np.lexsort((x, lane))
    rear, front = order[:-1], order[1:]
    gap = x[front] - x[rear] - 0.5 * (length[front] + length[rear])
    follows = (lane[rear] == lane[front]) & (number[rear] != _ROBOT) & (number[front] != _ROBOT)
    follows &= (gap < FOLLOWING) & (speed[rear] > 0.1)
    rear, front, gap = rear[follows], front[follows], np.maximum(gap[follows], 0.0)
    closing = speed[rear] - speed[front]
    sums.headways.append(gap / speed[rear])
    sums.times_to_collision.append(np.where(closing > 0.0, gap / np.where(closing > 0.0, closing, 1.0), np.inf))
