"""Collisions by kind, and whether the robot was responsible for them by RSS."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np

from hj_cosim.metrics.threats import touching
from hj_cosim.recording.record import RunRecord
from hj_cosim.settings import RssParameters
from hj_cosim.vehicles.rss import lateral_distance, longitudinal_distance

# m/s, RSS's μ-lateral velocity: who moves no faster towards another does not move towards it.
KEEPING_ITS_PLACE = 0.05

Kind = Literal["into_other", "into_robot", "side"]


@dataclass(frozen=True)
class Collision:
    """The beginning of an overlap of the robot's body with a car's."""

    sample: int
    car: int
    kind: Kind
    robot_is_responsible: bool


@dataclass(frozen=True)
class _Pair:
    """The robot and one car up to a collision; T samples in which the car is present, the collision's the last."""

    dx: np.ndarray  # (T,) m, the car's centre ahead of the robot's
    dy: np.ndarray  # (T,) m, to the left of it
    robot_speed: np.ndarray  # (T,) m/s
    car_speed: np.ndarray
    robot_lateral: np.ndarray  # (T,) m/s, to the left
    car_lateral: np.ndarray
    mean_length: float  # m, of the two
    mean_width: float

    @property
    def gap(self) -> np.ndarray:
        """Return (T,) bumper to bumper, m; negative where they overlap lengthwise."""
        return np.abs(self.dx) - self.mean_length

    @property
    def lateral_gap(self) -> np.ndarray:
        """Return (T,) side to side, m; negative where they overlap sideways."""
        return np.abs(self.dy) - self.mean_width


def collision_metrics(record: RunRecord, rss: RssParameters) -> dict[str, int]:
    """Return how many collisions there were, in all and of each kind, by their names in `metrics.catalogue`."""
    collisions = find_collisions(record, rss)
    kinds = {kind: sum(each.kind == kind for each in collisions) for kind in ("into_other", "into_robot", "side")}
    return {
        "collisions": len(collisions),
        **{f"collisions_{kind}": count for kind, count in kinds.items()},
        "collisions_responsible": sum(each.robot_is_responsible for each in collisions),
    }


def find_collisions(record: RunRecord, rss: RssParameters) -> list[Collision]:
    """Return the collisions of a run, one for each car and stretch of samples in which its body overlaps the robot's.

    Lengthwise collisions are those in which the bodies were apart lengthwise last; which car was behind tells the
    kind. Who is responsible is RSS's question (Shalev-Shwartz et al. 2017): whoever let the distance that was lost
    last be lost, the longitudinal one the car behind, the lateral one the car that moved towards the other faster.

    Args:
        record: the run.
        rss: whose distances count.
    """
    found = []
    for sample, car in _onsets(record):
        pair = _pair(record, car, sample)
        sideways = _met_sideways(pair)
        robot_is_behind = bool(pair.dx[-1] >= 0.0)
        kind: Kind = "side" if sideways else "into_other" if robot_is_behind else "into_robot"
        found.append(Collision(sample, car, kind, _robot_is_responsible(pair, rss, sideways=sideways)))
    return found


def _onsets(record: RunRecord) -> Iterator[tuple[int, int]]:
    """Yield the sample and the number of each car that begins to overlap the robot, in the order of time.

    Each car has its own beginnings: a second one may be hit while the first still is.
    """
    if not record.threats.collision.any():
        return
    robot, body = record.robot, (record.robot_length, record.robot_width)
    states = np.column_stack([robot.x, robot.y, robot.heading, robot.speed])
    before: frozenset[int] = frozenset()
    last = -1
    for samples, numbers, cars in record.traffic.pieces():
        for row in np.flatnonzero(record.threats.collision[samples]).tolist():
            sample, here = samples.start + row, np.flatnonzero(cars.present[row])
            tracks = (cars.x[row, here], cars.y[row, here], cars.heading[row, here])
            overlap = touching(states[sample], *body, *tracks, cars.length[here], cars.width[here])
            now = frozenset(numbers[here[overlap]].tolist())
            yield from ((sample, car) for car in sorted(now - before if sample == last + 1 else now))
            before, last = now, sample


