"""Cars that enter while the robot drives, whoever inserts them, and those that leave."""

import libsumo
import numpy as np
import pytest

from hj_cosim.settings import CarStart
from hj_cosim.vehicles.idm import idm_acceleration

STEP = 0.02


def insert(name: str, lane: int, front: float, speed: float) -> None:
    """Let SUMO insert a car of the first car's type, in the next step."""
    libsumo.vehicle.add(
        name, "road", "car_0", departLane=str(lane), departPos=str(front), departSpeed=str(speed), depart="now"
    )


@pytest.fixture
def world(open_scene, coast):
    """Return a world with two cars in it, and one that entered a second after the beginning."""
    cars = [CarStart(lane=lane, x=100.0, speed=20.0, desired_speed=20.0) for lane in (0, 3)]
    opened = open_scene(cars, lane=1)
    for _ in range(50):
        coast(opened)
    x = opened.observe().robot[0]
    insert("late", 2, x + 62.5, 15.0)
    coast(opened)
    return opened


def test_a_car_that_enters_later_is_observed_from_then_on_under_the_next_number(world, coast):
    assert world.vehicle_names == ["car_0", "car_1", "late"]
    seen = world.observe()
    assert seen.vehicle.tolist() == [0, 1, 2]
    assert (seen.lane[2], seen.target_lane[2], seen.y[2]) == (2, 2, 8.0)
    assert seen.speed[2] == 15.0
    assert seen.length[2] == 5.0
    for _ in range(100):
        before = seen
        coast(world)
        seen = world.observe()
        assert seen.x[2] + 2.5 == pytest.approx(libsumo.vehicle.getLanePosition("late"), abs=1e-9)
        assert seen.speed[2] == pytest.approx(libsumo.vehicle.getSpeed("late"), abs=1e-8)
        assert seen.acceleration[2] == pytest.approx((seen.speed[2] - before.speed[2]) / STEP, abs=1e-8)


def test_only_the_drivers_of_our_own_cars_are_known(world):
    drivers = world.drivers
    assert drivers.shape == (3, 6)
    assert drivers[0, 0] == 20.0
    assert np.isfinite(drivers[:2]).all()
    assert np.isnan(drivers[2]).all()


def test_a_late_car_is_followed_and_reacts_like_any_other(world, coast):
    x = world.observe().robot[0]
    insert("behind the robot", 1, x - 57.5, 20.0)
    coast(world)
    before = world.observe()
    coast(world)
    driver = world.drivers[0]
    gap = before.robot[0] - before.x[3] - 5.0
    assert world.observe().acceleration[3] == pytest.approx(
        idm_acceleration(before.speed[3], gap, 20.0, driver), abs=1e-3
    )


def test_the_change_of_a_car_that_sumo_has_change_lanes_is_observed_from_its_first_step(world, coast):
    libsumo.vehicle.changeLane("late", 3, 10.0)
    lateral, targets = [], []
    for _ in range(170):
        coast(world)
        seen = world.observe()
        lateral.append(float(seen.y[2]))
        targets.append(int(seen.target_lane[2]))
        offset = libsumo.vehicle.getLateralLanePosition("late")
        assert seen.y[2] == pytest.approx(4.0 * libsumo.vehicle.getLaneIndex("late") + offset, abs=1e-9)
    moving = np.flatnonzero(np.array(lateral) != 8.0)
    assert lateral[-1] == 12.0
    assert set(targets[moving[0] :]) == {3}
    assert set(targets[: moving[0]]) <= {2}


def test_one_of_ours_overtakes_a_late_car(open_scene, coast):
    world = open_scene([CarStart(lane=0, x=-40.0, speed=20.0, desired_speed=25.0)], lane=3, mobil=True)
    coast(world)
    insert("slow", 0, float(world.observe().x[0]) + 120.0, 15.0)
    coast(world)
    assert world.vehicle_names == ["car_0", "slow"]
    libsumo.vehicle.setMaxSpeed("slow", 15.0)
    assert world.observe().target_lane[0] == 0
    for _ in range(800):
        coast(world)
    seen = world.observe()
    assert seen.y.tolist() == [4.0, 0.0]
    assert seen.speed[0] > 22.0


def test_a_car_that_leaves_keeps_its_number_and_the_next_one_gets_a_new_one(world, coast):
    libsumo.vehicle.moveTo("car_1", "highway_3", 9990.0)
    for _ in range(60):
        coast(world)
    assert world.observe().vehicle.tolist() == [0, 2]
    insert("another", 3, float(world.observe().robot[0]) + 80.0, 20.0)
    coast(world)
    assert world.vehicle_names == ["car_0", "car_1", "late", "another"]
    seen = world.observe()
    assert seen.vehicle.tolist() == [0, 2, 3]
    assert seen.lane.tolist() == [0, 2, 3]
    assert len(world.drivers) == 4
