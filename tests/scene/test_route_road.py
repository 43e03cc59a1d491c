"""Roads that bend, against circles and clothoids in closed form."""

import json
import math

import numpy as np
import pytest
from bent_roads import WIDTH, circle, road_through
from scipy.special import fresnel

from hj_cosim.scene.road_text import road_from_json, road_to_json


@pytest.mark.parametrize("radius", [300.0, -300.0, 1500.0])
def test_a_road_round_a_circle_is_that_circle(radius):
    road = circle(radius)
    random = np.random.default_rng(0)
    for along, lateral in random.uniform((50.0, -2.0), (950.0, 9.0), (50, 2)):
        angle, reach = along / radius, radius - (lateral - 2 * WIDTH)
        x, y, heading = road.to_world(along, lateral, 0.1)
        assert (x, y) == pytest.approx((reach * math.sin(angle), radius - reach * math.cos(angle)), abs=1e-5)
        assert math.remainder(heading - angle - 0.1, math.tau) == pytest.approx(0.0, abs=1e-6)
        assert road.curvature_at(along) == pytest.approx(1.0 / radius, abs=1e-6)
        assert road.stretch_at(along, lateral) == pytest.approx(reach / radius, abs=1e-5)
        assert road.bend_rate(along, lateral, 30.0) == pytest.approx(30.0 / reach, rel=1e-4)


def test_the_curvature_of_a_clothoid_grows_as_it_goes_on():
    size = math.sqrt(400.0 * 200.0)  # of radius 400 m after 200 m
    along = np.arange(0.0, 201.0, 10.0)
    sine, cosine = fresnel(along / (size * math.sqrt(math.pi)))
    road = road_through(size * math.sqrt(math.pi) * np.column_stack([cosine, sine]), 200.0)
    for at in np.linspace(20.0, 180.0, 33):
        assert road.curvature_at(at) == pytest.approx(at / size**2, abs=2e-6)
        assert road.heading_at(at) == pytest.approx(at**2 / (2.0 * size**2), abs=1e-5)
        sine, cosine = fresnel(at / (size * math.sqrt(math.pi)))
        expected = size * math.sqrt(math.pi) * np.array([cosine, sine])
        assert road.to_world(at, 2 * WIDTH, 0.0)[:2] == pytest.approx(expected, abs=1e-5)


def test_places_go_to_the_world_and_back():
    road = circle(-300.0)
    random = np.random.default_rng(1)
    for along, lateral, heading in random.uniform((-20.0, -3.0, -1.0), (1020.0, 12.0, 1.0), (300, 3)):
        back = road.from_world(*road.to_world(along, lateral, heading), along + random.uniform(-20.0, 20.0))
        assert back == pytest.approx((along, lateral, heading), abs=1e-7)


def test_many_places_at_once_are_where_each_is():
    road = circle(500.0)
    along, lateral, heading = np.random.default_rng(2).uniform(0.0, 9.0, (3, 2, 5))
    together = np.array(road.to_world(along, lateral, heading))
    assert together.shape == (3, 2, 5)
    for place in np.ndindex(2, 5):
        alone = road.to_world(float(along[place]), float(lateral[place]), float(heading[place]))
        np.testing.assert_allclose(together[:, *place], alone, rtol=0, atol=1e-12)


CHANGING = {
    "lane_count": 4,
    "section_start": np.array([0.0, 300.0, 600.0]),
    "first_lane": np.array([1, 0, 1]),
    "lanes_there": np.array([3, 4, 2]),
    "leading_off": np.array([0, 0b0001, 0]),
}


def test_lanes_begin_and_end_and_keep_their_numbers():
    road = circle(1000.0, **CHANGING)
    assert [list(road.lanes_at(at)) for at in (0.0, 299.9, 300.0, 599.0, 600.0, 2000.0)] == [
        [1, 2, 3], [1, 2, 3], [0, 1, 2, 3], [0, 1, 2, 3], [1, 2], [1, 2],
    ]  # fmt: skip
    assert [road.lane_end(lane, 400.0) for lane in range(4)] == [600.0, math.inf, math.inf, 600.0]
    assert road.lane_end(3, 10.0) == 600.0
    assert [road.leads_off(lane, 400.0) for lane in range(4)] == [True, False, False, False]
    assert not road.leads_off(1, 10.0)
    assert [road.lane_at(0.0, at) for at in (100.0, 400.0, 700.0)] == [1, 0, 1]
    assert [road.lane_at(10.5, at) for at in (100.0, 400.0, 700.0)] == [3, 3, 2]
    both = road.nearest_lanes(np.array([0.0, 0.0, 10.5]), np.array([100.0, 400.0, 700.0]))
    assert both.tolist() == [1, 0, 2]
    assert list(road.lanes_overlapped(1.6, 2.0, 100.0)) == [1]
    assert list(road.lanes_overlapped(1.6, 2.0, 400.0)) == [0, 1]
    assert road.lane_lines(700.0).tolist() == [1.75, 5.25, 8.75]


@pytest.mark.parametrize("ahead", [0.0, 50.0, 150.0, 400.0])
def test_the_lanes_that_last_are_those_that_exist_at_every_place_on_the_way(ahead):
    road = circle(1000.0, **CHANGING)
    along = np.linspace(0.0, 900.0, 46)
    found = road.lasting_lanes(along, ahead)
    for s, (first, last) in zip(along, found, strict=True):
        everywhere = set(range(4)).intersection(*(road.lanes_at(at) for at in np.linspace(s, s + ahead, 200)))
        assert set(range(first, last + 1)) == everywhere


def test_a_closed_road_goes_on_and_on():
    angle = np.linspace(0.0, math.tau, 201)
    lap = math.tau * 318.0
    knots = 318.0 * np.column_stack([np.sin(angle), -np.cos(angle)])
    knots[-1] = knots[0]
    road = road_through(knots, 5 * lap, lap=lap)
    for along in (3.0, lap - 1e-6, 4.2 * lap):
        x, y, heading = road.to_world(along, 7.0, 0.0)
        assert math.hypot(x, y) == pytest.approx(318.0, abs=1e-4)
        assert road.from_world(x, y, heading, along + 5.0) == pytest.approx((along, 7.0, 0.0), abs=1e-6)
        assert road.curvature_at(along) == pytest.approx(1.0 / 318.0, abs=1e-6)
    assert road.lane_end(0, 4.2 * lap) == math.inf


def test_a_route_survives_being_written_and_what_is_none_is_refused():
    road = circle(700.0, **CHANGING)
    text = road_to_json(road)
    again = road_from_json(text)
    assert road_to_json(again) == text
    assert again.to_world(512.0, 3.0, 0.1) == road.to_world(512.0, 3.0, 0.1)
    written = json.loads(text)
    for key, wrong in (
        ("knots", [[0.0, 0.0]] * 4),
        ("knots", written["knots"][:3]),
        ("section_start", [0.0, 600.0, 300.0]),
        ("section_start", [10.0, 300.0, 600.0]),
        ("lanes_there", [3, 4]),
        ("leading_off", [0, 0]),
        ("lane_count", 3),
        ("lane_width", 0.0),
        ("knots", [[0.0, None]] * 9),
        ("lap", 100.0),
    ):
        with pytest.raises(ValueError, match="does not describe a road"):
            road_from_json(json.dumps(written | {key: wrong}))
