"""A scale for V on which it is nearly as smooth as a distance, so that it may be interpolated (jitted).

V(0, ·) is a cubic of the lateral gap: between two nodes of the heading it can fall from 100 m to 0. Its gradient's
sign is lost when such values are interpolated. On this scale, s(V) = sign(V) (∛(|V|/4 + c³) − c), the cubic of a gap
is the gap again, as far as it is longer than c. The softening c keeps the slope of s finite at V = 0, where the
longitudinal distance, which is linear, passes through.
"""

import math

import numpy as np

from hj_cosim.kernels import kernel

SOFTENING = 0.5  # c, m of lateral gap
_CUBED = SOFTENING**3
_THIRD_OF_BIAS = 0x2A9F7893782DA1CE  # two thirds of the exponent's bias, less what makes the error even


@kernel
def cube_root(number: float) -> float:
    """Return ∛x of a positive normal x, to 1e-14 of it.

    Look-ups take one for every car, and the C library's takes three times as long. A third of the exponent's bits is a
    root to 3 % (Kahan's trick), and Halley's step cubes the error.
    """
    bits = np.float64(number).view(np.int64)
    root = np.int64(bits // 3 + _THIRD_OF_BIAS).view(np.float64)
    for _ in range(2):
        cube = root * root * root
        root *= (cube + 2.0 * number) / (2.0 * cube + number)
    return root


@kernel
def scaled(value: float) -> float:
    """Return s(V); odd and increasing."""
    return math.copysign(cube_root(0.25 * abs(value) + _CUBED) - SOFTENING, value)


@kernel
def unscaled(scaled_value: float) -> float:
    """Return V, m, of which `scaled_value` is s(V)."""
    root = abs(scaled_value) + SOFTENING
    return math.copysign(4.0 * (root * root * root - _CUBED), scaled_value)


@kernel
def steepness(scaled_value: float) -> float:
    """Return dV/ds, m per unit of s; at least 12 c²."""
    root = abs(scaled_value) + SOFTENING
    return 12.0 * root * root


@kernel
def slowest_rise(value: float, limit: float, approach: float) -> float:
    """Return dV/dt, m/s, of a V above a limit that comes as near as it may: ds/dt = −γ (s(V) − s(limit)).

    Args:
        value: V, m.
        limit: m, below V.
        approach: γ, 1/s.
    """
    scale = scaled(value)
    return -approach * steepness(scale) * (scale - scaled(limit))
