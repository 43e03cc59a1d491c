"""The background drivers' decisions on cars in any order."""

import numpy as np

from hj_cosim.traffic.lane_changes import DrivingCars, sort_nearly_sorted, wanted_lanes
from hj_cosim.vehicles.mobil import lane_decisions, mobil_parameters


def test_an_order_of_a_step_ago_is_brought_up_to_date():
    random = np.random.default_rng(0)
    position = random.uniform(0.0, 1000.0, 200)
    order = np.argsort(position)
    position += random.normal(0.0, 5.0, 200)
    sort_nearly_sorted(order, position)
    np.testing.assert_array_equal(order, np.argsort(position))


def test_the_decisions_are_those_on_the_sorted_arrays_put_back_in_place():
    random = np.random.default_rng(3)
    count = 80
    position = random.permutation(np.sort(random.uniform(0.0, 900.0, count)))
    speed = random.uniform(15.0, 28.0, count)
    lane = random.integers(0, 4, count)
    deciding = random.random(count) < 0.3
    drivers = random.normal([24.0, 3.0, 5.0, 1.5, 5.0, 4.0], [2.0, 0.3, 0.5, 0.15, 0.5, 0.0], (count, 6))
    length = np.full(count, 5.0)
    mobil = np.array([mobil_parameters(*each) for each in random.uniform([0.0, 0.1, 1.0], [1.0, 0.4, 4.0], (count, 3))])
    order = np.arange(count)
    usable = np.column_stack([random.integers(0, 2, count), random.integers(2, 4, count)])
    wanted = wanted_lanes(order, deciding, DrivingCars(position, speed, lane, lane, length, drivers, mobil), usable)
    by_position = np.argsort(position)
    expected = lane_decisions(
        *(part[by_position] for part in (deciding, position, speed, lane, lane, length, drivers, mobil, usable)),
    )
    np.testing.assert_array_equal(wanted[by_position], expected)
    assert (wanted != lane).sum() > 3
    np.testing.assert_array_equal(wanted[~deciding], lane[~deciding])
