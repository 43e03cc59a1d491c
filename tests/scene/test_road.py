"""The road frame, checked against rotations written out with complex numbers and bodies laid over lanes by hand."""

import dataclasses
import json

import numpy as np
import pytest

from hj_cosim.scene.road import Road, StraightRoad
from hj_cosim.scene.road_text import road_from_json, road_to_json


def test_a_road_along_x_from_the_origin_is_the_identity():
    road = StraightRoad(lane_count=4)
    x, y, heading = np.array([3.0, 900.0]), np.array([-1.0, 12.5]), np.array([0.1, -0.2])
    np.testing.assert_array_equal(road.to_world(x, y, heading), [x, y, heading])


def test_world_coordinates_agree_with_a_rotation_of_the_complex_plane():
    road = StraightRoad(lane_count=3, origin_x=100.0, origin_y=-50.0, heading=2.3)
    random = np.random.default_rng(0)
    along, lateral, heading = random.uniform(-100, 100, (3, 50))
    x, y, world_heading = road.to_world(along, lateral, heading)
    np.testing.assert_allclose(x + 1j * y, (100 - 50j) + (along + 1j * lateral) * np.exp(2.3j), atol=1e-12)
    np.testing.assert_allclose(world_heading, heading + 2.3)


def test_a_straight_road_heads_where_its_centre_line_goes_and_does_not_bend():
    road: Road = StraightRoad(lane_count=3, origin_x=100.0, heading=-0.7)
    for along in (0.0, 512.5):
        (x_0, y_0, _), (x_1, y_1, _) = (road.to_world(at, 0.0, 0.0) for at in (along, along + 1.0))
        assert road.heading_at(along) == pytest.approx(np.arctan2(y_1 - y_0, x_1 - x_0))
        assert road.curvature_at(along) == 0.0
        assert list(road.lanes_at(along)) == [0, 1, 2]


@pytest.mark.parametrize(
    ("lateral", "lane"), [(-9.0, 0), (-1.9, 0), (1.74, 0), (1.76, 1), (3.5, 1), (7.0, 2), (8.7, 2), (99.0, 2)]
)
def test_a_lateral_offset_belongs_to_the_nearest_lane_of_the_road(lateral, lane):
    road = StraightRoad(lane_count=3, lane_width=3.5)
    assert road.lane_at(lateral, 10.0) == lane
    assert road.nearest_lanes(np.array([lateral, 0.0]), np.zeros(2)).tolist() == [lane, 0]
    assert road.lane_centre(lane, 10.0) == 3.5 * lane
    assert road.lane_centres(np.array([lane, 1]), np.zeros(2)).tolist() == [3.5 * lane, 3.5]


def test_lines_run_half_a_lane_beside_the_centre_lines():
    assert StraightRoad(3, 3.5).lane_lines(10.0).tolist() == [-1.75, 1.75, 5.25, 8.75]


def test_a_body_overlaps_the_lanes_that_it_has_a_part_in():
    road = StraightRoad(lane_count=4, lane_width=3.5)
    lines = road.lane_lines(0.0)
    random = np.random.default_rng(1)
    seen = set()
    for lateral, width in zip(random.uniform(-5.0, 16.0, 2000), random.uniform(0.5, 8.0, 2000), strict=True):
        right, left = lateral - 0.5 * width, lateral + 0.5 * width
        expected = [lane for lane in range(4) if right < lines[lane + 1] and left > lines[lane]]
        assert list(road.lanes_overlapped(lateral, width, 0.0)) == expected
        for lane in range(4):
            assert (abs(lateral - 3.5 * lane) < road.overlap_reach(width)) == (lane in expected)
        seen.add(len(expected))
    assert seen == {0, 1, 2, 3, 4}


def test_a_road_survives_being_written_and_what_is_none_is_refused():
    road = StraightRoad(lane_count=3, lane_width=3.5, length=812.5, origin_x=1.25, origin_y=-3.0, heading=0.1)
    assert json.loads(road_to_json(road)) == dataclasses.asdict(road)
    assert road_from_json(road_to_json(road)) == road
    for text in ("{}", "[1]", "not json", '{"lane_count": "many"}'):
        with pytest.raises(ValueError, match="does not describe a road"):
            road_from_json(text)


def test_a_body_that_only_touches_a_lane_does_not_overlap_it():
    road = StraightRoad(lane_count=3, lane_width=4.0)
    assert road.lanes_overlapped(4.0, 4.0, 0.0) == range(1, 2)  # as wide as its lane, and in the middle of it
    assert road.lanes_overlapped(4.0, 4.01, 0.0) == range(3)
