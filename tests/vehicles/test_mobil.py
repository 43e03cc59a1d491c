"""MOBIL against a plain version written from Kesting, Treiber, Helbing (2007), on random traffic."""

import math

import numpy as np
import pytest

from hj_cosim.vehicles.idm import idm_acceleration
from hj_cosim.vehicles.mobil import lane_decisions, mobil_parameters

LENGTH = 5.0


class PlainMobil:
    """Cars as a list of dictionaries; every neighbour is found by looking at everybody."""

    def __init__(self, cars: list[dict], politeness: float, threshold: float, safe_braking: float):
        self.cars, self.politeness, self.threshold, self.safe_braking = cars, politeness, threshold, safe_braking

    def leader(self, me: dict, lane: int) -> dict | None:
        ahead = [car for car in self.cars if car is not me and lane in car["lanes"] and car["x"] > me["x"]]
        return min(ahead, key=lambda car: car["x"], default=None)

    def follower(self, me: dict, lane: int) -> dict | None:
        behind = [car for car in self.cars if car is not me and lane in car["lanes"] and car["x"] < me["x"]]
        return max(behind, key=lambda car: car["x"], default=None)

    @staticmethod
    def acceleration(me: dict, leader: dict | None) -> float:
        if leader is None:
            return idm_acceleration(me["v"], math.inf, 0.0, me["driver"])
        return idm_acceleration(me["v"], leader["x"] - me["x"] - LENGTH, leader["v"], me["driver"])

    def incentive(self, me: dict, lane: int) -> float:
        """Return eq. 6's left side minus its right side, or −inf where eq. 2 forbids the change."""
        new_follower, new_leader = self.follower(me, lane), self.leader(me, lane)
        old_follower, old_leader = self.follower(me, me["lane"]), self.leader(me, me["lane"])
        near = [car for car in (new_follower, new_leader) if car and abs(car["x"] - me["x"]) <= LENGTH]
        if near or (new_follower and self.acceleration(new_follower, me) < -self.safe_braking):
            return -math.inf
        own = self.acceleration(me, new_leader) - self.acceleration(me, old_leader)
        others = 0.0
        if new_follower:
            others += self.acceleration(new_follower, me) - self.acceleration(new_follower, new_leader)
        if old_follower:
            others += self.acceleration(old_follower, old_leader) - self.acceleration(old_follower, me)
        return own + self.politeness * others - self.threshold

    def decide(self, me: dict, lane_count: int) -> int:
        best, wanted = 0.0, me["lane"]
        for lane in (me["lane"] + 1, me["lane"] - 1):
            if 0 <= lane < lane_count and self.incentive(me, lane) > best:
                best, wanted = self.incentive(me, lane), lane
        return wanted


def random_traffic(seed: int, count: int = 40, lane_count: int = 4):
    random = np.random.default_rng(seed)
    position = np.sort(random.uniform(0.0, 400.0, count))
    speed = random.uniform(10.0, 28.0, count)
    lane = random.integers(0, lane_count, count)
    second_lane = np.where(random.random(count) < 0.15, np.clip(lane + random.choice([-1, 1], count), 0, 3), lane)
    drivers = random.normal([25.0, 3.0, 5.0, 1.5, 5.0, 4.0], [2.0, 0.3, 0.5, 0.15, 0.5, 0.0], (count, 6))
    return position, speed, lane, second_lane, drivers


