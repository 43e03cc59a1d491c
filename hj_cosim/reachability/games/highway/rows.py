"""The rows of safety-preserving control: min over w_o of ∇V·f >= 0, for every car with V <= ε.

Paper, section HJI Safety Controller. With ∇V = (V_x, V_y, V_θ, V_r, V_o), a row is V_θ ω + V_r a + c_0 >= 0 where

    c_0 = min over (θ_o, a_o) of (V_o a_o − V_x v_o cosθ_o − V_y v_o sinθ_o)  +  V_x v_r cosθ_r + V_y v_r sinθ_r.

`recovery`, not in the paper and 0 by default, asks for more than 0: for κ (ε − V), at most κ ε. A table is wrong by
something everywhere, so that a V which is merely held is lost bit by bit; what is below ε shall come back.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from hj_cosim.errors import TableError
from hj_cosim.reachability.table.lookup import TableArrays, value_and_gradient_at
from hj_cosim.reachability.table.table import ValueTable
from hj_cosim.scene.observation import Cars

# A row with a larger coefficient comes from a broken table; squares of smaller ones do not overflow in any solver.
LARGEST_COEFFICIENT = 1e12

_PARAMETER_NAMES = ("other_heading_max", "other_acceleration_min", "other_acceleration_max")


class Disturbance(NamedTuple):
    """The other car's controls w_o, as the value table assumes them; a NamedTuple, so that kernels take it."""

    heading_max: float  # θ̄, rad
    acceleration_min: float  # m/s²
    acceleration_max: float  # m/s²

    @classmethod
    def of(cls, table: ValueTable) -> "Disturbance":
        """Return the limits that a table was solved with.

        Raises:
            TableError: if its dynamics have other parameters.
        """
        missing = [name for name in _PARAMETER_NAMES if name not in table.parameters]
        if missing:
            raise TableError(
                f"the dynamics {table.dynamics.name} have no parameter {missing[0]};"
                " the filter needs the other car's limits by the names that highway gives them"
            )
        return cls(*(table.parameters[name] for name in _PARAMETER_NAMES))


@njit(cache=True)
def worst_drift(gradient: np.ndarray, heading: float, speed: float, other_speed: float, other: Disturbance) -> float:
    """Return c_0 of the row, m/s.

    The worst θ_o points along (V_x, V_y), as far as |θ_o| <= θ̄ allows; a car that stands does not brake.

    Args:
        gradient: (5,) ∇V.
        heading: θ_r, rad.
        speed, other_speed: v_r and v_o, m/s.
        other: limits of w_o.
    """
    along, across = gradient[0], gradient[1]
    cos_max, sin_max = math.cos(other.heading_max), math.sin(other.heading_max)
    if abs(across) * cos_max <= along * sin_max:
        towards = math.hypot(along, across)
    else:
        towards = along * cos_max + abs(across) * sin_max
    braking = other.acceleration_min if other_speed > 0.0 else 0.0
    worst_acceleration = min(gradient[4] * braking, gradient[4] * other.acceleration_max)
    own = speed * (along * math.cos(heading) + across * math.sin(heading))
    return worst_acceleration - other_speed * towards + own


@njit(cache=True)
def recovery_rate(value: float, epsilon: float, recovery: float) -> float:
    """Return how fast V has to rise at the least, κ min(ε − V, ε), m/s.

    Bounded, so that a car with which all is lost does not outweigh the others under the one shared slack.
    """
    return recovery * min(epsilon - value, epsilon)


@njit(cache=True)
def hji_rows(
    table: TableArrays,
    robot: np.ndarray,
    cars: Cars,
    values: np.ndarray,
    epsilon: float,
    recovery: float,
    other: Disturbance,
) -> tuple[np.ndarray, np.ndarray]:
    """Return the rows of the cars in K: those with V <= ε.

    Args:
        table: the value table's arrays.
        robot: (4,) p_x, p_y (m), θ (rad), v (m/s).
        cars: the other cars.
        values: (J,) m, their V, as `table.car_values` looks it up.
        epsilon: ε, m.
        recovery: κ, 1/s.
        other: limits of the other car's controls.

    Returns:
        The cars in K, (K,) int indices; their rows, (4, K), V, p, q, c. No cars where a row is not finite, or larger
        than LARGEST_COEFFICIENT, as of a broken table.
    """
    in_k = np.empty(len(values), dtype=np.int64)
    rows = np.empty((4, len(values)))
    gradient = np.empty(5)
    count = 0
    for j in range(len(values)):
        value, speed = values[j], cars.speed[j]
        if value > epsilon:
            continue
        p_x, p_y = robot[0] - cars.x[j], robot[1] - cars.y[j]
        value_and_gradient_at(table, p_x, p_y, robot[2], robot[3], speed, gradient)
        in_k[count] = j
        rows[0, count] = value
        rows[1, count] = gradient[2]
        rows[2, count] = gradient[3]
        rows[3, count] = worst_drift(gradient, robot[2], robot[3], speed, other)
        rows[3, count] -= recovery_rate(value, epsilon, recovery)
        if not abs(value) + abs(rows[1, count]) + abs(rows[2, count]) + abs(rows[3, count]) <= LARGEST_COEFFICIENT:
            return in_k[:0], rows[:, :0]
        count += 1
    return in_k[:count], rows[:, :count]
