"""What gives way where rows cannot be met together, against a search over all controls."""

import numpy as np
import pytest
from scipy.optimize import linprog

from hj_cosim.control.problem.nearest_control import NearestControl
from hj_cosim.control.problem.safety_problem import SafetyRows
from hj_cosim.control.spc.conflicts import robot_answers, severity
from hj_cosim.control.spc.filter import SafetyPreservingFilter
from hj_cosim.reachability.table.cars import car_values
from hj_cosim.scene.observation import Control, Observation
from hj_cosim.scene.road import StraightRoad
from hj_cosim.settings import FilterSettings, RobotSettings
from hj_cosim.settings.episode import robot_and_filter

ROBOT = RobotSettings()
BOX = np.array([-0.3, 0.3, -6.0, 4.0])


def scene(*cars: tuple[float, float], heading: float = 0.0) -> Observation:
    """Return an observation of the robot at 20 m/s on y = 0, and cars at (x, y) beside it."""
    x, y = np.array(cars).T
    still, count = np.zeros(len(x)), len(x)
    return Observation(
        time=0.0, robot=np.array([0.0, 0.0, heading, 20.0]), robot_acceleration=0.0, vehicle=np.arange(count),
        x=x, y=y, heading=still, speed=still + 20.0, acceleration=still, lane=still.astype(int),
        target_lane=still.astype(int), length=still + 5.0, width=still + 2.0,
    )  # fmt: skip


def answers(*cars: tuple[float, float], heading: float = 0.0) -> list[bool]:
    return robot_answers(scene(*cars, heading=heading), np.arange(len(cars)), 5.0, 2.0).tolist()


def test_the_robot_answers_for_who_is_ahead_and_not_for_who_is_behind_or_beside():
    assert answers((15.0, 0.0), (-15.0, 0.0), (1.0, 3.0), (-15.0, 3.0)) == [True, False, False, False]


def test_a_robot_that_changes_lanes_answers_for_those_whose_room_it_takes():
    left = 0.05  # rad, 1 m/s
    assert answers((1.0, 3.0), (-15.0, 3.0), (1.0, -3.0), heading=left) == [True, True, False]
    assert answers((-15.0, 1.0), heading=left) == [False]  # in that lane already
    assert answers((-15.0, 3.0), heading=0.009) == [False]  # 0.18 m/s is keeping its place


def rows(p, q, c, value=(0.0, 0.0)) -> SafetyRows:
    return SafetyRows(np.arange(len(p)), np.array(value), np.array(p, float), np.array(q, float), np.array(c, float))


def resolved(between: SafetyRows, first: list[bool]) -> tuple[Control, Control]:
    nearest, desired = NearestControl(FilterSettings(solver="enumeration"), ROBOT), Control(0.0, 0.0)
    equal = nearest.choose(between, len(between), desired, BOX)
    assert not equal.meetable
    return equal.control, nearest.resolve(equal, np.array(first), severity(between.value, 0.5), desired).control


def test_the_car_ahead_is_braked_for_although_one_behind_forbids_it():
    between = rows([0.0, 0.0], [-1.0, 1.0], [-5.0, -1.0])  # a <= −5 for the one ahead, a >= 1 for the one behind
    equal, by_responsibility = resolved(between, [True, False])
    assert equal.acceleration == pytest.approx(-2.0)  # both are missed by 3
    assert -5.0 <= by_responsibility.acceleration < -4.9


def least_missed(between: SafetyRows, which: np.ndarray, kept: np.ndarray, by: float) -> float:
    """Return the least by which some rows have to be missed while others are missed by no more than `by`."""
    p, q, c = between.p, between.q, between.c
    bounds = [(BOX[0], BOX[1]), (BOX[2], BOX[3]), (0.0, None)]
    slack = np.where(which, -1.0, 0.0)
    found = linprog(
        [0.0, 0.0, 1.0], A_ub=np.column_stack([-p, -q, slack])[which | kept],
        b_ub=(c + np.where(kept, by, 0.0))[which | kept], bounds=bounds,
    )  # fmt: skip
    return float(found.fun)


def test_what_comes_first_is_missed_least_and_then_the_rest_as_linear_programming_finds():
    generator, first, none = np.random.default_rng(0), np.array([True, True, False, False]), np.zeros(4, bool)
    checked = 0
    for _ in range(100):
        p, q, c = generator.normal(0, 20, 4), generator.normal(0, 2, 4), generator.normal(-6, 3, 4)
        between = rows(p, q, c, [0.5] * 4)
        if least_missed(between, ~none, none, 0.0) < 0.1:
            continue
        _, found = resolved(between, first.tolist())
        least = least_missed(between, first, none, 0.0)
        then = least_missed(between, ~first, first, least + 1e-9)
        margins = between.margins(found.omega, found.acceleration)
        allowed = 0.02 * then  # what 100 times as much leaves
        assert -margins[first].min() <= least + allowed + 1e-6
        assert -margins[~first].min() <= then + 1e-6
        checked += 1
    assert checked > 30


def test_where_what_comes_first_cannot_be_met_the_rest_is_still_missed_as_little_as_can_be():
    between = rows([0.0, 10.0], [-1.0, 0.0], [-8.0, -1.0], [0.5, 0.5])  # a <= −8, which no robot can, and ω >= 0.1
    equal, by_responsibility = resolved(between, [True, False])
    assert equal.omega < 0.05  # missed by 1 of the 2 that the other is missed by anyway
    assert (by_responsibility.omega, by_responsibility.acceleration) == pytest.approx((0.1, -6.0), abs=1e-3)


def test_of_equals_the_one_with_less_left_counts_more():
    assert severity(np.array([0.5, -1.5, 7.0, -90.0]), 0.5).tolist() == [1.0, 3.0, 1.0, 11.0]
    between = rows([0.0, 0.0], [-1.0, 1.0], [-5.0, -1.0], [0.5, -1.5])
    for first in ([False, False], [True, True]):
        assert resolved(between, first)[1].acceleration == pytest.approx(-0.5, abs=0.02)  # missed by 4.5 and 1.5


def test_the_paper_misses_all_alike():
    assert robot_and_filter("paper")[1].conflicts == "equal"


def test_spc_brakes_for_who_is_ahead_though_somebody_follows_too_closely(table):
    cars = scene((11.0, 0.0), (-8.0, 0.0))
    closing = Observation(**{**vars(cars), "speed": np.array([12.0, 28.0])})
    values, found = car_values(table, closing), {}
    for conflicts in ("equal", "responsibility"):
        spc = SafetyPreservingFilter(FilterSettings(conflicts=conflicts), ROBOT, StraightRoad(4), table, 0.02)
        decision = spc.filter(closing, values, Control(0.0, 0.0))
        assert not decision.meetable
        found[conflicts] = decision.control.acceleration
        missed = -decision.rows.margins(decision.control.omega, decision.control.acceleration)
        assert decision.slack == pytest.approx(missed.max(), rel=1e-3)
    assert found["responsibility"] < found["equal"] - 1.0
