"""Synthetic runs: seeded random traffic around a robot, and records built from a few given states."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import tomli_w

from hj_cosim.metrics.summary import summarize
from hj_cosim.metrics.threats import threat_track
from hj_cosim.reachability.table.table import ValueTable
from hj_cosim.recording.record import NO_VEHICLE, RobotTrack, RunRecord, TrafficTrack
from hj_cosim.recording.run_folder import write_run
from hj_cosim.scene.road import Road, StraightRoad
from hj_cosim.settings import EpisodeConfig, Scenario

STEP = 0.02


def random_record(samples: int = 200, cars: int = 12, seed: int = 0, road: Road | None = None) -> RunRecord:
    """Return a run of cars at random places and speeds, some of which come late or leave early."""
    road = road or StraightRoad(lane_count=4)
    draw = np.random.default_rng(seed)
    time = np.arange(samples) * STEP
    speed = draw.uniform(18.0, 28.0, cars)
    lane = draw.integers(0, road.lane_count, cars)
    traffic = TrafficTrack.empty(tuple(f"car{j}" for j in range(cars)), np.full(cars, 5.0), np.full(cars, 2.0), samples)
    traffic.x[:] = draw.uniform(-50.0, 250.0, cars) + 500.0 + time[:, None] * speed
    traffic.y[:] = lane * road.lane_width + 0.3 * np.sin(time[:, None] + draw.uniform(0, 6, cars))
    traffic.heading[:] = 0.02 * np.cos(time[:, None] + lane)
    traffic.speed[:] = speed + 0.1 * np.sin(3.0 * time[:, None])
    traffic.acceleration[:] = draw.normal(0.0, 1.0, (samples, cars))
    traffic.lane[:] = lane
    first, last = draw.integers(0, samples // 3 + 1, cars), draw.integers(2 * samples // 3, samples + 1, cars)
    index = np.arange(samples)[:, None]
    traffic.present[:] = (index >= first) & (index < last)
    traffic.present[:, 0] = True

    robot = RobotTrack.empty(samples)
    robot.x[:] = 500.0 + 24.0 * time
    robot.y[:] = 4.0 + 2.0 * np.sin(0.3 * time)
    robot.heading[:] = 0.02 * np.cos(0.3 * time)
    robot.speed[:] = 24.0 + np.sin(time)
    robot.acceleration[:] = np.cos(time)
    robot.omega[:] = 0.05 * np.sin(2.0 * time)
    robot.plan_lane[:] = 1 + (time > 2.0)
    robot.plan_speed[:] = 25.0
    robot.value[:] = 5.0 * np.cos(time)
    robot.value_vehicle[:] = np.where(np.arange(samples) % 7 == 0, NO_VEHICLE, np.arange(samples) % cars)
    robot.value[robot.value_vehicle == NO_VEHICLE] = np.inf
    robot.intervening[:] = robot.value < 2.0
    robot.constraints[:] = robot.intervening
    return RunRecord(time, road, 5.0, 2.0, traffic, robot, threat_track(robot, traffic, 5.0, 2.0))


@pytest.fixture
def make_record() -> Callable[..., RunRecord]:
    return random_record


@pytest.fixture
def record() -> RunRecord:
    return random_record()


@pytest.fixture
def config() -> EpisodeConfig:
    return EpisodeConfig(seed=7, scenario=Scenario(name="synthetic"))


@pytest.fixture(scope="session")
def table(small_table: ValueTable) -> ValueTable:
    """Return the coarse highway table that all rooms share."""
    return small_table


@pytest.fixture(scope="session")
def make_hostile_run() -> Callable[[Path, str], Path]:
    """Return a function that writes a crowded run with collisions; one car and the scenario have the given name."""

    def write(folder: Path, name: str) -> Path:
        record = random_record(samples=150, cars=150, seed=5)
        names = (name, *record.traffic.names[1:])
        record = replace(record, traffic=replace(record.traffic, names=names))
        config = EpisodeConfig(seed=7, scenario=Scenario(name=name))
        write_run(
            folder,
            record,
            tomli_w.dumps(config.model_dump(mode="json", exclude_none=True)),
            summarize(record, config),
        )
        return folder

    return write
