"""The safety problem solved exactly, by enumeration: in jitted rollouts, and where every other solver has failed."""

import math
from typing import NamedTuple

import numpy as np
from numba import njit

# What this is called where a solver is chosen.
ENUMERATION = "enumeration"
# Up to so many rows all of them are enumerated together.
_FEW = 4


class _ScaledProblem(NamedTuple):
    """The problem with t eliminated, in coordinates scaled by the weights, in which the quadratic is a distance."""

    slope: np.ndarray  # (n, 2) of the affine pieces whose largest is the slack
    offset: np.ndarray  # (n,)
    target: np.ndarray  # (2,) the desired control
    slack_weight: float
    low: np.ndarray  # (2,) the box
    high: np.ndarray  # (2,)


@njit(cache=True)
def least_cost_control(
    p: np.ndarray,
    q: np.ndarray,
    c: np.ndarray,
    desired_omega: float,
    desired_acceleration: float,
    weights: np.ndarray,
    slack_is_free: bool,
    box: np.ndarray,
) -> tuple[float, float, float]:
    """Return the solution of the safety problem (`safety_problem`'s docstring).

    Of many rows only a few matter: the row that the solution for some of them misses most joins them, until none is
    missed. What solves the problem for those rows and keeps all others solves it for all. Some ten rows join of 500.

    Args:
        p, q, c: (K,) the rows; all finite.
        desired_omega: rad/s.
        desired_acceleration: m/s².
        weights: (3,) λ; the first two positive.
        slack_is_free: whether t may be negative.
        box: (4,) lower and upper ω, lower and upper a.

    Returns:
        ω, a and the slack t.
    """
    rows = len(p)
    if rows <= _FEW:
        return _enumerated(p, q, c, desired_omega, desired_acceleration, weights, slack_is_free, box)
    omega = min(max(desired_omega, box[0]), box[1])
    acceleration = min(max(desired_acceleration, box[2]), box[3])
    slack = -math.inf if slack_is_free else 0.0
    joined = np.zeros(rows, np.bool_)
    while True:
        worst, most = 0, -math.inf
        for k in range(rows):
            needed = -(p[k] * omega + q[k] * acceleration + c[k])
            if needed > most:
                worst, most = k, needed
        if most <= slack or joined[worst]:
            return omega, acceleration, slack
        joined[worst] = True
        omega, acceleration, slack = _enumerated(
            p[joined], q[joined], c[joined], desired_omega, desired_acceleration, weights, slack_is_free, box
        )


@njit(cache=True)
def _enumerated(
    p: np.ndarray,
    q: np.ndarray,
    c: np.ndarray,
    desired_omega: float,
    desired_acceleration: float,
    weights: np.ndarray,
    slack_is_free: bool,
    box: np.ndarray,
) -> tuple[float, float, float]:
    """Return the solution for a few rows; arguments and result as of `least_cost_control`.

    With t eliminated the cost is a separable quadratic plus λ_3 times the largest of n affine pieces −(p ω + q a + c)
    (and of 0 in MI). Its minimiser is the minimiser over the box of one piece, or over a segment where two pieces
    are equal, or the point where three are. All of those lie in the box, so the cheapest is the solution: there is no
    tolerance and nothing that can fail. O(K⁴), a microsecond for K <= 3.
    """
    rows = len(p)
    pieces = rows if slack_is_free else rows + 1
    scale_omega, scale_a = math.sqrt(weights[0]), math.sqrt(weights[1])
    slope = np.zeros((pieces, 2))
    offset = np.zeros(pieces)
    for k in range(rows):
        slope[k, 0] = -p[k] / scale_omega
        slope[k, 1] = -q[k] / scale_a
        offset[k] = -c[k]
    low = np.array([box[0] * scale_omega, box[2] * scale_a])
    high = np.array([box[1] * scale_omega, box[3] * scale_a])
    target = np.array([desired_omega * scale_omega, desired_acceleration * scale_a])

    problem = _ScaledProblem(slope, offset, target, weights[2], low, high)

    best = np.array([math.inf, 0.0, 0.0, 0.0])  # cost, point, slack
    if pieces == 0:
        x, y = min(max(target[0], low[0]), high[0]), min(max(target[1], low[1]), high[1])
        return x / scale_omega, y / scale_a, 0.0
    for i in range(pieces):
        # A separable quadratic over a box: clip each coordinate.
        x = min(max(target[0] - 0.5 * weights[2] * slope[i, 0], low[0]), high[0])
        y = min(max(target[1] - 0.5 * weights[2] * slope[i, 1], low[1]), high[1])
        _keep_cheaper(x, y, problem, best)
        for j in range(i + 1, pieces):
            _try_equal_pair(i, j, problem, best)
            for k in range(j + 1, pieces):
                _try_equal_triple(i, j, k, problem, best)
    omega = min(max(best[1] / scale_omega, box[0]), box[1])
    acceleration = min(max(best[2] / scale_a, box[2]), box[3])
    return omega, acceleration, best[3]


