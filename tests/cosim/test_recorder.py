"""What a recorder makes of samples: few, or more than the memory is to hold, of cars that come and go."""

import math
import resource
from dataclasses import fields

import numpy as np
import pandas as pd
import pytest

from hj_cosim.control.contract import FilterDecision
from hj_cosim.cosim.recorder import Recorder
from hj_cosim.errors import HjCosimError
from hj_cosim.metrics.collisions import find_collisions
from hj_cosim.metrics.summary import summarize
from hj_cosim.planning.contract import IDLE, Plan
from hj_cosim.recording.record import NO_VEHICLE
from hj_cosim.recording.run_folder import read_run, write_run
from hj_cosim.recording.spilled import SpilledTraffic
from hj_cosim.recording.trajectories import Scene
from hj_cosim.scene.observation import NOBODY, CarValues, Control, Observation, Target
from hj_cosim.scene.road import StraightRoad
from hj_cosim.settings import EpisodeConfig, RobotSettings, Scenario

SCENE = Scene(StraightRoad(4), 5.0, 2.0)
NAMES = [f"car{number}" for number in range(4)]
STEP = 0.02
CONTROL = Control(0.0, 0.0)


def one_car(robot_speed: float = 20.0) -> Observation:
    ones = np.ones(1)
    return Observation(
        time=0.0, robot=np.array([0.0, 0.0, 0.0, robot_speed]), robot_acceleration=0.0, vehicle=np.array([3]),
        x=50.0 * ones, y=ones, heading=0.0 * ones, speed=ones, acceleration=ones, lane=np.array([0]),
        target_lane=np.array([0]), length=5.0 * ones, width=2.0 * ones,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("constraints", "omega", "acceleration", "intervening"),
    [(0, 0.1, 1.0, False), (0, 0.1055, 1.09, False), (0, 0.1065, 1.0, True), (0, 0.1, 0.89, True), (1, 0.1, 1.0, True)],
)
def test_an_intervention_is_a_car_in_k_or_a_control_that_is_another_by_1_percent(
    tmp_path, constraints, omega, acceleration, intervening
):
    recorder = Recorder(SCENE, lambda: NAMES, RobotSettings(), 1, tmp_path / "run")
    decision = FilterDecision(Control(omega, acceleration), constraints=constraints)
    values = CarValues(np.array([7.5]), np.zeros((1, 5)), 7.5, 0)
    recorder.record(one_car(), values, Plan(IDLE, Target(0, 20.0)), Control(0.1, 1.0), decision, 0.0)
    assert recorder.finish("duration").robot.intervening[0] == intervening


@pytest.mark.parametrize(
    ("least", "nearest", "value", "vehicle"), [(7.5, 0, 7.5, 3), (math.nan, NOBODY, math.inf, NO_VEHICLE)]
)
def test_v_of_the_nearest_car_is_recorded_and_infinity_where_it_is_not_known(tmp_path, least, nearest, value, vehicle):
    recorder = Recorder(SCENE, lambda: NAMES, RobotSettings(), 1, tmp_path / "run")
    values = CarValues(np.array([least]), np.zeros((1, 5)), least, nearest)
    recorder.record(one_car(), values, Plan(IDLE, Target(0, 20.0)), CONTROL, FilterDecision(CONTROL), 0.0)
    record = recorder.finish("duration")
    assert (record.robot.value[0], record.robot.value_vehicle[0]) == (value, vehicle)


@pytest.mark.parametrize("spilled", [False, True])
def test_what_the_filter_believes_is_recorded_and_written_for_cars_that_come_later(tmp_path, request, spilled):
    if spilled:
        request.getfixturevalue("small_memory")
    observations, names = coming_and_going()
    recorder = Recorder(SCENE, lambda: names, RobotSettings(), len(observations), tmp_path / "run")
    believed = {}
    for sample, seen in enumerate(observations):
        belief = np.round(seen.vehicle / 100.0 + sample / 1000.0, 6)
        believed |= {(sample, int(car)): each for car, each in zip(seen.vehicle, belief, strict=True)}
        values = CarValues(np.full(len(seen.x), 5.0), np.zeros((len(seen.x), 5)), 5.0, NOBODY)
        decision = FilterDecision(CONTROL, belief=belief)
        recorder.record(seen, values, Plan(IDLE, Target(1, 24.0)), CONTROL, decision, 0.0)
    record = recorder.finish("duration")
    assert (type(record.traffic) is SpilledTraffic) is spilled
    summary = summarize(record, EpisodeConfig(scenario=Scenario(name="made up")))
    write_run(tmp_path / "run", record, 'seed = 1\n[scenario]\nname = "made up"\n', summary)
    for each in (record, read_run(tmp_path / "run").record):
        assert each.belief.shape == (len(observations), len(names))
        where = np.isfinite(each.belief)
        assert {(int(t), int(j)): each.belief[t, j] for t, j in zip(*np.nonzero(where), strict=True)} == believed


