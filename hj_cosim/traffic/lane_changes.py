"""MOBIL for the background drivers: whose turn it is, and which lane each of them wants."""

import numpy as np
from numba import njit

from hj_cosim.vehicles.mobil import lane_decisions


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
def wanted_lanes(
    order: np.ndarray,
    deciding: np.ndarray,
    position: np.ndarray,
    speed: np.ndarray,
    lane: np.ndarray,
    second_lane: np.ndarray,
    length: np.ndarray,
    drivers: np.ndarray,
    mobil: np.ndarray,
    lane_count: int,
) -> np.ndarray:
    """Return the lane that each car wants, (J,) int; the cars may be in any order.

    Args:
        order: (J,) int, the order of positions a step ago; brought up to date.
        deciding, position, speed, lane, second_lane, length, drivers, mobil, lane_count: as lane_decisions.
    """
    sort_nearly_sorted(order, position)
    wanted = lane_decisions(
        deciding[order],
        position[order],
        speed[order],
        lane[order],
        second_lane[order],
        length[order],
        drivers[order],
        mobil,
        lane_count,
    )
    result = np.empty_like(lane)
    result[order] = wanted
    return result
