import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hj_cosim.control.tracking import tracking_control
from hj_cosim.planning.catalogue import make_planner
from hj_cosim.planning.contract import IDLE, LEFT
from hj_cosim.planning.optimistic.crash import instants_within
from hj_cosim.planning.optimistic.prediction import approach
from hj_cosim.scene.observation import Target
from hj_cosim.scene.road import StraightRoad
from hj_cosim.settings import DriverSettings, PlannerSettings, RobotSettings, TrackingSettings
from hj_cosim.vehicles.bicycle import bicycle_step, steering_for


@pytest.mark.parametrize("kind", ["op", "hjop"])
def test_the_predicted_path_is_what_moving_all_cars_step_by_step_gives(
    small_table, draw_scene, reference, scene_seeds, kind
):
    planner_settings = PlannerSettings(kind=kind, expansions=60)
    planner = make_planner(planner_settings, RobotSettings(), DriverSettings(), StraightRoad(4), small_table)
    for seed, cars in scene_seeds:
        scene = draw_scene(seed, cars)
        target = Target(round(scene.robot[1] / 4.0), float(scene.robot[3]))
        statistics = planner.plan(scene, target).statistics
        path = statistics.trajectory
        model = reference(planner_settings, DriverSettings(), StraightRoad(4), small_table)
        state, value = model.start(scene, target), 0.0
        order = np.argsort(scene.x, kind="stable")
        for second, action in enumerate(path.action):
            assert action in model.actions(state)
            state = model.advance(state, action)
            value += planner_settings.discount**second * model.reward(state)
            np.testing.assert_allclose(path.x[second + 1], state.x[order], atol=2e-3)
            np.testing.assert_allclose(path.y[second + 1], state.y[order], atol=2e-3)
            np.testing.assert_allclose(path.speed[second + 1], state.speed[order], atol=2e-3)
            np.testing.assert_allclose(path.robot[second + 1], state.robot, atol=2e-3)
        assert statistics.best_value == pytest.approx(value, abs=1e-3)


def test_a_car_behind_brakes_for_a_robot_that_cuts_in_and_one_behind_that_one_for_it(small_table, observe):
    scene = observe([(2, -12.0, 24.0), (2, -60.0, 24.0), (0, -12.0, 24.0), (1, -60.0, 24.0)])
    # Without a reward for lanes the robot keeps to the lane that it is told, and only speeds up.
    planner = make_planner(
        PlannerSettings(kind="op", expansions=1, lane_weight=0.0, action_time=2.0),
        RobotSettings(),
        DriverSettings(),
        StraightRoad(3),
        small_table,
    )
    cuts_in = planner.plan(scene, Target(2, 24.0)).statistics.trajectory
    stays = planner.plan(scene, Target(1, 24.0)).statistics.trajectory
    speed_cut_in = dict(zip(cuts_in.vehicle, cuts_in.speed[1], strict=True))
    speed_stays = dict(zip(stays.vehicle, stays.speed[1], strict=True))
    assert speed_cut_in[0] < speed_stays[0] - 0.5
    assert speed_cut_in[1] < speed_stays[1]
    assert speed_cut_in[2] == speed_stays[2]


@given(st.floats(-20, 20), st.floats(-20, 20), st.floats(-6, 6), st.floats(-6, 6), st.floats(0.5, 6), st.floats(0.5, 3))
@settings(max_examples=100, deadline=None)
def test_touching_between_two_instants_is_what_many_samples_between_them_see(
    along, next_along, across, next_across, reach, breadth
):
    share = np.linspace(0.0, 1.0, 401)
    rounding = 1e-9
    seen = (np.abs(along + (next_along - along) * share) < reach - rounding) & (
        np.abs(across + (next_across - across) * share) < breadth - rounding
    )
    enter, leave = instants_within(along, next_along, reach)
    enter_across, leave_across = instants_within(across, next_across, breadth)
    overlap = min(leave, leave_across) - max(enter, enter_across)
    if seen.any():
        assert overlap > 0.0
    else:
        assert overlap < 1e-2  # shorter than the samples' distance, or none


@given(st.floats(-10, 10), st.floats(-10, 10), st.floats(0, 5))
def test_approach_gets_no_farther_than_it_may_and_never_beyond(value, target, distance):
    moved = approach(value, target, distance)
    assert abs(moved - value) <= distance + 1e-12
    assert abs(target - moved) == pytest.approx(max(abs(target - value) - distance, 0.0))


def test_a_crash_between_two_seconds_is_found(small_table, observe):
    # The robot passes right through the slow car: 14 m ahead at first, 6 m behind a second later.
    scene = observe([(0, 14.0, 0.0)], lane=0, speed=20.0)
    planner = make_planner(
        PlannerSettings(kind="op", expansions=100), RobotSettings(), DriverSettings(), StraightRoad(1), small_table
    )
    assert planner.plan(scene, Target(0, 20.0)).statistics.depth == 1


def test_the_planned_speed_is_approached_as_the_tracking_controller_does(small_table, observe):
    planner = make_planner(
        PlannerSettings(kind="op", expansions=1, speed_high=100.0), RobotSettings(), DriverSettings(), StraightRoad(1),
        small_table,
    )  # fmt: skip
    path = planner.plan(observe([], lane=0), Target(0, 27.0)).statistics.trajectory
    planned = path.planned_speed[1]
    time = np.linspace(0.0, 1.0, 100_001)
    speed = planned + (24.0 - planned) * np.exp(-time / 0.6)
    assert path.robot[1, 3] == pytest.approx(speed[-1], abs=1e-5)
    assert path.robot[1, 0] - 1000.0 == pytest.approx(np.trapezoid(speed, time), abs=1e-4)
    assert not math.isnan(path.robot[1, 2])


@pytest.mark.parametrize("heading_max", [0.25, 0.4])
@pytest.mark.parametrize("speed", [0.0, 2.0, 5.0, 10.0, 24.0])
def test_a_robot_gets_across_as_the_tracking_controller_takes_it(small_table, observe, speed, heading_max):
    """A slow robot cannot slide sideways: as far as the bicycle that the controller steers, but for 1.4 m."""
    settings, road, robot = PlannerSettings(heading_max=heading_max), StraightRoad(4), RobotSettings()
    tracking, step = TrackingSettings(heading_max=heading_max), 0.02
    scene = observe([], lane=1, speed=speed)
    planner = make_planner(settings, robot, DriverSettings(), road, small_table)
    path = planner.foresee(scene, Target(1, speed), [LEFT, IDLE])
    assert (np.abs(path.robot[:, 2]) <= heading_max).all()
    state, target = scene.robot, Target(2, speed)
    for second in (1, 2):
        for _ in range(round(1.0 / step)):
            control = tracking_control(state, target, road, tracking, robot)
            steering = steering_for(control.omega, float(state[3]), robot.wheelbase)
            state = bicycle_step(state, steering, control.acceleration, robot.wheelbase, robot.speed_max, step)
        assert path.robot[second, 1] == pytest.approx(state[1], abs=1.4)
        assert path.robot[second, 1] - 4.0 <= speed * math.sin(heading_max) * second + 1e-5
