"""SPC that assumes the worst of whom it suspects."""

import math

import numpy as np
import pytest
from test_belief import LANE, ROBOT, scene

from hj_cosim import plugins
from hj_cosim.control.belief import believing_filter
from hj_cosim.control.belief.believing_filter import SUSPECTS, BelievingFilter
from hj_cosim.control.belief.hypotheses import ASSUMED
from hj_cosim.control.catalogue import make_filter
from hj_cosim.control.contract import FilterDecision
from hj_cosim.control.spc.filter import SafetyPreservingFilter
from hj_cosim.errors import ConfigurationError
from hj_cosim.reachability.games.catalogue import find_game
from hj_cosim.reachability.table.cars import car_values, rows_of_cars, smooth_gradients
from hj_cosim.reachability.table.table import ValueTable
from hj_cosim.scene.observation import Control
from hj_cosim.scene.road import StraightRoad
from hj_cosim.settings import DriverSettings, FilterSettings, NormalDistribution, RobotSettings
from hj_cosim.vehicles.idm import idm_acceleration, mean_driver

CRUISE = Control(0.0, 0.0)
ROAD = StraightRoad(lane_count=4, lane_width=LANE)
CLOSING_IN = (-7.8, 0.0, 0.01, 25.5)  # a car, 2.8 m behind the robot and 5.5 m/s faster: no control meets its row
SPEEDING_UP = 9.0  # m/s², which nobody ordinary does
BELIEF = FilterSettings(priority="belief")


def lowered(table, by):
    """Return a table in which V is lower, by m, for each v_o of the grid or for all; above V(0, ·) it is nowhere."""
    values = (table.values - by).astype(np.float32)
    return ValueTable(table.specification, find_game("highway"), values, report=None)


@pytest.fixture
def lower_table(table, monkeypatch):
    """A table against the worst: V is 30 m less than among others, everywhere."""
    lower = lowered(table, 30.0)
    monkeypatch.setattr(believing_filter, "_worst_table", lambda robot: lower)
    return lower


@pytest.fixture
def crossing_tables(table, monkeypatch):
    """A table and one against the worst, in which V is less where the other car is fast, and more where it is slow."""
    against_the_worst = lowered(table, np.linspace(0.0, 30.0, table.values.shape[-1]))
    monkeypatch.setattr(believing_filter, "_worst_table", lambda robot: against_the_worst)
    return lowered(table, 15.0), against_the_worst


def both(table, settings=BELIEF):
    robot = RobotSettings()
    plain = SafetyPreservingFilter(FilterSettings(), robot, StraightRoad(4), table, 0.02)
    return plain, BelievingFilter(settings, robot, ROAD, table, 0.02)


def asked(safety_filter, table, cars, acceleration, seconds):
    for step in range(max(round(seconds / 0.1), 1)):
        observation = scene(cars, acceleration, time=0.1 * step)
        decision = safety_filter.filter(observation, car_values(table, observation), CRUISE)
    return observation, decision


def test_where_nobody_is_suspected_it_decides_as_spc(table, lower_table):
    plain, believing = both(table)
    for ahead in (8.0, 12.0, 20.0, 60.0):
        cars = [(ahead, 0.0, 0.0, 18.0), (-20.0, LANE, 0.0, 24.0)]
        one, other = (asked(each, table, cars, [0.0, 0.0], 0.0)[1] for each in (plain, believing))
        assert (one.control, one.constraints, one.slack) == (other.control, other.constraints, other.slack)


def test_a_suspected_cars_row_is_that_of_the_table_against_the_worst(table, lower_table):
    _, believing = both(table)
    cars = [(30.0, 0.0, 0.0, 20.0)]
    observation, early = asked(believing, table, cars, [-6.0], 0.0)
    assert early.constraints == 0
    _, late = asked(believing, table, cars, [-6.0], 6.0)
    assert late.diagnostics[SUSPECTS] == 1.0
    assert late.rows.value == pytest.approx(car_values(lower_table, observation).value)
    assert late.constraints == 1


