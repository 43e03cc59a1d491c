"""How real background traffic is: measures of traffic that is known, and their verdicts."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from hj_cosim.locations import scenarios_folder
from hj_cosim.scene.observation import Observation
from hj_cosim.scene.road import StraightRoad
from hj_cosim.traffic.route import read_network
from hj_cosim.traffic.sources.scenarios import load_scenario
from hj_cosim.verification.realism import CAPACITY, HEADWAY, findings
from hj_cosim.verification.traffic_measures import Lanes, measure_traffic

TWO_LANES = StraightRoad(2, length=20_000.0)
SPACING, SPEED, STEP = 50.0, 20.0, 0.1
CARS = 200  # a lane


def platoon(seconds=2.0, robot_x=-1000.0):
    """Return two lanes of evenly spaced cars that drive on at one speed, and the robot far behind."""
    lane = np.repeat([0, 1], CARS)
    start = np.tile(SPACING * np.arange(CARS), 2)
    zero = np.zeros(2 * CARS)
    for time in np.arange(0.0, seconds, STEP):
        yield Observation(
            *(time, np.array([robot_x + SPEED * time, 0.0, 0.0, SPEED]), 0.0, np.arange(2 * CARS)),
            *(start + SPEED * time, 4.0 * lane, zero, np.full(2 * CARS, SPEED), zero, lane, lane),
            *(np.full(2 * CARS, 5.0), np.full(2 * CARS, 2.0)),
        )


def test_a_platoon_has_the_flow_density_and_headways_that_it_was_made_with():
    found = measure_traffic([platoon()], STEP, TWO_LANES)
    assert found.density == pytest.approx(1000.0 / SPACING, rel=0.01)
    assert found.flow == pytest.approx(3.6 * SPEED * 1000.0 / SPACING, rel=0.01)
    assert found.speed == pytest.approx(SPEED)
    assert found.headway_median == pytest.approx((SPACING - 5.0) / SPEED)
    assert (found.lane_changes, found.short_headway_percent, found.critical_ttc_percent) == (0.0, 0.0, 0.0)
    assert math.isnan(found.ttc_p1)


def test_flow_and_density_are_per_lane_that_there_is():
    scenario = load_scenario("lane_drop")
    road, _ = read_network(scenarios_folder() / scenario.network.file, scenario.network)
    places = np.array([start for start in road.section_start if start < road.length] + [road.length])
    counts = road.lanes_there
    assert set(counts) == {2, 3}
    for begins, ends, count in zip(places[:-1], places[1:], counts, strict=True):
        assert Lanes.of(road).between(begins, ends) == pytest.approx(count * (ends - begins), abs=10.0)
    assert Lanes.of(road).between(0.0, road.length) == pytest.approx(np.sum(counts * np.diff(places)), abs=20.0)


def test_lane_changes_are_counted_per_kilometre_driven():
    def changing():
        for number, now in enumerate(platoon()):
            lane = now.lane.copy()
            lane[:4] = 1 if number >= 7 else 0
            yield replace(now, lane=lane)

    driven = 2 * CARS * SPEED * 20 * STEP / 1000.0
    assert measure_traffic([changing()], STEP, TWO_LANES).lane_changes == pytest.approx(4 / driven)
    twice = measure_traffic([changing(), changing()], STEP, TWO_LANES)
    assert twice.lane_changes == pytest.approx(4 / driven)


def test_who_closes_in_has_a_time_to_collision_and_who_is_near_a_short_headway():
    def hurried():
        for now in platoon(seconds=STEP):
            speed, x = now.speed.copy(), now.x.copy()
            x[10] = x[11] - 15.0  # a gap of 10 m
            speed[10] = 25.0  # closing at 5 m/s
            yield replace(now, speed=speed, x=x)

    found = measure_traffic([hurried()], STEP, TWO_LANES)
    pairs = 2 * (CARS - 1)
    assert found.ttc_p1 == pytest.approx(10.0 / 5.0)
    assert found.critical_ttc_percent == pytest.approx(100.0 / (pairs - 1), rel=0.01)
    assert found.short_headway_percent == pytest.approx(100.0 / (pairs - 1), rel=0.01)


def test_the_robot_is_nobody_s_leader_and_follows_nobody():
    def beside_the_robot():
        for now in platoon(seconds=STEP):
            yield replace(now, robot=np.array([now.x[50] + 6.0, 0.0, 0.0, 1.0]))

    found = measure_traffic([beside_the_robot()], STEP, TWO_LANES)
    assert found.headway_median == pytest.approx((SPACING - 5.0) / SPEED)
    assert (found.short_headway_percent, found.critical_ttc_percent) == (0.0, 0.0)


def test_the_robot_is_in_the_lane_that_it_is_nearest_to_whoever_is_nearest_to_it_across_the_road():
    """It drives between one that closes in and the next; a car of lane 1 that comes over is nearer to its line."""

    def between_two():
        for now in platoon(seconds=STEP):
            x, y, speed = now.x.copy(), now.y.copy(), now.speed.copy()
            x[50], speed[50], y[CARS + 3] = x[51] - 20.0, 30.0, 0.6
            yield replace(now, x=x, y=y, speed=speed, robot=np.array([x[51] - 10.0, 0.5, 0.0, 20.0]))

    assert measure_traffic([between_two()], STEP, TWO_LANES).critical_ttc_percent == 0.0


def test_verdicts_say_where_a_value_lies():
    assert [CAPACITY.verdict(value) for value in (100.0, 2101.0)] == ["within", "above"]
    assert [HEADWAY.verdict(value) for value in (0.8, 1.2, math.nan)] == ["below", "within", "nothing to measure"]
    found = {finding.quantity: finding for finding in findings(measure_traffic([platoon()], STEP, TWO_LANES))}
    assert found["speed"].verdict == "no band"  # at 1440 vehicles an hour nobody is free to choose it
    thin = replace(measure_traffic([platoon()], STEP, TWO_LANES), flow=400.0, density=5.0)
    assert {finding.quantity: finding.verdict for finding in findings(thin)}["speed"] == "below"


def test_the_command_measures_drawn_traffic_and_refuses_a_scene(call):
    options = ("--duration", 0.5, "--episodes", 1, "--json", "--set", "simulation.settle_time=0.1")
    status, out, _ = call("realism", "light", *options)
    found = json.loads(out)
    assert status == 0
    assert found["measures"]["density"] == pytest.approx(6.75, rel=0.25)
    assert {row["verdict"] for row in found["findings"]} <= {"within", "below", "above", "no band"}
    status, _, said = call("realism", "boxed_in", *options)
    assert status == 2
    assert "places all its cars by hand" in said
