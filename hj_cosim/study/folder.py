"""A study's folder: which episodes are there, what is still to be driven, and where its tables go.

study.toml           what was asked for, and by which versions of the program it is driven; --resume reads it
table.csv            a row per stack (and scenario, and value of a varied knob): episodes, missing ones, and every
                     metric with its 95 % bootstrap interval over episodes in _lo and _hi; the last to appear
differences.csv      every two rows that differ in one factor: first minus second on the seeds that both have
comparison.csv       the paper's numbers (_paper) beside ours, of the paper's stacks in the paper's traffic
claims.csv           what the paper says of its stacks, or the preset promises, checked in the paper's traffic
episodes.parquet     a row per episode: its row's factors, seed, and the numbers of its summary.json
windows.parquet      a row per episode and whole ten seconds, the points of the trade-off figure: factors, seed,
                     start (s), ttc_p1 (s, the 1st percentile of TTC) and mean_speed (m/s)
wall_times.csv       what each episode took: factors, seed, wall_seconds, real_time_factor; this alone depends on the
                     machine, all else is the same on every machine and for any number of workers
episodes/<stack>/<seed>/      a run folder each, below <scenario>/ and <key>=<value>/ where these vary; without
                              trajectories.parquet and pictures if the study keeps the robot alone
failures/<stack>/<seed>.log   of episodes that failed, what the worker printed last
figures/             trade-off.png, one for each scenario and value of a varied knob, and density-sweep.png if there
                     are several scenarios
"""

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from shutil import rmtree
from typing import Any

from hj_cosim.cosim.configuration import config_toml
from hj_cosim.errors import RunFolderError
from hj_cosim.files import remove_abandoned, whole_file
from hj_cosim.reachability.table.store import KeptTable
from hj_cosim.recording.run_folder import require_free_folder
from hj_cosim.recording.study_files import (
    CLAIMS_TABLE,
    COMPARISON,
    DIFFERENCES,
    EPISODES,
    EPISODES_TABLE,
    FAILURES,
    STUDY,
    TABLE,
    WALL_TIMES,
    WINDOWS,
    StudyRequest,
    read_study_file,
    write_study_file,
)
from hj_cosim.settings import EpisodeConfig
from hj_cosim.study.design import Cell, StudyDesign, design_of
from hj_cosim.study.jobs import EpisodeJob, Outcome, table_key
from hj_cosim.study.results import config_of, is_complete
from hj_cosim.study.tables import read_csv

_TABLES = (DIFFERENCES, COMPARISON, CLAIMS_TABLE, EPISODES_TABLE, WINDOWS, WALL_TIMES, TABLE)


@dataclass(frozen=True)
class Failure:
    """An episode that could not be driven."""

    stack: str  # its folder below episodes/
    seed: int
    reason: str  # one sentence
    log: Path  # what the worker printed


