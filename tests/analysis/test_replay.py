import base64
import math
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image, ImageSequence

from hj_cosim.analysis.figures.value_plot import value_colours
from hj_cosim.analysis.plan_path import plan_path, tracking_of
from hj_cosim.analysis.replay import AHEAD, BEHIND, HEADER, WIDTH, FrameArtist, frame_samples, write_replay
from hj_cosim.analysis.replay_data import replay_data
from hj_cosim.analysis.values import car_values
from hj_cosim.errors import OutputError
from hj_cosim.recording.run_folder import Run
from hj_cosim.settings import TrackingSettings

CODER = """#!{python}
import pathlib, sys
pathlib.Path(sys.argv[-1]).write_bytes(sys.stdin.buffer.read())
"""
BROKEN_CODER = """#!{python}
import math
import sys
sys.exit("unknown encoder")
"""


@pytest.fixture
def run(make_record, config, tmp_path) -> Run:
    record = make_record(samples=101)
    record.robot.intervening[:] = np.arange(101) >= 50
    return Run(tmp_path, config.model_dump(mode="json"), {}, record)


def test_a_gif_lasts_as_long_as_the_drive(run, table):
    seen = []
    path = write_replay(run, table, progress=lambda done, total: seen.append((done, total)))
    with Image.open(path) as image:
        durations = [frame.info["duration"] for frame in ImageSequence.Iterator(image)]
    assert path == run.folder / "replay.gif"
    assert sum(durations) == pytest.approx(2000.0, abs=100.0)
    assert seen[-1] == (26, 26)


def test_frames_are_evenly_spaced_and_end_with_the_last_sample():
    time = 0.02 * np.arange(1500)
    samples = frame_samples(time, 0.08)
    assert set(np.diff(samples[:-1])) == {4}
    assert samples[-1] == 1499


def test_cars_are_drawn_at_their_places_in_the_colours_of_their_values(run, table):
    record, sample = run.record, 60
    frame = np.asarray(FrameArtist(run, table).frame(sample))
    scale = WIDTH / (BEHIND + AHEAD)

    def pixel(x: float, y: float) -> np.ndarray:
        return frame[round(HEADER + (15.0 - y) * scale), round((x - record.robot.x[sample] + BEHIND) * scale)]

    values = car_values(record, table)[sample]
    ahead = record.traffic.x[sample] - record.robot.x[sample]
    alone = [
        car
        for car in np.flatnonzero(record.traffic.present[sample] & (np.abs(ahead - 25) < 70) & (np.abs(ahead) > 6))
        if np.sum(np.abs(record.traffic.x[sample] - record.traffic.x[sample, car]) < 6.0) == 1
        and abs(record.traffic.y[sample, car] - record.robot.y[sample]) > 3.0
    ]
    assert len(alone) >= 2
    for car in alone:
        expected = np.round(255 * value_colours(values[car : car + 1])[0][:3])
        np.testing.assert_allclose(
            pixel(record.traffic.x[sample, car], record.traffic.y[sample, car]), expected, atol=2
        )
    np.testing.assert_array_equal(frame[2, 2], [0xF0, 0xE4, 0x42])  # the filter intervenes


def test_a_ring_around_a_car_is_as_dark_as_its_driver_is_believed_to_mean_harm(run, table):
    record, sample = run.record, 60
    belief = np.full(record.traffic.x.shape, np.nan)
    near = np.flatnonzero(
        record.traffic.present[sample] & (np.abs(record.traffic.x[sample] - record.robot.x[sample]) < 40)
    )
    dark = {}
    for likely in (np.nan, 0.2, 0.9):
        belief[sample, near] = likely
        frame = np.asarray(FrameArtist(replace(run, record=replace(record, belief=belief)), table).frame(sample))
        dark[likely] = frame[HEADER:].sum(dtype=np.int64)
    plain = np.asarray(FrameArtist(run, table).frame(sample))[HEADER:].sum(dtype=np.int64)
    assert dark[0.9] < dark[0.2] < plain
    assert dark[np.nan] == plain


