"""A minute of every scenario on 20 seeds: no collision among the cars, and the density stays. Slow, so not a test."""

import libsumo
import numpy as np
import pytest

from hj_cosim.config import RobotSettings
from hj_cosim.traffic.scenarios import load_scenario
from hj_cosim.traffic.settling import follow_lane, robot_driver
from hj_cosim.traffic.sumo_world import ROBOT, SumoWorld
from hj_cosim.vehicles.observation import Observation

STEP = 0.02
SECONDS = 60.0
SEEDS = range(20)
SCENARIOS = ("light", "paper", "dense", "jam", "two_lanes", "six_lanes")


def mean_density(seen: Observation, lane_count: int) -> float:
    """Return cars per km and lane between the first and the last tenth of the cars: outliers shall not count."""
    first, last = np.quantile(seen.x, [0.1, 0.9])
    return 1000.0 * 0.8 * len(seen.x) / ((last - first) * lane_count)


def a_minute(name: str, seed: int, robot_follows: bool) -> tuple[set[tuple[str, str]], float]:
    """Return who collided with whom, and the largest relative change of the density.

    The robot keeps its speed, as `--planner idle --filter none` has it, or follows its leader.
    """
    scenario = load_scenario(name)
    collisions: set[tuple[str, str]] = set()
    with SumoWorld(scenario, RobotSettings(), seed) as world:
        start = mean_density(world.observe(), world.road.lane_count)
        world.settle(3.0)
        driver = robot_driver(scenario.drivers, scenario.robot.speed)
        drift = 0.0
        for step in range(round(SECONDS / STEP)):
            seen = world.observe()
            x, y, _, speed = seen.robot
            if robot_follows:
                world.step(*follow_lane(seen, driver, world.road, 5.0, STEP))
            else:
                world.step(np.array([x + speed * STEP, y, 0.0, speed]), 0.0)
            collisions |= {(each.collider, each.victim) for each in libsumo.simulation.getCollisions()}
            if step % 50 == 0:
                drift = max(drift, abs(mean_density(seen, world.road.lane_count) / start - 1.0))
    return collisions, drift


@pytest.mark.parametrize("robot_follows", [False, True], ids=["robot_idle", "robot_follows"])
@pytest.mark.parametrize("name", SCENARIOS)
def test_cars_never_collide_and_the_density_stays(name, robot_follows):
    results = [a_minute(name, seed, robot_follows) for seed in SEEDS]
    among_cars = [{pair for pair in pairs if ROBOT not in pair} for pairs, _ in results]
    by_the_robot = sum(any(ROBOT in pair for pair in pairs) for pairs, _ in results)
    drift = max(drift for _, drift in results)
    print(
        f"\n{name:10} robot {'follows' if robot_follows else 'idle   '}: {len(results)} seeds of {SECONDS:.0f} s,"
        f" collisions among cars in {sum(map(bool, among_cars))}, with the robot in {by_the_robot},"
        f" density changes by {100 * drift:.1f} % at most"
    )
    assert not any(among_cars)
    assert drift < 0.1
    if robot_follows:
        assert by_the_robot == 0
