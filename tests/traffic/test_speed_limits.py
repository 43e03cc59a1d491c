"""Speed limits that change along a road: what SUMO's cars do there, what is expected of them, and what is planned."""

import math
from pathlib import Path

import numpy as np
import pytest
from bent_roads import circle
from rolled_out import predict

from hj_cosim.planning.catalogue import make_planner
from hj_cosim.planning.contract import IDLE
from hj_cosim.planning.optimistic.planner import OptimisticPlanner
from hj_cosim.planning.optimistic.speed_limits import (
    NO_LIMITS,
    ROBOTS_BRAKING,
    fastest_within_limits,
    limits_in_sight,
)
from hj_cosim.scene.observation import Target
from hj_cosim.scene.road import StraightRoad
from hj_cosim.scene.road_text import road_from_json, road_to_json
from hj_cosim.settings import (
    CarStart,
    DriverSettings,
    NetworkSettings,
    NormalDistribution,
    PlannerSettings,
    RobotSettings,
    RobotStart,
    Scenario,
    TrafficSettings,
)
from hj_cosim.traffic.route import read_network
from hj_cosim.traffic.sumo.world import SumoWorld
from hj_cosim.vehicles.idm import DESIRED_SPEED

STEP = 0.1
EDGES = {"fast": (0.0, 1000.0, 36.0), "slow": (1000.2, 1500.0, 22.0), "again": (1500.2, 2500.0, 36.0)}


def lanes(edge: str, start: float, stop: float, speed: float) -> str:
    return "".join(
        f'<lane id="{edge}_{i}" index="{i}" speed="{speed}" length="{stop - start:.1f}" width="3.75"'
        f' shape="{start},{3.75 * i} {stop},{3.75 * i}"/>'
        for i in range(3)
    )


def junction(name: str, at: float, before: str) -> str:
    into, inner = (" ".join(f"{edge}_{i}" for i in range(3)) for edge in (before, f":{name}_0"))
    requests = "".join(f'<request index="{i}" response="000" foes="000" cont="0"/>' for i in range(3))
    return (
        f'<junction id="{name}" type="priority" x="{at}" y="0" incLanes="{into}" intLanes="{inner}"'
        f' shape="{at},-2 {at},10 {at + 0.2},10 {at + 0.2},-2">{requests}</junction>'
    )


@pytest.fixture(scope="module")
def network(tmp_path_factory) -> Path:
    """A straight road of three edges: 36 m/s, 22 m/s for 500 m, 36 m/s again."""
    parts = ['<net version="1.20"><location netOffset="0,0" convBoundary="0,0,1,1" origBoundary="0,0,1,1" ']
    parts.append('projParameter="!"/>')
    for name, at in (("b", 1000.0), ("c", 1500.0)):
        parts.append(f'<edge id=":{name}_0" function="internal">{lanes(f":{name}_0", at, at + 0.2, 22.0)}</edge>')
    ends = {"fast": ("a", "b"), "slow": ("b", "c"), "again": ("c", "d")}
    for edge, (start, stop, speed) in EDGES.items():
        source, target = ends[edge]
        parts.append(f'<edge id="{edge}" from="{source}" to="{target}" priority="1">')
        parts.append(f"{lanes(edge, start, stop, speed)}</edge>")
    parts.append('<junction id="a" type="dead_end" x="0" y="0" incLanes="" intLanes="" shape="0,0 0,1"/>')
    parts += [junction("b", 1000.0, "fast"), junction("c", 1500.0, "slow")]
    parts.append('<junction id="d" type="dead_end" x="2500" y="0" incLanes="again_0 again_1 again_2" intLanes=""')
    parts.append(' shape="2500,0 2500,1"/>')
    for before, name, after in (("fast", "b", "slow"), ("slow", "c", "again")):
        for i in range(3):
            parts.append(f'<connection from="{before}" to="{after}" fromLane="{i}" toLane="{i}" via=":{name}_0_{i}"')
            parts.append(f' dir="s" state="M"/><connection from=":{name}_0" to="{after}" fromLane="{i}" toLane="{i}"')
            parts.append(' dir="s" state="M"/>')
    path = tmp_path_factory.mktemp("limits") / "limits.net.xml"
    path.write_text("".join(parts) + "</net>")
    return path


