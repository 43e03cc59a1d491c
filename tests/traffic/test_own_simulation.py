"""Users' own simulations with the robot in them, each trap with the real libsumo."""

import libsumo
import numpy as np
import pytest
from bent_roads import road_through
from own_configurations import DEMAND, content, network, simulation

from hj_cosim.errors import DriveEnded, NetworkError, ScenarioError, SimulationError
from hj_cosim.settings import DriverSettings, OwnSimulationSettings, RobotSettings, RobotStart, Scenario
from hj_cosim.traffic.junctions import read_junctions
from hj_cosim.traffic.road_end import RoadEnd
from hj_cosim.traffic.settling import follow_lane, robot_driver
from hj_cosim.traffic.sumo.own_world import OwnWorld, _before_sharp_bends
from hj_cosim.traffic.sumo.puppet import ROBOT

STEP, TRAFFIC_STEP = 0.02, 0.1


def open_own(configuration, seed: int = 0, warm_up: float = 30.0, **own: object) -> OwnWorld:
    settings = OwnSimulationSettings(file=str(configuration), warm_up=warm_up, **own)
    return OwnWorld(Scenario(name="mine", own=settings), RobotSettings(), seed, STEP, TRAFFIC_STEP)


def drive(world: OwnWorld, steps: int, desired_speed: float = 25.0):
    """Yield what is seen before and after every step of a robot that follows its lane."""
    driver = robot_driver(DriverSettings(), desired_speed)
    after = world.observe()
    for _ in range(steps):
        before = after
        world.step(*follow_lane(before, driver, world.road, 5.0, STEP))
        after = world.observe()
        yield before, after


def test_nothing_is_written_into_the_users_folders_and_all_that_would_be_is_told(tmp_path, monkeypatch):
    configuration = simulation(tmp_path / "theirs")
    monkeypatch.chdir(tmp_path / "theirs")
    before = content(tmp_path / "theirs")
    with open_own(configuration) as world:
        list(drive(world, 60))
    assert content(tmp_path / "theirs") == before
    for output in (
        "fcd.xml",
        "trips.xml",
        "summary.xml",
        "sumo.log",
        "loops.xml",
        "areas.xml",
        "means.xml",
        "lights.xml",
    ):
        assert output in world.told
    assert "step-length 0.5 -> 0.1" in world.told
    assert "lateral-resolution 0.8 -> 0" in world.told


def test_the_robot_is_where_the_vehicle_was_and_as_fast_and_the_vehicle_is_gone(tmp_path):
    with open_own(simulation(tmp_path), ego="cars.4", begin=30.0) as world:
        x, y, heading, speed = world.observe().robot
        assert "takes over cars.4 at 30 s" in world.told
        names = libsumo.vehicle.getIDList()
        assert ROBOT in names
        assert "cars.4" not in names
        lane = libsumo.vehicle.getLaneID(ROBOT)
        assert x + 2.5 == pytest.approx(libsumo.vehicle.getLanePosition(ROBOT), abs=1e-6)
        assert y == pytest.approx(3.5 * int(lane[-1]))
        assert heading == 0.0
        assert speed == pytest.approx(libsumo.vehicle.getSpeed(ROBOT))
        assert 10.0 < speed < 36.0


def test_others_are_where_sumo_has_them_and_come_and_go(tmp_path):
    seen_names: set[str] = set()
    with open_own(simulation(tmp_path), near=150.0) as world:
        first = {world.vehicle_names[number] for number in world.observe().vehicle}
        for step, (before, after) in enumerate(drive(world, 1000), start=1):
            both, old, new = np.intersect1d(before.vehicle, after.vehicle, return_indices=True)
            way = 0.5 * (before.speed[old] + after.speed[new]) * STEP
            np.testing.assert_allclose(after.x[new] - before.x[old], way, atol=1e-6)
            assert len(both) >= len(after.vehicle) - 3
            if step % 5 == 0:
                for car, number in enumerate(after.vehicle):
                    name = world.vehicle_names[number]
                    edge = libsumo.vehicle.getRoadID(name)
                    start = {"e0": 0.0, ":j1_0": 600.0, "e1": 604.0}[edge]
                    front = after.x[car] + 0.5 * after.length[car]
                    assert front == pytest.approx(start + libsumo.vehicle.getLanePosition(name), abs=1e-6)
                    assert after.speed[car] == pytest.approx(libsumo.vehicle.getSpeed(name), abs=1e-9)
                    assert abs(after.x[car] - after.robot[0]) < 160.0
            seen_names |= {world.vehicle_names[number] for number in after.vehicle}
        last = {world.vehicle_names[number] for number in after.vehicle}
        assert len(world.vehicle_names) == len(set(world.vehicle_names))
        assert np.isnan(world.drivers).all()
        lorries = [car for car, n in enumerate(after.vehicle) if world.vehicle_names[n].startswith("lorries")]
        assert all(after.length[car] == 14.0 and after.width[car] == 2.5 for car in lorries)
    assert first - last
    assert last - first
    assert ROBOT not in seen_names


