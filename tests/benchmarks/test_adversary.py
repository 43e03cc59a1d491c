"""What an adversary that searches gets from the default filter: `pytest tests/benchmarks/test_adversary.py -s`."""

import os
from time import perf_counter

import pytest

from hj_cosim.reachability.table.size_classes import SIZE_CLASSES
from hj_cosim.reachability.table.sized import load_tables
from hj_cosim.reachability.table.store import load_table
from hj_cosim.reachability.table.table import ValueTable
from hj_cosim.settings import robot_and_filter
from hj_cosim.verification.adversary import DESIRED, AdversarySettings, search_adversary

GAMES = int(os.environ.get("HJ_COSIM_GAMES", "2000"))


def attack(table: ValueTable, above: float, up_to: float, games: int) -> None:
    """Search with every desired control, print what was found, and let nobody collide."""
    robot, filter_settings = robot_and_filter("best")
    print(f"\n{table.size.name}: {games} games each from V in ({above:g}, {up_to:g}], 6 s, 288 rollouts a game")
    print(f"{'desired':22s}{'entered':>8s}{'collided':>9s}{'no escape':>10s}{'fall 50 %':>10s}{'90 %':>7s}", end="")
    print(f"{'99 %':>7s}{'max':>7s}{'s':>8s}")
    for desired in DESIRED:
        started = perf_counter()
        settings = AdversarySettings(games=games, desired=desired, above=above, up_to=up_to)
        found = search_adversary(table, settings, filter_settings, robot)
        print(
            f"{desired:22s}{found.entered:8d}{found.collided:9d}{found.without_escape:10d}{found.fall_median:10.2f}"
            f"{found.fall_p90:7.2f}{found.fall_p99:7.2f}{found.fall_max:7.2f}{perf_counter() - started:8.1f}"
        )
        assert found.rollouts == 288 * games
        assert found.collided == 0


@pytest.mark.parametrize(("above", "up_to"), [(2.0, 2.5), (0.0, 2.0)])
def test_search(above, up_to):
    attack(load_table("highway"), above, up_to, GAMES)


@pytest.mark.parametrize("size", SIZE_CLASSES[1:], ids=lambda size: size.name)
def test_search_with_a_truck(size):
    tables = load_tables("highway", SIZE_CLASSES, robot=robot_and_filter("best")[0])
    attack(next(table for table in tables.by_size if table.size == size), 2.0, 2.5, GAMES // 5)
