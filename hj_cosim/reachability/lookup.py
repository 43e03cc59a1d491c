"""Multilinear look-ups in the five-dimensional table, for the planner and the filter (jitted), and in any other.

Outside the grid in p_x or p_y another car is safe: V = +inf with a zero gradient. The heading and the speeds are
clamped to the grid, and the gradient in a clamped coordinate is that of the nearest cell.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit


class TableArrays(NamedTuple):
    """A highway value table as jitted code takes it; the state is (p_x_rel, p_y_rel, θ_r, v_r, v_o)."""

    values: np.ndarray  # float32, C order, 5 axes
    lower: np.ndarray  # (5,) float64, the first nodes
    inverse_spacing: np.ndarray  # (5,) float64


@njit(cache=True)
def _cell(coordinate: float, nodes: int) -> tuple[int, float]:
    """Return the cell that a coordinate in units of the spacing lies in, and where in it, clamped to the grid."""
    clamped = min(max(coordinate, 0.0), nodes - 1.0)
    cell = min(int(clamped), nodes - 2)
    return cell, clamped - cell


@njit(cache=True)
def _is_outside(table: TableArrays, p_x: float, p_y: float) -> bool:
    x = (p_x - table.lower[0]) * table.inverse_spacing[0]
    y = (p_y - table.lower[1]) * table.inverse_spacing[1]
    inside = 0.0 <= x <= table.values.shape[0] - 1 and 0.0 <= y <= table.values.shape[1] - 1
    return not inside


@njit(cache=True)
def value_at(table: TableArrays, p_x: float, p_y: float, theta: float, v_r: float, v_o: float) -> float:
    """Return V, m; +inf outside the grid in p_x or p_y."""
    if _is_outside(table, p_x, p_y):
        return math.inf
    lower, inverse, shape = table.lower, table.inverse_spacing, table.values.shape
    i, s = _cell((p_x - lower[0]) * inverse[0], shape[0])
    j, t = _cell((p_y - lower[1]) * inverse[1], shape[1])
    k, u = _cell((theta - lower[2]) * inverse[2], shape[2])
    m, w = _cell((v_r - lower[3]) * inverse[3], shape[3])
    n, z = _cell((v_o - lower[4]) * inverse[4], shape[4])
    total = 0.0
    for a in range(2):
        weight_a = s if a else 1.0 - s
        for b in range(2):
            weight_b = weight_a * (t if b else 1.0 - t)
            for c in range(2):
                weight_c = weight_b * (u if c else 1.0 - u)
                row = table.values[i + a, j + b, k + c]
                near = row[m, n] + z * (row[m, n + 1] - row[m, n])
                far = row[m + 1, n] + z * (row[m + 1, n + 1] - row[m + 1, n])
                total += weight_c * (near + w * (far - near))
    return total


@njit(cache=True)
def value_and_gradient_at(
    table: TableArrays, p_x: float, p_y: float, theta: float, v_r: float, v_o: float, gradient_out: np.ndarray
) -> float:
    """Return V and write ∂V/∂x, (5,), per state unit; +inf and zeros outside the grid in p_x or p_y."""
    if _is_outside(table, p_x, p_y):
        for axis in range(5):
            gradient_out[axis] = 0.0
        return math.inf
    lower, inverse, shape = table.lower, table.inverse_spacing, table.values.shape
    i, s = _cell((p_x - lower[0]) * inverse[0], shape[0])
    j, t = _cell((p_y - lower[1]) * inverse[1], shape[1])
    k, u = _cell((theta - lower[2]) * inverse[2], shape[2])
    m, w = _cell((v_r - lower[3]) * inverse[3], shape[3])
    n, z = _cell((v_o - lower[4]) * inverse[4], shape[4])
    value = 0.0
    slope_x, slope_y, slope_theta, slope_r, slope_o = 0.0, 0.0, 0.0, 0.0, 0.0
    # Eight corners in position and heading; in each the two speeds are interpolated at once.
    for a in range(2):
        weight_a, sign_a = (s, 1.0) if a else (1.0 - s, -1.0)
        for b in range(2):
            weight_b, sign_b = (t, 1.0) if b else (1.0 - t, -1.0)
            for c in range(2):
                weight_c, sign_c = (u, 1.0) if c else (1.0 - u, -1.0)
                row = table.values[i + a, j + b, k + c]
                v00, v01, v10, v11 = row[m, n], row[m, n + 1], row[m + 1, n], row[m + 1, n + 1]
                near, far = v00 + z * (v01 - v00), v10 + z * (v11 - v10)
                here = near + w * (far - near)
                weight = weight_a * weight_b * weight_c
                value += weight * here
                slope_x += sign_a * weight_b * weight_c * here
                slope_y += sign_b * weight_a * weight_c * here
                slope_theta += sign_c * weight_a * weight_b * here
                slope_r += weight * (far - near)
                slope_o += weight * ((v01 - v00) + w * ((v11 - v10) - (v01 - v00)))
    gradient_out[0] = slope_x * inverse[0]
    gradient_out[1] = slope_y * inverse[1]
    gradient_out[2] = slope_theta * inverse[2]
    gradient_out[3] = slope_r * inverse[3]
    gradient_out[4] = slope_o * inverse[4]
    return value


@njit(cache=True)
def values_and_gradients(table: TableArrays, states: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return V (N,) and ∂V/∂x (N, 5) at `states` (N, 5)."""
    values = np.empty(states.shape[0])
    gradients = np.empty((states.shape[0], 5))
    for row in range(states.shape[0]):
        values[row] = value_and_gradient_at(
            table, states[row, 0], states[row, 1], states[row, 2], states[row, 3], states[row, 4], gradients[row]
        )
    return values, gradients
