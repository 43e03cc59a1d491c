"""How a row begins: what SPC asks of V above and below ε, beyond the paper's switch at ε (jitted).

The paper's row appears at V = ε and asks at once that V does not fall, whatever the other car does: it binds as it
appears, and the control jumps. A control barrier-value function (Choi, Lee, Sreenath, Tomlin & Herbert 2021, Robust
Control Barrier-Value Functions for Safety-Critical Control) asks instead that V falls no faster than γ (V − ε). The row
is there as long as V is finite, and is left out only where no control that the robot has could miss it, which is known
exactly: so it never appears binding, and leaving it out changes no solution.
"""

import numpy as np
from numba import njit

from hj_cosim.control.spc.recovery import recovery_rate


@njit(cache=True)
def asked_rise(value: float, epsilon: float, recovery: float, approach: float) -> float:
    """Return how fast V has to rise at the least, m/s; negative where it may fall.

    Args:
        value: V, m.
        epsilon: ε, m.
        recovery: κ, 1/s, below ε.
        approach: γ, 1/s, above ε.
    """
    if value > epsilon:
        return -approach * (value - epsilon)
    return recovery_rate(value, epsilon, recovery)


@njit(cache=True)
def can_bind(p: float, q: float, c: float, box: np.ndarray) -> bool:
    """Return whether some control in the box (4,), lower and upper ω, lower and upper a, misses p ω + q a + c >= 0."""
    return min(p * box[0], p * box[1]) + min(q * box[2], q * box[3]) + c < 0.0


@njit(cache=True)
def binding_rows(
    rows: np.ndarray, epsilon: float, recovery: float, approach: float, box: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return which rows matter, (K,) int, and these, (4, K): all of V <= ε, and of the others those that could bind.

    Args:
        rows: (4, J) V, p, q, c of min over w_o of dV/dt = p ω + q a + c; c is written, what is asked for taken off.
        epsilon: ε, m.
        recovery, approach: κ and γ, 1/s.
        box: (4,) lower and upper ω, lower and upper a.
    """
    kept = np.empty(rows.shape[1], np.int64)
    count = 0
    for j in range(rows.shape[1]):
        rows[3, j] -= asked_rise(rows[0, j], epsilon, recovery, approach)
        if rows[0, j] <= epsilon or can_bind(rows[1, j], rows[2, j], rows[3, j], box):
            kept[count] = j
            count += 1
    return kept[:count], rows[:, kept[:count]]
