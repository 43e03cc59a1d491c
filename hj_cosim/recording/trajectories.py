"""trajectories.parquet: rows as a table, and how Parquet is written.

A row group holds whole samples; at one time the robot comes first, then the cars by number. Its column `vehicle` is
dictionary-encoded with the names of all that had come by then, so that each group's names begin those of the next.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pyarrow as pa

from hj_cosim.recording.beliefs import BELIEF
from hj_cosim.recording.car_rows import MOTION, CarRows
from hj_cosim.recording.columns import name_column, numeric_column
from hj_cosim.recording.record import ROBOT_NAME, RobotTrack
from hj_cosim.recording.roles import role_column
from hj_cosim.scene.road import Road
from hj_cosim.scene.road_text import road_to_json

TRAJECTORIES = "trajectories.parquet"
ROAD_KEY = b"hj_cosim.road"
ROWS_PER_GROUP = 1 << 17  # written and read at a time, so that a long drive of many cars needs little memory


@dataclass(frozen=True)
class Scene:
    """What all rows of a run have in common."""

    road: Road
    robot_length: float  # m
    robot_width: float  # m
    # What those cars do whose drivers mean harm, by name.
    rogues: Mapping[str, str] = field(default_factory=dict)


def rows_table(
    scene: Scene,
    time: np.ndarray,
    robot: RobotTrack,
    rows: CarRows,
    names: Sequence[str],
    belief: np.ndarray | None = None,
) -> pa.Table:
    """Return the table of T consecutive samples.

    Args:
        scene: of the run.
        time: (T,) s.
        robot: T samples.
        rows: the cars.
        names: theirs, by number.
        belief: that the driver of each row's car means harm, if anybody judged.
    """
    cars_before = np.searchsorted(rows.sample, np.arange(len(time)))
    row_of_robot = cars_before + np.arange(len(time))
    row_of_car = np.arange(len(rows.sample)) + rows.sample + 1

    def both(of_robot: np.ndarray | float, of_cars: np.ndarray, kind: type[np.generic]) -> np.ndarray:
        column = np.empty(len(time) + len(rows.sample), kind)
        column[row_of_robot], column[row_of_car] = of_robot, of_cars
        return column

    vehicle = both(0, rows.vehicle + 1, np.int32)
    all_names = (ROBOT_NAME, *names)
    robot_lane = scene.road.nearest_lanes(robot.y, robot.x).astype(np.int8)
    columns = {
        "time": numeric_column(both(time, time[rows.sample], np.float64)),
        "vehicle": name_column(vehicle, all_names),
        **{name: numeric_column(both(getattr(robot, name), getattr(rows, name), np.float64)) for name in MOTION},
        "lane": numeric_column(both(robot_lane, rows.lane, np.int8)),
        "length": numeric_column(both(scene.robot_length, rows.length, np.float64)),
        "width": numeric_column(both(scene.robot_width, rows.width, np.float64)),
    }
    if scene.rogues:
        columns["role"] = role_column(vehicle, all_names, scene.rogues)
    if belief is not None:
        columns[BELIEF] = numeric_column(both(np.nan, belief, np.float64))
    return pa.table(columns).replace_schema_metadata({ROAD_KEY: road_to_json(scene.road).encode()})


def parquet_options(schema: pa.Schema) -> dict[str, Any]:
    """Return how Parquet is written: measured to be both the fastest and nearly the smallest."""
    return {
        "compression": "zstd",
        "compression_level": 1,
        "use_dictionary": [field.name for field in schema if pa.types.is_dictionary(field.type)],
        "use_byte_stream_split": [field.name for field in schema if pa.types.is_floating(field.type)],
        "write_statistics": ["time"],
    }
