"""Planners and filters of a user's own in a whole run: by command, from Python, and where they go wrong."""

import json
import math
import re
import sys
import time
import tomllib
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from hj_cosim import plugin_answers, plugins, run_episode
from hj_cosim.control.catalogue import make_filter
from hj_cosim.control.contract import FilterDecision
from hj_cosim.cosim.configuration import resolve_config
from hj_cosim.cosim.episode import drive, fallback_summary
from hj_cosim.errors import ConfigurationError, PluginError
from hj_cosim.planning.catalogue import make_planner
from hj_cosim.planning.contract import Plan
from hj_cosim.planning.guard import GuardedPlanner
from hj_cosim.planning.idle import IdlePlanner
from hj_cosim.scene.observation import Control, Target
from hj_cosim.settings import CarStart
from hj_cosim.traffic.fake import FakeWorld

README = Path(__file__).resolve().parents[2] / "README.md"


def commands_and_files() -> list[tuple[list[str], str, str]]:
    """Return the README's commands with a file of one's own, the file's name and its content."""
    text = README.read_text(encoding="utf-8")
    files = {name: block for block, name in re.findall(r"```python\n(# (\w+\.py).*?)```", text, flags=re.DOTALL)}
    commands = re.findall(r"`hj-cosim (run --(?:planner|filter) (\w+\.py):\w+[^`]*)`", text)
    return [(command.split(), name, files[name]) for command, name in commands]


@pytest.mark.parametrize("case", commands_and_files(), ids=lambda case: case[1])
def test_the_readme_s_command_drives_the_readme_s_file(case, call, small_specification, tmp_path, monkeypatch):
    command, name, content = case
    monkeypatch.chdir(tmp_path)
    (tmp_path / name).write_text(content)
    short = ("--duration", 1, "--table", small_specification, "--no-figures", "--out", tmp_path / "run", "--json")
    status, _, said = call(*command, *short)
    assert status == 0, said
    summary = json.loads((tmp_path / "run" / "summary.json").read_text())
    config = tomllib.loads((tmp_path / "run" / "config.toml").read_text())
    robot = pd.read_parquet(tmp_path / "run" / "robot.parquet")
    assert len(robot) == 50
    kind = "planner" if name == "mine.py" else "filter"
    assert summary[kind] == {"mine.py": "KeepRight", "careful.py": "KeepAway"}[name]
    assert config[kind]["kind"] == f"{tmp_path / name}:{summary[kind]}"
    if kind == "planner":
        assert (robot["plan_lane"] == 0).all()
        assert (robot["action"] == 4).all()
    else:
        assert config["filter"]["options"] == {"margin": 8.0}
        near = robot["value"] <= 8.0
        assert (robot["constraints"] > 0).equals(near)
        assert (robot["acceleration"][near] == -3.0).all()


def test_there_are_two_examples():
    assert [name for _, name, _ in commands_and_files()] == ["mine.py", "careful.py"]


class Slowing:
    """Plans to be slower and slower."""

    def __init__(self, road):
        self.lanes = road.lane_count

    def plan(self, observation, previous):
        return Plan(2, Target(self.lanes - 1, previous.speed - 1.0))


class Pushing:
    """Asks for more than the robot can."""

    def filter(self, observation, values, desired):
        return FilterDecision(Control(0.0, 100.0), diagnostics={"pushed": 2.0})


def test_run_episode_takes_a_class_and_an_object(small_specification):
    short = {"duration": 0.2, "table": str(small_specification), "scenario": "light"}
    episode = run_episode(planner=Slowing, filter=Pushing(), **short)
    assert (episode.summary["planner"], episode.summary["filter"]) == ("Slowing", "Pushing")
    assert (episode.record.robot.plan_lane == 3).all()
    assert (episode.record.robot.acceleration == 4.0).all()
    assert episode.config.planner.kind == f"{__name__}:Slowing"


def driven(planner, safety_filter, table, *settings):
    config = resolve_config("paper", assignments=["simulation.duration=0.5", *settings])
    world = FakeWorld([CarStart(lane=1, x=60.0, speed=20.0)])
    if isinstance(safety_filter, str):
        filter_settings = config.filter.model_copy(update={"kind": safety_filter})
        safety_filter = make_filter(filter_settings, config.robot, world.road, table, 0.02)
    if isinstance(planner, str):
        planner_settings = config.planner.model_copy(update={"kind": planner})
        planner = make_planner(planner_settings, config.robot, config.scenario.drivers, world.road, table)
    return drive(world, planner, safety_filter, table, config)


def test_a_filter_s_diagnostics_are_summed_and_v_is_recorded_whoever_filters(small_table):
    pushed = driven("idle", Pushing(), small_table)
    assert pushed.diagnostics == {"pushed": 50.0}
    by_spc = driven("idle", "spc", small_table)
    assert pushed.record.robot.value[0] == by_spc.record.robot.value[0] < math.inf
    assert pushed.record.robot.value_vehicle[0] == 0


