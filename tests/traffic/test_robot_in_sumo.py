"""The traps of SUMO around a vehicle that is moved from outside, each with the real libsumo."""

import logging
import math

import libsumo
import numpy as np
import pytest

from hj_cosim.settings import CarStart
from hj_cosim.traffic.sumo.puppet import GHOST, ROBOT
from hj_cosim.traffic.sumo.world import SumoWorld
from hj_cosim.vehicles.idm import idm_acceleration

STEP = 0.02
LANE_WIDTH = 4.0
EMERGENCY_BRAKING = 9.0  # m/s², what SUMO lets a passenger car brake at most


def free_acceleration(world: SumoWorld, car: int, speed: float) -> float:
    return idm_acceleration(speed, math.inf, 0.0, world.drivers[car])


def followers(lanes: list[int], gap: float = 25.0, speed: float = 20.0) -> list[CarStart]:
    """Return a car in each lane, its front bumper `gap` m behind the robot's rear one."""
    return [CarStart(lane=lane, x=-gap - 5.0, speed=speed, desired_speed=30.0) for lane in lanes]


def put(world: SumoWorld, y: float, speed: float) -> None:
    """Move the robot one step along the road, at a lateral offset."""
    x = world.observe().robot[0]
    world.step(np.array([x + speed * STEP, y, 0.0, speed]), 0.0)


def steer(world: SumoWorld, y: float, speed: float) -> None:
    """Move the robot one step straight to a lateral offset, heading there."""
    x, y_before, _, _ = world.observe().robot
    heading = math.asin((y - y_before) / (speed * STEP))
    world.step(np.array([x + speed * STEP * math.cos(heading), y, heading, speed]), 0.0)


def reacting(world: SumoWorld, speeds_before: np.ndarray) -> list[int]:
    """Return the lanes whose car does not accelerate as on a free road."""
    now = world.observe()
    free = [free_acceleration(world, car, speed) for car, speed in enumerate(speeds_before)]
    return now.lane[np.abs(now.acceleration - free) > 1e-3].tolist()


def lanes_that_see(y: float) -> list[int]:
    """Return the lanes whose drivers notice the robot at a lateral offset."""
    return np.flatnonzero(np.abs(y - LANE_WIDTH * np.arange(4)) < 0.5 * LANE_WIDTH + 1.0).tolist()


def test_a_robot_centred_in_a_lane_is_seen_in_that_lane_only(open_scene):
    world = open_scene(followers([0, 1, 2, 3]), lane=1)
    put(world, 4.0, 20.0)
    for _ in range(50):
        before = world.observe().speed
        put(world, 4.0, 20.0)
        assert reacting(world, before) == [1]


@pytest.mark.parametrize("y", [5.05, 5.5, 6.0 - 1e-9, 6.0, 6.5, 6.95])
def test_a_robot_that_straddles_two_lanes_is_seen_in_both(open_scene, y):
    world = open_scene(followers([0, 1, 2, 3]), lane=1)
    put(world, y, 20.0)
    put(world, y, 20.0)  # others react a step after they see it
    for _ in range(25):
        before = world.observe().speed
        put(world, y, 20.0)
        assert reacting(world, before) == [1, 2]


def test_a_robot_with_nothing_but_its_front_across_the_line_is_seen_on_both_sides(open_scene):
    world = open_scene(followers([0, 1, 2, 3]), lane=1)
    for step in range(20):
        before = world.observe()
        world.step(np.array([before.robot[0] + 20.0 * STEP, 4.9, 0.5, 20.0]), 0.0)
        if step >= 2:
            assert reacting(world, before.speed) == [1, 2]


def test_followers_of_a_straddling_robot_keep_their_distance_to_its_body(open_scene):
    world = open_scene(followers([1, 2]), lane=1)
    for _ in range(2):
        put(world, 6.0, 20.0)
    before = world.observe()
    put(world, 6.0, 20.0)
    gap = before.robot[0] - before.x - 5.0
    expected = [idm_acceleration(before.speed[car], gap[car], 20.0, world.drivers[car]) for car in range(2)]
    np.testing.assert_allclose(world.observe().acceleration, expected, atol=1e-3)


def test_a_lane_is_free_at_once_when_the_robot_has_left_it(open_scene):
    world = open_scene(followers([1, 2]), lane=1)
    lateral = np.append(np.linspace(4.0, 8.0, 151), np.full(20, 8.0))
    left_at = int(np.flatnonzero(lateral >= 7.0)[0])
    for step, y in enumerate(lateral):
        before = world.observe().speed
        put(world, y, 20.0)
        if step > left_at:  # the cars act on what they saw when the step began
            assert reacting(world, before) == [2], f"at y = {y:.2f}"


