"""Lanes that begin and end among real SUMO cars: ramps, exits and a lane drop."""

from collections.abc import Iterator

import libsumo
import numpy as np
import pytest

from hj_cosim.errors import ConfigurationError
from hj_cosim.settings import (
    CarStart,
    NetworkSettings,
    RobotSettings,
    RobotStart,
    Scenario,
    StreamSettings,
    TrafficSettings,
    validate,
)
from hj_cosim.traffic.sources.scenarios import load_scenario
from hj_cosim.traffic.sumo.world import SumoWorld

RAMPS = {"file": "ramps.net.xml", "from_edge": "m0", "to_edge": "m4"}
STEP = 0.1


def world_of(scenario: Scenario, seed: int = 0) -> SumoWorld:
    return SumoWorld(scenario, RobotSettings(), seed=seed, step=STEP)


def scene(network: dict, cars: list[CarStart], streams: tuple[StreamSettings, ...] = ()) -> Scenario:
    return Scenario(
        name="scene",
        network=NetworkSettings(**network),
        traffic=TrafficSettings(count=0),
        robot=RobotStart(lane=3, speed=1.0),
        cars=tuple(cars),
        streams=streams,
    )


def drive(world: SumoWorld, seconds: float, speed: float) -> Iterator:
    """Let the robot go straight on in its lane, and yield what it sees."""
    for _ in range(round(seconds / STEP)):
        s, d, _, _ = world.observe().robot
        world.step(np.array([s + speed * STEP, d, 0.0, speed]), 0.0)
        yield world.observe()


def test_cars_on_a_ramp_are_seen_before_they_merge_and_come_over_without_a_jump():
    streams = (StreamSettings(from_edge="on_1", to_edge="m4", flow=1200.0),)
    with world_of(scene({**RAMPS, "from_edge": "m0"}, [], streams)) as world:
        paths: dict[int, list[tuple[float, float, int, float]]] = {}
        for seen in drive(world, 60.0, 1.0):
            for car, number in enumerate(seen.vehicle.tolist()):
                row = (float(seen.x[car]), float(seen.y[car]), int(seen.lane[car]), float(seen.speed[car]))
                paths.setdefault(number, []).append(row)
        assert len(paths) > 5
        merged = [np.array(path) for path in paths.values() if path[-1][2] > 0]
        assert len(merged) > 2
        for path in merged:
            assert path[0, 0] < 1200.0  # on the ramp, 300 m before it joins
            assert path[0, 1] < -15.0
            assert path[0, 2] == 0
            assert (np.diff(path[:, 0]) <= path[1:, 3] * STEP + 0.05).all()  # no leap along the road
            assert np.abs(np.diff(path[:, 1])).max() < 0.6  # nor across
            assert path[-1, 1] == pytest.approx(3.75 * path[-1, 2], abs=2.0)
        first = paths[0][0]
        assert np.isnan(world.drivers[0]).all()
        assert first[3] > 10.0


def test_cars_that_leave_are_seen_off_and_then_no_more():
    streams = (StreamSettings(from_edge="m1", to_edge="off_1", flow=1200.0),)
    with world_of(scene({**RAMPS, "from_edge": "in_1"}, [], streams)) as world:
        last: dict[int, tuple[float, float]] = {}
        for seen in drive(world, 110.0, 1.0):
            last |= {int(v): (float(x), float(y)) for v, x, y in zip(seen.vehicle, seen.x, seen.y, strict=True)}
        gone = [place for number, place in last.items() if number not in seen.vehicle]
        assert len(gone) > 5
        exit_at = 250.0 + 1250.0 + 250.0
        for x, y in gone:
            assert exit_at + 250.0 < x < exit_at + 400.0
            assert -25.5 < y < -12.0


def test_cars_in_a_lane_that_ends_leave_it_in_time_and_are_observed_to():
    cars = [CarStart(lane=0, x=60.0 * number, speed=22.0, desired_speed=22.0) for number in range(1, 6)]
    network = {"file": "lane_drop.net.xml", "from_edge": "e0", "to_edge": "e1"}
    with world_of(scene(network, cars).model_copy(update={"robot": RobotStart(lane=2, speed=1.0)})) as world:
        left_from = {}
        for seen in drive(world, 95.0, 1.0):
            for car, number in enumerate(seen.vehicle.tolist()):
                sumos = world._lanes.by_name[libsumo.vehicle.getLaneID(world.vehicle_names[number])].number
                assert seen.lane[car] == sumos
                if seen.target_lane[car] == 1:
                    left_from.setdefault(number, float(seen.x[car]))
        assert len(left_from) == 5
        assert max(left_from.values()) < 1950.0
        assert min(seen.x) > 2000.0


def test_nobody_changes_into_a_lane_that_ends():
    scenario = load_scenario("lane_drop")
    traffic = TrafficSettings(count=40, density=20.0)
    with world_of(scenario.model_copy(update={"traffic": traffic, "streams": ()}), seed=3) as world:
        entered = 0
        for _ in range(400):
            before = world.observe()
            s, d, _, v = before.robot
            world.step(np.array([s + v * STEP, d, 0.0, v]), 0.0)
            seen = world.observe()
            entered += int(((seen.lane[:40] == 0) & (before.lane[:40] == 1) & (seen.x[:40] > 600.0)).sum())
            for lane, x in zip(seen.lane, seen.x, strict=True):
                assert lane in world.road.lanes_at(float(x) + 2.5)
        assert entered == 0


def test_streams_are_for_routes_and_their_edges_have_to_exist():
    stream = {"from_edge": "a", "to_edge": "b", "flow": 100.0}
    with pytest.raises(ConfigurationError, match=r"streams need network\.route"):
        validate(Scenario, {"name": "mine", "streams": [stream]}, "mine.toml")
    with pytest.raises(ConfigurationError, match="flow"):
        validate(Scenario, {"name": "mine", "streams": [{**stream, "flow": -1.0}]}, "mine.toml")
