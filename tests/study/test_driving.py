"""Real episodes in worker processes: what they write does not depend on how many there are."""

import pytest

from hj_cosim.cosim.configuration import resolve_config
from hj_cosim.reachability.table.store import table_path
from hj_cosim.study.driving import drive_episode
from hj_cosim.study.jobs import EpisodeJob
from hj_cosim.study.local_workers import LocalWorkers

SEEDS = (3, 4)


@pytest.fixture
def drive_with(small_table, small_specification, tmp_path):
    """Return a function that drives an episode per seed; it returns the bytes of the files by seed and name."""

    def drive_it(workers: int) -> dict[tuple[int, str], bytes]:
        settings = ["planner.kind=idle", "filter.kind=none", "simulation.duration=1", "simulation.settle_time=0.5"]
        config = resolve_config("light", assignments=settings)
        folders = {seed: tmp_path / str(workers) / str(seed) for seed in SEEDS}
        jobs = [
            EpisodeJob(config.model_copy(update={"seed": seed}), table_path(small_specification), folder)
            for seed, folder in folders.items()
        ]
        outcomes = list(LocalWorkers(workers).run(jobs, drive_episode))
        assert [outcome.error for outcome in outcomes] == [None, None]
        names = ("trajectories.parquet", "robot.parquet", "drivers.parquet")
        return {(seed, name): (folder / name).read_bytes() for seed, folder in folders.items() for name in names}

    return drive_it


def test_an_episode_is_the_same_bytes_with_one_worker_and_with_two(drive_with):
    one, two = drive_with(1), drive_with(2)
    assert one == two
    assert one[SEEDS[0], "trajectories.parquet"] != one[SEEDS[1], "trajectories.parquet"]
