"""The paper's two scenes with the paper's preset and its whole table, which takes too long to solve for `make test`."""

import pytest

from hj_cosim.cosim.configuration import resolve_config
from hj_cosim.planning.catalogue import make_planner
from hj_cosim.planning.contract import LEFT, RIGHT, SLOWER
from hj_cosim.reachability.table.store import load_table
from hj_cosim.scene.observation import Target
from hj_cosim.traffic.fake import FakeWorld


@pytest.mark.parametrize(
    ("scene", "planner", "action"),
    [("squeeze", "op", LEFT), ("squeeze", "hjop", RIGHT), ("boxed_in", "op", LEFT), ("boxed_in", "hjop", SLOWER)],
)
def test_op_takes_the_gap_and_hjop_keeps_out_of_it(scene, planner, action):
    config = resolve_config(scene, preset="paper", assignments=[f"planner.kind={planner}"])
    start = config.scenario.robot
    world = FakeWorld(config.scenario.cars, robot_start=(0.0, 4.0 * start.lane, 0.0, start.speed))
    planner = make_planner(config.planner, config.robot, config.scenario.drivers, world.road, load_table(config.table))
    assert planner.plan(world.observe(), Target(start.lane, start.speed)).action == action
