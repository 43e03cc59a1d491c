"""How a row begins: what SPC asks of V above and below ε, beyond the paper's switch at ε (jitted).

The paper's row appears at V = ε and asks at once that V does not fall, whatever the other car does: it binds as it
appears, and the control jumps. A control barrier-value function (Choi, Lee, Sreenath, Tomlin & Herbert 2021, Robust
Control Barrier-Value Functions for Safety-Critical Control) asks instead that V falls no faster than it is far from ε.
Far on the scale s(V) of look-ups, on which V is nearly a distance: ds/dt >= −γ (s(V) − s(ε)). In metres of V, a cubic
beside a car, that is γ (V − ε) just above ε, and soon more, so that a car 60 m ahead asks for nothing. The row is there
as long as V is finite, and is left out only where no control that the robot has could miss it, which is known exactly:
so it never appears binding, and leaving it out changes no solution.
"""

import numpy as np
from numba import njit

from hj_cosim.control.spc.recovery import recovery_rate
from hj_cosim.kernels import kernel
from hj_cosim.reachability.table.value_scale import slowest_rise

NOT_NEEDED = -1
_NO_REACH = 1e-12  # of a row that no control changes


@kernel
def asked_rise(value: float, epsilon: float, recovery: float, approach: float) -> float:
    """Return how fast V has to rise at the least, m/s; negative where it may fall.

    Args:
        value: V, m.
        epsilon: ε, m.
        recovery: κ, 1/s, below ε.
        approach: γ, 1/s, above ε.
    """
    if value > epsilon:
        return slowest_rise(value, epsilon, approach)
    return recovery_rate(value, epsilon, recovery)


@kernel
def can_bind(p: float, q: float, c: float, box: np.ndarray) -> bool:
    """Return whether some control in the box (4,), lower and upper ω, lower and upper a, misses p ω + q a + c >= 0."""
    return min(p * box[0], p * box[1]) + min(q * box[2], q * box[3]) + c < 0.0


@kernel
def _misses_by(row: np.ndarray, first: int, omega: float, acceleration: float, box: np.ndarray) -> float:
    """Return by how much a control misses a row, as a share of what the box can change; not above 0 if it meets it."""
    p, q = row[first + 1], row[first + 2]
    reach = abs(p) * (box[1] - box[0]) + abs(q) * (box[3] - box[2])
    return -(p * omega + q * acceleration + row[first + 3]) / max(reach, _NO_REACH)


# One of the parameters is written: the row.
@kernel
def begun_row(
    row: np.ndarray,
    epsilon: float,
    recovery: float,
    approach: float,
    box: np.ndarray,
    omega: float,
    acceleration: float,
) -> int:
    """Return where in a row the one to keep begins, and NOT_NEEDED if none; c is written, what is asked for taken off.

    V <= ε is always kept. Of a car with more it is V, or what may be kept instead as long as that is above ε, too: none
    where one of the two cannot be missed, and else the one that the desired control meets, or nearly does.

    Args:
        row: (4,) V, p, q, c of min over w_o of dV/dt = p ω + q a + c, or (8,) with those of what may be kept instead.
        epsilon: ε, m.
        recovery, approach: κ and γ, 1/s.
        box: (4,) lower and upper ω, lower and upper a.
        omega, acceleration: desired.
    """
    row[3] -= asked_rise(row[0], epsilon, recovery, approach)
    if row[0] <= epsilon:
        return 0
    if not can_bind(row[1], row[2], row[3], box):
        return NOT_NEEDED
    if len(row) == 4 or row[4] <= epsilon:
        return 0
    row[7] -= asked_rise(row[4], epsilon, recovery, approach)
    if not can_bind(row[5], row[6], row[7], box):
        return NOT_NEEDED
    missed = _misses_by(row, 0, omega, acceleration, box)
    return 0 if missed <= max(_misses_by(row, 4, omega, acceleration, box), 0.0) else 4


@njit(cache=True)
def binding_rows(
    rows: np.ndarray,
    epsilon: float,
    recovery: float,
    approach: float,
    box: np.ndarray,
    omega: float,
    acceleration: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Return which rows matter, (K,) int, and these, (4, K): all of V <= ε, and of the others those that could bind.

    Args:
        rows: (4, J) or (8, J), of each car what `begun_row` takes; the rest as there.
    """
    kept, found = np.empty(rows.shape[1], np.int64), np.empty((4, rows.shape[1]))
    count = 0
    for j in range(rows.shape[1]):
        row = rows[:, j].copy()
        first = begun_row(row, epsilon, recovery, approach, box, omega, acceleration)
        if first != NOT_NEEDED:
            kept[count], found[:, count] = j, row[first : first + 4]
            count += 1
    return kept[:count], found[:, :count].copy()
