"""Python files of one's own that a study's workers need: read at their places, or from copies that came along."""

import inspect
import shutil
from pathlib import Path

import pytest

from hj_cosim.cosim.configuration import resolve_config
from hj_cosim.errors import ConfigurationError, TableError, WorkerError
from hj_cosim.locations import read_code_from
from hj_cosim.plugins import PLANNER, find_plugin
from hj_cosim.reachability.games import double_integrator
from hj_cosim.reachability.games.catalogue import find_game
from hj_cosim.reachability.table.size_classes import CAR
from hj_cosim.reachability.table.store import kept_table, load_table, read_table
from hj_cosim.study import cluster, driving
from hj_cosim.study.jobs import EpisodeJob

KEEP = "class Keep:\n    def plan(self, observation, previous):\n        ...\n"
A_GAME = """
dynamics = "brakes.py"
horizon = 0.1
scheme = "first_order"
[grid]
lower = [-4.0, -2.0]
upper = [4.0, 2.0]
shape = [21, 21]
"""


@pytest.fixture
def job(tmp_path, monkeypatch):
    """Return an episode of a planner and a game in files of one's own, named from their folder."""
    monkeypatch.chdir(tmp_path)
    Path("mine.py").write_text(KEEP)
    Path("mine.toml").write_text(A_GAME)
    shutil.copy(inspect.getfile(double_integrator), "brakes.py")
    config = resolve_config("light", flags={"planner": {"kind": "mine.py:Keep"}}, assignments=["table=mine.toml"])
    monkeypatch.chdir("/")
    yield EpisodeJob(config, kept_table(config.table), tmp_path / "out")
    read_code_from({})


def test_files_that_are_here_are_read_where_they_are(job, tmp_path):
    code = cluster._code_of([job, job])
    assert code == {tmp_path / name: (tmp_path / name).read_bytes() for name in ("brakes.py", "mine.py")}
    assert cluster._copies_of(code) == {}


def test_files_that_are_missing_or_changed_are_read_from_copies_under_the_same_names(job, tmp_path):
    code = cluster._code_of([job])
    (tmp_path / "brakes.py").unlink()
    (tmp_path / "mine.py").write_text("class Other: ...")
    with pytest.raises(ConfigurationError, match="there is no file"):
        find_game(job.table.specification.dynamics)
    copies = cluster._copies_of(code)
    assert {path: copy.read_bytes() for path, copy in copies.items()} == code
    read_code_from(copies)
    assert find_game(job.table.specification.dynamics).fingerprint
    assert find_plugin(PLANNER, job.config.planner.kind).__name__ == "Keep"
    read_code_from({})
    with pytest.raises(ConfigurationError, match="has no class 'Keep'"):
        find_plugin(PLANNER, job.config.planner.kind)


def test_a_file_that_cannot_be_sent_is_named(job, tmp_path):
    (tmp_path / "mine.py").unlink()
    with pytest.raises(WorkerError, match=r"cannot read .*mine\.py, which is to be sent along: No such file"):
        cluster._code_of([job])


def test_a_worker_reads_the_table_of_a_game_of_ones_own_by_its_specification(job):
    solved = load_table(job.config.table)
    with pytest.raises(TableError, match="not run because a table says so"):
        read_table(job.table.path)
    read = driving._load_tables(((job.table.path, job.table.specification.model_dump_json(), CAR),))
    assert read.values.tobytes() == solved.values.tobytes()