@dataclass(frozen=True)
class StudyFolder:
    """The folder of a study."""

    path: Path
    request: StudyRequest
    design: StudyDesign  # of the request

    @classmethod
    def of(cls, path: Path, request: StudyRequest) -> "StudyFolder":
        """Return the folder of what is asked for; nothing is read or written yet.

        Raises:
            ConfigurationError: if what is asked for is unknown, of the wrong type or out of range.
        """
        return cls(path, request, design_of(request))

    def begin(self, program: Mapping[str, str], *, resume: bool) -> None:
        """Check that the study can go here, write study.toml, and clear away what an interrupted one left unfinished.

        Args:
            program: the version of everything that an episode depends on besides its configuration.
            resume: go on with the study that is here, which `resumed_study` has read the request from.

        Raises:
            RunFolderError: if the folder holds something else, a study that is not to be resumed, or episodes of
                another program or configuration; nothing has been changed then.
        """
        if resume:
            self._require_same_program(program)
            self._require_same_configurations()
        elif (self.path / STUDY).is_file():
            raise RunFolderError(
                f"{self.path} already holds a study; add --resume to go on with it, or choose another --out"
            )
        else:
            require_free_folder(self.path)
        write_study_file(self.path, self.request, program)
        for folder in (self.path, self.path / EPISODES, *(self.path / EPISODES).glob("**/")):
            remove_abandoned(folder)
        rmtree(self.path / FAILURES, ignore_errors=True)

    def _require_same_program(self, program: Mapping[str, str]) -> None:
        earlier = read_study_file(self.path).program
        for name in sorted(earlier.keys() & program.keys()):
            if earlier[name] != program[name]:
                raise RunFolderError(
                    f"{self.path / STUDY}: the study was begun with {name} {earlier[name]}, this is {program[name]};"
                    " episodes of both would not be comparable, so choose another --out"
                )

    def _require_same_configurations(self) -> None:
        for cell, seed in self.design.episodes():
            run_folder = self.run_folder(cell, seed)
            if not is_complete(run_folder):
                continue
            earlier, now = config_of(run_folder), config_toml(cell.config_of(seed))
            if earlier != now:
                raise RunFolderError(
                    f"{run_folder} was driven with another configuration than the study has now:"
                    f" {_first_difference(earlier, now)}; undo that in the scenario's file, or choose another --out"
                )

    def run_folder(self, cell: Cell, seed: int) -> Path:
        """Return the run folder of an episode."""
        return self.path / EPISODES / self.design.folder_name(cell) / str(seed)

    @property
    def tables(self) -> dict[str, EpisodeConfig]:
        """A configuration for each value table that the study's episodes need, by its `table_key`."""
        return {table_key(cell.config): cell.config for cell in self.design.cells}

    def remaining_jobs(self, tables: Mapping[str, Sequence[KeptTable]]) -> list[EpisodeJob]:
        """Return the episodes that are not there yet.

        Args:
            tables: the solved value tables of each `table_key` of the configurations, that of cars first.
        """
        jobs = []
        program = read_study_file(self.path).program
        for cell, seed in self.design.episodes():
            folder = self.run_folder(cell, seed).absolute()  # a plug-in may change the current folder
            if not is_complete(folder):
                table, *larger = tables[table_key(cell.config)]
                config, keep = cell.config_of(seed), self.request.keep
                jobs.append(EpisodeJob(config, table, folder, keep, tuple(larger), program))
        return jobs

    def is_finished(self) -> bool:
        """Return whether every episode is there, and all tables are of all of them."""
        if not all((self.path / name).is_file() for name in _TABLES):
            return False
        try:
            episodes = list(read_csv(self.path / TABLE)["episodes"])
        except (KeyError, ValueError):  # somebody wrote into it: it is made anew
            return False
        of_all = [len(self.design.seeds)] * len(self.design.cells)
        return episodes == of_all and all(is_complete(self.run_folder(*episode)) for episode in self.design.episodes())

    def keep_log(self, outcome: Outcome) -> Failure:
        """Write the log of an episode that failed, and return what is known of it."""
        place = outcome.job.folder.relative_to((self.path / EPISODES).absolute())
        log = self.path / FAILURES / place.parent / f"{place.name}.log"
        with whole_file(log) as temporary:
            temporary.write_text(f"{outcome.error}\n\n{outcome.log}", encoding="utf-8")
        return Failure(place.parent.as_posix(), outcome.job.config.seed, str(outcome.error), log)


def _first_difference(earlier: str, now: str) -> str:
    """Return which key of two configurations differs first, with both values."""
    was, wanted = _flat(tomllib.loads(earlier)), _flat(tomllib.loads(now))
    for key in was | wanted:
        if was.get(key) != wanted.get(key):
            return f"{key} was {was.get(key)!r} and is {wanted.get(key)!r}"
    return "it is written differently"


def _flat(nested: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    flat: dict[str, Any] = {}
    for key, value in nested.items():
        flat |= _flat(value, f"{prefix}{key}.") if isinstance(value, Mapping) else {f"{prefix}{key}": value}
    return flat