def test_the_page_gets_what_is_believed_of_each_car_that_it_shows(run, table):
    record = run.record
    belief = np.random.default_rng(0).uniform(size=record.traffic.x.shape)
    page = replay_data(replace(record, belief=belief), table, TrackingSettings())
    encoded = np.frombuffer(base64.b64decode(page["cars"]["belief"]["data"]), "<f4")
    vehicle = np.frombuffer(base64.b64decode(page["cars"]["vehicle"]["data"]), "<u4")
    start = np.frombuffer(base64.b64decode(page["cars"]["start"]["data"]), "<u4")
    assert encoded[start[60] : start[61]] == pytest.approx(belief[60, vehicle[start[60] : start[61]]])
    assert "belief" not in replay_data(record, table, TrackingSettings())["cars"]


def test_the_plan_leads_to_the_planned_lane_and_speed(run):
    path = plan_path(run.record, 0, TrackingSettings())
    robot = run.record.robot
    np.testing.assert_allclose(path[0], [robot.x[0], robot.y[0]])
    assert path[-1, 1] == pytest.approx(4.0 * robot.plan_lane[0], abs=0.01)
    assert (path[-1, 0] - path[-2, 0]) / 0.1 == pytest.approx(robot.plan_speed[0], abs=0.05)


def test_the_plan_is_followed_at_the_gains_of_the_run(run, table):
    softer = replace(run, config={**run.config, "tracking": {"k_1": 1.0, "k_2": 0.5}})
    path, robot = plan_path(run.record, 0, tracking_of(softer)), run.record.robot
    second = 10  # points are a tenth of a second apart
    off_centre = robot.y[0] - 4.0 * robot.plan_lane[0]
    assert path[second, 1] == pytest.approx(4.0 * robot.plan_lane[0] + off_centre * math.exp(-1.0))
    speed = (path[second + 1, 0] - path[second - 1, 0]) / 0.2
    left = (robot.speed[0] - robot.plan_speed[0]) * math.exp(-0.5)
    assert speed == pytest.approx(robot.plan_speed[0] + left, abs=0.01)
    data = replay_data(run.record, table, tracking_of(softer))
    assert (data["lateralRate"], data["speedRate"]) == (1.0, 0.5)


def coder_in(folder: Path, text: str, monkeypatch: pytest.MonkeyPatch) -> None:
    script = folder / "ffmpeg"
    script.write_text(text.format(python=sys.executable))
    script.chmod(0o755)
    monkeypatch.setenv("PATH", str(folder))


def test_an_mp4_gets_every_frame(run, make_record, table, tmp_path, monkeypatch):
    (tmp_path / "bin").mkdir()
    coder_in(tmp_path / "bin", CODER, monkeypatch)
    short = replace(run, record=make_record(samples=21))
    path = write_replay(short, table, tmp_path / "drive.mp4")
    width, height = FrameArtist(short, table).size
    assert (width % 2, height % 2) == (0, 0)
    assert path.stat().st_size == 11 * width * height * 3


def test_what_cannot_be_animated_is_named(run, table, tmp_path, monkeypatch):
    with pytest.raises(OutputError, match=r"ends in \.gif or \.mp4"):
        write_replay(run, table, tmp_path / "drive.avi")
    (tmp_path / "bin").mkdir()
    monkeypatch.setenv("PATH", str(tmp_path / "bin"))
    with pytest.raises(OutputError, match="ffmpeg is not installed"):
        write_replay(run, table, tmp_path / "drive.mp4")
    coder_in(tmp_path / "bin", BROKEN_CODER, monkeypatch)
    with pytest.raises(OutputError, match="unknown encoder"):
        write_replay(run, table, tmp_path / "drive.mp4")
    assert not (tmp_path / "drive.mp4").exists()


def test_absent_cars_have_no_value(run, table):
    values = car_values(run.record, table)
    assert np.isinf(values[~run.record.traffic.present]).all()
    nobody = replace(run.record.traffic, present=np.zeros_like(run.record.traffic.present))
    assert np.isinf(car_values(replace(run.record, traffic=nobody), table)).all()
