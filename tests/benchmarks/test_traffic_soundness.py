"""A minute of every scenario on 20 seeds: no collision among the cars, and the density stays. Slow, so not a test."""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import libsumo
import numpy as np
import pytest

from hj_cosim.scene.observation import Observation
from hj_cosim.settings import RobotSettings, Scenario
from hj_cosim.traffic.settling import follow_lane, robot_driver
from hj_cosim.traffic.sources.scenarios import load_scenario, scenario_names
from hj_cosim.traffic.sumo.puppet import ROBOT
from hj_cosim.traffic.sumo.world import SumoWorld
from hj_cosim.verification.traffic_measures import Lanes

STEP = 0.02
SETTLING = 3.0  # s
SECONDS = 60.0
SEEDS = range(20)


def is_traffic(scenario: Scenario) -> bool:
    """Return whether cars are drawn and none of them means harm."""
    return not scenario.is_hand_made and scenario.rogues.share == 0.0 and not any(car.rogue for car in scenario.cars)


SCENARIOS = [name for name in scenario_names() if is_traffic(load_scenario(name))]


@dataclass(frozen=True)
class Minute:
    """What one seed came to."""

    among_cars: int  # pairs of cars that SUMO reported, from the first step of settling on
    among_cars_before: int  # those of them that the robot's own first collision cannot have caused
    with_robot: int  # cars that the robot touched
    drift: float  # largest relative change of the mean density
    hardest_braking: float  # m/s², of any car before the robot's first collision


def mean_density(seen: Observation, lanes: Lanes) -> float:
    """Return cars per km and lane between the first and the last tenth of the cars: outliers shall not count."""
    first, last = np.quantile(seen.x, [0.1, 0.9])
    return 1000.0 * 0.8 * len(seen.x) / lanes.between(first, last)


def robot_states(world: SumoWorld, driver: np.ndarray, robot_follows: bool) -> Iterator[tuple[float, Observation]]:
    """Drive the robot through settling and a minute; yield the time since it took over, and what is seen then.

    It keeps its speed, as `--planner idle --filter none` has it, or goes on following its leader.
    """
    for step in range(-round(SETTLING / STEP), round(SECONDS / STEP)):
        seen = world.observe()
        if step < 0 or robot_follows:
            world.step(*follow_lane(seen, driver, world.road, RobotSettings().length, STEP))
        else:
            x, y, _, speed = seen.robot
            world.step(np.array([x + speed * STEP, y, 0.0, speed]), 0.0)
        yield step * STEP, world.observe()


def a_minute(name: str, seed: int, robot_follows: bool) -> Minute:
    scenario = load_scenario(name)
    first_touch: dict[frozenset[str], float] = {}
    robots_first = math.inf
    drift = hardest = 0.0
    with SumoWorld(scenario, RobotSettings(), seed) as world:
        lanes = Lanes.of(world.road)
        start = mean_density(world.observe(), lanes)
        driver = robot_driver(scenario.drivers, scenario.robot.speed)
        for time, seen in robot_states(world, driver, robot_follows):
            for each in libsumo.simulation.getCollisions():
                pair = frozenset((each.collider, each.victim))
                first_touch.setdefault(pair, time)
                if ROBOT in pair:
                    robots_first = min(robots_first, time)
            drift = max(drift, abs(mean_density(seen, lanes) / start - 1.0))
            if time < robots_first:
                hardest = max(hardest, -float(seen.acceleration.min()))
    among_cars = [time for pair, time in first_touch.items() if ROBOT not in pair]
    return Minute(
        len(among_cars),
        sum(time < robots_first for time in among_cars),
        len(first_touch) - len(among_cars),
        drift,
        hardest,
    )


@pytest.mark.parametrize("robot_follows", [False, True], ids=["robot_idle", "robot_follows"])
@pytest.mark.parametrize("name", SCENARIOS)
def test_cars_never_collide_and_the_density_stays(name, robot_follows):
    minutes = [a_minute(name, seed, robot_follows) for seed in SEEDS]
    drifts = [minute.drift for minute in minutes]
    print(
        f"\n{name:10} robot {'follows' if robot_follows else 'idle   '}: {len(minutes)} seeds of {SECONDS:.0f} s,"
        f" collisions among cars {sum(minute.among_cars for minute in minutes)}"
        f" ({sum(minute.among_cars_before for minute in minutes)} before the robot's own first),"
        f" robot hits a car in {sum(minute.with_robot > 0 for minute in minutes)} seeds,"
        f" density changes by {100 * max(drifts):.1f} % at most, {100 * np.mean(drifts):.1f} % in the mean over seeds,"
        f" hardest braking {max(minute.hardest_braking for minute in minutes):.1f} m/s²"
    )
    assert not any(minute.among_cars for minute in minutes)
    assert np.mean(drifts) < 0.1
    if robot_follows:
        assert not any(minute.with_robot for minute in minutes)