def test_who_follows_the_robot_keeps_behind_it(tmp_path):
    """Theirs drive as they do, and see the robot: it stops, and they stop behind it."""
    with open_own(simulation(tmp_path), ego="cars.4", begin=30.0) as world:
        seen = world.observe()
        for _ in range(900):
            x, y, _, speed = seen.robot.tolist()
            slower = max(speed - 4.0 * STEP, 0.0)
            world.step(np.array([x + 0.5 * (speed + slower) * STEP, y, 0.0, slower]), -4.0)
            seen = world.observe()
            near = (np.abs(seen.x - seen.robot[0]) < 0.5 * (seen.length + 5.0)) & (np.abs(seen.y - y) < 1.5)
            assert not near.any()
        behind = seen.robot[0] - seen.x
        assert ((behind > 0.0) & (behind < 60.0) & (seen.speed < 5.0)).any()


def test_the_drive_ends_where_a_light_is_and_what_was_driven_stands(tmp_path):
    with open_own(simulation(tmp_path, light="signal")) as world:
        with pytest.raises(DriveEnded) as end:
            list(drive(world, 3000))
        assert end.value.reason == "traffic light 'signal'"
        assert world.observe().robot[0] == pytest.approx(600.0 - 2.5, abs=1.0)


def test_the_drive_ends_with_the_vehicles_route(tmp_path):
    with open_own(simulation(tmp_path)) as world:
        with pytest.raises(DriveEnded) as end:
            list(drive(world, 4000, 33.0))
        assert end.value.reason == "end of its vehicle's route"
        assert world.observe().robot[0] == pytest.approx(1204.0 - 2.5, abs=1.0)


@pytest.mark.parametrize(
    ("request_", "reason"),
    [
        ('response="100" foes="100"', "junction 'j1', where others have the right of way"),
        ('response="000" foes="100"', "junction 'j1', where others cross on their way to 'aside'"),
    ],
)
def test_the_road_ends_where_others_have_the_right_of_way_or_cross(tmp_path, request_, reason):
    path = network(tmp_path / "a.net.xml", request=request_)
    text = path.read_text()
    text = text.replace('intLanes=":j1_0_0 :j1_0_1"', 'intLanes=":j1_0_0 :j1_0_1 :j1_1_0"')
    text = text.replace(
        "</net>", '<connection from="cross" to="aside" fromLane="0" toLane="0" via=":j1_1_0" dir="s" state="m"/></net>'
    )
    path.write_text(text)
    junctions = read_junctions(path)
    assert junctions.as_far_as_it_is_a_road(("e0", "e1")) == (("e0",), reason)
    path.write_text(text.replace('to="aside"', 'to="e1"'))
    merging = read_junctions(path).obstacle("e0", "e1")
    assert merging == (reason if "right of way" in reason else None)


def test_by_default_the_one_that_goes_farthest_is_taken_over_and_a_seed_chooses_among_those(tmp_path):
    short = '<flow id="stay" type="car" route="short" begin="0" end="300" period="5" departLane="1" departSpeed="20"/>'
    configuration = simulation(tmp_path, demand=DEMAND + short)

    def taken(seed: int) -> str:
        with open_own(configuration, seed) as world:
            return world.told.split("takes over ")[1].split(" ")[0]

    first = taken(0)
    assert first == taken(0)
    chosen = {taken(seed) for seed in range(1, 6)}
    assert len(chosen) > 1
    assert all(name.startswith("cars.") for name in chosen | {first})


