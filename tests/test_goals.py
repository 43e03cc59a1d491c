"""The table with which the benchmarks end: a row for each goal, met, short, or with the reason for no number."""

import re
import sys
from pathlib import Path

import pytest

BENCHMARKS = Path(__file__).resolve().parent / "benchmarks"
sys.path.insert(0, str(BENCHMARKS))
import goals  # noqa: E402

OTHERS = "share of 5000"  # goals that no benchmark reports yet


@pytest.mark.parametrize(
    ("at_least", "has", "said"),
    [
        (True, 240.0, "met"),
        (True, 200.0, "met"),
        (True, 100.0, "short by 2x"),
        (False, 150.0, "met"),
        (False, 200.0, "met"),
        (False, 240.0, "short by 1.2x"),
    ],
)
def test_what_falls_short_is_told_by_which_factor(at_least, has, said):
    assert goals.verdict(goals.Goal("x", 200.0, at_least=at_least), has) == said


def test_every_goal_has_a_row_measured_or_not():
    found = {"planner 11": goals.Measured(149_000.0, 14.5), "idle": goals.Measured(0.42)}
    lines = goals.table(found, {"solver weno5": "hj_reachability is not installed"}).splitlines()
    assert len(lines) == 2 + len(goals.GOALS)
    assert len({len(line) for line in lines}) == 1
    rows = dict(zip(goals.GOALS, ([cell.strip() for cell in line.split("|")[2:-1]] for line in lines[2:]), strict=True))
    assert rows["planner 11"] == [
        "149,000 expansions/s",
        ">= 200,000 expansions/s",
        "short by 1.3x",
        "rl-agents, elsewhere: 14.5 expansions/s",
    ]
    assert rows["idle"][:3] == ["0.42 x", "<= 0.6 x", "met"]
    assert rows["solver weno5"][:3] == ["–", ">= 40 x", "hj_reachability is not installed"]
    assert rows["make run"][2] == "not measured in this run"


def test_every_goal_is_reported_by_a_benchmark_under_its_name():
    texts = "\n".join(path.read_text(encoding="utf-8") for path in BENCHMARKS.glob("test_*.py"))
    literal = set(re.findall(r'"([a-z_0-9 -]+)"', texts))
    tails = {f"{name} {end}" for name in ("filter", "filter bend", "filter sizes") for end in ("median", "tail")}
    assert set(goals.GOALS) - literal - tails - {OTHERS} == set()
