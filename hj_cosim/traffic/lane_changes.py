"""MOBIL for the background drivers: whose turn it is, and which lane each of them wants."""

from typing import NamedTuple

import numpy as np
from numba import njit

from hj_cosim.vehicles.mobil import lane_decisions


class DrivingCars(NamedTuple):
    """What MOBIL sees of J cars, in any order."""

    position: np.ndarray  # (J,) m, centres along the road
    speed: np.ndarray  # (J,) m/s
    lane: np.ndarray  # (J,) int
    second_lane: np.ndarray  # (J,) int, the other lane that it is in while it changes, else its lane again
    length: np.ndarray  # (J,) m
    drivers: np.ndarray  # (J, 6) IDM parameters, in the order of vehicles.idm
    mobil: np.ndarray  # (J, 3) MOBIL's parameters, in the order of vehicles.mobil


@njit(cache=True)
def sort_nearly_sorted(order: np.ndarray, position: np.ndarray) -> None:
    """Bring `order` (J,) into ascending order of `position` (J,), in place.

    Insertion sort: from one step to the next hardly anybody overtakes, so this is linear in the cars.
    """
    for place in range(1, len(order)):
        car = order[place]
        before = place - 1
        while before >= 0 and position[order[before]] > position[car]:
            order[before + 1] = order[before]
            before -= 1
        order[before + 1] = car


@njit(cache=True)
def wanted_lanes(order: np.ndarray, deciding: np.ndarray, cars: DrivingCars, usable: np.ndarray) -> np.ndarray:
    """Return the lane that each car wants, (J,) int; the cars may be in any order.

    Args:
        order: (J,) int, the order of positions a step ago; brought up to date.
        deciding: (J,) bool, the cars whose turn it is.
        cars: all of them.
        usable: (J, 2) int, the first and the last lane that each may want.
    """
    sort_nearly_sorted(order, cars.position)
    wanted = lane_decisions(
        deciding[order],
        cars.position[order],
        cars.speed[order],
        cars.lane[order],
        cars.second_lane[order],
        cars.length[order],
        cars.drivers[order],
        cars.mobil[order],
        usable[order],
    )
    result = np.empty_like(cars.lane)
    for place in range(len(order)):  # `result[order] = wanted` would take 2 s more to compile
        result[order[place]] = wanted[place]
    return result
