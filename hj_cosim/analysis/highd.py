"""A run's trajectories as highD has them (Krajewski et al. 2018): three CSV files, 25 frames a second.

Columns, units and the zeros where there is nobody are those of highD's format description. Its coordinates are an
image's: y grows downwards, and x, y are the upper left corner of a vehicle's box. x is s, so bends are straightened.
Everybody drives to the right, on the lower carriageway; readers of highD's need an upper one, so there is one of a
single lane, on which nobody is.
"""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet as pq

from hj_cosim.analysis.highd_neighbours import NEIGHBOURS, neighbours
from hj_cosim.errors import OutputError
from hj_cosim.recording.columns import numeric_column, text_column
from hj_cosim.recording.large_arrays import zeros
from hj_cosim.scene.road import Road

FRAME_RATE = 25  # 1/s
TRACKS, TRACKS_META, RECORDING_META = "_tracks.csv", "_tracksMeta.csv", "_recordingMeta.csv"
TRUCK_LENGTH = 7.0  # m, from which a vehicle is called a truck
TO_THE_RIGHT = 2  # drivingDirection of the lower carriageway
UPPER_MARKINGS = 2  # lines of the upper carriageway's only lane
NONE_PRECEDING = -1.0  # of a minimum over frames in which nobody precedes

# What is kept of a row while all are collected, besides its neighbours.
_KEPT = ("frame", "vehicle", "x", "y", "width", "height", "xVelocity", "yVelocity", "xAcceleration", "laneId")
_COLUMN = {name: number for number, name in enumerate((*_KEPT, *NEIGHBOURS))}
_READ = ["time", "vehicle", "x", "y", "heading", "speed", "acceleration", "lane", "length", "width"]


def write_highd(
    trajectories: pq.ParquetFile, road: Road, step: float, recording: int, files: tuple[Path, Path, Path]
) -> None:
    """Write a run as highD's three files.

    A vehicle that leaves and comes back has a track of its own each time, for highD's have no gaps; tracks are numbered
    from 1 in the order in which they begin, and the robot's, which comes first at any time, is 1. dhw is from bumper to
    bumper, thw that over the speed, and ttc that over the speed of closing. A vehicle is a truck from 7 m on. There is
    no date, no speed limit (-1), and the location is 0.

    Args:
        trajectories: of the run; a row group holds whole samples.
        road: whose lanes become lane markings.
        step: s, between two samples.
        recording: the number of the recording.
        files: tracks, tracksMeta and recordingMeta.

    Raises:
        OutputError: if the samples do not fit 25 frames a second.
        HjCosimError: if the rows fit neither into memory nor onto the disk.
    """
    every = round(1.0 / (FRAME_RATE * step))
    if every < 1 or abs(every * step * FRAME_RATE - 1.0) > 1e-9:
        raise OutputError(
            f"highD has {FRAME_RATE} frames a second, and a run in steps of {step:g} s (simulation.step) has no sample"
            " at each of them; export as csv, or drive with simulation.step = 0.02"
        )
    rows, count = _collected(trajectories, road, step, every)
    order = np.lexsort((rows[:count, _COLUMN["frame"]], rows[:count, _COLUMN["vehicle"]]))
    track = _tracks_of(rows, order)
    order = order[np.argsort(track[order], kind="stable")]  # by track, then by frame
    starts = np.flatnonzero(np.diff(track[order], prepend=0))
    tracks = _tracks_table(rows, order, track, starts, road)
    meta = _tracks_meta(tracks, starts)
    for path, table in zip(files, (tracks, meta, _recording_meta(meta, recording, road)), strict=True):
        pyarrow.csv.write_csv(table, path, pyarrow.csv.WriteOptions(quoting_style="none"))


def _frames(trajectories: pq.ParquetFile, step: float, every: int, columns: list[str]) -> Iterator[pa.Table]:
    """Yield the rows of every frame, row group by row group."""
    for group in range(trajectories.num_row_groups):
        rows = trajectories.read_row_group(group, columns=columns)
        sample = np.rint(rows["time"].to_numpy() / step).astype(np.int64)
        yield rows.filter(pa.array(sample % every == 0))


