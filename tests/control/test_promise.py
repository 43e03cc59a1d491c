import math

import numpy as np
import pytest
from filter_in_loop import FilterInLoop

from hj_cosim.control.spc.recovery import recovery_rate
from hj_cosim.scene.observation import Control
from hj_cosim.settings import FilterSettings, RobotSettings
from hj_cosim.verification.promise import promise_kept, realised_value_rates

ROBOT = RobotSettings()
EPSILON = FilterSettings().epsilon


def test_rates_are_the_differences_of_v_between_two_instants(linear_table, observe):
    # V = −p_x − 2 v_r + v_o − 20
    before = observe([0.0, 4.0, 0.0, 25.0], [[47.0, 4.0, 0.0, 24.0], [60.0, 4.0, 0.0, 24.0]], 1.00)
    after = observe([0.5, 4.0, 0.0, 24.9], [[47.4, 4.0, 0.0, 23.9], [60.5, 4.0, 0.0, 24.0]], 1.02)
    rates = realised_value_rates(linear_table.stack, before, after, np.array([1, 0, 7]))
    np.testing.assert_allclose(rates[:2], [(0.0 + 0.2) / 0.02, (-0.1 + 0.2 - 0.1) / 0.02], atol=1e-2)
    assert math.isnan(rates[2])


def test_a_promise_is_kept_when_no_v_in_k_falls_and_broken_when_one_does(linear_table, observe):
    before = observe([0.0, 4.0, 0.0, 25.0], [[47.0, 4.0, 0.0, 24.0]], 1.00)
    spc = FilterInLoop(FilterSettings(), linear_table)
    result = spc.filter(before, Control(0.0, 1.0))
    assert result.rows.margins(result.control.omega, result.control.acceleration).min() == pytest.approx(0.0, abs=1e-4)
    # The other car is as bad as the table assumes: it brakes at 6 m/s² and drives 0.1 rad across.
    slower, driven = 25.0 + result.control.acceleration * 0.02, 24.94 * math.cos(0.1) * 0.02
    kept = observe([24.97 * 0.02, 4.0, 0.0, slower], [[47.0 + driven, 4.0, 0.0, 24.0 - 0.12]], 1.02)
    assert promise_kept(linear_table.stack, result, before, kept, epsilon=EPSILON, tolerance=0.1)
    broken = observe([24.97 * 0.02, 4.0, 0.0, slower], [[47.0, 4.0, 0.0, 23.0]], 1.02)
    assert promise_kept(linear_table.stack, result, before, broken, epsilon=EPSILON, tolerance=0.1) is False


def test_a_promise_is_broken_by_one_car_however_well_the_other_does(linear_table, observe):
    car = [47.0, 4.0, 0.0, 24.0]
    before = observe([0.0, 4.0, 0.0, 25.0], [car, car], 1.00)
    result = FilterInLoop(FilterSettings(), linear_table).filter(before, Control(0.0, 1.0))
    assert len(result.rows) == 2
    after = observe([0.5, 4.0, 0.0, 25.0], [[49.0, 4.0, 0.0, 24.0], [47.0, 4.0, 0.0, 23.0]], 1.02)
    rates = realised_value_rates(linear_table.stack, before, after, np.array([0, 1]))
    assert rates.min() < -0.1 < rates.max()
    assert promise_kept(linear_table.stack, result, before, after, epsilon=EPSILON, tolerance=0.1) is False


def test_v_above_epsilon_may_fall_though_its_approach_is_held(linear_table, observe):
    """V of the first car is 1 m, below ε = 2 m, and rises; that of the second is 4 m, has a row too, and falls."""
    before = observe([0.0, 4.0, 0.0, 25.0], [[47.0, 4.0, 0.0, 24.0], [50.0, 4.0, 0.0, 24.0]], 1.00)
    result = FilterInLoop(FilterSettings(approach=2.0), linear_table).filter(before, Control(0.0, 4.0))
    assert result.rows.value == pytest.approx([1.0, 4.0], abs=1e-3)
    after = observe([0.5, 4.0, 0.0, 25.0], [[48.0, 4.0, 0.0, 24.0], [50.0, 4.0, 0.0, 24.0]], 1.02)
    first, second = realised_value_rates(linear_table.stack, before, after, np.array([0, 1]))
    assert second < -1.0 < 1.0 < first
    for epsilon, kept in ((EPSILON, True), (4.1, False)):
        assert promise_kept(linear_table.stack, result, before, after, epsilon=epsilon, tolerance=0.1) is kept


def test_nothing_is_promised_where_k_is_empty_or_the_rows_cannot_be_met(linear_table, observe):
    spc = FilterInLoop(FilterSettings(), linear_table)
    far = observe([0.0, 4.0, 0.0, 25.0], [[90.0, 4.0, 0.0, 24.0]], 1.0)
    near = observe([0.0, 4.0, 0.0, 35.0], [[5.0, 4.0, 0.0, 10.0]], 1.0)
    for seen in (far, near):
        result = spc.filter(seen, Control(0.0, 1.0))
        assert promise_kept(linear_table.stack, result, seen, seen, epsilon=EPSILON, tolerance=0.1) is None
    assert len(spc.filter(far, Control(0.0, 1.0)).rows) == 0
    assert not spc.filter(near, Control(0.0, 1.0)).meetable


def test_with_a_recovery_v_below_epsilon_rises_and_at_epsilon_it_holds(linear_table, observe):
    # V = −p_x − 2 v_r + v_o − 20: 1 m with the car at 45 m, 2 m with it at 46 m
    for ahead, rate in ((45.0, 3.0 * (2.0 - 1.0)), (46.0, 0.0)):
        seen = observe([0.0, 4.0, 0.0, 24.0], [[ahead, 4.0, 0.0, 24.0]], 1.0)
        result = FilterInLoop(FilterSettings(recovery=3.0), linear_table).filter(seen, Control(0.0, 1.0))
        gradient = np.array([-1.0, 0.0, 0.0, -2.0, 1.0])
        worst = -6.0 - 24.0 + 24.0 * math.cos(0.1)  # it brakes, and drives as far across as it can
        realised = worst + gradient[3] * result.control.acceleration
        assert result.rows.value == pytest.approx([ahead - 44.0], abs=1e-3)
        assert realised == pytest.approx(rate, abs=1e-3)


def test_one_lost_car_asks_for_no_more_recovery_than_one_at_the_edge_of_the_target_set():
    assert recovery_rate(-50.0, 2.0, 3.0) == recovery_rate(0.0, 2.0, 3.0) == 6.0
