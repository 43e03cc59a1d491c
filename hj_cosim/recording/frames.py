"""A record as tables: trajectories.parquet, robot.parquet and drivers.parquet in memory, and as DataFrames."""

from collections.abc import Sequence
from dataclasses import fields
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa

from hj_cosim.recording.car_rows import rows_of_track
from hj_cosim.recording.columns import name_column, numeric_column, text_column
from hj_cosim.recording.record import RobotTrack, RunRecord, ThreatTrack
from hj_cosim.recording.trajectories import Scene, rows_table
from hj_cosim.vehicles.drivers import PARAMETER_NAMES

if TYPE_CHECKING:
    import pandas as pd  # imported by pyarrow where a DataFrame is asked for


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
    window = slice(start, stop)
    scene = Scene(record.road, record.robot_length, record.robot_width, record.rogues)
    robot = record.robot.between(start, stop)
    rows = rows_of_track(record.traffic, window)
    belief = None if record.belief is None else record.belief[start + rows.sample, rows.vehicle]
    return rows_table(scene, record.time[window], robot, rows, record.traffic.names, belief)


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
