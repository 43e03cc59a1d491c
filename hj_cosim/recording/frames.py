"""A record as tables: trajectories.parquet, robot.parquet and drivers.parquet in memory, and as DataFrames."""

from collections.abc import Sequence
from dataclasses import fields
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa

from hj_cosim.recording.beliefs import BELIEF
from hj_cosim.recording.columns import name_column, numeric_column, text_column
from hj_cosim.recording.record import ROBOT_NAME, RobotTrack, RunRecord, ThreatTrack
from hj_cosim.recording.roles import role_column
from hj_cosim.scene.road_text import road_to_json
from hj_cosim.vehicles.drivers import PARAMETER_NAMES

if TYPE_CHECKING:
    import pandas as pd  # imported by pyarrow where a DataFrame is asked for

TRAFFIC_FLOATS = ("x", "y", "heading", "speed", "acceleration")
ROAD_KEY = b"hj_cosim.road"


class RunFrames:
    """What has a record has its tables, too."""

    record: RunRecord

    @cached_property
    def robot(self) -> "pd.DataFrame":
        """The robot, a row per sample, the columns of robot.parquet (runs/README.md).

        Among them time (s since it took over), x, y (m, road frame), heading (rad), speed (m/s), omega (rad/s),
        acceleration (m/s²), value (least V, m; +inf where no car is near), ttc (s), intervening, collision (bool).
        """
        return robot_table(self.record).to_pandas()

    @cached_property
    def trajectories(self) -> "pd.DataFrame":
        """Every car at every sample, the robot among them as `robot`, the columns of trajectories.parquet.

        They are time (s), vehicle, x, y (centre of the body, m, road frame), heading (rad), speed (m/s), acceleration
        (m/s²), lane (0: right), length, width (m); role, where somebody means harm; and belief, the probability that a
        car's driver does, where the filter judged that (NaN for the robot).
        """
        return trajectory_table(self.record, 0, len(self.record.time)).to_pandas()


def trajectory_table(record: RunRecord, start: int, stop: int) -> pa.Table:
    """Return the rows of samples start to stop."""
    traffic, robot, road = record.traffic, record.robot, record.road
    window = slice(start, stop)
    time = record.time[window]
    present = np.column_stack([np.ones(len(time), bool), traffic.present[window]])
    sample, column = np.nonzero(present)  # in the order of time, then of the columns

    def both(of_robot: np.ndarray, of_cars: np.ndarray) -> np.ndarray:
        return np.asarray(np.column_stack([of_robot[window], of_cars[window]])[present])

    robot_lane = road.nearest_lanes(robot.y, robot.x).astype(np.int8)
    columns = {
        "time": numeric_column(time[sample]),
        "vehicle": name_column(column, (ROBOT_NAME, *traffic.names)),
        **{name: numeric_column(both(getattr(robot, name), getattr(traffic, name))) for name in TRAFFIC_FLOATS},
        "lane": numeric_column(both(robot_lane, traffic.lane).astype(np.int8)),
        "length": numeric_column(np.append(record.robot_length, traffic.length)[column]),
        "width": numeric_column(np.append(record.robot_width, traffic.width)[column]),
    }
    if record.rogues:
        columns["role"] = role_column(column, (ROBOT_NAME, *traffic.names), record.rogues)
    if record.belief is not None:
        columns[BELIEF] = numeric_column(both(np.full(len(record.time), np.nan), record.belief))
    return pa.table(columns).replace_schema_metadata({ROAD_KEY: road_to_json(road).encode()})


def robot_table(record: RunRecord) -> pa.Table:
    """Return robot.parquet's table: a row per sample."""
    columns = {"time": numeric_column(record.time)}
    for field in fields(RobotTrack):
        columns[field.name] = numeric_column(getattr(record.robot, field.name))
    columns["value_vehicle"] = name_column(record.robot.value_vehicle, record.traffic.names)
    for field in fields(ThreatTrack):
        columns[field.name] = numeric_column(getattr(record.threats, field.name))
    return pa.table(columns)


def driver_table(names: Sequence[str], drivers: np.ndarray) -> pa.Table:
    """Return drivers.parquet's table: a row per car, what its driver was drawn with (`drivers` as in write_run)."""
    columns = {name: numeric_column(drivers[:, number]) for number, name in enumerate(PARAMETER_NAMES)}
    return pa.table({"vehicle": text_column(names), **columns})
