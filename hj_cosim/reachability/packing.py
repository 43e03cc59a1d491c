"""The constants of a kernel in one array.

A NamedTuple is how kernels read constants, but to hand one over from Python costs some 0.1 µs a number, at every call:
9 µs for a table, which is as much as its look-ups for a hundred cars. So what is called at every step is handed one
array of numbers, and makes the NamedTuple of it itself, which is free there. Each type has the function that does
beside it: `target.formula_from`, `other_car.disturbance_from`, `paths.game_from`, `table_arrays.grid_from`.
"""

import numpy as np


def packed(constants: tuple) -> np.ndarray:
    """Return all numbers of a NamedTuple, those of tuples within it in their place, (n,) float64.

    Arrays are left out: they are handed over by themselves.
    """
    return np.array(_numbers(constants))


def _numbers(constants: tuple) -> list[float]:
    numbers: list[float] = []
    for item in constants:
        if isinstance(item, tuple):
            numbers += _numbers(item)
        elif not isinstance(item, np.ndarray):
            numbers.append(float(item))
    return numbers
