"""The vehicles of a user's own simulation that are near the robot: they come and go, and nobody knows their drivers.

One context subscription tells all about them in one call, however many there are elsewhere. Those who are only to be
recorded are asked for one by one.
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
FEW = 64  # vehicles, for whom there is room at first
_SPEED = 4  # its column in a row of what is seen
READ = (
    constants.VAR_LANE_ID,
    constants.VAR_LANEPOSITION,
    constants.VAR_LANEPOSITION_LAT,
    constants.VAR_SPEED,
)

Told = Mapping[int, Any]  # what SUMO says of a vehicle, by READ


class _Seen(NamedTuple):
    """The J vehicles that are seen after a step, in the road frame, by their numbers; SI, their centres."""

    number: np.ndarray  # (J,) int, ascending
    motion: Motion
    target_lane: np.ndarray  # (J,) int
    is_on_the_road: np.ndarray  # (J,) bool, in one of its lanes, not beside it
    is_near: np.ndarray  # (J,) bool, near enough to be observed

    def only(self, rows: np.ndarray) -> "_Seen":
        """Return some rows, by a mask or by their indices."""
        motion = Motion(*(column[rows] for column in self.motion))
        return _Seen(self.number[rows], motion, self.target_lane[rows], self.is_on_the_road[rows], self.is_near[rows])


class _Known(NamedTuple):
    """What does not change from step to step of J vehicles."""

    seen: _Seen
    length: np.ndarray  # (J,) m
    width: np.ndarray  # (J,) m
    expected: np.ndarray  # (J, 6) IDM parameters


class Surroundings:
    """The vehicles near the robot, after SUMO's last step and between two of its steps.

    Attributes:
        vehicle_names: the name of each number; see World.
    """

    # Six parameters beside itself: who is not looked for, the road, and how far is looked.
    def __init__(
        self, robot: str, ghost: str, road: Road, lanes: SumoLanes, near: float, *, farther: bool = False
    ) -> None:
        """Watch who is within `near` m of the robot, which is in SUMO already.

        Args:
            robot, ghost: names in SUMO that are nobody else's.
            road: the frame.
            lanes: what SUMO calls its lanes.
            near: m.
            farther: whether all others on the road and its ramps are read too, for `everybody`.
        """
        self.vehicle_names: list[str] = []
        self._numbers: dict[str, int] = {}
        self._lengths: list[float] = []
        self._bodies = np.empty((0, 2))  # length and width, m, by number
        self._expected = np.empty((0, len(PARAMETER_NAMES)))  # by number
        self._expected_in: list[str] = []  # the lane, by number: each has its own speed
        self._robot, self._not_others = robot, frozenset((robot, ghost))
        self._road, self._lanes = road, lanes
        self._looks_farther = farther
        libsumo.vehicle.subscribeContext(robot, constants.CMD_GET_VEHICLE_VARIABLE, near, list(READ))
        self._now = self._known(_table([], self._acceleration_of([], None, None)))
        self._between: tuple[_Known, BetweenSteps] | None = None

    @property
    def expected_drivers(self) -> np.ndarray:
        """What is expected of them, in the lanes that they were in last, (len(vehicle_names), 6)."""
        return self._expected[: len(self.vehicle_names)].copy()

    @property
    def is_on_the_road(self) -> np.ndarray:
        """Which of those observed at the end of a step are in a lane of the road, not beside it, (J,) bool."""
        seen = self._now.seen
        return seen.is_on_the_road[seen.is_near] if self._looks_farther else seen.is_on_the_road

    @property
    def drivers(self) -> np.ndarray:
        """Nobody knows them: NaN, (len(vehicle_names), 6); see World."""
        return np.full((len(self.vehicle_names), len(PARAMETER_NAMES)), math.nan)

    def read(self, duration: float | None = None) -> None:
        """Read who is near the robot.

        Args:
            duration: s, of SUMO's step that has just been made; None at the beginning, when there was none.
        """
        before = self._now.seen
        was_at = dict(zip(before.number.tolist(), before.motion.y.tolist(), strict=True)) if duration else {}
        told: Mapping[str, Told] = libsumo.vehicle.getContextSubscriptionResults(self._robot)
        rows = self._rows(told, was_at, duration, is_near=True)
        if self._looks_farther:
            rows += self._rows(self._told_of_the_others(told), was_at, duration, is_near=False)
        rows.sort()
        acceleration = self._acceleration_of(rows, before, duration)
        self._now = self._known(_table(rows, acceleration))
        if duration is None:
            return
        now = self._now.seen
        if not np.array_equal(now.number, before.number):
            stay = np.isin(now.number, before.number)
            before, now = before.only(np.isin(before.number, now.number)), now.only(stay)
        on_other_roads = np.flatnonzero(~(before.is_on_the_road & now.is_on_the_road))
        between = BetweenSteps(before.motion, now.motion, duration, self._road, on_other_roads)
        self._between = self._known(now), between

    def _rows(
        self, told: Mapping[str, Told], was_at: Mapping[int, float], duration: float | None, *, is_near: bool
    ) -> list[tuple[Any, ...]]:
        """Return a row for each that is on the road or beside it, whose first entry is its number."""
        rows = []
        for name in sorted(set(told).difference(self._not_others)):
            number = self._numbers.get(name)
            one = self._place(told[name], name, number, None if number is None else was_at.get(number), duration)
            if one is not None:
                number = self._number(name) if number is None else number
                rows.append((number, *one, is_near))
                self._look_at_driver(number, name, str(told[name][constants.VAR_LANE_ID]))
        return rows

    def _told_of_the_others(self, told: Mapping[str, Told]) -> dict[str, Told]:
        """Return the same of those on the road and its ramps whom SUMO has not told of, for they are not near."""
        vehicle, lane = libsumo.vehicle, libsumo.lane
        return {
            name: {
                constants.VAR_LANE_ID: where,
                constants.VAR_LANEPOSITION: vehicle.getLanePosition(name),
                constants.VAR_LANEPOSITION_LAT: vehicle.getLateralLanePosition(name),
                constants.VAR_SPEED: vehicle.getSpeed(name),
            }
            for where in self._lanes.by_name
            for name in lane.getLastStepVehicleIDs(where)
            if name not in told
        }

    def _acceleration_of(
        self, rows: Sequence[tuple[Any, ...]], before: _Seen | None, duration: float | None
    ) -> list[float]:
        """Return what their speeds have changed by, m/s²; 0 of those who were not seen before."""
        if before is None or duration is None:
            return [0.0] * len(rows)
        earlier = dict(zip(before.number.tolist(), before.motion.speed.tolist(), strict=True))
        return [(row[_SPEED] - earlier[row[0]]) / duration if row[0] in earlier else 0.0 for row in rows]

    def _known(self, seen: _Seen) -> _Known:
        bodies = self._bodies[seen.number]
        return _Known(seen, bodies[:, 0], bodies[:, 1], self._expected[seen.number])

    def _look_at_driver(self, number: int, name: str, lane: str) -> None:
        """Find out what can be expected of somebody's driver in a lane, unless that is known."""
        if self._expected_in[number] != lane:
            self._expected_in[number] = lane
            self._expected[number] = estimated_driver(name)

    def observe(self, time: float, robot: np.ndarray, robot_acceleration: float, elapsed: float) -> Observation:
        """Return what the robot sees; `elapsed` as for Fleet.observe."""
        seen = self.everybody(time, robot, robot_acceleration, elapsed)
        return seen.only(self._at(elapsed)[0].seen.is_near) if self._looks_farther else seen

    def everybody(self, time: float, robot: np.ndarray, robot_acceleration: float, elapsed: float) -> Observation:
        """Return likewise all who have been read."""
        known, motion = self._at(elapsed)
        return Observation(
            time=time,
            robot=robot,
            robot_acceleration=robot_acceleration,
            vehicle=known.seen.number,
            x=motion.x,
            y=motion.y,
            heading=motion.heading,
            speed=motion.speed,
            acceleration=motion.acceleration,
            lane=motion.lane,
            target_lane=known.seen.target_lane,
            length=known.length,
            width=known.width,
            expected_driver=known.expected,
        )

    def _at(self, elapsed: float) -> tuple[_Known, Motion]:
        """Return who is seen so many s after the beginning of SUMO's step, or at its end, and how they move."""
        if self._between is None or elapsed == 0.0:
            return self._now, self._now.seen.motion
        known, between = self._between
        return known, between.at(elapsed)

    def is_beside(self, robot: np.ndarray, length: float, lanes: Sequence[int]) -> bool:
        """Return whether somebody lies alongside the robot (4,), `length` m long, in one of the lanes that it is in."""
        seen = self._now.seen
        is_beside = np.abs(seen.motion.x - robot[0]) < 0.5 * (length + self._now.length)
        return any(seen.motion.lane[row] in lanes for row in np.flatnonzero(is_beside & seen.is_on_the_road).tolist())

    def _number(self, name: str) -> int:
        """Give a name its number when it is first seen."""
        number = self._numbers[name] = len(self.vehicle_names)
        self.vehicle_names.append(name)
        self._lengths.append(libsumo.vehicle.getLength(name))
        self._expected_in.append("")
        if number == len(self._bodies):
            room = max(2 * number, FEW)
            self._bodies = np.resize(self._bodies, (room, 2))
            self._expected = np.resize(self._expected, (room, len(PARAMETER_NAMES)))
        self._bodies[number] = self._lengths[number], libsumo.vehicle.getWidth(name)
        return number

    def _place(
        self, told: Told, name: str, number: int | None, was_at: float | None, duration: float | None
    ) -> tuple[float, float, float, float, int, int, bool] | None:
        """Return where somebody is in the road frame; None if neither on the road nor on a ramp's part beside it.

        That is x, y, heading and speed of its centre, its lane, the one that it is on its way to, and whether it is on
        the road itself. It was at d = `was_at` (m) before, if it is known.
        """
        place = self._lanes.by_name.get(told[constants.VAR_LANE_ID])
        if place is None:
            return None
        length = self._lengths[number] if number is not None else libsumo.vehicle.getLength(name)
        speed, position = told[constants.VAR_SPEED], told[constants.VAR_LANEPOSITION]
        offset, lane = told[constants.VAR_LANEPOSITION_LAT], place.number
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
            return x, centre, 0.0, speed, lane, lane, True
        y = centre + offset
        sideways = (y - was_at) / duration if was_at is not None and duration else 0.0
        heading = math.atan2(sideways, max(speed, TURNED_AS_AT))
        leaves = is_on_the_road and sideways * offset > 0.0
        target = lane + int(math.copysign(1, offset)) if leaves else lane
        return x, y, heading, speed, lane, target, is_on_the_road


def _table(rows: Sequence[tuple[Any, ...]], acceleration: Sequence[float]) -> _Seen:
    """Return rows, each a number, what `_place` returns and whether it is near, as arrays."""
    number, x, y, heading, speed, lane, target, on_the_road, near = zip(*rows, strict=True) if rows else [()] * 9
    motion = Motion(
        np.array(x, dtype=float),
        np.array(y, dtype=float),
        np.array(heading, dtype=float),
        np.array(speed, dtype=float),
        np.array(acceleration, dtype=float),
        np.array(lane, dtype=np.int64),
    )
    return _Seen(
        np.array(number, dtype=np.int64),
        motion,
        np.array(target, dtype=np.int64),
        np.array(on_the_road, dtype=bool),
        np.array(near, dtype=bool),
    )
