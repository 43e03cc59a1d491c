"""One episode, in SUMO and in a world without it."""

import dataclasses
import json
import math

import numpy as np
import pandas as pd
import pytest

from hj_cosim import run_episode
from hj_cosim.control.catalogue import make_filter
from hj_cosim.cosim.configuration import resolve_config
from hj_cosim.cosim.episode import drive, fallback_summary
from hj_cosim.errors import HjCosimError, RunFolderError, SimulationError
from hj_cosim.planning.catalogue import make_planner
from hj_cosim.settings import CarStart, RobotSettings
from hj_cosim.traffic.fake import FakeWorld


def drive_in_fake_world(cars, table, *settings):
    config = resolve_config("paper", assignments=settings)
    world = FakeWorld(cars)
    planner = make_planner(config.planner, config.robot, config.scenario.drivers, world.road, table)
    safety_filter = make_filter(config.filter, config.robot, world.road, table, config.simulation.step)
    return drive(world, planner, safety_filter, table, config).record


@pytest.fixture(scope="module")
def sumo_run(small_specification, tmp_path_factory):
    folder = tmp_path_factory.mktemp("runs") / "run"
    episode = run_episode("paper", seed=7, duration=4.0, table=str(small_specification), out=folder)
    return episode, folder


def test_run_folder_holds_what_the_readme_promises(sumo_run):
    _, folder = sumo_run
    names = {str(path.relative_to(folder)) for path in folder.rglob("*")}
    assert {"config.toml", "trajectories.parquet", "robot.parquet", "summary.json"} <= names
    assert {"figures/snapshots.png", "figures/timeline.png"} <= names


def test_every_sample_of_robot_and_cars_is_written(sumo_run):
    _, folder = sumo_run
    robot = pd.read_parquet(folder / "robot.parquet")
    np.testing.assert_allclose(robot["time"], 0.02 * np.arange(200), atol=1e-9)
    cars = pd.read_parquet(folder / "trajectories.parquet")
    assert (cars.groupby("time").size() == 101).all()


def test_robot_moves_as_the_recorded_controls_say(sumo_run):
    """Checked against an independent integration: Euler at a hundredth of the step."""
    _, folder = sumo_run
    robot = pd.read_parquet(folder / "robot.parquet").to_dict("list")
    for sample in range(0, 199, 11):
        x, y, heading, speed = (robot[name][sample] for name in ("x", "y", "heading", "speed"))
        for _ in range(100):
            x += speed * np.cos(heading) * 2e-4
            y += speed * np.sin(heading) * 2e-4
            heading += speed * np.tan(robot["steering"][sample]) / 5.0 * 2e-4
            speed += robot["acceleration"][sample] * 2e-4
        after = [robot[name][sample + 1] for name in ("x", "y", "heading", "speed")]
        np.testing.assert_allclose([x, y, heading, speed], after, atol=2e-4)


def test_summary_agrees_with_the_samples(sumo_run):
    episode, folder = sumo_run
    robot = pd.read_parquet(folder / "robot.parquet")
    summary = json.loads((folder / "summary.json").read_text())
    assert summary["samples"] == len(robot) == 200
    assert summary["mean_speed"] == pytest.approx(robot["speed"].mean())
    assert summary["distance"] == pytest.approx(robot["x"].iloc[-1] - robot["x"].iloc[0], abs=0.5)
    assert summary["seed"] == episode.config.seed == 7


def test_controls_stay_within_the_limits(sumo_run):
    _, folder = sumo_run
    robot, limits = pd.read_parquet(folder / "robot.parquet"), RobotSettings()
    assert robot["omega"].abs().max() <= limits.omega_max
    assert robot["acceleration"].between(limits.acceleration_min, limits.acceleration_max).all()


def test_folder_that_holds_a_run_is_not_written_over(sumo_run, small_specification):
    _, folder = sumo_run
    before = (folder / "summary.json").read_bytes()
    with pytest.raises(RunFolderError, match="already holds a run; choose another --out"):
        run_episode("paper", duration=1.0, table=str(small_specification), out=folder)
    assert (folder / "summary.json").read_bytes() == before


def test_robot_overtakes_a_slow_car_in_a_fake_world(small_table):
    record = drive_in_fake_world([CarStart(lane=1, x=60.0, speed=15.0)], small_table, "simulation.duration=12")
    assert record.robot.x[-1] > record.traffic.x[-1, 0]
    assert not record.threats.collision.any()


def test_filter_stops_a_blind_robot_behind_a_standing_car(small_table):
    """The idle planner would drive on at 24 m/s; only the filter sees the car."""
    cars = [CarStart(lane=lane, x=150.0, speed=0.0) for lane in range(4)]
    settings = ("planner.kind=idle", "simulation.duration=15")
    unfiltered = drive_in_fake_world(cars, small_table, *settings, "filter.kind=none")
    filtered = drive_in_fake_world(cars, small_table, *settings)
    assert unfiltered.threats.collision[-1]
    assert not filtered.threats.collision.any()
    assert filtered.robot.intervening.any()
    assert filtered.robot.speed[-1] < 3.0


