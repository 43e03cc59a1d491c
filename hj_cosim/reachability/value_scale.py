"""A scale for V on which it is nearly as smooth as a distance, so that it may be interpolated (jitted).

V(0, ·) is a cubic of the lateral gap: between two nodes of the heading it can fall from 100 m to 0. Its gradient's
sign is lost when such values are interpolated. On this scale, s(V) = sign(V) (∛(|V|/4 + c³) − c), the cubic of a gap
is the gap again, as far as it is longer than c. The softening c keeps the slope of s finite at V = 0, where the
longitudinal distance, which is linear, passes through.
"""

import math

import numpy as np
from numba import njit

SOFTENING = 0.5  # c, m of lateral gap
_CUBED = SOFTENING**3


@njit(cache=True)
def scaled(value: float) -> float:
    """Return s(V); odd and increasing."""
    return math.copysign(np.cbrt(0.25 * abs(value) + _CUBED) - SOFTENING, value)


@njit(cache=True)
def unscaled(scaled_value: float) -> float:
    """Return V, m, of which `scaled_value` is s(V)."""
    root = abs(scaled_value) + SOFTENING
    return math.copysign(4.0 * (root * root * root - _CUBED), scaled_value)


@njit(cache=True)
def steepness(scaled_value: float) -> float:
    """Return dV/ds, m per unit of s; at least 12 c²."""
    root = abs(scaled_value) + SOFTENING
    return 12.0 * root * root
