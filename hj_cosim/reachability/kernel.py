"""The solver's inner loop: one Runge-Kutta stage on a range of grid lines, fused into one pass over memory.

Why it has this shape:

- A solve is thousands of passes over the grid, so memory traffic decides. Each pass reads a line and its neighbours,
  and writes the line: derivatives, Hamiltonian and dissipation live in a few work arrays that fit the first-level
  cache, never on the grid. Three grid-sized arrays are all that TVD-RK3 needs.
- The contiguous axis is the game's `line_axis`, long and smooth, and every inner loop runs along it in SIMD; across
  the other axes the stencil is made of whole neighbouring lines, which `layout` has looked up beforehand. Loops run
  over whole vectors: past the line's end they compute on its neighbour's values, which are finite and thrown away.
- There are no ghost nodes. Schemes need differences only, and a face's extrapolation is a difference row repeated.
- Where the game mirrors itself only half of the grid is stored: a neighbour beyond the mirror is another stored line.
- Dynamics and schemes are called through C function pointers, once a line. So the kernel is compiled once, is cached
  on disk, and serves every game.
- It releases the interpreter's lock and runs on a range of lines: threads share the lines between them.
"""

from typing import Any

import numpy as np
from numba import njit

from hj_cosim.reachability.dynamics import FLOATING_POINT
from hj_cosim.reachability.layout import AWAY_FROM_ZERO, PERIODIC, VECTOR_WIDTH
from hj_cosim.reachability.schemes import LINE


@njit(cache=True)
def _seek(line: int, nodes: np.ndarray, index: np.ndarray) -> None:
    """Write the multi-index of a line."""
    index[nodes.size - 1] = 0
    for axis in range(nodes.size - 2, -1, -1):
        index[axis] = line % nodes[axis]
        line //= nodes[axis]


@njit(cache=True)
def _next_line(nodes: np.ndarray, index: np.ndarray) -> None:
    for axis in range(nodes.size - 2, -1, -1):
        index[axis] += 1
        if index[axis] < nodes[axis]:
            return
        index[axis] = 0


@njit(cache=True)
def _fill_states(
    coordinates: np.ndarray, state_axis: np.ndarray, index: np.ndarray, start: int, states: np.ndarray
) -> None:
    """Write the states of the nodes from `start` on of the line at `index`, (n, width)."""
    dimension, width = states.shape
    for axis in range(dimension - 1):
        coordinate = coordinates[axis, index[axis]]
        row = states[state_axis[axis]]
        for i in range(width):
            row[i] = coordinate
    states[state_axis[dimension - 1]] = coordinates[dimension - 1, start : start + width]


@njit(cache=True, fastmath=FLOATING_POINT)
def _subtract(upper: np.ndarray, lower: np.ndarray, scale: float, out: np.ndarray) -> None:
    for i in range(out.shape[0]):
        out[i] = (upper[i] - lower[i]) * scale


@njit(cache=True)
def _lead_away(face: np.ndarray, sign: int, differences: np.ndarray) -> None:
    """Turn a face's difference into one that leads away from zero towards the outside, which `sign` says."""
    outwards = np.float32(sign)
    for i in range(differences.shape[0]):
        differences[i] = np.sign(face[i]) * abs(differences[i]) * outwards


@njit(cache=True)
def _pad(row: np.ndarray, start: int, count: int, radius: int, boundary: int, padded: np.ndarray) -> None:
    """Copy `count` nodes of a line with `radius` more on either side, extrapolated beyond its ends."""
    nodes = row.shape[0]
    padded[radius : radius + count] = row[start : start + count]
    for k in range(1, radius + 1):
        for side in range(2):
            place, node = (radius - k, start - k) if side == 0 else (radius + count - 1 + k, start + count - 1 + k)
            if 0 <= node < nodes:
                padded[place] = row[node]
            elif boundary == PERIODIC:
                padded[place] = row[node % nodes]
            else:
                face, inner = (0, 1) if side == 0 else (nodes - 1, nodes - 2)
                slope = row[face] - row[inner]
                if boundary == AWAY_FROM_ZERO:
                    slope = np.sign(row[face]) * abs(slope)
                padded[place] = row[face] + np.float32(abs(node - face)) * slope


@njit(cache=True, fastmath=FLOATING_POINT)
def _centre_and_jump(left: np.ndarray, right: np.ndarray) -> None:
    """Replace the one-sided derivatives by their mean and half their difference."""
    half = np.float32(0.5)
    for i in range(left.shape[0]):
        centre = half * (right[i] + left[i])
        right[i] = half * (right[i] - left[i])
        left[i] = centre


@njit(cache=True, fastmath=FLOATING_POINT)
def _dissipate(rate: np.ndarray, bound: np.ndarray, jump: np.ndarray) -> None:
    for i in range(rate.shape[0]):
        rate[i] += bound[i] * jump[i]


@njit(cache=True, fastmath=FLOATING_POINT)
def _update(rate: np.ndarray, base: np.ndarray, source: np.ndarray, share: float, step: float, floor: float) -> None:
    """Turn the rate into share · base + (1 − share) · (source + step · min(0, rate)), at least `floor`.

    Written so that a NaN stays one instead of vanishing in a minimum, and into `rate` because the array that the
    result belongs to may be `base`: the compiler gives up on SIMD where arrays overlap.
    """
    zero = np.float32(0.0)
    rest = np.float32(1.0) - share
    for i in range(rate.shape[0]):
        change = zero if rate[i] > zero else rate[i]
        value = share * base[i] + rest * (source[i] + step * change)
        rate[i] = floor if value < floor else value