def _collected(trajectories: pq.ParquetFile, road: Road, step: float, every: int) -> tuple[np.ndarray, int]:
    """Return what is kept of every row (rows, columns), neighbours as numbers of rows counted from 1, and how many."""
    count = sum(len(rows) for rows in _frames(trajectories, step, every, ["time"]))
    kept = zeros((max(count, 1), len(_COLUMN)))
    top = (road.lane_count + UPPER_MARKINGS - 0.5) * road.lane_width  # y of d = 0
    done = 0
    for rows in _frames(trajectories, step, every, _READ):
        time, x, y, heading, speed, acceleration, lane, length, width = (
            rows[name].to_numpy() for name in _READ if name != "vehicle"
        )
        frame = np.rint(time / (step * every)).astype(np.int64)
        block = kept[done : done + len(rows)]
        columns = {
            "frame": frame + 1,
            "vehicle": rows["vehicle"].combine_chunks().indices.to_numpy(),
            "x": x - 0.5 * length,
            "y": top - y - 0.5 * width,
            "width": length,
            "height": width,
            "xVelocity": speed * np.cos(heading),
            "yVelocity": -speed * np.sin(heading),
            "xAcceleration": acceleration * np.cos(heading),
            "laneId": road.lane_count - lane.astype(np.int64) + UPPER_MARKINGS + 1,
        }
        for name, column in columns.items():
            block[:, _COLUMN[name]] = column
        found = neighbours(frame, lane.astype(np.int64), x, length)
        block[:, len(_KEPT) :] = np.where(found >= 0, found + done + 1, 0)
        done += len(rows)
    return kept, count


def _tracks_of(rows: np.ndarray, order: np.ndarray) -> np.ndarray:
    """Return the number of each row's track, from 1; `order` sorts the rows by vehicle and frame."""
    frame, vehicle = rows[order, _COLUMN["frame"]], rows[order, _COLUMN["vehicle"]]
    begins = (np.diff(vehicle, prepend=-1) != 0) | (np.diff(frame, prepend=-1) != 1)
    first = np.flatnonzero(begins)
    number = np.empty(len(first), np.int64)
    number[np.lexsort((vehicle[first], frame[first]))] = np.arange(1, len(first) + 1)
    track = np.empty(len(order), np.int64)
    track[order] = number[np.cumsum(begins) - 1]
    return track


def _tracks_table(rows: np.ndarray, order: np.ndarray, track: np.ndarray, starts: np.ndarray, road: Road) -> pa.Table:
    """Return XX_tracks.csv's table, the rows in `order`; `starts` are where tracks begin in it."""

    def column(name: str) -> np.ndarray:
        return rows[order, _COLUMN[name]]

    x, width, forward, sideways = column("x"), column("width"), column("xVelocity"), column("yVelocity")
    ahead = column("precedingId").astype(np.int64) - 1
    precedes = ahead >= 0
    gap = np.where(precedes, rows[ahead, _COLUMN["x"]] - x - width, 0.0)
    speed_ahead = np.where(precedes, rows[ahead, _COLUMN["xVelocity"]], 0.0)
    closing = forward - speed_ahead
    left, right = _section(x, width, road)
    columns = {
        "frame": column("frame").astype(np.int64),
        "id": track[order],
        **{name: column(name) for name in ("x", "y", "width", "height", "xVelocity", "yVelocity", "xAcceleration")},
        "yAcceleration": _slope(sideways, starts),
        "frontSightDistance": right - (x + 0.5 * width),
        "backSightDistance": x + 0.5 * width - left,
        "dhw": gap,
        "thw": np.where(precedes & (forward > 0.0), gap / np.where(forward > 0.0, forward, 1.0), 0.0),
        "ttc": np.where(precedes & (closing > 0.0), gap / np.where(closing > 0.0, closing, 1.0), 0.0),
        "precedingXVelocity": speed_ahead,
    }
    for name in NEIGHBOURS:
        who = column(name).astype(np.int64) - 1
        columns[name] = np.where(who >= 0, track[who], 0)
    columns["laneId"] = column("laneId").astype(np.int64)
    return pa.table({name: numeric_column(values) for name, values in columns.items()})


