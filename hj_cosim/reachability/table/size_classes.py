"""The other cars by size: a table is solved for the largest body of a class, and a car has that of its class (jitted).

A body that is larger than its class, or of a class that there is no table for, counts as one of the largest table's
class, at the place within it that is nearest to the robot.
"""

from collections.abc import Iterable

import numpy as np
from numba import njit

from hj_cosim.kernels import kernel
from hj_cosim.reachability.games.contract import SizeClass
from hj_cosim.vehicles.car import CAR_LENGTH, CAR_WIDTH, to_nearest_part

# The other cars, by the size that a table has to be right for; smaller ones count as cars.
SIZE_CLASSES = (
    SizeClass("car", CAR_LENGTH, CAR_WIDTH),
    SizeClass("van or truck", 12.0, 2.5),
    SizeClass("long truck", 18.0, 2.5),
)
CAR = SIZE_CLASSES[0]
LENGTH, WIDTH = 0, 1  # columns of numbers by size class: the largest body, m


@kernel
def class_of(numbers: np.ndarray, length: float, width: float) -> int:
    """Return the size class of a body, m, as a row: the first that is long and wide enough for it, or the last.

    The widest class is wide enough for all.

    Args:
        numbers: (classes, 2 or more), of which the first two are the largest body of a class, m.
        length, width: m.
    """
    last = numbers.shape[0] - 1
    for kind in range(last):
        if length <= numbers[kind, LENGTH] and (
            width <= numbers[kind, WIDTH] or numbers[kind, WIDTH] >= numbers[last, WIDTH]
        ):
            return kind
    return last


@njit(cache=True)
def classes_of(numbers: np.ndarray, length: np.ndarray, width: np.ndarray) -> np.ndarray:
    """Return the size classes of bodies, (J,) int; see class_of."""
    found = np.empty(len(length), np.int64)
    for j in range(len(length)):
        found[j] = class_of(numbers, length[j], width[j])
    return found


@kernel
def offsets_in_class(
    numbers: np.ndarray, kind: int, p_x: float, p_y: float, length: float, width: float
) -> tuple[float, float]:
    """Return p_x, p_y, m, to the nearest place within a body at which one of its class's size fits into it."""
    return (
        to_nearest_part(p_x, length, numbers[kind, LENGTH]),
        to_nearest_part(p_y, width, numbers[kind, WIDTH]),
    )


def classes_met(bodies: Iterable[tuple[float, float]]) -> tuple[SizeClass, ...]:
    """Return the size classes of bodies, length and width (m), and that of cars, the smallest first."""
    numbers = np.array([[size.length, size.width] for size in SIZE_CLASSES])
    met = {0, *(class_of(numbers, length, width) for length, width in bodies)}
    return tuple(SIZE_CLASSES[kind] for kind in sorted(met))
