import math
from dataclasses import replace

import numpy as np
import pytest

from hj_cosim.planning.catalogue import make_planner
from hj_cosim.planning.contract import IDLE, LEFT
from hj_cosim.planning.optimistic.planner import OptimisticPlanner
from hj_cosim.planning.optimistic.politeness import braking_imposed
from hj_cosim.planning.optimistic.prediction import REACTING, drive_cars, drive_robot
from hj_cosim.planning.optimistic.tree_search import open_node
from hj_cosim.scene.observation import Target
from hj_cosim.scene.road import StraightRoad
from hj_cosim.settings import DriverSettings, PlannerSettings, RobotSettings
from hj_cosim.vehicles.idm import idm_acceleration, mean_driver


def planner_of(table, polite_braking=9.0, **settings):
    settings = PlannerSettings(kind="op", polite_braking=polite_braking, **settings)
    return make_planner(settings, RobotSettings(), DriverSettings(), StraightRoad(4), table)


def imposed(table, scene, lane, speed=24.0):
    """Return what planning for a lane asks of those behind, by the planner's own prediction."""
    planner = planner_of(table)
    assert isinstance(planner, OptimisticPlanner)
    cars, bodies = planner._enter(scene)
    planner._plant_root(planner._tree, scene, cars, Target(1, speed))
    robot = open_node(planner._tree, 0, planner._scene, bodies, planner._prediction)
    occupied, _ = drive_robot(planner._scene, robot, lane, speed, planner._prediction)
    drive_cars(planner._scene, robot, occupied, REACTING, planner._prediction)
    return braking_imposed(planner._scene, robot, occupied, planner._prediction)


def chosen(table, scene, polite_braking):
    return planner_of(table, polite_braking).plan(scene, Target(1, float(scene.robot[3]))).action


def test_nobody_cuts_in_close_before_a_driver_whom_the_paper_s_planner_does_not_mind(small_table, observe):
    close = observe([(2, -12.0, 24.0)])  # 7 m between bumpers, at equal speeds
    assert chosen(small_table, close, 9.0) == LEFT
    assert chosen(small_table, close, 3.0) != LEFT
    far = observe([(2, -60.0, 24.0)])
    assert chosen(small_table, far, 3.0) == LEFT


def test_what_is_polite_is_a_setting(small_table, observe):
    scene = observe([(2, -40.0, 24.0)])
    asked = imposed(small_table, scene, 2)
    assert 1.0 < asked < 9.0
    assert chosen(small_table, scene, asked + 0.01) == LEFT
    assert chosen(small_table, scene, asked - 0.01) != LEFT


def test_who_follows_in_the_lane_entered_brakes_as_idm_says_at_the_hardest_instant(small_table, observe):
    # The robot at 24 m/s, constant; a follower at 26 m/s that drives on until the robot is noticed, at 0.5 s.
    driver = mean_driver(DriverSettings())
    x, speed, hardest = -45.0, 26.0, 0.0
    for now in range(1, 5):
        seen = now - 1 >= 2 + 1  # it reacts in the step after the instant at which the robot is 1 m across
        acceleration = idm_acceleration(speed, 24.0 * 0.25 * (now - 1) - x - 5.0, 24.0, driver) if seen else 0.0
        then = speed + acceleration * 0.25
        x, speed = x + 0.5 * (speed + then) * 0.25, then
        hardest = max(hardest, -idm_acceleration(speed, 24.0 * 0.25 * now - x - 5.0, 24.0, driver))
    assert imposed(small_table, observe([(2, -45.0, 26.0)]), 2) == pytest.approx(hardest, abs=1e-3)
    assert hardest > 3.0


def test_whoever_is_overtaken_meanwhile_is_behind_too_and_who_stays_ahead_is_not(small_table, observe):
    assert imposed(small_table, observe([(2, 2.0, 15.0)]), 2) == 9.0  # alongside at the first instant
    alongside_at_first_alone = observe([(2, -3.0, 2.0)])  # 3.5 m between bumpers at 0.25 s, 9 m at 0.5 s
    assert imposed(small_table, alongside_at_first_alone, 2) == pytest.approx(
        -idm_acceleration(2.0, 24.0 * 0.25 + 3.0 - 2.0 * 0.25 - 5.0, 24.0, mean_driver(DriverSettings())), abs=1e-3
    )
    assert imposed(small_table, observe([(2, 30.0, 15.0)]), 2) == 0.0


@pytest.mark.parametrize(
    "cars",
    [
        [],
        [(0, -12.0, 24.0)],
        [(1, -9.0, 22.0), (2, 20.0, 10.0)],
        [(3, -12.0, 24.0)],
        [(0, 2.0, 15.0)],
        [(2, -12.0, 24.0)],
    ],
    ids=["nobody", "other side", "own lane", "two lanes away", "overtaken on the other side", "but the robot stays"],
)
def test_nothing_is_imposed_on_who_is_not_behind_in_a_lane_that_is_entered(small_table, observe, cars):
    lane = 1 if cars == [(2, -12.0, 24.0)] else 2
    assert imposed(small_table, observe(cars), lane) == 0.0


def test_of_two_behind_in_the_lane_only_the_nearer_one_counts(small_table, observe):
    alone = imposed(small_table, observe([(2, -30.0, 24.0)]), 2)
    faster_behind = imposed(small_table, observe([(2, -30.0, 24.0), (2, -40.0, 35.0)]), 2)
    assert faster_behind == pytest.approx(alone, abs=1e-6)
    assert 0.0 < alone < 9.0


def test_a_robot_that_is_boxed_in_politely_still_has_a_plan(small_table, observe):
    everywhere = [(lane, -11.0, 24.0) for lane in (0, 2)] + [(1, -11.0, 24.0), (1, 11.0, 24.0)]
    plan = planner_of(small_table, 0.0, lane_weight=5.0).plan(observe(everywhere), Target(1, 24.0))
    assert plan.action in (IDLE, 1, 2)
    assert math.isfinite(plan.statistics.best_value)
    assert np.isneginf(plan.statistics.action_values[LEFT])


def test_a_change_that_is_under_way_may_be_gone_on_with(small_table, observe):
    scene = observe([(2, -12.0, 24.0)])
    under_way = replace(scene, robot=scene.robot + np.array([0.0, 0.6, 0.02, 0.0]))
    plan = planner_of(small_table, 3.0).plan(under_way, Target(2, 24.0))
    assert np.isfinite(plan.statistics.action_values[IDLE])
