"""What the other car is assumed to do: the duties, one by one, and that everything in the game keeps to them."""

import math

import numpy as np
import pytest
from reference import hamiltonian_values

from hj_cosim.reachability.games.catalogue import find_game
from hj_cosim.reachability.games.highway.other_car import Disturbance, allowed, worst_heading_sine
from hj_cosim.reachability.games.highway.parameters import PARAMETERS
from hj_cosim.reachability.games.highway.rows import worst_drift
from hj_cosim.vehicles.rss import longitudinal_distance

WORST = Disturbance.of_game(PARAMETERS)
DUTIFUL = Disturbance.of_game({**PARAMETERS, "responsible": 1.0})
EVERYTHING = (-math.sin(0.1), math.sin(0.1), -6.0, 4.0)
UNLIMITED = np.tile(np.array([[-np.inf], [np.inf]], np.float32), (1, 5))


def kept_distance(rear: float, front: float) -> float:
    """The distance between bumpers that a dutiful car keeps: RSS's for 1 s, and 2 m."""
    return 2.0 + longitudinal_distance(rear, front, 1.0, 3.0, 6.0, 6.0)


def random_states(count: int) -> np.ndarray:
    draw = np.random.default_rng(3)
    low, high = [-60.0, -6.0, -0.3, 0.5, 0.5], [60.0, 6.0, 0.3, 39.0, 39.0]
    return draw.uniform(low, high, (count, 5))


def test_the_worst_car_does_anything_within_its_limits_anywhere() -> None:
    for p_x, p_y, theta, v_r, v_o in random_states(200):
        assert allowed(WORST, p_x, p_y, v_r * math.sin(theta), v_r, v_o) == pytest.approx(EVERYTHING)


@pytest.mark.parametrize(("rear", "front"), [(25.0, 25.0), (30.0, 22.0), (6.0, 5.0)])
def test_a_follower_brakes_once_the_distance_is_violated_and_is_free_far_behind(rear: float, front: float) -> None:
    distance = 5.0 + kept_distance(rear, front)
    too_near = allowed(DUTIFUL, distance - 0.1, 0.5, 0.0, front, rear)
    far = allowed(DUTIFUL, distance + 4.1, 0.5, 0.0, front, rear)
    assert (too_near.least, too_near.most) == (-6.0, -6.0)
    assert (far.least, far.most) == (-6.0, 4.0)


def test_a_follower_that_keeps_its_duty_never_comes_nearer_than_its_standing_gap_to_a_braking_robot() -> None:
    for v_r, v_o in ((25.0, 25.0), (20.0, 28.0), (5.0, 8.0), (30.0, 12.0)):
        gap, least = kept_distance(v_o, v_r) + 0.1, math.inf
        for _ in range(1000):
            may = allowed(DUTIFUL, gap + 5.0, 0.0, 0.0, v_r, v_o)
            gap += 0.01 * (v_r - v_o)
            v_r, v_o = max(v_r - 0.06, 0.0), max(v_o + 0.01 * may.most, 0.0)
            least = min(least, gap)
        assert least > 1.9


def test_a_robot_that_changes_lanes_binds_nobody_behind_until_it_is_in_the_lane() -> None:
    towards = -1.5  # m/s to the right, towards a car on its right
    assert allowed(DUTIFUL, 8.0, 2.6, towards, 25.0, 25.0).most == 4.0
    assert allowed(DUTIFUL, 8.0, 2.6, 0.0, 25.0, 25.0).most == -6.0
    assert allowed(DUTIFUL, 8.0, 0.9, towards, 25.0, 25.0).most == -6.0


def test_who_is_ahead_may_brake_and_accelerate_as_it_likes() -> None:
    for gap in (1.0, 10.0, 40.0):
        may = allowed(DUTIFUL, -5.0 - gap, 0.0, 0.0, 25.0, 25.0)
        assert (may.least, may.most) == (-6.0, 4.0)


@pytest.mark.parametrize("p_x", [-8.0, 0.0, 8.0])
def test_who_is_beside_does_not_steer_into_the_margin_but_may_leave(p_x: float) -> None:
    on_the_left, on_the_right = (allowed(DUTIFUL, p_x, side * 2.9, 0.0, 25.0, 25.0) for side in (1.0, -1.0))
    assert on_the_left[:2] == pytest.approx((-math.sin(0.1), 0.0))  # the robot is on the other's left
    assert on_the_right[:2] == pytest.approx((0.0, math.sin(0.1)))
    assert allowed(DUTIFUL, p_x, 3.6, 0.0, 25.0, 25.0)[:2] == pytest.approx(EVERYTHING[:2])


def test_who_cuts_in_ahead_leaves_the_robot_the_distance() -> None:
    distance = 5.0 + kept_distance(25.0, 22.0)
    assert allowed(DUTIFUL, -distance + 0.1, 2.9, 0.0, 25.0, 22.0).left == pytest.approx(0.0)
    assert allowed(DUTIFUL, -distance - 2.1, 2.9, 0.0, 25.0, 22.0).left == pytest.approx(math.sin(0.1))


