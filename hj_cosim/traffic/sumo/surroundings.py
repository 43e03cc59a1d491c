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
from hj_cosim.traffic.sumo.known_drivers import estimated_driver
from hj_cosim.traffic.sumo.session import libsumo
from hj_cosim.traffic.sumo_lanes import SumoLanes
from hj_cosim.vehicles.idm import PARAMETER_NAMES

# Nearer than this to a lane's centre line (m), a vehicle is not between lanes.
ON_CENTRE_LINE = 1e-3
# m/s: SUMO lets those who stand slide into the next lane in three seconds, too, which turns nobody across the road.
TURNED_AS_AT = 10.0
READ = (
    constants.VAR_LANE_ID,
    constants.VAR_LANEPOSITION,
    constants.VAR_LANEPOSITION_LAT,
    constants.VAR_SPEED,
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
        self._expected: dict[int, tuple[str, np.ndarray]] = {}  # of whom and where: a lane has its own speed

    @property
    def drivers(self) -> np.ndarray:
        """Nobody knows them: NaN, (len(vehicle_names), 6); see World."""
        return np.full((len(self.vehicle_names), len(PARAMETER_NAMES)), math.nan)

    def read(self, duration: float | None = None) -> None:
        """Read who is near the robot.

        Args:
            duration: s, of SUMO's step that has just been made; None at the beginning, when there was none.
        """
        before = self._seen
        told: Mapping[str, Told] = libsumo.vehicle.getContextSubscriptionResults(self._robot)
        seen: dict[int, _Seen] = {}
        for name in sorted(set(told).difference(self._not_others)):
            number = self._numbers.get(name)
            one = self._place(told[name], name, None if number is None else before.get(number), duration)
            if one is not None:
                number = self._number(name) if number is None else number
                seen[number] = one
                self._look_at_driver(number, name, str(told[name][constants.VAR_LANE_ID]))
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

    def _look_at_driver(self, number: int, name: str, lane: str) -> None:
        """Find out what can be expected of somebody's driver in a lane, unless that is known."""
        known = self._expected.get(number)
        if known is None or known[0] != lane:
            self._expected[number] = lane, estimated_driver(name)

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
            expected_driver=np.array([self._expected[number][1] for number in numbers.tolist()]).reshape(
                -1, len(PARAMETER_NAMES)
            ),
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

    def _place(self, told: Told, name: str, before: _Seen | None, duration: float | None) -> _Seen | None:
        """Return where somebody is in the road frame; None if neither on the road nor on a ramp's part beside it."""
        place = self._lanes.by_name.get(str(told[constants.VAR_LANE_ID]))
        if place is None:
            return None
        number = self._numbers.get(name)
        length = self._bodies[number].length if number is not None else libsumo.vehicle.getLength(name)
        speed, position = float(told[constants.VAR_SPEED]), float(told[constants.VAR_LANEPOSITION])
        offset, lane = float(told[constants.VAR_LANEPOSITION_LAT]), place.number
        x = place.start + place.scale * position - 0.5 * length
        if place.beside is not None:
            first, last = place.beside.seen
            if not first <= position <= last:
                return None
            centre = place.beside.lateral_at(position - 0.5 * length)
        else:
            centre = self._road.lane_centre(lane, x)
        is_on_the_road = place.beside is None
        if abs(offset) < ON_CENTRE_LINE and is_on_the_road:
            return _Seen(x, centre, 0.0, speed, lane, lane, True)
        y = centre + offset
        sideways = (y - before.y) / duration if before is not None and duration else 0.0
        heading = math.atan2(sideways, max(speed, TURNED_AS_AT))
        leaves = is_on_the_road and sideways * offset > 0.0
        target = lane + int(math.copysign(1, offset)) if leaves else lane
        return _Seen(x, y, heading, speed, lane, target, is_on_the_road)
