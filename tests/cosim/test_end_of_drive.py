"""A drive that is over before its time keeps what it drove and says why; cars may come while it lasts."""

import json

import numpy as np
import pandas as pd
import pytest

from hj_cosim.control.catalogue import make_filter
from hj_cosim.cosim.configuration import resolve_config
from hj_cosim.cosim.episode import drive
from hj_cosim.errors import DriveEnded
from hj_cosim.planning.idle import IdlePlanner
from hj_cosim.recording.run_folder import read_run, write_run
from hj_cosim.scene.road import StraightRoad
from hj_cosim.settings import CarStart
from hj_cosim.traffic.fake import FakeWorld

STRAIGHT_ON = ("planner.kind=idle", "filter.kind=none")


def drive_idly(world, table, *settings):
    config = resolve_config("paper", assignments=[*STRAIGHT_ON, *settings])
    safety_filter = make_filter(config.filter, config.robot, world.road, table, config.simulation.step)
    return drive(world, IdlePlanner(), safety_filter, table, config).record


@pytest.fixture
def short_road(tmp_path):
    """Return a scenario on a road of 300 m, of which the robot at 24 m/s has some 245 m before it."""
    lanes = "".join(
        f'<lane id="highway_{lane}" index="{lane}" speed="60" length="300" width="4"'
        f' shape="0,{4 * lane} 300,{4 * lane}"/>'
        for lane in range(3)
    )
    (tmp_path / "short.net.xml").write_text(
        '<net version="1.20"><location netOffset="0,0" convBoundary="0,0,1,1" origBoundary="0,0,1,1"'
        f' projParameter="!"/><edge id="highway" from="a" to="b" priority="1">{lanes}</edge>'
        '<junction id="a" type="dead_end" x="0" y="0" incLanes="" intLanes="" shape="0,0 0,1"/>'
        '<junction id="b" type="dead_end" x="300" y="0" incLanes="" intLanes="" shape="300,0 300,1"/></net>'
    )
    scenario = tmp_path / "short.toml"
    scenario.write_text(
        '[network]\nfile = "short.net.xml"\n[traffic]\ncount = 0\n[robot]\nspeed = 24.0\n'
        "[[cars]]\nlane = 0\nx = 60.0\nspeed = 24.0\n"
    )
    return scenario


def test_a_drive_to_the_end_of_the_road_in_sumo_is_written_with_the_reason(call, short_road, small_specification):
    out = short_road.parent / "run"
    options = [part for setting in STRAIGHT_ON for part in ("--set", setting)]
    options += ["--table", small_specification, "--no-figures"]
    status, said, _ = call("run", short_road, "--out", out, *options)
    assert status == 0
    assert "end of the road" in said
    summary = json.loads((out / "summary.json").read_text())
    robot = pd.read_parquet(out / "robot.parquet")
    assert summary["ended"] == "end of the road"
    assert summary["samples"] == len(robot)
    assert summary["duration"] == pytest.approx(0.02 * len(robot))
    front = robot["x"].iloc[-1] + 2.5
    assert front <= 300.0 < front + 24.0 * 0.02 + 1e-6
    cars = pd.read_parquet(out / "trajectories.parquet")
    assert set(cars["vehicle"]) == {"robot", "car_0"}
    assert cars.loc[cars["vehicle"] == "car_0", "time"].max() < robot["time"].iloc[-1] - 1.0  # it left before
    assert read_run(out).record.ended == "end of the road"


def test_a_road_that_ends_while_the_traffic_settles_is_an_error_in_a_sentence(
    call, short_road, small_specification, tmp_path
):
    text = short_road.read_text().replace("count = 0", "count = 1\nspeed_low = 5.0\nspeed_high = 6.0\ndensity = 5.0")
    short_road.write_text(text.split("[[cars]]")[0])
    arguments = ("--set", "simulation.settle_time=60", "--table", small_specification, "--out", tmp_path / "run")
    status, _, said = call("run", short_road, *arguments)
    assert status == 2
    assert "the robot reached the end of the road (300 m) after" in said
    assert not (tmp_path / "run").exists()


def test_a_drive_says_whether_it_ended_by_its_duration_or_a_collision(small_table):
    record = drive_idly(FakeWorld(), small_table, "simulation.duration=1")
    assert (record.ended, len(record.time)) == ("duration", 50)
    wall = [CarStart(lane=1, x=20.0, speed=0.0)]
    assert drive_idly(FakeWorld(wall), small_table, "simulation.duration=3").ended == "collision"
    driven_on = drive_idly(FakeWorld(wall), small_table, "simulation.duration=1", "simulation.on_collision=continue")
    assert (driven_on.ended, len(driven_on.time)) == ("duration", 50)


def test_a_world_that_ended_the_drive_still_tells_how_it_was_before():
    world = FakeWorld([CarStart(lane=0, x=2.0, speed=20.0)], road=StraightRoad(4, length=10.0))
    before = world.observe()
    with pytest.raises(DriveEnded, match=r"end of the road \(10 m\) after 0\.00 s") as ended:
        world.step(np.array([7.6, 4.0, 0.0, 24.0]), 0.0)
    assert ended.value.reason == "end of the road"
    after = world.observe()
    assert (after.time, after.robot.tolist(), after.x.tolist()) == (before.time, before.robot.tolist(), [2.0])


def test_cars_that_enter_and_leave_during_a_drive_are_recorded_while_they_are_there(small_table, tmp_path):
    late = [(0.5 + 0.1 * number, CarStart(lane=number % 2 * 3, x=40.0, speed=30.0)) for number in range(7)]
    world = FakeWorld([CarStart(lane=0, x=100.0, speed=20.0)], road=StraightRoad(4, length=150.0), late=late)
    record = drive_idly(world, small_table, "simulation.duration=4")
    traffic = record.traffic
    assert traffic.names == tuple(f"car_{number}" for number in range(8))
    assert traffic.x.shape == (len(record.time), 8)
    assert traffic.present[:, 0].tolist() == (100.0 + 20.0 * record.time + 2.5 <= 150.0).tolist()
    for number, (time, car) in enumerate(late, start=1):
        there = np.flatnonzero(traffic.present[:, number])
        assert record.time[there[0]] == pytest.approx(time, abs=0.021)
        assert traffic.x[there[0], number] == pytest.approx(record.robot.x[there[0]] + car.x, abs=0.6)
        np.testing.assert_allclose(np.diff(traffic.x[there, number]), 30.0 * 0.02)
        assert (traffic.length[number], traffic.width[number]) == (5.0, 2.0)
        assert (traffic.lane[there, number] == car.lane).all()
    write_run(
        tmp_path / "run",
        record,
        "[scenario]\nname = 'x'\n",
        {
            "scenario": "x",
            "planner": "idle",
            "filter": "none",
            "scheme": "mi",
            "seed": 0,
        },
        world.drivers,
    )
    read = read_run(tmp_path / "run").record.traffic
    assert read.names == traffic.names
    np.testing.assert_array_equal(read.present, traffic.present)
    drivers = pd.read_parquet(tmp_path / "run" / "drivers.parquet")
    assert drivers["desired_speed"].isna().tolist() == [False] + 7 * [True]
