"""Two-dimensional slices through a value table, for figures."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from hj_cosim.errors import ConfigurationError
from hj_cosim.reachability.table.table import ValueTable

# The paper's figure of the value function: both cars parallel, the robot at 10 m/s, the other at 20 m/s.
PAPER_SLICE = {"theta": 0.0, "v_r": 10.0, "v_o": 20.0}


@dataclass(frozen=True)
class ValueSlice:
    """V over two state variables, the others fixed."""

    x_name: str
    y_name: str
    x: np.ndarray  # (X,)
    y: np.ndarray  # (Y,)
    values: np.ndarray  # (Y, X), V
    target: np.ndarray  # (Y, X), V(0, ·)
    fixed: Mapping[str, float]


def value_slice(
    table: ValueTable, fixed: Mapping[str, float] | None = None, *, x: str = "", y: str = "", points: int = 201
) -> ValueSlice:
    """Return a slice through a table.

    Args:
        table: the table.
        fixed: state variables and where they are held; those left out are 0, or as near to it as the grid goes. For
            the highway game nothing at all means the paper's slice.
        x, y: the state variables along the slice; the first two of the state unless given.
        points: per direction.

    Raises:
        ConfigurationError: if a name is not one of the table's state variables, or is both fixed and drawn.
    """
    names = table.dynamics.state
    x, y = x or names[0], y or names[1]
    if fixed is None:
        fixed = PAPER_SLICE if table.dynamics.name == "highway" and (x, y) == names[:2] else {}
    for name in (*fixed, x, y):
        if name not in names:
            raise ConfigurationError(f"slice: {name!r} is no state of {table.dynamics.name}; it has {', '.join(names)}")
    if x == y or x in fixed or y in fixed:
        raise ConfigurationError(f"slice: draw over two different states that are not held fixed, not {x} and {y}")
    grid = table.grid
    held = {
        name: float(np.clip(fixed.get(name, 0.0), low, high))
        for name, low, high in zip(names, grid.lower, grid.upper, strict=True)
        if name not in (x, y)
    }
    rest = np.array([held.get(name, 0.0) for name in names])
    along = np.linspace(*table.extent(names.index(x), rest), points)
    across = np.linspace(*table.extent(names.index(y), rest), points)
    states = np.empty((points, points, len(names)))
    for axis, name in enumerate(names):
        states[..., axis] = along[None, :] if name == x else across[:, None] if name == y else held[name]
    rows = states.reshape(-1, len(names))
    shape = (points, points)
    return ValueSlice(
        x, y, along, across, table.value(rows).reshape(shape), table.target_values(rows).reshape(shape), held
    )
