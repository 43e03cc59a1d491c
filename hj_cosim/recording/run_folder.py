"""A run's folder: config.toml, trajectories, robot and drivers as Parquet, summary.json, timing.json and figures/.

A folder appears whole or not at all, and the same record gives the same bytes: the order of the rows and the
compression are fixed, and what depends on the time or the machine is in timing.json alone.
"""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, fields, replace
from itertools import count
from os import PathLike
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from hj_cosim.errors import ConfigurationError, HjCosimError, RunFolderError
from hj_cosim.files import file_name, naming_the_place, remove_abandoned, require_writable, temporary_folder
from hj_cosim.locations import given_path, runs_folder
from hj_cosim.recording import trajectories
from hj_cosim.recording.beliefs import BeliefTrack
from hj_cosim.recording.car_rows import fill
from hj_cosim.recording.columns import name_numbers
from hj_cosim.recording.frames import RunFrames, driver_table, robot_table, trajectory_table
from hj_cosim.recording.record import DURATION, NO_VEHICLE, RobotTrack, RunRecord, ThreatTrack, TrafficTrack
from hj_cosim.recording.run_bounds import (
    MOST_SAMPLES,
    open_columns,
    plain_column,
    require_finite,
    require_road,
    require_room,
    require_times,
)
from hj_cosim.recording.spilled import SpilledTraffic, fits_into_memory, read_group, vehicle_names
from hj_cosim.recording.summary_file import TIMING, read_summary, summary_html, summary_sentence, summary_text
from hj_cosim.recording.trajectories import ROAD_KEY, TRAJECTORIES, parquet_options
from hj_cosim.recording.versions import VERSIONS, versions_text
from hj_cosim.scene.road import Road
from hj_cosim.scene.road_text import road_from_json
from hj_cosim.settings import EpisodeConfig, read_toml, validate

CONFIG = "config.toml"
ROBOT = "robot.parquet"
SUMMARY = "summary.json"
DRIVERS = "drivers.parquet"
NOTES = "own_simulation.toml"
FIGURES = "figures"
OWN_FILES = (CONFIG, TRAJECTORIES, ROBOT, SUMMARY, TIMING, VERSIONS, DRIVERS, NOTES, FIGURES)

Keep = Literal["all", "robot"]  # everything that a run folder holds, or all but the cars' trajectories

_ROBOT_STATE = ("x", "y", "heading", "speed", "steering", "omega", "acceleration", "plan_speed", "plan_lane")


@dataclass(frozen=True, repr=False)
class Run(RunFrames):
    """A run as read back from its folder; its arrays as DataFrames in `robot` and `trajectories`."""

    folder: Path
    config: Mapping[str, Any]  # everything that it depended on, as config.toml has it
    summary: Mapping[str, Any]  # a number or text a key, SI units; `hj-cosim metrics` explains each
    record: RunRecord

    def __repr__(self) -> str:
        return f"Run of {summary_sentence(self.summary)}, in {self.folder}"

    def _repr_html_(self) -> str:
        return summary_html(self.summary)


def require_free_folder(folder: Path) -> None:
    """Check, before the work, that a run can be written to `folder`.

    Raises:
        RunFolderError: if it is a file, a folder that already holds something, or where one may not write.
    """
    if folder.is_dir():
        remove_abandoned(folder)  # a study that was killed over its first file left nothing else
    if folder.is_dir() and any(folder.iterdir()):
        what = "already holds a run" if (folder / SUMMARY).exists() else "is not empty"
        raise RunFolderError(f"{folder} {what}; choose another --out, or remove it")
    if folder.exists() and not folder.is_dir():
        raise RunFolderError(f"{folder} is a file, a run needs a folder; choose another --out")
    try:
        require_writable(folder)
    except HjCosimError as error:
        raise RunFolderError(str(error)) from error


def require_not_own_file(path: Path) -> None:
    """Check that writing to `path` does not replace what a run recorded.

    Raises:
        RunFolderError: if it is one of the files of a run's folder.
    """
    place = path.resolve()
    if place.name in OWN_FILES and any((place.parent / name).is_file() for name in (CONFIG, TRAJECTORIES)):
        raise RunFolderError(f"{path} belongs to the run in {place.parent}; choose another name with --out")


