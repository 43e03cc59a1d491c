"""The background drivers in SUMO: IDM by SUMO, MOBIL by us, the continuous change, seeds, collisions."""

import logging
import math

import libsumo
import numpy as np
import pytest

from hj_cosim.errors import DriveEnded, SimulationError
from hj_cosim.settings import CarStart, RobotSettings, RobotStart, Scenario, TrafficSettings
from hj_cosim.traffic.settling import follow_lane, robot_driver
from hj_cosim.traffic.sources.scenarios import load_scenario
from hj_cosim.traffic.sumo import fleet
from hj_cosim.traffic.sumo.world import SumoWorld
from hj_cosim.vehicles.idm import idm_acceleration

STEP = 0.02
LANE_WIDTH = 4.0


def drive(world: SumoWorld, seconds: float, driver: np.ndarray | None = None):
    """Yield the observation before and after every step; the robot coasts, or is driven by IDM."""
    after = world.observe()
    for _ in range(round(seconds / STEP)):
        before = after
        if driver is None:
            x, y, _, speed = before.robot
            world.step(np.array([x + speed * STEP, y, 0.0, speed]), 0.0)
        else:
            world.step(*follow_lane(before, driver, world.road, 5.0, STEP))
        after = world.observe()
        yield before, after


def idm_of_everybody(world: SumoWorld, seen) -> np.ndarray:
    """Return the textbook's acceleration of every car that keeps its lane, NaN for the others; written from scratch.

    A car on its way into a lane is in both; it is out of the old one when its body has left it.
    """
    left = np.abs(seen.y - LANE_WIDTH * seen.target_lane) <= 1.0
    lanes = [
        {int(seen.target_lane[car])} | (set() if left[car] else {int(seen.lane[car]), _origin(seen, car)})
        for car in range(len(seen.x))
    ]
    expected = np.full(len(seen.x), math.nan)
    for car in range(len(seen.x)):
        if seen.y[car] != LANE_WIDTH * seen.lane[car] or seen.lane[car] != seen.target_lane[car]:
            continue
        lane = int(seen.lane[car])
        ahead = [
            (seen.x[other], seen.speed[other])
            for other in range(len(seen.x))
            if seen.x[other] > seen.x[car] and lane in lanes[other]
        ]
        if round(seen.robot[1] / LANE_WIDTH) == lane and seen.robot[0] > seen.x[car]:
            ahead.append((seen.robot[0], seen.robot[3]))
        x, speed = min(ahead, default=(math.inf, 0.0))
        expected[car] = idm_acceleration(seen.speed[car], x - seen.x[car] - 5.0, speed, world.drivers[car])
    return expected


def _origin(seen, car: int) -> int:
    """Return the lane on the other side of the line that a changing car is about to cross, or has crossed."""
    offset = seen.y[car] - LANE_WIDTH * seen.lane[car]
    return int(seen.lane[car] + np.sign(offset)) if seen.lane[car] == seen.target_lane[car] else int(seen.lane[car])


def test_sumos_accelerations_are_idms_on_the_states_of_the_step_before():
    with SumoWorld(load_scenario("light"), RobotSettings(), seed=3) as world:
        compared = 0
        for before, after in drive(world, 2.6):
            expected = idm_of_everybody(world, before)
            keeps_lane = np.isfinite(expected) & (expected > -world.drivers[:, 2])  # SUMO bounds the braking
            np.testing.assert_allclose(after.acceleration[keeps_lane], expected[keeps_lane], atol=1e-3)
            compared += int(keeps_lane.sum())
    assert compared > 0.7 * 130 * 100


def test_an_observation_is_what_sumos_getters_say():
    with SumoWorld(load_scenario("light"), RobotSettings(), seed=1) as world:
        between_lanes = 0
        for _, seen in drive(world, 2.0):
            for car, name in enumerate(world.vehicle_names):
                lane = libsumo.vehicle.getLaneIndex(name)
                lateral = libsumo.vehicle.getLateralLanePosition(name)
                assert seen.lane[car] == lane
                assert seen.y[car] == pytest.approx(LANE_WIDTH * lane + lateral, abs=1e-9)
                assert seen.x[car] + 2.5 == pytest.approx(libsumo.vehicle.getLanePosition(name), abs=1e-9)
                assert seen.speed[car] == pytest.approx(libsumo.vehicle.getSpeed(name), abs=1e-8)
                assert seen.acceleration[car] == pytest.approx(libsumo.vehicle.getAcceleration(name), abs=1e-5)
                if lateral != 0.0:
                    angle = math.radians(90.0 - libsumo.vehicle.getAngle(name))
                    assert seen.heading[car] == pytest.approx(angle, abs=1e-9)
                    between_lanes += 1
    assert between_lanes > 100