def test_a_filter_that_believes_nothing_leaves_nothing_recorded(tmp_path):
    assert recorded(*coming_and_going(30), tmp_path / "run").belief is None


def coming_and_going(samples: int = 400) -> tuple[list[Observation], list[str]]:
    """Return what is seen of 30 cars that each come, go, and come back, in no order; two are run into."""
    draw = np.random.default_rng(3)
    names, observations = [f"car{number}" for number in range(30)], []
    speed, lane = draw.uniform(20.0, 25.0, 30), draw.integers(0, 4, 30)
    length = draw.uniform(4.0, 12.0, 30)
    start = draw.uniform(-60.0, 400.0, 30)
    # Numbers are given in the order in which cars are first seen.
    first = np.sort(draw.integers(0, samples // 2, 30))
    first[:5] = 0
    gone = first + draw.integers(20, samples, 30)
    for car, ahead in ((0, 20.0), (29, 30.0)):  # which are run into, one while the other still is
        start[car], speed[car], lane[car], gone[car] = ahead, 20.0, 1, samples
    for sample in range(samples):
        here = np.flatnonzero((sample >= first) & ((sample < gone) | (sample > gone + 40)))
        here = draw.permutation(here)
        time = sample * STEP
        observations.append(
            Observation(
                time=time,
                robot=np.array([500.0 + 24.0 * time, 4.0, 0.01, 24.0]),
                robot_acceleration=0.5,
                vehicle=here,
                x=500.0 + start[here] + speed[here] * time,
                y=4.0 * lane[here] + 0.1 * np.sin(time + here),
                heading=0.01 * np.cos(time + here),
                speed=speed[here],
                acceleration=-6.0 * (np.sin(3.0 * time + here) > 0.5),
                lane=lane[here],
                target_lane=lane[here],
                length=length[here],
                width=np.full(len(here), 2.0),
            )
        )
    return observations, names


def recorded(observations, names, place, within=math.inf):
    """Return the record of what was seen, with names known only once their cars have come."""
    known: list[str] = []
    recorder = Recorder(SCENE, lambda: known, RobotSettings(), len(observations) + 10, place, within)
    for sample, seen in enumerate(observations):
        known[:] = names[: max(len(known), int(seen.vehicle.max(initial=-1)) + 1)]
        near = np.full(len(seen.x), 5.0)
        values = CarValues(near, np.zeros((len(near), 5)), 5.0 + sample, 0 if len(near) else NOBODY)
        recorder.record(seen, values, Plan(IDLE, Target(1, 24.0)), CONTROL, FilterDecision(CONTROL), 0.01)
    return recorder.finish("duration")


@pytest.fixture
def small_memory(monkeypatch):
    monkeypatch.setattr("hj_cosim.recording.spilled.MOST_IN_MEMORY", 1000)
    monkeypatch.setattr("hj_cosim.recording.traffic_recorder.ROWS_PER_STRETCH", 200)


@pytest.fixture
def both(tmp_path, request):
    """Return the same drive recorded in memory, and in a file."""
    held = recorded(*coming_and_going(), tmp_path / "held")
    request.getfixturevalue("small_memory")
    return held, recorded(*coming_and_going(), tmp_path / "spilled")


def assert_same_tracks(one, other):
    np.testing.assert_array_equal(one.present, other.present)
    for field in fields(one):
        a, b = getattr(one, field.name), getattr(other, field.name)
        if isinstance(a, np.ndarray) and a.ndim == 2:
            np.testing.assert_array_equal(a[one.present], b[one.present], err_msg=field.name)
        else:
            assert np.array_equal(a, b), field.name


def test_what_is_spilled_is_what_would_have_been_in_memory(both):
    held, spilled = both
    assert type(held.traffic) is not SpilledTraffic
    assert type(spilled.traffic) is SpilledTraffic
    assert_same_tracks(held.traffic, spilled.traffic)
    np.testing.assert_array_equal(held.time, spilled.time)
    for field in fields(held.robot):
        np.testing.assert_array_equal(getattr(held.robot, field.name), getattr(spilled.robot, field.name))
    # Independently: what was seen, sample by sample.
    for sample, seen in enumerate(coming_and_going()[0]):
        order = np.argsort(seen.vehicle)
        back = spilled.observation(sample)
        np.testing.assert_array_equal(back.vehicle, seen.vehicle[order])
        np.testing.assert_array_equal(back.x, seen.x[order])
        np.testing.assert_array_equal(back.length, seen.length[order])


def test_every_metric_is_the_same_from_memory_and_from_the_file(both):
    held, spilled = both
    config = EpisodeConfig(scenario=Scenario(name="made up"))
    numbers = [summarize(record, config) for record in both]
    assert numbers[0] == numbers[1]
    assert numbers[0]["hard_brakes_imposed"] > 2
    collisions = [find_collisions(record, config.filter.rss) for record in both]
    assert collisions[0] == collisions[1]
    assert [each.car for each in collisions[0]] == [0, 29]
    for field in fields(held.threats):
        np.testing.assert_array_equal(getattr(held.threats, field.name), getattr(spilled.threats, field.name))


def test_a_sample_and_a_car_are_read_alone(both):
    held, spilled = both
    for sample in (0, 7, 200, 399):
        assert_same_tracks(held.traffic.at(sample).traffic, spilled.traffic.at(sample).traffic)
        np.testing.assert_array_equal(held.traffic.at(sample).cars, spilled.traffic.at(sample).cars)
    for car in (0, 17, 29):
        assert_same_tracks(held.traffic.of(car), spilled.traffic.of(car))


def test_the_files_rows_are_the_same_and_it_is_read_back(both, tmp_path):
    summary = summarize(both[0], EpisodeConfig(scenario=Scenario(name="made up")))
    for name, record in zip(("held", "spilled"), both, strict=True):
        write_run(tmp_path / name, record, 'seed = 1\n[scenario]\nname = "made up"\n', summary)
    rows = [pd.read_parquet(tmp_path / name / "trajectories.parquet") for name in ("held", "spilled")]
    for table in rows:
        table["vehicle"] = table["vehicle"].astype(str)
    pd.testing.assert_frame_equal(*rows)
    back = read_run(tmp_path / "spilled").record  # in memory or not
    assert type(back.traffic) is SpilledTraffic
    assert_same_tracks(both[0].traffic, back.traffic)
    np.testing.assert_array_equal(back.robot.value_vehicle, both[0].robot.value_vehicle)
    # It is still there after it was moved, and for a second folder, and nothing else is left lying about.
    assert_same_tracks(both[0].traffic, both[1].traffic)
    write_run(tmp_path / "again", both[1], "", summary)
    assert (tmp_path / "again" / "trajectories.parquet").read_bytes() == (
        tmp_path / "spilled" / "trajectories.parquet"
    ).read_bytes()
    assert {path.name for path in tmp_path.iterdir()} == {"held", "spilled", "again"}


def test_a_file_that_is_not_taken_is_gone_with_its_record(tmp_path, small_memory):
    record = recorded(*coming_and_going(), tmp_path / "run")
    assert [path.name.startswith(".run.hj-cosim-unfinished") for path in tmp_path.iterdir()] == [True]
    del record
    assert list(tmp_path.iterdir()) == []


def test_of_a_drive_that_fails_nothing_is_left(tmp_path, small_memory, recwarn):
    recorder = Recorder(SCENE, lambda: [f"car{number}" for number in range(30)], RobotSettings(), 400, tmp_path / "run")
    for seen in coming_and_going()[0]:
        values = CarValues(np.empty(0), np.empty((0, 5)), 5.0, NOBODY)
        recorder.record(seen, values, Plan(IDLE, Target(1, 24.0)), CONTROL, FilterDecision(CONTROL), 0.01)
    assert len(list(tmp_path.iterdir())) == 1
    del recorder
    assert list(tmp_path.iterdir()) == []
    assert not recwarn.list


def test_a_disk_that_is_full_is_told_in_a_sentence(tmp_path, small_memory):
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, limits[1]))
    try:
        with pytest.raises(HjCosimError, match=r"cannot write .*run: File too large; choose another place or free it"):
            recorded(*coming_and_going(), tmp_path / "run")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert list(tmp_path.iterdir()) == []


