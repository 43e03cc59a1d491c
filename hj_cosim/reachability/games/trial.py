"""A trial of a game of a user's own as plain Python, before its compiled functions run on millions of nodes.

Compiled, a function that reads or writes beyond its arrays takes what lies there in memory, or ends the process, and
one that leaves out some of its output leaves what was in memory: tables that look like any other. The interpreter
notices. `hj_cosim.testing.check_game` tries far more.
"""

import numpy as np

from hj_cosim.errors import ConfigurationError
from hj_cosim.plugin_answers import STRANGERS_ERRORS, named, shown_path
from hj_cosim.reachability.games.contract import Game
from hj_cosim.reachability.grid import Grid

# What outputs hold beforehand, once each: what holds both afterwards has not been written.
_FILLS = (np.float32(12345.5), np.float32(-54321.25))
_POINTS = 3


def require_sound(game: Game, grid: Grid, parameters: np.ndarray, limits: np.ndarray, source: str) -> None:
    """Check that a game's functions stay within their arrays and write all of their output, at three points of a grid.

    Args:
        game: whose functions are tried.
        grid: its lowest, middle and highest points are taken.
        parameters: (P,) float32, as the functions take them.
        limits: (2, n) float32, likewise.
        source: what an error message calls the specification.

    Raises:
        ConfigurationError: if a function does not, or raises anything but an arithmetic error; compiled, it answers
            inf or NaN there, which the solver finds.
    """
    lower, upper = np.array(grid.lower, np.float32), np.array(grid.upper, np.float32)
    points = np.ascontiguousarray(np.linspace(lower, upper, _POINTS, dtype=np.float32).T)
    slopes = np.ones_like(points) * np.array([-1.0, 0.5, 1.0], np.float32)
    u, d = (np.zeros((len(inputs), _POINTS), np.float32) for inputs in (game.controls, game.disturbances))
    row, rows = (_POINTS,), points.shape
    trials = {
        "target": ((points, parameters), (row,)),
        "flow": ((points, u, d, parameters), (rows,)),
        "hamiltonian": ((points, slopes, parameters, limits), (row,)),
        "dissipation": ((points, parameters), (rows,)),
        "optimal_inputs": ((points, slopes, parameters, limits), (u.shape, d.shape)),
    }
    for name, (given, shapes) in trials.items():
        unwritten = [_called(game, name, given, shapes, fill, source) for fill in _FILLS]
        if any((first & second).any() for first, second in zip(*unwritten, strict=True)):
            raise ConfigurationError(
                f"{source}: {_place(game, name)}: {name} does not write all of its output; the rest would be whatever"
                " is in memory"
            )


def _called(
    game: Game,
    name: str,
    given: tuple[np.ndarray, ...],
    shapes: tuple[tuple[int, ...], ...],
    fill: np.float32,
    source: str,
) -> list[np.ndarray]:
    """Return, for each output of a function, where it holds `fill` afterwards."""
    outputs = [np.full(shape, fill, np.float32) for shape in shapes]
    function = getattr(game, name)
    try:
        with np.errstate(all="ignore"):
            getattr(function, "py_func", function)(*(array.copy() for array in given), *outputs)
    except IndexError as error:
        raise ConfigurationError(
            f"{source}: {_place(game, name)}: {name} reaches beyond an array: {error}; the game has {game.dimension}"
            f" state variables, {len(game.controls)} controls, {len(game.disturbances)} disturbances and"
            f" {len(game.parameters)} parameters"
        ) from error
    except (ArithmeticError, ValueError):
        return [np.zeros(shape, bool) for shape in shapes]
    except STRANGERS_ERRORS as error:
        raise ConfigurationError(f"{source}: {_place(game, name)}: {name} raised {named(error)}") from error
    return [output == fill for output in outputs]


def _place(game: Game, name: str) -> str:
    function = getattr(game, name)
    code = getattr(function, "py_func", function).__code__
    return f"{shown_path(code.co_filename)}:{code.co_firstlineno}"
