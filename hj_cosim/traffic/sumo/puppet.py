"""A vehicle in SUMO that is moved from outside like a puppet, such as the robot, and its ghost."""

import math
import re
from collections.abc import Iterator, Sequence
from typing import NamedTuple, Protocol

import numpy as np

from hj_cosim.scene.road import Road
from hj_cosim.traffic.sumo.session import libsumo

ROBOT = "robot"
# Who straddles two lanes is seen in one of them only; an invisible second vehicle is seen in the other.
_GHOST_ENDING = "'s ghost"
GHOST = ROBOT + _GHOST_ENDING

# setSpeedMode: bits 0 to 4 are the checks for safe speed, acceleration, deceleration, right of way and red lights;
# bit 5 alone leaves the speed to us.
SPEED_IS_OURS = 32
NO_LANE_CHANGES = 0  # setLaneChangeMode: none of SUMO's own, none on request
# moveToXY: exactly there, also off the lanes' centre lines and off the road.
KEEP_EXACT_POSITION = 2


class Body(Protocol):
    """How large a vehicle is."""

    @property
    def length(self) -> float:
        """Its length, m."""
        ...

    @property
    def width(self) -> float:
        """Its width, m."""
        ...


def ghost_of(name: str) -> str:
    """Return what the ghost of a vehicle is called."""
    return name + _GHOST_ENDING


def is_ghost(name: str) -> bool:
    """Return whether a vehicle is the ghost of another one."""
    return name.endswith(_GHOST_ENDING)


class Placement(NamedTuple):
    """Where the robot is to SUMO, which takes a vehicle to be where the middle of its front bumper is."""

    lane: int  # where its centre is
    second_lane: int  # the other one in which drivers notice it; the lane again where there is none
    front_lane: int  # where its front is, one of these two: a front crosses a line before the centre does
    along: float  # m, of the front
    lateral: float  # m, of the front
    heading: float  # rad, relative to the road


def placement(state: np.ndarray, body: Body, road: Road) -> Placement:
    """Return where the robot's front is, and which lanes it is in.

    Args:
        state: (4,) p_x, p_y (m), θ (rad), v (m/s) of its centre, in the road frame.
        body: its length and width.
        road: the lanes.
    """
    x, y, heading, _ = state.tolist()
    along = x + 0.5 * body.length * math.cos(heading)
    lateral = y + 0.5 * body.length * math.sin(heading)
    if not road.is_straight:
        world_x, world_y, direction = road.to_world(x, y, heading)
        ahead = 0.5 * body.length * math.cos(direction), 0.5 * body.length * math.sin(direction)
        along, lateral, _ = road.from_world(world_x + ahead[0], world_y + ahead[1], direction, along)
    lane, front_lane = road.lane_at(y, x), road.lane_at(lateral, along)
    second_lane = front_lane
    if front_lane == lane:
        neighbour = lane + (1 if y > road.lane_centre(lane, x) else -1)
        second_lane = neighbour if neighbour in road.lanes_overlapped(y, body.width, x) else lane
    return Placement(lane, second_lane, front_lane, along, lateral, heading)


