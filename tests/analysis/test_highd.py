"""highD's three files, read by a reader of this test's own: the tracks come back, and who is beside whom is so."""

import csv
import itertools
from collections import defaultdict
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from hj_cosim.analysis.export import export_files, export_run
from hj_cosim.analysis.highd_neighbours import NEIGHBOURS, neighbours
from hj_cosim.errors import OutputError
from hj_cosim.recording.run_folder import write_run
from hj_cosim.scene.road import StraightRoad

WIDTH, LANES = 3.5, 4
CONFIG = '[scenario]\nname = "synthetic"\n'
TRACKS_HEADER = (
    "frame,id,x,y,width,height,xVelocity,yVelocity,xAcceleration,yAcceleration,frontSightDistance,"
    "backSightDistance,dhw,thw,ttc,precedingXVelocity,precedingId,followingId,leftPrecedingId,leftAlongsideId,"
    "leftFollowingId,rightPrecedingId,rightAlongsideId,rightFollowingId,laneId"
)
TRACKS_META_HEADER = (
    "id,width,height,initialFrame,finalFrame,numFrames,class,drivingDirection,traveledDistance,minXVelocity,"
    "maxXVelocity,meanXVelocity,minDHW,minTHW,minTTC,numLaneChanges"
)
RECORDING_META_HEADER = (
    "id,frameRate,locationId,speedLimit,month,weekDay,startTime,duration,totalDrivenDistance,totalDrivenTime,"
    "numVehicles,numCars,numTrucks,upperLaneMarkings,lowerLaneMarkings"
)


