"""Roads read from chains of edges: our own networks, users' real ones where they are at hand, and what is refused."""

import gzip
import math
import os
from pathlib import Path

import libsumo
import numpy as np
import pytest

from hj_cosim.errors import ConfigurationError, NetworkError
from hj_cosim.locations import scenarios_folder
from hj_cosim.settings import NetworkSettings, validate
from hj_cosim.traffic.route import read_network
from hj_cosim.traffic.smoothing import smooth_knots

REAL = Path(os.environ.get("HJ_COSIM_REAL_NETWORKS", "no such folder"))
CURVES = scenarios_folder() / "curves.net.xml"
RAMPS = scenarios_folder() / "ramps.net.xml"


CUT = 5.2  # m a radian of a corner in the lanes, by which the smooth road cuts it


def read(path: Path, **network: object):
    return read_network(path, NetworkSettings(file=str(path), **network))


def deviations(road, lanes) -> tuple[np.ndarray, np.ndarray]:
    """How far SUMO's lanes are from the road's, every 10 m: across it, and along it."""
    across, along = [], []
    for section in lanes.sections:
        for number, chain in section.lanes.items():
            for lane in chain:
                place = lanes.by_name[lane.name]
                for position in np.linspace(0.0, lane.length, max(int(lane.length / 10.0), 2)):
                    x, y, _ = lane.world(float(position), 0.0)
                    expected = place.start + place.scale * position
                    s, d, _ = road.from_world(x, y, 0.0, expected)
                    across.append(abs(d - road.lane_centre(number, s)))
                    along.append(abs(s - expected))
    return np.array(across), np.array(along)


def beside_what_explains_it(road, lanes) -> tuple[np.ndarray, np.ndarray]:
    """What of the deviations is left, along the road beside SUMO's shear, and across it beside the smoothing, m.

    SUMO gives all lanes of an edge one length, and spreads each lane's own over it evenly, though a bend makes it
    longer or shorter only where it is: a lane `aside` m beside the middle is drawn aside (φ(s) − s/L φ(L)) m ahead of
    it, φ being what the road has turned since the edge began. The corners that are smoothed are the same for all lanes.
    """
    along, across = [], []
    for section in lanes.sections:
        share = np.linspace(0.0, 1.0, 51)
        turned = np.unwrap([road.heading_at(section.start + section.length * each) for each in share])
        sheared = turned - turned[0] - share * (turned[-1] - turned[0])
        middle = 0.5 * (min(section.lanes) + max(section.lanes))
        for at in np.linspace(0.0, section.length, max(int(section.length / 10.0), 2)):
            off = []
            for number in section.lanes:
                lane, position = lanes.place(number, section.start + min(float(at), section.length - 1e-6))
                x, y, _ = lane.world(position, 0.0)
                s, d, _ = road.from_world(x, y, 0.0, section.start + float(at))
                ahead = (number - middle) * road.lane_width * np.interp(at / section.length, share, sheared)
                along.append(abs(s - section.start - at - ahead))
                off.append(d - road.lane_centre(number, s))
            across.append(np.ptp(off))
    return np.array(along), np.array(across)


@pytest.mark.parametrize(("name", "stop"), [("curves", "e37"), ("ramps", "m4"), ("lane_drop", "e3")])
def test_our_own_roads_lie_where_sumo_draws_their_lanes(name, stop):
    start = {"ramps": "m0"}.get(name, "e0")
    road, lanes = read(scenarios_folder() / f"{name}.net.xml", from_edge=start, to_edge=stop)
    across, along = deviations(road, lanes)
    assert across.max() < 0.1
    assert along.max() < 0.15
    middle = [road.stretch_at(s, road.lane_width) for s in np.arange(5.0, road.length, 7.0)]
    assert np.abs(np.array(middle) - 1.0).max() < (0.005 if name == "curves" else 0.012)


def test_lane_positions_are_where_sumo_has_them():
    road, lanes = read(CURVES, from_edge="e0", to_edge="e37")
    libsumo.start(["sumo", "--net-file", str(CURVES), "--no-step-log", "true"])
    try:
        for s in np.linspace(3.0, road.length - 3.0, 200):
            for number in road.lanes_at(s):
                lane, position = lanes.place(number, s)
                expected = libsumo.simulation.convert2D(lane.edge, position, lane.index)
                x, y, _ = lane.world(position, 0.0)
                assert math.hypot(x - expected[0], y - expected[1]) < 1e-6
                own = road.to_world(s, road.lane_centre(number, s), 0.0)
                assert math.hypot(own[0] - expected[0], own[1] - expected[1]) < 0.2
    finally:
        libsumo.close()