def test_a_suspected_cars_smooth_slopes_are_those_of_the_table_against_the_worst(table, lower_table):
    _, believing = both(table, FilterSettings(priority="belief", suspect_weight=1.0, smooth_gradient=True))
    observation, decision = asked(believing, table, [(15.0, 2.2, 0.0, 20.0)], [-6.0], 6.0)
    values = car_values(lower_table, observation)
    slopes = smooth_gradients(lower_table, observation, values)
    _, rows = rows_of_cars(lower_table, observation, values.value, slopes, 2.0)
    kept = np.argmin(np.abs(rows[[1, 5], 0] - decision.rows.p[0]))  # of V, or of what may be kept instead
    assert decision.rows.p[0] == pytest.approx(rows[1 + 4 * kept, 0])
    assert decision.rows.q[0] == pytest.approx(rows[2 + 4 * kept, 0])
    of_others = smooth_gradients(table, observation, car_values(table, observation))
    assert np.abs(of_others - slopes).max() > 1e-3


def test_a_suspected_cars_row_is_of_the_table_that_gives_it_less_v(crossing_tables):
    table, against_the_worst = crossing_tables
    for speed, of, other in ((10.0, table, against_the_worst), (28.0, against_the_worst, table)):
        _, believing = both(table, FilterSettings(priority="belief", suspect_weight=1.0))
        observation, decision = asked(believing, table, [(7.0, 0.0, 0.0, speed)], [SPEEDING_UP], 6.0)
        assert decision.diagnostics[SUSPECTS] == 1.0
        values = car_values(of, observation)
        assert values.value[0] < car_values(other, observation).value[0] - 5.0
        _, rows = rows_of_cars(of, observation, values.value, values.gradient, 2.0)
        assert decision.rows.value == pytest.approx(rows[0])
        assert decision.rows.p == pytest.approx(rows[1])
        assert decision.rows.q == pytest.approx(rows[2])


def test_a_suspected_car_constrains_wherever_it_would_if_nobody_suspected_it(crossing_tables):
    table, _ = crossing_tables
    random, constrained = np.random.default_rng(0), 0
    for _ in range(40):
        plain, believing = both(table)
        cars = [(random.uniform(-25.0, 25.0), random.uniform(-4.0, 4.0), 0.0, random.uniform(0.0, 35.0))]
        _, trusting = asked(plain, table, cars, [SPEEDING_UP], 0.0)
        _, suspecting = asked(believing, table, cars, [SPEEDING_UP], 6.0)
        assert suspecting.diagnostics[SUSPECTS] == 1.0
        assert suspecting.constraints >= trusting.constraints
        if trusting.constraints:
            constrained += 1
            assert suspecting.rows.value[0] <= trusting.rows.value[0] + 1e-9
    assert constrained > 5


@pytest.mark.parametrize("scheme", ["mi", "sw"])
@pytest.mark.parametrize("conflicts", ["equal", "responsibility"])
def test_slack_is_what_the_rows_are_missed_by_before_they_are_weighed(table, lower_table, scheme, conflicts):
    chosen = {"priority": "belief", "scheme": scheme, "conflicts": conflicts}
    two = [(9.0, 0.0, 0.0, 15.0), CLOSING_IN]
    for cars, acceleration in (([CLOSING_IN], [SPEEDING_UP]), (two, [3.0, SPEEDING_UP])):
        for weight in (1.0, 0.25):
            _, believing = both(table, FilterSettings(**chosen, suspect_weight=weight))
            _, decision = asked(believing, table, cars, acceleration, 8.0)
            of = [weight if vehicle == len(cars) - 1 else 1.0 for vehicle in decision.rows.vehicle]
            margins = decision.rows.margins(decision.control.omega, decision.control.acceleration) / of
            assert decision.diagnostics[SUSPECTS] == 1.0
            assert decision.slack == pytest.approx(-margins.min(), abs=1e-6)
            assert decision.slack > 0.1


