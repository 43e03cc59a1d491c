"""The decorator of the innermost compiled kernels, which allocate nothing and return no arrays.

Numba counts references to every array that a kernel takes out of a tuple, slices or hands on, with atomic operations,
wherever it cannot prove that it need not: of a car's decision in the planner's prediction that was three quarters. Who
allocates nothing cannot lose anything, so nothing is counted in them. Numba's own kernels do the same.
"""

from collections.abc import Callable
from typing import Any

from numba import njit


def kernel(function: Callable) -> Callable[..., Any]:
    """Compile a function that allocates no array and returns none; its arrays belong to who calls it.

    Division follows NumPy: by zero it gives inf or NaN.

    Raises:
        numba.NumbaRuntimeError: when a function is called that does allocate an array.
    """
    compiled: Callable[..., Any] = njit(cache=True, error_model="numpy", _nrt=False)(function)
    return compiled