@pytest.mark.parametrize(
    ("own", "said"),
    [
        (
            {"ego": "nobody"},
            r"mine\.sumocfg, 0 to 3\d\d s: vehicle 'nobody' has not departed, or is gone; others are there: \w+\.",
        ),
        (
            {"ego": "lorries.0"},
            r"cannot take the place of vehicle 'lorries\.0', which is no passenger car but a truck",
        ),
        ({"begin": 400.0}, r"ends at 400 s, and the robot is to take over at 400 s; set scenario\.own\.begin"),
    ],
)
def test_who_cannot_be_taken_over_is_refused_in_one_sentence(tmp_path, own, said):
    with pytest.raises(ScenarioError, match=said):
        open_own(simulation(tmp_path), **own)
    assert not libsumo.isLoaded()


def test_where_nobody_can_be_taken_over_the_reasons_are_told(tmp_path):
    with pytest.raises(ScenarioError, match=r"none of \d+ vehicles; \d+ of them: on a road with one lane"):
        open_own(simulation(tmp_path, lanes=1, demand=DEMAND.splitlines()[1].replace("random", "0")))


def test_a_network_that_cannot_be_driven_on_is_refused_with_what_would_help(tmp_path):
    with pytest.raises(NetworkError, match=r"no lanes inside its junctions.*netconvert .*--no-internal-links false"):
        open_own(simulation(tmp_path / "a", inside=False))
    with pytest.raises(NetworkError, match="keeps to the left"):
        open_own(simulation(tmp_path / "b", root='lefthand="true"'))


def test_what_sumo_refuses_is_told_in_its_own_first_sentence(tmp_path):
    configuration = simulation(tmp_path, demand='<vehicle id="v" type="bicycle-shop" route="way" depart="0"/>')
    with pytest.raises(SimulationError, match=r"SUMO cannot run .*mine\.sumocfg: The vehicle type 'bicycle-shop'"):
        open_own(configuration)
    assert not libsumo.isLoaded()


def test_a_simulation_that_has_a_robot_already_is_refused(tmp_path):
    demand = DEMAND + '<vehicle id="robot" type="car" route="way" depart="20" departLane="1" departSpeed="20"/>'
    with pytest.raises(ScenarioError, match="a vehicle called 'robot'"):
        open_own(simulation(tmp_path, demand=demand), ego="cars.4", begin=30.0)


def test_the_same_seed_gives_the_same_drive(tmp_path):
    configuration = simulation(tmp_path)

    def states(seed: int) -> bytes:
        with open_own(configuration, seed, ego="cars.4", begin=30.0) as world:
            return b"".join(after.x.tobytes() + after.speed.tobytes() for _, after in drive(world, 100))

    first = states(3)
    for _ in range(3):  # whatever was simulated before in this process
        assert states(3) == first
    assert states(3) != states(4)


def test_a_vehicle_that_is_named_is_taken_over_as_soon_as_it_is_there(tmp_path):
    with open_own(simulation(tmp_path), ego="cars.20", warm_up=300.0) as world:
        assert "takes over cars.20 at 60" in world.told


def test_the_planner_is_told_what_is_known_of_those_near_by_their_types(tmp_path):
    with open_own(simulation(tmp_path), ego="cars.4", begin=30.0, near=400.0) as world:
        near = [world.vehicle_names[number] for number in world.observe().vehicle]
        lorries = sum(name.startswith("lorries") for name in near)
        assert 0 < lorries < len(near)
        share = lorries / len(near)
        driver = world.predicted
        assert driver.minimum_gap.mean == pytest.approx(2.5)  # SUMO's, of both types
        assert driver.max_acceleration.mean == pytest.approx(share * 1.3 + (1.0 - share) * 2.6)
        assert driver.desired_speed.mean == pytest.approx(share * 23.0 + (1.0 - share) * 33.0, abs=1.5)
        assert driver.max_acceleration.deviation == 0.0
        assert (
            "the planner predicts the others as MOBIL and IDM drivers by their types, on average with desired_speed"
            in world.told
        )


