"""Studies in SUMO itself: the same bytes whoever drives and whatever came between, and SUMO's failures."""

import importlib
import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

from hj_cosim.reachability.table.store import kept_table, load_table
from hj_cosim.study.driving import drive_episode
from hj_cosim.study.folder import StudyFolder
from hj_cosim.study.local_workers import LocalWorkers
from hj_cosim.study.request import new_study, resumed_study
from hj_cosim.study.study import conduct, run_study

FEW_CARS = "[traffic]\ncount = 6\ncount_behind = 2\n"
MACHINE_DEPENDENT = {"wall_seconds", "real_time_factor"}
STUDY = {"episodes": 2, "stacks": ("hjop-spc-mi", "op-rss-sw")}


@pytest.fixture
def few_cars(small_specification, small_table, tmp_path):
    """Return the scenario and the settings of short episodes of a few cars."""
    path = tmp_path / "few.toml"
    path.write_text(FEW_CARS)
    return str(path), (f"table={small_specification}", "simulation.duration=1.0")


def all_files(folder):
    """Return the content of every file of a study that must not depend on how it was driven: all but wall times."""
    content = {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and path.name not in ("wall_times.csv", "timing.json")
    }
    return content


def test_every_file_is_the_same_in_this_process_for_two_workers_killed_and_for_the_one_that_resumes(
    few_cars, in_this_process, monkeypatch, tmp_path
):
    scenario, settings = few_cars
    with monkeypatch.context() as patch:
        patch.setattr("hj_cosim.study.engines.LocalWorkers", lambda *_: in_this_process)
        reference = run_study(scenario, settings=settings, out=tmp_path / "reference", **STUDY)
    files = all_files(reference.folder)
    assert {"table.csv", "episodes.parquet", "episodes/op-rss-sw/1/trajectories.parquet"} <= files.keys()
    assert sum(name.startswith("episodes/") for name in files) == 4 * 6

    # The command line with paths from the current folder, killed as soon as it has an episode.
    here, table = os.path.relpath(scenario), settings[0].removeprefix("table=")
    from_here = (f"table={os.path.relpath(table)}", *settings[1:])
    arguments = [argument for text in from_here for argument in ("--set", text)]
    arguments += [argument for stack in STUDY["stacks"] for argument in ("--stack", stack)]
    command = [sys.executable, "-m", "hj_cosim", "study", here, "--episodes", "2", "--workers", "2", *arguments]
    killed = tmp_path / "killed"
    process = subprocess.Popen([*command, "--out", str(killed)], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    while process.poll() is None and not list(killed.glob("episodes/*/*/summary.json")):
        time.sleep(0.01)
    process.kill()
    process.wait()
    # From another folder, and with nothing but the study's: the command that the README has, by one worker.
    again = [sys.executable, "-m", "hj_cosim", "study", "--resume", "--out", str(killed), "--workers", "1"]
    path = os.pathsep.join(filter(None, [str(Path.cwd()), *sys.path]))
    done = subprocess.run(
        again, cwd=tmp_path, env={**os.environ, "PYTHONPATH": path}, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert all_files(killed) == files


def test_a_study_may_keep_the_robot_alone(few_cars, in_this_process, monkeypatch, tmp_path):
    scenario, settings = few_cars
    monkeypatch.setattr("hj_cosim.study.engines.LocalWorkers", lambda *_: in_this_process)
    options = {"episodes": 1, "stacks": "idle-none", "settings": settings}
    whole = run_study(scenario, out=tmp_path / "whole", **options).folder / "episodes" / "idle-none" / "0"
    lean = run_study(scenario, out=tmp_path / "lean", keep="robot", **options).folder / "episodes" / "idle-none" / "0"
    names = {path.name for path in whole.iterdir()}
    assert {path.name for path in lean.iterdir()} == names - {"trajectories.parquet"}
    for name in ("config.toml", "robot.parquet", "drivers.parquet"):
        assert (lean / name).read_bytes() == (whole / name).read_bytes()


@pytest.fixture
def conduct_in_sumo(few_cars, small_specification, tmp_path):
    """Return a function that conducts a study of four episodes of a robot that keeps its lane; one worker drives."""
    scenario, settings = few_cars
    given = {"scenarios": (scenario,), "episodes": 4, "stacks": ("idle-none",), "set": settings}
    place = tmp_path / "study"

    def conduct_it(function, engine=None, resume=False):
        folder = StudyFolder.of(place, resumed_study(place, {}) if resume else new_study(given))
        folder.begin({"hj-cosim": "1.0"}, resume=resume)
        tables = {}
        for key, config in folder.tables.items():
            load_table(config.table, robot=config.robot)
            tables[key] = (kept_table(config.table, config.robot),)
        return conduct(folder, engine or LocalWorkers(1), function=function, tables=tables)

    return conduct_it


def test_failures_of_sumo_are_reported_with_their_logs_and_the_others_go_on(
    conduct_in_sumo, in_this_process, monkeypatch
):
    """SUMO is one per process and stays broken: the episodes after the unlucky ones must not suffer from it."""
    monkeypatch.syspath_prepend(str(Path(__file__).parent))
    episodes = importlib.import_module("episodes_in_sumo")
    study = conduct_in_sumo(episodes.drive_while_sumo_breaks)
    assert {failure.seed: failure.reason for failure in study.failures} == {
        episodes.SEED_OF_AN_ERROR: "SUMO failed at 0.20 s: nothing goes any more",
        episodes.SEED_OF_A_CRASH: "the worker process was killed by SIGSEGV",
    }
    assert all("SUMO said something last" in failure.log.read_text() for failure in study.failures)
    assert (list(study.table["episodes"]), list(study.table["missing"])) == ([2], [2])
    resumed = conduct_in_sumo(drive_episode, in_this_process, resume=True)
    assert (resumed.failures, list(resumed.table["missing"])) == ((), [0])
