"""Takes down what the cars do, sample by sample: in memory while that is little, then into the file of the run.

Cars come and go; nobody has to be known beforehand. What is in memory is at most a stretch of samples and, before the
file is begun, MOST_IN_MEMORY samples of cars.
"""

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq

from hj_cosim.files import UnfinishedFile, naming_the_place
from hj_cosim.recording.beliefs import BeliefTrack
from hj_cosim.recording.car_rows import rows_of, track_of
from hj_cosim.recording.record import RobotTrack, TrafficTrack
from hj_cosim.recording.spilled import SpilledTraffic, fits_into_memory
from hj_cosim.recording.trajectories import Scene, parquet_options, rows_table
from hj_cosim.scene.observation import Observation

ROWS_PER_STRETCH = 1 << 16  # a row group of the file


class TrafficRecorder:
    """The cars of one episode while it is being driven."""

    def __init__(self, scene: Scene, names: Callable[[], Sequence[str]], beside: Path) -> None:
        """Begin with nothing.

        Args:
            scene: the road, the robot's body, who means harm.
            names: returns those of the cars that have come by now, by number.
            beside: the place near which a file is made if there is more than the memory is to hold.
        """
        self._scene, self._names, self._beside = scene, names, beside
        known = len(names())
        self._most_samples = max(ROWS_PER_STRETCH // (known + 1), 1)
        self._sizes = np.zeros((known, 2))
        self._pending: list[Observation] = []
        self._pending_rows = 0
        self._stretches: list[list[Observation]] = []  # those that have ended and are in memory
        # Of a drive that fails the writer goes first: it still writes the end of the file.
        self._writer: pq.ParquetWriter | None = None
        self._file: UnfinishedFile | None = None
        self._written = 0  # samples

    @property
    def is_stretch_full(self) -> bool:
        """Whether it is time for end_stretch."""
        return len(self._pending) >= self._most_samples or self._pending_rows >= ROWS_PER_STRETCH

    def record(self, observation: Observation) -> None:
        """Take one sample, which nobody may change any more."""
        self._pending.append(observation)
        self._pending_rows += len(observation.x) + 1

    def end_stretch(self, time: np.ndarray, robot: RobotTrack, beliefs: BeliefTrack) -> None:
        """Put what has been taken into the file, if it is too much for the memory.

        Args:
            time: (T,) s, of all samples up to now.
            robot: T samples.
            beliefs: about the cars, of the same samples.

        Raises:
            HjCosimError: if the file cannot be written.
        """
        self._stretches.append(self._pending)
        self._pending, self._pending_rows = [], 0
        if self._file is None and fits_into_memory(len(time), len(self._names())):
            return
        with naming_the_place(self._beside):
            for stretch in self._stretches:
                self._write(stretch, time, robot, beliefs)
        self._stretches = []

    def _write(self, stretch: list[Observation], time: np.ndarray, robot: RobotTrack, beliefs: BeliefTrack) -> None:
        rows = rows_of(stretch)
        known = int(rows.vehicle.max(initial=-1)) + 1
        if known > len(self._sizes):
            self._sizes = np.concatenate([self._sizes, np.zeros((known - len(self._sizes), 2))])
        self._sizes[rows.vehicle] = np.column_stack([rows.length, rows.width])
        first, last = self._written, self._written + len(stretch)
        table = rows_table(
            self._scene,
            time[first:last],
            robot.between(first, last),
            rows,
            tuple(self._names()),
            beliefs.of(first + rows.sample, rows.vehicle),
        )
        if self._file is None or self._writer is None:
            self._file = UnfinishedFile(self._beside)
            self._writer = pq.ParquetWriter(self._file.stream, table.schema, **parquet_options(table.schema))
        self._writer.write_table(table)
        self._written = last

    def finish(self, time: np.ndarray, robot: RobotTrack, beliefs: BeliefTrack) -> TrafficTrack:
        """Return what was taken.

        Args:
            time: (T,) s, of all samples.
            robot: T samples.
            beliefs: about the cars, of the same samples.

        Raises:
            HjCosimError: if the file cannot be written.
        """
        if self._pending:
            self.end_stretch(time, robot, beliefs)
        names = tuple(self._names())
        if self._writer is None or self._file is None:
            return track_of([seen for stretch in self._stretches for seen in stretch], names)
        with naming_the_place(self._beside):
            self._writer.close()
            self._file.stream.flush()
        sizes = np.concatenate([self._sizes, np.zeros((len(names) - len(self._sizes), 2))])
        return SpilledTraffic(self._file, time, names, sizes)