def test_a_lorry_that_slides_into_the_next_lane_while_it_stands_is_not_turned_across_the_road(tmp_path):
    with open_own(simulation(tmp_path), ego="cars.3", begin=15.0, near=600.0) as world:
        libsumo.vehicle.setPreviousSpeed("lorries.0", 0.3)
        libsumo.vehicle.setSpeed("lorries.0", 0.3)
        libsumo.vehicle.setLaneChangeMode("lorries.0", 0)
        libsumo.vehicle.changeLane("lorries.0", 1, 30.0)
        headings, lateral = [], []
        for _, seen in drive(world, 250, 5.0):
            car = np.flatnonzero(seen.vehicle == world.vehicle_names.index("lorries.0"))
            headings.append(float(seen.heading[car][0]))
            lateral.append(float(seen.y[car][0]))
    assert max(lateral) == pytest.approx(3.5)
    assert np.abs(np.diff(lateral)).max() < 0.05
    assert 0.05 < max(np.abs(headings)) < 0.2


def test_the_drive_ends_before_a_bend_that_takes_more_than_the_robot_keeps_for_bends():
    """Straight for 500 m, then ever sharper (s is on a clothoid's: curvature grows by 1/20,000 a metre of it)."""
    along = np.arange(0.0, 1001.0, 10.0)
    fine = np.linspace(0.0, 1000.0, 100_001)
    direction = 0.5 * np.maximum(fine - 500.0, 0.0) ** 2 / 20_000.0
    x, y = (np.append(0.0, np.cumsum(np.diff(fine) * part[:-1])) for part in (np.cos(direction), np.sin(direction)))
    road = road_through(np.column_stack([np.interp(along, fine, x), np.interp(along, fine, y)]), 1000.0)
    robot, end = RobotSettings(), RoadEnd(1000.0, "end", "")
    sharpest = min(robot.bend_rate_max / 30.0, robot.bend_acceleration_max / 30.0**2)
    found = _before_sharp_bends(road, robot, 30.0, 0.0, end)
    assert found.reason == "bend that is too sharp"
    assert found.along == pytest.approx(500.0 + 20_000.0 * sharpest, abs=3.0)
    assert "at 30 m/s; lower robot.speed_max" in found.remedy
    assert _before_sharp_bends(road, robot, 5.0, 0.0, end) is end
    with pytest.raises(
        NetworkError, match=r"where the robot takes over there is a bend of radius 1\d\d m, and 200 m is"
    ):
        _before_sharp_bends(road, robot, 30.0, 650.0, end)


def test_bodies_and_drivers_are_known_by_the_types_of_theirs(tmp_path):
    with open_own(simulation(tmp_path / "theirs"), warm_up=60.0) as world:
        assert world.bodies == {(4.5, 1.8), (14.0, 2.5)}
        seen = world.observe()
        lorries = seen.length == 14.0
        assert lorries.any()
        assert not lorries.all()
        # IDM's desired speed is what the type and the lane (36 m/s) allow; SUMO's defaults are the rest.
        assert (seen.expected_driver[lorries, 0] == 23.0).all()
        assert (seen.expected_driver[~lorries, 0] > 23.0).all()
        for number, driver in zip(seen.vehicle, seen.expected_driver, strict=True):
            name = world.vehicle_names[number]
            assert driver[1] == libsumo.vehicle.getAccel(name)
            assert driver[4] == libsumo.vehicle.getMinGap(name)


def open_inserted(configuration, warm_up: float = 40.0, own: dict | None = None, **robot: object) -> OwnWorld:
    settings = OwnSimulationSettings(file=str(configuration), warm_up=warm_up, **(own or {}))
    scenario = Scenario(name="mine", own=settings, robot=RobotStart(**robot))
    return OwnWorld(scenario, RobotSettings(), 0, STEP, TRAFFIC_STEP)


