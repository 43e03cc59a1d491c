"""The rows of safety-preserving control in the highway game: min over w_o of ∇V·f >= 0, in closed form.

Paper, section HJI Safety Controller; and beside each what may be kept instead of V. V(0, ·) is the greater of two
distances, and V bends where they are equal: one falls there as the other takes over, and the row of the one would ask
for what is not needed. V as it would be if the lesser distance alone were V(0, ·) is nowhere above V, so that V is kept
by whoever keeps that.

With ∇V = (V_x, V_y, V_θ, V_r, V_o), a row is V_θ ω + V_r a + c_0 >= 0 where

    c_0 = min over (θ_o, a_o) of (V_o a_o − V_x v_o cosθ_o − V_y v_o sinθ_o)  +  V_x v_r cosθ_r + V_y v_r sinθ_r.
"""

import math
from collections.abc import Mapping, Sequence

import numpy as np
from numba import njit

from hj_cosim.kernels import kernel
from hj_cosim.reachability.games.contract import RowsOfCars, SizeClass
from hj_cosim.reachability.games.highway.other_car import (
    Disturbance,
    allowed,
    available_acceleration,
    disturbance_from,
    worst_heading_sine,
)
from hj_cosim.reachability.games.highway.target import FORMULA_NUMBERS, TargetFormula, formula_from, terms_at
from hj_cosim.reachability.packing import packed
from hj_cosim.reachability.table.size_classes import class_of, offsets_in_class
from hj_cosim.reachability.table.value_scale import scaled, steepness, unscaled
from hj_cosim.scene.observation import Cars
from hj_cosim.vehicles.car import CAR_LENGTH, CAR_WIDTH


@kernel
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


@kernel
def value_of_lesser_term(target: TargetFormula, state: np.ndarray, value: float, gradient: np.ndarray) -> float:
    """Return what V would be by the lesser term of V(0, ·) alone, m, and turn ∇V into its gradient.

    V is looked up as s(V) = s(V(0, ·)) − W (`table.lookup`): W and its slopes are those of V.

    Args:
        target: V(0, ·).
        state: (5,) p_x, p_y (m), θ_r (rad), v_r, v_o (m/s).
        value: V, m, finite.
        gradient: (5,) ∇V; overwritten.
    """
    greater, lesser = terms_at(target, state[0], state[1], state[2], state[3], state[4])
    scale, scale_lesser, scale_value = scaled(greater.value), scaled(lesser.value), scaled(value)
    scale_found = scale_lesser - (scale - scale_value)
    steep, of_greater, of_lesser = steepness(scale_found), 1.0 / steepness(scale), 1.0 / steepness(scale_lesser)
    of_value = 1.0 / steepness(scale_value)
    high = (greater.by_x, greater.by_y, greater.by_theta, greater.by_r, greater.by_o)
    low = (lesser.by_x, lesser.by_y, lesser.by_theta, lesser.by_r, lesser.by_o)
    for axis in range(5):
        gradient[axis] = steep * (of_lesser * low[axis] - of_greater * high[axis] + of_value * gradient[axis])
    return unscaled(scale_found)


@njit(cache=True)
def write_row(
    target: TargetFormula, other: Disturbance, state: np.ndarray, value: float, gradient: np.ndarray, row: np.ndarray
) -> None:
    """Write V, the coefficients of ω and a, and c_0 of one car, and the same four of what may be kept instead.

    Args:
        target: V(0, ·).
        other: what w_o is assumed to be.
        state: (5,) p_x, p_y (m), θ_r (rad), v_r, v_o (m/s).
        value, gradient: V, m, finite, and ∇V, (5,); left alone.
        row: (8,), written.
    """
    row[0], row[1], row[2], row[3] = value, gradient[2], gradient[3], worst_drift(gradient, state, other)
    instead = gradient.copy()
    row[4] = value_of_lesser_term(target, state, value, instead)
    row[5], row[6], row[7] = instead[2], instead[3], worst_drift(instead, state, other)


# Ten parameters: a NamedTuple of arrays costs a microsecond to hand over, at every step.
@njit(cache=True)
def _rows_of_cars(
    robot: np.ndarray,
    x: np.ndarray,
    y: np.ndarray,
    speed: np.ndarray,
    length: np.ndarray,
    width: np.ndarray,
    values: np.ndarray,
    gradients: np.ndarray,
    bound: float,
    numbers: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    target, other = game_in(numbers, 0)
    before, state = 0, np.empty(5)
    chosen, rows = np.empty(len(values), np.int64), np.empty((len(values), 8))
    count = 0
    for j in range(len(values)):
        if values[j] <= bound:
            kind = class_of(numbers, length[j], width[j])
            if kind != before:
                target, other = game_in(numbers, kind)
                before = kind
            state[0], state[1] = offsets_in_class(numbers, kind, robot[0] - x[j], robot[1] - y[j], length[j], width[j])
            state[2], state[3], state[4] = robot[2], robot[3], speed[j]
            chosen[count] = j
            write_row(target, other, state, values[j], gradients[j], rows[count])
            count += 1
    return chosen[:count], rows[:count].T.copy()


@kernel
def game_in(numbers: np.ndarray, kind: int) -> tuple[TargetFormula, Disturbance]:
    """Return V(0, ·) and the assumption of a size class, by its row; the largest body of the class comes first."""
    row = numbers[kind, 2:]
    return formula_from(row), disturbance_from(row[FORMULA_NUMBERS:])


def row_numbers(
    parameters: Mapping[str, float], larger: Sequence[tuple[SizeClass, Mapping[str, float]]] = ()
) -> np.ndarray:
    """Return what `game_in` reads, (classes, n): a size class's largest body, V(0, ·) and the assumption.

    Args:
        parameters, larger: as `closed_rows` takes them.

    Raises:
        TableError: if they are the parameters of another game.
    """
    return np.array(
        [
            [*body, *packed((TargetFormula.of_game(each), Disturbance.of_game(each)))]
            for body, each in [
                ((CAR_LENGTH, CAR_WIDTH), parameters),
                *(((size.length, size.width), of_class) for size, of_class in larger),
            ]
        ]
    )


def closed_rows(
    parameters: Mapping[str, float], larger: Sequence[tuple[SizeClass, Mapping[str, float]]] = ()
) -> RowsOfCars:
    """Return the function that makes the rows of all cars with V up to a bound, in one pass.

    Args:
        parameters: all of a highway game.
        larger: size classes of larger cars, the smallest first, and all of the parameters of the games with them.
    """
    numbers = row_numbers(parameters, larger)

    def rows_of_cars(
        robot: np.ndarray, cars: Cars, values: np.ndarray, gradients: np.ndarray, bound: float
    ) -> tuple[np.ndarray, np.ndarray]:
        chosen, rows = _rows_of_cars(
            robot, cars.x, cars.y, cars.speed, cars.length, cars.width, values, gradients, bound, numbers
        )
        return chosen, rows

    return rows_of_cars
