"""The states that a table is asked about, checked before any look-up."""

import math

import numpy as np

from hj_cosim.errors import StateError
from hj_cosim.reachability.games.contract import Game
from hj_cosim.reachability.grid import Grid

_LARGEST_ANGLE = math.pi * (1.0 + 1e-6)  # float32 rounds π up


def state_rows(game: Game, grid: Grid, states: np.ndarray) -> np.ndarray:
    """Return `states` as rows, (N, n) float64.

    A state that is not finite passes: of it nothing is known, and that is what a look-up answers.

    Args:
        game: whose state it is.
        grid: of the table.
        states: (N, n), or (n,) for a single one.

    Raises:
        StateError: if they have another shape, are no real numbers, or an angle is beyond ± π, which is mostly one in
            degrees. An angle along which the grid is periodic may be any number of turns away.
    """
    axes = f"({', '.join(game.state)})"
    try:
        given = np.asarray(states)
        if np.iscomplexobj(given):
            raise TypeError("complex numbers have no order")
        rows = np.atleast_2d(given.astype(np.float64))
    except (TypeError, ValueError) as error:
        raise StateError(f"states of {game.name} are numbers {axes}, not {type(states).__name__}: {error}") from error
    if rows.ndim != 2 or rows.shape[1] != game.dimension:
        raise StateError(
            f"states of {game.name} have the shape {np.shape(states)}; (N, {game.dimension}) is right, in the order"
            f" {axes}"
        )
    for name in game.angles:
        axis = game.state.index(name)
        if grid.boundary[axis] == "periodic":
            continue
        beyond = np.flatnonzero(np.isfinite(rows[:, axis]) & (np.abs(rows[:, axis]) > _LARGEST_ANGLE))
        if len(beyond):
            raise StateError(
                f"{name} = {rows[beyond[0], axis]:g} in state {beyond[0]} of {game.name} {axes} is beyond ± π; angles"
                " are in radians"
            )
    return rows
