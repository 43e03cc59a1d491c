"""What a recorder makes of one sample."""

import math

import numpy as np
import pytest

from hj_cosim.control.contract import FilterDecision
from hj_cosim.cosim.recorder import Recorder
from hj_cosim.planning.contract import IDLE, Plan
from hj_cosim.recording.record import NO_VEHICLE
from hj_cosim.scene.observation import NOBODY, CarValues, Control, Observation, Target
from hj_cosim.scene.road import StraightRoad
from hj_cosim.settings import RobotSettings


@pytest.mark.parametrize(
    ("least", "nearest", "value", "vehicle"), [(7.5, 0, 7.5, 3), (math.nan, NOBODY, math.inf, NO_VEHICLE)]
)
def test_v_of_the_nearest_car_is_recorded_and_infinity_where_it_is_not_known(least, nearest, value, vehicle):
    ones = np.ones(1)
    seen = Observation(
        time=0.0, robot=np.array([0.0, 0.0, 0.0, 20.0]), robot_acceleration=0.0, vehicle=np.array([3]), x=50.0 * ones,
        y=ones, heading=0.0 * ones, speed=ones, acceleration=ones, lane=np.array([0]), target_lane=np.array([0]),
        length=5.0 * ones, width=2.0 * ones,
    )  # fmt: skip
    recorder = Recorder(1, 1)
    values = CarValues(np.array([least]), np.zeros((1, 5)), least, nearest)
    control = Control(0.0, 0.0)
    recorder.record(seen, values, Plan(IDLE, Target(0, 20.0)), control, FilterDecision(control), 0.0)
    record = recorder.finish(StraightRoad(4), RobotSettings(), [f"car{number}" for number in range(4)], "duration")
    assert (record.robot.value[0], record.robot.value_vehicle[0]) == (value, vehicle)