def test_duties_only_ever_take_away_and_mirror_left_and_right() -> None:
    for p_x, p_y, theta, v_r, v_o in random_states(2000):
        may = allowed(DUTIFUL, p_x, p_y, v_r * math.sin(theta), v_r, v_o)
        mirrored = allowed(DUTIFUL, p_x, -p_y, -v_r * math.sin(theta), v_r, v_o)
        assert EVERYTHING[0] <= may.right <= 0.0 <= may.left <= EVERYTHING[1]
        assert may.least == -6.0
        assert -6.0 <= may.most <= 4.0
        assert (mirrored.right, mirrored.left) == pytest.approx((-may.left, -may.right))
        assert mirrored.most == pytest.approx(may.most)


def test_limits_are_continuous_in_the_state() -> None:
    for state in random_states(500):
        here = state + np.array([0.0, 0.0, 0.0, 0.0, 0.0])
        there = state + np.random.default_rng(5).normal(size=5) * 1e-4
        if here[0] * there[0] <= 0.0:
            continue  # on either side of p_x = 0 bodies overlap or pass with room: see the duties
        limits = [np.array(allowed(DUTIFUL, s[0], s[1], s[3] * math.sin(s[2]), s[3], s[4])) for s in (here, there)]
        assert np.abs(limits[0] - limits[1]).max() < 0.05


def test_the_worst_heading_within_limits_is_what_trying_finds() -> None:
    draw = np.random.default_rng(7)
    for _ in range(300):
        right, left = np.sort(draw.uniform(-0.3, 0.3, 2))
        along, across = draw.normal(size=2)
        limits = allowed(WORST, 0.0, 0.0, 0.0, 1.0, 1.0)._replace(right=right, left=left)
        sine = worst_heading_sine(limits, along, across)
        tried = np.linspace(right, left, 4001)
        best = (along * np.sqrt(1.0 - tried**2) + across * tried).max()
        assert along * math.sqrt(1.0 - sine**2) + across * sine == pytest.approx(best, abs=1e-6)


def test_hamiltonian_inputs_and_rows_are_what_trying_all_that_is_allowed_finds() -> None:
    game = find_game("highway")
    parameters = {**PARAMETERS, "responsible": 1.0, "lateral_acceleration_max": 4.0}
    c = game.parameter_values(parameters, "the test")
    states = random_states(300)
    gradients = np.random.default_rng(9).normal(size=states.shape) * [1.0, 3.0, 20.0, 2.0, 2.0]
    closed = hamiltonian_values(game, states, gradients, c, UNLIMITED)
    u, d = game.optimal(states, gradients, c, UNLIMITED)
    for state, gradient, value, control, worst in zip(states, gradients, closed, u, d, strict=True):
        may = allowed(DUTIFUL, state[0], state[1], state[3] * math.sin(state[2]), state[3], state[4])
        headings = np.arcsin(np.linspace(may.right, may.left, 401))
        tried = state[4] * (gradient[0] * np.cos(headings) + gradient[1] * np.sin(headings))
        drift = state[3] * (gradient[0] * math.cos(state[2]) + gradient[1] * math.sin(state[2])) - tried.max()
        drift += min(may.least * gradient[4], may.most * gradient[4])
        turning = min(0.3, 4.0 / state[3])
        best = turning * abs(gradient[2]) + max(-6.0 * gradient[3], 4.0 * gradient[3])
        assert value == pytest.approx(drift + best, rel=1e-3, abs=2e-3)
        assert worst_drift(gradient, state, DUTIFUL) == pytest.approx(drift, rel=1e-4, abs=1e-3)
        assert abs(control[0]) == pytest.approx(turning, rel=1e-5)
        rate = game.state_derivative(state[None], control[None], worst[None], c)[0]
        assert float(rate @ gradient) == pytest.approx(value, rel=1e-3, abs=5e-3)


def test_dissipation_bounds_every_slope_of_the_hamiltonian_under_duties_too() -> None:
    game = find_game("highway")
    c = game.parameter_values({**PARAMETERS, "responsible": 1.0, "lateral_acceleration_max": 4.0}, "the test")
    states = random_states(200)
    slopes = np.random.default_rng(11).normal(size=states.shape)
    alpha = np.empty((5, 200), np.float32)
    for row in range(200):
        here = np.ascontiguousarray(states[row : row + 1].T, np.float32)
        game.dissipation(here, c, alpha[:, row : row + 1])
    for axis in range(5):
        moved = slopes.copy()
        moved[:, axis] += 0.1
        before, after = (hamiltonian_values(game, states, each, c, UNLIMITED) for each in (slopes, moved))
        assert (np.abs(after - before) / 0.1 <= alpha[axis] + 0.02).all()