def drivers(speed: float) -> DriverSettings:
    return DriverSettings(
        **{
            name: NormalDistribution(mean=mean, deviation=0.0)
            for name, mean in {
                "desired_speed": speed,
                "max_acceleration": 3.0,
                "comfortable_deceleration": 5.0,
                "time_headway": 1.5,
                "minimum_gap": 5.0,
            }.items()
        }
    )


def scene(network: Path, cars: list[CarStart], speed: float = 30.0, x: float = 700.0) -> Scenario:
    """Return a scene with the robot at s = x in the middle lane; cars' places count from it."""
    behind = CarStart(lane=0, x=50.0 - x, speed=1.0, desired_speed=1.0)  # where a route's scene begins
    return Scenario(
        name="limits",
        network=NetworkSettings(file=str(network), route=("fast", "slow", "again")),
        traffic=TrafficSettings(count=0),
        drivers=drivers(33.0),
        robot=RobotStart(lane=1, speed=speed),
        cars=(behind, *cars),
    )


def coast(world: SumoWorld) -> None:
    x, y, _, speed = world.observe().robot
    world.step(np.array([x + speed * STEP, y, 0.0, speed]), 0.0)


def test_a_road_has_the_limits_of_its_edges_and_tells_where_they_begin(network):
    road, _ = read_network(network, NetworkSettings(file=str(network), route=("fast", "slow", "again")))
    assert road.speed_limit(np.array([10.0, 999.9, 1000.1, 1499.0, 1500.3, 2400.0])).tolist() == [
        36,
        36,
        22,
        22,
        36,
        36,
    ]
    np.testing.assert_allclose(road.speed_limits(900.0, 1600.0), [[900.0, 36.0], [1000.0, 22.0], [1500.2, 36.0]])
    assert road.speed_limits(1100.0, 1200.0).tolist() == [[1100.0, 22.0]]
    again = road_from_json(road_to_json(road))
    assert again.speed_limits(0.0, 2400.0).tolist() == road.speed_limits(0.0, 2400.0).tolist()


def test_limits_of_a_closed_road_come_again_every_lap():
    road = circle(
        1000.0 / math.tau, lap=1000.0, length=3000.0, limit_start=np.array([0.0, 600.0]), limit=np.array([30.0, 20.0])
    )
    assert road.speed_limit(np.array([1599.0, 1601.0, 2001.0])).tolist() == [30.0, 20.0, 30.0]
    assert road.speed_limits(700.0, 1700.0).tolist() == [[700.0, 20.0], [1000.0, 30.0], [1600.0, 20.0]]


def test_a_road_without_limits_has_none():
    for road in (circle(500.0), StraightRoad(3)):
        assert road.speed_limit(np.array([3.0])).tolist() == [math.inf]
        assert road.speed_limits(100.0, 900.0).tolist() == [[100.0, math.inf]]
        assert limits_in_sight(road, 300.0, 120.0) is NO_LIMITS
        assert fastest_within_limits(road, 300.0, 40.0, 1.0) == math.inf


def test_cars_brake_before_a_lower_limit_as_they_are_predicted_to(network, small_table):
    cars = [
        CarStart(lane=2, x=60.0, speed=33.0, desired_speed=33.0),
        CarStart(lane=2, x=20.0, speed=30.0, desired_speed=33.0),
    ]
    worst, slowest, made, compared = 0.0, math.inf, [], 0
    with SumoWorld(scene(network, cars), RobotSettings(), seed=0, step=STEP) as world:
        planner = OptimisticPlanner(
            PlannerSettings(expansions=1), RobotSettings(), drivers(33.0), world.road, small_table
        )
        for step in range(121):
            seen = world.observe()
            if step % 10 == 0:
                for path in made[-3:-2]:
                    _, here, there = np.intersect1d(path.vehicle, seen.vehicle, return_indices=True)
                    kept_lane = seen.lane[there] == 2
                    here, there = here[kept_lane], there[kept_lane]
                    compared += len(here)
                    worst = max(worst, float(np.abs(path.x[3, here] - seen.x[there]).max(initial=0.0)))
                made.append(predict(planner, seen, Target(1, float(seen.robot[3])), [IDLE] * 3))
            if seen.x[1] + 2.5 > 1000.3:
                slowest = min(slowest, float(seen.speed[1]))
                assert seen.speed[1] < 22.001
            coast(world)
    assert slowest > 21.9
    assert compared > 12
    assert worst < 1.0  # m, 3 s ahead; without the limit they would be up to 20 m farther


