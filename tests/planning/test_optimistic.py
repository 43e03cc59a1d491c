from dataclasses import replace

import numpy as np
import pytest

from hj_cosim.planning.catalogue import make_planner
from hj_cosim.planning.contract import IDLE, LEFT, RIGHT, Plan, Planner
from hj_cosim.planning.idle import IdlePlanner
from hj_cosim.planning.optimistic.planner import OptimisticPlanner, OptimisticPlannerWithoutValue, occupied_lanes
from hj_cosim.scene.observation import Target
from hj_cosim.scene.road import StraightRoad
from hj_cosim.settings import DriverSettings, PlannerSettings, RobotSettings
from hj_cosim.traffic.fake import FakeWorld
from hj_cosim.traffic.sources.scenarios import load_scenario

PAPER = {"expansions": 40, "value_clip": 5.0}


def make(table, road=None, **settings):
    return make_planner(PlannerSettings(**settings), RobotSettings(), DriverSettings(), road or StraightRoad(4), table)


def worst_value(table, path, second, clip=np.inf):
    """Return min_j V, m, at a second of a predicted path, clipped to ±`clip`."""
    x, y, heading, speed = path.robot[second]
    count = len(path.vehicle)
    columns = (
        x - path.x[second], y - path.y[second], np.full(count, heading), np.full(count, speed), path.speed[second]
    )  # fmt: skip
    return float(np.clip(table.value(np.column_stack(columns)).min(initial=np.inf), -clip, clip))


def plan_scene(name, table, **settings):
    scenario = load_scenario(name)
    with FakeWorld(scenario.cars, (1000.0, 4.0 * scenario.robot.lane, 0.0, scenario.robot.speed)) as world:
        planner = make_planner(PlannerSettings(**settings), RobotSettings(), scenario.drivers, world.road, table)
        return planner.plan(world.observe(), Target(scenario.robot.lane, scenario.robot.speed))


@pytest.mark.parametrize("settings", [{}, PAPER], ids=["default", "paper"])
def test_in_the_papers_squeeze_op_goes_left_and_hjop_ends_no_less_safe(small_table, settings):
    op = plan_scene("squeeze", small_table, kind="op", **settings)
    hjop = plan_scene("squeeze", small_table, kind="hjop", **settings)
    assert op.action == LEFT
    value_of_op = worst_value(small_table, op.statistics.trajectory, 2)
    value_of_hjop = worst_value(small_table, hjop.statistics.trajectory, 2)
    assert value_of_hjop > value_of_op


@pytest.mark.parametrize("settings", [{}, PAPER], ids=["default", "paper"])
def test_op_lets_itself_be_boxed_in_and_hjop_does_not(small_table, settings):
    op = plan_scene("boxed_in", small_table, kind="op", **settings)
    hjop = plan_scene("boxed_in", small_table, kind="hjop", **settings)
    assert op.action == LEFT
    assert hjop.action != LEFT
    for second in (1, 2):
        value_of_op = worst_value(small_table, op.statistics.trajectory, second)
        value_of_hjop = worst_value(small_table, hjop.statistics.trajectory, second)
        assert value_of_hjop > value_of_op


def test_where_the_planners_choose_differently_hjop_is_safer_two_seconds_later(small_table, draw_scene):
    settings = {kind: PlannerSettings(kind=kind, expansions=100) for kind in ("op", "hjop")}
    planners = {
        kind: make_planner(each, RobotSettings(), DriverSettings(), StraightRoad(4), small_table)
        for kind, each in settings.items()
    }
    differing, safer, seed = 0, 0, 0
    while differing < 100:
        scene = draw_scene(seed, 16)
        seed += 1
        target = Target(round(scene.robot[1] / 4.0), float(scene.robot[3]))
        values = {}
        for kind, planner in planners.items():
            path = planner.plan(scene, target).statistics.trajectory
            # As far as the reward tells them apart: all that is beyond the clip is as safe, or as unsafe.
            values[kind] = worst_value(small_table, path, min(2, len(path.action)), settings[kind].value_clip)
        differing += values["hjop"] != values["op"]
        safer += values["hjop"] > values["op"]
    assert safer >= 95


def test_op_does_not_depend_on_the_table(small_table, draw_scene):
    planner = make(small_table, kind="op", expansions=100)
    weightless = make(small_table, kind="hjop", gamma_r=1.0, value_clip=1.0, expansions=100)
    for seed in range(5):
        scene = draw_scene(seed, 8)
        first, second = planner.plan(scene, Target(1, 24.0)), weightless.plan(scene, Target(1, 24.0))
        assert first.action == second.action
        assert first.statistics.best_value == second.statistics.best_value


def test_the_same_scene_is_planned_for_in_the_same_way(small_table, draw_scene):
    kept = make(small_table, expansions=200)
    for seed in (0, 1, 0):
        scene = draw_scene(seed, 6 + 4 * seed)
        first = kept.plan(scene, Target(1, 24.0))
        anew = make(small_table, expansions=200).plan(scene, Target(1, 24.0))
        assert first.target == anew.target
        np.testing.assert_array_equal(first.statistics.trajectory.x, anew.statistics.trajectory.x)


