import itertools

import numpy as np
import pytest
from filter_in_loop import FilterInLoop

from hj_cosim.control.spc.approach import asked_rise, binding_rows, can_bind
from hj_cosim.scene.observation import Control
from hj_cosim.settings import FilterSettings, RobotSettings

BOX = np.array([-0.3, 0.3, -6.0, 4.0])


def test_above_epsilon_v_may_fall_by_gamma_times_what_is_left_to_begin_with() -> None:
    assert asked_rise(2.001, 2.0, 0.0, 4.0) == pytest.approx(-4.0 * 0.001, rel=1e-3)
    assert asked_rise(2.0, 2.0, 0.0, 4.0) == 0.0
    assert asked_rise(1.0, 2.0, 3.0, 4.0) == 3.0  # below, it has to recover


def test_far_above_epsilon_a_lateral_gap_may_shrink_as_fast_as_it_is_wide() -> None:
    # V of a gap d beside a car is 4 d³, and 12 d² its slope: on the scale of look-ups the gap itself.
    for gap in (4.0, 6.0):
        falls = asked_rise(4.0 * gap**3, 0.0, 0.0, 3.0)
        assert falls / (12.0 * gap**2) == pytest.approx(-3.0 * gap, rel=0.2)
    rates = [asked_rise(value, 0.5, 0.0, 4.0) / (value - 0.5) for value in (1.0, 3.0, 10.0, 30.0, 100.0)]
    assert rates == sorted(rates, reverse=True)


def test_a_row_can_bind_where_some_corner_of_the_box_misses_it() -> None:
    draw = np.random.default_rng(1)
    for p, q, c in draw.normal(size=(500, 3)) * [10.0, 2.0, 5.0]:
        corners = [p * omega + q * a + c for omega, a in itertools.product(BOX[:2], BOX[2:])]
        assert can_bind(p, q, c, BOX) == (min(corners) < 0.0)


def test_only_rows_that_no_control_could_miss_are_left_out() -> None:
    rows = np.array([[1.0, 5.0, 5.0], [0.0, 0.0, 10.0], [-1.0, -1.0, -1.0], [-1.0, -5.0, -40.0]])
    kept, found = binding_rows(rows.copy(), 2.0, 0.0, 4.0, BOX, 0.0, 0.0)
    assert kept.tolist() == [0, 2]  # in K; above epsilon and sure to be met; above and missed by some
    assert found[3].tolist() == [-1.0, -40.0 - asked_rise(5.0, 2.0, 0.0, 4.0)]


def test_a_row_begins_before_epsilon_and_without_a_jump(table, observe) -> None:
    spc = FilterInLoop(FilterSettings(kind="spc", approach=4.0), table)
    asked = Control(0.0, 4.0)
    applied = [
        spc.filter(observe([0.0, 4.0, 0.0, 25.0], [[gap, 4.0, 0.0, 22.0]]), asked).control.acceleration
        for gap in np.arange(60.0, 30.0, -0.05)
    ]
    assert applied[0] == 4.0
    assert min(applied) < -4.0
    switched = FilterInLoop(FilterSettings(kind="spc"), table)
    at_once = [
        switched.filter(observe([0.0, 4.0, 0.0, 25.0], [[gap, 4.0, 0.0, 22.0]]), asked).control.acceleration
        for gap in np.arange(60.0, 30.0, -0.05)
    ]
    assert np.abs(np.diff(applied)).max() < 0.5 * np.abs(np.diff(at_once)).max()


def test_constraints_are_the_cars_in_k_though_rows_begin_above(table, observe) -> None:
    seen = observe([0.0, 4.0, 0.0, 25.0], [[42.0, 4.0, 0.0, 22.0]])
    decision = FilterInLoop(FilterSettings(kind="spc", approach=1.0), table).filter(seen, Control(0.0, 4.0))
    assert len(decision.rows) == 1
    assert decision.rows.value[0] > 2.0
    assert decision.constraints == 0
    assert decision.control.acceleration < 4.0


@pytest.mark.parametrize("kind", ["spc", "rss", "none"])
@pytest.mark.parametrize("speed", [5.0, 20.0, 35.0])
def test_tyres_hold_every_turn_whatever_is_asked_and_whoever_filters(table, observe, kind: str, speed: float) -> None:
    robot = RobotSettings(lateral_acceleration_max=3.0)
    guarded = FilterInLoop(FilterSettings(kind=kind, approach=6.0), table, robot)
    scenes = ([[300.0, 4.0, 0.0, speed]], [[3.0, 1.0, 0.0, speed]], [[3.0, 7.0, 0.0, speed]], [[20.0, 4.0, 0.0, 0.0]])
    for cars, asked in itertools.product(scenes, (-0.3, 0.3)):
        control = guarded.filter(observe([0.0, 4.0, 0.0, speed], cars), Control(asked, 0.0)).control
        assert abs(control.omega) * speed <= 3.0 + 1e-9


@pytest.mark.parametrize("kind", ["spc", "rss"])
def test_rows_are_met_within_what_tyres_hold(table, observe, kind: str) -> None:
    robot = RobotSettings(lateral_acceleration_max=3.0)
    guarded = FilterInLoop(FilterSettings(kind=kind), table, robot)
    decision = guarded.filter(observe([0.0, 4.0, -0.2, 30.0], [[3.0, 1.0, 0.0, 30.0]]), Control(0.0, 0.0))
    assert decision.constraints == 1
    assert decision.available[:2] == pytest.approx([-0.1, 0.1])
