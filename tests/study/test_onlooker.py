"""Who looks on while a study is driven: which episodes run, and how its table stands."""

import json

import pytest

from hj_cosim.study.local_workers import LocalWorkers
from hj_cosim.watching.server import WatchServer
from hj_cosim.watching.study import SHOWN, LiveStudy, study_page


@pytest.fixture
def server():
    with WatchServer(study_page(), port=0) as server:
        yield server


def states(server: WatchServer) -> list[dict]:
    lines = [line for event in server._events for line in event.decode().splitlines()]
    return [json.loads(line[6:]) for line in lines if line.startswith("data: ")]


def test_the_table_stands_as_the_study_s_own_when_all_is_driven(server, conduct_synthetic):
    done = conduct_synthetic("watched", watch=LiveStudy(server))
    alone = conduct_synthetic("alone")
    first, *_, last = states(server)
    assert (first["done"], first["total"], first["failed"], first["running"]) == (0, 8, 0, [])
    assert (last["done"], last["failed"]) == (8, 0)
    assert [row[:3] for row in last["rows"]] == [
        ["paper hjop spc mi", "4 of 4", "0"],
        ["paper op none -", "4 of 4", "0"],
    ]
    column = 3 + SHOWN.index("mean_speed")
    for row, mean in zip(last["rows"], done.table["mean_speed"], strict=True):
        assert float(row[column]) == pytest.approx(mean, abs=0.0051)
    assert done.table.equals(alone.table)


def test_what_runs_is_told_by_the_processes_of_this_machine(server, conduct_synthetic, synthetic):
    live = LiveStudy(server)
    # Slowly: of episodes that take no time several are done before the study has noted the first.
    conduct_synthetic("watched", LocalWorkers(1, live.started), watch=live, function=synthetic.drive_slowly)
    running = [state["running"] for state in states(server)]
    assert max(map(len, running)) in (1, 2)  # one that is done is told of after the next was handed out
    assert {(name, seed) for each in running for name, seed, _ in each} == {
        (name, str(seed)) for name in ("paper hjop spc mi", "paper op none -") for seed in range(4)
    }
    assert running[-1] == []


def test_failed_episodes_are_counted_and_those_of_before_are_there_at_once(server, conduct_synthetic, synthetic):
    conduct_synthetic("study", watch=LiveStudy(server), function=synthetic.drive_or_fail)
    last = states(server)[-1]
    assert (last["done"], last["failed"]) == (7, 1)
    with WatchServer(study_page(), port=0) as again:
        conduct_synthetic("study", resume=True, watch=LiveStudy(again))
        assert states(again)[0]["done"] == 7
        assert states(again)[-1]["done"] == 8
