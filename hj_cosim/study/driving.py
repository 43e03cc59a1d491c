"""How a worker drives one episode of a study in SUMO."""

from functools import cache
from pathlib import Path

from hj_cosim.cosim.episode import run_in_sumo, write_episode
from hj_cosim.cosim.plugin_versions import plugin_versions
from hj_cosim.errors import PluginError
from hj_cosim.reachability.games.contract import SizeClass
from hj_cosim.reachability.table.sized import read_tables
from hj_cosim.reachability.table.store import KeptTable
from hj_cosim.reachability.table.table import ValueTable
from hj_cosim.settings import TableSpecification
from hj_cosim.study.jobs import EpisodeJob


@cache  # once a process
def _load_tables(kept: tuple[tuple[Path, str, SizeClass], ...]) -> ValueTable:
    return read_tables(
        [KeptTable(TableSpecification.model_validate_json(text), path, size) for path, text, size in kept]
    )


def drive_episode(job: EpisodeJob) -> None:
    """Drive the episode of a job in SUMO and write its run folder, as `hj-cosim run` does, whole or not at all.

    Raises:
        PluginError: if the file of a plug-in has changed since the study began, or is another one on this machine.
        HjCosimError: if the world cannot be built, SUMO fails, or the folder cannot be written.
    """
    for name, content in plugin_versions(job.config).items():
        if content != job.program.get(name):
            raise PluginError(
                f"the {name} is not what it was when the study began; undo that and --resume, or begin another study"
            )
    kept = (job.table, *job.larger)
    table = _load_tables(tuple((one.path, one.specification.model_dump_json(), one.size) for one in kept))
    write_episode(run_in_sumo(job.config, table, beside=job.folder), job.folder, job.keep)
