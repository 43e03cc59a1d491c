"""The solver's inner loop: one Runge-Kutta stage on a range of grid lines, fused into one pass over memory.

Why it has this shape:

- A solve is thousands of passes over the grid, so memory traffic decides. Each pass reads a line and its neighbours,
  and writes the line: derivatives, Hamiltonian and dissipation live in a few work arrays that fit the first-level
  cache, never on the grid. Three grid-sized arrays are all that TVD-RK3 needs.
- The contiguous axis is `line_axis`, long and smooth, and every inner loop runs along it in SIMD; across the other
  axes the stencil is made of whole neighbouring lines. Loops run over whole vectors: past the line's end they compute
  on its neighbour's values, which are finite and thrown away.
- There are no ghost nodes. Schemes need differences only, and a face's extrapolation is a difference row repeated.
- Where the game mirrors itself only half of the grid is stored: a neighbour beyond the mirror is another stored line.
- Dynamics and schemes are called through C function pointers, once a line. So the kernel is compiled once, is cached
  on disk, and serves every game.
- It releases the interpreter's lock and runs on a range of lines: threads share the lines between them.
"""

from typing import Any, NamedTuple

import numpy as np
from numba import njit

from hj_cosim.reachability.dynamics import FLOATING_POINT
from hj_cosim.reachability.schemes import LINE

LINEAR, AWAY_FROM_ZERO, PERIODIC = 0, 1, 2
VECTOR_WIDTH = 16  # float32 in the widest SIMD register


class Layout(NamedTuple):
    """How the stored part of the grid lies in memory; axes are permuted so that lines run along the last one."""

    shape: np.ndarray  # (n,) int64, stored nodes per internal axis
    strides: np.ndarray  # (n,) int64, in elements
    state_axis: np.ndarray  # (n,) int64, which state each internal axis is
    boundary: np.ndarray  # (n,) int64
    mirrored: np.ndarray  # (n,) int64, 1 where the mirror negates the coordinate
    fold: int  # the internal axis of which half is stored, or -1
    fold_centre: int  # 1 if the fold axis has a node on the mirror
    origin: np.ndarray  # (n,) float64, coordinate of the first stored node per internal axis
    spacing: np.ndarray  # (n,) float64


class Game(NamedTuple):
    """The game and the scheme, as C functions, and their constants."""

    target: Any
    hamiltonian: Any
    dissipation: Any
    derivatives: Any
    radius: int
    parameters: np.ndarray  # float32
    limits: np.ndarray  # (2, n) float32


@njit(cache=True)
def whole_vectors(count: int) -> int:
    """Return `count` rounded up to whole SIMD vectors."""
    return (count + VECTOR_WIDTH - 1) // VECTOR_WIDTH * VECTOR_WIDTH


@njit(cache=True)
def line_count(layout: Layout) -> int:
    """Return how many lines the stored grid has."""
    lines = 1
    for axis in range(layout.shape.size - 1):
        lines *= layout.shape[axis]
    return lines


@njit(cache=True)
def _seek(line: int, layout: Layout, index: np.ndarray) -> None:
    """Write the multi-index of a line's first node."""
    last = layout.shape.size - 1
    index[last] = 0
    for axis in range(last - 1, -1, -1):
        index[axis] = line % layout.shape[axis]
        line //= layout.shape[axis]


@njit(cache=True)
def _fill_states(layout: Layout, index: np.ndarray, start: int, width: int, states: np.ndarray) -> None:
    """Write the states of the nodes from `start` on of the line at `index`, (n, width)."""
    last = layout.shape.size - 1
    for axis in range(last):
        row = states[layout.state_axis[axis]]
        coordinate = np.float32(layout.origin[axis] + index[axis] * layout.spacing[axis])
        for i in range(width):
            row[i] = coordinate
    row = states[layout.state_axis[last]]
    for i in range(width):
        row[i] = np.float32(layout.origin[last] + (start + i) * layout.spacing[last])


