"""The Dask engine against real scheduler and worker processes on the loopback interface."""

import inspect
import os
import shutil
import sys
from collections.abc import Callable, Generator
from pathlib import Path

import pytest
from loopback_cluster import LoopbackCluster
from own_configurations import content, simulation

from hj_cosim.errors import WorkerError
from hj_cosim.reachability.games.highway import game
from hj_cosim.study import cluster
from hj_cosim.study.cluster import DaskCluster
from hj_cosim.study.study import run_study


@pytest.fixture
def start_cluster(synthetic, tmp_path) -> Generator[Callable[[], LoopbackCluster], None, None]:
    started: list[LoopbackCluster] = []

    def start() -> LoopbackCluster:
        path = os.pathsep.join([str(Path(synthetic.__file__).parent), *filter(None, sys.path)])
        started.append(LoopbackCluster(tmp_path, path))
        return started[-1]

    yield start
    for each in started:
        each.stop()


def test_a_cluster_gives_the_same_files_though_a_worker_is_killed_half_way(
    start_cluster, conduct_synthetic, reproducible_files, synthetic
):
    cluster = start_cluster()
    cluster.add_worker()
    doomed = cluster.add_worker()

    def kill_half_way(done: int, total: int) -> None:
        if done == total // 2:
            doomed.kill()

    study = conduct_synthetic(
        "cluster", DaskCluster(cluster.address), function=synthetic.drive_slowly, progress=kill_half_way
    )
    assert doomed.wait() < 0
    assert study.failures == ()
    reference = conduct_synthetic("reference")
    assert reproducible_files(study.folder) == reproducible_files(reference.folder)
    for file in ("config.toml", "robot.parquet", "trajectories.parquet"):
        one = "episodes/op-none/2"
        assert (study.folder / one / file).read_bytes() == (reference.folder / one / file).read_bytes()
    assert (study.folder / "episodes" / "op-none" / "2" / "figures").is_dir()


def test_who_looks_on_learns_which_episodes_run(start_cluster, conduct_synthetic, synthetic):
    cluster = start_cluster()
    cluster.add_worker()
    begun: list[str] = []
    seen_at: list[int] = []
    study = conduct_synthetic(
        "watched",
        DaskCluster(cluster.address, started=lambda job: begun.append(str(job.folder))),
        function=synthetic.drive_slowly,
        progress=lambda done, total: seen_at.append(len(begun)),
    )
    driven = {str(place.parent) for place in (study.folder / "episodes").rglob("summary.json")}
    assert set(begun) == driven
    assert len(begun) == len(driven)
    assert 0 < seen_at[1] < len(driven)  # as they begin, not all at once


def test_an_episode_that_fails_is_reported_and_the_others_go_on(start_cluster, conduct_synthetic, synthetic):
    cluster = start_cluster()
    cluster.add_worker()
    study = conduct_synthetic("failing", DaskCluster(cluster.address), function=synthetic.drive_or_fail)
    (failure,) = study.failures
    assert (failure.stack, failure.seed) == ("op-none", synthetic.UNLUCKY_SEED)
    assert failure.reason == "the traffic could not be settled"
    study = conduct_synthetic("wrong", DaskCluster(cluster.address), function=synthetic.drive_or_be_wrong)
    (failure,) = study.failures
    assert failure.reason == "a worker of the cluster failed: ZeroDivisionError: a programming error"
    assert "in drive_or_be_wrong" in failure.log.read_text()
    assert list(study.table["missing"]) == [0, 1]


def test_a_scheduler_without_workers_is_named_with_the_command_that_starts_some(start_cluster, conduct_synthetic):
    cluster = start_cluster()
    with pytest.raises(WorkerError, match=f"{cluster.address} has no workers; start some with"):
        conduct_synthetic("study", DaskCluster(cluster.address, timeout=1.0))


def test_a_scheduler_that_does_not_answer_is_named(conduct_synthetic):
    with pytest.raises(WorkerError, match=r"no Dask scheduler answers at tcp://127\.0\.0\.1:1 "):
        conduct_synthetic("nobody", DaskCluster("tcp://127.0.0.1:1", timeout=1.0))
    with pytest.raises(WorkerError, match="no Dask scheduler answers at nonsense"):
        conduct_synthetic("nonsense", DaskCluster("nonsense://x", timeout=1.0))