class Puppet:
    """Puts the robot, and its ghost while it straddles two lanes, where they are told to be."""

    def __init__(self, road: Road, edge: str, route: str, name: str = ROBOT) -> None:
        """Take the robot, or another vehicle, which is in SUMO already, over.

        Args:
            road: the road.
            edge: its name in SUMO.
            route: of the vehicle and its ghost, a name in SUMO.
            name: the vehicle's, and its type's.
        """
        self._name, self._ghost = name, ghost_of(name)
        self._road = road
        self._edge = edge
        self._route = route
        self._lane_in_sumo: dict[str, int] = {}  # of the vehicles that were moved before
        self._has_ghost = self._has_new_ghost = False
        libsumo.vehicle.setLaneChangeMode(self._name, NO_LANE_CHANGES)
        libsumo.vehicle.setSpeedMode(self._name, SPEED_IS_OURS)

    def place(self, robot: Placement, is_beside_somebody: bool) -> None:
        """Tell SUMO where the robot is to be when the next step ends, in its lane and, straddling, in the next one.

        Args:
            robot: where.
            is_beside_somebody: whether it is now alongside a car in a lane that both are in.
        """
        self._move(self._name, robot.front_lane, (robot.along, robot.lateral, robot.heading), is_beside_somebody)
        straddles = robot.second_lane != robot.lane
        if straddles:
            if not self._has_ghost:
                libsumo.vehicle.add(self._ghost, self._route, self._name)
                libsumo.vehicle.setLaneChangeMode(self._ghost, NO_LANE_CHANGES)
                libsumo.vehicle.setSpeedMode(self._ghost, SPEED_IS_OURS)
            lane = robot.second_lane if robot.front_lane == robot.lane else robot.lane
            centre = self._road.lane_centre(lane, robot.along)
            self._move(self._ghost, lane, (robot.along, centre, 0.0), is_beside_somebody)
        elif self._has_ghost:
            libsumo.vehicle.remove(self._ghost)
            del self._lane_in_sumo[self._ghost]
        self._has_new_ghost = straddles and not self._has_ghost
        self._has_ghost = straddles

    def _move(self, name: str, lane: int, place: tuple[float, float, float], is_beside_somebody: bool) -> None:
        """Put a vehicle's front at a place in the road frame: s, d (m) and heading (rad)."""
        if self._lane_in_sumo.get(name, lane) != lane:
            # Otherwise it goes on blocking the lane that it came from.
            self._put_into_lane(name, lane)
        elif name in self._lane_in_sumo and is_beside_somebody:
            # SUMO keeps a lane's vehicles in the order in which they came in: had the robot passed this car, those
            # behind would follow the robot, through the car. Only from another lane is it put where it belongs.
            self._put_into_lane(name, self._neighbour(lane))
            self._put_into_lane(name, lane)
        self._lane_in_sumo[name] = lane
        self._move_to(name, lane, place)

    def _move_to(self, name: str, lane: int, place: tuple[float, float, float]) -> None:
        """Ask SUMO to have a vehicle's front at a place in the road frame, in a lane, when the next step ends."""
        x, y, direction = self._road.to_world(*place)
        angle = 90.0 - math.degrees(direction)
        libsumo.vehicle.moveToXY(name, self._edge, lane, x, y, angle, KEEP_EXACT_POSITION)

    def _neighbour(self, lane: int) -> int:
        """Return a lane beside another one, where the robot is."""
        return lane + 1 if lane == 0 else lane - 1

    def _put_into_lane(self, name: str, lane: int) -> None:
        """Set a vehicle into a lane of SUMO's where it is: SUMO takes its speed from the way it makes in the step."""
        libsumo.vehicle.moveTo(name, f"{self._edge}_{lane}", libsumo.vehicle.getLanePosition(name))

    def correct_speed(self, speed: float) -> None:
        """Give the robot, and its ghost, the speed (m/s) that it really has, before the others look at it."""
        libsumo.vehicle.setPreviousSpeed(self._name, speed)
        if self._has_ghost:
            libsumo.vehicle.setPreviousSpeed(self._ghost, speed)

    def remove(self) -> None:
        """Take the vehicle, and its ghost, off the road."""
        libsumo.vehicle.remove(self._name)
        if self._has_ghost:
            libsumo.vehicle.remove(self._ghost)

    def after_step(self, speed: float) -> None:
        """Give a ghost that came in this step the robot's speed (m/s).

        It has made no way yet, and would stand in its followers' eyes.
        """
        if self._has_new_ghost:
            libsumo.vehicle.setPreviousSpeed(self._ghost, speed)


def without_ghost(lines: Sequence[str]) -> Iterator[str]:
    """Yield SUMO's warnings with ghosts called what they stand for; those of one and its own ghost are left out.

    So are those about how SUMO would have the robot brake: its speed is ours.
    """
    for line in lines:
        told = line.replace(_GHOST_ENDING, "")
        if f"'{ROBOT}' performs emergency braking" in told:
            continue
        if told == line or len(set(re.findall(r"[Vv]ehicle '([^']*)'", told))) != 1:
            yield told
