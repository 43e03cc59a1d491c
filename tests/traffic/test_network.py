"""Which networks are roads, and what is said about those that are not."""

import gzip
import math

import numpy as np
import pytest

from hj_cosim.errors import NetworkError, SimulationError
from hj_cosim.locations import scenarios_folder
from hj_cosim.settings import NetworkSettings, RobotSettings, RobotStart, Scenario, TrafficSettings
from hj_cosim.traffic import net_file
from hj_cosim.traffic.network import read_road
from hj_cosim.traffic.sources.scenarios import network_path
from hj_cosim.traffic.sumo.world import SumoWorld


def net(tmp_path, lanes: list[str], edge: str = "main", before: str = "", internal: str = ""):
    """Write a network of one edge; a lane is what stands between `<lane id=… index=…` and `/>`."""
    written = "".join(f'<lane id="{edge}_{index}" index="{index}" {lane}/>' for index, lane in enumerate(lanes))
    path = tmp_path / "own.net.xml"
    path.write_text(
        f'<?xml version="1.0"?>{before}<net version="1.20"><location netOffset="0,0" convBoundary="0,0,1,1"'
        f' origBoundary="0,0,1,1" projParameter="!"/>{internal}'
        f'<edge id="{edge}" from="a" to="b" priority="1">{written}</edge>'
        '<junction id="a" type="dead_end" x="0" y="0" incLanes="" intLanes="" shape="0,0 0,1"/>'
        '<junction id="b" type="dead_end" x="900" y="0" incLanes="" intLanes="" shape="900,0 900,1"/></net>',
        encoding="utf-8",
    )
    return path


def lane(shape: str, length: float = 1000.0, **attributes: object) -> str:
    stated = {"speed": 30, "length": length, "width": 3.5, "shape": shape} | attributes
    return " ".join(f'{key}="{value}"' for key, value in stated.items() if value is not None)


STRAIGHT = [lane("0,0 1000,0"), lane("0,3.5 1000,3.5"), lane("0,7 1000,7")]


def slanted(angle: float, origin: tuple[float, float], count: int = 3, width: float = 3.5, length: float = 1000.0):
    """Return lanes of a road that starts at `origin` and heads along `angle`."""
    along = np.array([math.cos(angle), math.sin(angle)])
    left = np.array([-along[1], along[0]])
    starts = [np.array(origin) + width * index * left for index in range(count)]
    points = [(start, start + 0.4 * length * along, start + length * along) for start in starts]
    return [lane(" ".join(f"{x:.6f},{y:.6f}" for x, y in shape)) for shape in points]


@pytest.mark.parametrize(("name", "lanes"), [("two_lanes", 2), ("four_lanes", 4), ("six_lanes", 6)])
def test_our_own_roads_are_the_road_frame_itself(name, lanes):
    road = read_road(scenarios_folder() / f"{name}.net.xml", "highway")
    assert (road.lane_count, road.lane_width, road.length) == (lanes, 4.0, 10_000.0)
    assert (road.origin_x, road.origin_y, road.heading) == (0.0, 0.0, 0.0)


def test_a_road_may_start_anywhere_and_head_anywhere(tmp_path):
    road = read_road(net(tmp_path, slanted(2.0, (500.0, -80.0))), "main")
    assert road.lane_count == 3
    assert road.lane_width == 3.5
    assert road.length == pytest.approx(1000.0, abs=1e-4)
    assert (road.origin_x, road.origin_y, road.heading) == pytest.approx((500.0, -80.0, 2.0), abs=1e-6)


def test_the_robot_drives_on_a_users_slanted_road_as_on_ours(tmp_path):
    path = net(tmp_path, slanted(2.0, (500.0, -80.0)))
    scenario = Scenario(
        name="slanted",
        network=NetworkSettings(file=path.name, edge="main"),
        traffic=TrafficSettings(count=20, count_behind=5),
        robot=RobotStart(lane=1),
    )
    ours = scenario.model_copy(update={"network": NetworkSettings(file=str(ours_of_same_width(tmp_path)), edge="main")})
    speeds = []
    for one in (scenario, ours):
        with SumoWorld(one, RobotSettings(), seed=4, scenario_folder=tmp_path) as world:
            world.settle(2.0)
            seen = world.observe()
            speeds.append(seen.speed)
            assert np.abs(seen.heading).max() < 0.5
            assert np.all((seen.y > -0.1) & (seen.y < 7.1))
    np.testing.assert_allclose(speeds[0], speeds[1], atol=1e-3)