def test_what_is_in_memory_does_not_grow_with_the_drive(tmp_path, small_memory):
    observations, names = coming_and_going()
    known: list[str] = []
    recorder = Recorder(SCENE, lambda: known, RobotSettings(), len(observations), tmp_path / "run")
    held = []
    for seen in observations:
        known[:] = names[: max(len(known), int(seen.vehicle.max(initial=-1)) + 1)]
        values = CarValues(np.empty(0), np.empty((0, 5)), 5.0, NOBODY)
        recorder.record(seen, values, Plan(IDLE, Target(1, 24.0)), CONTROL, FilterDecision(CONTROL), 0.01)
        cars = recorder._cars
        in_stretches = (len(each.x) for stretch in cars._stretches for each in stretch)
        held.append(cars._pending_rows + sum(in_stretches))
    assert max(held[len(held) // 2 :]) <= 230
    assert max(held) <= 1000 + 230


def test_of_those_far_away_nothing_is_recorded_if_that_is_asked_for(tmp_path):
    observations, names = coming_and_going()
    record = recorded(observations, names, tmp_path / "run", within=80.0)
    for sample, seen in enumerate(observations):
        distance = np.hypot(seen.x - seen.robot[0], seen.y - seen.robot[1])
        np.testing.assert_array_equal(
            np.flatnonzero(record.traffic.present[sample]), np.sort(seen.vehicle[distance <= 80.0])
        )