def _pair(record: RunRecord, car: int, last: int) -> _Pair:
    """Return the robot and a car up to a sample, from where the car has been present without a break."""
    robot, traffic = record.robot, record.traffic.of(car)
    absent = np.flatnonzero(~traffic.present[: last + 1, 0])
    window = slice(int(absent[-1]) + 1 if len(absent) else 0, last + 1)
    robot_speed, car_speed = robot.speed[window], traffic.speed[window, 0]
    return _Pair(
        dx=traffic.x[window, 0] - robot.x[window],
        dy=traffic.y[window, 0] - robot.y[window],
        robot_speed=robot_speed,
        car_speed=car_speed,
        robot_lateral=robot_speed * np.sin(robot.heading[window]),
        car_lateral=car_speed * np.sin(traffic.heading[window, 0]),
        mean_length=0.5 * (record.robot_length + float(traffic.length[0])),
        mean_width=0.5 * (record.robot_width + float(traffic.width[0])),
    )


def _met_sideways(pair: _Pair) -> bool:
    """Return whether the gap that closed last is the one from side to side.

    Where both close within the last step, it is the one that needs the larger share of the step; where there is no
    step before, or neither was open (turned bodies), the one that is less deeply closed.
    """
    gaps = np.array([pair.gap[-2:], pair.lateral_gap[-2:]])  # (2, 1 or 2), lengthwise first
    before, now = gaps[:, 0], gaps[:, -1]
    if gaps.shape[1] == 1 or (before < 0.0).all() or (before <= now).any():
        return bool(before[1] > before[0])
    share = np.maximum(before, 0.0) / (before - now)
    return bool(share[1] > share[0])


def _robot_is_responsible(pair: _Pair, rss: RssParameters, *, sideways: bool) -> bool:
    """Return whether the robot let the RSS distance be lost that was lost last before a collision."""
    first = len(pair.dx) - 1
    lost = _lost_distances(pair, first, rss)
    while first > 0:
        before = _lost_distances(pair, first - 1, rss)
        if not all(before):
            lost = before
            break
        first -= 1
    lengthwise_before, sideways_before = lost
    if lengthwise_before != sideways_before:
        sideways = lengthwise_before  # the other one was still kept, and so was lost last
    if not sideways:
        return bool(pair.dx[first] >= 0.0)
    towards_left = 1.0 if pair.dy[first] > 0.0 else -1.0
    towards_car = towards_left * float(pair.robot_lateral[first])
    return towards_car > max(-towards_left * float(pair.car_lateral[first]), KEEPING_ITS_PLACE)


def _lost_distances(pair: _Pair, sample: int, rss: RssParameters) -> tuple[bool, bool]:
    """Return whether the longitudinal and the lateral RSS distance are not kept at a sample."""
    robot_is_behind = pair.dx[sample] >= 0.0
    speeds = (pair.robot_speed[sample], pair.car_speed[sample])
    rear, front = speeds if robot_is_behind else speeds[::-1]
    longitudinal = longitudinal_distance(rear, front, rss.response_time, rss.acceleration, rss.brake_min, rss.brake_max)
    # The left car's lateral speed counts to the right, the right car's to the left.
    robot, car = pair.robot_lateral[sample], pair.car_lateral[sample]
    left, right = (-car, robot) if pair.dy[sample] > 0.0 else (-robot, car)
    limits = (rss.response_time, rss.lateral_acceleration, rss.lateral_brake)
    lateral = lateral_distance(left, right, *limits, *limits, rss.lateral_margin)
    return bool(pair.gap[sample] < longitudinal), bool(pair.lateral_gap[sample] < lateral)
