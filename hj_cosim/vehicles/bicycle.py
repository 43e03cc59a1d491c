"""The robot: the dynamically extended simple car (paper, eq. case study low-level dynamics)."""

import math

import numpy as np
from numba import njit

# Below this speed (m/s) the steering is that of this speed. With the paper's arctan(ω L / v) a car that hardly moves
# would turn its wheels across, and spin many times faster than ω as soon as it drives off.
SLOWEST_FULL_TURN = 0.5


@njit(cache=True)
def steering_for(omega: float, speed: float, wheelbase: float) -> float:
    """Return δ = arctan(ω L / v), rad, the steering that turns at `omega`; less for a car that hardly moves.

    A car that stands steers straight.
    """
    if speed <= 0.0:
        return 0.0
    return math.atan(omega * wheelbase / max(speed, SLOWEST_FULL_TURN))


@njit(cache=True)
def bicycle_step(
    state: np.ndarray, steering: float, acceleration: float, wheelbase: float, speed_max: float, step: float
) -> np.ndarray:
    """Return the state after one step of constant δ and a, integrated exactly.

    With constant steering the path is a circle, so heading and position follow from the distance driven
    in closed form; the speed is kept in [0, speed_max], and where it meets a limit it stays there.

    Args:
        state: (4,) p_x, p_y (m), θ (rad), v (m/s).
        steering: δ, rad.
        acceleration: a, m/s².
        wheelbase: L, m.
        speed_max: m/s.
        step: s.

    Returns:
        (4,) the next state.
    """
    x, y, heading = state[0], state[1], state[2]
    speed = min(max(state[3], 0.0), speed_max)
    next_speed = min(max(speed + acceleration * step, 0.0), speed_max)
    if acceleration != 0.0 and next_speed != speed + acceleration * step:
        until_limit = (next_speed - speed) / acceleration
        distance = 0.5 * (speed + next_speed) * until_limit + next_speed * (step - until_limit)
    else:
        distance = 0.5 * (speed + next_speed) * step
    turn = distance * math.tan(steering) / wheelbase
    half = 0.5 * turn
    # The chord of an arc: sin(half)/half is taken from its series where the division would lose digits.
    chord = distance * (1.0 - half * half / 6.0 if abs(half) < 1e-4 else math.sin(half) / half)
    return np.array(
        [x + chord * math.cos(heading + half), y + chord * math.sin(heading + half), heading + turn, next_speed]
    )
