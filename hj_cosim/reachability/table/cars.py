"""A table of two cars asked about all cars of an observation: once a step, for all who want it."""

import math

import numpy as np
from numba import njit

from hj_cosim.reachability.table.lookup import TableArrays, value_at
from hj_cosim.reachability.table.table import ValueTable
from hj_cosim.scene.observation import NOBODY, Cars, CarValues, Observation, is_possible


def car_values(table: ValueTable, observation: Observation) -> CarValues:
    """Return V between the robot and each car of an observation.

    Args:
        table: V over (p_x, p_y, θ_r, v_r, v_o).
        observation: finite or not; where it is not, nor is any value.
    """
    value, least, nearest = _car_values(table.arrays, observation.robot, observation.cars)
    return CarValues(value, least, nearest)


@njit(cache=True)
def _car_values(table: TableArrays, robot: np.ndarray, cars: Cars) -> tuple[np.ndarray, float, int]:
    """Return V (J,), the least of them and its index; NaN, and NOBODY, where any is not a number."""
    value = np.full(len(cars.x), np.nan)
    if not is_possible(robot, cars.x, cars.y, cars.heading, cars.speed):
        return value, math.nan, NOBODY
    least, nearest, known = math.inf, NOBODY, True
    for j in range(len(value)):
        value[j] = value_at(table, robot[0] - cars.x[j], robot[1] - cars.y[j], robot[2], robot[3], cars.speed[j])
        if value[j] < least:
            least, nearest = value[j], j
        known = known and value[j] > -math.inf
    return (value, least, nearest) if known else (value, math.nan, NOBODY)


@njit(cache=True)
def pair_states(robot: np.ndarray, cars: Cars, chosen: np.ndarray) -> np.ndarray:
    """Return the states (p_x, p_y, θ, v_r, v_o) of the robot and some of the cars, (K, 5).

    Args:
        robot: (4,) p_x, p_y (m), θ (rad), v (m/s).
        cars: all of them, J.
        chosen: (K,) int, which.
    """
    states = np.empty((len(chosen), 5))
    for k in range(len(chosen)):
        j = chosen[k]
        states[k, 0], states[k, 1] = robot[0] - cars.x[j], robot[1] - cars.y[j]
        states[k, 2], states[k, 3], states[k, 4] = robot[2], robot[3], cars.speed[j]
    return states
