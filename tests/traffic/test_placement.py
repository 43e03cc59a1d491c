"""Where the cars of a scenario start, how fast, and who drives them."""

import itertools

import numpy as np
import pytest

from hj_cosim.errors import ScenarioError
from hj_cosim.locations import scenarios_folder
from hj_cosim.scene.road import StraightRoad
from hj_cosim.settings import CarStart, NormalDistribution, RobotSettings, RobotStart, Scenario, TrafficSettings
from hj_cosim.traffic.route import read_network
from hj_cosim.traffic.sources.kinds import draw_drivers, truncated_normal
from hj_cosim.traffic.sources.placement import (
    ENDING_SOON,
    density,
    initial_traffic,
    mean_spacing,
    stream_speed,
)
from hj_cosim.traffic.sources.scenarios import load_scenario
from hj_cosim.vehicles.car import CAR_LENGTH
from hj_cosim.vehicles.idm import (
    DESIRED_SPEED,
    PARAMETER_NAMES,
    equilibrium_speed,
    idm_acceleration,
    mean_driver,
)

SCENARIOS = {"light": 4, "paper": 4, "dense": 4, "jam": 4, "two_lanes": 2, "six_lanes": 6}


def everybody(name: str, seed: int):
    """Return x, lane, speed and drivers of all cars, the robot last."""
    scenario = load_scenario(name)
    start = initial_traffic(scenario, StraightRoad(SCENARIOS[name]), RobotSettings(), seed)
    robot_driver = mean_driver(scenario.drivers)
    robot_driver[DESIRED_SPEED] = scenario.robot.speed
    return (
        np.append(start.x, start.robot[0]),
        np.append(start.lane, scenario.robot.lane),
        np.append(start.speed, start.robot[3]),
        np.vstack([start.drivers, robot_driver]),
    )


@pytest.mark.parametrize("name", SCENARIOS)
def test_nobody_starts_faster_than_idm_holds_at_its_gap_or_has_to_brake(name):
    for seed in range(5):
        x, lane, speed, drivers = everybody(name, seed)
        for number in range(SCENARIOS[name]):
            members = np.flatnonzero(lane == number)
            members = members[np.argsort(x[members])]
            for rear, front in itertools.pairwise(members):
                gap = x[front] - x[rear] - CAR_LENGTH
                assert gap > 0.0
                assert speed[rear] <= equilibrium_speed(gap, drivers[rear]) + 1e-6
                if speed[rear] > 0.0:
                    assert idm_acceleration(speed[rear], gap, speed[front], drivers[rear]) >= -1e-5


@pytest.mark.parametrize("name", SCENARIOS)
def test_the_density_is_the_stated_one(name):
    scenario = load_scenario(name)
    for seed in range(3):
        x, *_ = everybody(name, seed)
        here = 1000.0 * (len(x) - 1) / (np.ptp(x) * SCENARIOS[name])
        assert here == pytest.approx(density(scenario.traffic, SCENARIOS[name]), rel=0.05)


@pytest.mark.parametrize("name", ["ramps", "lane_drop"])
def test_where_lanes_begin_and_end_each_that_lasts_has_the_stated_density(name):
    scenario = load_scenario(name)
    road, _ = read_network(scenarios_folder() / scenario.network.file, scenario.network)
    cars = lane_kilometres = 0.0
    for seed in range(10):
        start = initial_traffic(scenario, road, RobotSettings(), seed)
        along = np.arange(start.x.min(), start.x.max(), 5.0)
        lasting = [
            sum(road.lane_end(lane, place) - place > ENDING_SOON for lane in road.lanes_at(place)) for place in along
        ]
        cars += len(start.x)
        lane_kilometres += 0.005 * sum(lasting)
    assert cars / lane_kilometres == pytest.approx(scenario.traffic.density, rel=0.05)


def test_the_papers_spacing_is_1_5_v_exp_minus_5_n_over_30():
    assert mean_spacing(load_scenario("paper").traffic, 4) == pytest.approx(1.5 * 24.0 * np.exp(-20.0 / 30.0))
    assert density(load_scenario("paper").traffic, 4) == pytest.approx(13.5, abs=0.1)


@pytest.mark.parametrize(("name", "factor"), [("light", 0.5), ("dense", 2.0), ("jam", 4.0)])
def test_light_dense_and_jam_are_half_double_and_four_times_the_papers_density(name, factor):
    ratio = density(load_scenario(name).traffic, 4) / density(load_scenario("paper").traffic, 4)
    assert ratio == pytest.approx(factor, rel=0.01)


def test_cars_stand_ahead_and_behind_as_many_as_stated_and_in_every_lane():
    scenario = load_scenario("dense")
    start = initial_traffic(scenario, StraightRoad(4), RobotSettings(), 0)
    assert (start.x > start.robot[0]).sum() == scenario.traffic.count
    assert (start.x < start.robot[0]).sum() == scenario.traffic.count_behind
    assert set(start.lane) == {0, 1, 2, 3}
    assert start.x.min() > 0.0


