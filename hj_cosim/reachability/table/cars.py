"""A table of two cars asked about all cars around the robot at once (jitted)."""

import math

import numpy as np
from numba import njit

from hj_cosim.reachability.table.lookup import TableArrays, value_at
from hj_cosim.scene.observation import is_possible


@njit(cache=True)
def values_of_cars(
    table: TableArrays, robot: np.ndarray, x: np.ndarray, y: np.ndarray, heading: np.ndarray, speed: np.ndarray
) -> np.ndarray:
    """Return V of every car of an observation, (J,), m.

    +inf of a car that is not within the table in p_x or p_y; NaN of all if the observation is not possible
    (`scene.observation.is_possible`), for then nothing is known.

    Args:
        table: the value table's arrays.
        robot: (4,) p_x, p_y (m), θ (rad), v (m/s).
        x, y, heading, speed: (J,) m, m, rad, m/s, of the other cars.
    """
    values = np.full(len(x), math.nan)
    if is_possible(robot, x, y, heading, speed):
        for j in range(len(x)):
            values[j] = value_at(table, robot[0] - x[j], robot[1] - y[j], robot[2], robot[3], speed[j])
    return values


@njit(cache=True)
def pair_states(robot: np.ndarray, x: np.ndarray, y: np.ndarray, speed: np.ndarray, cars: np.ndarray) -> np.ndarray:
    """Return the states (p_x, p_y, θ, v_r, v_o) of the robot and some of the cars, (K, 5).

    Args:
        robot: (4,) p_x, p_y (m), θ (rad), v (m/s).
        x, y, speed: (J,) m, m, m/s, of all cars.
        cars: (K,) int, which.
    """
    states = np.empty((len(cars), 5))
    for k in range(len(cars)):
        j = cars[k]
        states[k, 0], states[k, 1] = robot[0] - x[j], robot[1] - y[j]
        states[k, 2], states[k, 3], states[k, 4] = robot[2], robot[3], speed[j]
    return states
