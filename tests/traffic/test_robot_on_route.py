"""The robot on bends, over junctions and past ends of lanes, seen by real SUMO cars as their models say."""

import math
import os
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import libsumo
import numpy as np
import pytest

from hj_cosim.errors import DriveEnded
from hj_cosim.settings import (
    CarStart,
    DriverSettings,
    NetworkSettings,
    NormalDistribution,
    RobotSettings,
    RobotStart,
    Scenario,
    TrafficSettings,
)
from hj_cosim.traffic.settling import follow_lane
from hj_cosim.traffic.sumo.puppet import GHOST, ROBOT, placement
from hj_cosim.traffic.sumo.route_puppet import OFF_THE_ROAD
from hj_cosim.traffic.sumo.world import SumoWorld
from hj_cosim.vehicles.idm import idm_acceleration

REAL = Path(os.environ.get("HJ_COSIM_REAL_NETWORKS", "no such folder"))
STEP = 0.02
# A straight of 300 m, a bend of radius 400 m, a straight, a bend of radius 600 m the other way: eight edges.
BENDS = {"file": "curves.net.xml", "from_edge": "e22", "to_edge": "e29"}

OpenRoute = Callable[..., SumoWorld]


@pytest.fixture
def open_route() -> Iterator[OpenRoute]:
    """Open a scene of a few cars on a route: `open_route(network, cars, lane=..., speed=...)`."""
    with ExitStack() as worlds:

        def open_it(network: dict, cars: list[CarStart], lane: int = 1, speed: float = 25.0) -> SumoWorld:
            means = {"max_acceleration": 3.0, "comfortable_deceleration": 5.0, "time_headway": 1.5, "minimum_gap": 5.0}
            certain = {name: NormalDistribution(mean=mean, deviation=0.0) for name, mean in means.items()}
            scenario = Scenario(
                name="scene",
                network=NetworkSettings(**network),
                traffic=TrafficSettings(count=0),
                drivers=DriverSettings(**certain, gain_threshold=1e6),
                robot=RobotStart(lane=lane, speed=speed),
                cars=tuple(cars),
            )
            return worlds.enter_context(SumoWorld(scenario, RobotSettings(), seed=0, step=STEP))

        yield open_it


def followers(lanes: range, gap: float, desired_speed: float = 32.0) -> list[CarStart]:
    return [CarStart(lane=lane, x=-gap, speed=25.0, desired_speed=desired_speed) for lane in lanes]


def steer(world: SumoWorld, lateral: float, speed: float) -> None:
    """Drive a step on, to a lateral offset, heading where that leads."""
    s, d, _, _ = world.observe().robot
    heading = math.atan2(lateral - d, speed * STEP)
    forward = speed * math.cos(heading) * STEP / world.road.stretch_at(s, d)
    world.step(np.array([s + forward, lateral, heading, speed]), 0.0)


def lanes_that_see(world: SumoWorld) -> list[int]:
    """The lanes that the robot's body, or its front's middle, is in."""
    put = placement(world.observe().robot, RobotSettings(), world.road)
    return sorted({put.lane, put.second_lane})


def test_followers_keep_idms_distance_to_a_robot_that_weaves_over_bends_and_junctions(open_route):
    world = open_route(BENDS, followers(range(3), gap=40.0, desired_speed=25.5))
    compared, edges = 0, set()
    for phase in np.linspace(-math.pi / 2, 24.0, 2300):
        before, seen_by = world.observe(), lanes_that_see(world)
        front = placement(before.robot, RobotSettings(), world.road).along
        steer(world, 3.75 * (1.0 + math.sin(phase)), 25.0)
        edges.add(libsumo.vehicle.getRoadID(ROBOT))
        assert libsumo.vehicle.getLaneID(ROBOT) != ""
        assert libsumo.vehicle.getSpeed(ROBOT) == pytest.approx(25.0, abs=1e-9)
        if lanes_that_see(world) != seen_by:
            continue  # in the step in which they change, either is right
        after = world.observe()
        for car in range(3):
            sees = int(before.lane[car]) in seen_by
            gap = front - 5.0 - (before.x[car] + 2.5) if sees else math.inf
            expected = max(idm_acceleration(before.speed[car], gap, 25.0, world.drivers[car]), -9.0)  # SUMO's hardest
            assert after.acceleration[car] == pytest.approx(expected, abs=1e-3), (before.time, car)
        compared += 1
    assert compared > 2100
    assert len(edges) > 7  # junctions' own among them, where a step ends there


def test_sumo_has_the_robots_front_where_the_road_frame_has_it(open_route):
    world = open_route(BENDS, [], speed=30.0)
    for phase in np.linspace(-math.pi / 2, 20.0, 1500):
        steer(world, 3.75 * (1.0 + math.sin(phase)), 30.0)
        put = placement(world.observe().robot, RobotSettings(), world.road)
        place = world._lanes.by_name[libsumo.vehicle.getLaneID(ROBOT)]
        position = place.start + place.scale * libsumo.vehicle.getLanePosition(ROBOT)
        assert place.number == put.front_lane
        assert position == pytest.approx(put.along, abs=0.12)
        offset = libsumo.vehicle.getLateralLanePosition(ROBOT)
        assert offset == pytest.approx(put.lateral - world.road.lane_centre(put.front_lane, put.along), abs=0.02)


