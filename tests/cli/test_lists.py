"""What the terminal lists: complete as JSON, and whole at any width."""

import json
import os
import subprocess
import sys

import pytest

from hj_cosim import __version__
from hj_cosim.cli import console
from hj_cosim.metrics.catalogue import METRICS
from hj_cosim.settings import list_settings


def test_version_and_short_help(call):
    assert call("--version") == (0, f"hj-cosim {__version__}\n", "")
    for command in ((), ("run",), ("table",), ("table", "solve")):
        status, short, _ = call(*command, "-h")
        assert status == 0
        assert short == call(*command, "--help")[1]


def test_knobs_are_all_settings(call):
    status, out, _ = call("knobs", "--json")
    assert status == 0
    assert [row["key"] for row in json.loads(out)] == [entry.key for entry in list_settings()]
    status, out, _ = call("knobs", "filter.rss", "--json")
    assert {row["key"] for row in json.loads(out)} == {entry.key for entry in list_settings("filter.rss")}


def test_unknown_group_of_knobs_is_refused_with_those_that_exist(call):
    status, out, err = call("knobs", "plannner")
    assert (status, out) == (2, "")
    assert "no settings are called 'plannner'; choose one of robot, tracking, planner" in " ".join(err.split())


def test_glossary_has_every_metric(call):
    status, out, _ = call("metrics", "--json")
    assert status == 0
    glossary = json.loads(out)
    assert {row["name"] for row in glossary["metrics"]} == set(METRICS)
    assert {"wall_seconds", "samples"} <= {row["name"] for row in glossary["facts"]}


@pytest.mark.parametrize("width", [60, 80, 200])
@pytest.mark.parametrize("command", ["knobs", "metrics", "scenarios", "figure"])
def test_no_name_is_cut_at_any_width(call, monkeypatch, command, width):
    monkeypatch.setattr(console.results, "_width", width)
    names = {
        "knobs": [entry.key for entry in list_settings()],
        "metrics": list(METRICS),
        "scenarios": [row["name"] for row in json.loads(call("scenarios", "--json")[1])],
        "figure": [row["name"] for row in json.loads(call("figure", "--json")[1])],
    }[command]
    status, out, _ = call(command)
    assert status == 0
    words = out.split()
    assert [name for name in names if name not in words] == []
    assert max(map(len, out.splitlines())) <= width
    assert "…" not in out


def test_bars_are_quiet_where_messages_go_to_no_terminal(capsys):
    with console.progress_bars() as bars:
        console.bar(bars, "driving")(1, 2)
    assert capsys.readouterr() == ("", "")


@pytest.mark.parametrize("encoding", ["ascii", "cp1252", "utf-8"])
def test_a_terminal_that_cannot_show_every_letter_is_shown_the_others(encoding):
    environment = {**os.environ, "PYTHONIOENCODING": encoding}
    listed = subprocess.run(
        [sys.executable, "-m", "hj_cosim", "metrics"], env=environment, capture_output=True, check=True, timeout=60
    )
    assert b"ttc_p1" in listed.stdout
    assert (b"?" in listed.stdout) == (encoding != "utf-8")
