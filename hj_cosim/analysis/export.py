"""A run's trajectories in other forms: CSV, plain Parquet, and SUMO's FCD XML, the texts compressed if asked for.

All stream row group by row group, so that a long drive of many cars needs little memory.
"""

import gzip
import math
from collections.abc import Iterator
from contextlib import contextmanager
from os import PathLike
from pathlib import Path
from typing import IO, Any
from xml.sax.saxutils import escape

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.csv
import pyarrow.parquet as pq

from hj_cosim.errors import OutputError, RunFolderError
from hj_cosim.files import whole_file
from hj_cosim.locations import given_path
from hj_cosim.recording.run_bounds import open_columns
from hj_cosim.recording.run_folder import TRAJECTORIES, read_config, require_not_own_file, road_of
from hj_cosim.scene.road import Road
from hj_cosim.settings import shown

# What each format's file is called when no name is given.
DEFAULT_NAMES = {"csv": "trajectories.csv", "parquet": "trajectories.plain.parquet", "fcd": "trajectories.fcd.xml"}
COLUMNS = ("time", "vehicle", "x", "y", "heading", "speed", "acceleration", "lane", "length", "width")


_FORMATS_OF_SUFFIXES = {".csv": "csv", ".parquet": "parquet", ".xml": "fcd"}
_OTHER_COMPRESSIONS = (".bz2", ".xz", ".zst", ".zip", ".7z", ".tgz", ".tar")


def export_run(folder: PathLike[str] | str, format: str | None = None, out: PathLike[str] | str | None = None) -> Path:
    """Write a run's trajectories in another form.

    `csv` and `parquet` have the columns of trajectories.parquet, the names as plain strings, in compression that every
    reader knows. `fcd` is SUMO's floating car data: world coordinates of the middle of the front bumper, angles in
    degrees clockwise from north, lane names, and positions along the lane; SUMO replays it
    (`sumo-gui --net-file NET --step-length 0.02 --device.fcd-replay.file FILE`).

    Args:
        folder: of the run.
        format: `csv`, `parquet` or `fcd`; unless given, what the file's name says, or else `csv`.
        out: the file, compressed with gzip if its name ends in .gz; in the run's folder under DEFAULT_NAMES unless
            given.

    Returns:
        The file that was written.

    Raises:
        ConfigurationError: if `folder` or `out` is no path.
        OutputError: if the format is unknown, or the file's name contradicts it.
        RunFolderError: if the folder holds no run, or the file belongs to one.
        HjCosimError: if the file cannot be written.
    """
    folder = given_path(folder, "the run's folder")
    out = None if out is None else given_path(out, "out")
    kind = _format_of(format, out)
    target = folder / DEFAULT_NAMES[kind] if out is None else out
    require_not_own_file(target)
    if not (folder / TRAJECTORIES).is_file():
        raise RunFolderError(f"{folder} holds no run: {TRAJECTORIES} is missing")
    edge = read_config(folder)["scenario"]["network"]["edge"] if kind == "fcd" else ""
    try:
        with open_columns(folder / TRAJECTORIES) as trajectories:
            _require_columns(trajectories.schema_arrow)
            with whole_file(target) as temporary:
                if kind == "parquet":
                    _write_parquet(trajectories, temporary)
                    return target
                with _opened(temporary, compressed=target.suffix == ".gz") as file:
                    if kind == "csv":
                        _write_csv(trajectories, file)
                    else:
                        _write_fcd(trajectories, file, road_of(trajectories.schema_arrow), edge)
    except (OSError, ValueError, KeyError) as error:  # pyarrow's errors are among these
        raise RunFolderError(f"{folder / TRAJECTORIES} is broken: {error}") from error
    return target


def _format_of(format: str | None, out: Path | None) -> str:
    """Return the format that is asked for, by its name or by the file's.

    Raises:
        OutputError: if there is none of that name, the two contradict each other, or neither says anything.
    """
    choice = f"choose one of {', '.join(DEFAULT_NAMES)}"
    if format is not None and (not isinstance(format, str) or format not in DEFAULT_NAMES):
        raise OutputError(f"cannot export as {shown(repr(format))}; {choice}")
    if out is None:
        return format or "csv"
    if out.suffix in _OTHER_COMPRESSIONS:
        raise OutputError(f"cannot write {out}: only gzip compresses an export, with a name that ends in .gz")
    is_compressed = out.suffix == ".gz"
    implied = _FORMATS_OF_SUFFIXES.get((out.with_suffix("") if is_compressed else out).suffix)
    kind = format or implied
    if kind is None:
        raise OutputError(f"the name {out} does not say what to export; give it with --format, {choice}")
    if implied not in (None, kind):
        raise OutputError(
            f"--format {format} contradicts the name {out}, which is that of {implied}; change one of them"
        )
    if kind == "parquet" and is_compressed:
        raise OutputError(f"cannot write {out}: Parquet is compressed within; choose a name that ends in .parquet")
    return kind


@contextmanager
def _opened(path: Path, *, compressed: bool) -> Iterator[IO[bytes]]:
    """Open a file for writing, through gzip if asked for; the same content gives the same bytes."""
    with path.open("wb") as file:
        if not compressed:
            yield file
            return
        with gzip.GzipFile(filename="", mode="wb", fileobj=file, mtime=0) as stream:
            yield stream  # type: ignore[misc]  # it is one, but is not declared so


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


def _write_csv(trajectories: pq.ParquetFile, file: IO[bytes]) -> None:
    with pyarrow.csv.CSVWriter(file, _plain_schema(trajectories)) as writer:
        for rows in _row_groups(trajectories):
            writer.write_table(_plain(rows))


def _write_parquet(trajectories: pq.ParquetFile, path: Path) -> None:
    with pq.ParquetWriter(path, _plain_schema(trajectories), compression="snappy") as writer:
        for rows in _row_groups(trajectories):
            writer.write_table(_plain(rows))


def _write_fcd(trajectories: pq.ParquetFile, file: IO[bytes], road: Road, edge: str) -> None:
    file.write(b'<?xml version="1.0" encoding="UTF-8"?>\n\n<fcd-export>\n')
    for rows in _row_groups(trajectories):  # a row group holds whole time steps
        lines = _fcd_lines(rows, road, edge).to_pylist()
        time = rows["time"].to_numpy()
        starts = np.concatenate([[0], np.flatnonzero(np.diff(time)) + 1])
        for start, stop in zip(starts, [*starts[1:], len(time)], strict=True):
            body = "\n".join(lines[start:stop])
            file.write(f'    <timestep time="{time[start]:.3f}">\n{body}\n    </timestep>\n'.encode())
    file.write(b"</fcd-export>\n")


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
