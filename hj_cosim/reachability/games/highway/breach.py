"""Who is seen to break a duty that the game `responsible` counts on (`other_car`; jitted).

V among cars that do their duties promises nothing of one that does not. Seen is how a car moves now: across the road
towards a robot that it has to leave room beside, or on at a robot that it has to brake for. Who turns farther than the
table takes a car to turn, as slow ones do who change lanes, breaks no duty by that alone. A car that moves across
cannot stop at once, as the game's can, so that a breach is foreseen where it would break its duty by going on for a
moment. Beyond doubt is only what it did not have the right to do a moment ago, either.

Who follows owes more distance than drivers keep: at 22 m/s 41 m, where they keep 25 to 30, and on narrow lanes who is
beside owes it too. That alone is no breach. It is one in the robot's way, where the two would come together if both
braked as hard as the duty says.
"""

import math

from hj_cosim.kernels import kernel
from hj_cosim.reachability.games.highway.other_car import BESIDE, Disturbance, allowed

DOES_DUTIES, WILL_BREAK, BREAKS = 0, 1, 2
FORESIGHT = 0.7  # s
# What ordinary drivers exceed their duties by, in sensing and in keeping to their lane.
ACROSS, ALONG = 0.3, 1.0  # m/s, m/s²
IN_THE_WAY = 0.5  # m between two sides, up to which who is behind is in the robot's way
# How far the state of a step ago, to which what is seen belongs, may be from that of now; and what else it may change.
DOUBT_ALONG, DOUBT_ACROSS, DOUBT_OF_BRAKING = 1.5, 0.2, 2.0  # m, m, m/s²


@kernel
def breach(
    other: Disturbance, p_x: float, p_y: float, leftwards: float, v_r: float, v_o: float, sine: float, gain: float
) -> int:
    """Return whether a car moves as its duties forbid: DOES_DUTIES, WILL_BREAK one if it goes on, or BREAKS one.

    Args:
        other: what is assumed of it; who has no duties breaks none.
        p_x, p_y: robot − other, m.
        leftwards: v_r sin θ of the robot, m/s.
        v_r, v_o: m/s.
        sine: sin θ_o, of its heading.
        gain: a_o, m/s².
    """
    if not other.responsible:
        return DOES_DUTIES
    across = v_o * sine
    comes_nearer = abs(across) > ACROSS and across * p_y > 0.0
    bound = other.width + other.side_margin + BESIDE
    # Who goes along beside or ahead has nothing to break; most cars are told apart here.
    if not comes_nearer and (p_x < -DOUBT_ALONG or abs(p_y) > bound + DOUBT_ACROSS):
        return DOES_DUTIES
    right, left, most = 0.0, 0.0, -math.inf  # the most that may have been allowed
    farther = p_x + math.copysign(DOUBT_ALONG, p_x)
    for x in (farther, -farther if abs(p_x) < DOUBT_ALONG else farther):
        for y in (p_y - DOUBT_ACROSS, p_y + DOUBT_ACROSS):
            before = allowed(other, x, y, leftwards, v_r, v_o)
            right, left, most = min(right, before.right), max(left, before.left), max(most, before.most)
    comes_on = _comes_on(other, p_x + DOUBT_ALONG, abs(p_y) + DOUBT_ACROSS, v_r, v_o)
    presses_in = _is_beyond(other, right, left, v_o, across)
    if presses_in or (comes_on and gain > most + DOUBT_OF_BRAKING + ALONG):
        return BREAKS
    comes_on = _comes_on(other, p_x, abs(p_y), v_r, v_o)
    if comes_on and gain > allowed(other, p_x, p_y, leftwards, v_r, v_o).most + ALONG:
        return WILL_BREAK
    if not comes_nearer:
        return DOES_DUTIES
    nearer = math.copysign(max(abs(p_y) - FORESIGHT * abs(across), 0.0), p_y)
    then = allowed(other, p_x, nearer, leftwards, v_r, v_o)
    return WILL_BREAK if _is_beyond(other, then.right, then.left, v_o, across) else DOES_DUTIES


@kernel
def _comes_on(other: Disturbance, p_x: float, beside: float, v_r: float, v_o: float) -> bool:
    """Return whether a car in the robot's way would be within the standing gap of it, both braking with b_min."""
    gained = max(v_o * v_o - v_r * v_r, 0.0) / (2.0 * other.brake_min)
    return beside < other.width + IN_THE_WAY and p_x - other.length - gained < other.standing_gap


@kernel
def _is_beyond(other: Disturbance, right: float, left: float, speed: float, across: float) -> bool:
    """Return whether a speed across the road, m/s, is beyond what a duty leaves of it.

    The duty leaves a share of what the car could do if it had none: the least and the greatest sin θ_o, `right` and
    `left`, as a share of the heading limit's, of what that limit makes at its speed or of what it does if that is more.
    """
    sine = math.sin(other.heading_max)
    share = (left if across > 0.0 else -right) / sine
    return abs(across) > share * max(abs(across), speed * sine) + ACROSS
