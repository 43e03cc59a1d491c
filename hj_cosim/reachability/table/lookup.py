"""Look-ups in the five-dimensional table, for the planner and the filter (jitted).

V is looked up as s(V) = s(V0) − W: V0 = V(0, ·) by its formula, the deficit W = s(V0) − s(V) >= 0 by multilinear
interpolation between the nodes, and s the scale of `value_scale`. So V <= V0 holds between the nodes as at them, and no
state of the target set is ever taken for safe. Interpolating V itself is wrong by metres wherever V0 has its kinks,
and to the unsafe side: |p_x| − d_long moves by some 20 m from one speed node to the next, and d_lat's floor lies far
below it. Interpolating V0 − V is right to metres, but where V0 is a cubic that falls to 0 within a cell, the slope of
V0 − V drowns V0's own, and a robot that steers towards the other car seems to gain by it.

The grid's first axis may be sheared, ξ = p_x − k (v_o² − v_r²), see `systems.highway`: look-ups take states, find ξ
themselves, and give the slopes of V along the state.

Outside the grid along the road another car is safe: V = +inf with a zero gradient. Beside the grid it is so too where
the game has no V(0, ·), and V is V(0, ·) where it has: +inf there let a robot that came back fast, and turned towards
the car, fall by 100 m from one step to the next. The heading and the speeds are clamped to the grid, and the gradient
in a clamped coordinate is that of the nearest cell. With a heading beyond the grid nothing is ever called safe: V is at
most 0. `interpolation` serves tables of any dimension.

Interpolation goes axis by axis, the speeds first, and carries the slopes along: a third of the work of weighing all
32 corners for the value and every slope. Corners are offsets into the flat table, unsigned, which spares the index
arithmetic of five axes and a test for negative indices at every corner.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from hj_cosim.kernels import kernel
from hj_cosim.reachability.games.highway.target import (
    target_and_gradient_at,
    target_at,
)
from hj_cosim.reachability.table.table_arrays import TableGrid
from hj_cosim.reachability.table.value_scale import scaled, steepness, unscaled

_ONE = np.uint64(1)
_FAR_ASIDE = 1e6  # m from the other car's line, beyond which nothing is asked: cubes of it would not stay numbers
_HEADING_ROUNDING = 1e-6  # rad beyond the grid that still count as on its edge


class Cell(NamedTuple):
    """The cell that a state lies in: its first corner, the steps to the others, and where in it the state is."""

    corner: np.uint64  # offset into the flat table
    step_x: np.uint64  # to the next node along p_x, p_y, θ, v_r; along v_o it is 1
    step_y: np.uint64
    step_theta: np.uint64
    step_r: np.uint64
    x: float  # shares of the spacing, float32
    y: float
    theta: float
    r: float
    o: float


@kernel
def _clamped(grid: TableGrid, axis: int, coordinate: float) -> float:
    return min(max(coordinate, grid.lower[axis]), grid.upper[axis])


@kernel
def _target(grid: TableGrid, p_x: float, p_y: float, theta: float, v_r: float, v_o: float) -> float:
    """Return V0, m, with heading and speeds clamped to the grid."""
    theta, v_r, v_o = _clamped(grid, 2, theta), _clamped(grid, 3, v_r), _clamped(grid, 4, v_o)
    return target_at(grid.target, p_x, p_y, theta, v_r, v_o)


@kernel
def _target_and_gradient(
    grid: TableGrid, p_x: float, p_y: float, theta: float, v_r: float, v_o: float
) -> tuple[float, float, float, float, float, float]:
    """Return V0 and its slopes, likewise."""
    theta, v_r, v_o = _clamped(grid, 2, theta), _clamped(grid, 3, v_r), _clamped(grid, 4, v_o)
    return target_and_gradient_at(grid.target, p_x, p_y, theta, v_r, v_o)


@kernel
def _place(coordinate: float, nodes: int) -> tuple[np.uint64, float]:
    """Return the cell that a coordinate in units of the spacing lies in, and where in it, clamped to the grid."""
    clamped = min(max(coordinate, 0.0), nodes - 1.0)
    cell = min(int(clamped), nodes - 2)
    return np.uint64(cell), np.float32(clamped - cell)  # type: ignore[return-value]


@kernel
def shift_of_grid(grid: TableGrid, v_r: float, v_o: float) -> float:
    """Return p_x − ξ = k (v_o² − v_r²), m: how far the grid lies ahead of where its first axis says."""
    v_r, v_o = _clamped(grid, 3, v_r), _clamped(grid, 4, v_o)
    return grid.braking_shear * (v_o * v_o - v_r * v_r)


@kernel
def _is_outside(grid: TableGrid, axis: int, coordinate: float) -> bool:
    place = (coordinate - grid.lower[axis]) * grid.inverse_spacing[axis]
    return not (place >= 0.0 and place <= grid.shape[axis] - 1)


@kernel
def _claimed(grid: TableGrid, theta: float, value: float) -> float:
    """Return V, or what is left to say of it where the table knows nothing of the heading."""
    if grid.lower[2] - _HEADING_ROUNDING <= theta <= grid.upper[2] + _HEADING_ROUNDING:
        return value
    return min(value, 0.0)


@kernel
def _cell_of(grid: TableGrid, xi: float, p_y: float, theta: float, v_r: float, v_o: float) -> Cell:
    lower, inverse, shape = grid.lower, grid.inverse_spacing, grid.shape
    i, x = _place((xi - lower[0]) * inverse[0], shape[0])
    j, y = _place((p_y - lower[1]) * inverse[1], shape[1])
    k, t = _place((theta - lower[2]) * inverse[2], shape[2])
    m, r = _place((v_r - lower[3]) * inverse[3], shape[3])
    n, o = _place((v_o - lower[4]) * inverse[4], shape[4])
    step_r = np.uint64(shape[4])
    step_theta = step_r * np.uint64(shape[3])
    step_y = step_theta * np.uint64(shape[2])
    step_x = step_y * np.uint64(shape[1])
    corner = np.uint64(grid.begin) + i * step_x + j * step_y + k * step_theta + m * step_r + n
    return Cell(corner, step_x, step_y, step_theta, step_r, x, y, t, r, o)


@kernel
def _over_speeds(flat: np.ndarray, corner: np.uint64, cell: Cell) -> tuple[float, float, float]:
    """Return value, slope in v_r and slope in v_o (per cell) at a node in position and heading."""
    above = corner + cell.step_r
    slow, fast = flat[corner], flat[above]
    slow_rise, fast_rise = flat[corner + _ONE] - slow, flat[above + _ONE] - fast
    low = slow + cell.o * slow_rise
    rise = fast + cell.o * fast_rise - low
    return low + cell.r * rise, rise, slow_rise + cell.r * (fast_rise - slow_rise)


@kernel
def _over_headings(flat: np.ndarray, corner: np.uint64, cell: Cell) -> tuple[float, float, float, float]:
    """Return value and slopes in θ, v_r, v_o at a node in position."""
    share = cell.theta
    low, low_r, low_o = _over_speeds(flat, corner, cell)
    high, high_r, high_o = _over_speeds(flat, corner + cell.step_theta, cell)
    rise = high - low
    return low + share * rise, rise, low_r + share * (high_r - low_r), low_o + share * (high_o - low_o)


@kernel
def _over_width(flat: np.ndarray, corner: np.uint64, cell: Cell) -> tuple[float, float, float, float, float]:
    """Return value and slopes in p_y, θ, v_r, v_o at a node in p_x."""
    share = cell.y
    low, low_t, low_r, low_o = _over_headings(flat, corner, cell)
    high, high_t, high_r, high_o = _over_headings(flat, corner + cell.step_y, cell)
    rise = high - low
    return (
        low + share * rise,
        rise,
        low_t + share * (high_t - low_t),
        low_r + share * (high_r - low_r),
        low_o + share * (high_o - low_o),
    )


@kernel
def value_and_gradient_at(
    flat: np.ndarray,
    grid: TableGrid,
    p_x: float,
    p_y: float,
    theta: float,
    v_r: float,
    v_o: float,
    gradient_out: np.ndarray,
) -> float:
    """Return V and write ∂V/∂x, (5,), per state unit; outside the grid as said above."""
    xi, is_beside = p_x - shift_of_grid(grid, v_r, v_o), _is_outside(grid, 1, p_y)
    if _is_outside(grid, 0, xi) or (is_beside and not (grid.has_target and abs(p_y) <= _FAR_ASIDE)):
        for axis in range(5):
            gradient_out[axis] = 0.0
        return math.inf
    if is_beside:
        target, by_x, by_y, by_theta, by_r, by_o = _target_and_gradient(grid, p_x, p_y, theta, v_r, v_o)
        gradient_out[0], gradient_out[1], gradient_out[2] = by_x, by_y, by_theta
        gradient_out[3], gradient_out[4] = by_r, by_o
        return _claimed(grid, theta, target)
    cell = _cell_of(grid, xi, p_y, theta, v_r, v_o)
    share, inverse = cell.x, grid.inverse_spacing
    low, low_y, low_t, low_r, low_o = _over_width(flat, cell.corner, cell)
    high, high_y, high_t, high_r, high_o = _over_width(flat, cell.corner + cell.step_x, cell)
    deficit = float(low + share * (high - low))
    gradient_out[0] = -(high - low) * inverse[0]
    gradient_out[1] = -(low_y + share * (high_y - low_y)) * inverse[1]
    gradient_out[2] = -(low_t + share * (high_t - low_t)) * inverse[2]
    gradient_out[3] = -(low_r + share * (high_r - low_r)) * inverse[3]
    gradient_out[4] = -(low_o + share * (high_o - low_o)) * inverse[4]
    return _value_and_slopes(grid, p_x, p_y, theta, v_r, v_o, deficit, gradient_out)


@kernel
def _is_flat(gradient: np.ndarray) -> bool:
    return gradient[0] == gradient[1] == gradient[2] == gradient[3] == gradient[4] == 0.0


# Eight parameters, the last of them what is written.
@kernel
def _value_and_slopes(
    grid: TableGrid,
    p_x: float,
    p_y: float,
    theta: float,
    v_r: float,
    v_o: float,
    deficit: float,
    gradient_out: np.ndarray,
) -> float:
    """Return V of a deficit, and turn −∂W along the grid's axes into ∂V/∂x, (5,)."""
    # ξ changes with the speeds.
    gradient_out[3] += 2.0 * grid.braking_shear * _clamped(grid, 3, v_r) * gradient_out[0]
    gradient_out[4] -= 2.0 * grid.braking_shear * _clamped(grid, 4, v_o) * gradient_out[0]
    if not grid.has_target:
        return _claimed(grid, theta, -deficit)
    target, by_x, by_y, by_theta, by_r, by_o = _target_and_gradient(grid, p_x, p_y, theta, v_r, v_o)
    if deficit == 0.0 and _is_flat(gradient_out):
        gradient_out[0], gradient_out[1], gradient_out[2] = by_x, by_y, by_theta
        gradient_out[3], gradient_out[4] = by_r, by_o
        return _claimed(grid, theta, target)
    scaled_target = scaled(target)
    scaled_value = scaled_target - deficit
    # ∇V = dV/ds (∇V0 / (dV0/ds) − ∇W)
    steep = steepness(scaled_value)
    share_of_target = steep / steepness(scaled_target)
    gradient_out[0] = share_of_target * by_x + steep * gradient_out[0]
    gradient_out[1] = share_of_target * by_y + steep * gradient_out[1]
    gradient_out[2] = share_of_target * by_theta + steep * gradient_out[2]
    gradient_out[3] = share_of_target * by_r + steep * gradient_out[3]
    gradient_out[4] = share_of_target * by_o + steep * gradient_out[4]
    return _claimed(grid, theta, unscaled(scaled_value))


