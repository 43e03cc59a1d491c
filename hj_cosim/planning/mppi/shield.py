"""A filter inside the rollouts: samples are held to accelerations under which V falls no faster than it is far from ε.

The rows are the game's, those of safety-preserving control, about the nearest cars. A sample keeps its turn rate, and
its acceleration is brought into the interval in which all rows hold; where there is none, it is the one that the rows
of least V leave. That is less than the filter of the loop does, which also turns, and no program has to be solved.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from hj_cosim.planning.mppi.others import Others
from hj_cosim.reachability.games.highway.rows import game_in, worst_drift
from hj_cosim.reachability.table.lookup import value_and_gradient_at
from hj_cosim.reachability.table.size_classes import class_of, offsets_in_class
from hj_cosim.reachability.table.stack import TableStack, grid_in
from hj_cosim.reachability.table.value_scale import slowest_rise

_NO_HOLD = 1e-9  # of ∂V/∂v_r, below which no acceleration changes anything


class Shield(NamedTuple):
    """What samples are held to; none without numbers."""

    numbers: np.ndarray  # (classes, n) of `rows.row_numbers`
    epsilon: float  # m
    approach: float  # 1/s, γ: V may fall by γ (V − ε) a second, on the scale of look-ups


NO_SHIELD = Shield(np.empty((0, 0)), 0.0, 0.0)


@njit(cache=True, error_model="numpy")
def asked_rise(value: float, shield: Shield) -> float:
    """Return how fast V, m, has to rise at the least, m/s: not to fall below ε, and no faster than it is far above."""
    return slowest_rise(value, shield.epsilon, shield.approach) if value > shield.epsilon else 0.0


@njit(cache=True, error_model="numpy")
def held_acceleration(
    state: np.ndarray,
    others: Others,
    instant: int,
    nearest: np.ndarray,
    omega: float,
    asked: float,
    tables: TableStack,
    shield: Shield,
) -> float:
    """Return the acceleration nearest to the one asked for under which the rows of the nearest cars hold, m/s².

    Args:
        state: (4,) of the robot.
        others: the cars, of which those at an instant count.
        instant: which.
        nearest: (K,) the numbers of those that are looked at, −1 for nobody.
        omega: rad/s, which is kept.
        asked: m/s².
        tables: V.
        shield: what is kept.
    """
    least, most = -math.inf, math.inf
    from_least, from_most = math.inf, math.inf  # V of the cars whose rows these are
    pair, gradient, flat = np.empty(5), np.empty(5), tables.flat
    pair[2], pair[3] = state[2], state[3]
    grid, other, known = grid_in(tables.numbers, 0), game_in(shield.numbers, 0)[1], 0
    for car in nearest:
        if car < 0:
            continue
        length, width = others.length[car], others.width[car]
        kind = class_of(tables.numbers, length, width)
        p_x, p_y = offsets_in_class(
            tables.numbers, kind, state[0] - others.x[instant, car], state[1] - others.y[instant, car], length, width
        )
        speed = others.speed[instant, car]
        if kind != known:
            grid, other, known = grid_in(tables.numbers, kind), game_in(shield.numbers, kind)[1], kind
        value = value_and_gradient_at(flat, grid, p_x, p_y, state[2], state[3], speed, gradient)
        hold = gradient[3]
        if not value < math.inf or abs(hold) <= _NO_HOLD:
            continue
        pair[0], pair[1], pair[4] = p_x, p_y, speed
        rest = gradient[2] * omega + worst_drift(gradient, pair, other) - asked_rise(value, shield)
        bound = -rest / hold
        if hold > 0.0 and bound > least:
            least, from_least = bound, value
        elif hold < 0.0 and bound < most:
            most, from_most = bound, value
    if least > most:
        return least if from_least < from_most else most
    return min(max(asked, least), most)