def test_planners_are_told_the_mean_drivers_and_not_how_they_scatter(small_table):
    class Asking:
        def __init__(self, drivers, settings):
            self.drivers, self.settings = drivers, settings

        def plan(self, observation, previous): ...

    config = resolve_config("paper", flags={"planner": {"kind": plugins.given(plugins.PLANNER, Asking)}})
    drivers = config.scenario.drivers
    planner = make_planner(config.planner, config.robot, drivers, FakeWorld().road, small_table)
    assert planner.drivers.desired_speed.mean == drivers.desired_speed.mean
    assert (
        planner.drivers.desired_speed.deviation
        == planner.drivers.time_headway.deviation
        == 0.0
        < drivers.desired_speed.deviation
    )
    assert planner.settings == config.planner


class Planning:
    def __init__(self, answer):
        self.answer = answer

    def plan(self, observation, previous):
        return self.answer(observation, previous)


class Filtering:
    def __init__(self, answer):
        self.answer = answer

    def filter(self, observation, values, desired):
        return self.answer(observation, values, desired)


NO_PLANS = {
    "raised ZeroDivisionError: division by zero": lambda seen, previous: 1 / 0,
    "raised SystemExit: 0": lambda seen, previous: sys.exit(0),
    "returned None, which is no Plan": lambda seen, previous: None,
    "returned a target in lane 9; the road has the lanes 0 to 3": lambda seen, previous: Plan(0, Target(9, 20.0)),
    "returned a target in lane 0.5": lambda seen, previous: Plan(0, Target(0.5, 20.0)),
    "returned a target speed of nan": lambda seen, previous: Plan(0, Target(0, math.nan)),
    "returned a target speed of -1.0": lambda seen, previous: Plan(0, Target(0, -1.0)),
    "returned a target speed of None": lambda seen, previous: Plan(0, Target(0, None)),
    "returned the action 7": lambda seen, previous: Plan(7, previous),
}


@pytest.mark.parametrize("said", NO_PLANS)
def test_a_plan_that_is_none_ends_the_drive_in_a_sentence(small_table, said):
    with pytest.raises(PluginError, match=rf"^.*test_plugged_drive.py:\d+: Planning.plan {re.escape(said)}") as raised:
        driven(Planning(NO_PLANS[said]), "none", small_table)
    assert "\n" not in str(raised.value)


def written(arrays, answer):
    """Write into the first entry of each array, and return an answer."""
    for array in arrays:
        array[0] += 1.0
    return answer


@pytest.mark.parametrize("name", ["x", "robot"])
def test_a_planner_that_writes_into_what_it_sees_ends_the_drive_in_a_sentence(small_table, name):
    writing = Planning(lambda seen, previous: written([getattr(seen, name)], Plan(0, previous)))
    with pytest.raises(PluginError, match=r"^.*test_plugged_drive.py:\d+: Planning.plan wrote to Observation."):
        driven(writing, "none", small_table)


@pytest.mark.parametrize("writes", [lambda seen, values: seen.speed, lambda seen, values: values.value])
def test_a_filter_that_writes_into_what_it_sees_ends_the_drive_in_a_sentence(small_table, writes):
    writing = Filtering(lambda seen, values, desired: written([writes(seen, values)], FilterDecision(desired)))
    with pytest.raises(
        PluginError,
        match=r"^.*test_plugged_drive.py:\d+: Filtering.filter wrote to (Observation.speed|CarValues.value)",
    ):
        driven("idle", writing, small_table)


def test_numbers_of_numpy_in_a_plan_become_pythons_and_compile_nothing_anew(small_table):
    answer = Plan(np.int64(1), Target(np.int32(2), np.float32(20.5)))
    world = FakeWorld()
    guarded = GuardedPlanner(Planning(lambda seen, previous: answer), world.road)
    planned = guarded.plan(world.observe(), Target(0, 0.0))
    assert planned == Plan(1, Target(2, 20.5))
    assert [type(each) for each in (planned.action, planned.target.lane, planned.target.speed)] == [int, int, float]


