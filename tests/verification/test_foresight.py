import math

import numpy as np
import pytest

from hj_cosim.metrics.catalogue import require_declared
from hj_cosim.scene.observation import Observation, Target
from hj_cosim.scene.road import StraightRoad
from hj_cosim.settings import DriverSettings, PlannerSettings, RobotSettings
from hj_cosim.verification.foresight import ForesightAudit


def seen(time, cars):
    """Return a robot at 24 m/s in lane 1 among cars, (number, x, lane, speed)."""
    rows = np.array(cars, float).reshape(-1, 4)
    count, lane = len(rows), rows[:, 2].astype(np.int64)
    return Observation(
        time, np.array([1000.0 + 24.0 * time, 4.0, 0.0, 24.0]), 0.0, rows[:, 0].astype(np.int64), rows[:, 1],
        4.0 * lane, np.zeros(count), rows[:, 3], np.zeros(count), lane, lane, np.full(count, 5.0), np.full(count, 2.0),
    )  # fmt: skip


def audit(table):
    return ForesightAudit(PlannerSettings(), RobotSettings(), DriverSettings(), StraightRoad(4), table)


def test_errors_are_how_far_cars_are_from_where_they_were_predicted(small_table):
    """Cars with nobody ahead are predicted to keep their speed and lane."""
    judged = audit(small_table)
    for time in range(5):
        slower = 1050.0 + 20.0 * time - 0.5 * time**2  # it brakes with 1 m/s²
        cars = [(4, 1080.0 + 25.0 * time, 3, 25.0), (2, slower, 0, 20.0 - time)]
        judged.judge(seen(float(time), cars if time < 4 else cars[1:]), Target(1, 24.0))
    found = judged.summary()
    # The one is where it was predicted, the other 0.5 t² behind; the first has gone at the last instant.
    assert (found["prediction_samples_1s"], found["prediction_samples_2s"], found["prediction_samples_3s"]) == (7, 5, 3)
    assert found["prediction_error_1s"] == pytest.approx(4 * 0.5 / 7, abs=1e-3)
    assert found["prediction_error_2s"] == pytest.approx(3 * 2.0 / 5, abs=1e-3)
    assert found["prediction_error_3s"] == pytest.approx(2 * 4.5 / 3, abs=1e-3)
    assert found["prediction_lane_3s"] == 1.0
    require_declared(found)


def test_a_second_without_a_look_shifts_no_prediction(small_table):
    judged = audit(small_table)
    for time in (0.0, 1.0, 3.0, 4.0, 8.0):  # where a car's state is not a number, nobody is judged
        judged.judge(seen(time, [(4, 1080.0 + 25.0 * time, 3, 25.0)]), Target(1, 24.0))
    found = judged.summary()
    assert [found[f"prediction_samples_{ahead}s"] for ahead in (1, 2, 3)] == [2, 1, 2]
    assert max(found[f"prediction_error_{ahead}s"] for ahead in (1, 2, 3)) < 1e-3


def test_a_lane_that_nobody_expected_counts(small_table):
    judged = audit(small_table)
    for time in range(4):
        judged.judge(seen(float(time), [(0, 1060.0 + 25.0 * time, 3 - (time == 3), 25.0)]), Target(1, 24.0))
    assert judged.summary()["prediction_lane_3s"] == 0.0


def test_where_there_was_nobody_there_is_no_error(small_table):
    judged = audit(small_table)
    for time in range(4):
        judged.judge(seen(float(time), []), Target(1, 24.0))
    found = judged.summary()
    assert math.isnan(found["prediction_error_3s"])
    assert found["prediction_samples_1s"] == 0
