"""What study.toml says that a study's episodes depend on besides their configuration."""

import pytest

from hj_cosim.control.belief.believing_filter import WORST_TABLE
from hj_cosim.errors import RunFolderError
from hj_cosim.reachability.table.store import kept_table
from hj_cosim.recording.study_files import read_study_file
from hj_cosim.settings import robot_and_filter
from hj_cosim.study import study

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
