"""Whom a rogue follows: whoever ahead of it leaves it the least room, seen from both lanes that it is in."""

import numpy as np
import pytest
from rogue_scenes import LENGTH, SPEED, seen

from hj_cosim.scene.road import StraightRoad
from hj_cosim.settings import DriverSettings, RogueLimits
from hj_cosim.traffic.rogues.contract import CarInput
from hj_cosim.traffic.rogues.restraint import OwnCar, moved, ordinary_input, restrained
from hj_cosim.vehicles.idm import idm_acceleration, mean_driver

ROAD, LIMITS = StraightRoad(4), RogueLimits()
BETWEEN, LEFT_LANE, RIGHT_LANE = 6.0, 8.0, 4.0  # m across the road
AWAY = (300.0, LEFT_LANE, SPEED, LENGTH)  # too far to be followed
MINE = OwnCar(0, mean_driver(DriverSettings()))


def kept(*cars):
    """Return the acceleration of a rogue between two lanes that wants more than its car can."""
    wanted = CarInput(0.0, 10.0)
    return restrained(wanted, seen([(0.0, BETWEEN, SPEED, LENGTH), *cars]), MINE, ROAD, LIMITS).acceleration


def test_a_rogue_between_two_lanes_brakes_for_the_truck_whose_rear_is_nearer_than_that_of_the_nearer_centre():
    car, truck = (40.0, LEFT_LANE, 30.0, LENGTH), (42.0, RIGHT_LANE, 5.0, 18.0)
    assert kept(car, truck) == kept(AWAY, truck) < -4.0
    assert kept(car, AWAY) > 3.0


def test_a_rogue_between_two_lanes_brakes_for_who_stands_beyond_a_nearer_rear_that_is_fast():
    fast, standing = (20.0, LEFT_LANE, 30.0, LENGTH), (45.0, RIGHT_LANE, 0.0, LENGTH)
    assert kept(fast, standing) == kept(AWAY, standing) < -4.0
    assert kept(fast, AWAY) > 1.0


def test_a_rogue_between_two_lanes_stops_behind_a_truck_though_the_centre_of_a_car_is_nearer():
    state, step = np.array([0.0, BETWEEN, 0.0, SPEED]), 0.1
    standing = [(98.0, LEFT_LANE, 0.0, LENGTH), (100.0, RIGHT_LANE, 0.0, 18.0)]
    for _ in range(250):
        now = seen([(state[0], state[1], state[3], LENGTH), *standing])
        state, _ = moved(state, restrained(CarInput(0.0, 10.0), now, MINE, ROAD, LIMITS), LIMITS, step)
    assert state[3] < 0.5
    assert 1.0 < 100.0 - state[0] - 0.5 * (18.0 + LENGTH) < 3.0


def test_an_idle_rogue_follows_the_nearest_rear_ahead_not_the_nearest_centre():
    me, truck = (0.0, 5.0, SPEED, LENGTH), (42.0, 4.0, 12.0, 18.0)
    leaves = (40.0, 6.9, 24.0, LENGTH)  # a car that is half in the lane to the left
    expected = idm_acceleration(SPEED, 42.0 - 0.5 * (18.0 + LENGTH), 12.0, MINE.driver)
    assert ordinary_input(seen([me, leaves, truck]), MINE, ROAD, LENGTH).acceleration == pytest.approx(expected)
    alone = ordinary_input(seen([me, leaves]), MINE, ROAD, LENGTH).acceleration
    assert alone == pytest.approx(idm_acceleration(SPEED, 35.0, 24.0, MINE.driver))
