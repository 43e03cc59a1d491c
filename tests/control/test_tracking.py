import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hj_cosim.control.tracking import eased, tracking_control
from hj_cosim.scene.observation import Control, Target
from hj_cosim.scene.road import StraightRoad
from hj_cosim.settings import RobotSettings, TrackingSettings
from hj_cosim.vehicles.bicycle import bicycle_step, steering_for

ROAD, ROBOT, GAINS = StraightRoad(lane_count=4), RobotSettings(), TrackingSettings()


def control(state, lane=1, speed=24.0):
    return tracking_control(np.array(state), Target(lane, speed), ROAD, GAINS, ROBOT)


def test_it_is_the_paper_s_law_where_no_limit_binds():
    v, off_centre, heading = 25.0, 0.1, 0.01
    steering = math.atan(-ROBOT.wheelbase * 5.0 / v * (heading + math.asin(2.0 * off_centre / v)))
    wanted = control([0.0, 4.0 + off_centre, heading, v], speed=24.5)
    assert steering_for(wanted.omega, v, ROBOT.wheelbase) == pytest.approx(steering, abs=1e-12)
    assert wanted.acceleration == pytest.approx(1.67 * (24.5 - v))


def test_it_is_at_rest_in_the_middle_of_the_lane_at_the_planned_speed():
    wanted = control([100.0, 8.0, 0.0, 20.0], lane=2, speed=20.0)
    assert (wanted.omega, wanted.acceleration) == (0.0, 0.0)


@given(
    lateral=st.floats(-20.0, 30.0), heading=st.floats(-7.0, 7.0), speed=st.floats(0.0, 40.0), wanted=st.floats(0, 60)
)
def test_it_is_finite_and_within_the_limits_for_any_state_standing_included(lateral, heading, speed, wanted):
    chosen = control([0.0, lateral, heading, speed], speed=wanted)
    assert abs(chosen.omega) <= ROBOT.omega_max
    assert ROBOT.acceleration_min <= chosen.acceleration <= ROBOT.acceleration_max


@given(lateral=st.floats(-8.0, 8.0), heading=st.floats(-0.4, 0.4), speed=st.floats(0.0, 40.0))
def test_left_and_right_are_mirror_images(lateral, heading, speed):
    left = control([0.0, 4.0 + lateral, heading, speed])
    right = control([0.0, 4.0 - lateral, -heading, speed])
    assert left.omega == pytest.approx(-right.omega, abs=1e-12)


@pytest.mark.parametrize("speed", [2.0, 10.0, 24.0, 35.0])
def test_a_lane_change_ends_in_the_lane_without_leaving_the_value_table_s_headings(speed):
    state = np.array([0.0, 4.0, 0.0, speed])
    headings, laterals = [], []
    for _ in range(1000):
        wanted = control(state, lane=2, speed=speed)
        steering = steering_for(wanted.omega, state[3], ROBOT.wheelbase)
        state = bicycle_step(state, steering, wanted.acceleration, ROBOT.wheelbase, ROBOT.speed_max, 0.02)
        headings.append(abs(state[2]))
        laterals.append(state[1])
    assert max(headings) <= 0.4 + 1e-9
    assert laterals[-1] == pytest.approx(8.0, abs=0.01)
    assert state[2] == pytest.approx(0.0, abs=1e-3)
    assert max(laterals) < 8.0 + 1.0  # stays within its lane: half a lane less half a car


@pytest.mark.parametrize("speed", [10.0, 24.0, 38.0])
def test_who_may_turn_little_approaches_its_lane_no_faster_than_it_can_straighten_up(speed):
    # With K_1 = 2 alone a robot that may turn with 2.4 m/s2 went up to 0.8 m beyond its lane, and off the road.
    settings = TrackingSettings(lateral_acceleration_max=2.4, heading_max=0.25)
    state, laterals = np.array([0.0, 4.0, 0.0, speed]), []
    for _ in range(500):
        wanted = tracking_control(state, Target(2, speed), ROAD, settings, ROBOT)
        steering = steering_for(wanted.omega, state[3], ROBOT.wheelbase)
        state = bicycle_step(state, steering, wanted.acceleration, ROBOT.wheelbase, ROBOT.speed_max, 0.02)
        laterals.append(state[1])
    assert max(laterals) < 8.0 + 0.15
    assert laterals[300] == pytest.approx(8.0, abs=0.2)  # and is there in 6 s


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_what_is_not_finite_stays_so_for_the_filter_to_count(bad):
    assert not math.isfinite(control([0.0, 4.0, 0.0, 24.0], speed=bad).acceleration)
    assert not math.isfinite(control([0.0, 4.0, bad, 24.0]).omega)


def test_an_eased_acceleration_changes_no_faster_than_the_jerk_allows():
    before = Control(0.1, 1.0)
    assert eased(Control(0.2, 4.0), before, 8.0, 0.02) == Control(0.2, pytest.approx(1.16))
    assert eased(Control(0.2, -6.0), before, 8.0, 0.02) == Control(0.2, pytest.approx(0.84))
    assert eased(Control(0.2, 1.1), before, 8.0, 0.02) == Control(0.2, 1.1)


def test_it_turns_no_harder_than_asked_or_than_tyres_hold():
    for settings, robot, most in (
        (TrackingSettings(lateral_acceleration_max=2.0), RobotSettings(), 2.0),
        (TrackingSettings(), RobotSettings(lateral_acceleration_max=3.0), 3.0),
    ):
        control = tracking_control(np.array([0.0, 4.0, 0.0, 30.0]), Target(3, 30.0), ROAD, settings, robot)
        assert abs(control.omega) * 30.0 == pytest.approx(most)
