"""Where SUMO has the cars, in the road frame: on one straight edge, or on a route of many."""

import math
from collections.abc import Sequence
from typing import Protocol

import numpy as np
from numba import njit

from hj_cosim.scene.road import Road
from hj_cosim.traffic.sumo.session import libsumo
from hj_cosim.traffic.sumo_lanes import SumoLanes

# m, by which a car's way in a step may differ from its speed times the step; it has entered another lane where it does.
_SAME_LANE = 1e-6
_ALL_ALONG = (-math.inf, math.inf)


class Places(Protocol):
    """What the fleet reads of its cars, whatever they drive on."""

    def read(self, names: Sequence[str], step: float) -> tuple[np.ndarray, np.ndarray | None]:
        """Return s (J,), m, of the cars' front bumpers, and their speeds (J,), m/s, or None: then their way tells."""
        ...

    def lane(self, name: str) -> int:
        """Return the road's number of the lane that a car is in."""
        ...

    def index(self, name: str, lane: int) -> int | None:
        """Return the index of the road's lane `lane` on the edge that a car is on; None if it does not exist there."""
        ...

    def knows(self, name: str) -> bool:
        """Return whether a vehicle is on the road, or near enough beside it to be observed."""
        ...

    def centre(self, name: str, lane: int, along: float) -> float:
        """Return d (m) of the centre line of the lane that a car is in, whose number and s (m) are known."""
        ...

    def heading(self, name: str, along: float, sideways: float, forward: float) -> float:
        """Return the heading, rad relative to the road, of a car between lanes.

        Args:
            name: in SUMO.
            along: s of its centre, m.
            sideways, forward: its speeds across and along the road, m/s.
        """
        ...


class EdgePlaces:
    """Places on one straight edge: SUMO's lane positions are s, and its lane indices are the road's."""

    def __init__(self, road: Road) -> None:
        self._road = road

    def read(self, names: Sequence[str], step: float) -> tuple[np.ndarray, np.ndarray | None]:
        """Return where the fronts are; SUMO moves a car by its new speed times the step, so its way is its speed."""
        return np.fromiter(map(libsumo.vehicle.getLanePosition, names), float, len(names)), None

    def lane(self, name: str) -> int:
        """Return the lane's index; see Places."""
        return int(libsumo.vehicle.getLaneIndex(name))

    def index(self, name: str, lane: int) -> int | None:
        """Return the lane itself; see Places."""
        return lane

    def knows(self, name: str) -> bool:
        """Return True: who is in SUMO is on this edge."""
        return True

    def centre(self, name: str, lane: int, along: float) -> float:
        """Return d of the road's lane; see Places."""
        return self._road.lane_centre(lane, along)

    def heading(self, name: str, along: float, sideways: float, forward: float) -> float:
        """Return SUMO's angle, relative to the road."""
        angle = math.radians(90.0 - libsumo.vehicle.getAngle(name))
        return math.remainder(angle - self._road.heading_at(along), math.tau)


class RoutePlaces:
    """Places on a route.

    A lane's name is read only when a car's way in a step is not its speed times the step, the new one or, where SUMO is
    ballistic, the mean one: then it has come into another edge, whose positions count from 0 again.
    """

    def __init__(self, road: Road, lanes: SumoLanes) -> None:
        self._road = road
        self._lanes = lanes
        self._names: Sequence[str] = ()
        self._position = self._speed = self._start = self._scale = np.empty(0)
        self._seen = np.empty((0, 2))  # between which lane positions

    def read(self, names: Sequence[str], step: float) -> tuple[np.ndarray, np.ndarray | None]:
        """Return where the fronts are, in the first lap, NaN of those out of sight, and SUMO's own speeds."""
        vehicle, count = libsumo.vehicle, len(names)
        position = np.fromiter(map(vehicle.getLanePosition, names), float, count)
        speed = np.fromiter(map(vehicle.getSpeed, names), float, count)
        if names is not self._names or count != len(self._position):
            self._names, self._start, self._scale = names, np.empty(count), np.empty(count)
            self._seen = np.empty((count, 2))
            moved: Sequence[int] = range(count)
        else:
            moved = _unlike_their_way(position, self._position, speed, self._speed, step).tolist()
        for car in moved:
            place = self._lanes.by_name.get(vehicle.getLaneID(names[car]))
            self._start[car], self._scale[car] = (math.nan, 1.0) if place is None else (place.start, place.scale)
            self._seen[car] = _ALL_ALONG if place is None or place.beside is None else place.beside.seen
        self._position, self._speed = position, speed
        return _fronts(position, self._start, self._scale, self._seen), speed

    def knows(self, name: str) -> bool:
        """Return whether a vehicle is on the route, or on a ramp's part that is near it; see Places."""
        place = self._lanes.by_name.get(libsumo.vehicle.getLaneID(name))
        if place is None or place.beside is None:
            return place is not None
        first, last = place.beside.seen
        return bool(first <= libsumo.vehicle.getLanePosition(name) <= last)

    def centre(self, name: str, lane: int, along: float) -> float:
        """Return d of the road's lane, or of a ramp's lane where the car is; see Places."""
        beside = self._lanes.by_name[libsumo.vehicle.getLaneID(name)].beside
        if beside is None:
            return self._road.lane_centre(lane, along)
        return beside.lateral_at(libsumo.vehicle.getLanePosition(name) - 0.5 * libsumo.vehicle.getLength(name))

    def lane(self, name: str) -> int:
        """Return the road's lane; see Places."""
        return self._lanes.by_name[libsumo.vehicle.getLaneID(name)].number

    def index(self, name: str, lane: int) -> int | None:
        """Return the lane's index on the car's edge; see Places."""
        return self._lanes.index_on(libsumo.vehicle.getRoadID(name), lane)

    def heading(self, name: str, along: float, sideways: float, forward: float) -> float:
        """Return the direction in which it moves: SUMO's angles jump where the polylines have their corners."""
        return math.atan2(sideways, forward) if forward > abs(sideways) else 0.0


@njit(cache=True)
def _unlike_their_way(
    position: np.ndarray, position_before: np.ndarray, speed: np.ndarray, speed_before: np.ndarray, step: float
) -> np.ndarray:
    """Return the cars whose way in a step is not what their speeds (J,) make it, the new ones or the mean ones."""
    found, count = np.empty(len(position), np.int64), 0
    for car in range(len(position)):
        way = position[car] - position_before[car]
        by_new, by_mean = speed[car] * step, 0.5 * (speed_before[car] + speed[car]) * step
        if min(abs(way - by_new), abs(way - by_mean)) > _SAME_LANE:
            found[count] = car
            count += 1
    return found[:count]


@njit(cache=True)
def _fronts(position: np.ndarray, start: np.ndarray, scale: np.ndarray, seen: np.ndarray) -> np.ndarray:
    """Return s (J,) of lane positions, NaN of those that are not between the two (J, 2) where they are seen, m."""
    fronts = np.empty(len(position))
    for car in range(len(position)):
        is_seen = seen[car, 0] <= position[car] <= seen[car, 1]
        fronts[car] = start[car] + scale[car] * position[car] if is_seen else math.nan
    return fronts


def nearest_lap(along: np.ndarray, lap: float, near: float) -> np.ndarray:
    """Return s (J,) of places on a closed road, m, each in the lap in which it is nearest to `near`."""
    return along + lap * np.round((near - along) / lap)