def rows_of(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


@pytest.fixture
def run(tmp_path, make_record, monkeypatch) -> Path:
    """Return a run in many row groups: a truck, a car that goes and comes back, and lane changes."""
    monkeypatch.setattr("hj_cosim.recording.trajectories.ROWS_PER_GROUP", 100)
    record = make_record(samples=90, cars=20, road=StraightRoad(lane_count=LANES, lane_width=WIDTH, length=2000.0))
    traffic = record.traffic
    traffic.length[3], traffic.width[3] = 12.0, 2.5
    traffic.present[:, 5] = True
    traffic.present[31:47, 5] = False
    traffic.lane[60:, 6] = (traffic.lane[60:, 6] + 1) % LANES
    write_run(tmp_path / "run", record, CONFIG, {})
    return tmp_path / "run"


@pytest.fixture
def expected(run) -> pd.DataFrame:
    """Return every second sample of the run's own file."""
    table = pd.read_parquet(run / "trajectories.parquet")
    table = table.assign(vehicle=table.vehicle.astype("str"), sample=np.rint(table.time / 0.02).astype(int))
    return table[table["sample"] % 2 == 0]


def test_the_three_files_have_highd_s_columns_in_its_order(run):
    files = export_files(run, "highd", None)
    assert [path.name for path in files] == ["01_tracks.csv", "01_tracksMeta.csv", "01_recordingMeta.csv"]
    headers = [path.read_text().splitlines()[0].replace('"', "") for path in files]
    assert headers == [TRACKS_HEADER, TRACKS_META_HEADER, RECORDING_META_HEADER]


def test_tracks_read_back_to_where_everybody_was(run, expected):
    tracks, meta, recording = map(rows_of, export_files(run, "highd", None))
    markings = [float(y) for y in recording[0]["lowerLaneMarkings"].split(";")]
    assert len(markings) == LANES + 1
    right_edge = markings[-1]  # y grows downwards, and the right-most lane is the lowest
    names, seen = {}, {}
    by_place = {(row["sample"], row.x, row.y): row for _, row in expected.iterrows()}
    for row in tracks:
        centre_x = float(row["x"]) + 0.5 * float(row["width"])
        centre_y = right_edge - (float(row["y"]) + 0.5 * float(row["height"])) - 0.5 * WIDTH
        sample = 2 * (int(row["frame"]) - 1)
        near = [
            other
            for (when, x, y), other in by_place.items()
            if when == sample and abs(x - centre_x) < 1e-6 and abs(y - centre_y) < 1e-6
        ]
        assert len(near) == 1, row
        other = near[0]
        assert names.setdefault(row["id"], other.vehicle) == other.vehicle
        assert (sample, other.vehicle) not in seen
        seen[sample, other.vehicle] = row
        assert float(row["xVelocity"]) == pytest.approx(other.speed * np.cos(other.heading))
        assert float(row["yVelocity"]) == pytest.approx(-other.speed * np.sin(other.heading))
        assert float(row["xAcceleration"]) == pytest.approx(other.acceleration * np.cos(other.heading))
        assert (float(row["width"]), float(row["height"])) == (other.length, other["width"])
        # A lane's number is one more than the lines above it.
        lines = recording[0]["upperLaneMarkings"].split(";") + recording[0]["lowerLaneMarkings"].split(";")
        middle = right_edge - (other.lane + 0.5) * WIDTH
        assert int(row["laneId"]) == 1 + sum(float(y) < middle for y in lines)
    assert set(seen) == set(zip(expected["sample"], expected.vehicle, strict=True))
    assert names["1"] == "robot"
    assert len(names) == len(set(names.values())) + 1  # the one that comes back has two tracks
    assert {row["id"]: row["class"] for row in meta}.keys() == names.keys()
    assert {names[row["id"]] for row in meta if row["class"] == "Truck"} == {"car3"}


def test_a_track_has_no_gap_and_its_meta_says_what_it_holds(run):
    tracks, meta, recording = map(rows_of, export_files(run, "highd", None))
    by_id = defaultdict(list)
    for row in tracks:
        by_id[row["id"]].append(row)
    assert [row["id"] for row in meta] == [str(number + 1) for number in range(len(by_id))]
    for told in meta:
        rows = by_id[told["id"]]
        frames = [int(row["frame"]) for row in rows]
        assert frames == list(range(int(told["initialFrame"]), int(told["finalFrame"]) + 1))
        assert int(told["numFrames"]) == len(frames)
        speeds = [float(row["xVelocity"]) for row in rows]
        assert float(told["minXVelocity"]) == min(speeds)
        assert float(told["maxXVelocity"]) == max(speeds)
        assert float(told["meanXVelocity"]) == pytest.approx(np.mean(speeds))
        lanes = [row["laneId"] for row in rows]
        assert int(told["numLaneChanges"]) == sum(a != b for a, b in itertools.pairwise(lanes))
        places = np.array([[float(row["x"]), float(row["y"])] for row in rows])
        assert float(told["traveledDistance"]) == pytest.approx(np.hypot(*np.diff(places, axis=0).T).sum())
        sideways = np.array([float(row["yVelocity"]) for row in rows])
        if len(rows) > 2:
            middle = 25.0 * (sideways[2:] - sideways[:-2]) / 2.0
            assert [float(row["yAcceleration"]) for row in rows[1:-1]] == pytest.approx(middle)
        for name, key in (("dhw", "minDHW"), ("thw", "minTHW"), ("ttc", "minTTC")):
            valid = [float(row[name]) for row in rows if row["precedingId"] != "0" and float(row[name]) != 0.0]
            assert float(told[key]) == (min(valid) if valid else -1.0)
    assert int(recording[0]["numVehicles"]) == len(meta) == int(recording[0]["numCars"]) + 1
    assert float(recording[0]["duration"]) == 45 / 25
    assert float(recording[0]["totalDrivenTime"]) == pytest.approx(len(tracks) / 25)


def test_headways_and_sights_are_those_of_the_vehicle_that_is_named(run):
    tracks, _, _ = map(rows_of, export_files(run, "highd", None))
    at = {(row["frame"], row["id"]): row for row in tracks}
    followed = 0
    for row in tracks:
        x, length, speed = (float(row[name]) for name in ("x", "width", "xVelocity"))
        assert float(row["backSightDistance"]) == pytest.approx(x + 0.5 * length)
        assert float(row["frontSightDistance"]) == pytest.approx(2000.0 - x - 0.5 * length)
        if row["precedingId"] == "0":
            assert [float(row[name]) for name in ("dhw", "thw", "ttc", "precedingXVelocity")] == [0.0] * 4
            continue
        followed += 1
        other = at[row["frame"], row["precedingId"]]
        assert other["laneId"] == row["laneId"]
        gap, ahead = float(other["x"]) - (x + length), float(other["xVelocity"])
        assert float(row["dhw"]) == pytest.approx(gap)
        assert float(row["precedingXVelocity"]) == ahead
        assert float(row["thw"]) == pytest.approx(gap / speed)
        assert float(row["ttc"]) == pytest.approx(gap / (speed - ahead) if speed > ahead else 0.0)
    assert followed > 100


def test_neighbours_are_those_that_a_search_of_all_pairs_finds():
    draw = np.random.default_rng(3)
    count = 400
    frame, lane = draw.integers(0, 12, count), draw.integers(0, 4, count)
    x, length = draw.uniform(0.0, 150.0, count), draw.choice([4.0, 5.0], count)

    def nearest(row: int, others: np.ndarray) -> int:
        return int(others[np.argmin(np.abs(x[others] - x[row]))]) if len(others) else -1

    found = neighbours(frame, lane, x, length)
    for row in range(count):
        wanted = []
        for side in (0, 1, -1):
            there = np.flatnonzero((frame == frame[row]) & (lane == lane[row] + side) & (np.arange(count) != row))
            overlaps = (np.abs(x[there] - x[row]) < 0.5 * (length[there] + length[row])) & (side != 0)
            ahead = there[(x[there] >= x[row]) & ~overlaps]
            behind = there[(x[there] < x[row]) & ~overlaps]
            alongside = [] if side == 0 else [nearest(row, there[overlaps])]
            wanted += [nearest(row, ahead), *alongside, nearest(row, behind)]
        assert found[row].tolist() == wanted, dict(zip(NEIGHBOURS, wanted, strict=True))


def test_the_file_s_name_numbers_the_recording(run, tmp_path):
    tracks, meta, recording = export_files(run, "highd", tmp_path / "out" / "07_tracks.csv")
    assert [path.name for path in (tracks, meta, recording)] == [
        "07_tracks.csv", "07_tracksMeta.csv", "07_recordingMeta.csv",
    ]  # fmt: skip
    assert rows_of(recording)[0]["id"] == "7"


def test_what_does_not_fit_highd_is_refused_in_a_sentence_and_nothing_is_written(run, tmp_path):
    with pytest.raises(OutputError, match=r"is called NN_tracks\.csv"):
        export_run(run, "highd", tmp_path / "drive.csv")
    (run / "config.toml").write_text(CONFIG + "[simulation]\nstep = 0.03\n")
    with pytest.raises(OutputError, match=r"25 frames a second.*steps of 0\.03 s"):
        export_run(run, "highd", tmp_path / "01_tracks.csv")
    assert list(tmp_path.glob("*.csv")) == []
