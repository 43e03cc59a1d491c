import dataclasses
import math

import numpy as np
import pytest
from extreme_scenes import draw_desired, draw_scene
from filter_in_loop import ROBOT, FilterInLoop
from hypothesis import given
from hypothesis import strategies as st

from hj_cosim.reachability.games.highway.other_car import Disturbance
from hj_cosim.reachability.games.highway.rows import worst_drift
from hj_cosim.reachability.table.lookup import value_and_gradient_at
from hj_cosim.scene.observation import Control
from hj_cosim.settings import FilterSettings

CRUISE = Control(0.0, 0.0)


def filter_of(table, **settings):
    return FilterInLoop(FilterSettings(**settings), table)


gradients = st.tuples(*(st.floats(-50, 50) for _ in range(5)))


@given(gradient=gradients, heading=st.floats(-0.4, 0.4), speed=st.floats(0, 40), other=st.floats(0.0, 40))
def test_the_drift_is_the_least_that_the_other_car_can_bring_about(gradient, heading, speed, other):
    limits = Disturbance(0.1, -6.0, 4.0)
    drift = worst_drift(np.array(gradient), np.array([0.0, 0.0, heading, speed, other]), limits)
    headings, accelerations = np.linspace(-0.1, 0.1, 201), np.array([-6.0 if other > 0 else 0.0, 4.0])
    v_x, v_y, _, _, v_o = gradient
    own = speed * (v_x * math.cos(heading) + v_y * math.sin(heading))
    sampled = (v_o * accelerations).min() - other * (v_x * np.cos(headings) + v_y * np.sin(headings)).max() + own
    assert drift <= sampled + 1e-9
    assert drift == pytest.approx(sampled, abs=1e-4 * (1 + other * math.hypot(v_x, v_y)))


def test_far_from_all_cars_the_desired_control_passes_within_the_limits(table, observe):
    seen = observe([0.0, 4.0, 0.0, 24.0], [[90.0, 12.0, 0.0, 24.0], [500.0, 4.0, 0.0, 10.0]])
    for kind in ("spc", "rss", "none"):
        result = filter_of(table, kind=kind).filter(seen, Control(0.9, -20.0))
        assert result.control == Control(0.3, -6.0)
        assert not result.constrained
        assert (result.constraints, result.slack) == (0, 0.0)


@pytest.mark.parametrize("scheme", ["mi", "sw"])
def test_spc_s_control_keeps_every_row_that_can_be_met(table, observe, scheme):
    seen = observe([0.0, 4.0, 0.02, 26.0], [[27.0, 4.0, 0.0, 22.0], [4.0, 7.0, 0.0, 24.0]])
    result = filter_of(table, kind="spc", scheme=scheme).filter(seen, Control(0.1, 2.0))
    assert result.constrained
    assert result.constraints == len(result.rows) == 2
    margins = result.rows.margins(result.control.omega, result.control.acceleration)
    assert result.slack == pytest.approx(max(-margins.min(), 0.0 if scheme == "mi" else -np.inf), abs=1e-9)
    assert result.meetable == (result.least_slack <= 1e-6)
    assert result.slack >= result.least_slack - 1e-6 or scheme == "sw"


def test_spc_s_rows_are_the_table_s_gradient_and_worst_drift(table, observe):
    seen = observe([0.0, 4.0, 0.02, 26.0], [[300.0, 4.0, 0.0, 22.0], [27.0, 4.0, 0.0, 22.0]])
    rows = filter_of(table, kind="spc").filter(seen, CRUISE).rows
    gradient = np.empty(5)
    value = value_and_gradient_at(*table.arrays, -27.0, 0.0, 0.02, 26.0, 22.0, gradient)
    assert rows.vehicle.tolist() == [1]
    drift = worst_drift(gradient, np.array([-27.0, 0.0, 0.02, 26.0, 22.0]), Disturbance.of_game(table.parameters))
    np.testing.assert_allclose([rows.value[0], rows.p[0], rows.q[0], rows.c[0]], [value, *gradient[2:4], drift])


