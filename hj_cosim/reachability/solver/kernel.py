"""The solver's inner loop: one Runge-Kutta stage on a range of slabs of the grid, fused into one pass over memory.

Why it has this shape:

- A solve is thousands of passes over the grid, so memory traffic decides. Each pass reads a slab and its neighbours,
  and writes the slab: derivatives, Hamiltonian and dissipation live in work arrays that fit the caches next to the
  core, never on the grid. Three grid-sized arrays are all that TVD-RK3 needs.
- A slab is some consecutive lines of the two innermost axes, 500 to 1000 nodes that lie together in memory, and every
  inner loop runs over all of it in SIMD: a difference along any axis is one slab minus another, shifted. The few
  nodes at the ends of its lines are put right afterwards. A line alone, 40 to 60 nodes, would spend most of its time
  on starting loops.
- There are no ghost nodes. Schemes need differences only, and a face's extrapolation is a difference repeated.
  `Layout.stencils` has looked up beforehand which lines make a difference across an axis.
- Where the game mirrors itself only half of the grid is stored: a neighbour beyond the mirror is another stored line.
- Games and schemes are called through C function pointers, once a slab. So the kernel is compiled once, is cached
  on disk, and serves every game.
- It releases the interpreter's lock and runs on a range of slabs: threads share the slabs between them.
"""

from typing import Any

import numpy as np
from numba import njit

from hj_cosim.reachability.games.contract import FLOATING_POINT
from hj_cosim.reachability.solver.layout import AWAY_FROM_ZERO, FRONT, PERIODIC
from hj_cosim.reachability.solver.schemes import PITCH


@njit(cache=True)
def _seek(outer: int, nodes: np.ndarray, index: np.ndarray) -> None:
    """Write the multi-index over all but the two innermost axes."""
    for axis in range(nodes.size - 3, -1, -1):
        index[axis] = outer % nodes[axis]
        outer //= nodes[axis]


@njit(cache=True)
def _fill_outer_states(coordinates: np.ndarray, state_axis: np.ndarray, index: np.ndarray, states: np.ndarray) -> None:
    """Write the coordinates that a slab's nodes share; rows that hold them already are left alone."""
    for axis in range(states.shape[0] - 2):
        coordinate = coordinates[axis, index[axis]]
        row = states[state_axis[axis]]
        if row[0] != coordinate:
            for i in range(row.shape[0]):
                row[i] = coordinate