@kernel
def _deficit(flat: np.ndarray, grid: TableGrid, place: tuple[float, float, float, float, float]) -> float:
    """Return W at a place in the grid's coordinates, clamped to the grid."""
    cell = _cell_of(grid, place[0], place[1], place[2], place[3], place[4])
    low = _over_width(flat, cell.corner, cell)[0]
    high = _over_width(flat, cell.corner + cell.step_x, cell)[0]
    return float(low + cell.x * (high - low))


@kernel
def smooth_gradient_at(
    flat: np.ndarray,
    grid: TableGrid,
    p_x: float,
    p_y: float,
    theta: float,
    v_r: float,
    v_o: float,
    gradient_out: np.ndarray,
) -> float:
    """Return V and write ∂V/∂x as `value_and_gradient_at` does, but with slopes of W that do not jump between cells.

    Along each axis it is the slope of W's mean over a cell's width around the state. Between two cells the slope of W
    itself may change its sign, and a filter that follows it steers left and right in turn, 50 times a second.
    """
    xi = p_x - shift_of_grid(grid, v_r, v_o)
    if _is_outside(grid, 0, xi) or _is_outside(grid, 1, p_y):
        return value_and_gradient_at(flat, grid, p_x, p_y, theta, v_r, v_o, gradient_out)
    here = (xi, p_y, theta, v_r, v_o)
    for axis in range(5):
        middle, half = _clamped(grid, axis, here[axis]), 0.5 / grid.inverse_spacing[axis]
        low, high = _clamped(grid, axis, middle - half), _clamped(grid, axis, middle + half)
        rise = _deficit(flat, grid, _moved(here, axis, high)) - _deficit(flat, grid, _moved(here, axis, low))
        gradient_out[axis] = -rise / (high - low)
    return _value_and_slopes(grid, p_x, p_y, theta, v_r, v_o, _deficit(flat, grid, here), gradient_out)