def test_a_lane_change_takes_three_seconds_and_is_continuous(open_scene):
    cars = [
        CarStart(lane=0, x=60.0, speed=20.0, desired_speed=25.0),
        CarStart(lane=0, x=100.0, speed=12.0, desired_speed=12.0),
    ]
    world = open_scene(cars, lane=3, mobil=True)
    lateral = np.array([after.y[0] for _, after in drive(world, 6.0)])
    moving = np.flatnonzero(np.diff(lateral) > 1e-9)
    assert lateral[0] < 0.1
    assert lateral[-1] == LANE_WIDTH
    assert (moving[-1] - moving[0] + 2) * STEP == pytest.approx(3.0, abs=0.05)
    assert np.abs(np.diff(lateral)).max() < 1.5 * LANE_WIDTH / 3.0 * STEP


def test_drivers_overtake_where_mobil_says_so_and_only_there(open_scene):
    slow_ahead = [
        CarStart(lane=0, x=60.0, speed=20.0, desired_speed=25.0),
        CarStart(lane=0, x=100.0, speed=12.0, desired_speed=12.0),
    ]
    hindered = [CarStart(lane=1, x=48.0, speed=24.0, desired_speed=24.0)]
    world = open_scene(slow_ahead + hindered, lane=3, mobil=True)
    for _, after in drive(world, 1.0):
        assert after.target_lane[0] == 0  # its new follower would have to brake harder than is safe
    *_, (_, last) = drive(world, 6.0)
    assert last.lane[0] == 1


def test_a_change_that_sumo_finds_unsafe_is_dropped_and_not_made_later(open_scene, monkeypatch):
    cars = [CarStart(lane=lane, x=x, speed=v, desired_speed=v) for lane, x, v in ((0, 60.0, 20.0), (1, 57.0, 25.0))]
    world = open_scene(cars, lane=3)
    asked = iter([1])
    monkeypatch.setattr(fleet, "wanted_lanes", lambda *_: np.array([next(asked, 0), 1, 3]))
    states = [after for _, after in drive(world, 8.0)]
    assert states[0].target_lane[0] == 0
    assert all(after.y[0] == 0.0 for after in states)
    assert states[-1].x[1] - states[-1].x[0] > 25.0  # who was in its way has long been out of it


def test_every_car_decides_once_a_second_and_not_all_at_once():
    scenario = load_scenario("light")
    with SumoWorld(scenario, RobotSettings(), seed=0) as world:
        begun = [
            step % 50
            for step, (before, after) in enumerate(drive(world, 9.0))
            for _ in np.flatnonzero((after.target_lane != before.target_lane) & (after.y != before.y))
        ]
    assert len(begun) > 15
    assert set(begun) <= set(range(0, 50, 5))
    assert len(set(begun)) >= 5


def test_the_same_seed_gives_the_same_world_and_another_seed_another():
    def states(seed: int) -> np.ndarray:
        with SumoWorld(load_scenario("dense"), RobotSettings(), seed) as world:
            world.settle(1.0)
            seen = [after for _, after in drive(world, 3.0)]
            return np.array([[s.x, s.y, s.speed, s.acceleration, s.heading] for s in seen])

    first = states(11)
    assert first.tobytes() == states(11).tobytes()
    assert not np.array_equal(first[0], states(12)[0])


def test_whether_sumo_checks_for_collisions_changes_nothing_else():
    def last(check: bool):
        scenario = load_scenario("light")
        traffic = scenario.traffic.model_copy(update={"check_collisions": check})
        with SumoWorld(scenario.model_copy(update={"traffic": traffic}), RobotSettings(), seed=8) as world:
            *_, (_, seen) = drive(world, 3.0)
            return np.array([seen.x, seen.y, seen.speed])

    assert last(True).tobytes() == last(False).tobytes()


