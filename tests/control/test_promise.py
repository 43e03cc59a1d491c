import math

import numpy as np
import pytest

from hj_cosim.config import FilterSettings, RobotSettings
from hj_cosim.control.promise import promise_kept, promised_rate, realised_value_rates
from hj_cosim.control.safety_filter import make_filter
from hj_cosim.vehicles.observation import Control

ROBOT = RobotSettings()


def test_rates_are_the_differences_of_v_between_two_instants(linear_table, observe):
    # V = −p_x − 2 v_r + v_o − 20
    before = observe([0.0, 4.0, 0.0, 25.0], [[47.0, 4.0, 0.0, 24.0], [60.0, 4.0, 0.0, 24.0]], 1.00)
    after = observe([0.5, 4.0, 0.0, 24.9], [[47.4, 4.0, 0.0, 23.9], [60.5, 4.0, 0.0, 24.0]], 1.02)
    rates = realised_value_rates(linear_table.arrays, before, after, np.array([1, 0, 7]))
    np.testing.assert_allclose(rates[:2], [(0.0 + 0.2) / 0.02, (-0.1 + 0.2 - 0.1) / 0.02], atol=1e-2)
    assert math.isnan(rates[2])


def test_a_promise_is_kept_when_no_v_in_k_falls_and_broken_when_one_does(linear_table, observe):
    before = observe([0.0, 4.0, 0.0, 25.0], [[47.0, 4.0, 0.0, 24.0]], 1.00)
    spc = make_filter(FilterSettings(), ROBOT, linear_table, 0.02)
    result = spc.filter(before, Control(0.0, 1.0))
    assert promised_rate(result) == pytest.approx(0.0, abs=1e-4)
    # The other car is as bad as the table assumes: it brakes at 6 m/s² and drives 0.1 rad across.
    slower, driven = 25.0 + result.control.acceleration * 0.02, 24.94 * math.cos(0.1) * 0.02
    kept = observe([24.97 * 0.02, 4.0, 0.0, slower], [[47.0 + driven, 4.0, 0.0, 24.0 - 0.12]], 1.02)
    assert promise_kept(linear_table.arrays, result, before, kept, tolerance=0.1)
    broken = observe([24.97 * 0.02, 4.0, 0.0, slower], [[47.0, 4.0, 0.0, 23.0]], 1.02)
    assert promise_kept(linear_table.arrays, result, before, broken, tolerance=0.1) is False


def test_nothing_is_promised_where_k_is_empty_or_the_rows_cannot_be_met(linear_table, observe):
    spc = make_filter(FilterSettings(), ROBOT, linear_table, 0.02)
    far = observe([0.0, 4.0, 0.0, 25.0], [[90.0, 4.0, 0.0, 24.0]], 1.0)
    near = observe([0.0, 4.0, 0.0, 35.0], [[5.0, 4.0, 0.0, 10.0]], 1.0)
    for seen in (far, near):
        result = spc.filter(seen, Control(0.0, 1.0))
        assert promise_kept(linear_table.arrays, result, seen, seen, 0.1) is None
    assert promised_rate(spc.filter(far, Control(0.0, 1.0))) == math.inf
    assert not spc.filter(near, Control(0.0, 1.0)).meetable
