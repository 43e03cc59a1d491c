"""Values of the cars around the robot, looked up again from what a run recorded."""

import math

import numpy as np
from numba import njit

from hj_cosim.reachability.table.lookup import value_at
from hj_cosim.reachability.table.size_classes import class_of, offsets_in_class
from hj_cosim.reachability.table.stack import TableStack, grid_in
from hj_cosim.reachability.table.table import ValueTable
from hj_cosim.recording.record import RunRecord


def car_values(record: RunRecord, table: ValueTable) -> np.ndarray:
    """Return V of every car at every sample, (T, J) float32, m; +inf where a car is outside the grid or absent."""
    robot, traffic = record.robot, record.traffic
    states = np.column_stack([robot.x, robot.y, robot.heading, robot.speed])
    sizes = np.column_stack([traffic.length, traffic.width])
    return _car_values(table.stack, states, traffic.present, traffic.x, traffic.y, traffic.speed, sizes)


@njit(cache=True)
def _car_values(
    tables: TableStack,
    robot: np.ndarray,
    present: np.ndarray,
    x: np.ndarray,
    y: np.ndarray,
    speed: np.ndarray,
    sizes: np.ndarray,
) -> np.ndarray:
    samples, cars = x.shape
    values, numbers = np.full((samples, cars), math.inf, np.float32), tables.numbers
    for j in range(cars):
        kind = class_of(numbers, sizes[j, 0], sizes[j, 1])
        grid = grid_in(numbers, kind)
        for t in range(samples):
            if present[t, j]:
                p_x, p_y = offsets_in_class(
                    numbers, kind, robot[t, 0] - x[t, j], robot[t, 1] - y[t, j], sizes[j, 0], sizes[j, 1]
                )
                values[t, j] = value_at(tables.flat, grid, p_x, p_y, robot[t, 2], robot[t, 3], speed[t, j])
    return values


def value_field(
    table: ValueTable,
    along: np.ndarray,
    aside: np.ndarray,
    heading: float,
    robot_speed: float,
    x: np.ndarray,
    y: np.ndarray,
    speed: np.ndarray,
) -> np.ndarray:
    """Return the least V over given cars if the robot were elsewhere, (len(aside), len(along)), m.

    Args:
        table: V.
        along, aside: positions of the robot, m, as axes of the field.
        heading, robot_speed: of the robot, rad and m/s.
        x, y, speed: (J,) of the cars, m and m/s.
    """
    px, py = np.meshgrid(along, aside)
    states = np.empty((px.size, 5))
    states[:, 2], states[:, 3] = heading, robot_speed
    field = np.full(px.size, np.inf)
    for car in range(len(x)):
        states[:, 0], states[:, 1], states[:, 4] = px.ravel() - x[car], py.ravel() - y[car], speed[car]
        field = np.minimum(field, table.value(states))
    return field.reshape(px.shape)