@njit(cache=True)
def _fill_inner_states(
    coordinates: np.ndarray, state_axis: np.ndarray, line: int, first_line: int, size: int, states: np.ndarray
) -> None:
    """Write the coordinates along the two innermost axes for the slab that begins with `first_line`."""
    dimension = states.shape[0]
    across, along = states[state_axis[dimension - 2]], states[state_axis[dimension - 1]]
    for j in range(size // line):
        coordinate = coordinates[dimension - 2, first_line + j]
        for i in range(line):
            across[j * line + i] = coordinate
            along[j * line + i] = coordinates[dimension - 1, i]


@njit(cache=True, fastmath=FLOATING_POINT)
def _subtract(upper: np.ndarray, lower: np.ndarray, scale: float, out: np.ndarray) -> None:
    for i in range(out.shape[0]):
        out[i] = (upper[i] - lower[i]) * scale


@njit(cache=True)
def _lead_away(face: np.ndarray, sign: int, differences: np.ndarray) -> None:
    """Turn a face's differences into ones that lead away from zero towards the outside, which `sign` says."""
    outwards = np.float32(sign)
    for i in range(differences.shape[0]):
        differences[i] = np.sign(face[i]) * abs(differences[i]) * outwards


@njit(cache=True)
def _difference_by_stencil(
    source: np.ndarray, here: int, stencils: np.ndarray, node: int, m: int, mirror_shift: int, scale: float,
    out: np.ndarray,
) -> None:  # fmt: skip
    """Write one difference across an axis for the nodes from `here` on, as `Layout.stencils` says."""
    size = out.shape[0]
    high = here + stencils[node, m, 0] + stencils[node, m, 1] * mirror_shift
    low = here + stencils[node, m, 2] + stencils[node, m, 3] * mirror_shift
    sign = stencils[node, m, 4]
    _subtract(source[high : high + size], source[low : low + size], scale, out)
    if sign != 0:
        face = low if sign < 0 else high
        _lead_away(source[face : face + size], sign, out)


# Ten parameters: slices of a slab are views, and packing them in the innermost loop costs more than it says.
@njit(cache=True)
def _differences_between_lines(
    source: np.ndarray, here: int, first_line: int, line: int, count: int, stencils: np.ndarray, mirror_shift: int,
    scale: float, m: int, out: np.ndarray,
) -> None:  # fmt: skip
    """Write the difference m between the lines of a slab: at once where no face is near, else line by line."""
    lines = out.shape[0] // line
    reach = m - stencils.shape[1] // 2  # the lower of the two lines, as seen from the node
    begin = min(max(-reach - first_line, 0), lines)
    end = max(min(count - 1 - reach - first_line, lines), begin)
    low = here + (begin + reach) * line
    size = (end - begin) * line
    if size > 0:
        inside = out[begin * line : end * line]
        _subtract(source[low + line : low + line + size], source[low : low + size], scale, inside)
    for j in range(lines):
        if j < begin or j >= end:
            row = out[j * line : (j + 1) * line]
            _difference_by_stencil(source, here + j * line, stencils, first_line + j, m, mirror_shift, scale, row)


@njit(cache=True)
def _differences_along_lines(
    source: np.ndarray, here: int, line: int, reach: int, boundary: int, scale: float, out: np.ndarray
) -> None:
    """Write the difference between the nodes `reach` and `reach + 1` away along the lines of a slab.

    All at once, across the ends of lines too, where it is put right afterwards.
    """
    size = out.shape[0]
    low = here + reach
    _subtract(source[low + 1 : low + 1 + size], source[low : low + size], scale, out)
    if reach < 0:
        for first in range(0, size, line):
            for node in range(-reach):
                out[first + node] = scale * _difference_below(source, here + first, line, node + reach, boundary)
    for first in range(0, size, line):
        for node in range(line - 1 - reach, line):
            out[first + node] = scale * _difference_above(source, here + first, line, node + reach, boundary)


@njit(cache=True)
def _difference_below(source: np.ndarray, row: int, line: int, low: int, boundary: int) -> float:
    """Return the difference between the nodes `low` < 0 and `low + 1` of the line that begins at `row`."""
    if boundary == PERIODIC:
        return source[row + (low + 1 if low == -1 else low + 1 + line)] - source[row + low + line]
    slope = source[row + 1] - source[row]
    if boundary == AWAY_FROM_ZERO:
        return -np.sign(source[row]) * abs(slope)
    return slope


@njit(cache=True)
def _difference_above(source: np.ndarray, row: int, line: int, low: int, boundary: int) -> float:
    """Return the difference between the nodes `low` and `low + 1` > the last of the line that begins at `row`."""
    last = row + line - 1
    if boundary == PERIODIC:
        return source[row + low + 1 - line] - source[row + (low if low == line - 1 else low - line)]
    slope = source[last] - source[last - 1]
    if boundary == AWAY_FROM_ZERO:
        return np.sign(source[last]) * abs(slope)
    return slope


@njit(cache=True, fastmath=FLOATING_POINT)
def _update(
    rate: np.ndarray, dissipated: np.ndarray, base: np.ndarray, source: np.ndarray, share: float, step: float,
    floor: float,
) -> None:  # fmt: skip
    """Turn H into share · base + (1 − share) · (source + step · min(0, H + dissipated)), at least `floor`.

    Written so that a NaN stays one instead of vanishing in a minimum, and into `rate` because the array that the
    result belongs to may be `base`: the compiler gives up on SIMD where arrays overlap.
    """
    zero = np.float32(0.0)
    rest = np.float32(1.0) - share
    for i in range(rate.shape[0]):
        change = rate[i] + dissipated[i]
        change = zero if change > zero else change
        value = share * base[i] + rest * (source[i] + step * change)
        rate[i] = floor if value < floor else value


@njit(cache=True)
def _copy(source: np.ndarray, out: np.ndarray) -> None:
    for i in range(out.shape[0]):
        out[i] = source[i]


# Twenty-one parameters: flat arrays compile to one kernel for every game and scheme, which its cache then serves.
@njit(cache=True, nogil=True)
def advance_slabs(
    first: int,
    end: int,
    nodes: np.ndarray,
    state_axis: np.ndarray,
    coordinates: np.ndarray,
    slab_lines: int,
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
    """Do one Runge-Kutta stage of V_t + min(0, H) = 0, backwards in time, on the slabs `first` to `end`.

    target = share · base + (1 − share) · (source + step · min(0, Ĥ(source))), with the Lax-Friedrichs Ĥ.

    Args:
        first, end: the range of slabs.
        nodes, state_axis, coordinates, slab_lines, inverse_spacing, stencils, mirror_shifts, line_boundary: see Layout.
        derivatives: the scheme, as a C function.
        hamiltonian, dissipation: of the game, as C functions.
        parameters, limits: what the game's functions take.
        source: float32, FRONT numbers of room, then the stored nodes, then room again: what is differentiated.
        base, target: the same shape; they may be one array, but not `source`.
        share: float32.
        step: s, float32.
        floor: float32, the least value, or -inf.
    """
    dimension = nodes.size
    line = nodes[dimension - 1]
    slabs_per_plane = (nodes[dimension - 2] + slab_lines - 1) // slab_lines
    rows = stencils.shape[2]
    index = np.zeros(dimension, np.int64)
    most = slab_lines * line
    states = np.zeros((dimension, most), np.float32)
    centre = np.zeros((dimension, most), np.float32)
    bounds = np.zeros((dimension, most), np.float32)
    dissipated = np.zeros(most, np.float32)
    rate = np.zeros(most, np.float32)
    differences = np.zeros(rows * PITCH, np.float32)
    filled = -1
    for slab in range(first, end):
        _seek(slab // slabs_per_plane, nodes, index)
        first_line = slab % slabs_per_plane * slab_lines
        size = min(slab_lines, nodes[dimension - 2] - first_line) * line
        here = FRONT + (slab // slabs_per_plane * nodes[dimension - 2] + first_line) * line
        mirror_shift = 0
        for axis in range(dimension - 2):
            mirror_shift += mirror_shifts[axis, index[axis]]
        _fill_outer_states(coordinates, state_axis, index, states)
        if first_line != filled:
            _fill_inner_states(coordinates, state_axis, line, first_line, size, states)
            filled = first_line
        dissipation(states, parameters, bounds)
        for i in range(size):
            dissipated[i] = 0.0
        for axis in range(dimension):
            scale = inverse_spacing[axis]
            for m in range(rows):
                row = differences[m * PITCH : m * PITCH + size]
                if axis == dimension - 1:
                    _differences_along_lines(source, here, line, m - rows // 2, line_boundary, scale, row)
                elif axis == dimension - 2:
                    _differences_between_lines(
                        source, here, first_line, line, nodes[axis], stencils[axis], mirror_shift, scale, m, row
                    )
                else:
                    _difference_by_stencil(source, here, stencils[axis], index[axis], m, mirror_shift, scale, row)
            state = state_axis[axis]
            derivatives(differences, bounds[state, :size], centre[state, :size], dissipated[:size])
        hamiltonian(states, centre, parameters, limits, rate)
        stop = here + size
        _update(rate[:size], dissipated[:size], base[here:stop], source[here:stop], share, step, floor)
        _copy(rate[:size], target[here:stop])


# Nine parameters: the arrays of advance_slabs that it needs, in the same order.
@njit(cache=True, nogil=True)
def target_slabs(
    first: int,
    end: int,
    nodes: np.ndarray,
    state_axis: np.ndarray,
    coordinates: np.ndarray,
    slab_lines: int,
    target: Any,
    parameters: np.ndarray,
    values: np.ndarray,
) -> None:
    """Write V(0, ·) on the slabs `first` to `end`."""
    planes = nodes[nodes.size - 2]
    slabs_per_plane = (planes + slab_lines - 1) // slab_lines
    line = nodes[nodes.size - 1]
    index = np.zeros(nodes.size, np.int64)
    for slab in range(first, end):
        _seek(slab // slabs_per_plane, nodes, index)
        first_line = slab % slabs_per_plane * slab_lines
        size = min(slab_lines, planes - first_line) * line
        states = np.zeros((nodes.size, size), np.float32)
        _fill_outer_states(coordinates, state_axis, index, states)
        _fill_inner_states(coordinates, state_axis, line, first_line, size, states)
        here = FRONT + (slab // slabs_per_plane * planes + first_line) * line
        target(states, parameters, values[here : here + size])


@njit(cache=True, nogil=True)
def largest_speed(
    nodes: np.ndarray,
    state_axis: np.ndarray,
    coordinates: np.ndarray,
    slab_lines: int,
    inverse_spacing: np.ndarray,
    dissipation: Any,
    parameters: np.ndarray,
) -> float:
    """Return the greatest Σ α_i/Δx_i over all nodes, 1/s: the time step is at most its inverse."""
    dimension = nodes.size
    planes = nodes[dimension - 2]
    slabs_per_plane = (planes + slab_lines - 1) // slab_lines
    outer = 1
    for axis in range(dimension - 2):
        outer *= nodes[axis]
    line = nodes[dimension - 1]
    index = np.zeros(dimension, np.int64)
    largest = 0.0
    for slab in range(outer * slabs_per_plane):
        _seek(slab // slabs_per_plane, nodes, index)
        first_line = slab % slabs_per_plane * slab_lines
        size = min(slab_lines, planes - first_line) * line
        states = np.zeros((dimension, size), np.float32)
        bounds = np.empty((dimension, size), np.float32)
        _fill_outer_states(coordinates, state_axis, index, states)
        _fill_inner_states(coordinates, state_axis, line, first_line, size, states)
        dissipation(states, parameters, bounds)
        for i in range(size):
            total = 0.0
            for axis in range(dimension):
                total += bounds[state_axis[axis], i] * inverse_spacing[axis]
            largest = max(largest, total)
    return largest
