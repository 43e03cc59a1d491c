"""A table of two cars as compiled look-ups take it: its numbers, and the deficit W in one array."""

from typing import NamedTuple

import numpy as np
from numba.np.unsafe.ndarray import to_fixed_tuple

from hj_cosim.kernels import kernel
from hj_cosim.reachability.games.highway.target import FORMULA_NUMBERS, TargetFormula, formula_from


class TableGrid(NamedTuple):
    """What a look-up needs to know of a highway table but W itself; the state is (p_x_rel, p_y_rel, θ_r, v_r, v_o)."""

    begin: int  # where W begins in the flat array, in C order
    shape: tuple[int, int, int, int, int]
    lower: tuple[float, float, float, float, float]  # the first nodes
    upper: tuple[float, float, float, float, float]  # the last
    inverse_spacing: tuple[float, float, float, float, float]
    braking_shear: float  # k, s²/m, of the first axis
    target: TargetFormula
    has_target: bool  # else the game is another with the same state, and W is −V


class TableArrays(NamedTuple):
    """A highway value table as jitted code takes it, in two parts.

    Kernels hand them over one by one: jitted code counts references to an array that it takes out of a tuple, with
    atomic operations, and a look-up would take three times as long.
    """

    flat: np.ndarray  # W, float32
    grid: TableGrid


@kernel
def grid_from(begin: int, shape: tuple[int, int, int, int, int], numbers: np.ndarray) -> TableGrid:
    """Return the grid of a table of which W lies at `begin`, of the rest of its numbers (`reachability.packing`)."""
    return TableGrid(
        begin,
        shape,
        to_fixed_tuple(numbers, 5),
        to_fixed_tuple(numbers[5:], 5),
        to_fixed_tuple(numbers[10:], 5),
        numbers[15],
        formula_from(numbers[16:]),
        numbers[16 + FORMULA_NUMBERS] != 0.0,
    )
