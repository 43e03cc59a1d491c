"""A run's trajectories in other forms: CSV, plain Parquet, and SUMO's FCD XML.

All stream row group by row group, so that a long drive of many cars needs little memory.
"""

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from xml.sax.saxutils import escape

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.csv
import pyarrow.parquet as pq

from hj_cosim.errors import OutputError, RunFolderError
from hj_cosim.files import whole_file
from hj_cosim.recording.run_bounds import open_columns
from hj_cosim.recording.run_folder import TRAJECTORIES, read_config, road_of
from hj_cosim.scene.road import Road

# What each format's file is called when no name is given.
DEFAULT_NAMES = {"csv": "trajectories.csv", "parquet": "trajectories.plain.parquet", "fcd": "trajectories.fcd.xml"}
COLUMNS = ("time", "vehicle", "x", "y", "heading", "speed", "acceleration", "lane", "length", "width")


def export_run(folder: Path, format: str, out: Path | None = None) -> Path:
    """Write a run's trajectories in another form.

    `csv` and `parquet` have the columns of trajectories.parquet, the names as plain strings, in compression that every
    reader knows. `fcd` is SUMO's floating car data: world coordinates of the middle of the front bumper, angles in
    degrees clockwise from north, lane names, and positions along the lane; SUMO replays it
    (`sumo-gui --net-file NET --step-length 0.02 --device.fcd-replay.file FILE`).

    Args:
        folder: of the run.
        format: `csv`, `parquet` or `fcd`.
        out: the file; in the run's folder under DEFAULT_NAMES unless given.

    Returns:
        The file that was written.

    Raises:
        OutputError: if the format is unknown.
        RunFolderError: if the folder holds no run.
        HjCosimError: if the file cannot be written.
    """
    if format not in DEFAULT_NAMES:
        raise OutputError(f"cannot export as {format!r}; choose one of {', '.join(DEFAULT_NAMES)}")
    target = out or folder / DEFAULT_NAMES[format]
    if not (folder / TRAJECTORIES).is_file():
        raise RunFolderError(f"{folder} holds no run: {TRAJECTORIES} is missing")
    edge = read_config(folder)["scenario"]["network"]["edge"] if format == "fcd" else ""
    try:
        with open_columns(folder / TRAJECTORIES) as trajectories:
            _require_columns(trajectories.schema_arrow)
            with whole_file(target) as temporary:
                if format == "csv":
                    _write_csv(trajectories, temporary)
                elif format == "parquet":
                    _write_parquet(trajectories, temporary)
                else:
                    _write_fcd(trajectories, temporary, road_of(trajectories.schema_arrow), edge)
    except (OSError, ValueError, KeyError) as error:  # pyarrow's errors are among these
        raise RunFolderError(f"{folder / TRAJECTORIES} is broken: {error}") from error
    return target


def _require_columns(schema: pa.Schema) -> None:
    missing = [name for name in COLUMNS if name not in schema.names]
    if missing:
        raise KeyError(f"it has no column {missing[0]}")


def _row_groups(trajectories: pq.ParquetFile) -> Iterator[pa.Table]:
    for group in range(trajectories.num_row_groups):
        yield trajectories.read_row_group(group)


def _plain(rows: pa.Table) -> pa.Table:
    """Return the rows with the vehicles' names as plain strings."""
    return rows.set_column(rows.schema.get_field_index("vehicle"), "vehicle", rows["vehicle"].cast(pa.string()))


def _plain_schema(trajectories: pq.ParquetFile) -> pa.Schema:
    schema = trajectories.schema_arrow
    return schema.set(schema.get_field_index("vehicle"), pa.field("vehicle", pa.string()))


def _write_csv(trajectories: pq.ParquetFile, path: Path) -> None:
    with pyarrow.csv.CSVWriter(path, _plain_schema(trajectories)) as writer:
        for rows in _row_groups(trajectories):
            writer.write_table(_plain(rows))


def _write_parquet(trajectories: pq.ParquetFile, path: Path) -> None:
    with pq.ParquetWriter(path, _plain_schema(trajectories), compression="snappy") as writer:
        for rows in _row_groups(trajectories):
            writer.write_table(_plain(rows))


def _write_fcd(trajectories: pq.ParquetFile, path: Path, road: Road, edge: str) -> None:
    with path.open("w", encoding="utf-8") as file:
        file.write('<?xml version="1.0" encoding="UTF-8"?>\n\n<fcd-export>\n')
        for rows in _row_groups(trajectories):  # a row group holds whole time steps
            lines = _fcd_lines(rows, road, edge).to_pylist()
            time = rows["time"].to_numpy()
            starts = np.concatenate([[0], np.flatnonzero(np.diff(time)) + 1])
            for start, stop in zip(starts, [*starts[1:], len(time)], strict=True):
                body = "\n".join(lines[start:stop])
                file.write(f'    <timestep time="{time[start]:.3f}">\n{body}\n    </timestep>\n')
        file.write("</fcd-export>\n")


def _fcd_lines(rows: pa.Table, road: Road, edge: str) -> pa.Array:
    """Return FCD's line for each row; numbers are written so that they read back as the same doubles."""
    x, y, heading, length = (rows[name].to_numpy() for name in ("x", "y", "heading", "length"))
    front = x + 0.5 * length * np.cos(heading)
    front_lateral = y + 0.5 * length * np.sin(heading)
    world_x, world_y, world_heading = road.to_world(front, front_lateral, heading)
    # + 0.0 turns the -0.0 that rounding leaves into 0.0
    angle = (90.0 - world_heading * (180.0 / math.pi)) % 360.0 + 0.0
    vehicle = rows["vehicle"].combine_chunks()
    names = vehicle.dictionary.to_pylist()
    identity = [f'        <vehicle id="{escape(name, {chr(34): "&quot;"})}" x="' for name in names]
    columns: list[Any] = [
        pa.array(identity).take(vehicle.indices),
        _text(world_x),
        '" y="',
        _text(world_y),
        '" angle="',
        _text(angle),
        # The type that SUMO knows without being told: so it replays the file as it is.
        '" type="DEFAULT_VEHTYPE" speed="',
        rows["speed"].combine_chunks().cast(pa.string()),
        '" pos="',
        _text(front),
        f'" lane="{escape(edge, {chr(34): "&quot;"})}_',
        rows["lane"].combine_chunks().cast(pa.string()),
        '" slope="0" acceleration="',
        rows["acceleration"].combine_chunks().cast(pa.string()),
        '"/>',
        "",
    ]
    return pc.binary_join_element_wise(*columns)


def _text(values: np.ndarray) -> pa.Array:
    return pa.array(values).cast(pa.string())