@njit(cache=True)
def _mirror_image(layout: Layout, index: np.ndarray, folded: int) -> int:
    """Return the offset of the line whose fold coordinate is `folded` < 0, which is stored as its mirror image."""
    offset = 0
    for axis in range(layout.shape.size - 1):
        if axis == layout.fold:
            node = -folded if layout.fold_centre == 1 else -1 - folded
        elif layout.mirrored[axis] == 1:
            nodes = layout.shape[axis]
            node = (nodes - index[axis]) % nodes if layout.boundary[axis] == PERIODIC else nodes - 1 - index[axis]
        else:
            node = index[axis]
        offset += node * layout.strides[axis]
    return offset


@njit(cache=True)
def _neighbour(layout: Layout, index: np.ndarray, here: int, axis: int, node: int) -> int:
    """Return the offset of the line that is `node` along `axis` and otherwise at `index`; -1 if there is none."""
    nodes = layout.shape[axis]
    if 0 <= node < nodes:
        return here + (node - index[axis]) * layout.strides[axis]
    if layout.boundary[axis] == PERIODIC:
        return here + (node % nodes - index[axis]) * layout.strides[axis]
    if axis == layout.fold and node < 0:
        return _mirror_image(layout, index, node)
    return -1


@njit(cache=True, fastmath=FLOATING_POINT)
def _subtract(upper: np.ndarray, lower: np.ndarray, scale: float, out: np.ndarray) -> None:
    for i in range(out.shape[0]):
        out[i] = (upper[i] - lower[i]) * scale


@njit(cache=True)
def _away(face: np.ndarray, sign: float, out: np.ndarray) -> None:
    """Turn the face's difference into one that leads away from zero, seen from inside in the direction `sign`."""
    for i in range(out.shape[0]):
        slope = abs(out[i])
        out[i] = (slope if face[i] > 0.0 else (-slope if face[i] < 0.0 else np.float32(0.0))) * sign


@njit(cache=True)
def _differences_across(
    values: np.ndarray, layout: Layout, index: np.ndarray, here: int, axis: int, radius: int, width: int,
    out: np.ndarray,
) -> None:  # fmt: skip
    """Write the 2 radius first differences along an outer axis, for `width` nodes from the offset `here` on."""
    scale = np.float32(1.0 / layout.spacing[axis])
    nodes = layout.shape[axis]
    for m in range(2 * radius):
        row = out[m * LINE : m * LINE + width]
        node = index[axis] + m - radius
        low = _neighbour(layout, index, here, axis, node)
        high = _neighbour(layout, index, here, axis, node + 1)
        if low >= 0 and high >= 0:
            _subtract(values[high : high + width], values[low : low + width], scale, row)
            continue
        # Beyond a face: the face's own difference continues.
        below = node < 0
        face = here + ((0 if below else nodes - 1) - index[axis]) * layout.strides[axis]
        inner = face + (layout.strides[axis] if below else -layout.strides[axis])
        if below:
            _subtract(values[inner : inner + width], values[face : face + width], scale, row)
        else:
            _subtract(values[face : face + width], values[inner : inner + width], scale, row)
        if layout.boundary[axis] == AWAY_FROM_ZERO:
            _away(values[face : face + width], np.float32(-1.0 if below else 1.0), row)


