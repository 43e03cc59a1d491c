"""What versions.json says that a run depends on besides its configuration."""

import pytest

from hj_cosim import run, run_episode
from hj_cosim.control.belief import believing_filter
from hj_cosim.reachability.table.store import kept_table

AGAINST_THE_WORST = "value table, highway_worst"


@pytest.fixture
def driven(small_specification, small_table, monkeypatch):
    """Return a function that drives a moment with a priority; V against the worst is that of others, solved already."""
    monkeypatch.setattr(run, "load_table", lambda *_, **__: small_table)
    monkeypatch.setattr(believing_filter, "_worst_table", lambda robot: small_table)
    options = {"preset": "paper", "duration": 0.1, "table": str(small_specification)}
    return lambda priority, **settings: run_episode(
        "light", **options, settings={"filter.priority": priority, "scenario.traffic.count": 20, **settings}
    )


def test_a_run_by_belief_says_which_table_against_the_worst_it_had(driven):
    episode = driven("belief")
    assert episode.versions[AGAINST_THE_WORST] == kept_table("highway_worst", episode.config.robot).identity
    assert AGAINST_THE_WORST not in driven("equal").versions


def test_a_run_by_belief_compares_with_its_scenarios_drivers(driven, monkeypatch):
    told = []

    class Watching(believing_filter.Watcher):
        def __init__(self, robot_length, lane_width, drivers):
            told.append(drivers)
            super().__init__(robot_length, lane_width, drivers)

    monkeypatch.setattr(believing_filter, "Watcher", Watching)
    driven("belief", **{"scenario.drivers.desired_speed": {"mean": 32.0, "deviation": 1.5}})
    assert told[0].desired_speed.mean == 32.0
    assert told[0].desired_speed.deviation == 0.0
