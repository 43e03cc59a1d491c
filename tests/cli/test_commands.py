"""The command line as a user meets it: results, mistakes, exit statuses."""

import contextlib
import json
import os
import signal
import subprocess
import sys

import pandas as pd
import pytest

from hj_cosim.cli.interruption import MESSAGE


@pytest.fixture(scope="module")
def run_folder(small_specification, tmp_path_factory):
    folder = tmp_path_factory.mktemp("runs") / "run"
    command = [
        "run",
        "light",
        "--duration",
        "1",
        "--seed",
        "3",
        "--table",
        small_specification,
        "--out",
        folder,
        "--no-figures",
        "--json",
    ]
    done = subprocess.run(
        [sys.executable, "-m", "hj_cosim", *map(str, command)], capture_output=True, text=True, check=True
    )
    assert json.loads(done.stdout)["folder"] == str(folder)
    return folder


def test_same_seed_in_another_process_writes_the_same_bytes(call, run_folder, small_specification, tmp_path):
    again, other = tmp_path / "again", tmp_path / "other"
    options = ("--duration", 1, "--table", small_specification, "--no-figures")
    assert call("run", "light", "--seed", 3, *options, "--out", again)[0] == 0
    assert call("run", "light", "--seed", 4, *options, "--out", other)[0] == 0
    for name in ("trajectories.parquet", "robot.parquet"):
        assert (again / name).read_bytes() == (run_folder / name).read_bytes()
        assert (other / name).read_bytes() != (run_folder / name).read_bytes()


TALKING = """
from hj_cosim.planning.contract import Plan

print("imported")

class Talking:
    def plan(self, observation, previous):
        print("planning")
        return Plan(0, previous)
"""


def test_what_a_plug_in_prints_is_kept_out_of_the_json(call, small_specification, tmp_path):
    planner = tmp_path / "talking.py"
    planner.write_text(TALKING)
    options = ("run", "--table", small_specification, "--duration", 0.1, "--planner", f"{planner}:Talking")
    status, out, said = call(*options, "--out", tmp_path / "a", "--no-figures", "--json")
    assert (status, json.loads(out)["planner"]) == (0, "Talking")
    assert "imported" in said
    assert "planning" in said
    _, out, _ = call(*options, "--out", tmp_path / "b", "--no-figures")
    assert "planning" in out  # for people it is where they look


def test_summary_is_a_table_for_people_and_json_for_scripts(call, small_specification, tmp_path):
    options = ("run", "light", "--duration", 1, "--planner", "idle", "--filter", "none", "--table", small_specification)
    status, out, _ = call(*options, "--out", tmp_path / "a")
    assert status == 0
    assert "mean speed" in out
    status, out, _ = call(*options, "--out", tmp_path / "b", "--no-figures", "--json")
    summary = json.loads(out)
    assert (status, summary["planner"], summary["filter"], summary["samples"]) == (0, "idle", "none", 50)


@pytest.mark.parametrize("format", ["csv", "parquet"])
def test_export_holds_every_row(call, run_folder, tmp_path, format):
    out = tmp_path / f"drive.{format}"
    assert call("export", run_folder, "--format", format, "--out", out)[0] == 0
    exported = pd.read_csv(out) if format == "csv" else pd.read_parquet(out)
    assert len(exported) == len(pd.read_parquet(run_folder / "trajectories.parquet"))


def test_table_is_solved_with_another_scheme_and_shape_into_its_own_file(call, small_specification, tmp_path):
    out = tmp_path / "coarse.npz"
    shape = [argument for nodes in (21, 9, 7, 7, 7) for argument in ("--shape", nodes)]
    status, printed, _ = call("table", "solve", small_specification, *shape, "--scheme", "eno2", "--out", out, "--json")
    report = json.loads(printed)
    assert (status, report["shape"], report["scheme"]) == (0, [21, 9, 7, 7, 7], "eno2")
    assert out.is_file()


def test_tables_are_listed(call):
    status, out, _ = call("table", "list", "--json")
    assert status == 0
    assert {"highway", "highway_paper"} <= {row["name"] for row in json.loads(out)}


def test_scenarios_are_listed_with_their_densities(call):
    status, out, _ = call("scenarios", "--json")
    density = {row["name"]: row["density"] for row in json.loads(out)}
    assert status == 0
    assert density["light"] < density["paper"] < density["dense"] < density["jam"]


def test_printed_template_is_a_scenario_that_runs(call, small_specification, tmp_path):
    status, template, _ = call("scenarios", "--template")
    mine = tmp_path / "mine.toml"
    mine.write_text(template)
    options = ("--duration", 0.1, "--table", small_specification, "--no-figures", "--out", tmp_path / "run")
    assert (status, call("run", mine, *options)[0]) == (0, 0)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("run", "papr"), "no scenario is called 'papr'; choose one of"),
        (("run", "--preset", "bst"), "no preset is called 'bst'; choose one of best, paper"),
        (("run", "--planner", "mcts"), "'mcts': no planner is called so; choose one of hjop, op, mppi, idle"),
        (("run", "--seed", "-1"), "seed = -1"),
        (("run", "--duration", "0"), "simulation.duration = 0.0"),
        (("run", "--table", "highwy"), "no table specification is called 'highwy'"),
        (("run", "--set", "planner.gama=1"), "unknown key 'planner.gama'"),
        (("run", "--set", "planner"), "write KEY=VALUE"),
        (("table", "show", "highwy"), "no table specification is called 'highwy'"),
        (("table", "solve", "highway", "--scheme", "eno2"), "name its file with --out"),
        (("export", "nowhere", "--format", "csv"), "nowhere"),
    ],
)
def test_mistake_ends_in_one_sentence_and_status_2(call, tmp_path, monkeypatch, arguments, said):
    monkeypatch.chdir(tmp_path)
    status, out, err = call(*arguments)
    assert status == 2
    assert said in " ".join(err.split())
    assert "Traceback" not in err
    assert out == ""
    assert list(tmp_path.iterdir()) == []


def test_ctrl_c_ends_in_one_sentence_and_leaves_nothing(small_specification, tmp_path):
    """On a terminal of its own, where the progress bar says when it is driving."""
    command = [sys.executable, "-m", "hj_cosim", "run", "--duration", "300", "--table", str(small_specification)]
    terminal, inside = os.openpty()
    process = subprocess.Popen([*command, "--out", str(tmp_path / "run")], stdout=inside, stderr=inside)
    os.close(inside)
    said = b""
    while b"driving paper" not in said:
        said += os.read(terminal, 1000)
    process.send_signal(signal.SIGINT)
    with contextlib.suppress(OSError):  # what Linux answers when the other end of a terminal is closed
        while chunk := os.read(terminal, 1000):
            said += chunk
    assert process.wait(timeout=60) == 130
    assert MESSAGE.encode() in said
    assert b"Traceback" not in said
    assert list(tmp_path.iterdir()) == []


def test_unknown_option_is_answered_by_the_usage(call):
    status, _, err = call("run", "--sede", 3)
    assert status == 2
    assert "--sede" in err


@pytest.mark.parametrize("command", [(), ("run",), ("export",), ("scenarios",), ("table", "solve"), ("table", "show")])
def test_help_has_an_example(call, command):
    status, out, _ = call(*command, "--help")
    assert status == 0
    assert "Example: hj-cosim" in " ".join(out.split())
