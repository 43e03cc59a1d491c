"""What workers do: one episode a job, its folder written whole or not at all; engines differ in where they do it."""

from collections.abc import Callable, Generator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

from hj_cosim.reachability.table.size_classes import classes_met
from hj_cosim.reachability.table.store import KeptTable
from hj_cosim.recording.run_folder import Keep
from hj_cosim.settings import EpisodeConfig


@dataclass(frozen=True)
class EpisodeJob:
    """One episode of a study, ready to be sent to a worker."""

    config: EpisodeConfig
    table: KeptTable  # the solved value table, and what it was solved from
    folder: Path  # where the run folder appears when the episode is done
    keep: Keep = "all"
    larger: tuple[KeptTable, ...] = ()  # those of larger size classes that are met, likewise
    program: Mapping[str, str] = field(default_factory=dict)  # the versions that study.toml has


def table_key(config: EpisodeConfig) -> str:
    """Return what tells the value tables of a study apart: the table's name, what is not the default robot's, sizes."""
    robot = config.robot.model_dump_json(exclude_defaults=True)
    sizes = [size.name for size in classes_met(config.scenario.bodies)[1:]]
    return " ".join([config.table, *([] if robot == "{}" else [robot]), *sizes])


EpisodeFunction = Callable[[EpisodeJob], None]
"""Drives the episode of a job and writes its run folder, whole or not at all. A function that can be imported by its
name, so that it can be sent to other processes."""


@dataclass(frozen=True)
class NotDone:
    """A worker's answer when it could not carry out a job."""

    reason: str  # one sentence
    # SUMO failed, which is one per process and keeps a state of its own: no other episode is to suffer from that.
    process_is_spoilt: bool


@dataclass(frozen=True)
class Outcome:
    """What became of a job."""

    job: EpisodeJob
    error: str | None = None  # one sentence; None when the run folder is in place
    log: str = ""  # of an episode that failed, the end of what the worker printed during it


class Engine(Protocol):
    """Where the episodes of a study are driven."""

    def run(self, jobs: Sequence[EpisodeJob], function: EpisodeFunction) -> Generator[Outcome, None, None]:
        """Carry out every job, and yield its outcome as soon as it is there, in any order.

        A job that fails is an outcome like any other. Closing the iterator stops the work that is under way.

        Args:
            jobs: what to do, started in this order.
            function: drives and writes one episode.

        Raises:
            WorkerError: if workers cannot be started or reached at all.
        """
        ...
