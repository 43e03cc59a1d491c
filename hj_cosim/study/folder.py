"""A study's folder: which episodes are there, what is still to be driven, and where its tables go.

study.toml           what was asked for
table.csv            a row per stack (and scenario, and value of a varied knob), with intervals
differences.csv      rows against rows, on the same seeds
comparison.csv       the paper's numbers beside ours
episodes.parquet     a row per episode
windows.parquet      a row per episode and ten seconds: the points of the trade-off figure
wall_times.csv       what each episode took; all else is the same on every machine and for any number of workers
episodes/<stack>/<seed>/      a run folder each
failures/<stack>/<seed>.log   of episodes that failed
figures/
"""

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from shutil import rmtree
from typing import Any

import tomli_w

from hj_cosim.cosim.configuration import config_toml
from hj_cosim.errors import RunFolderError
from hj_cosim.files import remove_abandoned, whole_file
from hj_cosim.recording.run_folder import Keep, require_free_folder
from hj_cosim.settings import read_toml
from hj_cosim.study.design import Cell, StudyDesign
from hj_cosim.study.jobs import EpisodeJob, Outcome, table_key
from hj_cosim.study.results import config_of, is_complete

STUDY = "study.toml"
TABLE = "table.csv"
DIFFERENCES = "differences.csv"
COMPARISON = "comparison.csv"
CLAIMS_TABLE = "claims.csv"
EPISODES_TABLE = "episodes.parquet"
WINDOWS = "windows.parquet"
WALL_TIMES = "wall_times.csv"
EPISODES = "episodes"
FAILURES = "failures"
FIGURES = "figures"


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
    design: StudyDesign

    def prepare(self, *, resume: bool) -> None:
        """Make sure that the study can go here, and clear away what an interrupted one left unfinished.

        Raises:
            RunFolderError: if the folder holds something else, or a study that is not to be resumed.
        """
        if not (self.path / STUDY).is_file():
            require_free_folder(self.path)
        elif not resume and (self.path / EPISODES).exists():
            raise RunFolderError(
                f"{self.path} already holds a study; add --resume to go on with it, or choose another --out"
            )
        for folder in (self.path, self.path / EPISODES, *(self.path / EPISODES).glob("**/")):
            remove_abandoned(folder)
        rmtree(self.path / FAILURES, ignore_errors=True)

    def require_same_program(self, program: Mapping[str, str]) -> None:
        """Check that what is there was driven by the same program.

        Args:
            program: the version of everything that an episode depends on besides its configuration.

        Raises:
            RunFolderError: if a version is another than study.toml has.
        """
        earlier = read_toml(self.path / STUDY).get("program", {}) if (self.path / STUDY).is_file() else {}
        if not isinstance(earlier, dict):
            raise RunFolderError(
                f"{self.path / STUDY}: program = {earlier!r} is no table of versions; choose another --out"
            )
        for name in sorted(earlier.keys() & program.keys()):
            if earlier[name] != program[name]:
                raise RunFolderError(
                    f"{self.path / STUDY}: the study was begun with {name} {earlier[name]}, this is {program[name]};"
                    " episodes of both would not be comparable, so choose another --out"
                )

    def describe(self, request: Mapping[str, Any], program: Mapping[str, str]) -> None:
        """Write study.toml, which marks the folder as a study's: what was asked for, and of which program."""
        with whole_file(self.path / STUDY) as temporary:
            temporary.write_text(tomli_w.dumps({**request, "program": dict(program)}), encoding="utf-8")

    def run_folder(self, cell: Cell, seed: int) -> Path:
        """Return the run folder of an episode."""
        return self.path / EPISODES / self.design.folder_name(cell) / str(seed)

    def remaining_jobs(self, table_files: Mapping[str, Path], keep: Keep = "all") -> list[EpisodeJob]:
        """Return the episodes that are not there yet.

        Args:
            table_files: the solved value table of each `table_key` of the configurations.
            keep: what their run folders are to hold.

        Raises:
            RunFolderError: if an episode that is there was driven with another configuration.
        """
        jobs = []
        for cell, seed in self.design.episodes():
            config = cell.config.model_copy(update={"seed": seed})
            run_folder = self.run_folder(cell, seed)
            if not is_complete(run_folder):
                jobs.append(EpisodeJob(config, table_files[table_key(config)], run_folder, keep))
            elif (earlier := config_of(run_folder)) != config_toml(config):
                raise RunFolderError(
                    f"{run_folder} was driven with another configuration than is asked for now:"
                    f" {_first_difference(earlier, config_toml(config))}; resume with the options in"
                    f" {self.path / STUDY}, or choose another --out"
                )
        return jobs

    def keep_log(self, outcome: Outcome) -> Failure:
        """Write the log of an episode that failed, and return what is known of it."""
        place = outcome.job.folder.relative_to(self.path / EPISODES)
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
