"""The examples do what they say, in a fraction of the time."""

import json
from importlib.resources import files

import pandas as pd
import pytest

from hj_cosim.examples import drive_and_plot, own_game, own_planner, sweep
from hj_cosim.study.jobs import Outcome

NAMES = {path.name[:-3] for path in files("hj_cosim.examples").iterdir() if path.name.endswith(".py")} - {"__init__"}


def test_drive_and_plot_writes_a_run_and_a_picture(small_specification, small_table, tmp_path, capsys):
    drive_and_plot.main(tmp_path / "drive", duration=1.0, table=str(small_specification))
    assert (tmp_path / "drive" / "robot.parquet").is_file()
    assert (tmp_path / "drive" / "speed-and-value.png").stat().st_size > 10_000
    assert "Episode of dense, seed 3" in capsys.readouterr().out


class InThisProcess:
    """Drives a study's episodes here: starting workers would take longer than all the rest."""

    def run(self, jobs, function):
        for job in jobs:
            function(job)
            yield Outcome(job)


def test_sweep_prints_paired_differences_of_the_weights(
    small_specification, small_table, tmp_path, capsys, monkeypatch
):
    monkeypatch.setattr("hj_cosim.study.engines.LocalWorkers", lambda *_: InThisProcess())
    options = {"episodes": 2, "duration": 0.4, "table": str(small_specification), "scenarios": ("light",)}
    sweep.main(tmp_path / "sweep", **options)
    table = pd.read_csv(tmp_path / "sweep" / "table.csv")
    assert list(table["planner.gamma_r"]) == [0.8, 1.0]
    assert "0 of 4 episodes crashed" in capsys.readouterr().out


def test_own_planner_drives_beside_ours(small_specification, small_table, capsys):
    own_planner.main(duration=0.2, table=str(small_specification), seeds=range(1))
    first, second = capsys.readouterr().out.splitlines()
    assert "KeepRight + spc" in first
    assert "hjop + spc" in second


def test_own_game_is_solved_to_what_is_known(tmp_path):
    assert own_game.main(tmp_path / "boat") < 0.02


def test_examples_are_listed_and_printed_by_name(call):
    status, out, _ = call("examples", "--json")
    listed = json.loads(out)
    assert (status, {row["name"] for row in listed}) == (0, NAMES)
    assert all(len(row["shows"]) > 30 for row in listed)
    status, out, _ = call("examples", "sweep")
    assert (status, out) == (0, files("hj_cosim.examples").joinpath("sweep.py").read_text())
    status, _, said = call("examples", "swep")
    assert status == 2
    assert "no example is called 'swep'; choose one of" in " ".join(said.split())


@pytest.mark.parametrize("name", sorted(NAMES))
def test_an_example_is_short_enough_to_be_read(name):
    assert len(files("hj_cosim.examples").joinpath(f"{name}.py").read_text().splitlines()) <= 110


def test_a_policy_is_trained_with_and_without_the_filter(small_specification, small_table, capsys):
    pytest.importorskip("gymnasium")
    from hj_cosim.examples import train_with_filter

    train_with_filter.main(generations=1, population=2, duration=0.4, table=str(small_specification))
    without, with_filter = capsys.readouterr().out.splitlines()
    assert without.startswith("without a filter: 0 of 2 episodes crashed, mean reward at the end ")
    assert with_filter.startswith("with the filter: 0 of 2")
