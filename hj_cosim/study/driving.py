"""How a worker drives one episode of a study in SUMO."""

from functools import cache

from hj_cosim.cosim.episode import run_in_sumo, write_episode
from hj_cosim.reachability.table.store import read_table
from hj_cosim.study.jobs import EpisodeJob

_load_table = cache(read_table)  # once a process


def drive_episode(job: EpisodeJob) -> None:
    """Drive the episode of a job in SUMO and write its run folder, as `hj-cosim run` does, whole or not at all.

    Raises:
        HjCosimError: if the world cannot be built, SUMO fails, or the folder cannot be written.
    """
    write_episode(run_in_sumo(job.config, _load_table(job.table)), job.folder, job.keep)
