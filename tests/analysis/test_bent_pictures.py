"""Drives on bends, drawn where they are."""

import base64
import json

import numpy as np
import pytest
from bent_roads import WIDTH, circle

from hj_cosim.analysis.figures.drive_map import drive_map
from hj_cosim.analysis.figures.snapshots import BEHIND, snapshots
from hj_cosim.analysis.figures.style import PAGE
from hj_cosim.analysis.replay import AHEAD, HEADER, FrameArtist
from hj_cosim.analysis.replay import BEHIND as SHOWN_BEHIND
from hj_cosim.analysis.replay import WIDTH as PIXELS
from hj_cosim.analysis.replay_data import EVERY, replay_data
from hj_cosim.analysis.view import View, height_of, stretches
from hj_cosim.recording.run_folder import Run
from hj_cosim.scene.road import StraightRoad
from hj_cosim.settings import TrackingSettings


@pytest.fixture
def run(make_record, config, tmp_path) -> Run:
    return Run(tmp_path, config.model_dump(mode="json"), {}, make_record(samples=60, road=circle(300.0)))


def test_a_view_keeps_distances_and_looks_along_the_road():
    road = circle(-250.0)
    view = View(road, 400.0)
    random = np.random.default_rng(0)
    places = random.uniform((300.0, -2.0), (500.0, 9.0), (40, 2))
    shown = view.points(places)
    x, y, _ = road.to_world(places[:, 0], places[:, 1], np.zeros(40))
    between = np.abs((x + 1j * y)[:, None] - (x + 1j * y))
    np.testing.assert_allclose(np.abs((shown @ [1, 1j])[:, None] - shown @ [1, 1j]), between, atol=1e-9)
    here = view.place(np.array([400.0]), np.array([3.0]), np.array([0.1]))
    assert [float(each[0]) for each in here] == pytest.approx([400.0, 3.0, 0.1], abs=1e-9)
    assert view.points(np.array([[440.0, 0.0]]))[0, 1] < -2.0  # it bends to the right


def test_a_view_of_a_straight_road_is_the_road_frame():
    places = np.array([[1.0, 2.0], [3.0, 4.0]])
    assert View(StraightRoad(4, heading=1.0), 5.0).points(places) is places


def test_what_is_drawn_of_a_road_ends_where_its_lanes_do():
    parts = {"section_start": np.array([0.0, 600.0]), "first_lane": np.array([0, 1])}
    road = circle(1000.0, **parts, lanes_there=np.array([3, 2]), leading_off=np.array([0, 0]))
    (before, all_lines), (after, fewer) = stretches(road, 500.0, 700.0)
    assert all_lines.tolist() == [-1.75, 1.75, 5.25, 8.75]
    assert fewer.tolist() == [1.75, 5.25, 8.75]
    assert before[0] == 500.0
    assert before[-1] == after[0] == pytest.approx(600.0, abs=5.0)
    assert after[-1] == 700.0
    assert len(stretches(road, 0.0, 500.0)) == 1


def test_a_picture_is_high_enough_for_the_bend():
    low, high = height_of(circle(300.0), np.array([400.0]), 50.0, 100.0)
    assert low == pytest.approx(-0.5 * WIDTH, abs=0.1)
    assert high == pytest.approx(2.5 * WIDTH + 300.0 * (1.0 - np.cos(100.0 / 300.0)), abs=0.5)
    assert height_of(StraightRoad(3, WIDTH), np.array([400.0]), 50.0, 100.0) == (-1.75, 8.75)


def test_the_map_has_the_drive_in_the_world(run):
    data, road, robot = drive_map(run).data, run.record.road, run.record.robot
    x, y, _ = road.to_world(robot.x, robot.y, robot.heading)
    np.testing.assert_allclose(data[["x", "y"]].to_numpy(), np.column_stack([x, y]))
    np.testing.assert_array_equal(data.speed, robot.speed)


def test_the_snapshots_of_a_bend_keep_the_road_frame_in_their_data(run):
    data = snapshots(run).data
    robot = data[data.vehicle == "robot"]
    assert robot.x.to_numpy()[0] == run.record.robot.x[0]
    assert (np.abs(data.x - data.time.map(robot.set_index("time").x)) < BEHIND[PAGE] + 70.0).all()


def test_frames_show_the_robot_at_its_place_and_the_asphalt_where_the_road_bends_to(run, table):
    artist, record, sample = FrameArtist(run, table), run.record, 30
    frame = np.asarray(artist.frame(sample)).astype(int)
    scale = PIXELS / (SHOWN_BEHIND + AHEAD)
    view = View(record.road, float(record.robot.x[sample]))
    top = height_of(record.road, record.robot.x[::50], SHOWN_BEHIND, AHEAD)[1] + 1.0

    def pixel(s: float, d: float) -> np.ndarray:
        x, y = view.points(np.array([[record.robot.x[sample] + s, d]]))[0]
        return frame[round(HEADER + (top - y) * scale), round((x - record.robot.x[sample] + SHOWN_BEHIND) * scale)]

    red, green, blue = pixel(0.0, float(record.robot.y[sample]))
    assert red > 180
    assert blue < 60
    assert green < red
    beside = frame[round(HEADER + (top - 0.3 * WIDTH) * scale), round((90.0 + SHOWN_BEHIND) * scale)]
    assert beside.tolist() == [255, 255, 255]  # where a straight road would be
    assert 225 < pixel(95.0, -1.2).min() < 250  # asphalt


def test_the_page_has_the_bends_line_and_lanes_and_a_straight_roads_page_has_none(run, make_record, table):
    bend = replay_data(run.record, table, TrackingSettings())["bend"]
    x, y, heading = (np.frombuffer(base64.b64decode(bend[name]["data"]), "<f4") for name in ("x", "y", "heading"))
    radius = 300.0 + 2 * WIDTH  # d = 0 is the right lane's
    along = bend["start"] + EVERY * np.arange(len(x))
    assert bend["start"] < run.record.robot.x.min() - 120.0
    assert along[-1] > run.record.robot.x.max() + 120.0
    on_road = along > 0.0
    np.testing.assert_allclose(heading[on_road], along[on_road] / 300.0, atol=1e-3)
    turned = np.unwrap(np.arctan2(*np.diff(np.stack([y, x]), axis=1)))
    np.testing.assert_allclose(np.hypot(np.diff(x), np.diff(y))[on_road[:-1]], EVERY * radius / 300.0, atol=2e-3)
    np.testing.assert_allclose(np.diff(turned)[on_road[:-2]], EVERY / 300.0, atol=2e-3)
    assert [each[2:] for each in bend["stretches"]] == [[-0.5 * WIDTH, 3]]
    assert bend["high"] - bend["low"] > 3 * WIDTH + 14.0  # 100 m ahead it has gone 16 m aside
    straight = replay_data(make_record(samples=20), table, TrackingSettings())
    assert "bend" not in json.loads(json.dumps(straight))