def test_a_robot_that_steered_out_of_a_lane_is_in_nobodys_way_there(open_scene):
    """Its front crosses the line before its centre does; SUMO must not be left to move it over by itself."""
    slower = [CarStart(lane=lane, x=x, speed=14.0, desired_speed=14.0) for lane, x in ((1, 40.0), (3, 30.0))]
    world = open_scene(slower, lane=1)
    smooth = 0.5 - 0.5 * np.cos(np.linspace(0.0, np.pi, 151))
    for y in np.concatenate([4.0 + 4.0 * smooth, np.full(400, 8.0)]):
        before = world.observe()
        steer(world, float(y), 20.0)
        if before.robot[1] >= 7.0:
            assert reacting(world, before.speed) == [], f"at y = {y:.2f}"
    assert world.observe().robot[0] > world.observe().x.max() + 5.0


def test_a_lane_change_of_the_robot_makes_nobody_see_it_halt(open_scene):
    world = open_scene(followers([1, 2], gap=60.0), lane=1)
    for y in np.append(np.linspace(4.0, 8.0, 151), np.full(20, 8.0)):
        put(world, y, 20.0)
        assert libsumo.vehicle.getSpeed(ROBOT) == pytest.approx(20.0, abs=1e-6)
        assert libsumo.vehicle.getLaneIndex(ROBOT) == world.road.lane_at(y, 0.0)
        if GHOST in libsumo.vehicle.getIDList():
            assert libsumo.vehicle.getSpeed(GHOST) == pytest.approx(20.0, abs=1e-6)
        assert world.observe().acceleration.min() > -1.0


def test_the_lane_that_the_robot_returns_to_sees_it_again(open_scene):
    world = open_scene(followers([1, 2], gap=40.0), lane=1)
    for y in np.concatenate([np.linspace(4.0, 8.0, 60), np.linspace(8.0, 4.0, 60), np.full(3, 4.0)]):
        before = world.observe().speed
        put(world, y, 20.0)
    assert reacting(world, before) == [1]


@pytest.mark.parametrize("speed", [35.0, 40.0])
def test_sumo_reports_the_robot_at_its_own_speed_also_above_the_traffics(open_scene, speed):
    world = open_scene([CarStart(lane=1, x=500.0, speed=20.0)], speed=speed)
    for _ in range(5):
        put(world, 4.0, speed)
    assert libsumo.vehicle.getSpeed(ROBOT) == pytest.approx(speed, abs=1e-6)


def test_sumo_holds_the_robot_where_we_put_it(open_scene):
    world = open_scene([], lane=1)
    random = np.random.default_rng(7)
    x, y, heading, speed = world.observe().robot
    for _ in range(300):
        speed = float(np.clip(speed + random.normal(0.0, 0.1), 5.0, 40.0))
        heading = float(np.clip(heading + random.normal(0.0, 0.01), -0.2, 0.2))
        x, y = x + speed * math.cos(heading) * STEP, float(np.clip(y + speed * math.sin(heading) * STEP, -1.0, 13.0))
        world.step(np.array([x, y, heading, speed]), 0.0)
        front_x, front_y = libsumo.vehicle.getPosition(ROBOT)
        assert front_x - 2.5 * math.cos(heading) == pytest.approx(x, abs=1e-6)
        assert front_y - 2.5 * math.sin(heading) == pytest.approx(y, abs=1e-6)
        assert math.radians(90.0 - libsumo.vehicle.getAngle(ROBOT)) == pytest.approx(heading, abs=1e-6)


def test_a_car_that_cuts_in_ahead_is_observed_in_the_same_step(open_scene, coast):
    cars = [
        CarStart(lane=2, x=60.0, speed=20.0, desired_speed=25.0),
        CarStart(lane=2, x=100.0, speed=12.0, desired_speed=12.0),
        CarStart(lane=3, x=60.0, speed=20.0, desired_speed=20.0),
    ]
    world = open_scene(cars, lane=1, speed=18.0, mobil=True)
    moved_at = seen_at = None
    for step in range(100):
        coast(world)
        if moved_at is None and libsumo.vehicle.getLateralLanePosition("car_0") != 0.0:
            moved_at = step
        seen = world.observe()
        if seen_at is None and seen.target_lane[0] == 1:
            seen_at = step
            assert seen.y[0] < 8.0
    assert moved_at is not None
    assert seen_at == moved_at


