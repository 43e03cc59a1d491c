"""Real episodes in worker processes: what they write does not depend on how many there are."""

import json
from pathlib import Path

import pytest

from hj_cosim.cosim.configuration import resolve_config
from hj_cosim.cosim.plugin_versions import plugin_versions
from hj_cosim.reachability.table.store import kept_table
from hj_cosim.study.driving import drive_episode
from hj_cosim.study.jobs import Engine, EpisodeJob
from hj_cosim.study.local_workers import LocalWorkers

SEEDS = (3, 4)


@pytest.fixture
def drive_with(small_table, small_specification, tmp_path):
    """Return a function that drives an episode per seed; it returns the bytes of the files by seed and name."""

    def drive_it(name: str, engine: Engine) -> dict[tuple[int, str], bytes]:
        settings = ["planner.kind=idle", "filter.kind=none", "simulation.duration=1", "simulation.settle_time=0.5"]
        config = resolve_config("light", assignments=settings)
        folders = {seed: tmp_path / name / str(seed) for seed in SEEDS}
        jobs = [
            EpisodeJob(config.model_copy(update={"seed": seed}), kept_table(str(small_specification)), folder)
            for seed, folder in folders.items()
        ]
        outcomes = list(engine.run(jobs, drive_episode))
        assert [outcome.error for outcome in outcomes] == [None, None]
        names = ("trajectories.parquet", "robot.parquet", "drivers.parquet")
        return {(seed, name): (folder / name).read_bytes() for seed, folder in folders.items() for name in names}

    return drive_it


def test_an_episode_is_the_same_bytes_in_this_process_and_with_two_workers(drive_with, in_this_process):
    one, two = drive_with("here", in_this_process), drive_with("there", LocalWorkers(2))
    assert one == two
    assert one[SEEDS[0], "trajectories.parquet"] != one[SEEDS[1], "trajectories.parquet"]


def test_workers_resolve_a_planner_of_one_s_own_and_one_that_fails_stops_its_episode_alone(
    small_table, small_specification, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    Path("mine.py").write_text(
        "from hj_cosim.planning.contract import Plan\n\n\n"
        "class Keep:\n    def plan(self, observation, previous):\n        return Plan(0, previous)\n\n\n"
        "class Lost:\n    def plan(self, observation, previous):\n        return self.way\n"
    )
    settings = ["filter.kind=none", "simulation.duration=0.2", "simulation.settle_time=0.1"]
    configs = {
        name: resolve_config("light", flags={"planner": {"kind": f"mine.py:{name}"}}, assignments=settings)
        for name in ("Lost", "Keep")
    }
    table = kept_table(str(small_specification))
    jobs = [
        EpisodeJob(config, table, tmp_path / name, program=plugin_versions(config)) for name, config in configs.items()
    ]
    monkeypatch.chdir("/")  # a worker's own folder is not the one that the reference was written in
    errors = {outcome.job.folder.name: outcome.error for outcome in LocalWorkers(1).run(jobs, drive_episode)}
    assert errors["Keep"] is None
    assert "mine.py:11: Lost.plan raised AttributeError" in errors["Lost"]
    assert json.loads((tmp_path / "Keep" / "summary.json").read_text())["planner"] == "Keep"
    assert not (tmp_path / "Lost").exists()
