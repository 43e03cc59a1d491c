"""The rows of safety-preserving control in the highway game: min over w_o of ∇V·f >= 0, in closed form.

Paper, section HJI Safety Controller. With ∇V = (V_x, V_y, V_θ, V_r, V_o), a row is V_θ ω + V_r a + c_0 >= 0 where

    c_0 = min over (θ_o, a_o) of (V_o a_o − V_x v_o cosθ_o − V_y v_o sinθ_o)  +  V_x v_r cosθ_r + V_y v_r sinθ_r.
"""

import math
from collections.abc import Mapping

import numpy as np
from numba import njit

from hj_cosim.reachability.games.contract import RowsOfCars
from hj_cosim.reachability.games.highway.other_car import (
    Disturbance,
    allowed,
    available_acceleration,
    worst_heading_sine,
)
from hj_cosim.scene.observation import Cars


@njit(cache=True)
def worst_drift(gradient: np.ndarray, state: np.ndarray, other: Disturbance) -> float:
    """Return c_0 of the row, m/s.

    The worst θ_o points along (V_x, V_y), as far as it is allowed; a car that stands does not brake.

    Args:
        gradient: (5,) ∇V.
        state: (5,) p_x, p_y (m), θ_r (rad), v_r, v_o (m/s).
        other: what w_o is assumed to be.
    """
    along, across, heading, speed, other_speed = gradient[0], gradient[1], state[2], state[3], state[4]
    leftwards = speed * math.sin(heading)
    may = allowed(other, state[0], state[1], leftwards, speed, other_speed)
    sine = worst_heading_sine(may, along, across)
    towards = along * math.sqrt(1.0 - sine * sine) + across * sine
    least, most = available_acceleration(may, other_speed, 0.0, math.inf)
    worst_acceleration = min(gradient[4] * least, gradient[4] * most)
    own = along * speed * math.cos(heading) + across * leftwards
    return worst_acceleration - other_speed * towards + own


@njit(cache=True)
def _rows_of_cars(
    robot: np.ndarray, cars: Cars, values: np.ndarray, gradients: np.ndarray, bound: float, other: Disturbance
) -> tuple[np.ndarray, np.ndarray]:
    chosen, rows = np.empty(len(values), np.int64), np.empty((4, len(values)))
    state = np.empty(5)
    count = 0
    for j in range(len(values)):
        if values[j] <= bound:
            state[0], state[1] = robot[0] - cars.x[j], robot[1] - cars.y[j]
            state[2], state[3], state[4] = robot[2], robot[3], cars.speed[j]
            chosen[count] = j
            rows[0, count], rows[1, count], rows[2, count] = values[j], gradients[j, 2], gradients[j, 3]
            rows[3, count] = worst_drift(gradients[j], state, other)
            count += 1
    return chosen[:count], rows[:, :count]


def closed_rows(parameters: Mapping[str, float]) -> RowsOfCars:
    """Return the function that makes the rows of all cars with V up to a bound, in one pass.

    Args:
        parameters: all of a highway game.
    """
    other = Disturbance.of_game(parameters)

    def rows_of_cars(
        robot: np.ndarray, cars: Cars, values: np.ndarray, gradients: np.ndarray, bound: float
    ) -> tuple[np.ndarray, np.ndarray]:
        chosen, rows = _rows_of_cars(robot, cars, values, gradients, bound, other)
        return chosen, rows

    return rows_of_cars
