"""The tables of all size classes at once, as kernels take them (jitted).

A robot has a table for each class of cars that it meets (`size_classes`). All have the same axes, but for larger bodies
the grid reaches farther. So their deficits lie one behind the other in one flat array, and a row of numbers for each
says where it begins and what else a look-up needs. A kernel makes the `TableGrid` of a class of its row, which takes
some 30 ns, and finds a car's class by its body on the way. So nothing is sorted into classes in Python, where each
class would cost a call more; nothing is compiled anew for another number of classes, as it would be for a tuple of
tables; and with cars alone it is one table and one row, at what that cost before.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from hj_cosim.kernels import kernel
from hj_cosim.reachability.packing import packed
from hj_cosim.reachability.table.table_arrays import TableArrays, TableGrid, grid_from

# Columns of a row: the largest body of the class, m, comes first; where W begins; its nodes; what
# `table_arrays.grid_from` takes.
BEGIN, NODES, REST = 2, 3, 8


class TableStack(NamedTuple):
    """Tables by size class, the smallest first; the state of all is (p_x_rel, p_y_rel, θ_r, v_r, v_o)."""

    flat: np.ndarray  # W of all of them, float32
    numbers: np.ndarray  # (classes, REST + n) float64, a row for each


def stacked(tables: Sequence[tuple[tuple[float, float], TableArrays]]) -> TableStack:
    """Return tables, each with the largest body (length and width, m) that it is for, in one; the smallest first."""
    rows, begin = [], 0
    for body, arrays in tables:
        rows.append(np.array([*body, begin, *packed(arrays.grid)[1:]]))
        begin += arrays.flat.size
    first = tables[0][1].flat
    flat = first if len(tables) == 1 else np.concatenate([arrays.flat for _, arrays in tables])
    return TableStack(flat, np.array(rows))


@kernel
def grid_in(numbers: np.ndarray, kind: int) -> TableGrid:
    """Return the grid of a size class's table in the stack, by its row."""
    row = numbers[kind]
    shape = (int(row[NODES]), int(row[NODES + 1]), int(row[NODES + 2]), int(row[NODES + 3]), int(row[NODES + 4]))
    return grid_from(int(row[BEGIN]), shape, row[REST:])
