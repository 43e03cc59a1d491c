"""The robot as a mean driver before it takes over, in the world without SUMO."""

import numpy as np
import pytest

from hj_cosim.settings import CarStart, DriverSettings
from hj_cosim.traffic.contract import World
from hj_cosim.traffic.fake import FakeWorld
from hj_cosim.traffic.settling import follow_lane, robot_driver
from hj_cosim.vehicles.idm import idm_acceleration


def test_it_follows_the_nearest_car_ahead_in_its_lane_as_idm_does():
    cars = [CarStart(lane=1, x=x, speed=18.0) for x in (90.0, 35.0, -20.0)] + [CarStart(lane=2, x=8.0, speed=3.0)]
    world = FakeWorld(cars, robot_start=(100.0, 4.0, 0.0, 22.0))
    driver = robot_driver(DriverSettings(), 24.0)
    state, acceleration = follow_lane(world.observe(), driver, world.road, 5.0, 0.02)
    assert acceleration == pytest.approx(idm_acceleration(22.0, 30.0, 18.0, driver))
    speed = 22.0 + 0.02 * acceleration
    np.testing.assert_allclose(state, [100.0 + 0.02 * speed, 4.0, 0.0, speed])


def test_it_accelerates_freely_to_its_own_speed_and_never_backs():
    driver = robot_driver(DriverSettings(), 24.0)
    world = FakeWorld(robot_start=(0.0, 4.0, 0.0, 10.0))
    world.settle(60.0)
    assert world.observe().robot[3] == pytest.approx(10.0, abs=0.01)  # the speed that it started with is its own
    blocked = FakeWorld([CarStart(lane=1, x=5.5, speed=0.0)], robot_start=(0.0, 4.0, 0.0, 0.05))
    state, acceleration = follow_lane(blocked.observe(), driver, blocked.road, 5.0, 0.02)
    assert state[3] == 0.0
    assert acceleration == pytest.approx(-0.05 / 0.02)


def test_the_world_without_sumo_keeps_the_worlds_promises():
    world: World = FakeWorld([CarStart(lane=0, x=10.0, speed=20.0), CarStart(lane=3, x=-5.0, speed=30.0)])
    with world:
        before = world.observe()
        world.step(np.array([1.0, 4.5, 0.1, 25.0]), 0.5)
        after = world.observe()
        assert world.vehicle_names == ["car_0", "car_1"]
        assert world.drivers.shape == (2, 6)
    assert (before.time, after.time) == (0.0, 0.02)
    assert after.robot.tolist() == [1.0, 4.5, 0.1, 25.0]
    assert after.robot_acceleration == 0.5
    np.testing.assert_allclose(after.x - before.x, [0.4, 0.6])
    assert after.y.tolist() == [0.0, 12.0]
    assert before.robot[0] == 0.0


def test_settling_ends_at_time_zero():
    world = FakeWorld([CarStart(lane=0, x=10.0, speed=20.0)])
    world.settle(1.0)
    seen = world.observe()
    assert seen.time == 0.0
    assert seen.x[0] == pytest.approx(30.0)
