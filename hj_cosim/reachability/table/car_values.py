"""V of all cars of an observation, looked up once a step for all who want it."""

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
