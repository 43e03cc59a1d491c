"""How many episodes a second a Dask scheduler hands out and takes back, with real processes and episodes of 10 ms.

Beside the rate on this machine stands what an episode costs the scheduler's process and the study's, in processor time:
whichever costs more is the most that any number of workers can be kept busy with.
"""

import os
import sys
import time
from collections.abc import Sequence
from dataclasses import replace

import psutil
import pytest
from loopback_cluster import LoopbackCluster

from hj_cosim import __version__
from hj_cosim.reachability.table.store import kept_table
from hj_cosim.study.cluster import DaskCluster
from hj_cosim.study.folder import StudyFolder
from hj_cosim.study.jobs import EpisodeFunction, EpisodeJob
from hj_cosim.study.request import new_study

SHORT_EPISODES = """
import os, time
def drive(job):
    time.sleep(0.01)
    job.folder.mkdir()
    (job.folder / "trajectories.parquet").write_bytes(os.urandom(int(os.environ["BYTES_AN_EPISODE"])))
"""
EPISODES = 300
WORKERS = 4
OF_AN_EPISODE = 0.45  # s of processor time that a worker drives


@pytest.mark.parametrize("size", [0, 1_500_000], ids=["empty folders", "folders of 1.5 MB, as 30 s of `paper` write"])
def test_episodes_a_second_of_one_scheduler(tmp_path, monkeypatch, size):
    (tmp_path / "short_episodes.py").write_text(SHORT_EPISODES)
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setenv("BYTES_AN_EPISODE", str(size))
    import short_episodes

    cluster = LoopbackCluster(tmp_path, os.pathsep.join([str(tmp_path), *filter(None, sys.path)]))
    try:
        for _ in range(WORKERS):
            cluster.add_worker()
        table = replace(kept_table("highway"), path=tmp_path / "table.npz")
        table.path.write_bytes(b"no episode here looks into it")
        folder = StudyFolder.of(tmp_path / "study", new_study({"episodes": EPISODES + 20, "stacks": ("hjop-spc-mi",)}))
        folder.begin({"hj-cosim": __version__}, resume=False)
        jobs = folder.remaining_jobs(dict.fromkeys(folder.tables, (table,)))
        engine = DaskCluster(cluster.address)
        _carry_out(engine, jobs[:20], short_episodes.drive)  # imports what workers need
        scheduler, study = psutil.Process(cluster.processes[0].pid), psutil.Process()
        before, started = (_seconds(scheduler), _seconds(study)), time.perf_counter()
        _carry_out(engine, jobs[20:], short_episodes.drive)
        wall = time.perf_counter() - started
        costs = ((_seconds(scheduler) - before[0]) / EPISODES, (_seconds(study) - before[1]) / EPISODES)
    finally:
        cluster.stop()
    most = 1.0 / max(costs)
    print(
        f"\n{WORKERS} workers, {EPISODES} episodes of 10 ms and {size:,} bytes: {EPISODES / wall:.0f} a second on the"
        f" wall; an episode costs the scheduler {1e3 * costs[0]:.1f} ms and the study {1e3 * costs[1]:.1f} ms, so"
        f" {most:.0f} a second are the most, which keep {OF_AN_EPISODE * most:.0f} workers busy with episodes of"
        f" {OF_AN_EPISODE} s"
    )


def _carry_out(engine: DaskCluster, jobs: Sequence[EpisodeJob], drive: EpisodeFunction) -> None:
    """Have all jobs done, none of which may fail."""
    assert [outcome.error for outcome in engine.run(jobs, drive)] == [None] * len(jobs)


def _seconds(process: psutil.Process) -> float:
    """Return the processor time of a process, s."""
    times = process.cpu_times()
    return times.user + times.system
