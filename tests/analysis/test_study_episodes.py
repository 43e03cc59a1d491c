"""Which row of a study's table an episode belongs to."""

import pandas as pd
import pytest

from hj_cosim.analysis.study_episodes import REPLAY, study_episodes, write_replays
from hj_cosim.errors import RunFolderError

STACK = {"planner": "hjop", "filter": "spc", "scheme": "mi"}


@pytest.fixture
def study(make_hostile_run, tmp_path):
    """Return a study's folder with one episode, driven with planner.gamma_r = 0.9."""
    make_hostile_run(tmp_path / "episodes" / "planner.gamma_r=0.90" / "hjop-spc-mi" / "7", "synthetic")
    return tmp_path


def rows(**varied):
    count = len(next(iter(varied.values())))
    return pd.DataFrame({"scenario": ["synthetic"] * count, **varied, **{k: [v] * count for k, v in STACK.items()}})


def test_an_episode_belongs_to_the_row_that_has_its_settings(study):
    knobs = {"planner.gamma_r": [0.8, 0.9], "filter.keep_escape": [True, False]}
    (episode,) = study_episodes(study, rows(**knobs))
    assert (episode.row, episode.seed, episode.crashed, episode.has_cars) == (1, 7, True, True)
    assert study_episodes(study, rows(**{"planner.gamma_r": [0.7, 0.8]})) == []
    assert study_episodes(study, rows(scenario=["paper", "dense"])) == []


def test_who_kept_the_robot_alone_has_no_replay(study, table, monkeypatch):
    monkeypatch.setattr("hj_cosim.analysis.study_episodes.table_of", lambda run: table)
    (episode,) = study_episodes(study, rows(scenario=["synthetic"]))
    told = []
    write_replays([episode], lambda *done: told.append(done))
    assert told == [(1, 1)]
    assert (episode.folder / REPLAY).stat().st_size < 700_000
    (episode.folder / REPLAY).unlink()
    (episode.folder / "trajectories.parquet").unlink()
    write_replays([episode], lambda *done: told.append(done))
    assert not (episode.folder / REPLAY).exists()


def test_a_broken_episode_is_named(study):
    (summary,) = study.glob("episodes/**/summary.json")
    summary.write_text("{}")
    with pytest.raises(RunFolderError, match=f"{summary.parent} holds no readable run"):
        study_episodes(study, rows(scenario=["synthetic"]))