def test_the_order_of_the_cars_does_not_matter(small_table, observe):
    cars = [(0, 20.0, 22.0), (2, -15.0, 24.0), (1, 40.0, 21.0), (3, 5.0, 23.0)]
    plans = [make(small_table, expansions=200).plan(observe(order), Target(1, 24.0)) for order in (cars, cars[::-1])]
    assert plans[0].target == plans[1].target
    assert plans[0].statistics.best_value == plans[1].statistics.best_value


def test_cars_beyond_the_sensing_range_do_not_enter_the_tree(small_table, observe):
    near, far = (1, 60.0, 22.0), (1, 90.0, 22.0)
    planner = make(small_table, sensing_range=80.0, expansions=50)
    plan = planner.plan(observe([far, near]), Target(1, 24.0))
    assert plan.statistics.trajectory.vehicle.tolist() == [1]
    assert plan.target == planner.plan(observe([near]), Target(1, 24.0)).target


@pytest.mark.parametrize(("kept", "planned"), [(24.0, 24.0), (40.0, 28.0), (5.0, 20.0)])
def test_the_planned_speed_is_carried_over_within_the_window_around_the_robots(small_table, observe, kept, planned):
    plan = make(small_table, expansions=10).plan(observe([], speed=24.0), Target(1, kept))
    assert plan.statistics.trajectory.planned_speed[0] == planned


def test_a_car_that_overlaps_the_robot_already_is_left_out(small_table, observe):
    scene = observe([(1, 3.0, 24.0), (1, 60.0, 24.0)])
    statistics = make(small_table, expansions=50).plan(scene, Target(1, 24.0)).statistics
    assert statistics.trajectory.vehicle.tolist() == [1]
    assert statistics.expansions == 50


def test_the_trajectory_is_what_the_plan_leads_to(small_table, draw_scene):
    scene = draw_scene(3, 8)
    plan = make(small_table, expansions=200).plan(scene, Target(1, 24.0))
    path = plan.statistics.trajectory
    depth = len(path.action)
    assert path.action[0] == plan.action
    assert (path.planned_lane[1], path.planned_speed[1]) == (plan.target.lane, plan.target.speed)
    assert path.time.tolist() == list(range(depth + 1))
    assert path.robot.shape == (depth + 1, 4)
    assert path.x.shape == path.y.shape == path.speed.shape == (depth + 1, 8)
    order = np.argsort(scene.x)
    np.testing.assert_array_equal(path.vehicle, scene.vehicle[order])
    np.testing.assert_allclose(path.x[0], scene.x[order], atol=1e-4)
    np.testing.assert_allclose(path.robot[0], scene.robot, atol=1e-4)


def test_a_changing_car_is_in_both_lanes_until_its_body_has_left_the_first(observe):
    scene = observe([(1, 20.0, 22.0), (1, 40.0, 22.0), (1, 60.0, 22.0), (1, 80.0, 22.0)])
    scene.y[:] = [4.0, 5.0, 6.5, 7.2]
    scene.lane[:] = [1, 1, 2, 2]
    target = np.full(4, 2)
    lane, second_lane = occupied_lanes(replace(scene, target_lane=target), np.arange(4), StraightRoad(4))
    assert lane.tolist() == [2, 2, 2, 2]
    assert second_lane.tolist() == [1, 1, 1, 2]


def test_a_robot_beside_the_road_is_planned_for_all_the_same(small_table, observe):
    scene = observe([(0, 30.0, 22.0)], lane=0)
    scene.robot[1] = -5.0
    assert make(small_table, expansions=50).plan(scene, Target(0, 24.0)).statistics.expansions == 50


def test_make_planner_makes_what_the_settings_name(small_table, observe):
    arguments = (RobotSettings(), DriverSettings(), StraightRoad(4), small_table)
    idle = make_planner(PlannerSettings(kind="idle"), *arguments)
    assert isinstance(idle, IdlePlanner)
    assert idle.plan(observe([]), Target(2, 21.0)) == Plan(IDLE, Target(2, 21.0))
    assert isinstance(make_planner(PlannerSettings(kind="op"), *arguments), OptimisticPlannerWithoutValue)
    assert type(make_planner(PlannerSettings(kind="hjop"), *arguments)) is OptimisticPlanner


def test_op_plans_as_hjop_with_all_weight_on_the_driving_reward(small_table, draw_scene):
    for seed in range(5):
        scene = draw_scene(seed, 16)
        target = Target(round(scene.robot[1] / 4.0), float(scene.robot[3]))
        op = make(small_table, kind="op", gamma_r=0.5, expansions=50).plan(scene, target)
        all_on_driving = make(small_table, kind="hjop", gamma_r=1.0, expansions=50).plan(scene, target)
        assert (op.action, op.target) == (all_on_driving.action, all_on_driving.target)
        assert op.statistics.best_value == all_on_driving.statistics.best_value


def test_a_planner_of_a_users_own_is_one_class_with_one_method(observe):
    class KeepRight:
        def plan(self, observation, previous):
            return Plan(action=RIGHT, target=Target(lane=max(previous.lane - 1, 0), speed=previous.speed))

    planner: Planner = KeepRight()
    assert planner.plan(observe([]), Target(1, 24.0)).target == Target(0, 24.0)
