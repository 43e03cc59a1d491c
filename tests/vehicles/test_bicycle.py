"""The bicycle's exact step against numerical integration of the paper's equations of motion."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from hj_cosim.vehicles.bicycle import SLOWEST_FULL_TURN, bicycle_step, steering_for

WHEELBASE, SPEED_MAX = 5.0, 40.0


def derivative(_, state, steering, acceleration):
    _, _, heading, speed = state
    return [
        speed * math.cos(heading),
        speed * math.sin(heading),
        speed * math.tan(steering) / WHEELBASE,
        acceleration,
    ]


@pytest.mark.parametrize(
    ("state", "steering", "acceleration", "step"),
    [
        ([0.0, 0.0, 0.0, 24.0], 0.05, 3.0, 0.02),
        ([5.0, 4.0, 0.3, 20.0], -0.06, -6.0, 0.5),
        ([0.0, 8.0, -0.2, 3.0], 0.5, 4.0, 1.0),
        ([0.0, 0.0, 0.1, 30.0], 1e-7, 0.0, 1.0),
        ([0.0, 0.0, 0.1, 30.0], 0.0, -2.0, 1.0),
    ],
)
def test_step_is_the_integral_of_the_equations_of_motion(state, steering, acceleration, step):
    reached = bicycle_step(np.array(state), steering, acceleration, WHEELBASE, SPEED_MAX, step)
    integrated = solve_ivp(derivative, (0.0, step), state, args=(steering, acceleration), rtol=1e-11, atol=1e-12).y[
        :, -1
    ]
    np.testing.assert_allclose(reached, integrated, atol=1e-8)


def test_a_braking_car_stops_and_stays_where_it_stopped():
    state = np.array([0.0, 0.0, 0.0, 1.0])
    stopped = bicycle_step(state, 0.0, -4.0, WHEELBASE, SPEED_MAX, 1.0)
    np.testing.assert_allclose(stopped, [1.0 / 8.0, 0.0, 0.0, 0.0], atol=1e-12)
    np.testing.assert_array_equal(bicycle_step(stopped, 0.3, -4.0, WHEELBASE, SPEED_MAX, 1.0), stopped)


def test_speed_ends_at_the_top_speed():
    state = np.array([0.0, 0.0, 0.0, 39.0])
    reached = bicycle_step(state, 0.0, 4.0, WHEELBASE, SPEED_MAX, 1.0)
    assert reached[3] == SPEED_MAX
    assert reached[0] == pytest.approx(39.5 * 0.25 + 40.0 * 0.75)


@given(omega=st.floats(-0.3, 0.3), speed=st.floats(SLOWEST_FULL_TURN, 40.0))
def test_steering_turns_at_the_yaw_rate_asked_for(omega, speed):
    steering = steering_for(omega, speed, WHEELBASE)
    reached = bicycle_step(np.array([0.0, 0.0, 0.0, speed]), steering, 0.0, WHEELBASE, SPEED_MAX, 0.02)
    assert reached[2] == pytest.approx(omega * 0.02, abs=1e-12)


@given(omega=st.floats(-0.3, 0.3), speed=st.floats(0.0, 0.5), acceleration=st.floats(-6.0, 4.0))
def test_a_car_that_hardly_moves_does_not_spin_when_it_drives_off(omega, speed, acceleration):
    steering = steering_for(omega, speed, WHEELBASE)
    reached = bicycle_step(np.array([0.0, 0.0, 0.0, speed]), steering, acceleration, WHEELBASE, SPEED_MAX, 0.02)
    assert abs(reached[2]) <= abs(omega) * 0.02 * 1.08 + 1e-12


@pytest.mark.parametrize(("speed", "kept"), [(45.0, SPEED_MAX), (-3.0, 0.0)])
@pytest.mark.parametrize("acceleration", [1e-300, -1e-300, 1e-17, 0.0])
def test_a_speed_beyond_its_limits_counts_as_the_limit(speed, kept, acceleration):
    reached = bicycle_step(np.array([0.0, 0.0, 0.0, speed]), 0.0, acceleration, WHEELBASE, SPEED_MAX, 0.02)
    np.testing.assert_allclose(reached, [0.02 * kept, 0.0, 0.0, kept], atol=1e-12)


def test_a_standing_car_steers_straight():
    assert steering_for(0.3, 0.0, WHEELBASE) == 0.0


@given(heading=st.floats(-3.0, 3.0), steering=st.floats(-0.3, 0.3), speed=st.floats(0.0, 40.0))
def test_two_half_steps_are_one_step(heading, steering, speed):
    state = np.array([1.0, 2.0, heading, speed])
    once = bicycle_step(state, steering, 2.0, WHEELBASE, SPEED_MAX, 0.2)
    half = bicycle_step(state, steering, 2.0, WHEELBASE, SPEED_MAX, 0.1)
    twice = bicycle_step(half, steering, 2.0, WHEELBASE, SPEED_MAX, 0.1)
    np.testing.assert_allclose(twice, once, atol=1e-9)
