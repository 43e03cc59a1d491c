"""Scenes to ask planners and filters about, and a table for them that needs no solving."""

from collections.abc import Iterator
from functools import cache

import numpy as np

from hj_cosim.reachability.games.catalogue import find_game
from hj_cosim.reachability.solver.solver import SolveReport
from hj_cosim.reachability.table.table import ValueTable
from hj_cosim.scene.observation import Observation
from hj_cosim.scene.road import Road, StraightRoad
from hj_cosim.settings import GridSettings, RobotSettings, TableSpecification

ROAD = StraightRoad(lane_count=4)
SCENES = 40
# A robot and the cars of each scene: none, a few, a road full of them.
CROWDS = (0, 1, 5, 30)


@cache
def target_table() -> ValueTable:
    """Return V(0, ·) of the highway game on a coarse grid, a table as any other but for being too high."""
    game = find_game("highway")
    specification = TableSpecification(
        dynamics="highway",
        grid=GridSettings(
            lower=(-100.0, -8.0, -0.4, 0.0, 0.0), upper=(100.0, 8.0, 0.4, 40.0, 40.0), shape=(41, 17, 9, 9, 9)
        ),
    )
    report = SolveReport(
        shape=specification.grid.shape, scheme=specification.scheme, runge_kutta=0, horizon=0.0, steps=0, time_step=0.0,
        seconds=0.0, cell_updates_per_second=0.0, peak_memory_mib=0.0, residual=0.0, unsafe_share=0.0, versions={},
    )  # fmt: skip
    empty = ValueTable(specification, game, np.empty(0, np.float32), report)
    nodes = np.stack(np.meshgrid(*empty.grid.axes, indexing="ij"), axis=-1).reshape(-1, 5)
    values = game.target_values(nodes, game.parameter_values({}, "hj_cosim.testing"))
    return ValueTable(specification, game, values.astype(np.float32).reshape(empty.grid.shape), report)


def scenes(road: Road = ROAD, seed: int = 0) -> Iterator[Observation]:
    """Yield SCENES scenes, a step apart as far as the clock goes: empty ones, and ones with cars everywhere.

    The robot stands, drives, or is as fast as it can be; cars may overlap it, for such scenes have to be answered, too.
    """
    draw = np.random.default_rng(seed)
    speed_max = RobotSettings().speed_max
    for index in range(SCENES):
        count = CROWDS[index % len(CROWDS)]
        lane = draw.integers(0, road.lane_count, count)
        speed = (0.0, 24.0, speed_max)[index % 3]
        robot_lane = int(draw.integers(0, road.lane_count))
        yield Observation(
            time=0.02 * index,
            robot=np.array([500.0, road.lane_centre(robot_lane, 500.0) + 0.3, draw.uniform(-0.1, 0.1), speed]),
            robot_acceleration=0.0,
            vehicle=np.arange(count),
            x=draw.uniform(400.0, 620.0, count),
            y=road.lane_centres(lane, np.full(count, 500.0)),
            heading=draw.uniform(-0.05, 0.05, count),
            speed=draw.uniform(0.0, 30.0, count),
            acceleration=draw.uniform(-2.0, 2.0, count),
            lane=lane,
            target_lane=lane.copy(),
            length=np.full(count, 5.0),
            width=np.full(count, 2.0),
        )
