"""Which lanes the robot is put into, without SUMO, against bodies laid over lanes by hand."""

import math

import numpy as np
import pytest

from hj_cosim.scene.road import StraightRoad
from hj_cosim.settings import RobotSettings
from hj_cosim.traffic.sumo.puppet import placement

ROAD = StraightRoad(4)


@pytest.mark.parametrize(
    ("y", "heading", "lanes"),
    [
        (4.0, 0.0, (1, 1, 1)),
        (4.99, 0.0, (1, 1, 1)),
        (5.01, 0.0, (1, 2, 1)),
        (6.01, 0.0, (2, 1, 2)),
        (7.01, 0.0, (2, 2, 2)),
        (2.99, 0.0, (1, 0, 1)),
        (-1.5, 0.0, (0, 0, 0)),
        (13.5, 0.0, (3, 3, 3)),
        (4.9, 0.5, (1, 2, 2)),
        (7.1, -0.5, (2, 1, 1)),
    ],
    ids=str,
)
def test_the_robot_is_in_the_lane_of_its_centre_and_in_the_one_that_its_body_or_front_reaches_over_to(
    y, heading, lanes
):
    put = placement(np.array([100.0, y, heading, 20.0]), RobotSettings(), ROAD)
    assert (put.lane, put.second_lane, put.front_lane) == lanes


def test_a_wider_robot_is_noticed_in_the_next_lane_sooner():
    state = np.array([100.0, 4.8, 0.0, 20.0])
    assert placement(state, RobotSettings(width=2.0), ROAD).second_lane == 1
    assert placement(state, RobotSettings(width=2.5), ROAD).second_lane == 2


def test_sumo_is_told_where_the_middle_of_the_front_bumper_is():
    put = placement(np.array([100.0, 8.0, 0.3, 20.0]), RobotSettings(length=6.0), ROAD)
    assert (put.along, put.lateral) == pytest.approx((100.0 + 3.0 * math.cos(0.3), 8.0 + 3.0 * math.sin(0.3)))
    assert put.heading == 0.3
