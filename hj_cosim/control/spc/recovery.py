"""How fast V of a car in K has to come back, beyond the paper's rows, which only hold it (jitted)."""

from numba import njit


@njit(cache=True)
def recovery_rate(value: float, epsilon: float, recovery: float) -> float:
    """Return how fast V has to rise at the least, κ min(ε − V, ε), m/s.

    A table is wrong by something everywhere, so that a V which is merely held is lost bit by bit. Bounded, so that a
    car with which all is lost does not outweigh the others under the one shared slack.

    Args:
        value: V, m.
        epsilon: ε, m.
        recovery: κ, 1/s; 0 is the paper's.
    """
    return recovery * min(epsilon - value, epsilon)