@njit(cache=True)
def _keep_cheaper(x: float, y: float, problem: _ScaledProblem, best: np.ndarray) -> None:
    slope, offset, target = problem.slope, problem.offset, problem.target
    slack = -math.inf
    for k in range(len(offset)):
        slack = max(slack, slope[k, 0] * x + slope[k, 1] * y + offset[k])
    cost = (x - target[0]) ** 2 + (y - target[1]) ** 2 + problem.slack_weight * slack
    if cost < best[0]:
        best[0], best[1], best[2], best[3] = cost, x, y, slack


@njit(cache=True)
def _try_equal_pair(i: int, j: int, problem: _ScaledProblem, best: np.ndarray) -> None:
    slope, offset, target, slack_weight, low, high = problem
    normal_x, normal_y = slope[i, 0] - slope[j, 0], slope[i, 1] - slope[j, 1]
    length = math.hypot(normal_x, normal_y)
    if length == 0.0:  # the same row twice, or parallel ones
        return
    normal_x /= length
    normal_y /= length
    direction = (-normal_y, normal_x)
    # From the target's foot on the line, the distance along it that balances the piece's slope ...
    to_line = (offset[j] - offset[i]) / length - normal_x * target[0] - normal_y * target[1]
    foot = (target[0] + to_line * normal_x, target[1] + to_line * normal_y)
    along = -0.5 * slack_weight * (slope[i, 0] * direction[0] + slope[i, 1] * direction[1])
    # ... within the part of the line that lies in the box.
    first, last = -math.inf, math.inf
    for axis in range(2):
        if direction[axis] == 0.0:
            if foot[axis] < low[axis] or foot[axis] > high[axis]:
                return
            continue
        one = (low[axis] - foot[axis]) / direction[axis]
        other = (high[axis] - foot[axis]) / direction[axis]
        first, last = max(first, min(one, other)), min(last, max(one, other))
    if first > last:
        return
    along = min(max(along, first), last)
    x = min(max(foot[0] + along * direction[0], low[0]), high[0])
    y = min(max(foot[1] + along * direction[1], low[1]), high[1])
    _keep_cheaper(x, y, problem, best)


@njit(cache=True)
def _try_equal_triple(i: int, j: int, k: int, problem: _ScaledProblem, best: np.ndarray) -> None:
    slope, offset, _, _, low, high = problem
    a, b, e = slope[i, 0] - slope[j, 0], slope[i, 1] - slope[j, 1], offset[j] - offset[i]
    c, d, f = slope[i, 0] - slope[k, 0], slope[i, 1] - slope[k, 1], offset[k] - offset[i]
    determinant = a * d - b * c
    if determinant == 0.0:
        return
    x, y = (e * d - b * f) / determinant, (a * f - e * c) / determinant
    if low[0] <= x <= high[0] and low[1] <= y <= high[1]:
        _keep_cheaper(x, y, problem, best)
