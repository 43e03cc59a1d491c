"""The rows of safety-preserving control in the highway game: min over w_o of ∇V·f >= 0, in closed form.

Paper, section HJI Safety Controller. With ∇V = (V_x, V_y, V_θ, V_r, V_o), a row is V_θ ω + V_r a + c_0 >= 0 where

    c_0 = min over (θ_o, a_o) of (V_o a_o − V_x v_o cosθ_o − V_y v_o sinθ_o)  +  V_x v_r cosθ_r + V_y v_r sinθ_r.
"""

import math
from collections.abc import Mapping

import numpy as np
from numba import njit

from hj_cosim.reachability.games.contract import HalfPlanes
from hj_cosim.reachability.games.highway.other_car import Disturbance, allowed


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
    right, left, least, most = allowed(other, state[0], state[1], speed, other_speed)
    cos_right, sin_right, cos_left, sin_left = math.cos(right), math.sin(right), math.cos(left), math.sin(left)
    # V_x cosθ_o + V_y sinθ_o still rises at the right-most heading and falls at the left-most: its top lies between.
    if across * cos_right >= along * sin_right and across * cos_left <= along * sin_left:
        towards = math.hypot(along, across)
    else:
        towards = max(along * cos_right + across * sin_right, along * cos_left + across * sin_left)
    braking = least if other_speed > 0.0 else max(least, 0.0)
    worst_acceleration = min(gradient[4] * braking, gradient[4] * most)
    own = speed * (along * math.cos(heading) + across * math.sin(heading))
    return worst_acceleration - other_speed * towards + own


@njit(cache=True)
def _half_planes(states: np.ndarray, gradients: np.ndarray, other: Disturbance) -> np.ndarray:
    found = np.empty((3, len(states)))
    for k in range(len(states)):
        found[0, k] = gradients[k, 2]
        found[1, k] = gradients[k, 3]
        found[2, k] = worst_drift(gradients[k], states[k], other)
    return found


def closed_half_planes(parameters: Mapping[str, float]) -> HalfPlanes:
    """Return the function that makes rows of states and gradients, both (K, 5): V_θ, V_r and c_0, (3, K).

    Args:
        parameters: all of a highway game.
    """
    other = Disturbance.of_game(parameters)

    def rows_of(states: np.ndarray, gradients: np.ndarray) -> np.ndarray:
        rows: np.ndarray = _half_planes(states, gradients, other)
        return rows

    return rows_of