def test_mi_changes_a_control_no_more_than_it_must(linear_table, observe):
    # V = −p_x − 2 v_r + v_o − 20 = 1 <= ε; the row is −2 a + v_o cosθ̄ − v_r − 6 >= 0.
    seen = observe([0.0, 4.0, 0.0, 25.0], [[47.0, 4.0, 0.0, 24.0]])
    spc = filter_of(linear_table, kind="spc")
    asked_too_much = spc.filter(seen, Control(0.05, 1.0))
    assert asked_too_much.rows.value == pytest.approx([1.0], abs=1e-4)
    assert asked_too_much.control.acceleration == pytest.approx((24.0 * math.cos(0.1) - 31.0) / 2.0, abs=1e-4)
    assert asked_too_much.control.omega == pytest.approx(0.05, abs=1e-6)
    assert spc.filter(seen, Control(0.05, -5.0)).control.acceleration == pytest.approx(-5.0, abs=1e-6)


def test_sw_holds_the_steering_and_meets_the_row_with_as_much_room_as_it_can(linear_table, observe):
    switching = filter_of(linear_table, kind="spc", scheme="sw")
    switching.filter(observe([0.0, 4.0, 0.0, 25.0], [[90.0, 4.0, 0.0, 24.0]]), Control(0.07, 1.0))
    seen = observe([0.0, 4.0, 0.0, 25.0], [[47.0, 4.0, 0.0, 24.0]])
    result = switching.filter(seen, Control(-0.2, 1.0))
    assert result.control.omega == pytest.approx(0.07, abs=1e-6)
    assert result.control.acceleration == pytest.approx(-6.0, abs=1e-4)
    assert result.slack == pytest.approx(-(12.0 + 24.0 * math.cos(0.1) - 31.0), abs=1e-3)


def test_spc_keeps_the_heading_within_the_table(table, observe):
    seen = observe([0.0, 4.0, 0.4, 26.0], [[20.0, 4.0, 0.0, 22.0]])
    result = filter_of(table, kind="spc").filter(seen, Control(0.3, 0.0))
    assert result.available[1] <= 0.0
    assert result.control.omega <= 1e-9


NOT_FINITE = [math.nan, math.inf, -math.inf, 1e300]


@pytest.mark.parametrize("kind", ["spc", "rss", "none"])
@pytest.mark.parametrize("bad", NOT_FINITE)
@pytest.mark.parametrize("where", ["robot", "x", "y", "speed", "heading", "acceleration"])
def test_an_observation_that_is_not_finite_brakes_straight_ahead_and_is_counted(table, observe, kind, bad, where):
    seen = observe([0.0, 4.0, 0.1, 24.0], [[30.0, 4.0, 0.0, 20.0], [3.0, 8.0, 0.0, 20.0]])
    array = getattr(seen, where).copy()
    array[1] = bad
    safety_filter = filter_of(table, kind=kind)
    result = safety_filter.filter(dataclasses.replace(seen, **{where: array}), CRUISE)
    assert result.control.acceleration == ROBOT.acceleration_min
    assert -ROBOT.omega_max <= result.control.omega <= 0.0
    assert safety_filter.counts == {"could not judge": 1}


@pytest.mark.parametrize("kind", ["spc", "rss", "none"])
@pytest.mark.parametrize("bad", NOT_FINITE[:3])
def test_a_desired_control_that_is_not_finite_is_replaced_by_braking_and_counted(table, observe, kind, bad):
    seen = observe([0.0, 4.0, 0.0, 24.0], [[30.0, 4.0, 0.0, 20.0]])
    for desired in (Control(bad, 0.0), Control(0.0, bad)):
        safety_filter = filter_of(table, kind=kind)
        control = safety_filter.filter(seen, desired).control
        assert math.isfinite(control.omega)
        assert -6.0 <= control.acceleration <= -3.9  # RSS may leave it at b_min
        assert safety_filter.counts == {"desired not finite": 1}


