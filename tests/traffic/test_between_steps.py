"""The two clocks: SUMO's cars between two of its steps, and the robot in a traffic that steps more seldom."""

import math

import libsumo
import numpy as np
import pytest

from hj_cosim.scene.road import StraightRoad
from hj_cosim.settings import CarStart, DriverSettings, RobotSettings, RobotStart, Scenario, TrafficSettings
from hj_cosim.traffic.settling import follow_lane, robot_driver
from hj_cosim.traffic.sources.scenarios import load_scenario
from hj_cosim.traffic.sumo.between_steps import BetweenSteps, Motion
from hj_cosim.traffic.sumo.puppet import ROBOT
from hj_cosim.traffic.sumo.world import SumoWorld
from hj_cosim.vehicles.idm import idm_acceleration

STEP, TRAFFIC_STEP = 0.02, 0.1
ROAD = StraightRoad(lane_count=4)


def one_car(x: float, speed: float, y: float = 0.0, heading: float = 0.0, lane: int = 0) -> Motion:
    return Motion(*(np.array([number]) for number in (x, y, heading, speed, 0.0)), np.array([lane]))


def course(between: BetweenSteps, samples: int = 1001) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return times within the step, and the only car's positions and speeds."""
    times = np.linspace(0.0, TRAFFIC_STEP, samples)
    motions = [between.at(time) for time in times]
    return times, np.array([m.x[0] for m in motions]), np.array([m.speed[0] for m in motions])


@pytest.mark.parametrize("acceleration", [-9.0, -2.0, 0.0, 3.0])
def test_a_car_moves_by_its_constant_acceleration(acceleration):
    way = 20.0 * TRAFFIC_STEP + 0.5 * acceleration * TRAFFIC_STEP**2
    after = one_car(100.0 + way, 20.0 + acceleration * TRAFFIC_STEP)
    times, x, speed = course(BetweenSteps(one_car(100.0, 20.0), after, TRAFFIC_STEP, ROAD))
    np.testing.assert_allclose(x, 100.0 + 20.0 * times + 0.5 * acceleration * times**2, atol=1e-12)
    np.testing.assert_allclose(speed, 20.0 + acceleration * times, atol=1e-12)


@pytest.mark.parametrize(
    ("before", "after"),
    [
        (one_car(0.0, 0.5), one_car(0.5 * 0.5 * 0.06, 0.0)),  # stops after 0.06 s
        (one_car(0.0, 0.5), one_car(0.0, 0.0)),  # is halted where it is
        (one_car(0.0, 0.5), one_car(0.5 * 0.5 * TRAFFIC_STEP, 0.0)),  # stops just when the step ends
        (one_car(0.0, 20.0), one_car(2.03, 20.1)),  # the ends contradict a constant acceleration
    ],
)
def test_position_and_speed_meet_at_both_ends_and_nobody_drives_backwards(before, after):
    _, x, speed = course(BetweenSteps(before, after, TRAFFIC_STEP, ROAD))
    assert x[0] == before.x[0]
    assert x[-1] == pytest.approx(after.x[0], abs=1e-12)
    assert speed[-1] == pytest.approx(after.speed[0], abs=1e-9)
    assert np.diff(x).min() >= 0.0
    assert speed.min() >= 0.0
    way = np.sum(0.5 * (speed[1:] + speed[:-1])) * TRAFFIC_STEP / 1000
    assert way == pytest.approx(after.x[0] - before.x[0], abs=1e-5)


def test_a_car_that_stops_brakes_evenly_and_then_stands():
    between = BetweenSteps(one_car(0.0, 0.5), one_car(0.015, 0.0), TRAFFIC_STEP, ROAD)
    assert between.at(0.03).speed[0] == pytest.approx(0.25)
    assert between.at(0.03).x[0] == pytest.approx(0.01125)
    for time in (0.06, 0.08, 0.0999):
        assert between.at(time).speed[0] == pytest.approx(0.0, abs=1e-12)
        assert between.at(time).x[0] == pytest.approx(0.015)


def test_a_car_that_changes_lanes_is_in_the_lane_that_is_nearest():
    before, after = one_car(0.0, 20.0, y=1.95, lane=0), one_car(2.0, 20.0, y=2.08, lane=1)
    between = BetweenSteps(before, after, TRAFFIC_STEP, ROAD)
    assert [int(between.at(time).lane[0]) for time in (0.0, 0.03, 0.05, 0.09)] == [0, 0, 1, 1]
    np.testing.assert_allclose([between.at(time).y[0] for time in (0.0, 0.05, 0.1)], [1.95, 2.015, 2.08])


def test_a_heading_turns_the_short_way():
    before, after = one_car(0.0, 20.0, heading=math.pi - 0.01), one_car(2.0, 20.0, heading=-math.pi + 0.01)
    halfway = BetweenSteps(before, after, TRAFFIC_STEP, ROAD).at(0.05).heading[0]
    assert math.cos(halfway) == pytest.approx(-1.0, abs=1e-12)


def open_scenario(name: str, seed: int = 3, traffic_step: float | None = TRAFFIC_STEP) -> SumoWorld:
    return SumoWorld(load_scenario(name), RobotSettings(), seed, STEP, traffic_step=traffic_step)


def weave(world: SumoWorld, steps: int):
    """Yield the observations before and after every step of a robot that speeds up, brakes and changes lanes."""
    after = world.observe()
    for step in range(steps):
        before = after
        x, y, heading, speed = before.robot.tolist()
        acceleration = 1.5 * math.sin(0.02 * step)
        heading = 0.03 * math.sin(0.01 * step)
        way = speed * STEP
        state = np.array(
            [x + way * math.cos(heading), y + way * math.sin(heading), heading, max(speed + acceleration * STEP, 0.0)]
        )
        world.step(state, acceleration)
        after = world.observe()
        yield before, after