def ours_of_same_width(tmp_path):
    folder = tmp_path / "ours"
    folder.mkdir()
    return net(folder, STRAIGHT)


@pytest.mark.parametrize(
    ("lanes", "said"),
    [
        ([STRAIGHT[0]], "1 lane; two or more"),
        ([STRAIGHT[0], lane("0,3.5 500,6 1000,3.5")], "not straight and parallel"),
        ([STRAIGHT[0], lane("0,3.5 1000,5")], "not straight and parallel"),
        ([STRAIGHT[0], lane("0,-3.5 1000,-3.5")], "not straight and parallel"),
        ([STRAIGHT[0], lane("0,3.5 1000,3.5", width=3.0)], "3.00 m wide and lane 0 3.50 m"),
        ([lane("0,0 1000,0", width=2.0), lane("0,2 1000,2", width=2.0)], "at least 2.5 m"),
        ([STRAIGHT[0], lane("0,3.5 1000,3.5", length=900.0)], "states a length of 900.00 m"),
        ([STRAIGHT[0], lane("0,3.5,0 1000,3.5,30")], "slope"),
        ([STRAIGHT[0], lane("0,3.5 1000,3.5", allow="bus")], "does not admit cars"),
        ([STRAIGHT[0], lane("0,3.5 1000,3.5", disallow="truck passenger")], "does not admit cars"),
        ([STRAIGHT[0], lane("0,3.5 1000,3.5", disallow="all")], "does not admit cars"),
        ([lane("0,0 0.5,0", length=0.5), lane("0,3.5 0.5,3.5", length=0.5)], "name a longer one"),
        ([STRAIGHT[0], lane("0,3.5")], "readable"),
        ([STRAIGHT[0], lane("0,3.5 nan,3.5")], "readable"),
        ([STRAIGHT[0], lane("0,3.5 1000,3.5", length="long")], "readable"),
        ([STRAIGHT[0], lane("0,3.5 1000,3.5", length=None)], "readable"),
    ],
)
def test_what_is_not_a_straight_road_of_car_lanes_is_refused_in_a_sentence(tmp_path, lanes, said):
    path = net(tmp_path, lanes)
    with pytest.raises(NetworkError, match=said) as error:
        read_road(path, "main")
    assert str(path) in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("attributes", [{"allow": "passenger bus"}, {"allow": "all"}, {"disallow": "truck"}])
def test_lanes_for_cars_among_others_are_roads(tmp_path, attributes):
    assert read_road(net(tmp_path, [lane(f"0,{y} 1000,{y}", **attributes) for y in (0, 3.5)]), "main").lane_count == 2


def test_lanes_without_a_width_have_sumos(tmp_path):
    path = net(tmp_path, [lane(f"0,{y} 1000,{y}", width=None) for y in (0, 3.2)])
    assert read_road(path, "main").lane_width == 3.2


def test_an_unknown_edge_is_answered_with_those_that_exist(tmp_path):
    with pytest.raises(NetworkError, match=r"no edge 'highway'.*\(main\)"):
        read_road(net(tmp_path, STRAIGHT), "highway")
    inside = '<edge id=":a_0" function="internal"><lane id=":a_0_0" index="0" length="1" shape="0,0 1,0"/></edge>'
    with pytest.raises(NetworkError, match="no edge ':a_0'"):
        read_road(net(tmp_path, STRAIGHT, internal=inside), ":a_0")


def test_a_network_with_a_doctype_is_refused_before_anything_is_expanded(tmp_path):
    bomb = '<!DOCTYPE net [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;"><!ENTITY c "&b;&b;&b;&b;">]>'
    with pytest.raises(NetworkError, match="DOCTYPE"):
        read_road(net(tmp_path, STRAIGHT, before=bomb), "main")


