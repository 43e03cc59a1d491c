"""A table of two cars asked about all cars of an observation: once a step, for all who want it."""

import math

import numpy as np
from numba import njit

from hj_cosim.reachability.table.lookup import smooth_gradient_at, value_and_gradient_at
from hj_cosim.reachability.table.size_classes import class_of, classes_of, offsets_in_class
from hj_cosim.reachability.table.stack import grid_in
from hj_cosim.reachability.table.table import ValueTable
from hj_cosim.scene.observation import NOBODY, Cars, CarValues, Observation
from hj_cosim.scene.possible import is_possible

SMOOTHED = 50.0  # m of V, above which no row is ever asked for


def car_values(table: ValueTable, observation: Observation) -> CarValues:
    """Return V and its gradient between the robot and each car of an observation.

    Args:
        table: V over (p_x, p_y, θ_r, v_r, v_o), of each car that of its size class: see `stack`.
        observation: finite or not; where it is not, nor is any value.
    """
    seen = observation
    value, gradient, least, nearest = _car_values(
        *table.stack, seen.robot, seen.x, seen.y, seen.heading, seen.speed, seen.acceleration, seen.length, seen.width
    )
    return CarValues(value, gradient, least, nearest)


def smooth_gradients(table: ValueTable, observation: Observation, values: CarValues) -> np.ndarray:
    """Return ∂V/∂x, (J, 5), with slopes that do not jump between the table's cells (`lookup.smooth_gradient_at`).

    Of cars with V up to SMOOTHED; of others, which no row is about, they are those of `values`.
    """
    cars = observation.cars
    place = (cars.x, cars.y, cars.speed, cars.length, cars.width)
    return _smooth_gradients(*table.stack, observation.robot, *place, values.value, values.gradient)


def rows_of_cars(
    table: ValueTable, observation: Observation, value: np.ndarray, gradient: np.ndarray, bound: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return the cars with V up to a bound, (K,) int, and what a filter asks of its control about each, (4 or 8, K).

    Those rows are V, the coefficients of ω and a, and c: see `ValueTable.half_planes`. A game may add the same four of
    what may be kept instead of V, for it is nowhere above it: see `games.highway.rows`.

    Args:
        table: V over (p_x, p_y, θ_r, v_r, v_o).
        observation: the robot and the cars.
        value, gradient: V of the cars, (J,) m, and ∂V/∂x, (J, 5), of `car_values` or smooth.
        bound: m.
    """
    if table.closed_rows is not None:
        return table.closed_rows(observation.robot, observation.cars, value, gradient, bound)
    cars = np.flatnonzero(value <= bound)
    states = pair_states(observation.robot, observation.cars, cars)
    if not table.larger:
        return cars, np.vstack([value[cars], table.half_planes(states, gradient[cars])])
    seen, numbers = observation.cars, table.stack.numbers
    kinds = classes_of(numbers, seen.length[cars], seen.width[cars])
    planes = np.empty((len(table.game.controls) + 1, len(cars)))
    for kind, each in enumerate(table.by_size):
        planes[:, kinds == kind] = each.half_planes(states[kinds == kind], gradient[cars[kinds == kind]])
    return cars, np.vstack([value[cars], planes])


# Ten parameters: a NamedTuple of arrays costs a microsecond to hand over, at every step.
@njit(cache=True)
def _car_values(
    flat: np.ndarray,
    numbers: np.ndarray,
    robot: np.ndarray,
    x: np.ndarray,
    y: np.ndarray,
    heading: np.ndarray,
    speed: np.ndarray,
    acceleration: np.ndarray,
    length: np.ndarray,
    width: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, float, int]:
    """Return V (J,), its gradients (J, 5), the least V and its index; NaN, and NOBODY, where any is not a number.

    One pass for all who want V or its gradient, with the tables as `stack` has them, class by class: a table is made
    of its numbers once.
    """
    value, gradient = np.full(len(x), np.nan), np.zeros((len(x), 5))
    if not is_possible(robot, x, y, heading, speed, acceleration):
        return value, gradient, math.nan, NOBODY
    least, nearest, known = math.inf, NOBODY, True
    for kind in range(len(numbers)):
        grid = grid_in(numbers, kind)
        for j in range(len(value)):
            if class_of(numbers, length[j], width[j]) != kind:
                continue
            p_x, p_y = offsets_in_class(numbers, kind, robot[0] - x[j], robot[1] - y[j], length[j], width[j])
            value[j] = value_and_gradient_at(flat, grid, p_x, p_y, robot[2], robot[3], speed[j], gradient[j])
            if value[j] < least:
                least, nearest = value[j], j
            known = known and value[j] > -math.inf
    return (value, gradient, least, nearest) if known else (value, gradient, math.nan, NOBODY)


# Ten parameters: likewise.
@njit(cache=True)
def _smooth_gradients(
    flat: np.ndarray,
    numbers: np.ndarray,
    robot: np.ndarray,
    x: np.ndarray,
    y: np.ndarray,
    speed: np.ndarray,
    length: np.ndarray,
    width: np.ndarray,
    values: np.ndarray,
    gradients: np.ndarray,
) -> np.ndarray:
    found = gradients.copy()
    for kind in range(len(numbers)):
        grid = grid_in(numbers, kind)
        for j in range(len(values)):
            if values[j] <= SMOOTHED and class_of(numbers, length[j], width[j]) == kind:
                p_x, p_y = offsets_in_class(numbers, kind, robot[0] - x[j], robot[1] - y[j], length[j], width[j])
                smooth_gradient_at(flat, grid, p_x, p_y, robot[2], robot[3], speed[j], found[j])
    return found


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
