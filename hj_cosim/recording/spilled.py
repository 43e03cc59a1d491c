"""The traffic of a run in its trajectories.parquet, for runs that are too long or too crowded to be held in memory."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import cached_property
from pathlib import Path
from shutil import copyfile
from typing import Any, NamedTuple

import numpy as np
import pyarrow.parquet as pq

from hj_cosim.errors import RunFolderError
from hj_cosim.files import UnfinishedFile
from hj_cosim.recording.beliefs import beliefs_of
from hj_cosim.recording.car_rows import MOTION, CarRows, fill, piece_of
from hj_cosim.recording.record import ROBOT_NAME, Piece, TrafficTrack
from hj_cosim.recording.roles import rogues_of
from hj_cosim.recording.run_bounds import open_columns, plain_column, plain_numbers, require_finite, require_room
from hj_cosim.recording.trajectories import TRAJECTORIES

KEPT = ("present", *MOTION, "lane")
# Samples times cars that a run has in memory; more stay in its file. As rows that is 35 MB.
MOST_IN_MEMORY = 300_000


def fits_into_memory(samples: int, cars: int) -> bool:
    """Return whether a run's cars are few enough to be held in memory."""
    return samples * cars <= MOST_IN_MEMORY


class Group(NamedTuple):
    """A row group of trajectories.parquet: consecutive samples."""

    first: int  # sample
    samples: int
    rows: CarRows  # without the robot; samples count from `first`
    robot_body: tuple[float, float]  # length and width, m
    rogues: Mapping[str, str]  # what those of them do who mean harm, by name
    belief: np.ndarray | None  # of each row; see beliefs_of


def vehicle_names(trajectories: pq.ParquetFile) -> tuple[str, ...]:
    """Return the names of all vehicles, the robot's first.

    Raises:
        ValueError: if there are none.
    """
    last = trajectories.num_row_groups - 1
    chunks = trajectories.read_row_group(last, columns=["vehicle"])["vehicle"].chunks
    names = chunks[0].dictionary.to_pylist() if chunks else []
    if not names or not all(isinstance(name, str) for name in names):
        raise ValueError(f"{TRAJECTORIES} names no vehicle")
    return tuple(names)


def read_group(trajectories: pq.ParquetFile, number: int, time: np.ndarray, names: tuple[str, ...]) -> Group:
    """Return a row group, checked.

    Args:
        trajectories: the file.
        number: which group.
        time: (T,) s, of all samples of the run.
        names: of all vehicles, the robot's first.

    Raises:
        ValueError, KeyError, IndexError: if it is not what a run has.
    """
    table = trajectories.read_row_group(number, use_threads=False)
    vehicle = table["vehicle"].combine_chunks()
    known = tuple(vehicle.dictionary.to_pylist())
    if known != names[: len(known)]:
        raise ValueError(f"{TRAJECTORIES} numbers its vehicles differently from place to place")
    car = plain_numbers(vehicle.indices, "vehicle").astype(np.int32)
    when = plain_column(table, "time")
    sample = np.searchsorted(time, when)
    if not len(sample) or int(sample.max()) >= len(time):
        raise ValueError(f"{TRAJECTORIES} has times that are out of bounds")
    columns = {name: plain_column(table, name) for name in (*MOTION, "lane", "length", "width")}
    require_finite(columns)
    own, first, last = np.flatnonzero(car == 0), int(sample.min()), int(sample.max())
    body = (float(columns["length"][own[-1]]), float(columns["width"][own[-1]])) if len(own) else (0.0, 0.0)
    others = car > 0
    kept = {name: column[others] for name, column in columns.items()}
    rows = CarRows(sample=(sample[others] - first).astype(np.int32), vehicle=car[others] - 1, **kept)
    belief = beliefs_of(table)
    believed = None if belief is None else belief[others]
    return Group(first, last - first + 1, rows, body, rogues_of(table, car, list(known)), believed)


