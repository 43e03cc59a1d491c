"""How often the slack's weight λ_3 leaves rows unmet that could be met: λ_3 = 1, the paper's, is no exact penalty.

In the preset `paper`, whose rows have to be met while a car is in K; where others do their duties hardly one ever is.
"""

import pytest

from hj_cosim.control.catalogue import make_filter
from hj_cosim.control.contract import FilterDecision, SafetyFilter
from hj_cosim.cosim.configuration import resolve_config
from hj_cosim.cosim.episode import drive
from hj_cosim.planning.catalogue import make_planner
from hj_cosim.reachability.table.store import load_table
from hj_cosim.scene.observation import CarValues, Control, Observation
from hj_cosim.traffic.sumo.world import SumoWorld

SEEDS = range(600, 620)
UNMET = 1e-3  # m/s of slack


class Counting:
    """A filter whose results are counted."""

    def __init__(self, inner: SafetyFilter) -> None:
        self.inner, self.in_k, self.meetable, self.left_unmet = inner, 0, 0, 0

    def filter(self, observation: Observation, values: CarValues, desired: Control) -> FilterDecision:
        result = self.inner.filter(observation, values, desired)
        self.in_k += result.constrained
        self.meetable += result.constrained and result.meetable
        self.left_unmet += result.constrained and result.meetable and result.slack > UNMET
        return result


@pytest.mark.parametrize("weight", [1.0, 10.0, 100.0])
def test_meetable_rows_left_unmet(weight: float) -> None:
    in_k, meetable, unmet, collided = 0, 0, 0, 0
    for seed in SEEDS:
        config = resolve_config("dense", preset="paper", assignments=[f"filter.slack_weight={weight}", f"seed={seed}"])
        table = load_table(config.table)
        with SumoWorld(config.scenario, config.robot, config.seed, config.simulation.step) as world:
            world.settle(config.simulation.settle_time)
            planner = make_planner(config.planner, config.robot, config.scenario.drivers, world.road, table)
            counting = Counting(make_filter(config.filter, config.robot, world.road, table, config.simulation.step))
            record = drive(world, planner, counting, table, config).record
        in_k, meetable, unmet = in_k + counting.in_k, meetable + counting.meetable, unmet + counting.left_unmet
        collided += bool(record.threats.collision.any())
    print(
        f"\nλ_3 = {weight:g}: {len(SEEDS)} episodes of dense, {in_k} samples in K, rows meetable in {meetable},"
        f" left unmet in {unmet} of these ({unmet / max(meetable, 1):.2%}), {collided} collisions"
    )
    assert in_k > 1000
    assert unmet == 0 or weight < 10.0