@pytest.mark.parametrize("politeness", [0.0, 0.3, 1.0])
def test_decisions_are_those_of_a_plain_version_of_the_paper(politeness):
    changes = 0
    for seed in range(25):
        position, speed, lane, second_lane, drivers = random_traffic(seed)
        cars = [
            {"x": position[i], "v": speed[i], "lane": lane[i], "lanes": {lane[i], second_lane[i]}, "driver": drivers[i]}
            for i in range(len(position))
        ]
        plain = PlainMobil(cars, politeness, 0.2, 2.0)
        mobil = mobil_parameters(politeness, 0.2, 2.0)
        for car in range(len(position)):  # one decision at a time
            deciding = np.arange(len(position)) == car
            wanted = lane_decisions(
                deciding,
                position,
                speed,
                lane,
                second_lane,
                np.full(40, LENGTH),
                drivers,
                all_have(mobil, 40),
                lanes(40, 4),
            )
            expected = lane[car] if lane[car] != second_lane[car] else plain.decide(cars[car], 4)
            assert wanted[car] == expected
            assert np.array_equal(np.delete(wanted, car), np.delete(lane, car))
            changes += int(expected != lane[car])
    assert changes > 50


def all_have(mobil: np.ndarray, cars: int) -> np.ndarray:
    """Return that each of so many cars has the same parameters."""
    return np.tile(mobil, (cars, 1))


def lanes(cars: int, count: int) -> np.ndarray:
    """Return that each of so many cars may want any of so many lanes."""
    return np.tile([0, count - 1], (cars, 1))


def two_behind_slow_ones():
    """Return two cars side by side with a free lane between them, each behind a slow car."""
    position = np.array([0.0, 1.0, 30.0, 31.0])
    speed = np.array([25.0, 25.0, 10.0, 10.0])
    lane = np.array([0, 2, 0, 2])
    drivers = np.tile([25.0, 3.0, 5.0, 1.5, 5.0, 4.0], (4, 1))
    return position, speed, lane, drivers


def test_two_cars_that_decide_at_once_do_not_take_the_same_gap():
    position, speed, lane, drivers = two_behind_slow_ones()
    everybody = np.array([True, True, False, False])
    wanted = lane_decisions(
        everybody,
        position,
        speed,
        lane,
        lane,
        np.full(4, LENGTH),
        drivers,
        all_have(mobil_parameters(0.0, 0.2, 2.0), 4),
        lanes(4, 3),
    )
    assert wanted.tolist() == [1, 2, 0, 2]
    alone = lane_decisions(
        np.array([False, True, False, False]),
        position, speed, lane, lane, np.full(4, LENGTH), drivers,
        all_have(mobil_parameters(0.0, 0.2, 2.0), 4), lanes(4, 3),
    )  # fmt: skip
    assert alone.tolist() == [0, 1, 0, 2]


def test_politeness_keeps_a_driver_from_a_change_that_costs_others_more():
    position = np.array([-12.0, 0.0, 60.0])
    speed = np.array([24.0, 22.0, 20.0])
    lane = np.array([1, 0, 0])
    drivers = np.tile([25.0, 3.0, 5.0, 0.3, 2.0, 4.0], (3, 1))

    def wanted(politeness: float) -> int:
        mobil = all_have(mobil_parameters(politeness, 0.2, 20.0), 3)
        deciding = np.array([False, True, False])
        return lane_decisions(deciding, position, speed, lane, lane, np.full(3, LENGTH), drivers, mobil, lanes(3, 2))[1]

    assert wanted(0.0) == 1
    assert wanted(1.0) == 0


def test_nobody_wants_a_lane_that_it_may_not_use():
    position, speed, lane, drivers = two_behind_slow_ones()
    usable = lanes(4, 3)
    usable[0] = [0, 0]
    wanted = lane_decisions(
        np.array([True, True, False, False]), position, speed, lane, lane, np.full(4, LENGTH), drivers,
        all_have(mobil_parameters(0.0, 0.2, 2.0), 4), usable,
    )  # fmt: skip
    assert wanted.tolist() == [0, 1, 0, 2]
    usable[0], usable[1] = [0, 2], [2, 1]  # none at all
    wanted = lane_decisions(
        np.array([True, True, False, False]), position, speed, lane, lane, np.full(4, LENGTH), drivers,
        all_have(mobil_parameters(0.0, 0.2, 2.0), 4), usable,
    )  # fmt: skip
    assert wanted.tolist() == [1, 2, 0, 2]