def _section(x: np.ndarray, width: np.ndarray, road: Road) -> tuple[float, float]:
    """Return where the recorded section begins and ends, m of x: the road, or of a closed one what was driven."""
    if road.lap:
        return float(x.min(initial=0.0)), float((x + width).max(initial=0.0))
    return 0.0, road.length


def _slope(values: np.ndarray, starts: np.ndarray) -> np.ndarray:
    """Return the rate of change (1/s) of values, frame by frame, within each track; 0 of a track of one frame."""
    slope = np.zeros_like(values)
    for start, stop in zip(starts, [*starts[1:], len(values)], strict=True):
        if stop - start > 1:
            slope[start:stop] = np.gradient(values[start:stop]) * FRAME_RATE
    return slope


def _tracks_meta(tracks: pa.Table, starts: np.ndarray) -> pa.Table:
    """Return XX_tracksMeta.csv's table, a row a track."""
    read = {name: tracks[name].to_numpy() for name in tracks.column_names}
    last = np.append(starts[1:], len(tracks)) - 1
    frames = last - starts + 1
    speed = read["xVelocity"]
    steps = np.hypot(np.diff(read["x"], prepend=0.0), np.diff(read["y"], prepend=0.0))
    steps[starts] = 0.0
    changes = np.diff(read["laneId"], prepend=0) != 0
    changes[starts] = False

    def least(name: str) -> np.ndarray:
        valid = (read["precedingId"] > 0) & ((read[name] > 0.0) | (name == "dhw"))
        smallest = np.minimum.reduceat(np.where(valid, read[name], np.inf), starts)
        return np.where(np.isfinite(smallest), smallest, NONE_PRECEDING)

    columns = {
        "id": read["id"][starts],
        "width": read["width"][starts],
        "height": read["height"][starts],
        "initialFrame": read["frame"][starts],
        "finalFrame": read["frame"][last],
        "numFrames": frames,
        "class": np.where(read["width"][starts] >= TRUCK_LENGTH, "Truck", "Car"),
        "drivingDirection": np.full(len(starts), TO_THE_RIGHT),
        "traveledDistance": np.add.reduceat(steps, starts),
        "minXVelocity": np.minimum.reduceat(speed, starts),
        "maxXVelocity": np.maximum.reduceat(speed, starts),
        "meanXVelocity": np.add.reduceat(speed, starts) / frames,
        "minDHW": least("dhw"),
        "minTHW": least("thw"),
        "minTTC": least("ttc"),
        "numLaneChanges": np.add.reduceat(changes.astype(np.int64), starts),
    }
    return pa.table({name: _column(values) for name, values in columns.items()})


def _column(values: np.ndarray) -> pa.Array:
    return text_column(values.tolist()) if values.dtype.kind == "U" else numeric_column(values)


def _recording_meta(meta: pa.Table, recording: int, road: Road) -> pa.Table:
    """Return XX_recordingMeta.csv's table: one row."""
    frames, kinds = meta["numFrames"].to_numpy(), meta["class"].to_pylist()
    lines = np.arange(UPPER_MARKINGS + road.lane_count + 1) * road.lane_width
    columns = {
        "id": recording,
        "frameRate": FRAME_RATE,
        "locationId": 0,
        "speedLimit": -1.0,
        "month": "",
        "weekDay": "",
        "startTime": "",
        "duration": float(meta["finalFrame"].to_numpy().max()) / FRAME_RATE,
        "totalDrivenDistance": float(meta["traveledDistance"].to_numpy().sum()),
        "totalDrivenTime": float(frames.sum()) / FRAME_RATE,
        "numVehicles": len(meta),
        "numCars": kinds.count("Car"),
        "numTrucks": kinds.count("Truck"),
        "upperLaneMarkings": ";".join(map(repr, lines[:UPPER_MARKINGS].tolist())),
        "lowerLaneMarkings": ";".join(map(repr, lines[UPPER_MARKINGS:].tolist())),
    }
    return pa.table({name: _column(np.array([value])) for name, value in columns.items()})
