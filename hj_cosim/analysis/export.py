"""A run's trajectories in other forms: CSV, plain Parquet, highD's CSVs, and SUMO's FCD XML, texts compressed if asked.

All stream row group by row group, so that a long drive of many cars needs little memory.
"""

import gzip
import re
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from os import PathLike
from pathlib import Path
from typing import IO

import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet as pq

from hj_cosim.analysis.fcd import TYPES, TYPES_TEXT, lane_names, row_groups, types_of, write_fcd
from hj_cosim.analysis.highd import RECORDING_META, TRACKS, TRACKS_META, write_highd
from hj_cosim.errors import OutputError, RunFolderError
from hj_cosim.files import naming_the_place, whole_file
from hj_cosim.locations import given_path
from hj_cosim.recording.run_bounds import open_columns
from hj_cosim.recording.run_folder import read_config, road_of
from hj_cosim.recording.study_files import require_not_ours
from hj_cosim.recording.trajectories import TRAJECTORIES
from hj_cosim.settings import shown

# What each format's file is called when no name is given.
DEFAULT_NAMES = {
    "csv": "trajectories.csv",
    "parquet": "trajectories.plain.parquet",
    "fcd": "trajectories.fcd.xml",
    "highd": f"01{TRACKS}",
}
COLUMNS = ("time", "vehicle", "x", "y", "heading", "speed", "acceleration", "lane", "length", "width")


_FORMATS_OF_SUFFIXES = {".csv": "csv", ".parquet": "parquet", ".xml": "fcd"}
_OTHER_COMPRESSIONS = (".bz2", ".xz", ".zst", ".zip", ".7z", ".tgz", ".tar")


def export_run(folder: PathLike[str] | str, format: str | None = None, out: PathLike[str] | str | None = None) -> Path:
    """Write a run's trajectories in another form.

    `csv` and `parquet` have the columns of trajectories.parquet, the names as plain strings, in compression that every
    reader knows. `fcd` is SUMO's floating car data: world coordinates of the middle of the front bumper, angles in
    degrees clockwise from north, lane names, and positions along the lane; the latter two not of a user's own
    simulation, nor of cars on ramps. The robot has a type of its own, `robot`,
    which a second file beside it defines (NAME.types.add.xml); with both, SUMO replays it
    (`sumo-gui --net-file NET --step-length 0.02 --additional-files TYPES --device.fcd-replay.file FILE`).
    `highd` is highD's three CSV files, 25 frames a second (analysis/highd.py).

    Args:
        folder: of the run.
        format: `csv`, `parquet`, `fcd` or `highd`; unless given, what the file's name says, or else `csv`.
        out: the file, compressed with gzip if its name ends in .gz; in the run's folder under DEFAULT_NAMES unless
            given. Of highD's three it is NN_tracks.csv, and the others appear beside it.

    Returns:
        The file that was written, the first of those that are.

    Raises:
        ConfigurationError: if `folder` or `out` is no path.
        OutputError: if the format is unknown, the file's name contradicts it, or what is to appear beside it would
            replace a file that no earlier export wrote, or the file is there and its name is no export's.
        NetworkError: if it is to be `fcd` of a drive on a route, whose network is gone.
        RunFolderError: if the folder holds no run, or the file belongs to one or to a study.
        HjCosimError: if the file cannot be written.
    """
    return export_files(folder, format, out)[0]


def export_files(folder: PathLike[str] | str, format: str | None, out: PathLike[str] | str | None) -> list[Path]:
    """Do as `export_run`, and return all files that were written."""
    folder = given_path(folder, "the run's folder")
    out = None if out is None else given_path(out, "out")
    kind = _format_of(format, out)
    target = folder / DEFAULT_NAMES[kind] if out is None else out
    written = [target, *_companions(target, kind)]
    for path in written:
        require_not_ours(path)
    _require_name_of_an_export(target, kind)
    for path in written[1:]:
        _require_exported(path, target, kind)
    if not (folder / TRAJECTORIES).is_file():
        raise RunFolderError(f"{folder} holds no run: {TRAJECTORIES} is missing")
    config = read_config(folder) if kind in ("fcd", "highd") else {}
    try:
        with open_columns(folder / TRAJECTORIES, TRAJECTORIES) as trajectories:
            _require_columns(trajectories.schema_arrow)
            with ExitStack() as whole:
                temporary, *beside = [whole.enter_context(whole_file(path)) for path in written]
                if kind == "parquet":
                    _write_parquet(trajectories, temporary)
                    return written
                if kind == "highd":
                    road, step = road_of(trajectories.schema_arrow), config["simulation"]["step"]
                    write_highd(trajectories, road, step, _recording(target), (temporary, beside[0], beside[1]))
                    return written
                with _opened(temporary, compressed=target.suffix == ".gz") as file:
                    if kind == "csv":
                        _write_csv(trajectories, file)
                    else:
                        road = road_of(trajectories.schema_arrow)
                        write_fcd(trajectories, file, road, lane_names(road, config["scenario"]))
                        beside[0].write_text(types_of(trajectories), encoding="utf-8")
    except (OSError, ValueError, KeyError) as error:  # pyarrow's errors are among these
        raise RunFolderError(f"{folder / TRAJECTORIES} is broken: {error}") from error
    return written


