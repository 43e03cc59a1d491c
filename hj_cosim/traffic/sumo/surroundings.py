"""The vehicles of a user's own simulation that are near the robot: they come and go, and nobody knows their drivers.

One context subscription tells all about them in one call, however many there are elsewhere.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from traci import constants

from hj_cosim.scene.observation import Observation
from hj_cosim.scene.road import Road
from hj_cosim.traffic.sumo.between_steps import BetweenSteps, Motion
from hj_cosim.traffic.sumo.session import libsumo
from hj_cosim.traffic.sumo_lanes import SumoLanes
from hj_cosim.vehicles.idm import PARAMETER_NAMES

# Nearer than this to a lane's centre line (m), a vehicle is not between lanes.
ON_CENTRE_LINE = 1e-3
# How far beside the road (m) and how far turned against it (rad) somebody on another lane, a ramp's, may be to be seen.
BESIDE_THE_ROAD = 8.0
ABOUT_ALONG_THE_ROAD = 0.6
# m, of height: who is on a bridge above the road, or below it, is not beside it.
SAME_LEVEL = 3.0
STEEPEST = 0.06  # of the roads between here and there

READ = (
    constants.VAR_LANE_ID,
    constants.VAR_LANEPOSITION,
    constants.VAR_LANEPOSITION_LAT,
    constants.VAR_SPEED,
    constants.VAR_POSITION3D,
    constants.VAR_ANGLE,
)

Told = Mapping[int, Any]  # what SUMO says of a vehicle, by READ


class _Seen(NamedTuple):
    """One vehicle in the road frame; SI, its centre."""

    x: float
    y: float
    heading: float
    speed: float
    lane: int
    target_lane: int
    is_on_the_road: bool  # in one of its lanes, not beside it


class _Body(NamedTuple):
    length: float  # m
    width: float  # m


class Surroundings:
    """The vehicles near the robot, after SUMO's last step and between two of its steps.

    Attributes:
        vehicle_names: the name of each number; see World.
    """

    def __init__(self, robot: str, ghost: str, road: Road, lanes: SumoLanes, near: float) -> None:
        """Watch who is within `near` m of the robot, which is in SUMO already.

        Args:
            robot, ghost: names in SUMO that are nobody else's.
            road: the frame.
            lanes: what SUMO calls its lanes.
            near: m.
        """
        self.vehicle_names: list[str] = []
        self._numbers: dict[str, int] = {}
        self._bodies: list[_Body] = []
        self._robot, self._not_others = robot, (robot, ghost)
        self._road, self._lanes = road, lanes
        libsumo.vehicle.subscribeContext(robot, constants.CMD_GET_VEHICLE_VARIABLE, near, list(READ))
        self._seen: dict[int, _Seen] = {}
        self._acceleration: dict[int, float] = {}
        self._between: tuple[np.ndarray, BetweenSteps] | None = None
        self._targets: dict[int, int] = {}

    @property
    def drivers(self) -> np.ndarray:
        """Nobody knows them: NaN, (len(vehicle_names), 6); see World."""
        return np.full((len(self.vehicle_names), len(PARAMETER_NAMES)), math.nan)

    def read(self, robot_along: float, duration: float | None = None) -> None:
        """Read who is near the robot.

        Args:
            robot_along: s of the robot, m.
            duration: s, of SUMO's step that has just been made; None at the beginning, when there was none.
        """
        before = self._seen
        told: Mapping[str, Told] = libsumo.vehicle.getContextSubscriptionResults(self._robot)
        here = told.get(self._robot, {}).get(constants.VAR_POSITION3D, (0.0, 0.0, 0.0))
        seen: dict[int, _Seen] = {}
        for name in sorted(set(told).difference(self._not_others)):
            number = self._numbers.get(name)
            if _is_on_another_level(told[name], here):
                continue
            one = self._place(told[name], name, None if number is None else before.get(number), robot_along, duration)
            if one is not None:
                seen[self._number(name) if number is None else number] = one
        self._seen = dict(sorted(seen.items()))
        if duration is None:
            self._acceleration = dict.fromkeys(self._seen, 0.0)
            return
        self._acceleration = {
            number: (one.speed - before[number].speed) / duration if number in before else 0.0
            for number, one in self._seen.items()
        }
        stayed = [number for number in self._seen if number in before]
        on_other_roads = [
            not (before[number].is_on_the_road and self._seen[number].is_on_the_road) for number in stayed
        ]
        self._between = (
            np.array(stayed, dtype=np.int64),
            BetweenSteps(
                self._motion(before, stayed),
                self._motion(self._seen, stayed),
                duration,
                self._road,
                np.flatnonzero(on_other_roads),
            ),
        )

    def observe(self, time: float, robot: np.ndarray, robot_acceleration: float, elapsed: float) -> Observation:
        """Return what the robot sees; `elapsed` as for Fleet.observe."""
        if self._between is None or elapsed == 0.0:
            numbers = np.array(list(self._seen), dtype=np.int64)
            motion = self._motion(self._seen, list(self._seen))
        else:
            numbers, between = self._between
            motion = between.at(elapsed)
        bodies = np.array([self._bodies[number] for number in numbers]).reshape(-1, 2)
        return Observation(
            time=time,
            robot=robot,
            robot_acceleration=robot_acceleration,
            vehicle=numbers,
            x=motion.x,
            y=motion.y,
            heading=motion.heading,
            speed=motion.speed,
            acceleration=motion.acceleration,
            lane=motion.lane,
            target_lane=np.array([self._seen[number].target_lane for number in numbers.tolist()], dtype=np.int64),
            length=bodies[:, 0],
            width=bodies[:, 1],
        )

    def is_beside(self, robot: np.ndarray, length: float, lanes: Sequence[int]) -> bool:
        """Return whether somebody lies alongside the robot (4,), `length` m long, in one of the lanes that it is in."""
        return any(
            one.is_on_the_road
            and one.lane in lanes
            and abs(one.x - robot[0]) < 0.5 * (length + self._bodies[number].length)
            for number, one in self._seen.items()
        )

    def _motion(self, seen: Mapping[int, _Seen], numbers: Sequence[int]) -> Motion:
        ones = [seen[number] for number in numbers]
        return Motion(
            x=np.array([one.x for one in ones], dtype=float),
            y=np.array([one.y for one in ones], dtype=float),
            heading=np.array([one.heading for one in ones], dtype=float),
            speed=np.array([one.speed for one in ones], dtype=float),
            acceleration=np.array([self._acceleration.get(number, 0.0) for number in numbers], dtype=float),
            lane=np.array([one.lane for one in ones], dtype=np.int64),
        )

    def _number(self, name: str) -> int:
        """Give a name its number when it is first seen."""
        self._numbers[name] = len(self.vehicle_names)
        self.vehicle_names.append(name)
        self._bodies.append(_Body(libsumo.vehicle.getLength(name), libsumo.vehicle.getWidth(name)))
        return self._numbers[name]

    def _place(
        self,
        told: Told,
        name: str,
        before: _Seen | None,
        robot_along: float,
        duration: float | None,
    ) -> _Seen | None:
        """Return where somebody is in the road frame; None if that is neither on the road nor beside it."""
        number = self._numbers.get(name)
        length = self._bodies[number].length if number is not None else libsumo.vehicle.getLength(name)
        speed = float(told[constants.VAR_SPEED])
        place = self._lanes.by_name.get(str(told[constants.VAR_LANE_ID]))
        if place is None:
            return self._beside(told, length, speed, robot_along)
        x = place.start + place.scale * float(told[constants.VAR_LANEPOSITION]) - 0.5 * length
        offset = float(told[constants.VAR_LANEPOSITION_LAT])
        lane = place.number
        if abs(offset) < ON_CENTRE_LINE:
            return _Seen(x, self._road.lane_centre(lane, x), 0.0, speed, lane, lane, True)
        y = self._road.lane_centre(lane, x) + offset
        sideways = (y - before.y) / duration if before is not None and before.is_on_the_road and duration else 0.0
        heading = math.atan2(sideways, speed) if speed > abs(sideways) else 0.0
        leaves = sideways * offset > 0.0
        target = lane + int(math.copysign(1, offset)) if leaves else lane
        return _Seen(x, y, heading, speed, lane, target, True)

    def _beside(self, told: Told, length: float, speed: float, robot_along: float) -> _Seen | None:
        """Return where somebody on another road is, a ramp perhaps; None if that road does not run along ours."""
        front_x, front_y, _ = told[constants.VAR_POSITION3D]
        direction = math.radians(90.0 - float(told[constants.VAR_ANGLE]))
        x = float(front_x) - 0.5 * length * math.cos(direction)
        y = float(front_y) - 0.5 * length * math.sin(direction)
        near = robot_along + self._towards(x, y, robot_along)
        if not 0.0 <= near <= self._road.length:
            return None
        along, lateral, heading = self._road.from_world(x, y, direction, near)
        heading = math.remainder(heading, math.tau)
        if not 0.0 <= along <= self._road.length or abs(heading) > ABOUT_ALONG_THE_ROAD:
            return None
        lines = self._road.lane_lines(along)
        if not lines[0] - BESIDE_THE_ROAD <= lateral <= lines[-1] + BESIDE_THE_ROAD:
            return None
        lane = self._road.lane_at(lateral, along)
        return _Seen(along, lateral, heading, speed, lane, lane, False)

    def _towards(self, x: float, y: float, robot_along: float) -> float:
        """Return how far along the road a place is from the robot, m, roughly: along the robot's own direction."""
        here_x, here_y, direction = self._road.to_world(robot_along, 0.0, 0.0)
        return (x - here_x) * math.cos(direction) + (y - here_y) * math.sin(direction)


def _is_on_another_level(told: Told, here: tuple[float, float, float]) -> bool:
    x, y, z = told[constants.VAR_POSITION3D]
    return bool(abs(z - here[2]) > SAME_LEVEL + STEEPEST * math.hypot(x - here[0], y - here[1]))
