"""What a recorder makes of one sample."""

import math
from dataclasses import replace

import numpy as np
import pytest

from hj_cosim.control.contract import FilterDecision
from hj_cosim.cosim.recorder import Recorder
from hj_cosim.planning.contract import IDLE, Plan
from hj_cosim.recording.record import NO_VEHICLE
from hj_cosim.scene.observation import NOBODY, CarValues, Control, Observation, Target
from hj_cosim.scene.road import StraightRoad
from hj_cosim.settings import RobotSettings


def one_car(robot_speed: float = 20.0) -> Observation:
    ones = np.ones(1)
    return Observation(
        time=0.0, robot=np.array([0.0, 0.0, 0.0, robot_speed]), robot_acceleration=0.0, vehicle=np.array([3]),
        x=50.0 * ones, y=ones, heading=0.0 * ones, speed=ones, acceleration=ones, lane=np.array([0]),
        target_lane=np.array([0]), length=5.0 * ones, width=2.0 * ones,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("constraints", "omega", "acceleration", "intervening"),
    [(0, 0.1, 1.0, False), (0, 0.1055, 1.09, False), (0, 0.1065, 1.0, True), (0, 0.1, 0.89, True), (1, 0.1, 1.0, True)],
)
def test_an_intervention_is_a_car_in_k_or_a_control_that_is_another_by_1_percent(
    constraints, omega, acceleration, intervening
):
    recorder = Recorder(1, 1, RobotSettings())
    decision = FilterDecision(Control(omega, acceleration), constraints=constraints)
    values = CarValues(np.array([7.5]), np.zeros((1, 5)), 7.5, 0)
    recorder.record(one_car(), values, Plan(IDLE, Target(0, 20.0)), Control(0.1, 1.0), decision, 0.0)
    record = recorder.finish(StraightRoad(4), RobotSettings(), [f"car{number}" for number in range(4)], "duration", {})
    assert record.robot.intervening[0] == intervening


@pytest.mark.parametrize(
    ("least", "nearest", "value", "vehicle"), [(7.5, 0, 7.5, 3), (math.nan, NOBODY, math.inf, NO_VEHICLE)]
)
def test_v_of_the_nearest_car_is_recorded_and_infinity_where_it_is_not_known(least, nearest, value, vehicle):
    recorder = Recorder(1, 1, RobotSettings())
    values = CarValues(np.array([least]), np.zeros((1, 5)), least, nearest)
    control = Control(0.0, 0.0)
    recorder.record(one_car(), values, Plan(IDLE, Target(0, 20.0)), control, FilterDecision(control), 0.0)
    record = recorder.finish(StraightRoad(4), RobotSettings(), [f"car{number}" for number in range(4)], "duration", {})
    assert (record.robot.value[0], record.robot.value_vehicle[0]) == (value, vehicle)


def test_what_the_filter_believes_is_recorded_where_it_judges_and_for_cars_that_come_later():
    recorder, control = Recorder(3, 1, RobotSettings()), Control(0.0, 0.0)
    values, plan = CarValues(np.array([7.5]), np.zeros((1, 5)), 7.5, 0), Plan(IDLE, Target(0, 20.0))
    for vehicle, belief in ((1, None), (1, np.array([0.25])), (9, np.array([0.75]))):
        decision = FilterDecision(control, belief=belief)
        recorder.record(replace(one_car(), vehicle=np.array([vehicle])), values, plan, control, decision, 0.0)
    names = [f"car{number}" for number in range(10)]
    belief = recorder.finish(StraightRoad(4), RobotSettings(), names, "duration", {}).belief
    assert belief.shape == (3, 10)
    assert (belief[1, 1], belief[2, 9]) == (0.25, 0.75)
    assert np.isnan(belief).sum() == 28


def test_a_filter_that_believes_nothing_leaves_nothing_recorded():
    recorder, control = Recorder(1, 1, RobotSettings()), Control(0.0, 0.0)
    values = CarValues(np.array([7.5]), np.zeros((1, 5)), 7.5, 0)
    recorder.record(one_car(), values, Plan(IDLE, Target(0, 20.0)), control, FilterDecision(control), 0.0)
    assert recorder.finish(StraightRoad(4), RobotSettings(), ["a", "b", "c", "d"], "duration", {}).belief is None