@njit(cache=True)
def _differences_along(
    values: np.ndarray, layout: Layout, line: int, start: int, count: int, radius: int, width: int,
    padded: np.ndarray, out: np.ndarray,
) -> None:  # fmt: skip
    """Write the 2 radius first differences along the line itself, for the nodes from `start` on."""
    last = layout.shape.size - 1
    nodes = layout.shape[last]
    row = values[line : line + nodes]
    scale = np.float32(1.0 / layout.spacing[last])
    for i in range(count + 2 * radius):
        node = start + i - radius
        if layout.boundary[last] == PERIODIC:
            padded[i] = row[node % nodes]
        elif node < 0:
            slope = row[1] - row[0]
            if layout.boundary[last] == AWAY_FROM_ZERO:
                slope = -np.sign(row[0]) * abs(slope)
            padded[i] = row[0] + np.float32(node) * slope
        elif node >= nodes:
            slope = row[nodes - 1] - row[nodes - 2]
            if layout.boundary[last] == AWAY_FROM_ZERO:
                slope = np.sign(row[nodes - 1]) * abs(slope)
            padded[i] = row[nodes - 1] + np.float32(node - nodes + 1) * slope
        else:
            padded[i] = row[node]
    for m in range(2 * radius):
        _subtract(padded[m + 1 : m + 1 + width], padded[m : m + width], scale, out[m * LINE : m * LINE + width])


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
    first: int, end: int, layout: Layout, game: Game, source: np.ndarray, base: np.ndarray, target: np.ndarray,
    share: float, step: float, floor: float,
) -> None:  # fmt: skip
    """Do one Runge-Kutta stage of V_t + min(0, H) = 0, backwards in time, on the lines `first` to `end`.

    target = share · base + (1 − share) · (source + step · min(0, Ĥ(source))), with the Lax-Friedrichs Ĥ.

    Args:
        first, end: the range of lines.
        layout, game: see there.
        source: (stored nodes + LINE,) float32, what is differentiated.
        base, target: the same shape; they may be one array, but not `source`.
        share: float32.
        step: s, float32.
        floor: float32, the least value, or -inf.
    """
    dimension = layout.shape.size
    last = dimension - 1
    nodes = layout.shape[last]
    radius = game.radius
    index = np.empty(dimension, np.int64)
    widest = min(LINE, whole_vectors(nodes))
    states = np.zeros((dimension, widest), np.float32)
    centre = np.zeros((dimension, widest), np.float32)
    jump = np.zeros((dimension, widest), np.float32)
    bounds = np.zeros((dimension, widest), np.float32)
    differences = np.zeros(2 * radius * LINE, np.float32)
    padded = np.zeros(LINE + 2 * radius + VECTOR_WIDTH, np.float32)
    rate = np.zeros(LINE, np.float32)
    _seek(first, layout, index)
    for line in range(first, end):
        for start in range(0, nodes, LINE):
            count = min(LINE, nodes - start)
            width = whole_vectors(count)
            here = line * nodes + start
            for axis in range(dimension):
                if axis == last:
                    _differences_along(source, layout, line * nodes, start, count, radius, width, padded, differences)
                else:
                    _differences_across(source, layout, index, here, axis, radius, width, differences)
                state = layout.state_axis[axis]
                game.derivatives(differences, width, centre[state], jump[state])
                _centre_and_jump(centre[state, :width], jump[state, :width])
            _fill_states(layout, index, start, width, states)
            game.hamiltonian(states, centre, game.parameters, game.limits, rate[:width])
            game.dissipation(states, game.parameters, bounds)
            for state in range(dimension):
                _dissipate(rate[:width], bounds[state, :width], jump[state, :width])
            _update(rate[:width], base[here : here + width], source[here : here + width], share, step, floor)
            target[here : here + count] = rate[:count]
        _next_line(layout, index)


@njit(cache=True)
def _next_line(layout: Layout, index: np.ndarray) -> None:
    for axis in range(layout.shape.size - 2, -1, -1):
        index[axis] += 1
        if index[axis] < layout.shape[axis]:
            return
        index[axis] = 0


@njit(cache=True, nogil=True)
def target_lines(first: int, end: int, layout: Layout, game: Game, values: np.ndarray) -> None:
    """Write V(0, ·) on the lines `first` to `end`."""
    nodes = layout.shape[layout.shape.size - 1]
    index = np.empty(layout.shape.size, np.int64)
    states = np.zeros((layout.shape.size, nodes), np.float32)
    _seek(first, layout, index)
    for line in range(first, end):
        _fill_states(layout, index, 0, nodes, states)
        game.target(states, game.parameters, values[line * nodes : (line + 1) * nodes])
        _next_line(layout, index)


@njit(cache=True, nogil=True)
def largest_speed(layout: Layout, game: Game) -> float:
    """Return the greatest Σ α_i/Δx_i over all nodes, 1/s: the time step is at most its inverse."""
    dimension = layout.shape.size
    nodes = layout.shape[dimension - 1]
    index = np.empty(dimension, np.int64)
    states = np.zeros((dimension, nodes), np.float32)
    bounds = np.zeros((dimension, nodes), np.float32)
    largest = 0.0
    _seek(0, layout, index)
    for _ in range(line_count(layout)):
        _fill_states(layout, index, 0, nodes, states)
        game.dissipation(states, game.parameters, bounds)
        for i in range(nodes):
            total = 0.0
            for axis in range(dimension):
                total += bounds[layout.state_axis[axis], i] / layout.spacing[axis]
            largest = max(largest, total)
        _next_line(layout, index)
    return largest
