"""How many episodes a minute a study drives with 1 and 2 workers, and where an episode's time goes."""

import time
from collections import defaultdict
from collections.abc import Callable
from functools import wraps
from pathlib import Path
from typing import Any

import libsumo
import pytest

from hj_cosim import __version__
from hj_cosim.control.catalogue import make_filter
from hj_cosim.cosim.configuration import resolve_config
from hj_cosim.cosim.episode import Episode, drive, open_world, run_in_sumo, write_episode
from hj_cosim.cosim.recorder import Recorder
from hj_cosim.metrics.summary import summarize, timing
from hj_cosim.planning.catalogue import make_planner
from hj_cosim.reachability.table.store import kept_table, load_table
from hj_cosim.settings import EpisodeConfig
from hj_cosim.study.driving import drive_episode
from hj_cosim.study.folder import StudyFolder
from hj_cosim.study.local_workers import LocalWorkers
from hj_cosim.study.request import new_study
from hj_cosim.traffic.sumo.own_world import OwnWorld
from hj_cosim.traffic.sumo.world import SumoWorld

EPISODES_A_STACK = 2
TABLE_OF_THE_PAPER = 200  # episodes


@pytest.mark.parametrize("workers", [1, 2])
def test_episodes_a_minute(benchmark, row, workers, tmp_path):
    """The ten stacks of `best`; the first episode of each worker, which compiles or loads kernels, counts."""
    request = new_study({"episodes": EPISODES_A_STACK})
    table = {}
    for key, config in StudyFolder.of(tmp_path / "table", request).tables.items():
        load_table(config.table, robot=config.robot)
        table[key] = (kept_table(config.table, config.robot),)
    rounds = iter(range(100))

    def drive_them() -> None:
        folder = StudyFolder.of(tmp_path / str(next(rounds)), request)
        folder.begin({"hj-cosim": __version__}, resume=False)
        jobs = folder.remaining_jobs(table)
        assert all(outcome.error is None for outcome in LocalWorkers(workers).run(jobs, drive_episode))

    benchmark.pedantic(drive_them, rounds=1, warmup_rounds=0)
    count = request.rows * EPISODES_A_STACK
    seconds = benchmark.stats.stats.min
    print(
        f"\n{workers} workers: {count} episodes in {seconds:.1f} s, {60.0 * count / seconds:.0f} a minute;"
        f" the paper's table of {TABLE_OF_THE_PAPER} in {TABLE_OF_THE_PAPER * seconds / count:.0f} s"
    )
    if workers == 2:
        row("table of the paper", TABLE_OF_THE_PAPER * seconds / count)


def test_where_an_episodes_time_goes(monkeypatch, row, tmp_path):
    """The shares of one core's time (CPU time), each part timed from outside; what is left is the loop itself."""
    spent: dict[str, float] = defaultdict(float)

    def timed(part: str, function: Callable[..., Any]) -> Callable[..., Any]:
        @wraps(function)
        def wrapper(*arguments: Any, **options: Any) -> Any:
            started = time.process_time()
            try:
                return function(*arguments, **options)
            finally:
                spent[part] += time.process_time() - started

        return wrapper

    config = resolve_config("paper", flags={"seed": 1, "simulation": {"on_collision": "continue"}})
    table = load_table(config.table)
    run_in_sumo(config.model_copy(update={"seed": 0}), table)  # loads every kernel
    undisturbed = []
    for attempt in range(3):
        started = time.process_time()
        write_episode(run_in_sumo(config, table), tmp_path / f"undisturbed-{attempt}")
        undisturbed.append(time.process_time() - started)
    monkeypatch.setattr(libsumo, "simulationStep", timed("SUMO's steps", libsumo.simulationStep))
    monkeypatch.setattr(SumoWorld, "step", timed("world", SumoWorld.step))
    monkeypatch.setattr(SumoWorld, "observe", timed("world", SumoWorld.observe))
    monkeypatch.setattr(Recorder, "record", timed("recording", Recorder.record))
    monkeypatch.setattr(Recorder, "finish", timed("threat metrics", Recorder.finish))
    started = time.process_time()
    opening = timed("start and settling", _opened)
    world = opening(config)
    with world:
        spent["world"] = spent["SUMO's steps"] = 0.0  # those of settling are in settling
        planner = make_planner(config.planner, config.robot, config.scenario.drivers, world.road, table)
        safety_filter = make_filter(config.filter, config.robot, world.road, table, config.simulation.step)
        monkeypatch.setattr(type(planner), "plan", timed("planning", type(planner).plan))
        monkeypatch.setattr(type(safety_filter), "filter", timed("filter", type(safety_filter).filter))
        record = drive(world, planner, safety_filter, table, config).record
    summary = timed("summary", summarize)(record, config)
    timed("writing", write_episode)(
        Episode(config, record, summary, world.drivers, timing(summary, 1.0)), Path(tmp_path) / "run"
    )
    whole = time.process_time() - started
    spent["exchange with SUMO"] = spent.pop("world") - spent["SUMO's steps"]
    spent["tracking, bicycle, the loop"] = whole - sum(spent.values())
    print(f"\nan episode of `paper`, hjop + spc + mi: {min(undisturbed):.2f} s, timed part by part {whole:.2f} s")
    for part, seconds in sorted(spent.items(), key=lambda item: -item[1]):
        print(f"  {part:30s} {seconds:6.3f} s {100.0 * seconds / whole:5.1f} %")
    row("episode", min(undisturbed), spent["SUMO's steps"])
    assert all(seconds >= 0.0 for seconds in spent.values())


def _opened(config: EpisodeConfig) -> SumoWorld | OwnWorld:
    world = open_world(config)
    world.settle(config.simulation.settle_time)
    return world
