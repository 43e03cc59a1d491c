"""What study.toml says that a study's episodes depend on besides their configuration."""

import pytest

from hj_cosim.control.belief.believing_filter import WORST_TABLE
from hj_cosim.errors import PluginError, RunFolderError
from hj_cosim.reachability.table.store import kept_table
from hj_cosim.recording.study_files import read_study_file
from hj_cosim.settings import robot_and_filter
from hj_cosim.study import study
from hj_cosim.study.driving import drive_episode

ASKED = {"stacks": ["hjop-spc-mi"], "episodes": 1}
OF_SUSPECTS = f"table {WORST_TABLE} of suspects"


@pytest.fixture(autouse=True)
def nothing_driven(monkeypatch):
    for name in ("load_table", "load_tables", "conduct"):
        monkeypatch.setattr(study, name, lambda *_, **__: None)


def begun(folder, *, resume=False, **asked):
    study.run_study("light", **ASKED, **asked, resume=resume, out=folder)
    return read_study_file(folder).program


def test_a_study_by_belief_says_which_table_against_the_worst_it_has(tmp_path):
    program = begun(tmp_path / "study", settings={"filter.priority": "belief"})
    assert program[OF_SUSPECTS] == kept_table(WORST_TABLE, robot_and_filter("best")[0]).identity
    assert len(program) == 4


def test_tables_against_the_worst_of_all_robots_are_named_in_the_same_order(tmp_path):
    asked = {"settings": {"filter.priority": "belief"}, "vary": {"robot.length": [4.5, 5.0]}}
    program = begun(tmp_path / "one", **asked)
    assert len(program[OF_SUSPECTS].split()) == 2
    assert begun(tmp_path / "other", **asked) == program


def test_a_study_without_belief_says_nothing_of_it(tmp_path):
    assert OF_SUSPECTS not in begun(tmp_path / "study")


def test_a_study_by_belief_is_not_resumed_with_another_table_against_the_worst(tmp_path, monkeypatch):
    begun(tmp_path / "study", settings={"filter.priority": "belief"})
    monkeypatch.setattr(study, "kept_table", lambda _, robot: kept_table("highway_paper", robot))
    with pytest.raises(RunFolderError, match=rf"was begun with {OF_SUSPECTS}"):
        study.run_study(resume=True, out=tmp_path / "study")


PLANNER = """
from hj_cosim.planning.contract import IDLE, Plan

class Keeper:
    def plan(self, observation, previous):
        return Plan(IDLE, previous)
"""


@pytest.fixture
def asked_with(tmp_path):
    """Return what a study by a planner of one's own asks for, and that planner's file."""
    file = tmp_path / "mine.py"
    file.write_text(PLANNER)
    return {"stacks": [f"{file}:Keeper/none"], "episodes": 1, "out": tmp_path / "study"}, file


def test_a_study_is_not_resumed_with_another_version_of_a_planner_of_ones_own(asked_with):
    asked, file = asked_with
    study.run_study("light", **asked)
    study.run_study(resume=True, out=asked["out"])
    file.write_text(PLANNER + "\n# changed\n")
    with pytest.raises(
        RunFolderError, match=rf"begun with planner {file}:Keeper [0-9a-f]{{12}}, this is [0-9a-f]{{12}}"
    ):
        study.run_study(resume=True, out=asked["out"])
    file.write_text(PLANNER)
    study.run_study(resume=True, out=asked["out"])


def test_an_episode_is_not_driven_with_a_planner_that_changed_after_the_study_began(asked_with, monkeypatch):
    asked, file = asked_with
    begun = []
    monkeypatch.setattr(study, "conduct", lambda folder, *_, tables, **__: begun.append(folder.remaining_jobs(tables)))
    study.run_study("light", **asked)
    ((job,),) = begun
    assert f"planner {file}:Keeper" in job.program
    file.write_text(PLANNER + "\n# changed\n")
    with pytest.raises(PluginError, match="is not what it was when the study began"):
        drive_episode(job)


def test_filters_and_behaviours_of_ones_own_have_versions_too(tmp_path):
    file = tmp_path / "mine.py"
    file.write_text(
        "class Passing:\n    def filter(self, observation, values, desired): ...\n\n"
        "class Nasty:\n    def act(self, scene): ...\n"
    )
    asked = {"stacks": [f"hjop/{file}:Passing-mi"], "episodes": 1, "out": tmp_path / "study"}
    study.run_study("rogues", **asked, settings={"scenario.rogues.behaviour": f"{file}:Nasty"})
    program = read_study_file(tmp_path / "study").program
    assert {name for name in program if str(file) in name} == {f"filter {file}:Passing", f"behaviour {file}:Nasty"}


def test_ours_have_the_programs_version_and_none_of_their_own(tmp_path):
    assert [name.split()[0] for name in begun(tmp_path / "study")] == ["hj-cosim", "libsumo", "table"]