def test_bends_have_the_radii_that_they_were_drawn_with():
    road, _ = read(CURVES, from_edge="e0", to_edge="e37")
    curvature = np.array([road.curvature_at(s) for s in np.arange(0.0, road.length, 1.0)])
    assert 1.0 / road.sharpest == pytest.approx(400.0, rel=0.02)
    for radius in (1500.0, -1000.0, 1000.0, -700.0, 500.0, -500.0, 400.0, -600.0):
        assert (np.abs(curvature - 1.0 / radius) < 5e-5).sum() > 200
    assert np.abs(np.diff(curvature)).max() < 5e-5


def test_a_lane_keeps_its_number_over_ramps_and_begins_and_ends_with_them():
    road, lanes = read(RAMPS, from_edge="m0", to_edge="m4")
    assert road.lane_count == 4
    assert [(at, *road.lanes_at(at)) for at in (1000.0, 1600.0, 2000.0, 3100.0, 3400.0)] == [
        (1000.0, 1, 2, 3), (1600.0, 0, 1, 2, 3), (2000.0, 1, 2, 3), (3100.0, 0, 1, 2, 3), (3400.0, 1, 2, 3),
    ]  # fmt: skip
    assert road.lane_end(0, 1600.0) == pytest.approx(1750.0, abs=5.0)
    assert road.lane_end(1, 1000.0) == math.inf
    assert (lanes.index_on("m0", 1), lanes.index_on("in_1", 1), lanes.index_on("m0", 0)) == (0, 1, None)
    lane, position = lanes.place(1, 1600.0)
    assert (lane.edge, lane.index) == ("in_1", 1)
    assert position == pytest.approx(100.0, abs=3.0)
    assert lanes.place(0, 2000.0) is None


def test_a_lane_drop_ends_the_right_lane_and_begins_it_again():
    road, _ = read(scenarios_folder() / "lane_drop.net.xml", from_edge="e0", to_edge="e3")
    assert [list(road.lanes_at(at)) for at in (500.0, 3000.0, 5000.0, 7000.0)] == [[0, 1, 2], [1, 2], [0, 1, 2], [1, 2]]
    assert road.lane_end(0, 5000.0) == pytest.approx(6000.0, abs=10.0)


def test_a_ring_is_as_long_as_its_laps_and_ends_where_it_begins():
    edges = [f"e{number}" for number in range(10)]
    road, lanes = read(scenarios_folder() / "ring.net.xml", route=edges, laps=3)
    assert road.length == 3 * road.lap
    assert road.to_world(road.lap - 1e-9, 3.0, 0.0) == pytest.approx(road.to_world(0.0, 3.0, 0.0), abs=1e-6)
    (lane, position), (first_lane, first_position) = lanes.place(1, 2.5 * road.lap), lanes.place(1, 0.5 * road.lap)
    assert lane is first_lane
    assert position == pytest.approx(first_position, abs=1e-6)
    assert lanes.route.split() == edges * 3


def test_the_shortest_route_is_found_and_a_packed_network_is_the_same(tmp_path):
    packed = tmp_path / "ramps.net.xml.gz"
    packed.write_bytes(gzip.compress(RAMPS.read_bytes()))
    _, lanes = read(packed, from_edge="on_1", to_edge="off_1")
    assert lanes.edges == ("on_1", "in_1", "m1", "out_1", "off_1")


def test_who_comes_by_a_ramp_has_the_ramps_lane_first():
    road, _ = read(RAMPS, route=["on_1", "in_1", "m1"])
    assert list(road.lanes_at(100.0)) == [0]
    assert list(road.lanes_at(600.0)) == [0, 1, 2, 3]
    assert list(road.lanes_at(1000.0)) == [1, 2, 3]


@pytest.mark.parametrize(
    ("network", "said"),
    [
        ({"route": ["m0", "m1"]}, "edge 'm0' does not lead to 'm1' but to in_1"),
        ({"route": ["m0", "nowhere"]}, r"has no edge 'nowhere'; it has in_1, in_2"),
        ({"from_edge": "m4", "to_edge": "m0"}, "no route leads from edge 'm4' to edge 'm0'"),
        ({"from_edge": ":n1_1", "to_edge": "m0"}, "has no edge ':n1_1'"),
        ({"route": ["m0", "in_1"], "laps": 2}, "edge 'in_1' does not lead to 'm0' but to m1"),
    ],
)
def test_edges_that_are_no_road_are_refused_in_a_sentence(network, said):
    with pytest.raises(NetworkError, match=said) as error:
        read(RAMPS, **network)
    assert str(RAMPS) in str(error.value)