@pytest.mark.parametrize("name", ["light", "paper", "dense", "jam", "two_lanes", "six_lanes"])
def test_scenarios_start_and_run_without_collisions(name):
    scenario = load_scenario(name)
    with SumoWorld(scenario, RobotSettings(), seed=5) as world:
        driver = robot_driver(scenario.drivers, scenario.robot.speed)
        for _, after in drive(world, 8.0, driver):
            assert not libsumo.simulation.getCollisions()
            assert after.acceleration.min() > -6.0


def test_settling_keeps_the_robot_in_its_lane_and_sets_the_clock_to_zero():
    scenario = load_scenario("dense")
    with SumoWorld(scenario, RobotSettings(), seed=2) as world:
        start = world.observe()
        world.settle(2.0)
        settled = world.observe()
    assert settled.time == 0.0
    assert settled.robot[1] == start.robot[1] == LANE_WIDTH
    assert settled.robot[2] == 0.0
    assert settled.robot[0] == pytest.approx(start.robot[0] + 2.0 * start.robot[3], abs=4.0)
    assert settled.x.mean() > start.x.mean() + 10.0


def test_a_scene_made_by_hand_is_not_settled(open_scene):
    world = open_scene([CarStart(lane=1, x=12.0, speed=3.0)], speed=24.0)
    world.settle(3.0)
    seen = world.observe()
    assert seen.x[0] - seen.robot[0] == pytest.approx(12.0)
    assert seen.robot[3] == 24.0
    assert seen.speed[0] == 3.0


def test_sumos_warnings_reach_the_log_and_not_the_terminal(open_scene, caplog, capfd):
    world = open_scene([CarStart(lane=1, x=5.2, speed=0.0)], speed=20.0)
    for _ in drive(world, 0.2):
        pass
    with caplog.at_level(logging.WARNING, logger="hj_cosim.traffic.sumo.session"):
        world.close()
    assert any("collision" in message for message in caplog.messages)
    assert "collision" not in "".join(capfd.readouterr())


def test_a_second_world_in_the_same_process_is_refused(open_scene):
    open_scene([])
    with pytest.raises(SimulationError, match="close it first"):
        SumoWorld(load_scenario("paper"), RobotSettings(), seed=0)


def test_cars_that_reach_the_end_of_the_road_leave_the_observation(tmp_path):
    short = network(tmp_path, length=300.0)
    scenario = Scenario(
        name="short",
        network={"file": str(short)},
        traffic=TrafficSettings(count=0),
        robot=RobotStart(lane=1, speed=1.0),
        cars=[CarStart(lane=lane, x=60.0 + 30.0 * lane, speed=20.0 + 2.0 * lane) for lane in range(3)],
    )
    with SumoWorld(scenario, RobotSettings(), seed=0) as world:
        present = [after.vehicle.tolist() for _, after in drive(world, 11.0)]
        assert present[0] == [0, 1, 2]
        assert present[-1] == []
        assert [0, 1] in present
        assert [0] in present
        driver = robot_driver(scenario.drivers, 1.0)
        driver[0] = 40.0
        with pytest.raises(DriveEnded, match="end of the road"):
            for _ in drive(world, 30.0, driver):
                pass


def network(folder, length: float):
    lanes = "".join(
        f'<lane id="highway_{lane}" index="{lane}" speed="60" length="{length}" width="4" '
        f'shape="0,{4 * lane} {length},{4 * lane}"/>'
        for lane in range(3)
    )
    path = folder / "short.net.xml"
    path.write_text(
        '<net version="1.20"><location netOffset="0,0" convBoundary="0,0,1,1" origBoundary="0,0,1,1"'
        f' projParameter="!"/><edge id="highway" from="a" to="b" priority="1">{lanes}</edge>'
        '<junction id="a" type="dead_end" x="0" y="0" incLanes="" intLanes="" shape="0,0 0,1"/>'
        f'<junction id="b" type="dead_end" x="{length}" y="0" incLanes="" intLanes=""'
        f' shape="{length},0 {length},1"/></net>'
    )
    return path