class SpilledTraffic(TrafficTrack):
    """A track that lies in a file; its arrays are read when they are asked for, if they can be held.

    Whoever goes through its pieces, or asks for one sample or one car, needs little memory.
    """

    def __init__(
        self, source: Path | UnfinishedFile, time: np.ndarray, names: tuple[str, ...], sizes: np.ndarray
    ) -> None:
        """Take a file that has been written.

        Args:
            source: the file, or its path.
            time: (T,) s, of its samples.
            names: of the J cars by number, without the robot.
            sizes: (J, 2) their lengths and widths, m.
        """
        known = {"source": source, "names": names, "length": sizes[:, 0], "width": sizes[:, 1], "_time": time}
        for name, value in known.items():
            object.__setattr__(self, name, value)

    source: Path | UnfinishedFile
    _time: np.ndarray

    def __getattr__(self, name: str) -> Any:
        """Return one of the arrays (T, J), all of which are read now.

        Raises:
            RunFolderError: if the file is broken, or too large to be held in memory.
        """
        if name not in KEPT:
            raise AttributeError(name)
        return getattr(self._whole, name)

    @cached_property
    def _whole(self) -> TrafficTrack:
        with self._reading():
            require_room(len(self._time), len(self.names))
        track = TrafficTrack.empty(self.names, self.length, self.width, len(self._time))
        for group in self._groups():
            fill(track, group.rows, group.first)
        return track

    def pieces(self) -> Iterator[Piece]:
        """Yield all samples, in order, a row group at a time, each with columns for those that are in it.

        Raises:
            RunFolderError: if the file is broken.
        """
        for group in self._groups():
            with self._reading():
                require_room(group.samples, len(np.unique(group.rows.vehicle)))
            yield piece_of(group.rows, group.first, group.samples, self.names)

    def at(self, sample: int) -> Piece:
        """Return who is present at a sample."""
        number = int(np.searchsorted(self._starts, self._time[sample], side="right")) - 1
        with self._reading(), self._opened() as file:
            group = read_group(file, max(number, 0), self._time, (ROBOT_NAME, *self.names))
        here = group.rows.sample == sample - group.first
        rows = CarRows(*(column[here] for column in group.rows))
        return piece_of(rows._replace(sample=np.zeros_like(rows.sample)), sample, 1, self.names)

    def of(self, car: int) -> TrafficTrack:
        """Return the track of one car alone, (T, 1)."""
        track = TrafficTrack.empty((self.names[car],), self.length[[car]], self.width[[car]], len(self._time))
        for group in self._groups():
            rows = CarRows(*(column[group.rows.vehicle == car] for column in group.rows))
            fill(track, rows, group.first, np.zeros(len(rows.sample), np.int32))
        return track

    def move_to(self, place: Path) -> None:
        """Put the file into a place, or a copy of it if it has one already.

        Raises:
            OSError: if that is not possible.
        """
        if isinstance(self.source, UnfinishedFile):
            self.source.move_to(place)
        else:
            copyfile(self.source, place)

    def _opened(self) -> pq.ParquetFile:
        source = self.source.stream if isinstance(self.source, UnfinishedFile) else self.source
        return open_columns(source, TRAJECTORIES)

    def _groups(self) -> Iterator[Group]:
        with self._reading(), self._opened() as file:
            for number in range(file.num_row_groups):
                yield read_group(file, number, self._time, (ROBOT_NAME, *self.names))

    @cached_property
    def _starts(self) -> np.ndarray:
        """The first time of each row group, s."""
        with self._reading(), self._opened() as file:
            found = [file.read_row_group(number, ["time"])["time"][0].as_py() for number in range(file.num_row_groups)]
        return np.array(found, dtype=float)

    @contextmanager
    def _reading(self) -> Iterator[None]:
        try:
            yield
        except (OSError, ValueError, KeyError, IndexError) as error:  # pyarrow's errors are among these
            raise RunFolderError(f"{TRAJECTORIES} is not readable: {error}") from error
