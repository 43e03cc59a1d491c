"""How a worker drives one episode of a study in SUMO."""

from functools import cache
from pathlib import Path

import pyarrow.parquet as pq

from hj_cosim.cosim.configuration import config_toml
from hj_cosim.cosim.episode import Episode, run_in_sumo, write_episode
from hj_cosim.reachability.table.store import read_table
from hj_cosim.recording.run_folder import CONFIG, FIGURES, ROBOT, SUMMARY, robot_table, summary_text, whole_folder
from hj_cosim.study.jobs import EpisodeJob

_load_table = cache(read_table)  # once a process


def drive_episode(job: EpisodeJob) -> None:
    """Drive the episode of a job in SUMO and write its run folder, whole or not at all.

    Raises:
        HjCosimError: if the world cannot be built, SUMO fails, or the folder cannot be written.
    """
    episode = run_in_sumo(job.config, _load_table(job.table))
    if job.keep == "all":
        write_episode(episode, job.folder)
    else:
        _write_without_trajectories(episode, job.folder)


def _write_without_trajectories(episode: Episode, folder: Path) -> None:
    """Write a run folder that holds all but the cars' trajectories, which are nearly all of its size."""
    with whole_folder(folder) as temporary:
        (temporary / CONFIG).write_text(config_toml(episode.config), encoding="utf-8")
        pq.write_table(robot_table(episode.record), temporary / ROBOT, compression="zstd")
        (temporary / SUMMARY).write_text(summary_text(episode.summary), encoding="utf-8")
        (temporary / FIGURES).mkdir()
