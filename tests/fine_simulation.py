"""What a manoeuvre guarantees in the highway game, simulated in steps of 2 ms: the reference for its bounds.

Written from the game's words alone: at every instant the other car may be anywhere between hardest braking and
strongest acceleration, along the road, weaving or not, and as far aside as its heading allows; gaps are those of
V(0, ·), with bodies
turned by the robot's heading.
"""

import numpy as np
from numba import njit

STEP, DURATION = 0.002, 8.0  # s
LOST = -5.0  # m; how far below it a guarantee is does not matter


def guaranteed_by_simulation(
    parameters: dict[str, float],
    states: np.ndarray,
    heading: float,
    acceleration: float,
    top: float = 40.0,
    step: float = STEP,
) -> np.ndarray:
    """Return the least of max(gap along, gap across) of either side, the better one, (N,), m; if below LOST, any such.

    Args:
        parameters: of the highway game, all of them.
        states: (N, 5).
        heading, acceleration: of the manoeuvre, rad and m/s².
        top: m/s, the top speed of both cars.
        step: s.
    """
    names = (
        "omega_max", "other_heading_max", "other_acceleration_min", "other_acceleration_max", "length", "width",
        "response_time", "acceleration", "brake_min", "brake_max", "lateral_acceleration", "lateral_brake",
        "lateral_margin",
    )  # fmt: skip
    # Of the game with a time to collision; with none RSS's distances count.
    beyond = [parameters.get("time_to_collision", 0.0), parameters.get("gap_at_collision", 0.0)]
    numbers = np.array([*(parameters[name] for name in names), *beyond])
    return _simulate(numbers, states, heading, acceleration, top, step)


def near_by_simulation(
    parameters: dict[str, float], states: np.ndarray, heading: float, acceleration: float, within: float = 5.0
) -> tuple[np.ndarray, np.ndarray]:
    """Return which states, (N,) bool, a manoeuvre guarantees between -within and within, and how much it does there, m.

    Steps ten times as long tell which they may be, for they are wrong by far less than the 3 m that are allowed for.
    """
    near = np.abs(guaranteed_by_simulation(parameters, states, heading, acceleration, step=10.0 * STEP)) < within + 3.0
    simulated = guaranteed_by_simulation(parameters, states[near], heading, acceleration)
    near[near] = np.abs(simulated) < within
    return near, simulated[np.abs(simulated) < within]


@njit(cache=True)
def _longitudinal(rear: float, front: float, c: np.ndarray) -> float:
    rho, gain, least, most, time, gap = c[6], c[7], c[8], c[9], c[13], c[14]
    if time > 0.0:
        return max(gap + time * (rear - front), 0.0)
    after = rear + rho * gain
    return max(rear * rho + 0.5 * gain * rho * rho + after * after / (2.0 * least) - front * front / (2.0 * most), 0.0)


@njit(cache=True)
def _lateral(towards: float, rho: float, gain: float, brake: float, margin: float) -> float:
    # Both cars gain speed towards each other for ρ, then brake; the other one has no lateral speed to begin with.
    own, other = towards + rho * gain, rho * gain
    own_way = 0.5 * (towards + own) * rho + (own * own / (2.0 * brake) if own > 0.0 else 0.0)
    other_way = 0.5 * other * rho + other * other / (2.0 * brake)
    return max(own_way + other_way + margin, 0.0)


@njit(cache=True)
def _simulate(
    c: np.ndarray, states: np.ndarray, heading: float, acceleration: float, top: float, step: float
) -> np.ndarray:
    omega, angle, braking, gaining, length, width = c[0], c[1], c[2], c[3], c[4], c[5]
    rho, side_gain, side_brake, margin = c[6], c[10], c[11], c[12]
    found = np.empty(len(states))
    for i in range(len(states)):
        x, y, theta, v, slow = states[i]
        fast, least, most = slow, 0.0, 0.0
        lowest_left = lowest_right = np.inf
        for _ in range(round(DURATION / step) + 1):
            from_behind = _longitudinal(fast, v, c)
            to_the_front = _longitudinal(v, slow, c)
            if x > most:
                along = x - most - length - from_behind
            elif x < least:
                along = least - x - length - to_the_front
            else:
                along = -length - max(from_behind, to_the_front)
            sideways, leftwards = most * np.sin(angle), v * np.sin(theta)
            turned = 0.5 * (width + length * abs(np.sin(theta)) + width * np.cos(theta))
            apart = max(width + _lateral(-leftwards, rho, side_gain, side_brake, margin), turned)
            lowest_left = min(lowest_left, max(along, 4.0 * (y - sideways - apart) ** 3))
            apart = max(width + _lateral(leftwards, rho, side_gain, side_brake, margin), turned)
            lowest_right = min(lowest_right, max(along, 4.0 * (-y - sideways - apart) ** 3))
            if max(lowest_left, lowest_right) < LOST:
                break
            rest = heading - theta
            turn = min(max(rest, -omega * step), omega * step)
            v_new = min(max(v + acceleration * step, 0.0), top)
            x += 0.5 * (v + v_new) * step * np.cos(theta + 0.5 * turn)
            y += 0.5 * (v + v_new) * step * np.sin(theta + 0.5 * turn)
            theta, v = theta + turn, v_new
            slow_new, fast_new = max(slow + braking * step, 0.0), min(fast + gaining * step, top)
            least, most = least + 0.5 * (slow + slow_new) * step * np.cos(angle), most + 0.5 * (fast + fast_new) * step
            slow, fast = slow_new, fast_new
        found[i] = max(lowest_left, lowest_right)
    return found