@pytest.mark.parametrize("crossing_at", [250.0, 258.0, 261.0, 264.0, 297.0])
def test_the_lane_that_the_robot_left_near_a_junction_is_free(open_route, crossing_at):
    world = open_route(BENDS, followers(range(3), gap=90.0, desired_speed=26.0))
    d, settled = 3.75, 0
    for _ in range(700):
        s = world.observe().robot[0]
        if s > crossing_at:
            d = min(d + 0.03, 7.5)
        steer(world, d, 25.0)
        settled += d == 7.5
        if settled > 3:
            assert libsumo.vehicle.getShadowLaneID(ROBOT) == ""
    before = world.observe()
    assert before.robot[1] == 7.5
    steer(world, d, 25.0)
    gaps = [math.inf, math.inf, before.robot[0] - before.x[2] - 5.0]
    expected = [idm_acceleration(before.speed[car], gaps[car], 25.0, world.drivers[car]) for car in range(3)]
    np.testing.assert_allclose(world.observe().acceleration, expected, atol=1e-3)


def test_cars_that_change_lanes_on_a_bend_head_where_they_go(open_route):
    cars = [CarStart(lane=0, x=-30.0, speed=25.0, desired_speed=25.0)]
    world = open_route({**BENDS, "from_edge": "e24"}, cars, lane=2)
    libsumo.vehicle.changeLane("car_0", 1, 10.0)
    world._fleet._changing.append(0)
    headings, laterals = [], []
    for _ in range(200):
        steer(world, 7.5, 25.0)
        seen = world.observe()
        headings.append(seen.heading[0])
        laterals.append(seen.y[0])
    assert laterals[-1] == 3.75
    assert np.abs(np.diff(laterals)).max() < 0.03
    assert max(headings) == pytest.approx(math.atan2(3.75 / 3.0, 25.0), abs=2e-3)
    assert headings[-1] == 0.0


def test_no_ghost_is_left_where_a_lane_has_ended(open_route):
    world = open_route({"file": "lane_drop.net.xml", "from_edge": "e0", "to_edge": "e1"}, [], lane=1, speed=40.0)
    ghosts = []
    while world.observe().robot[0] < 2100.0:
        steer(world, 2.4, 40.0) if world.observe().robot[0] > 1900.0 else steer(world, 3.75, 40.0)
        assert libsumo.vehicle.getLaneID(ROBOT) != ""
        ghosts.append((world.observe().robot[0], GHOST in libsumo.vehicle.getIDList()))
    assert all(
        there == (1900.0 < s < 1990.0) for s, there in ghosts if not 1895.0 < s < 1905.0 and not 1985.0 < s < 2015.0
    )


def test_who_drives_off_the_road_is_told_where(open_route):
    world = open_route(BENDS, [], lane=2)
    with pytest.raises(DriveEnded, match=r"left the road at s = .* m, d = .* m \(x = ") as ended:  # noqa: PT012
        for d in np.linspace(7.5, 30.0, 300):
            steer(world, float(d), 25.0)
    assert ended.value.reason == OFF_THE_ROAD


def test_a_ring_never_ends_and_cars_stay_in_the_lap_in_which_they_are_near(open_route):
    network = {"file": "ring.net.xml", "route": [f"e{number}" for number in range(10)], "laps": 4}
    cars = [
        CarStart(lane=0, x=-40.0, speed=40.0, desired_speed=40.0),
        CarStart(lane=2, x=60.0, speed=0.0, desired_speed=0.01),
    ]
    world = open_route(network, cars, speed=40.0)
    lap = world.road.lap
    came_by = 0
    for _ in range(int(1.2 * lap / 40.0 / STEP)):
        seen = world.observe()
        steer(world, 3.75, 40.0)
        ahead = world.observe().x - world.observe().robot[0]
        assert np.abs(ahead).max() <= 0.5 * lap + 1.0
        came_by += bool(seen.x[1] - seen.robot[0] > 0.0 >= ahead[1] and abs(ahead[1]) < 100.0)
    assert abs(world.observe().x[0] - world.observe().robot[0] + 40.0) < 5.0
    assert came_by == 2


@pytest.mark.skipif(not REAL.is_dir(), reason="HJ_COSIM_REAL_NETWORKS names no folder of real networks")
def test_a_real_motorway_is_driven_to_its_end_in_its_lanes(open_route):
    network = {"file": str(REAL / "a10kw/A10KW/osm.net.xml"), "from_edge": "264306385", "to_edge": "264308376"}
    world = open_route(network, [], lane=2, speed=30.0)
    steps = 0
    while world.observe().robot[0] < world.road.length - 10.0:
        state, acceleration = follow_lane(world.observe(), world._robot_driver, world.road, 5.0, STEP)
        state[1] = 6.4 + 2.0 * math.sin(steps / 100.0)
        world.step(state, acceleration)
        assert libsumo.vehicle.getLaneID(ROBOT) != ""
        steps += 1
    assert steps > 4000