def test_episode_ends_at_a_collision_unless_told_to_drive_on(small_table):
    cars = [CarStart(lane=1, x=40.0, speed=0.0)]
    settings = ("planner.kind=idle", "filter.kind=none", "simulation.duration=3")
    stopped = drive_in_fake_world(cars, small_table, *settings)
    driven_on = drive_in_fake_world(cars, small_table, *settings, "simulation.on_collision=continue")
    assert stopped.threats.collision[-1]
    assert stopped.threats.collision.sum() == 1
    assert len(driven_on.time) == 150
    assert driven_on.threats.collision.sum() > 1


def test_progress_reaches_the_end(small_table):
    config = resolve_config("paper", assignments=["planner.kind=idle", "filter.kind=none", "simulation.duration=2.5"])
    world, calls = FakeWorld(), []
    planner = make_planner(config.planner, config.robot, config.scenario.drivers, world.road, small_table)
    safety_filter = make_filter(config.filter, config.robot, world.road, small_table, 0.02)
    drive(world, planner, safety_filter, small_table, config, progress=lambda done, total: calls.append((done, total)))
    assert calls == [(0, 125), (50, 125), (100, 125), (125, 125)]


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        (["planner.gama_r=1"], r"--set planner\.gama_r=1: unknown key 'planner\.gama_r'; known keys are kind, gamma_r"),
        (["filter.epsilon=-1"], r"filter\.epsilon = -1"),
    ],
)
def test_wrong_setting_is_named(settings, said):
    with pytest.raises(HjCosimError, match=said):
        run_episode("paper", settings=settings)


class BrokenWorld(FakeWorld):
    """A world that puts a car, or the robot, at NaN from one second on."""

    def __init__(self, cars, broken):
        super().__init__(cars)
        self._broken = broken

    def observe(self):
        seen = super().observe()
        if seen.time < 1.0:
            return seen
        array = getattr(seen, self._broken).copy()
        array[0] = math.nan
        return dataclasses.replace(seen, **{self._broken: array})


@pytest.mark.parametrize("kind", ["spc", "rss", "none"])
@pytest.mark.parametrize("broken", ["x", "y", "heading", "speed"])
def test_robot_brakes_in_its_lane_while_a_car_is_nowhere_and_the_summary_tells(small_table, kind, broken):
    config = resolve_config("paper", assignments=["simulation.duration=2", f"filter.kind={kind}", "planner.kind=idle"])
    world = BrokenWorld([CarStart(lane=2, x=60.0, speed=20.0)], broken)
    planner = make_planner(config.planner, config.robot, config.scenario.drivers, world.road, small_table)
    safety_filter = make_filter(config.filter, config.robot, world.road, small_table, 0.02)
    driven = drive(world, planner, safety_filter, small_table, config)
    robot = driven.record.robot
    assert (robot.acceleration[50:] == config.robot.acceleration_min).all()
    assert np.abs(robot.omega).max() <= config.robot.omega_max
    assert np.abs(robot.y - 4.0).max() < 0.1
    assert fallback_summary(driven.diagnostics)["not_judged_samples"] == 50


def test_robot_that_a_world_puts_nowhere_ends_the_episode(small_table):
    config = resolve_config("paper", assignments=["simulation.duration=2"])
    world = BrokenWorld([], "robot")
    planner = make_planner(config.planner, config.robot, config.scenario.drivers, world.road, small_table)
    safety_filter = make_filter(config.filter, config.robot, world.road, small_table, 0.02)
    with pytest.raises(SimulationError, match=r"the world has the robot at p_x, p_y, θ, v = \[nan, .* at 1\.00 s"):
        drive(world, planner, safety_filter, small_table, config)


def test_summary_says_that_nothing_had_to_be_answered_by_braking(sumo_run):
    _, folder = sumo_run
    summary = json.loads((folder / "summary.json").read_text())
    assert (summary["not_judged_samples"], summary["desired_not_finite_samples"]) == (0, 0)
    assert summary["solver_failures"] == 0


def test_what_the_filter_is_asked_for_changes_no_faster_than_the_jerk_allows(small_table):
    settings = ("simulation.duration=6", "filter.kind=none", "planner.speed_step=2")
    eased = drive_in_fake_world([], small_table, *settings, "tracking.jerk_max=8").robot.acceleration_desired
    at_once = drive_in_fake_world([], small_table, *settings, "tracking.jerk_max=1e6").robot.acceleration_desired
    assert np.abs(np.diff(eased)).max() <= 8 * 0.02 + 1e-9
    assert np.abs(np.diff(at_once)).max() > 1.0