def test_a_follower_does_not_brake_for_a_slower_robot_on_its_left(open_scene):
    cars = [CarStart(lane=1, x=-60.0, speed=29.0, desired_speed=30.0)]
    world = open_scene(cars, lane=2, speed=20.0)
    for _ in range(600):  # it comes up, draws level, and goes by
        before = world.observe().speed
        put(world, 8.0, 20.0)
        assert reacting(world, before) == []
    assert world.observe().x[0] > world.observe().robot[0]


def test_the_ghost_is_in_sumo_but_in_no_observation(open_scene):
    world = open_scene(followers([1, 2]), lane=1)
    for _ in range(3):
        put(world, 6.0, 20.0)
    assert GHOST in libsumo.vehicle.getIDList()
    seen = world.observe()
    assert [world.vehicle_names[number] for number in seen.vehicle] == ["car_0", "car_1"]
    assert len(world.drivers) == 2
    for y in (7.5, 8.0):
        put(world, y, 20.0)
    assert GHOST not in libsumo.vehicle.getIDList()


def test_sumos_warnings_about_the_ghost_are_told_of_the_robot_or_not_at_all(open_scene, caplog):
    world = open_scene([CarStart(lane=2, x=5.5, speed=15.0, desired_speed=15.0)], lane=1)
    for y in np.append(np.linspace(4.0, 7.0, 40), np.linspace(7.0, 4.0, 40)):  # it crowds the car, crosses, and returns
        put(world, y, 20.0)
    with caplog.at_level(logging.WARNING, logger="hj_cosim.traffic.sumo.session"):
        world.close()
    assert any("'robot'; collision with vehicle 'car_0'" in message for message in caplog.messages)
    assert "'robot'; collision with vehicle 'robot'" not in caplog.text
    assert "ghost" not in caplog.text


def test_no_ghost_stands_beside_the_road(open_scene):
    world = open_scene([], lane=0)
    for y in (-1.5, -1.9):
        put(world, y, 20.0)
        assert libsumo.vehicle.getIDList() == (ROBOT,)


def test_a_robot_that_weaves_is_seen_in_the_lanes_that_it_is_in_and_blocks_no_other(open_scene):
    cars = [CarStart(lane=lane, x=-60.0, speed=15.0, desired_speed=15.0) for lane in range(4)]
    world = open_scene(cars, lane=1, speed=15.0)
    compared = 0
    for y in 6.0 + 4.0 * np.sin(np.linspace(-math.pi / 6, 40.0, 2500)):
        before = world.observe()
        steer(world, float(y), 15.0)
        if lanes_that_see(before.robot[1]) == lanes_that_see(y):  # in the step in which they change, either is right
            assert reacting(world, before.speed) == lanes_that_see(y), f"at y = {y:.2f}"
            compared += 1
    assert compared > 2400


@pytest.mark.parametrize(("y", "lane"), [(4.0, 1), (6.5, 1), (6.5, 2)], ids=["centred", "straddling", "beside"])
def test_who_comes_behind_follows_the_car_that_the_robot_has_driven_through(open_scene, y, lane):
    cars = [
        CarStart(lane=lane, x=9.03, speed=15.0, desired_speed=15.0),
        CarStart(lane=lane, x=-30.0, speed=15.0, desired_speed=20.0),
    ]
    world = open_scene(cars, lane=1, speed=20.0)
    for _ in range(250):
        before = world.observe()
        put(world, y, 20.0)
        now = world.observe()
        robot_gap = before.robot[0] - before.x[0] - 5.0
        if robot_gap > 0.0:
            gap = before.x[0] - before.x[1] - 5.0
            expected = [
                idm_acceleration(before.speed[0], robot_gap, 20.0, world.drivers[0]),
                idm_acceleration(before.speed[1], gap, before.speed[0], world.drivers[1]),
            ]
            np.testing.assert_allclose(now.acceleration, np.maximum(expected, -EMERGENCY_BRAKING), atol=1e-3)
        assert now.x[0] - now.x[1] > 5.0
    assert robot_gap > 5.0


def test_the_robot_keeps_its_place_and_speed_in_sumo_while_it_drives_through_a_car(open_scene):
    world = open_scene([CarStart(lane=1, x=8.0, speed=15.0, desired_speed=15.0)], lane=1, speed=20.0)
    for _ in range(200):
        put(world, 4.3, 20.0)
        front_x, front_y = libsumo.vehicle.getPosition(ROBOT)
        assert (front_x - 2.5, front_y) == pytest.approx((world.observe().robot[0], 4.3), abs=1e-6)
        assert libsumo.vehicle.getSpeed(ROBOT) == pytest.approx(20.0, abs=1e-6)
        assert libsumo.vehicle.getLaneID(ROBOT) == "highway_1"
    assert world.observe().x[0] < world.observe().robot[0]
