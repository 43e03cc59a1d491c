"""The command `study`, and `report` of a study, as a user meets them; episodes are synthetic ones."""

import importlib
import json
import sys
from pathlib import Path

import pytest
from in_this_process import InThisProcess
from rich.console import Console

from hj_cosim.cli import console, study_table
from hj_cosim.study.stacks import parse_stack
from hj_cosim.study.study import read_study

SIZE = ("--episodes", 2, "--stack", "hjop-spc-mi", "--stack", "op-none", "--workers", 1)


@pytest.fixture(scope="module")
def synthetic():
    """The module `synthetic_episodes`, importable here and in the workers."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(Path(__file__).parents[1] / "study"))
        yield importlib.import_module("synthetic_episodes")


@pytest.fixture
def study(call, synthetic, monkeypatch):
    """Return a function that calls `hj-cosim study`, whose episodes are driven by a function of synthetic_episodes."""
    module = importlib.import_module("hj_cosim.study.study")
    monkeypatch.setattr(module, "load_tables", lambda name, sizes, progress, *, robot: None)
    monkeypatch.setattr("hj_cosim.study.engines.LocalWorkers", lambda *_: InThisProcess())

    def call_it(*arguments, way="drive"):
        monkeypatch.setattr(module, "drive_episode", getattr(synthetic, way))
        return call("study", *arguments)

    return call_it


def content(folder):
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_missing_episodes_end_in_status_1_a_report_says_how_far_it_is_and_the_folder_alone_goes_on(
    study, call, tmp_path
):
    folder = tmp_path / "study"
    status, out, err = study("light,paper", *SIZE, "--keep", "robot", "--out", folder, way="drive_or_fail")
    assert status == 1
    assert f"2 of 8 episodes are missing; hj-cosim study --resume --out {folder} drives them" in err
    assert "missing: light/op-none, seed 1: the traffic could not be settled" in " ".join(err.split())
    assert "hjop-spc-mi" in out

    status, out, err = call("report", folder)
    assert status == 0
    assert f"unfinished: 6 of 8 episodes; hj-cosim study --resume --out {folder} goes on with it" in err
    assert "6 of 8 episodes" in (folder / "report.html").read_text()
    (folder / "report.html").unlink()

    status, out, err = study("--resume", "--out", folder, "--json")
    printed = json.loads(out)
    assert (status, printed["missing"], len(printed["rows"])) == (0, 0, 4)
    assert not list(folder.glob("episodes/**/trajectories.parquet"))
    finished = content(folder)
    assert study("--resume", "--out", folder, way="never_finish")[0] == 0
    assert content(folder) == finished
    assert "unfinished" not in call("report", folder)[2]
    assert "unfinished" not in (folder / "report.html").read_text()


def test_a_report_of_a_study_without_tables_says_how_far_it_is(study, call, tmp_path, monkeypatch):
    module = importlib.import_module("hj_cosim.study.study")
    folder = tmp_path / "study"

    def stop(*arguments, **options):
        raise KeyboardInterrupt

    monkeypatch.setattr(module, "write_tables", stop)
    assert study(*SIZE, "--out", folder)[0] != 0
    monkeypatch.undo()
    monkeypatch.setattr(sys, "argv", ["hj-cosim"])
    status, _, err = call("report", folder)
    assert status == 0
    assert "unfinished: 4 of 4 episodes" in err
    assert "4 of 4 episodes" in (folder / "report.html").read_text()


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("paper", "--scenario", "dense"), "scenario paper is given, and --scenario dense too; give all in one place"),
        (("--resume",), "give its folder: --resume --out DIR"),
        (("--resume", "--out", "nowhere"), "nowhere holds no study: study.toml is missing"),
        (("--keep", "some"), "--keep"),
        (("--stack", "mpc-spc-mi"), "no stack is called 'mpc-spc-mi'"),
        (("--episodes", "0"), "episodes = 0"),
    ],
)
def test_what_makes_no_sense_is_refused_and_nothing_is_written(study, tmp_path, monkeypatch, arguments, said):
    monkeypatch.chdir(tmp_path)
    status, _, err = study(*arguments)
    assert status == 2
    assert said in " ".join(err.replace("\u2502", " ").split())
    assert list(tmp_path.iterdir()) == []


def test_a_given_option_that_contradicts_the_study_is_refused_and_a_default_is_none(study, tmp_path):
    folder = tmp_path / "study"
    assert study("light", "--seed", 7, *SIZE, "--out", folder)[0] == 0
    before = content(folder)
    status, _, err = study("--resume", "--seed", 0, "--out", folder)
    assert status == 2
    assert f"{folder}/study.toml has seed = 7, but seed = 0 is asked for now" in " ".join(err.split())
    assert study("light", "--out", folder)[0] == 2
    assert content(folder) == before
    assert study("--resume", "--episodes", 3, "--workers", 1, "--out", folder)[0] == 0
    assert (read_study(folder).table["episodes"] == 3).all()


def test_names_are_whole_at_any_width_and_the_papers_numbers_stand_only_in_its_traffic(
    study, tmp_path, monkeypatch, capsys
):
    mine = parse_stack("mine.py:KeepRightWhereverThereIsRoom/spc-mi")
    for scenario in ("dense", "paper"):
        assert study(scenario, *SIZE, "--out", tmp_path / scenario)[0] == 0
        done = read_study(tmp_path / scenario)
        done.table.loc[1, list(mine.columns)] = list(mine.columns.values())
        capsys.readouterr()
        for width in (60, 80, 110, 160):
            for module in (console, study_table):
                monkeypatch.setattr(module, "results", Console(width=width))
            study_table.show_study(done)
            said = capsys.readouterr().out
            assert "hjop-spc-mi" in said
            assert mine.name in said
            assert ("the paper's" in said) == (scenario == "paper")
            assert ("more metrics than have room here" in said) or width > 110
            lines = [line for line in said.splitlines() if str(tmp_path) not in line]  # a path stays whole
            assert max(map(len, lines)) <= width