@contextmanager
def whole_folder(folder: Path) -> Iterator[Path]:
    """Yield a temporary folder beside `folder`; it takes `folder`'s place when the block ends without an error.

    Raises:
        RunFolderError: if `folder` already holds something, or cannot be written.
    """
    require_free_folder(folder)
    with naming_the_place(folder, RunFolderError):
        folder.parent.mkdir(parents=True, exist_ok=True)
        with temporary_folder(folder.parent, folder.name) as temporary:
            # It is made private; what we write is as readable as any other folder of the user.
            temporary.chmod(folder.parent.stat().st_mode & 0o777)
            yield temporary
            temporary.replace(folder)


# Nine parameters: one for each file, and where they go.
def write_run(
    folder: Path,
    record: RunRecord,
    config_text: str,
    summary: Mapping[str, Any],
    drivers: np.ndarray | None = None,
    keep: Keep = "all",
    timing: Mapping[str, float] | None = None,
    versions: Mapping[str, str] | None = None,
    notes: str | None = None,
) -> None:
    """Write a run's folder, without its figures; all of it or nothing.

    Args:
        folder: must not exist yet, or be empty.
        record: the run.
        config_text: the resolved configuration as TOML.
        summary: as `metrics.summary.summarize` returns it.
        drivers: (J, 6) IDM parameters of the cars, in the order of vehicles.idm; drivers.parquet unless None.
        keep: `all`, or everything but trajectories.parquet, which is nearly all of the size (`robot`).
        timing: as `metrics.summary.timing` returns it; timing.json unless None.
        versions: of what it was driven with, as recording.versions has them; versions.json unless None.
        notes: TOML about a user's own simulation; own_simulation.toml unless None.

    Raises:
        RunFolderError: if `folder` already holds something, or cannot be written.
    """
    with whole_folder(folder) as temporary:
        (temporary / CONFIG).write_text(config_text, encoding="utf-8")
        if keep == "all":
            write_trajectories(temporary / TRAJECTORIES, record)
        _write_table(temporary / ROBOT, robot_table(record))
        if drivers is not None:
            _write_table(temporary / DRIVERS, driver_table(record.traffic.names, drivers))
        (temporary / SUMMARY).write_text(summary_text(summary), encoding="utf-8")
        if timing is not None:
            (temporary / TIMING).write_text(summary_text(timing), encoding="utf-8")
        if versions is not None:
            (temporary / VERSIONS).write_text(versions_text(versions), encoding="utf-8")
        if notes is not None:
            (temporary / NOTES).write_text(notes, encoding="utf-8")
        (temporary / FIGURES).mkdir()


def new_folder(name: str) -> Path:
    """Return a folder that does not exist yet, in runs/, with a name from anybody, or a number after it."""
    names = (name if attempt == 1 else f"{name}-{attempt}" for attempt in count(1))
    folders = (runs_folder() / file_name(each) for each in names)
    return next(folder for folder in folders if not folder.exists())