def test_lanes_are_drawn_and_not_dealt_out_in_turn():
    start = initial_traffic(load_scenario("paper"), StraightRoad(4), RobotSettings(), 0)
    steps = np.diff(start.lane) % 4
    assert len(set(steps)) >= 3


def test_the_foremost_car_of_a_lane_drives_no_faster_than_the_stream():
    scenario = load_scenario("jam")
    start = initial_traffic(scenario, StraightRoad(4), RobotSettings(), 0)
    for lane in range(4):
        foremost = np.flatnonzero(start.lane == lane)[np.argmax(start.x[start.lane == lane])]
        assert start.drivers[foremost, DESIRED_SPEED] == pytest.approx(stream_speed(scenario, 4))


def test_draws_have_the_stated_mean_and_deviation_and_stay_within_the_truncation():
    distribution = NormalDistribution(mean=23.0, deviation=1.5, truncation=2.5)
    draws = truncated_normal(distribution, 20_000, np.random.default_rng(0))
    assert draws.mean() == pytest.approx(23.0, abs=0.05)
    assert draws.std() == pytest.approx(1.5 * 0.955, rel=0.02)  # of a normal distribution cut at 2.5
    assert np.abs(draws - 23.0).max() <= 2.5 * 1.5


def test_drivers_differ_in_everything_that_is_drawn_and_depend_on_the_seed_alone():
    scenario = load_scenario("paper")
    drivers = draw_drivers(scenario.drivers, 500, np.random.default_rng(1))
    means = mean_driver(scenario.drivers)
    np.testing.assert_allclose(drivers.mean(axis=0), means, rtol=0.02)
    assert (drivers.std(axis=0)[:5] / means[:5] > 0.05).all()
    again = draw_drivers(scenario.drivers, 500, np.random.default_rng(1))
    np.testing.assert_array_equal(drivers, again)


def test_a_drivers_parameters_are_named_in_the_order_of_their_columns():
    drivers = load_scenario("paper").drivers
    stated = [getattr(drivers, name) for name in PARAMETER_NAMES]
    means = [each.mean if isinstance(each, NormalDistribution) else each for each in stated]
    assert mean_driver(drivers).tolist() == means


def test_cars_placed_by_hand_start_as_written():
    scenario = Scenario(
        name="hand",
        traffic=TrafficSettings(count=0),
        robot=RobotStart(lane=2, speed=24.0),
        cars=(CarStart(lane=2, x=9.0, speed=30.0), CarStart(lane=0, x=-70.0, speed=5.0, desired_speed=6.0)),
    )
    start = initial_traffic(scenario, StraightRoad(4), RobotSettings(), 0)
    assert (start.x - start.robot[0]).tolist() == pytest.approx([9.0, -70.0])
    assert start.speed.tolist() == [30.0, 5.0]
    assert start.lane.tolist() == [2, 0]
    assert start.robot[1] == 8.0
    assert start.robot[3] == 24.0
    assert start.drivers[0, DESIRED_SPEED] == 30.0
    assert start.drivers[1, DESIRED_SPEED] == 6.0


def test_drawn_cars_leave_room_beside_those_placed_by_hand():
    scenario = load_scenario("siege")
    for seed in (*range(20), 1005, 1009):
        start = initial_traffic(scenario, StraightRoad(4), RobotSettings(), seed)
        for car in range(len(start.x) - len(scenario.cars), len(start.x)):
            others = np.flatnonzero((start.lane == start.lane[car]) & (np.arange(len(start.x)) != car))
            assert np.abs(start.x[others] - start.x[car]).min() > 10.0


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"traffic": {"density": 250.0}}, r"250 cars per km and lane do not fit .*lower traffic\.density"),
        ({"traffic": {"spacing_factor": 0.02}}, "do not fit"),
        ({"traffic": {"count": 5000}}, "the road is 10000 m long; take fewer cars"),
        ({"robot": {"lane": 4}}, r"robot\.lane = 4, but the road has lanes 0 to 3"),
        ({"traffic": {"count": 0}, "cars": [{"lane": 7, "x": 9.0, "speed": 1.0}]}, "a car is in lane 7"),
        ({"traffic": {"count": 0}, "cars": [{"lane": 1, "x": 4.0, "speed": 1.0}]}, "overlap in lane 1"),
    ],
)
def test_what_does_not_fit_is_refused_in_a_sentence(changes, said):
    scenario = Scenario.model_validate({"name": "tight", **changes})
    with pytest.raises(ScenarioError, match=said) as error:
        initial_traffic(scenario, StraightRoad(4), RobotSettings(), 0)
    assert str(error.value).startswith("scenario tight:")
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("name", ["paper", "dense", "two_lanes"])
def test_robot_has_the_room_ahead_that_a_car_of_the_stream_has_on_average(name):
    lanes = SCENARIOS[name]
    scenario = load_scenario(name)
    for seed in range(5):
        start = initial_traffic(scenario, StraightRoad(lanes), RobotSettings(), seed)
        ahead = start.x[(start.lane == scenario.robot.lane) & (start.x > start.robot[0])]
        room = ahead.min() - start.robot[0]
        assert room >= lanes * mean_spacing(scenario.traffic, lanes) * (1.0 - 1e-9)