def test_slack_of_one_suspected_car_does_not_depend_on_its_weight(table, lower_table):
    slacks = []
    for weight in (1.0, 0.25):
        _, believing = both(table, FilterSettings(priority="belief", suspect_weight=weight))
        slacks.append(asked(believing, table, [CLOSING_IN], [SPEEDING_UP], 8.0)[1].slack)
    assert slacks[0] > 0.1
    assert slacks[1] == pytest.approx(slacks[0], rel=1e-3)


def test_drivers_of_the_scenario_are_those_that_ordinary_ones_are_compared_with(table, lower_table):
    fast = DriverSettings(desired_speed=NormalDistribution(mean=32.0, deviation=1.5))
    cars, free = [(60.0, LANE, 0.0, 20.0)], idm_acceleration(20.0, math.inf, 0.0, mean_driver(fast))
    beliefs = []
    for drivers in ({}, {"drivers": fast}):
        made = make_filter(BELIEF, RobotSettings(), ROAD, table, 0.02, **drivers)
        beliefs.append(asked(made, table, cars, [free], 20.0)[1].belief[0])
    assert beliefs[1] < ASSUMED.prior
    assert beliefs[1] < beliefs[0]


def test_filters_are_told_the_mean_drivers_and_not_how_they_scatter(table):
    fast = DriverSettings(desired_speed=NormalDistribution(mean=32.0, deviation=1.5))
    told = make_filter(
        FilterSettings(kind=plugins.given(plugins.FILTER, Told)), RobotSettings(), ROAD, table, 0.02, fast
    ).drivers
    assert told.desired_speed.mean == 32.0
    assert told.desired_speed.deviation == 0.0


class Told:
    def __init__(self, drivers):
        self.drivers = drivers

    def filter(self, observation, values, desired):
        return FilterDecision(desired)


def test_weight_scales_a_suspected_cars_row_and_nobody_elses(table, lower_table):
    cars = [(9.0, 0.0, 0.0, 15.0), (30.0, 0.0, 0.0, 20.0)]
    rows = {}
    for weight in (1.0, 0.25):
        _, believing = both(table, FilterSettings(priority="belief", suspect_weight=weight))
        rows[weight] = asked(believing, table, cars, [0.0, -6.0], 8.0)[1].rows
    light, heavy = rows[0.25], rows[1.0]
    share = np.where(heavy.vehicle == 1, 0.25, 1.0)
    assert set(heavy.vehicle) == {0, 1}
    assert light.p == pytest.approx(share * heavy.p)
    assert light.q == pytest.approx(share * heavy.q)
    assert light.c == pytest.approx(share * heavy.c)


def test_belief_of_a_car_can_be_asked_for(table, lower_table):
    _, believing = both(table)
    observation, _ = asked(believing, table, [(30.0, 0.0, 0.0, 20.0)], [-6.0], 6.0)
    assert believing.belief(observation)[0] > 0.8


def test_what_it_believes_goes_with_the_decision_and_of_spc_nothing_does(table, lower_table):
    plain, believing = both(table)
    cars = [(30.0, 0.0, 0.0, 20.0), (-40.0, LANE, 0.0, 20.0)]
    for seconds in (0.0, 6.0):  # nobody is suspected yet, and then
        observation, decision = asked(believing, table, cars, [-6.0, 0.0], seconds)
        assert decision.belief.tolist() == believing.belief(observation).tolist()
        assert 0.0 < decision.belief[1] < 0.8
    assert decision.belief[0] > 0.8
    assert asked(plain, table, cars, [-6.0, 0.0], 0.0)[1].belief is None


def test_priority_by_belief_without_spc_is_refused(table):
    with pytest.raises(ConfigurationError, match=r"priority.*spc.*rss"):
        make_filter(FilterSettings(kind="rss", priority="belief"), RobotSettings(), ROAD, table, 0.02)


def test_without_cars_it_passes_the_desired_control(table, lower_table):
    _, believing = both(table)
    assert len(ROBOT) == 4
    assert asked(believing, table, [], [], 0.2)[1].control == CRUISE
