"""SPC that assumes the worst of whom it suspects."""

import numpy as np
import pytest
from test_belief import LANE, ROBOT, scene

from hj_cosim.control.belief import believing_filter
from hj_cosim.control.belief.believing_filter import SUSPECTS, BelievingFilter
from hj_cosim.control.catalogue import make_filter
from hj_cosim.control.spc.filter import SafetyPreservingFilter
from hj_cosim.errors import ConfigurationError
from hj_cosim.reachability.games.catalogue import find_game
from hj_cosim.reachability.table.cars import car_values, rows_of_cars, smooth_gradients
from hj_cosim.reachability.table.table import ValueTable
from hj_cosim.scene.observation import Control
from hj_cosim.scene.road import StraightRoad
from hj_cosim.settings import FilterSettings, RobotSettings

CRUISE = Control(0.0, 0.0)
ROAD = StraightRoad(lane_count=4, lane_width=LANE)
BELIEF = FilterSettings(priority="belief")


@pytest.fixture
def lower_table(table, monkeypatch):
    """A table against the worst: V is 30 m less than among others, everywhere."""
    lower = ValueTable(table.specification, find_game("highway"), table.values - np.float32(30.0), report=None)
    monkeypatch.setattr(believing_filter, "_worst_table", lambda robot: lower)
    return lower


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