@pytest.mark.parametrize("bad", [*NOT_FINITE, -1.0])
@pytest.mark.parametrize("where", ["length", "width"])
def test_rss_brakes_and_counts_where_a_body_is_not_possible(table, observe, bad, where):
    seen = observe([0.0, 4.0, 0.1, 24.0], [[3.0, 8.0, 0.0, 20.0]])
    safety_filter = filter_of(table, kind="rss")
    result = safety_filter.filter(dataclasses.replace(seen, **{where: np.array([bad])}), CRUISE)
    assert result.control == Control(-0.2, ROBOT.acceleration_min)
    assert safety_filter.counts == {"could not judge": 1}


def test_a_table_with_nan_brakes_and_is_counted(table, observe):
    broken = dataclasses.replace(table, values=np.full_like(table.values, np.nan))
    safety_filter = filter_of(broken, kind="spc")
    result = safety_filter.filter(observe([0.0, 4.0, 0.0, 24.0], [[30.0, 4.0, 0.0, 20.0]]), CRUISE)
    assert result.control == Control(0.0, -6.0)
    assert safety_filter.counts == {"could not judge": 1}


@given(
    robot=st.tuples(st.floats(-50, 50), st.floats(-4, 16), st.floats(-0.5, 0.5), st.floats(0, 40)),
    cars=st.lists(st.tuples(st.floats(-60, 60), st.floats(-4, 16), st.floats(-0.2, 0.2), st.floats(0, 40)), max_size=6),
    desired=st.tuples(st.floats(-2, 2), st.floats(-20, 20)),
    kind=st.sampled_from(["spc", "rss"]),
    scheme=st.sampled_from(["mi", "sw"]),
)
def test_every_control_is_finite_and_within_the_limits(table, observe, robot, cars, desired, kind, scheme):
    control = filter_of(table, kind=kind, scheme=scheme).filter(observe(robot, cars), Control(*desired)).control
    assert abs(control.omega) <= ROBOT.omega_max
    assert ROBOT.acceleration_min <= control.acceleration <= ROBOT.acceleration_max


@pytest.mark.parametrize("kind", ["spc", "rss", "none"])
@pytest.mark.parametrize("scheme", ["mi", "sw"])
@pytest.mark.parametrize("keep_escape", [False, True])
def test_extreme_scenes_are_answered_within_the_limits(table, kind, scheme, keep_escape):
    """tests/benchmarks/test_fuzz.py draws a million."""
    draw = np.random.default_rng(0)
    safety_filter = filter_of(table, kind=kind, scheme=scheme, keep_escape=keep_escape)
    for _ in range(500):
        result = safety_filter.filter(draw_scene(draw), draw_desired(draw))
        assert abs(result.control.omega) <= ROBOT.omega_max
        assert ROBOT.acceleration_min <= result.control.acceleration <= ROBOT.acceleration_max
        assert math.isfinite(result.slack + getattr(result, "least_slack", 0.0))
    assert safety_filter.counts["could not judge"] > 50
    assert safety_filter.counts["desired not finite"] > 10


@pytest.mark.parametrize("kind", ["spc", "rss"])
def test_hundreds_of_cars_on_top_of_the_robot_are_answered(table, observe, kind):
    draw = np.random.default_rng(1)
    cars = np.column_stack(
        [draw.uniform(-2, 2, 500), draw.uniform(3, 5, 500), draw.uniform(-0.2, 0.2, 500), draw.uniform(0, 40, 500)]
    )
    for scheme in ("mi", "sw"):
        result = filter_of(table, kind=kind, scheme=scheme).filter(observe([0.0, 4.0, 0.1, 24.0], cars), CRUISE)
        assert result.constraints == 500
        margins = result.rows.margins(result.control.omega, result.control.acceleration)
        assert margins.min() == pytest.approx(-result.slack, abs=1e-3)
