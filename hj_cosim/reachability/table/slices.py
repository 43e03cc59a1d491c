"""Two-dimensional slices through a value table, for figures."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from hj_cosim.errors import ConfigurationError
from hj_cosim.reachability.table.table import ValueTable


@dataclass(frozen=True)
class ValueSlice:
    """V over two state variables, the others held."""

    x_name: str
    y_name: str
    x: np.ndarray  # (X,)
    y: np.ndarray  # (Y,)
    values: np.ndarray  # (Y, X), V
    target: np.ndarray  # (Y, X), V(0, ·)
    held: Mapping[str, float]


def value_slice(
    table: ValueTable,
    held: Mapping[str, float] | None = None,
    *,
    over: Sequence[str] = (),
    points: tuple[int, int] = (201, 201),
) -> ValueSlice:
    """Return a slice through a table of any game.

    Args:
        table: the table.
        held: state variables and where they are held; those left out are where the game has its pictures drawn, or in
            the middle of the grid.
        over: the two state variables along the slice; the first two of the state unless given.
        points: along either of them.

    Raises:
        ConfigurationError: if a name is not one of the table's state variables, is both held and drawn, or is held
            where the table does not reach.
    """
    game, held = table.game, held or {}
    names = game.state
    over = tuple(over) or names[:2]
    for name in (*held, *over):
        if name not in names:
            raise ConfigurationError(f"slice: {name!r} is no state of {game.name}; it has {', '.join(names)}")
    if len(set(over)) != 2 or len(over) != 2 or set(over) & set(held):
        raise ConfigurationError(f"slice: draw over two different states that are not held, not {', '.join(over)}")
    grid = table.grid
    middle = game.states_at(0.5 * (np.array(grid.lower) + np.array(grid.upper)), table.parameters)
    here = np.array(
        [{**game.drawn_at, **held}.get(name, place) for name, place in zip(names, middle, strict=True)], np.float64
    )
    if not table.in_grid(here)[0]:
        for name in held:
            low, high = table.extent(names.index(name), here)
            if not low <= held[name] <= high:
                raise ConfigurationError(f"slice: {name} = {held[name]:g} is not in the table; {low:g} to {high:g} is")
    axes = [names.index(name) for name in over]
    along, across = (np.linspace(*table.extent(axis, here), count) for axis, count in zip(axes, points, strict=True))
    states = np.empty((len(across), len(along), len(names)))
    states[:] = here
    states[..., axes[0]] = along
    states[..., axes[1]] = across[:, None]
    rows, shape = states.reshape(-1, len(names)), states.shape[:2]
    return ValueSlice(
        over[0],
        over[1],
        along,
        across,
        table.value(rows).reshape(shape),
        table.target_values(rows).reshape(shape),
        {name: float(place) for name, place in zip(names, here, strict=True) if name not in over},
    )


def parse_held(texts: Sequence[str]) -> dict[str, float]:
    """Return state variables and where they are held, of texts NAME=VALUE.

    Raises:
        ConfigurationError: if a text is none, or its value is no number.
    """
    held = {}
    for text in texts:
        name, _, value = text.partition("=")
        try:
            held[name.strip()] = float(value)
        except ValueError as error:
            raise ConfigurationError(f"slice: {text!r} is not NAME=NUMBER, such as v_o=20") from error
    return held
