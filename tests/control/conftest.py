"""Value tables that need no solve: V(0, ·) on a coarse grid, and a linear V, which interpolation represents exactly.

A linear V is no solution of the highway game: its game has the same state and a target set of its own, none.
"""

import dataclasses
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from hj_cosim.reachability.games.catalogue import find_game
from hj_cosim.reachability.games.contract import Game
from hj_cosim.reachability.table.table import ValueTable
from hj_cosim.scene.observation import Observation
from hj_cosim.settings import GridSettings, TableSpecification

sys.path.insert(0, str(Path(__file__).resolve().parent))  # extreme_scenes

# Property tests take the same examples every time, however long one takes on a busy machine.

SPECIFICATION = TableSpecification(
    dynamics="highway",
    grid=GridSettings(
        lower=(-100.0, -8.0, -0.4, 0.0, 0.0), upper=(100.0, 8.0, 0.4, 40.0, 40.0), shape=(41, 17, 9, 9, 9)
    ),
)


def no_target(x: np.ndarray, c: np.ndarray, out: np.ndarray) -> None:
    out[:] = 1.0


def table_of(value: Callable[[np.ndarray], np.ndarray], game: Game) -> ValueTable:
    """Return a table of V as a function of states (N, 5)."""
    empty = ValueTable(SPECIFICATION, game, np.empty(0, np.float32), report=None)
    nodes = np.stack(np.meshgrid(*empty.grid.axes, indexing="ij"), axis=-1).reshape(-1, 5)
    values = value(nodes).astype(np.float32).reshape(empty.grid.shape)
    return ValueTable(SPECIFICATION, game, values, report=None)


@pytest.fixture(scope="session")
def table() -> ValueTable:
    game = find_game("highway")
    parameters = game.parameter_values({}, "the test")
    return table_of(lambda states: game.target_values(states, parameters), game)


@pytest.fixture(scope="session")
def game_without_target() -> Game:
    return dataclasses.replace(find_game("highway"), target=no_target, target_formula=None, manoeuvres=None)


@pytest.fixture(scope="session")
def linear_table(game_without_target: Game) -> ValueTable:
    """V = −p_x − 2 v_r + v_o − 20: the robot behind another car, safe when far or slow."""
    return table_of(lambda states: states @ np.array([-1.0, 0.0, 0.0, -2.0, 1.0]) - 20.0, game_without_target)


@pytest.fixture(scope="session")
def safe_table(game_without_target: Game) -> ValueTable:
    """V = −p_x − 8 v_r + 100, whose row a <= (v_o cosθ_o − v_r) / 8 can be met everywhere."""
    return table_of(lambda states: states @ np.array([-1.0, 0.0, 0.0, -8.0, 0.0]) + 100.0, game_without_target)


@pytest.fixture(scope="session")
def observe() -> Callable[..., Observation]:
    """How to observe a robot among cars given as rows (x, y, heading, speed), numbered from 0."""
    return _observe


def _observe(robot, cars, time=0.0) -> Observation:
    cars = np.array(cars, float).reshape(-1, 4)
    count, lanes = len(cars), np.round(cars[:, 1] / 4.0).astype(int)
    return Observation(
        time=time, robot=np.array(robot, float), robot_acceleration=0.0, vehicle=np.arange(count), x=cars[:, 0],
        y=cars[:, 1], heading=cars[:, 2], speed=cars[:, 3], acceleration=np.zeros(count), lane=lanes,
        target_lane=lanes, length=np.full(count, 5.0), width=np.full(count, 2.0),
    )  # fmt: skip
