"""Who is ahead of a rogue, and beside it, against lists made by hand from random traffic."""

import math

import numpy as np
import pytest

from hj_cosim.scene.observation import Cars
from hj_cosim.settings import DriverSettings
from hj_cosim.traffic.rogues.neighbours import acceleration_behind_all, car_ahead, room_beside
from hj_cosim.vehicles.idm import idm_acceleration, mean_driver

DRIVER = mean_driver(DriverSettings())
OWN, REACH, DISTANCE = 3, 2.0, 2.0


@pytest.fixture(params=range(20))
def cars(request):
    random = np.random.default_rng(request.param)
    count = 14
    x, y = random.uniform(0.0, 90.0, count), random.uniform(0.0, 12.0, count)
    size = random.choice([5.0, 12.0], count), random.choice([1.8, 2.5], count)
    return Cars(np.arange(count), x, y, np.zeros(count), random.uniform(5.0, 30.0, count), *size)


def rears_ahead(cars):
    """Return the gaps and the speeds of all that are ahead within reach."""
    me = (cars.x[OWN], cars.y[OWN], cars.length[OWN])
    rows = zip(cars.x, cars.y, cars.length, cars.speed, strict=True)
    return [
        (x - 0.5 * length - (me[0] + 0.5 * me[2]), speed)
        for x, y, length, speed in rows
        if x > me[0] and abs(y - me[1]) < REACH
    ]


def test_the_car_ahead_is_the_one_with_the_nearest_rear(cars):
    expected = min(rears_ahead(cars), default=(math.inf, 0.0))
    assert car_ahead(cars, OWN, REACH) == pytest.approx(expected)


@pytest.mark.parametrize("to_end", [7.0, 50.0, math.inf])
def test_nobody_ahead_and_no_end_of_the_lane_is_followed_less_than_idm_asks(cars, to_end):
    followed = [*rears_ahead(cars), (to_end, 0.0)]
    expected = min(idm_acceleration(cars.speed[OWN], gap, speed, DRIVER) for gap, speed in followed)
    assert acceleration_behind_all(cars, OWN, REACH, to_end, DRIVER) == pytest.approx(expected)


def test_the_room_beside_reaches_to_the_nearest_side_on_either_hand(cars):
    sides = {1.0: [math.inf], -1.0: [math.inf]}
    for other in np.flatnonzero(np.arange(len(cars.x)) != OWN):
        bumpers = abs(cars.x[other] - cars.x[OWN]) - 0.5 * cars.length[other] - 0.5 * cars.length[OWN]
        aside = cars.y[other] - cars.y[OWN]
        if bumpers < DISTANCE:
            sides[np.sign(aside)].append(abs(aside) - 0.5 * cars.width[other] - 0.5 * cars.width[OWN])
    assert room_beside(cars, OWN, DISTANCE) == pytest.approx((min(sides[-1.0]), min(sides[1.0])))


def test_whoever_is_alone_has_nobody_ahead_and_all_the_room_there_is(cars):
    alone = Cars(*(column[:1] for column in cars))
    assert car_ahead(alone, 0, REACH) == (math.inf, 0.0)
    assert room_beside(alone, 0, DISTANCE) == (math.inf, math.inf)
