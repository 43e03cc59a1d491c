"""`hj-cosim run my.sumocfg`, from the command line to the run's folder, and a study of it."""

import json
import tomllib

import pandas as pd
import pytest
from own_configurations import content, simulation

from hj_cosim.analysis.export import export_run
from hj_cosim.cosim.configuration import resolve_config
from hj_cosim.errors import ConfigurationError
from hj_cosim.reachability.table.store import kept_table
from hj_cosim.recording.run_folder import read_run
from hj_cosim.study.design import design_study
from hj_cosim.study.driving import drive_episode
from hj_cosim.study.jobs import EpisodeJob
from hj_cosim.study.stacks import PAPER_STACKS

WARM_UP = ("--set", "scenario.own.warm_up=30")


@pytest.fixture
def theirs(tmp_path):
    return simulation(tmp_path / "theirs", light="signal", lengths=(600.0, 400.0, 300.0))


def test_a_run_keeps_what_was_chosen_and_repeats_itself_and_leaves_their_folder_alone(
    call, theirs, small_specification, tmp_path
):
    before = content(theirs.parent)
    options = ("--duration", 4, "--table", small_specification, "--no-figures", *WARM_UP)
    status, _, told = call("run", theirs, "--ego", "cars.3", "--begin", 30, "--out", tmp_path / "run", *options)
    assert status == 0, told
    assert "takes over cars.3" in told
    assert content(theirs.parent) == before
    notes = tomllib.loads((tmp_path / "run" / "own_simulation.toml").read_text())
    assert "takes over cars.3 at 30 s" in notes["chosen"][0]
    assert "traffic light 'signal'" in notes["chosen"][1]
    assert any("edgeData means" in line for line in notes["silenced"])
    summary = json.loads((tmp_path / "run" / "summary.json").read_text())
    assert (summary["scenario"], summary["ended"], summary["samples"]) == ("mine", "duration", 200)
    run = read_run(tmp_path / "run")
    assert {name.split(".")[0] for name in run.record.traffic.names} <= {"cars", "lorries"}
    assert run.config["scenario"]["own"] | {"ego": "cars.3", "file": str(theirs)} == run.config["scenario"]["own"]

    config = tmp_path / "run" / "config.toml"
    again = resolve_config(theirs, flags={"scenario": {"own": {"ego": "cars.3", "warm_up": 30.0}}})
    assert again.scenario.own.ego == tomllib.loads(config.read_text())["scenario"]["own"]["ego"]
    status, _, _ = call("run", theirs, "--ego", "cars.3", "--begin", 30, "--out", tmp_path / "again", *options)
    for name in ("trajectories.parquet", "robot.parquet", "summary.json", "own_simulation.toml", "config.toml"):
        assert (tmp_path / "run" / name).read_bytes() == (tmp_path / "again" / name).read_bytes(), name
    exported = export_run(tmp_path / "run", "csv", tmp_path / "drive.csv")
    assert set(pd.read_csv(exported)["vehicle"]) == {"robot", *run.record.traffic.names}


def test_a_drive_that_comes_to_a_light_keeps_what_it_drove_and_says_why_it_ended(
    call, theirs, small_specification, tmp_path
):
    options = ("--table", small_specification, "--no-figures", "--planner", "idle", "--filter", "none", *WARM_UP)
    status, said, told = call("run", theirs, "--duration", 120, "--out", tmp_path / "run", *options)
    assert status == 0, told
    summary = json.loads((tmp_path / "run" / "summary.json").read_text())
    assert summary["ended"] == "traffic light 'signal'"
    assert "traffic light 'signal'" in said
    robot = pd.read_parquet(tmp_path / "run" / "robot.parquet")
    assert len(robot) == summary["samples"] < 6000
    assert robot["x"].iloc[-1] == pytest.approx(1004.0 - 2.5, abs=1.0)


