"""The robot on a bend, against the equations of the road frame integrated in small steps beside it."""

import math

import numpy as np
import pytest
from bent_roads import WIDTH, circle

from hj_cosim.control.tracking import tracking_control
from hj_cosim.cosim.configuration import resolve_config
from hj_cosim.cosim.motion import in_existing_lane, moved, require_bends, yaw_rate
from hj_cosim.errors import NetworkError
from hj_cosim.locations import scenarios_folder
from hj_cosim.scene.observation import Target
from hj_cosim.scene.road import StraightRoad
from hj_cosim.settings import NetworkSettings, RobotSettings, TrackingSettings
from hj_cosim.traffic.route import read_network
from hj_cosim.vehicles.bicycle import bicycle_step, steering_for


@pytest.mark.parametrize("radius", [400.0, -400.0])
def test_the_robot_moves_as_the_equations_of_the_road_frame_say(radius):
    """ds/dt = v cosθ/(1 − κ d), dd/dt = v sinθ, dθ/dt = ω, integrated in steps of 0.1 ms beside it."""
    road, robot = circle(radius), RobotSettings()
    state = np.array([100.0, 3.0, 0.04, 30.0])
    expected = state.copy()
    for step in range(100):
        omega = 0.05 * math.cos(0.1 * step)
        steering = steering_for(yaw_rate(state, omega, road), float(state[3]), robot.wheelbase)
        state = moved(state, steering, -0.5, road, robot, 0.02)
        for _ in range(200):
            _, d, theta, v = expected
            forward = v * math.cos(theta) / (1.0 - (d - 2 * WIDTH) / radius)
            expected = expected + 1e-4 * np.array([forward, v * math.sin(theta), omega, -0.5])
    # Within a step the wheels are held, the road's turning is not.
    assert np.all(np.abs(state - expected) < [1e-3, 1e-3, 1e-4, 1e-9])


def test_a_robot_told_not_to_turn_goes_round_the_bend_with_the_road():
    road, robot = circle(300.0), RobotSettings()
    state = np.array([50.0, 3.5, 0.0, 25.0])
    for _ in range(500):
        steering = steering_for(yaw_rate(state, 0.0, road), float(state[3]), robot.wheelbase)
        state = moved(state, steering, 0.0, road, robot, 0.02)
    assert state[1:3] == pytest.approx((3.5, 0.0), abs=1e-3)
    assert state[0] == pytest.approx(50.0 + 250.0 / (1.0 + 3.5 / 300.0), abs=0.01)


def test_on_a_straight_road_the_frame_changes_nothing():
    road, robot, state = StraightRoad(4, heading=0.7), RobotSettings(), np.array([10.0, 4.0, 0.02, 25.0])
    assert yaw_rate(state, 0.03, road) == 0.03
    expected = bicycle_step(state, 0.01, 1.0, robot.wheelbase, robot.speed_max, 0.02)
    assert moved(state, 0.01, 1.0, road, robot, 0.02).tolist() == expected.tolist()


def test_a_road_may_bend_as_far_as_the_table_leaves_room_and_no_further():
    road = circle(-400.0)
    inner = 400.0 - 7.0  # the centre of the lane that is nearest to the middle of the circle
    assert 1.0 / road.sharpest == pytest.approx(inner, rel=1e-3)
    fits = {"bend_rate_max": 40.0 / inner + 2e-3, "bend_acceleration_max": 1600.0 / inner + 0.02}
    require_bends(road, RobotSettings(**fits), "the road")
    for key, value in (("bend_rate_max", 40.0 / inner - 2e-3), ("bend_acceleration_max", 1600.0 / inner - 0.02)):
        with pytest.raises(NetworkError, match=r"the road has a bend of radius 393 m: at robot\.speed_max = 40 m/s"):
            require_bends(road, RobotSettings(**(fits | {key: value})), "the road")
    slower = RobotSettings(bend_rate_max=0.05, bend_acceleration_max=4.0, speed_max=0.05 * inner - 0.1)
    require_bends(road, slower, "the road")
    require_bends(StraightRoad(4), RobotSettings(bend_rate_max=0.0, bend_acceleration_max=0.0), "the road")


def test_a_drive_on_a_road_too_sharp_for_the_table_is_refused_before_it_begins():
    with pytest.raises(NetworkError, match=r"curves\.net\.xml has a bend of radius .* 0.08 rad/s .*another route"):
        resolve_config("curves", assignments=["robot.bend_rate_max=0.08"])


def test_a_target_in_a_lane_that_is_not_there_or_ends_in_a_moment_becomes_the_nearest_lane():
    parts = {"section_start": np.array([0.0, 600.0]), "first_lane": np.array([0, 1])}
    road = circle(1000.0, **parts, lanes_there=np.array([3, 1]), leading_off=np.array([0, 0]))
    for s, lane, followed in [(400.0, 0, 0), (520.0, 0, 1), (520.0, 2, 1), (520.0, 1, 1), (700.0, 0, 1), (700.0, 2, 1)]:
        state = np.array([s, lane * WIDTH, 0.0, 25.0])
        assert in_existing_lane(Target(lane, 22.0), state, road) == Target(followed, 22.0)


@pytest.mark.parametrize("lane", [0, 1, 2])
def test_the_robot_keeps_to_its_lane_at_30_m_s_through_the_bends_of_500_m(lane):
    path = scenarios_folder() / "curves.net.xml"
    road, _ = read_network(path, NetworkSettings(file=str(path), from_edge="e15", to_edge="e22"))
    robot, gains, target = RobotSettings(), TrackingSettings(), Target(lane, 30.0)
    state, farthest, sharpest = np.array([5.0, road.lane_centre(lane, 0.0), 0.0, 30.0]), 0.0, 0.0
    while state[0] < road.length - 10.0:
        wanted = tracking_control(state, target, road, gains, robot)
        steering = steering_for(yaw_rate(state, wanted.omega, road), float(state[3]), robot.wheelbase)
        state = moved(state, steering, wanted.acceleration, road, robot, 0.02)
        farthest = max(farthest, abs(state[1] - road.lane_centre(lane, state[0])))
        sharpest = max(sharpest, abs(road.curvature_at(float(state[0]))))
    assert sharpest == pytest.approx(1.0 / 500.0, rel=0.05)
    assert farthest < 0.05