def test_a_network_without_lanes_in_its_junctions_is_refused(tmp_path):
    path = tmp_path / "gaps.net.xml"
    text = RAMPS.read_text()
    for number in range(3):
        text = text.replace(f' via=":n2_0_{number}"', "")
    path.write_text(text)
    with pytest.raises(NetworkError, match=r"no lanes inside the junction from edge 'in_1' to 'm1'.*no-internal-links"):
        read(path, from_edge="m0", to_edge="m4")


@pytest.mark.parametrize(
    ("network", "said"),
    [
        ({"from_edge": "m0"}, "go together"),
        ({"route": ["m0"], "from_edge": "m0", "to_edge": "m1"}, "say the same thing twice"),
        ({"laps": 2}, "needs a route"),
        ({"route": []}, "route"),
    ],
)
def test_settings_that_name_no_route_are_refused(network, said):
    with pytest.raises(ConfigurationError, match=said):
        validate(NetworkSettings, network, "mine.toml")


def test_smoothing_takes_the_corners_off_and_leaves_a_circle_where_it_is():
    along = np.arange(0.0, 601.0, 50.0)
    angle = along / 500.0
    circle = 500.0 * np.column_stack([np.sin(angle), 1.0 - np.cos(angle)])
    knots = smooth_knots(along, circle, 600.0, closed=False)
    distance = np.hypot(*(knots - [0.0, 500.0]).T)
    assert np.abs(distance - 500.0).max() < 50.0**2 / 8.0 / 500.0 + 0.05
    turns = np.diff(np.unwrap(np.arctan2(*np.diff(knots, axis=0).T[::-1])))
    assert turns.max() < 2.0 * 10.0 / 500.0  # the polyline's own are 5 times as sharp


def test_a_corner_is_cut_by_five_metres_a_radian_whatever_its_angle():
    for angle in (0.02, 0.1, -0.2):
        corner = np.array([[0.0, 0.0], [600.0, 0.0], [600.0 + 600.0 * math.cos(angle), 600.0 * math.sin(angle)]])
        knots = smooth_knots(np.array([0.0, 600.0, 1200.0]), corner, 1200.0, closed=False)
        cut = np.hypot(*(knots[60] - corner[1]))
        assert cut / abs(angle) == pytest.approx(CUT, rel=0.02)
        assert np.abs(knots[:50, 1]).max() < 0.3 * cut  # 100 m before it the road is where the lanes are


# Main carriageways of real motorways, as crowds have drawn them: a vertex every 50 m and kinks of some degrees.
@pytest.mark.skipif(not REAL.is_dir(), reason="HJ_COSIM_REAL_NETWORKS names no folder of real networks")
@pytest.mark.parametrize(
    ("file", "start", "stop", "lanes_of_road"),
    [
        ("sumo_ramp/ramp/ramp.net.xml", "gneE7", "gneE11", 3),
        ("a10kw/A10KW/osm.net.xml", "264306385", "264308376", 4),
        ("a10kw/A10KW/osm.net.xml", "290296351", "264308373", 4),
        ("nds_a2_a39/nds_a2_a39.net.xml", "81646004", "270440691", 5),
    ],
)
def test_real_motorways_become_roads(file, start, stop, lanes_of_road):
    road, lanes = read(REAL / file, from_edge=start, to_edge=stop)
    assert road.lane_count == lanes_of_road
    across, along = deviations(road, lanes)
    assert np.quantile(across, 0.95) < 0.3
    assert np.quantile(along, 0.95) < 1.0
    assert np.quantile(beside_what_explains_it(road, lanes)[0], 0.95) < 0.11
    assert beside_what_explains_it(road, lanes)[1].max() < 0.05
    random = np.random.default_rng(0)
    for s, d, heading in random.uniform((0.0, -2.0, -0.5), (road.length, 15.0, 0.5), (300, 3)):
        back = road.from_world(*road.to_world(s, d, heading), s + random.uniform(-5.0, 5.0))
        assert back == pytest.approx((s, d, heading), abs=1e-6)


def test_a_network_that_is_asked_for_again_is_read_once_and_one_that_has_changed_anew(tmp_path):
    copy = tmp_path / "curves.net.xml"
    copy.write_bytes(CURVES.read_bytes())
    first = read(copy, from_edge="e0", to_edge="e37")
    assert read(copy, from_edge="e0", to_edge="e37")[0] is first[0]
    assert read(copy, from_edge="e0", to_edge="e3")[0].length < first[0].length
    copy.write_text(copy.read_text().replace('speed="', 'speed="1', 1))
    assert read(copy, from_edge="e0", to_edge="e37")[0] is not first[0]
