"""Kinds of vehicles: how they are drawn, placed, put into SUMO, and expected to drive."""

import libsumo
import numpy as np
import pytest

from hj_cosim.cosim.configuration import resolve_config
from hj_cosim.errors import ConfigurationError
from hj_cosim.scene.road import StraightRoad
from hj_cosim.settings import RobotSettings
from hj_cosim.traffic.sources.kinds import kinds_of
from hj_cosim.traffic.sources.placement import initial_traffic
from hj_cosim.traffic.sources.scenarios import load_scenario
from hj_cosim.traffic.sources.streams import drawn_streams
from hj_cosim.traffic.sumo.world import SumoWorld
from hj_cosim.vehicles.idm import DESIRED_SPEED, MAX_ACCELERATION, mean_driver

ROAD = StraightRoad(4, length=10_000.0)
TRUCK = {"share": 0.3, "length": 16.5, "width": 2.5}
SLOW = {"desired_speed": {"mean": 20.0, "deviation": 0.5}, "politeness": 0.4}


def start_of(scenario, seed):
    return initial_traffic(scenario, ROAD, RobotSettings(), seed)


def test_a_share_of_the_vehicles_is_of_each_kind_and_has_drivers_of_its_kind():
    scenario = load_scenario("trucks")
    starts = [start_of(scenario, seed) for seed in range(30)]
    length = np.concatenate([start.length for start in starts])
    width = np.concatenate([start.width for start in starts])
    drivers = np.vstack([start.drivers for start in starts])
    for kind in scenario.vehicles:
        of_kind = length == kind.length
        # A binomial count, three standard deviations of it.
        assert abs(of_kind.mean() - kind.share) < 3.0 * np.sqrt(kind.share * (1.0 - kind.share) / len(length))
        assert (width[of_kind] == kind.width).all()
        assert drivers[of_kind, MAX_ACCELERATION].mean() == pytest.approx(
            kind.drivers.max_acceleration.mean, abs=3.0 * 0.15 / np.sqrt(of_kind.sum())
        )
        assert drivers[of_kind, DESIRED_SPEED].max() < 25.0
    assert (np.unique(length) == [5.0, 12.0, 16.5]).all()


def test_cars_have_the_same_drivers_whatever_is_among_them():
    trucks, paper = load_scenario("trucks"), load_scenario("paper")
    some, none = start_of(trucks, 3), start_of(paper, 3)
    cars = some.length == 5.0
    columns = [column for column in range(6) if column != DESIRED_SPEED]  # the foremost of a lane is slowed down
    assert np.array_equal(some.drivers[cars][:, columns], none.drivers[cars][:, columns])
    assert set(none.length) == {5.0}


def test_nobody_overlaps_and_nobody_has_to_brake_at_once():
    scenario = load_scenario("trucks").model_copy(
        update={"vehicles": tuple(kind.model_copy(update={"share": 0.4}) for kind in load_scenario("trucks").vehicles)}
    )
    for seed in range(5):
        start = start_of(scenario, seed)
        for lane in range(4):
            here = np.flatnonzero(start.lane == lane)
            here = here[np.argsort(start.x[here])]
            gaps = np.diff(start.x[here]) - 0.5 * (start.length[here][1:] + start.length[here][:-1])
            assert gaps.min() > 5.0


def test_sumo_has_their_bodies_and_the_robot_sees_them_and_expects_their_kinds_of_drivers():
    scenario = load_scenario("trucks")
    with SumoWorld(scenario, RobotSettings(), seed=1, step=0.02, traffic_step=0.1) as world:
        seen = world.observe()
        for number, name in enumerate(world.vehicle_names):
            assert libsumo.vehicle.getLength(name) == seen.length[number]
            assert libsumo.vehicle.getWidth(name) == seen.width[number]
            assert libsumo.vehicle.getLanePosition(name) == pytest.approx(
                seen.x[number] + 0.5 * seen.length[number], abs=1e-6
            )
        kinds = {kind.length: mean_driver(kind.drivers) for kind in kinds_of(scenario)}
        for number, length in enumerate(seen.length.tolist()):
            assert np.array_equal(seen.expected_driver[number], kinds[length])
    with SumoWorld(load_scenario("paper"), RobotSettings(), seed=1, step=0.02, traffic_step=0.1) as world:
        assert world.observe().expected_driver is None


def test_a_kind_has_lane_changers_of_its_own():
    scenario = resolve_config({"vehicles": [TRUCK | {"drivers": SLOW}]}).scenario
    start = start_of(scenario, 0)
    assert set(start.mobil[start.length == 16.5, 0]) == {0.4}
    assert set(start.mobil[start.length == 5.0, 0]) == {0.0}
    assert (start.mobil[:, 1:] == start.mobil[0, 1:]).all()


def test_streams_bring_every_kind_too():
    scenario = load_scenario("ramps").model_copy(update={"vehicles": load_scenario("trucks").vehicles})
    for stream in drawn_streams(scenario, 5):
        assert {tuple(body) for body in stream.bodies} <= {(5.0, 2.0), (12.0, 2.5), (16.5, 2.5)}
        long = stream.bodies[:, 0] > 5.0
        assert (stream.drivers[long, MAX_ACCELERATION] < 2.0).all()
        assert (stream.drivers[~long, MAX_ACCELERATION] > 2.0).all()
    assert any((stream.bodies[:, 0] > 5.0).any() for stream in drawn_streams(scenario, 5))


@pytest.mark.parametrize(
    ("vehicles", "message"),
    [
        ([TRUCK | {"share": 0.6}, TRUCK | {"share": 0.6}], "the shares of vehicles add up to 1.2; 1 is all there are"),
        ([TRUCK | {"length": 25.0}], r"entry 1, length.*less than or equal to 18"),
        ([{"length": 12.0, "width": 2.5}], r"entry 1, share"),
        (
            [TRUCK | {"drivers": {"desired_speed": {"mean": 1.0, "deviation": 2.0}}}],
            "reaches zero within 2.5 deviations",
        ),
        ([TRUCK | {"drivers": {"speed": 3.0}}], r"entry 1, drivers\.speed"),
    ],
)
def test_what_is_wrong_with_a_kind_is_said_in_a_sentence(vehicles, message):
    with pytest.raises(ConfigurationError, match=message) as caught:
        resolve_config({"vehicles": vehicles})
    assert "\n" not in str(caught.value)


def test_a_car_that_is_placed_may_be_a_truck():
    cars = [{"lane": 1, "x": 40.0, "speed": 20.0, "length": 16.5, "width": 2.5}]
    scenario = resolve_config({"traffic": {"count": 0}, "cars": cars}).scenario
    assert scenario.bodies == {(16.5, 2.5)}
    with SumoWorld(scenario, RobotSettings(), seed=0) as world:
        seen = world.observe()
        assert (seen.length[0], seen.width[0]) == (16.5, 2.5)
        assert seen.x[0] - seen.robot[0] == pytest.approx(40.0)
