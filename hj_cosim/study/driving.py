"""How a worker drives one episode of a study in SUMO."""

from functools import cache
from pathlib import Path

from hj_cosim.cosim.episode import run_in_sumo, write_episode
from hj_cosim.reachability.table.store import read_table
from hj_cosim.reachability.table.table import ValueTable
from hj_cosim.settings import TableSpecification
from hj_cosim.study.jobs import EpisodeJob


@cache  # once a process
def _load_table(path: Path, specification: str) -> ValueTable:
    return read_table(path, TableSpecification.model_validate_json(specification))


def drive_episode(job: EpisodeJob) -> None:
    """Drive the episode of a job in SUMO and write its run folder, as `hj-cosim run` does, whole or not at all.

    Raises:
        HjCosimError: if the world cannot be built, SUMO fails, or the folder cannot be written.
    """
    table = _load_table(job.table.path, job.table.specification.model_dump_json())
    write_episode(run_in_sumo(job.config, table), job.folder, job.keep)
