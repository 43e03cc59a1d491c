"""`study --resume` with every option that `study` declares: the same is fine, another refused, nothing touched."""

import importlib
from pathlib import Path

import pytest
import typer
from in_this_process import InThisProcess

from hj_cosim.cli.commands import app
from hj_cosim.study.study import run_study
from hj_cosim.watching.server import WatchServer

STUDY = {
    "scenarios": ["light"], "episodes": 2, "seed": 7, "preset": "paper", "stacks": ["hjop-spc-mi", "op-none"],
    "vary": ["planner.gamma_r=0.8,0.9"], "settings": ["filter.epsilon=3", "simulation.duration=20"], "keep": "robot",
    "traffic": "theirs",
}  # fmt: skip
# Of each option that says which study it is: the same that the study has, others, and the field that has both values.
SAME_AND_OTHERS = {
    "scenario": ([["light"]], [["dense"], ["light,dense"], ["/elsewhere/light.toml"]], "scenarios"),
    "scenario_list": ([["--scenario", "light"]], [["--scenario", "paper"]], "scenarios"),
    "episodes": ([["--episodes", "2"]], [["--episodes", "1"]], "episodes"),
    "seed": ([["--seed", "7"]], [["--seed", "0"], ["--seed", "8"]], "seed"),
    "preset": ([["--preset", "paper"]], [["--preset", "best"]], "preset"),
    "stack": (
        [["--stack", "hjop-spc-mi", "--stack", "op-none"]],
        [["--stack", "op-none"], ["--stack", "op-none", "--stack", "hjop-spc-mi"], ["--stack", "a.py:B/none"]],
        "stacks",
    ),
    "vary": (
        [["--vary", "planner.gamma_r=0.8,0.9"]],
        [["--vary", "planner.gamma_r=0.8"], ["--vary", "filter.epsilon=1,2"]],
        "vary",
    ),
    "assignments": (
        [["--set", "filter.epsilon=3", "--set", "simulation.duration=20"]],
        [["--set", "filter.epsilon=3"], ["--set", "filter.epsilon=2", "--set", "simulation.duration=20"]],
        "set",
    ),
    "keep": ([["--keep", "robot"]], [["--keep", "all"]], "keep"),
    "traffic": ([["--traffic", "theirs"]], [["--traffic", "idm-mobil"]], "traffic"),
}
# Options that say how it is driven or shown, not which study it is, with values that a finished study has no use for.
HOW = {
    "workers": ["--workers", "3"], "scheduler": ["--scheduler", "tcp://127.0.0.1:1"], "resume": ["--resume"],
    "out": [], "as_json": ["--json"], "watch": ["--watch"],
}  # fmt: skip
DECLARED = {parameter.name for parameter in typer.main.get_command(app).commands["study"].params}


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """Return the folder of a finished study, whose episodes are synthetic ones."""
    module = importlib.import_module("hj_cosim.study.study")
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(Path(__file__).parents[1] / "study"))
        synthetic = importlib.import_module("synthetic_episodes")
        patch.setattr(module, "load_tables", lambda name, sizes, progress, *, robot: None)
        patch.setattr(module, "drive_episode", synthetic.drive)
        patch.setattr("hj_cosim.study.engines.LocalWorkers", lambda *_: InThisProcess())
        return run_study(**STUDY, out=tmp_path_factory.mktemp("finished") / "study").folder


@pytest.fixture
def resume(finished, call, monkeypatch):
    """Return a function that resumes the study with further options, checks that nothing changed, and what it said."""
    module = importlib.import_module("hj_cosim.study.study")
    monkeypatch.setattr(module, "load_tables", lambda name, sizes, progress, *, robot: None)

    def resume_it(*options):
        before = files(finished)
        status, out, err = call("study", *options, "--resume", "--out", finished)
        assert files(finished) == before
        return status, out, " ".join(err.split())

    return resume_it


def files(folder):
    return {path: (path.stat().st_mtime_ns, path.read_bytes()) for path in folder.rglob("*") if path.is_file()}


def test_every_option_that_study_declares_is_tried():
    assert set(SAME_AND_OTHERS) | set(HOW) == DECLARED


@pytest.mark.parametrize("option", sorted(DECLARED))
def test_the_same_value_is_accepted_and_a_finished_study_is_left_alone(option, resume, monkeypatch):
    monkeypatch.setattr(WatchServer, "wait_for_page", lambda server: False)
    for arguments in SAME_AND_OTHERS[option][0] if option in SAME_AND_OTHERS else [HOW[option]]:
        status, out, said = resume(*arguments)
        assert status == 0
        assert said.startswith("watch at http://127.0.0.1:") if option == "watch" else said == ""
        assert "hjop-spc-mi" in out or option == "as_json"


@pytest.mark.parametrize("option", sorted(SAME_AND_OTHERS))
def test_another_value_is_refused_in_one_sentence_with_both(option, resume, finished):
    _, others, field = SAME_AND_OTHERS[option]
    has = {"stacks": STUDY["stacks"], "set": STUDY["settings"]}.get(field) or STUDY[field]
    for arguments in others:
        status, out, said = resume(*arguments)
        assert (status, out) == (2, "")
        asked = said.partition(f"error: {finished}/study.toml has {field} = {has!r}, but {field} = ")[2]
        value, _, advice = asked.partition(" is asked for now; ")
        assert advice.endswith(", or choose another --out"), said
        for word in arguments[-1].split(","):
            assert word in value


def test_all_that_the_study_has_at_once_is_accepted(resume):
    said_once = sorted(SAME_AND_OTHERS.keys() - {"scenario"})
    everything = [word for name in said_once for word in SAME_AND_OTHERS[name][0][0]]
    assert resume(*everything)[0] == 0
