"""Multilinear interpolation in a table of any dimension; `lookup` has the fast one for the highway game."""

import numpy as np
from numba import njit


@njit(cache=True)
def interpolate(
    values: np.ndarray,
    shape: np.ndarray,
    lower: np.ndarray,
    inverse_spacing: np.ndarray,
    periodic: np.ndarray,
    safe_outside: np.ndarray,
    states: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Return value (N,) and gradient (N, n) at `states` (N, n).

    Args:
        values: all nodes in C order, flat.
        shape: (n,) int64.
        lower, inverse_spacing: (n,) float64.
        periodic: (n,) bool, axes that wrap.
        safe_outside: (n,) bool, axes beyond whose faces V = +inf with zero gradient; the others are clamped.
        states: float64.
    """
    count, dimension = states.shape
    result = np.empty(count)
    gradient = np.zeros((count, dimension))
    low, high = np.empty(dimension, np.int64), np.empty(dimension, np.int64)
    share = np.empty(dimension)
    for row in range(count):
        outside = False
        stride = 1
        for axis in range(dimension - 1, -1, -1):
            nodes = shape[axis]
            place = (states[row, axis] - lower[axis]) * inverse_spacing[axis]
            if periodic[axis]:
                place %= nodes  # exact, so that also a state many turns away has its cell in the table
                cell = min(int(place), nodes - 1)
            else:
                if safe_outside[axis] and not (0.0 <= place <= nodes - 1):
                    outside = True
                place = min(max(place, 0.0), nodes - 1.0)
                cell = min(int(place), nodes - 2)
            share[axis] = place - cell
            low[axis] = cell * stride
            high[axis] = (cell + 1) % nodes * stride
            stride *= nodes
        if outside:
            result[row] = np.inf
            continue
        result[row] = 0.0
        for corner in range(1 << dimension):
            offset = 0
            weight = 1.0
            for axis in range(dimension):
                upper = (corner >> axis) & 1
                offset += high[axis] if upper else low[axis]
                weight *= share[axis] if upper else 1.0 - share[axis]
            node_value = values[offset]
            result[row] += weight * node_value
            for axis in range(dimension):
                slope_weight = 1.0 if (corner >> axis) & 1 else -1.0
                for other in range(dimension):
                    if other != axis:
                        slope_weight *= share[other] if (corner >> other) & 1 else 1.0 - share[other]
                gradient[row, axis] += slope_weight * inverse_spacing[axis] * node_value
    return result, gradient
