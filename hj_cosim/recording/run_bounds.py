"""What a run's files may ask for, whoever made them: how large, of what types, and how far from any drive.

A Parquet file of some kilobytes may hold a billion equal rows, so what it says of itself is read before its rows are.
Every function raises ValueError, in words that name the bound; KeyError for what is missing.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import IO

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from hj_cosim.recording.columns import numbers_of
from hj_cosim.scene.observation import FARTHEST
from hj_cosim.scene.road import Road, StraightRoad
from hj_cosim.scene.road_text import MOST_LANES, WIDEST_LANE

MOST_SAMPLES = 1_000_000  # five and a half hours at 50 Hz
MOST_CELLS = 100_000_000  # samples times cars: 4 GB as arrays
MOST_ROWS = 1_000_000_000  # a row is a car at a sample; they are read a row group at a time
TEXTS = ("vehicle", "value_vehicle", "role")  # the columns that hold names
MOST_ROWS_AT_ONCE = 1 << 20  # in a row group; eight times what is written
MOST_BYTES_AT_ONCE = 1 << 28  # of a row group, unpacked


def open_columns(source: Path | IO[bytes], name: str, most: int | None = None) -> pq.ParquetFile:
    """Return an open Parquet file whose row groups can be read, one after the other, without harm.

    Args:
        source: a path, or a file that is open.
        name: what it is called in messages.
        most: rows that it may have; MOST_ROWS unless given.
    """
    file = pq.ParquetFile(source)
    metadata = file.metadata
    most = MOST_ROWS if most is None else most
    if metadata.num_row_groups == 0 or metadata.num_rows == 0:
        raise ValueError(f"{name} has no rows")
    if metadata.num_rows > most:
        raise ValueError(f"{name} has {metadata.num_rows} rows; {most} is the most")
    for number in range(metadata.num_row_groups):
        group = metadata.row_group(number)
        if group.num_rows > MOST_ROWS_AT_ONCE or group.total_byte_size > MOST_BYTES_AT_ONCE:
            raise ValueError(
                f"{name} has a row group of {group.num_rows} rows and {group.total_byte_size} bytes;"
                f" {MOST_ROWS_AT_ONCE} and {MOST_BYTES_AT_ONCE} are the most"
            )
    for field in file.schema_arrow:
        kind = field.type
        is_name = pa.types.is_dictionary(kind) and pa.types.is_string(kind.value_type)
        if field.name in TEXTS and not is_name:
            raise ValueError(f"{name}: column {field.name} is {kind}, and must be a dictionary of strings")
        if field.name not in TEXTS and not _is_number(kind):
            raise ValueError(f"{name}: column {field.name} is {kind}, and must be of numbers")
    return file


def _is_number(kind: pa.DataType) -> bool:
    return bool(pa.types.is_integer(kind) or pa.types.is_floating(kind) or pa.types.is_boolean(kind))


def plain_column(rows: pa.Table, name: str) -> np.ndarray:
    """Return a column of numbers without nulls."""
    return plain_numbers(rows[name], name)


def plain_numbers(column: pa.Array | pa.ChunkedArray, name: str) -> np.ndarray:
    """Return numbers without nulls."""
    if column.null_count:
        raise ValueError(f"column {name} has {column.null_count} rows without a number")
    return numbers_of(column)


def require_times(time: np.ndarray) -> None:
    """Check that the times of the samples (T,), s, are a clock's."""
    if len(time) > MOST_SAMPLES:
        raise ValueError(f"it has {len(time)} samples; {MOST_SAMPLES} is the most")
    if not np.isfinite(time).all() or (np.diff(time) <= 0.0).any():
        raise ValueError("its times are not finite and growing")


def require_room(samples: int, vehicles: int) -> None:
    """Check that samples times vehicles can be held in memory."""
    if samples * vehicles > MOST_CELLS:
        raise ValueError(f"it has {samples} samples of {vehicles} vehicles; {MOST_CELLS} of both together is the most")


def require_finite(columns: Mapping[str, np.ndarray]) -> None:
    """Check that columns hold what a road and a car can have."""
    for name, column in columns.items():
        if not (np.abs(column) <= FARTHEST).all():
            raise ValueError(f"column {name} has what is not finite or beyond {FARTHEST:g}")


def require_road(road: Road) -> None:
    """Check that a road can be drawn."""
    if not isinstance(road, StraightRoad):
        return  # its text was checked as it was read
    places = np.array([road.length, road.origin_x, road.origin_y, road.heading])
    if not (
        1 <= road.lane_count <= MOST_LANES and 0.0 < road.lane_width <= WIDEST_LANE and (np.abs(places) <= 1e9).all()
    ):
        raise ValueError(f"its road has {road.lane_count} lanes of {road.lane_width} m, which no road has")
