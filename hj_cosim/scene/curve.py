"""A cubic spline as a road's reference curve: places on it and beside it, and how it bends (jitted)."""

import math

import numpy as np
from numba import njit

from hj_cosim.kernels import kernel

_NEWTON_STEPS = 20
_CLOSE_ENOUGH = 1e-9  # m of s
# Of the way to a curve's centre: who is beyond is on the other side of it, where s and d mean nothing.
_SMALLEST_STRETCH = 0.05


@kernel
def curve_at(along: float, spacing: float, lap: float, coefficients: np.ndarray) -> tuple[float, ...]:
    """Return x, y, x', y', x'', y'' of the reference lane's centre line; straight on before its beginning and its end.

    Args:
        along: s, m.
        spacing: of the spline's knots, m of s.
        lap: the length of one lap of a closed road, m; 0 of an open one.
        coefficients: (2, 4, knots − 1), the highest power first.
    """
    if lap > 0.0:
        along = along % lap
    last = coefficients.shape[2] - 1
    piece = min(max(int(along / spacing), 0), last)
    inside = min(max(along - piece * spacing, 0.0), spacing)
    beyond = along - piece * spacing - inside
    a, b, c, d = (
        coefficients[0, 0, piece],
        coefficients[0, 1, piece],
        coefficients[0, 2, piece],
        coefficients[0, 3, piece],
    )
    e, f, g, h = (
        coefficients[1, 0, piece],
        coefficients[1, 1, piece],
        coefficients[1, 2, piece],
        coefficients[1, 3, piece],
    )
    x = ((a * inside + b) * inside + c) * inside + d
    y = ((e * inside + f) * inside + g) * inside + h
    x_1, y_1 = (3.0 * a * inside + 2.0 * b) * inside + c, (3.0 * e * inside + 2.0 * f) * inside + g
    if beyond != 0.0:
        return x + beyond * x_1, y + beyond * y_1, x_1, y_1, 0.0, 0.0
    return x, y, x_1, y_1, 6.0 * a * inside + 2.0 * b, 6.0 * e * inside + 2.0 * f


@kernel
def bend_and_stretch(
    along: float, offset: float, spacing: float, lap: float, coefficients: np.ndarray
) -> tuple[float, float]:
    """Return ψ', 1/m, and how many metres of the world a metre of s is, `offset` m to the left of the curve."""
    _, _, x_1, y_1, x_2, y_2 = curve_at(along, spacing, lap, coefficients)
    squared = x_1 * x_1 + y_1 * y_1
    bend = (x_1 * y_2 - y_1 * x_2) / squared
    return bend, max(math.sqrt(squared) - bend * offset, _SMALLEST_STRETCH)


@kernel
def place_on_curve(
    x: float, y: float, near: float, spacing: float, lap: float, coefficients: np.ndarray
) -> tuple[float, float, float]:
    """Return s, the offset to the left of the curve (m) and ψ (rad) of a place in the world, by Newton's method.

    Args:
        x, y: m.
        near: an s (m) at which to begin, not more than some ten metres away.
        spacing, lap, coefficients: as for curve_at.
    """
    along = near
    for _ in range(_NEWTON_STEPS):
        at_x, at_y, x_1, y_1, x_2, y_2 = curve_at(along, spacing, lap, coefficients)
        squared = x_1 * x_1 + y_1 * y_1
        from_x, from_y = x - at_x, y - at_y
        # |r'| − ψ' times the offset is what dr·r'/ds becomes, whatever the parameter.
        slope = squared - (from_x * x_2 + from_y * y_2)
        step = (from_x * x_1 + from_y * y_1) / max(slope, _SMALLEST_STRETCH * squared)
        along += step
        if abs(step) < _CLOSE_ENOUGH:
            break
    at_x, at_y, x_1, y_1, _, _ = curve_at(along, spacing, lap, coefficients)
    offset = (-(x - at_x) * y_1 + (y - at_y) * x_1) / math.sqrt(x_1 * x_1 + y_1 * y_1)
    return along, offset, math.atan2(y_1, x_1)


@kernel
def place_beside_curve(
    along: float, offset: float, spacing: float, lap: float, coefficients: np.ndarray
) -> tuple[float, float, float]:
    """Return x, y (m) and ψ (rad) of one place beside the curve."""
    at_x, at_y, x_1, y_1, _, _ = curve_at(along, spacing, lap, coefficients)
    norm = math.sqrt(x_1 * x_1 + y_1 * y_1)
    return at_x - offset * y_1 / norm, at_y + offset * x_1 / norm, math.atan2(y_1, x_1)


@njit(cache=True)
def places_beside_curve(
    along: np.ndarray, offset: np.ndarray, spacing: float, lap: float, coefficients: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return x, y (m) and ψ (rad), (N,) each, of places beside the curve."""
    x, y, direction = np.empty(len(along)), np.empty(len(along)), np.empty(len(along))
    for i in range(len(along)):
        x[i], y[i], direction[i] = place_beside_curve(along[i], offset[i], spacing, lap, coefficients)
    return x, y, direction


@njit(cache=True)
def sharpest_of_curve(
    along: np.ndarray, offset: np.ndarray, spacing: float, lap: float, coefficients: np.ndarray
) -> float:
    """Return the largest |curvature|, 1/m, at places (N,), m, on lanes `offset` (2, N) m to the left of the curve."""
    most = 0.0
    for i in range(len(along)):
        for side in range(2):
            bend, stretch = bend_and_stretch(along[i], offset[side, i], spacing, lap, coefficients)
            most = max(most, abs(bend) / stretch)
    return most
