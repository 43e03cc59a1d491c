from dataclasses import replace

import numpy as np
import pytest

from hj_cosim.reachability.table.cars import car_values, pair_states
from hj_cosim.reachability.table.table import ValueTable
from hj_cosim.scene.observation import Observation

ROBOT = np.array([100.0, 4.0, 0.05, 24.0])
X, Y = np.array([130.0, 95.0, 700.0, 100.0]), np.array([4.0, 8.0, 4.0, 40.0])
HEADING, SPEED = np.zeros(4), np.array([20.0, 25.0, 20.0, 20.0])


def scene(robot: np.ndarray, x: np.ndarray, y: np.ndarray, heading: np.ndarray, speed: np.ndarray) -> Observation:
    lane = np.zeros(len(x), np.int64)
    body = np.full(len(x), 5.0), np.full(len(x), 2.0)
    return Observation(0.0, robot, 0.0, np.arange(len(x)), x, y, heading, speed, np.zeros(len(x)), lane, lane, *body)


def test_values_of_all_cars_are_those_of_their_states_one_by_one(small_table: ValueTable) -> None:
    observation = scene(ROBOT, X, Y, HEADING, SPEED)
    values = car_values(small_table, observation)
    states = [[100.0 - x, 4.0 - y, 0.05, 24.0, v] for x, y, v in zip(X, Y, SPEED, strict=True)]
    assert values.value == pytest.approx(small_table.value(np.array(states)))
    assert np.isfinite(values.value[:2]).all()
    assert np.isposinf(values.value[2])  # too far ahead
    assert values.value[3] > 1000.0  # too far aside: V(0, ·)
    assert values.least == values.value.min()
    assert pair_states(ROBOT, observation.cars, np.array([1, 3])) == pytest.approx(np.array(states)[[1, 3]])


@pytest.mark.parametrize("what", range(5))
@pytest.mark.parametrize("bad", [np.nan, np.inf, 1e300])
def test_nothing_is_known_about_an_observation_that_cannot_be(small_table: ValueTable, what: int, bad: float) -> None:
    robot, cars = ROBOT.copy(), [X.copy(), Y.copy(), HEADING.copy(), SPEED.copy()]
    broken = robot if what == 4 else cars[what]
    broken[2] = bad
    values = car_values(small_table, scene(robot, *cars))
    assert np.isnan(values.value).all()
    assert np.isnan(values.least)


def test_an_empty_road_has_no_values(small_table: ValueTable) -> None:
    nobody = np.empty(0)
    values = car_values(small_table, scene(ROBOT, nobody, nobody, nobody, nobody))
    assert values.value.shape == (0,)
    assert values.least == np.inf


@pytest.mark.parametrize(("x", "y"), [(-30.0, 4.0), (30.0, 4.0), (5.0, 7.6), (-3.0, 0.4)])
def test_v_of_a_truck_is_that_of_the_worst_car_within_it(small_table: ValueTable, x: float, y: float) -> None:
    """Written from scratch: a car everywhere within the body, and the least of their values."""
    robot = np.array([100.0, 4.0, 0.0, 24.0])
    one = np.array([100.0 + x]), np.array([y]), np.zeros(1), np.array([22.0])
    truck = replace(scene(robot, *one), length=np.array([15.0]), width=np.array([2.5]))
    within = [(a, b) for a in np.linspace(-5.0, 5.0, 201) for b in (-0.25, 0.25, np.clip(4.0 - y, -0.25, 0.25))]
    worst = min(float(small_table.value(np.array([[-(x + a), 4.0 - (y + b), 0.0, 24.0, 22.0]]))[0]) for a, b in within)
    value = float(car_values(small_table, truck).value[0])
    assert value == pytest.approx(worst, abs=0.1)
    assert value < float(car_values(small_table, scene(robot, *one)).value[0])


def test_whoever_is_no_larger_than_a_car_has_the_value_of_a_car(small_table: ValueTable) -> None:
    cars = scene(ROBOT, X, Y, HEADING, SPEED)
    small = replace(cars, length=np.full(4, 4.2), width=np.full(4, 1.7))
    assert np.array_equal(car_values(small_table, small).value, car_values(small_table, cars).value)
