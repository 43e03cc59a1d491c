"""The least of V(0, ·) = max(gap along, 4 (gap across)³) between two instants, where both gaps go straight (jitted)."""

import math

from hj_cosim.kernels import kernel

_ROOT_STEPS = 80
_ROOT_TOLERANCE = 1e-9  # m


@kernel
def least_between(along_0: float, across_0: float, along_1: float, across_1: float) -> float:
    """Return the least of max(along, 4 across³), m, where `along` and `across` go straight from one value to another.

    Both of the two rise or fall all the way. So the least lies at an end, or where one falls and the other rises, at
    the one place at which they are equal. That is sought by Newton's rule as long as it halves the difference, and by
    bisection else; beside it the smaller of the two is less than at it, so that what is returned is never too high.
    """
    cubic_0, cubic_1 = 4.0 * across_0 * across_0 * across_0, 4.0 * across_1 * across_1 * across_1
    before, after = along_0 - cubic_0, along_1 - cubic_1
    along_rise, across_rise = along_1 - along_0, across_1 - across_0
    if (before > 0.0) == (after > 0.0) or (along_rise > 0.0) == (across_rise > 0.0):
        return min(max(along_0, cubic_0), max(along_1, cubic_1))
    low, high, least, last = 0.0, 1.0, -math.inf, math.inf
    share = before / (before - after)
    for _ in range(_ROOT_STEPS):
        along, across = along_0 + share * along_rise, across_0 + share * across_rise
        cubic = 4.0 * across * across * across
        difference = along - cubic
        least = max(least, min(along, cubic))
        if abs(difference) <= _ROOT_TOLERANCE:
            break
        if (difference > 0.0) == (before > 0.0):
            low = share
        else:
            high = share
        slope = along_rise - 12.0 * across * across * across_rise  # not 0, for the two terms have one sign
        share -= difference / slope
        if not low < share < high or abs(difference) > 0.5 * last:
            share = 0.5 * (low + high)
        last = abs(difference)
    return least


@kernel
def least_of_step(along: tuple[float, float], across: tuple[float, float], known: float) -> float:
    """Return the least of max(along, 4 across³) in a step, or `known` if that is less."""
    nearest = min(across[0], across[1])
    if min(along[0], along[1]) >= known or 4.0 * nearest * nearest * nearest >= known:
        return known
    return min(known, least_between(along[0], across[0], along[1], across[1]))