NO_DECISIONS = {
    "raised KeyError: 'row'": lambda seen, values, desired: {}["row"],
    "raised SystemExit: 5": lambda seen, values, desired: sys.exit(5),
    "raised GeneratorExit": lambda seen, values, desired: (_ for _ in ()).throw(GeneratorExit),
    "returned FilterDecision(control=Control(omega=10000": lambda seen, values, desired: FilterDecision(
        Control(10**400, 1.0)
    ),
    "returned namespace(control": lambda seen, values, desired: SimpleNamespace(
        control=desired, slack=0.0, constraints=0, diagnostics={}, belief=None
    ),
    "returned FilterDecision(control=Control(omega='0.0'": lambda seen, values, desired: FilterDecision(
        Control("0.0", "1.0")
    ),
    "returned slack = 0.0, constraints = 10": lambda seen, values, desired: FilterDecision(desired, 10**30),
    "returned slack = 0.0, constraints = 0.5": lambda seen, values, desired: FilterDecision(desired, 0.5),
    "returned belief = 'abc'": lambda seen, values, desired: FilterDecision(desired, belief="abc"),
    "returned belief = array([0., 0.])": lambda seen, values, desired: FilterDecision(desired, belief=np.zeros(2)),
    "returned belief = array([nan": lambda seen, values, desired: FilterDecision(
        desired, belief=np.full(len(seen.x), math.nan)
    ),
    "returned diagnostics = {5: 1}": lambda seen, values, desired: FilterDecision(desired, diagnostics={5: 1}),
    "returned diagnostics = {'a': nan}": lambda seen, values, desired: FilterDecision(
        desired, diagnostics={"a": math.nan}
    ),
    "returned diagnostics = ['a']": lambda seen, values, desired: FilterDecision(desired, diagnostics=["a"]),
    "returned None, which is no FilterDecision": lambda seen, values, desired: None,
    "returned Control(omega=": lambda seen, values, desired: desired,
    "returned FilterDecision(control=None": lambda seen, values, desired: FilterDecision(None),
    "returned FilterDecision(control=Control(omega='left'": lambda seen, values, desired: FilterDecision(
        Control("left", 0.0)
    ),
    "returned slack = nan": lambda seen, values, desired: FilterDecision(desired, slack=math.nan),
    "returned slack = 0.0, constraints = -1": lambda seen, values, desired: FilterDecision(desired, constraints=-1),
}


@pytest.mark.parametrize("said", NO_DECISIONS)
def test_a_decision_that_is_none_ends_the_drive_in_a_sentence(small_table, said):
    with pytest.raises(PluginError, match=rf"^.*test_plugged_drive.py:\d+: Filtering.filter {re.escape(said)}"):
        driven("idle", Filtering(NO_DECISIONS[said]), small_table)


def test_a_filter_that_cannot_judge_brakes_in_the_lane_and_is_counted(small_table):
    silent = Filtering(lambda seen, values, desired: FilterDecision(Control(math.nan, 1.0)))
    drive_of_it = driven("idle", silent, small_table)
    assert (drive_of_it.record.robot.acceleration == -6.0).all()
    assert fallback_summary(drive_of_it.diagnostics)["not_judged_samples"] == 25


def test_an_answer_that_takes_too_long_ends_the_drive(small_table, monkeypatch):
    def slow(seen, previous):
        time.sleep(0.05)
        return Plan(0, previous)

    assert plugin_answers.SLOWEST_ANSWER == 10.0
    monkeypatch.setattr(plugin_answers, "SLOWEST_ANSWER", 0.04)
    with pytest.raises(
        PluginError, match=r"Planning.plan took 0\.\d s; 0.04 s is the most, and what has to be compiled"
    ):
        driven(Planning(slow), "none", small_table)


class Ready(IdlePlanner):
    def __init__(self):
        self.called = []

    def prepare(self, observation):
        self.called.append(("prepare", observation.time))

    def plan(self, observation, previous):
        self.called.append(("plan", observation.time))
        return super().plan(observation, previous)


class Unready(Filtering):
    def prepare(self, observation, values):
        raise RuntimeError("no compiler")


def test_what_a_planner_or_a_filter_prepares_is_prepared_before_the_drive(small_table):
    ready = Ready()
    driven(ready, "none", small_table)
    assert ready.called == [("prepare", 0.0), ("plan", 0.0)]
    with pytest.raises(PluginError, match=r"Unready.prepare raised RuntimeError: no compiler"):
        driven("idle", Unready(None), small_table)


def test_what_fails_in_a_run_is_a_sentence_with_status_2_and_leaves_nothing(
    call, small_specification, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    Path("mine.py").write_text("class Lost:\n    def plan(self, observation, previous):\n        return self.way\n")
    out = ("--table", small_specification, "--duration", 1, "--out", "run")
    status, _, said = call("run", "light", "--planner", "mine.py:Lost", *out)
    assert status == 2
    assert "mine.py:3: Lost.plan raised AttributeError: 'Lost' object has no attribute 'way'" in " ".join(said.split())
    assert not Path("run").exists()
    status, _, said = call("run", "light", "--planner", "mine.py:Lots", *out)
    assert (status, "has no class 'Lots'; it has Lost" in " ".join(said.split())) == (2, True)


def test_a_wrong_plug_in_is_refused_before_anything_is_built():
    with pytest.raises(ConfigurationError, match=r"filter\.kind = 'cbf': no filter is called so"):
        resolve_config("paper", flags={"filter": {"kind": "cbf"}})
    with pytest.raises(ConfigurationError, match=r"planner\.options: 'x' is given, but IdlePlanner has none"):
        resolve_config("paper", assignments=["planner.kind=idle", "planner.options.x=1"])