def test_a_robot_is_put_in_where_there_is_room_and_nobody_vanishes(tmp_path):
    configuration = simulation(tmp_path / "theirs", lengths=(600.0, 400.0, 300.0))
    with open_own(configuration, ego="cars.4", begin=40.0) as world:
        others = set(libsumo.vehicle.getIDList()) - {ROBOT}
    with open_inserted(configuration, edge="e0", lane=1, speed=21.0) as world:
        assert set(libsumo.vehicle.getIDList()) - {ROBOT} == others | {"cars.4"}
        seen = world.observe()
        assert seen.robot[3] == 21.0
        assert world.road.lane_at(seen.robot[1], seen.robot[0]) == 1
        assert "is put in at 40 s, in lane e0_1, at 21.0 m/s" in world.told
        assert world.road.length == pytest.approx(600.0 + 400.0 + 300.0 + 2 * 4.0)
        ahead = seen.x - seen.robot[0]
        here = np.abs(seen.y - seen.robot[1]) < 1.0
        gaps = np.abs(ahead[here]) - 0.5 * (seen.length[here] + 5.0)
        assert (gaps[ahead[here] > 0.0] >= 10.0 + 2.0 * 21.0 - 1e-6).all()
        assert (gaps[ahead[here] < 0.0] >= 10.0).all()
        followers = set()
        for _, after in drive(world, 400, desired_speed=15.0):
            behind = (after.x < after.robot[0]) & (np.abs(after.y - after.robot[1]) < 1.0)
            followers |= set(after.vehicle[behind].tolist())
            assert (np.abs(after.x - after.robot[0])[behind] > 4.0).all()
        assert followers  # they see it, and keep behind


@pytest.mark.parametrize(
    ("robot", "message"),
    [
        ({"edge": "nowhere"}, r"robot\.edge = 'nowhere': the simulation's network has no such edge"),
        ({"edge": "e0", "lane": 7}, r"robot\.lane = 7: edge 'e0' has the lanes 0 to 1"),
    ],
)
def test_where_no_robot_can_be_put_in_is_said_in_a_sentence(tmp_path, robot, message):
    with pytest.raises(ScenarioError, match=message):
        open_inserted(simulation(tmp_path / "theirs"), **robot)


def test_an_edge_of_theirs_makes_no_sense_beside_a_vehicle_or_in_a_scenario_of_ours(tmp_path):
    own = OwnSimulationSettings(file=str(simulation(tmp_path / "theirs")), ego="cars.4")
    with pytest.raises(ValueError, match="both say where the robot begins; keep one of them"):
        Scenario(name="mine", own=own, robot=RobotStart(edge="e0"))
    with pytest.raises(ValueError, match=r"robot\.edge is an edge of a user's own simulation"):
        Scenario(name="mine", robot=RobotStart(edge="e0"))


def test_those_farther_away_are_there_to_be_recorded_and_change_nothing_that_is_seen(tmp_path):
    configuration = simulation(tmp_path)
    settings = OwnSimulationSettings(file=str(configuration), warm_up=30.0, near=100.0)
    seen: dict[bool, list] = {}
    far = set()
    for looks_farther in (False, True):
        seen[looks_farther] = []
        with OwnWorld(
            Scenario(name="mine", own=settings), RobotSettings(), 0, STEP, TRAFFIC_STEP, looks_farther=looks_farther
        ) as world:
            for _, after in drive(world, 300):
                names = [world.vehicle_names[number] for number in after.vehicle]
                order = np.argsort(names)
                columns = (after.x, after.y, after.speed, after.acceleration, after.target_lane, after.length)
                seen[looks_farther].append((sorted(names), [column[order].tolist() for column in columns]))
                if not looks_farther:
                    continue
                everybody = world.everybody()
                rows = {world.vehicle_names[number]: row for row, number in enumerate(everybody.vehicle)}
                assert set(names) <= set(rows)
                assert len(rows) == len(everybody.vehicle) > len(names)
                far |= set(rows) - set(names)
            # Independently: all that SUMO has on these two edges but the robot.
            world.step(*follow_lane(after, robot_driver(DriverSettings(), 25.0), world.road, 5.0, STEP))
            if looks_farther:
                there = {name for name in libsumo.vehicle.getIDList() if name != ROBOT}
                read = {world.vehicle_names[number] for number in world._surroundings._now.seen.number}
                assert read == there
    assert seen[False] == seen[True]
    assert len(far) > 5