def test_what_is_expected_of_drivers_is_what_the_limit_where_they_are_leaves_of_it(network):
    cars = [
        CarStart(lane=2, x=20.0, speed=20.0, desired_speed=33.0),
        CarStart(lane=2, x=320.0, speed=20.0, desired_speed=33.0),
    ]
    with SumoWorld(scene(network, cars), RobotSettings(), seed=0, step=STEP) as world:
        expected = world.observe().expected_driver
        assert expected[1:, DESIRED_SPEED].tolist() == [33.0, 22.0]
        assert world.drivers[1:, DESIRED_SPEED].tolist() == [33.0, 33.0]


def test_nobody_cuts_in_before_who_could_not_accelerate_for_the_limit(network):
    """40 m ahead of a car at the limit: it would brake by 2.7 m/s², more than MOBIL finds safe. Were it free to drive
    33 m/s, IDM would have it brake by 0.3 m/s².
    """
    cars = [
        CarStart(lane=0, x=430.0, speed=22.0, desired_speed=33.0),
        CarStart(lane=0, x=465.0, speed=15.0, desired_speed=15.0),
        CarStart(lane=1, x=385.0, speed=22.0, desired_speed=33.0),
    ]
    with SumoWorld(scene(network, cars, speed=22.0), RobotSettings(), seed=0, step=STEP) as world:
        for _ in range(10):
            coast(world)
            assert world.observe().target_lane[1:].tolist() == [0, 0, 1]


@pytest.mark.parametrize("kind", ["hjop", "mppi"])
def test_the_robot_plans_to_be_as_slow_as_the_limit_where_it_begins(network, small_table, kind):
    with SumoWorld(scene(network, []), RobotSettings(), seed=0, step=STEP) as world:
        settings = PlannerSettings(kind=kind, expansions=30)
        planner = make_planner(settings, RobotSettings(), drivers(33.0), world.road, small_table)
        target, speeds, limited = Target(1, 30.0), [], []
        for step in range(140):
            seen = world.observe()
            if step % 10 == 0:
                target = planner.plan(seen, target).target
            x, y, _, speed = seen.robot
            acceleration = float(np.clip(1.67 * (target.speed - speed), -6.0, 4.0))
            later = speed + acceleration * STEP
            world.step(np.array([x + 0.5 * (speed + later) * STEP, y, 0.0, later]), acceleration)
            (speeds if x < 850.0 else limited if x > 1000.0 else []).append(float(speed))
    assert max(speeds) > 27.0
    assert max(limited) < 22.6


def test_the_robot_brakes_evenly_for_a_limit_after_its_reaction(network):
    road, _ = read_network(network, NetworkSettings(file=str(network), route=("fast", "slow", "again")))
    for ahead in (30.0, 60.0, 110.0):
        speed = fastest_within_limits(road, 1000.0 - ahead, 30.0, 1.0)
        stretch = max(ahead - 30.0, 0.0)
        assert speed == pytest.approx(math.sqrt(22.0**2 + 2.0 * ROBOTS_BRAKING * stretch))
    assert fastest_within_limits(road, 1100.0, 30.0, 1.0) == 22.0
    assert fastest_within_limits(road, 500.0, 30.0, 1.0) == 36.0


def test_no_drawn_car_starts_faster_than_the_limit(network):
    scenario = scene(network, []).model_copy(
        update={"cars": (), "traffic": TrafficSettings(count=40, count_behind=20, speed_low=30.0, speed_high=33.0)}
    )
    with SumoWorld(scenario, RobotSettings(), seed=3, step=STEP) as world:
        seen = world.observe()
        assert (seen.speed <= world.road.speed_limit(seen.x) + 1e-9).all()
        assert (seen.x > 1000.0).sum() > 5


def test_where_lanes_have_different_limits_the_fastest_lane_s_is_the_road_s(network, tmp_path):
    slower_on_the_right = network.read_text().replace(
        'id="slow_0" index="0" speed="22.0"', 'id="slow_0" index="0" speed="16.0"'
    )
    assert 'speed="16.0"' in slower_on_the_right
    changed = tmp_path / "lanes.net.xml"
    changed.write_text(slower_on_the_right)
    settings = NetworkSettings(route=["fast", "slow", "again"])
    plain, with_a_slower_lane = (read_network(path, settings)[0] for path in (network, changed))
    assert with_a_slower_lane.speed_limits(0.0, 2500.0).tolist() == plain.speed_limits(0.0, 2500.0).tolist()
    assert plain.speed_limits(0.0, 2500.0)[:, 1].min() == 22.0