OF_ONES_OWN = """
from hj_cosim.control.contract import FilterDecision
from hj_cosim.planning.contract import RIGHT, Plan
from hj_cosim.scene.observation import Target
from hj_cosim.settings import Settings


class KeepRight:
    def plan(self, observation, previous):
        return Plan(action=RIGHT, target=Target(lane=0, speed=previous.speed))


class Lost:
    def plan(self, observation, previous):
        return self.way


class Calm:
    class Options(Settings):
        gentle: bool = False

    def __init__(self, options):
        self.gentle = options.gentle

    def filter(self, observation, values, desired):
        return FilterDecision(desired)
"""
A_TABLE = """
dynamics = "two_cars.py"
horizon = 0.1
scheme = "first_order"
[grid]
lower = [-80.0, -8.0, -0.4, 0.0, 0.0]
upper = [80.0, 8.0, 0.4, 40.0, 40.0]
shape = [9, 7, 7, 7, 7]
"""


def test_planners_filters_and_games_in_files_travel_to_workers_that_do_not_have_them(
    start_cluster, tmp_path, monkeypatch
):
    """The files are gone before a worker asks for them, which may be on another machine."""
    place = tmp_path / "mine"
    place.mkdir()
    monkeypatch.chdir(place)
    Path("mine.py").write_text(OF_ONES_OWN)
    Path("table.toml").write_text(A_TABLE)
    Path("few.toml").write_text("[traffic]\ncount = 6\n")
    # What ours imports is part of the package, and so on every worker.
    shutil.copy(inspect.getfile(game), "two_cars.py")
    read = cluster._code_of

    def read_and_lost(jobs):
        code = read(jobs)
        for path in code:
            path.unlink()
        return code

    monkeypatch.setattr(cluster, "_code_of", read_and_lost)
    workers = start_cluster()
    workers.add_worker()
    study = run_study(
        "few.toml",
        stacks=["mine.py:KeepRight/none", "hjop/mine.py:Calm", "mine.py:Lost/none"],
        episodes=1,
        settings=["table=table.toml", "simulation.duration=0.4", "simulation.settle_time=0.1"],
        scheduler=workers.address,
        out="study",
    )
    (failure,) = study.failures
    assert failure.reason.startswith(f"{place}/mine.py:15: Lost.plan raised AttributeError")
    assert list(study.table["planner"]) == ["KeepRight", "hjop", "Lost"]
    assert list(study.table["episodes"]) == [1, 1, 0]
    config = (study.folder / "episodes" / "KeepRight-none" / "0" / "config.toml").read_text()
    assert f'kind = "{place}/mine.py:KeepRight"' in config


def test_a_users_own_simulation_is_driven_by_two_workers_as_by_one_process(
    start_cluster, small_specification, small_table, tmp_path
):
    """Their files lie where every worker reads them; two stacks, two seeds, their drivers and ours."""
    theirs = simulation(tmp_path / "theirs")
    before = content(theirs.parent)
    asked = {
        "stacks": ["idle-none", "hjop-spc-mi"],
        "episodes": 2,
        "seed": 1000,
        "vary": "scenario.own.traffic=theirs,idm-mobil",
        "settings": [f"table={small_specification}", "simulation.duration=1", "scenario.own.warm_up=30"],
    }
    workers = start_cluster()
    for _ in range(2):
        workers.add_worker()
    driven = run_study(str(theirs), scheduler=workers.address, out=tmp_path / "cluster", **asked)
    assert (driven.failures, driven.missing) == ((), 0)
    reference = run_study(str(theirs), workers=1, out=tmp_path / "reference", **asked)
    for name in ("table.csv", "differences.csv", "episodes.parquet"):
        assert (driven.folder / name).read_bytes() == (reference.folder / name).read_bytes(), name
    runs = sorted(path.parent.relative_to(driven.folder) for path in driven.folder.glob("episodes/**/summary.json"))
    assert len(runs) == 8
    for run in runs:
        for name in ("config.toml", "own_simulation.toml", "trajectories.parquet", "robot.parquet", "summary.json"):
            one, other = driven.folder / run / name, reference.folder / run / name
            assert one.read_bytes() == other.read_bytes(), (run, name)
    assert content(theirs.parent) == before
