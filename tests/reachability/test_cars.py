import numpy as np
import pytest

from hj_cosim.reachability.table.cars import pair_states, values_of_cars
from hj_cosim.reachability.table.table import ValueTable

ROBOT = np.array([100.0, 4.0, 0.05, 24.0])
X, Y = np.array([130.0, 95.0, 700.0, 100.0]), np.array([4.0, 8.0, 4.0, 40.0])
HEADING, SPEED = np.zeros(4), np.array([20.0, 25.0, 20.0, 20.0])


def test_values_of_all_cars_are_those_of_their_states_one_by_one(small_table: ValueTable) -> None:
    values = values_of_cars(small_table.arrays, ROBOT, X, Y, HEADING, SPEED)
    states = [[100.0 - x, 4.0 - y, 0.05, 24.0, v] for x, y, v in zip(X, Y, SPEED, strict=True)]
    assert values == pytest.approx(small_table.value(np.array(states)))
    assert np.isfinite(values[:2]).all()
    assert np.isposinf(values[2:]).all()  # too far ahead, too far aside
    assert pair_states(ROBOT, X, Y, SPEED, np.array([1, 3])) == pytest.approx(np.array(states)[[1, 3]])


@pytest.mark.parametrize("what", range(5))
@pytest.mark.parametrize("bad", [np.nan, np.inf, 1e300])
def test_nothing_is_known_about_an_observation_that_cannot_be(small_table: ValueTable, what: int, bad: float) -> None:
    robot, cars = ROBOT.copy(), [X.copy(), Y.copy(), HEADING.copy(), SPEED.copy()]
    broken = robot if what == 4 else cars[what]
    broken[2] = bad
    assert np.isnan(values_of_cars(small_table.arrays, robot, *cars)).all()


def test_an_empty_road_has_no_values(small_table: ValueTable) -> None:
    nobody = np.empty(0)
    assert values_of_cars(small_table.arrays, ROBOT, nobody, nobody, nobody, nobody).shape == (0,)