def _companions(file: Path, kind: str) -> tuple[Path, ...]:
    """Return the files that are written beside an export, of formats that take more than one."""
    if kind == "highd":
        return tuple(file.with_name(file.name.removesuffix(TRACKS) + end) for end in (TRACKS_META, RECORDING_META))
    if kind == "fcd":
        stem = file.name.removesuffix(".gz").removesuffix(".xml").removesuffix(".fcd")
        return (file.with_name(stem + TYPES),)
    return ()


def _require_name_of_an_export(target: Path, kind: str) -> None:
    """Check that an export replaces only files of its own kind, not somebody's plug-in or network, by their names.

    Raises:
        OutputError: if the file is there, and has another name than exports have.
    """
    name = target.with_suffix("") if target.suffix == ".gz" else target
    is_export = _FORMATS_OF_SUFFIXES.get(name.suffix) == ("csv" if kind == "highd" else kind)
    if kind == "fcd":
        is_export = is_export and name.with_suffix("").suffix in ("", ".fcd")  # .net.xml and the like are SUMO's
    if target.is_file() and not is_export:
        raise OutputError(
            f"cannot write {target}: it is there already, and its name is not one that exports have; choose another"
            " with --out"
        )


def _require_exported(companion: Path, target: Path, kind: str) -> None:
    """Check that a file beside an export, which nobody named, is not there, or is an earlier export's.

    SUMO's types are known by their content, for an export and the same compressed share them; highD's files by what
    they are beside.

    Raises:
        OutputError: if it is another's.
    """
    if not companion.exists():
        return
    if kind == "highd":
        is_ours = target.exists()
    else:
        form = re.escape(TYPES_TEXT.format("LENGTH", "WIDTH")).replace("LENGTH", '[^"]+').replace("WIDTH", '[^"]+')
        with naming_the_place(companion):
            content = companion.read_bytes() if companion.stat().st_size < 2 * len(TYPES_TEXT) else b""
        is_ours = re.fullmatch(form.encode(), content.replace(b"\r\n", b"\n")) is not None
    if not is_ours:
        raise OutputError(
            f"cannot write {target}: {companion} would be written beside it, but is there already and is none of an"
            " earlier export's files; choose another name with --out"
        )


def _recording(tracks: Path) -> int:
    """Return the number in the name of NN_tracks.csv; 1 where there is none."""
    number = tracks.name.removesuffix(TRACKS)
    return int(number) if number.isascii() and number.isdigit() else 1


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
    if format == "highd":
        if not out.name.endswith(TRACKS):
            raise OutputError(f"cannot write {out}: highD's first file is called NN{TRACKS}, for example 01{TRACKS}")
        return format
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


def _plain(rows: pa.Table) -> pa.Table:
    """Return the rows with the vehicles' names as plain strings."""
    return rows.set_column(rows.schema.get_field_index("vehicle"), "vehicle", rows["vehicle"].cast(pa.string()))


def _plain_schema(trajectories: pq.ParquetFile) -> pa.Schema:
    schema = trajectories.schema_arrow
    return schema.set(schema.get_field_index("vehicle"), pa.field("vehicle", pa.string()))


def _write_csv(trajectories: pq.ParquetFile, file: IO[bytes]) -> None:
    with pyarrow.csv.CSVWriter(file, _plain_schema(trajectories)) as writer:
        for rows in row_groups(trajectories):
            writer.write_table(_plain(rows))


def _write_parquet(trajectories: pq.ParquetFile, path: Path) -> None:
    with pq.ParquetWriter(path, _plain_schema(trajectories), compression="snappy") as writer:
        for rows in row_groups(trajectories):
            writer.write_table(_plain(rows))
