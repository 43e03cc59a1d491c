"""How a grid lies in the solver's memory: axes permuted, half of a mirrored grid, every line's neighbours looked up."""

from dataclasses import dataclass

import numpy as np

from hj_cosim.errors import ConfigurationError
from hj_cosim.reachability.games.contract import Game
from hj_cosim.reachability.grid import Grid
from hj_cosim.reachability.solver.schemes import MOST_NODES

LINEAR, AWAY_FROM_ZERO, PERIODIC = 0, 1, 2
FRONT = 8  # numbers of room before the first node, and after the last: stencils read them and ignore what they read
_SLAB_NODES = 1024  # about what the kernel takes at a time; its work arrays then fit the second-level cache

_BOUNDARY_CODES = {"linear": LINEAR, "away_from_zero": AWAY_FROM_ZERO, "periodic": PERIODIC}


@dataclass(frozen=True)
class Layout:
    """The stored part of a grid; axes are permuted so that the slabs' two come last, in C order.

    `stencils[axis, node, m]` says how the first difference m of a scheme of radius r, between the nodes m − r and
    m − r + 1 away, is made from two lines: (offset of the upper one, 1 if it lies beyond the mirror, offset of the
    lower one, the same, sign of an extrapolation away from zero or 0). Offsets are from the line itself; beyond the
    mirror the line's own mirror shift, the sum of `mirror_shifts[axis, node]`, comes on top.
    """

    order: tuple[int, ...]  # which state each axis is
    nodes: np.ndarray  # (n,) int64, stored
    coordinates: np.ndarray  # (n, most nodes) float32
    inverse_spacing: np.ndarray  # (n,) float32
    stencils: np.ndarray  # (n, most nodes, 2 r, 5) int64
    mirror_shifts: np.ndarray  # (n, most nodes) int64
    slab_lines: int  # lines in a slab
    line_boundary: int
    mirrored: np.ndarray  # (n,) bool
    fold: int  # the axis of which half is stored, or -1
    fold_on_node: bool  # whether a node lies on the mirror
    periodic: np.ndarray  # (n,) bool

    @property
    def stored_nodes(self) -> int:
        """How many nodes are computed; the mirror gives the rest."""
        return int(np.prod(self.nodes))

    @property
    def slabs(self) -> int:
        """How many slabs there are."""
        return int(np.prod(self.nodes[:-2])) * -(-int(self.nodes[-2]) // self.slab_lines)

    def buffer(self) -> np.ndarray:
        """Return room for the stored nodes, float32."""
        return np.zeros(self.stored_nodes + 2 * FRONT, np.float32)

    def stored(self, buffer: np.ndarray) -> np.ndarray:
        """Return the nodes in a buffer."""
        return buffer[FRONT : FRONT + self.stored_nodes]

    def whole(self, buffer: np.ndarray) -> np.ndarray:
        """Return the values on the whole grid, axes in the state's order, from the stored part."""
        values = self.stored(buffer).reshape(tuple(self.nodes))
        if self.fold >= 0:
            image = values
            for axis in np.flatnonzero(self.mirrored):
                image = np.flip(image, int(axis))
                if self.periodic[axis]:
                    image = np.roll(image, 1, int(axis))  # node k mirrors node −k, so node 0 stays
            beyond = image.take(range(values.shape[self.fold] - int(self.fold_on_node)), self.fold)
            values = np.concatenate([beyond, values], self.fold)
        return np.ascontiguousarray(values.transpose(np.argsort(self.order)))


def lay_out(game: Game, grid: Grid, radius: int) -> Layout:
    """Return the layout of a game's grid for schemes of a radius; half of it where the grid mirrors itself.

    Raises:
        ConfigurationError: if the innermost axis is too long for the kernel's work arrays.
    """
    inner = list(game.slab_axes)
    if grid.shape[inner[-1]] > MOST_NODES:
        raise ConfigurationError(
            f"grid.shape: {grid.shape[inner[-1]]} nodes along {game.state[inner[-1]]}; at most {MOST_NODES} there"
        )
    order = [axis for axis in range(grid.dimension) if axis not in inner] + inner
    nodes = np.array(grid.shape, np.int64)[order]
    origin = np.array(grid.lower)[order]
    spacing = grid.spacing[order]
    boundary = [_BOUNDARY_CODES[grid.boundary[axis]] for axis in order]
    mirrored = np.zeros(grid.dimension, bool)
    fold, on_node = _fold(game, grid, order)
    if fold >= 0:
        mirrored[:] = [axis in game.mirrored_axes for axis in order]
        origin[fold] = 0.0 if on_node else spacing[fold] / 2.0
        nodes[fold] = (nodes[fold] + 1) // 2
    strides = np.append(np.cumprod(nodes[:0:-1])[::-1], 1)
    most = int(nodes.max())
    stencils = np.zeros((grid.dimension, most, 2 * radius, 5), np.int64)
    mirror_shifts = np.zeros((grid.dimension, most), np.int64)
    for axis in range(grid.dimension - 1):
        count = int(nodes[axis])
        for node in range(count):
            if mirrored[axis] and axis != fold:
                image = -node % count if boundary[axis] == PERIODIC else count - 1 - node
                mirror_shifts[axis, node] = (image - node) * strides[axis]
            for m in range(2 * radius):
                stencils[axis, node, m] = _stencil_entry(
                    node, node + m - radius, count, int(strides[axis]), boundary[axis], axis == fold, on_node
                )
    # Slabs of equal size, each at least a line.
    pieces = -(-int(nodes[-2] * nodes[-1]) // _SLAB_NODES)
    steps = np.arange(most)
    return Layout(
        order=tuple(order),
        nodes=nodes,
        coordinates=(origin[:, None] + steps * spacing[:, None]).astype(np.float32),
        inverse_spacing=(1.0 / spacing).astype(np.float32),
        stencils=stencils,
        mirror_shifts=mirror_shifts,
        slab_lines=max(1, -(-int(nodes[-2]) // pieces)),
        line_boundary=boundary[-1],
        mirrored=mirrored,
        fold=fold,
        fold_on_node=on_node,
        periodic=np.array([code == PERIODIC for code in boundary]),
    )


def _fold(game: Game, grid: Grid, order: list[int]) -> tuple[int, bool]:
    """Return the axis of which half is stored, or -1, and whether a node lies on the mirror."""
    foldable = [axis for axis in game.mirrored_axes if grid.boundary[axis] != "periodic"]
    if not foldable or not all(grid.mirrors_itself(axis) for axis in game.mirrored_axes):
        return -1, False
    return order.index(foldable[0]), grid.shape[foldable[0]] % 2 == 1


def _stencil_entry(
    node: int, low: int, count: int, stride: int, boundary: int, folded: bool, on_node: bool
) -> tuple[int, int, int, int, int]:
    """Return the entry of `Layout.stencils` for the difference between `low` and `low + 1`, seen from `node`."""
    sign = 0
    if boundary != PERIODIC:
        beyond_lower, beyond_upper = low < 0 and not folded, low + 1 >= count
        if beyond_lower or beyond_upper:
            # The face's own difference continues; away from zero, its sign is the face value's.
            low = 0 if beyond_lower else count - 2
            if boundary == AWAY_FROM_ZERO:
                sign = -1 if beyond_lower else 1
    entry = []
    for place in (low + 1, low):
        mirror = int(folded and place < 0)
        stored = (-place if on_node else -1 - place) if mirror else place % count
        entry += [(stored - node) * stride, mirror]
    return entry[0], entry[1], entry[2], entry[3], sign
