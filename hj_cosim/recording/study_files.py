"""The files of a study's folder, and study.toml: what was asked for, by which a study is known again.

Whoever reads a study needs no more than this; `study.folder` says what each file holds.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import tomli_w
from pydantic import Field

from hj_cosim.errors import ConfigurationError, RunFolderError
from hj_cosim.files import whole_file
from hj_cosim.recording.run_folder import SUMMARY, Keep, require_not_own_file
from hj_cosim.settings import Settings, read_toml, shown, validate

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
# What no export, figure or report may replace; the report of a study is written anew at any time.
OWN_FILES = (STUDY, TABLE, DIFFERENCES, COMPARISON, CLAIMS_TABLE, EPISODES_TABLE, WINDOWS, WALL_TIMES)


class StudyRequest(Settings):
    """What is asked of a study; it decides every byte of the tables."""

    scenarios: tuple[str, ...] = Field(min_length=1, description="names in sumo_net/ or paths to scenario TOMLs")
    stacks: tuple[str, ...] = Field(min_length=1, description="in the order of the table's rows")
    episodes: int = Field(ge=1, le=1_000_000, description="for each row of the table")
    seed: int = Field(ge=0, description="the first of as many consecutive seeds, the same for every row")
    preset: str = Field(description="best or paper")
    vary: tuple[str, ...] = Field(description="KEY=VALUE,VALUE of each varied knob")
    set: tuple[str, ...] = Field(description="KEY=VALUE for every episode")
    keep: Keep = Field(description="all that a run folder holds, or all but the cars' trajectories (robot)")
    traffic: Literal["theirs", "idm-mobil"] = Field("theirs", description="who drives the others in a .sumocfg")

    @property
    def rows(self) -> int:
        """The number of the table's rows: every stack in every scenario with every combination of the varied knobs."""
        settings = math.prod(len(split_variation(text)[1]) for text in self.vary)
        return len(self.scenarios) * len(self.stacks) * settings


class StudyFile(StudyRequest):
    """The content of study.toml."""

    program: Mapping[str, str] = Field(description="versions of what an episode depends on besides its configuration")


@dataclass(frozen=True)
class StudyProgress:
    """How far a study is."""

    done: int  # episodes whose run folders are there
    total: int
    has_tables: bool

    @property
    def text(self) -> str:
        """Say it in words, for example `12 of 40 episodes`."""
        return f"{self.done} of {self.total} episodes"

    @property
    def is_unfinished(self) -> bool:
        """Whether there is something left that `hj-cosim study --resume` would do."""
        return self.done < self.total or not self.has_tables


def split_variation(text: str) -> tuple[str, tuple[str, ...]]:
    """Return the key and the values of a text such as `planner.gamma_r=0.8,0.9,1.0`."""
    key, _, listed = text.partition("=")
    return key.strip(), tuple(value.strip() for value in listed.split(","))


def require_not_ours(path: Path) -> None:
    """Check that writing to `path` replaces neither what a run recorded nor what a study found.

    Raises:
        RunFolderError: if it is one of the files of a run's or a study's folder.
    """
    require_not_own_file(path)
    place = path.resolve()
    if place.name in OWN_FILES and (place.parent / STUDY).is_file():
        raise RunFolderError(f"{path} belongs to the study in {place.parent}; choose another name with --out")


def read_study_file(folder: Path) -> StudyFile:
    """Return the study.toml of a study's folder.

    Raises:
        ConfigurationError: if it is missing, or is not what a study wrote.
    """
    path = folder / STUDY
    if not path.is_file():
        raise ConfigurationError(f"{folder} holds no study: {STUDY} is missing; give the folder that a study wrote")
    return validate(StudyFile, read_toml(path), str(path))


def write_study_file(folder: Path, request: StudyRequest, program: Mapping[str, str]) -> None:
    """Write study.toml, which marks the folder as a study's, whole or not at all; nothing if it is there already."""
    text = tomli_w.dumps({**request.model_dump(mode="json"), "program": dict(program)})
    path = folder / STUDY
    if path.is_file() and path.read_bytes() == text.encode():
        return
    with whole_file(path) as temporary:
        temporary.write_bytes(text.encode())


def study_progress(folder: Path) -> StudyProgress:
    """Return how far the study in a folder is.

    Raises:
        ConfigurationError: as read_study_file.
    """
    request = read_study_file(folder)
    # What is being written has a name that begins with a dot.
    summaries = (folder / EPISODES).glob(f"**/{SUMMARY}")
    done = sum(not any(part.startswith(".") for part in path.relative_to(folder).parts) for path in summaries)
    return StudyProgress(done, request.rows * request.episodes, (folder / TABLE).is_file())


def require_no_contradiction(folder: Path, earlier: StudyRequest, given: Mapping[str, Any]) -> None:
    """Check that what is asked for now is the study that is in a folder; it may get more episodes.

    Args:
        folder: the study's.
        earlier: what its study.toml asks for.
        given: the fields of a StudyRequest that were given now.

    Raises:
        ConfigurationError: if a value is another one; the sentence has both.
    """
    for name, value in given.items():
        before = getattr(earlier, name)
        if value == before or (name == "episodes" and value > before):
            continue
        advice = "ask for as many or more" if name == "episodes" else "leave that out to go on with it"
        raise ConfigurationError(
            f"{folder / STUDY} has {name} = {_shown(before)}, but {name} = {_shown(value)} is asked for now;"
            f" {advice}, or choose another --out"
        )


def _shown(value: Any) -> str:
    return shown(repr(list(value) if isinstance(value, tuple) else value))