def write_trajectories(path: Path, record: RunRecord) -> None:
    """Write trajectories.parquet: a row per sample and car that is present; at one time the robot comes first.

    That of a drive which was too large for the memory has been written while it was driven, and is put into its place.
    """
    if isinstance(record.traffic, SpilledTraffic):
        record.traffic.move_to(path)
        return
    schema = trajectory_table(record, 0, 0).schema
    samples_per_group = max(trajectories.ROWS_PER_GROUP // (len(record.traffic.names) + 1), 1)
    with pq.ParquetWriter(path, schema, **parquet_options(schema)) as writer:
        for start in range(0, len(record.time), samples_per_group):
            writer.write_table(trajectory_table(record, start, start + samples_per_group))


def _write_table(path: Path, table: pa.Table) -> None:
    pq.write_table(table, path, **parquet_options(table.schema))


def read_run(folder: PathLike[str] | str) -> Run:
    """Return the run in `folder`, which anybody may have made.

    Raises:
        ConfigurationError: if `folder` is no path.
        RunFolderError: if the folder or one of its files is missing, broken, or larger than `run_bounds` allows.
    """
    folder = given_path(folder, "the run's folder")
    config = read_config(folder)
    missing = [name for name in (TRAJECTORIES, ROBOT, SUMMARY) if not (folder / name).exists()]
    if missing:
        raise RunFolderError(f"{folder} holds no complete run: {', '.join(missing)} is missing")
    try:
        summary = read_summary(folder / SUMMARY)
        record = replace(_read_record(folder), ended=str(summary.get("ended", DURATION)))
    except (OSError, ValueError, KeyError, IndexError) as error:  # pyarrow's and json's errors are among these
        raise RunFolderError(f"{folder} holds no readable run: {error}") from error
    return Run(folder, config, summary, record)


def read_config(folder: Path) -> dict[str, Any]:
    """Return the content of a run's config.toml, checked, and completed where it leaves something to its default.

    Raises:
        RunFolderError: if it is missing or broken.
    """
    if not folder.is_dir():
        raise RunFolderError(f"{folder} is not a folder; give the folder that a run wrote")
    if not (folder / CONFIG).is_file():
        raise RunFolderError(f"{folder} holds no run: {CONFIG} is missing")
    try:
        config = validate(EpisodeConfig, read_toml(folder / CONFIG), str(folder / CONFIG))
    except ConfigurationError as error:
        raise RunFolderError(f"{folder} holds no readable run: {error}") from error
    return config.model_dump(mode="json", exclude_none=True)


def road_of(schema: pa.Schema) -> Road:
    """Return the road that trajectories.parquet carries in its metadata.

    Raises:
        KeyError: if it carries none.
        ValueError: if that is no road.
    """
    try:
        road = road_from_json((schema.metadata or {})[ROAD_KEY])
    except KeyError as error:
        raise KeyError(f"{TRAJECTORIES} does not say what road it is about") from error
    require_road(road)
    return road


def _read_record(folder: Path) -> RunRecord:
    with open_columns(folder / ROBOT, ROBOT, MOST_SAMPLES) as file:
        robot = file.read()
    time = plain_column(robot, "time")
    require_times(time)
    with open_columns(folder / TRAJECTORIES, TRAJECTORIES) as file:
        road = road_of(file.schema_arrow)
        body, traffic, rogues, belief = _read_traffic(folder / TRAJECTORIES, file, time)
    columns = {name: plain_column(robot, name) for name in robot.column_names if name != "value_vehicle"}
    for field in (*fields(RobotTrack), *fields(ThreatTrack)):
        if field.name not in robot.column_names:
            raise ValueError(f"{ROBOT} has no column {field.name}")
    require_finite({name: columns[name] for name in _ROBOT_STATE})
    columns["value_vehicle"] = name_numbers(robot["value_vehicle"].combine_chunks(), NO_VEHICLE)
    if columns["value_vehicle"].max(initial=0) >= max(len(traffic.names), 1):
        raise ValueError(f"{ROBOT} names a vehicle that {TRAJECTORIES} does not have")
    return RunRecord(
        time=time,
        road=road,
        robot_length=body[0],
        robot_width=body[1],
        traffic=traffic,
        robot=RobotTrack(**{field.name: columns[field.name] for field in fields(RobotTrack)}),
        threats=ThreatTrack(**{field.name: columns[field.name] for field in fields(ThreatTrack)}),
        rogues=rogues,
        belief=belief.taken(len(time), len(traffic.names)),
    )


def _read_traffic(
    path: Path, file: pq.ParquetFile, time: np.ndarray
) -> tuple[tuple[float, float], TrafficTrack, dict[str, str], BeliefTrack]:
    """Return the robot's length and width, m, the cars, in memory unless they are too many, who means harm, or may."""
    names = vehicle_names(file)
    is_held = fits_into_memory(len(time), len(names))
    if is_held:
        require_room(len(time), len(names))
    sizes, body, rogues = np.zeros((len(names) - 1, 2)), (0.0, 0.0), dict[str, str]()
    traffic = TrafficTrack.empty(names[1:], sizes[:, 0], sizes[:, 1], len(time) if is_held else 0)
    beliefs = BeliefTrack(len(time))
    for number in range(file.num_row_groups):
        group = read_group(file, number, time, names)
        body = group.robot_body
        rogues |= group.rogues
        sizes[group.rows.vehicle] = np.column_stack([group.rows.length, group.rows.width])
        if group.belief is not None:
            beliefs.fill((group.first + group.rows.sample, group.rows.vehicle), group.belief)
        if is_held:
            fill(traffic, group.rows, group.first)
    return body, traffic if is_held else SpilledTraffic(path, time, names[1:], sizes), rogues, beliefs