def test_a_study_of_theirs_has_other_drives_by_seed(theirs, small_specification, small_table, tmp_path):
    before = content(theirs.parent)
    settings = (f"table={small_specification}", "simulation.duration=1", "scenario.own.warm_up=30")
    design = design_study((str(theirs),), episodes=3, stacks=(PAPER_STACKS[0],), settings=settings)
    chosen = []
    for cell, seed in design.episodes():
        folder = tmp_path / str(seed)
        drive_episode(EpisodeJob(cell.config_of(seed), kept_table(str(small_specification)), folder))
        chosen.append(tomllib.loads((folder / "own_simulation.toml").read_text())["chosen"][0])
    assert len(set(chosen)) == 3
    assert len({sentence.split(" at ")[1] for sentence in chosen}) == 3  # not even at the same time
    assert content(theirs.parent) == before


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("nowhere.sumocfg",), "'nowhere.sumocfg' does not exist; give a .sumocfg"),
        (("paper", "--ego", "somebody"), "scenario.own.ego and scenario.own.begin (--ego, --begin) are about"),
        (("paper", "--set", "scenario.own.file=gone.sumocfg"), "'gone.sumocfg': there is no such .sumocfg"),
    ],
)
def test_what_cannot_be_is_refused_in_a_sentence(call, arguments, said):
    status, _, told = call("run", *arguments)
    assert status == 2
    assert said in " ".join(told.split())


def test_a_scenario_may_have_a_simulation_beside_it(theirs):
    scenario = theirs.parent / "mine.toml"
    scenario.write_text('[own]\nfile = "mine.sumocfg"\nwarm_up = 30.0\n')
    assert resolve_config(scenario).scenario.own.file == str(theirs)
    scenario.write_text('[own]\nfile = "other.sumocfg"\n')
    with pytest.raises(ConfigurationError, match=r"'other\.sumocfg': there is no such \.sumocfg"):
        resolve_config(scenario)


def test_who_breaks_a_duty_is_evaded_there_as_anywhere(theirs):
    assert resolve_config(theirs).filter.evade
    assert not resolve_config(theirs, assignments=["filter.evade=false"]).filter.evade
    assert resolve_config("paper").filter.evade
    assert not resolve_config("paper", preset="paper").filter.evade


def test_near_is_recorded_unless_all_is_asked_for_and_the_robot_drives_the_same(
    call, theirs, small_specification, tmp_path
):
    options = ("--duration", 3, "--table", small_specification, "--no-figures", *WARM_UP)
    options += ("--planner", "idle", "--filter", "none", "--set", "scenario.own.near=60")
    runs = {}
    for name, more in (("usual", ()), ("near", ("--record", "near")), ("all", ("--record", "all"))):
        status, _, told = call("run", theirs, *options, *more, "--out", tmp_path / name)
        assert status == 0, told
        runs[name] = read_run(tmp_path / name)
    assert [run.config["recording"]["cars"] for run in runs.values()] == ["near", "near", "all"]
    for file in ("trajectories.parquet", "robot.parquet", "config.toml", "summary.json"):
        assert (tmp_path / "usual" / file).read_bytes() == (tmp_path / "near" / file).read_bytes()
    near, everybody = runs["near"].trajectories, runs["all"].trajectories
    assert len(everybody) > len(near)
    both = [frame[frame["vehicle"] == "robot"].drop(columns="vehicle") for frame in (near, everybody)]
    pd.testing.assert_frame_equal(*(frame.reset_index(drop=True) for frame in both))
    keys = ["time", "vehicle"]
    frames = [frame.assign(vehicle=frame["vehicle"].astype(str)).set_index(keys) for frame in (near, everybody)]
    pd.testing.assert_frame_equal(frames[0], frames[1].loc[frames[0].index])


def test_our_drivers_are_refused_where_they_drive_already(call, small_specification, tmp_path):
    status, out, told = call("run", "light", "--traffic", "idm-mobil", "--out", tmp_path / "run")
    assert (status, out) == (2, "")
    said = " ".join(told.split())
    assert "scenario.own.traffic = 'idm-mobil' (--traffic) is about a user's own .sumocfg" in said
    assert "IDM and MOBIL already, so leave it out" in said
    assert not (tmp_path / "run").exists()


def test_a_drive_among_our_drivers_says_so_and_knows_them(call, theirs, small_specification, tmp_path):
    options = ("--duration", 2, "--table", small_specification, "--no-figures", *WARM_UP)
    status, _, told = call("run", theirs, *options, "--traffic", "idm-mobil", "--out", tmp_path / "run")
    assert status == 0, told
    assert "their drivers -> IDM and MOBIL" in told
    drivers = pd.read_parquet(tmp_path / "run" / "drivers.parquet")
    assert drivers.drop(columns="vehicle").notna().all().all()
    assert 1.0 < drivers["time_headway"].mean() < 2.0
    assert read_run(tmp_path / "run").config["scenario"]["own"]["traffic"] == "idm-mobil"