@njit(cache=True, nogil=True)
def advance_lines(
    first: int,
    end: int,
    nodes: np.ndarray,
    state_axis: np.ndarray,
    coordinates: np.ndarray,
    inverse_spacing: np.ndarray,
    stencils: np.ndarray,
    mirror_shifts: np.ndarray,
    line_boundary: int,
    derivatives: Any,
    hamiltonian: Any,
    dissipation: Any,
    parameters: np.ndarray,
    limits: np.ndarray,
    source: np.ndarray,
    base: np.ndarray,
    target: np.ndarray,
    share: float,
    step: float,
    floor: float,
) -> None:
    """Do one Runge-Kutta stage of V_t + min(0, H) = 0, backwards in time, on the lines `first` to `end`.

    target = share · base + (1 − share) · (source + step · min(0, Ĥ(source))), with the Lax-Friedrichs Ĥ.

    Args:
        first, end: the range of lines.
        nodes, state_axis, coordinates, inverse_spacing, stencils, mirror_shifts, line_boundary: see Layout.
        derivatives: the scheme, as a C function.
        hamiltonian, dissipation: of the game, as C functions.
        parameters, limits: what the game's functions take.
        source: (stored nodes + LINE,) float32, what is differentiated.
        base, target: the same shape; they may be one array, but not `source`.
        share: float32.
        step: s, float32.
        floor: float32, the least value, or -inf.
    """
    dimension = nodes.size
    line_nodes = nodes[dimension - 1]
    rows = stencils.shape[2]
    width = min(LINE, (line_nodes + VECTOR_WIDTH - 1) // VECTOR_WIDTH * VECTOR_WIDTH)
    index = np.empty(dimension, np.int64)
    states = np.zeros((dimension, width), np.float32)
    centre = np.zeros((dimension, width), np.float32)
    jump = np.zeros((dimension, width), np.float32)
    bounds = np.zeros((dimension, width), np.float32)
    differences = np.zeros(rows * LINE, np.float32)
    padded = np.zeros(LINE + rows, np.float32)
    rate = np.zeros(width, np.float32)
    _seek(first, nodes, index)
    for line in range(first, end):
        mirror_shift = 0
        for axis in range(dimension - 1):
            mirror_shift += mirror_shifts[axis, index[axis]]
        for start in range(0, line_nodes, LINE):
            count = min(LINE, line_nodes - start)
            here = line * line_nodes + start
            for axis in range(dimension - 1):
                for m in range(rows):
                    entry = stencils[axis, index[axis], m]
                    high = here + entry[0] + entry[1] * mirror_shift
                    low = here + entry[2] + entry[3] * mirror_shift
                    out = differences[m * LINE : m * LINE + width]
                    _subtract(source[high : high + width], source[low : low + width], inverse_spacing[axis], out)
                    if entry[4] != 0:
                        face = low if entry[4] < 0 else high
                        _lead_away(source[face : face + width], entry[4], out)
                derivatives(differences, width, centre[state_axis[axis]], jump[state_axis[axis]])
            _pad(source[line * line_nodes : (line + 1) * line_nodes], start, count, rows // 2, line_boundary, padded)
            for m in range(rows):
                _subtract(
                    padded[m + 1 : m + 1 + width], padded[m : m + width], inverse_spacing[dimension - 1],
                    differences[m * LINE : m * LINE + width],
                )  # fmt: skip
            derivatives(differences, width, centre[state_axis[dimension - 1]], jump[state_axis[dimension - 1]])
            _fill_states(coordinates, state_axis, index, start, states)
            for state in range(dimension):
                _centre_and_jump(centre[state], jump[state])
            hamiltonian(states, centre, parameters, limits, rate)
            dissipation(states, parameters, bounds)
            for state in range(dimension):
                _dissipate(rate, bounds[state], jump[state])
            _update(rate, base[here : here + width], source[here : here + width], share, step, floor)
            target[here : here + count] = rate[:count]
        _next_line(nodes, index)


@njit(cache=True, nogil=True)
def target_lines(
    first: int,
    end: int,
    nodes: np.ndarray,
    state_axis: np.ndarray,
    coordinates: np.ndarray,
    target: Any,
    parameters: np.ndarray,
    values: np.ndarray,
) -> None:
    """Write V(0, ·) on the lines `first` to `end`."""
    line_nodes = nodes[nodes.size - 1]
    index = np.empty(nodes.size, np.int64)
    states = np.zeros((nodes.size, line_nodes), np.float32)
    _seek(first, nodes, index)
    for line in range(first, end):
        _fill_states(coordinates, state_axis, index, 0, states)
        target(states, parameters, values[line * line_nodes : (line + 1) * line_nodes])
        _next_line(nodes, index)


@njit(cache=True, nogil=True)
def largest_speed(
    nodes: np.ndarray,
    state_axis: np.ndarray,
    coordinates: np.ndarray,
    inverse_spacing: np.ndarray,
    dissipation: Any,
    parameters: np.ndarray,
) -> float:
    """Return the greatest Σ α_i/Δx_i over all nodes, 1/s: the time step is at most its inverse."""
    dimension = nodes.size
    line_nodes = nodes[dimension - 1]
    index = np.empty(dimension, np.int64)
    states = np.zeros((dimension, line_nodes), np.float32)
    bounds = np.zeros((dimension, line_nodes), np.float32)
    largest = 0.0
    _seek(0, nodes, index)
    for _ in range(np.prod(nodes[:-1])):
        _fill_states(coordinates, state_axis, index, 0, states)
        dissipation(states, parameters, bounds)
        for i in range(line_nodes):
            total = 0.0
            for axis in range(dimension):
                total += bounds[state_axis[axis], i] * inverse_spacing[axis]
            largest = max(largest, total)
        _next_line(nodes, index)
    return largest
