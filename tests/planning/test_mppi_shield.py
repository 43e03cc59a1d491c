"""A filter inside the sampling planner's rollouts, against the rows that a filter is given."""

from dataclasses import replace

import numpy as np
import pytest

from hj_cosim.planning.mppi.others import Others
from hj_cosim.planning.mppi.planner import MppiPlanner
from hj_cosim.planning.mppi.rollouts import Costs, Outlook, RobotModel, drive, judge, worth
from hj_cosim.planning.mppi.shield import NO_SHIELD, Shield, held_acceleration
from hj_cosim.planning.optimistic.reward import reward_model
from hj_cosim.reachability.games.highway.rows import row_numbers
from hj_cosim.reachability.table.cars import car_values, rows_of_cars
from hj_cosim.reachability.table.value_scale import scaled, steepness
from hj_cosim.scene.observation import Target
from hj_cosim.scene.road import StraightRoad
from hj_cosim.settings import DriverSettings, PlannerSettings, RobotSettings

EPSILON, APPROACH = 0.5, 4.0
STEP, SIZES = 0.2, (np.array([5.0]), np.array([2.0]))
ROBOT = RobotModel(5.0, 2.0, 0.3, -6.0, 4.0, 4.0, 40.0, 0.3, 4.0, 4)


@pytest.fixture
def shield(small_table) -> Shield:
    return Shield(row_numbers(small_table.parameters), EPSILON, APPROACH)


def others_in(observation) -> Others:
    at = (observation.x[None], observation.y[None], observation.speed[None])
    return Others(*at, observation.length, observation.width)


def held(shield, table, observation, omega, asked) -> float:
    nearest = np.append(np.arange(len(observation.x)), -1)
    return held_acceleration(observation.robot, others_in(observation), 0, nearest, omega, asked, table.stack, shield)


def bounds(table, observation, omega) -> tuple[float, float]:
    """Return the least and the greatest acceleration that the filter's rows leave at a turn rate."""
    values = car_values(table, observation)
    _, rows = rows_of_cars(table, observation, values.value, values.gradient, np.finfo(float).max)
    least, most = -np.inf, np.inf
    for value, p, q, c in rows[:4].T:
        scale = scaled(value)
        rise = 0.0 if value <= EPSILON else -APPROACH * steepness(scale) * (scale - scaled(EPSILON))
        # p ω + q a + c >= rise
        if q > 1e-9:
            least = max(least, (rise - c - p * omega) / q)
        elif q < -1e-9:
            most = min(most, (rise - c - p * omega) / q)
    return least, most


def test_an_acceleration_is_brought_to_the_nearest_that_all_rows_leave(shield, small_table, observe):
    generator, changed = np.random.default_rng(0), 0
    for _ in range(300):
        ahead = (1, generator.uniform(8.0, 60.0), generator.uniform(10.0, 25.0))
        behind = (int(generator.integers(0, 3)), generator.uniform(-60.0, -8.0), generator.uniform(15.0, 30.0))
        cars = [ahead, behind]
        scene = observe(cars, lane=1, speed=generator.uniform(15.0, 28.0))
        omega, asked = generator.uniform(-0.05, 0.05), generator.uniform(-6.0, 4.0)
        least, most = bounds(small_table, scene, omega)
        if least > most:
            continue
        assert held(shield, small_table, scene, omega, asked) == pytest.approx(np.clip(asked, least, most), abs=1e-6)
        changed += not least <= asked <= most
    assert changed > 30


def test_where_no_acceleration_will_do_the_car_with_less_left_decides(shield, small_table, observe):
    decided = set()
    for ahead in np.linspace(7.0, 40.0, 34):
        for behind in np.linspace(-40.0, -7.0, 34):
            scene = observe([(1, ahead, 15.0), (1, behind, 28.0)], lane=1, speed=22.0)
            least, most = bounds(small_table, scene, 0.0)
            if least > most:
                value = car_values(small_table, scene).value
                found = held(shield, small_table, scene, 0.0, 0.0)
                expected = most if value[0] <= value[1] else least  # who is ahead asks for less, who is behind for more
                assert found == pytest.approx(expected, abs=1e-6)
                decided.add(expected == most)
    assert decided == {True, False}


def test_with_nobody_near_what_is_asked_is_kept(shield, small_table, observe):
    assert held(shield, small_table, observe([], lane=1, speed=20.0), 0.01, 3.7) == 3.7


def made(table, **options) -> MppiPlanner:
    given = MppiPlanner.Options(**options)
    return MppiPlanner(PlannerSettings(), given, RobotSettings(), DriverSettings(), StraightRoad(4), table)


def test_on_an_empty_road_a_shield_changes_no_plan(small_table, observe):
    scene, target = observe([], lane=1, speed=22.0), Target(1, 22.0)
    assert made(small_table, shielded=True).plan(scene, target) == made(small_table).plan(scene, target)


def test_behind_a_slow_car_a_shielded_plan_brakes_earlier(small_table, observe):
    wall = [(1, 34.0, 14.0), (0, 4.0, 22.0), (2, 4.0, 22.0), (0, -8.0, 22.0), (2, -8.0, 22.0)]
    scene, speeds = observe(wall, lane=1, speed=22.0), []
    for shielded in (True, False):
        planner, target = made(small_table, shielded=shielded), Target(1, 22.0)
        for time in range(3):
            target = planner.plan(replace(scene, time=0.001 * time), target).target
        speeds.append(target.speed)
    assert speeds[0] < speeds[1] - 0.3


def judged(table, shield) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return ten samples behind a slow car as they were judged: their controls, and what `drive` and `worth` say."""
    random = np.random.default_rng(2)
    asked = np.stack([random.uniform(-0.3, 0.3, (10, 8)), random.uniform(-8.0, 6.0, (10, 8))], axis=2)
    settings, speeds = PlannerSettings(), np.full((9, 1), 14.0)
    others = Others(26.0 + 14.0 * STEP * np.arange(9.0)[:, None], 4.0 + 0.0 * speeds, speeds, *SIZES)
    outlook = Outlook(others, reward_model(settings, StraightRoad(4)), Costs(0.002, 0.001, 0.003), ROBOT, STEP, 0.98)
    state, controls = np.array([0.0, 4.0, 0.0, 22.0]), asked.copy()
    worths, ends = np.empty(10), np.empty(10, np.int64)
    judge(state, controls, outlook, table.stack, shield, worths, ends)
    path, plain = np.empty((9, 4)), np.empty(10)
    for sample, each in enumerate(asked):
        drive(state, each, path, ROBOT, STEP)
        plain[sample] = worth(path, each, outlook, table.stack)
    return controls - asked, worths - plain, ends


def test_without_a_shield_samples_are_driven_and_judged_as_they_were_drawn(shield, small_table):
    changes, differences, ends = judged(small_table, NO_SHIELD)
    assert np.abs(changes).max() < 1e-9
    assert np.abs(differences).max() < 1e-9
    assert set(ends) <= {0, 1, 2}
    changes, differences, _ = judged(small_table, shield)  # which changes some of the same samples
    assert np.abs(changes[:, :, 1]).max() > 1.0
    assert np.abs(differences).max() > 0.01