@pytest.mark.parametrize("name", ["paper", "jam"])
def test_cars_are_where_sumo_has_them_at_its_steps_and_move_continuously_in_between(name):
    with open_scenario(name) as world:
        world.settle(1.0)
        was_moving_sideways = 0
        for step, (before, after) in enumerate(weave(world, 500), start=1):
            if step % 5 == 0:
                names = world.vehicle_names
                fronts = np.array([libsumo.vehicle.getLanePosition(name) for name in names])
                np.testing.assert_allclose(after.x + 2.5, fronts, atol=1e-9)
                np.testing.assert_allclose(after.speed, [libsumo.vehicle.getSpeed(name) for name in names], atol=1e-9)
                lateral = [libsumo.vehicle.getLateralLanePosition(name) for name in names]
                np.testing.assert_allclose(after.y, 4.0 * after.lane + lateral, atol=1e-9)
                assert after.lane.tolist() == [libsumo.vehicle.getLaneIndex(name) for name in names]
            way = 0.5 * (before.speed + after.speed) * STEP
            np.testing.assert_allclose(after.x - before.x, way, atol=1e-9)
            np.testing.assert_allclose(after.speed - before.speed, after.acceleration * STEP, atol=1e-9)
            assert np.abs(after.y - before.y).max() < 1.5 * 4.0 / 3.0 * STEP
            assert np.abs(after.y - 4.0 * after.lane).max() < 2.0 + 1e-6
            was_moving_sideways += np.count_nonzero(after.y != before.y)
    assert was_moving_sideways > 100 or name == "jam"


def test_who_follows_the_robot_acts_by_idm_on_what_is_when_sumos_step_begins():
    scenario = Scenario(
        name="two",
        traffic=TrafficSettings(count=0),
        drivers=DriverSettings(gain_threshold=1e6),
        robot=RobotStart(lane=1, speed=20.0),
        cars=(CarStart(lane=1, x=-40.0, speed=20.0, desired_speed=30.0),),
    )
    with SumoWorld(scenario, RobotSettings(), 0, STEP, traffic_step=TRAFFIC_STEP) as world:
        seen = world.observe()
        for step in range(400):
            x, y, _, speed = seen.robot.tolist()
            acceleration = 3.0 * math.sin(0.05 * step)
            if step % 5 == 0:
                gap = seen.robot[0] - seen.x[0] - 5.0
                expected = idm_acceleration(seen.speed[0], gap, seen.robot[3], world.drivers[0])
            later_speed = speed + acceleration * STEP
            world.step(np.array([x + 0.5 * (speed + later_speed) * STEP, y, 0.0, later_speed]), acceleration)
            seen = world.observe()
            # Where it will be was foreseen, to some millimetres, when the step before began.
            assert seen.acceleration[0] == pytest.approx(expected, abs=5e-3)
            if step % 5 == 4:
                front, _ = libsumo.vehicle.getPosition(ROBOT)
                assert front - 2.5 == pytest.approx(seen.robot[0], abs=0.01)


def test_the_same_seed_gives_the_same_traffic():
    def states() -> bytes:
        with open_scenario("dense", seed=11) as world:
            world.settle(1.0)
            seen = [after for _, after in weave(world, 100)]
            return b"".join(np.array([s.x, s.y, s.speed, s.acceleration, s.heading]).tobytes() for s in seen)

    assert states() == states()


def test_one_clock_is_the_world_without_a_second_one():
    def states(traffic_step: float | None) -> bytes:
        with open_scenario("paper", traffic_step=traffic_step) as world:
            world.settle(0.2)
            return b"".join(after.x.tobytes() + after.speed.tobytes() for _, after in weave(world, 60))

    assert states(STEP) == states(None)
    assert states(TRAFFIC_STEP) != states(None)


def test_drivers_decide_as_often_as_with_one_clock():
    """Each decides once a second, in one of ten turns, however long SUMO's steps are."""
    begun: dict[float, list[float]] = {}
    for traffic_step in (STEP, 0.04, TRAFFIC_STEP, 0.2):
        with open_scenario("light", seed=0, traffic_step=traffic_step) as world:
            driver = robot_driver(load_scenario("light").drivers, 24.0)
            after, times = world.observe(), []
            for step in range(450):
                before = after
                world.step(*follow_lane(before, driver, world.road, 5.0, STEP))
                after = world.observe()
                begins = (after.y != before.y) & (before.y == 4.0 * before.lane)
                times += [step * STEP] * int(begins.sum())
            begun[traffic_step] = times
    for traffic_step, times in begun.items():
        assert len(times) == pytest.approx(len(begun[STEP]), rel=0.35), traffic_step
        steps = np.array(times) / traffic_step
        np.testing.assert_allclose(steps, np.round(steps), atol=1e-6)


def test_a_car_that_enters_within_a_step_is_seen_when_it_ends():
    with open_scenario("light") as world:
        world.settle(0.1)
        known = len(world.vehicle_names)
        front = float(world.observe().x.max()) + 200.0
        driver = libsumo.vehicle.getTypeID(world.vehicle_names[0])
        libsumo.vehicle.add("late", "road", driver, departLane="2", departPos=str(front), departSpeed="15")
        counts = [len(after.x) for _, after in weave(world, 10)]
    assert counts == [known] * 4 + [known + 1] * 6
    assert world.vehicle_names[-1] == "late"