@pytest.mark.parametrize("content", [b"", b"not xml", b"<net><edge id='main'>", b"<routes/>", b"\xff\xfe\x00"])
def test_what_is_not_a_network_is_refused(tmp_path, content):
    path = tmp_path / "broken.net.xml"
    path.write_bytes(content)
    with pytest.raises(NetworkError, match="not a SUMO network"):
        read_road(path, "main")


def test_a_network_without_a_version_is_refused_because_sumo_crashes_on_it(tmp_path):
    path = net(tmp_path, STRAIGHT)
    path.write_text(path.read_text().replace('version="1.20"', ""))
    with pytest.raises(NetworkError, match="states no version"):
        read_road(path, "main")


def test_what_sumo_itself_finds_wrong_is_told_in_one_sentence(tmp_path):
    path = net(tmp_path, STRAIGHT)
    path.write_text(path.read_text().replace('from="a"', 'from="nowhere"'))
    scenario = Scenario(
        name="broken", network=NetworkSettings(file=str(path), edge="main"), traffic=TrafficSettings(count=5)
    )
    with pytest.raises(
        SimulationError, match=r"cannot run scenario broken on .*: Unknown from-node 'nowhere'"
    ) as error:
        SumoWorld(scenario, RobotSettings(), seed=0)
    assert "\n" not in str(error.value)


def test_a_missing_network_names_where_it_was_looked_for(tmp_path):
    with pytest.raises(NetworkError, match=r"'none\.net\.xml' is not in .*set network\.file"):
        network_path(NetworkSettings(file="none.net.xml"), tmp_path)
    with pytest.raises(NetworkError, match="cannot read the network"):
        read_road(tmp_path / "none.net.xml", "main")


def test_a_network_beside_the_scenario_wins_over_ours(tmp_path):
    own = tmp_path / "four_lanes.net.xml"
    own.write_text("<net/>")
    assert network_path(NetworkSettings(), tmp_path) == own
    assert network_path(NetworkSettings()) == scenarios_folder() / "four_lanes.net.xml"


def packed(path):
    folded = path.with_name(f"{path.name}.gz")
    folded.write_bytes(gzip.compress(path.read_bytes()))
    path.unlink()
    return folded


def test_a_packed_network_is_the_same_road_to_us_and_to_sumo(tmp_path):
    plain = net(tmp_path, STRAIGHT)
    road = read_road(plain, "main")
    path = packed(plain)
    assert read_road(path, "main") == road
    scenario = Scenario(
        name="packed", network=NetworkSettings(file=path.name, edge="main"), traffic=TrafficSettings(count=5)
    )
    with SumoWorld(scenario, RobotSettings(), seed=0, scenario_folder=tmp_path) as world:
        world.settle(0.5)
        assert len(world.observe().x) == 5


def test_a_packed_network_that_unpacks_to_far_too_much_is_refused_before_it_is_in_memory(tmp_path, monkeypatch):
    monkeypatch.setattr(net_file, "LARGEST_NETWORK", 2 * net_file.READ_AT_ONCE)
    path = tmp_path / "bomb.net.xml.gz"
    path.write_bytes(gzip.compress(b'<net version="1.20">' + b" " * 8 * net_file.READ_AT_ONCE))
    assert path.stat().st_size < 50_000
    with pytest.raises(NetworkError, match=r"bomb\.net\.xml\.gz is too large; 2 MB of network is the most"):
        read_road(path, "main")


@pytest.mark.parametrize(
    "damage", [lambda data: b"not gzip", lambda data: data[:-20], lambda data: data[:40] + b"\0" * 40]
)
def test_a_packed_network_that_is_broken_is_refused_in_a_sentence(tmp_path, damage):
    path = packed(net(tmp_path, STRAIGHT))
    path.write_bytes(damage(path.read_bytes()))
    with pytest.raises(NetworkError, match=r"own\.net\.xml\.gz is not a SUMO network") as error:
        read_road(path, "main")
    assert "\n" not in str(error.value)
