"""Which engine drives a study, as it is asked for."""

from typing import Any

from hj_cosim.errors import ConfigurationError
from hj_cosim.settings import shown
from hj_cosim.study.cluster import DaskCluster
from hj_cosim.study.jobs import Engine
from hj_cosim.study.local_workers import LocalWorkers
from hj_cosim.study.onlooker import Onlooker


def engine_of(workers: Any, scheduler: Any, watch: Onlooker | None = None) -> Engine:
    """Return processes of this machine, or those of a scheduler.

    Args:
        workers: how many processes; as many as there are cores if None.
        scheduler: address of a Dask scheduler, or None.
        watch: told when a job begins, if there is one.

    Raises:
        ConfigurationError: if one of them is of the wrong type.
        WorkerError: if there can be no such engine.
    """
    if workers is not None and (not isinstance(workers, int) or isinstance(workers, bool)):
        raise ConfigurationError(f"workers = {shown(repr(workers))} is no whole number; give how many to start")
    if scheduler is not None and not isinstance(scheduler, str):
        raise ConfigurationError(f"scheduler = {shown(repr(scheduler))} is no text; give its address, tcp://HOST:PORT")
    started = None if watch is None else watch.started
    if scheduler is not None:
        return DaskCluster(scheduler, started=started)
    return LocalWorkers(workers, started)