@kernel
def _moved(
    place: tuple[float, float, float, float, float], axis: int, to: float
) -> tuple[float, float, float, float, float]:
    """Return a place with one of its coordinates replaced."""
    return (
        to if axis == 0 else place[0],
        to if axis == 1 else place[1],
        to if axis == 2 else place[2],
        to if axis == 3 else place[3],
        to if axis == 4 else place[4],
    )


@kernel
def value_at(flat: np.ndarray, grid: TableGrid, p_x: float, p_y: float, theta: float, v_r: float, v_o: float) -> float:
    """Return V, m; outside the grid as said above."""
    xi, is_beside = p_x - shift_of_grid(grid, v_r, v_o), _is_outside(grid, 1, p_y)
    if _is_outside(grid, 0, xi) or (is_beside and not (grid.has_target and abs(p_y) <= _FAR_ASIDE)):
        return math.inf
    if is_beside:
        return _claimed(grid, theta, _target(grid, p_x, p_y, theta, v_r, v_o))
    cell = _cell_of(grid, xi, p_y, theta, v_r, v_o)
    # The slopes are not used, and the compiler leaves them out.
    low = _over_width(flat, cell.corner, cell)[0]
    high = _over_width(flat, cell.corner + cell.step_x, cell)[0]
    deficit = float(low + cell.x * (high - low))
    if not grid.has_target:
        return _claimed(grid, theta, -deficit)
    target = _target(grid, p_x, p_y, theta, v_r, v_o)
    return _claimed(grid, theta, unscaled(scaled(target) - deficit) if deficit > 0.0 else target)


@njit(cache=True)
def values_and_gradients(flat: np.ndarray, grid: TableGrid, states: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return V (N,) and ∂V/∂x (N, 5) at `states` (N, 5)."""
    values = np.empty(states.shape[0])
    gradients = np.empty((states.shape[0], 5))
    for row in range(states.shape[0]):
        values[row] = value_and_gradient_at(
            flat, grid, states[row, 0], states[row, 1], states[row, 2], states[row, 3], states[row, 4], gradients[row]
        )
    return values, gradients
