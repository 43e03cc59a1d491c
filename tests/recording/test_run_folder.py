import json
from dataclasses import fields, replace

import numpy as np
import pandas as pd
import pytest
from bent_roads import circle

from hj_cosim.errors import RunFolderError
from hj_cosim.recording.run_folder import read_run, require_free_folder, write_run
from hj_cosim.scene.road import StraightRoad
from hj_cosim.scene.road_text import road_to_json

TRAJECTORY_COLUMNS = [
    "time",
    "vehicle",
    "x",
    "y",
    "heading",
    "speed",
    "acceleration",
    "lane",
    "length",
    "width",
]
ROBOT_COLUMNS = [
    "time",
    "x",
    "y",
    "heading",
    "speed",
    "steering",
    "omega",
    "acceleration",
    "omega_desired",
    "acceleration_desired",
    "action",
    "plan_speed",
    "plan_lane",
    "value",
    "value_vehicle",
    "constraints",
    "intervening",
    "slack",
    "ttc",
    "btn",
    "stn",
    "min_gap",
    "collision",
    "ttc_2d",
]
CONFIG = '[scenario]\nname = "synthetic"\n'
STACK = {"planner": "hjop", "filter": "spc", "scheme": "mi"}
SUMMARY = {**STACK, "scenario": "synthetic", "seed": 3, "ttc_p10": float("inf"), "collisions": 0}


def assert_same(left, right) -> None:
    for field in fields(left):
        a, b = getattr(left, field.name), getattr(right, field.name)
        if isinstance(a, np.ndarray):
            np.testing.assert_array_equal(a, b, err_msg=field.name)
        elif not hasattr(a, "__dataclass_fields__") or isinstance(a, StraightRoad):
            assert a == b, field.name
        else:
            assert_same(a, b)


def only_present(record):
    """Return the record with zeros where a car is not present: there the arrays mean nothing."""
    traffic = record.traffic
    arrays = {
        name: np.where(traffic.present, getattr(traffic, name), 0)
        for name in ("x", "y", "heading", "speed", "acceleration", "lane")
    }
    return replace(record, traffic=replace(traffic, **arrays))


def test_a_run_reads_back_as_it_was_written(tmp_path, make_record):
    record = only_present(make_record(road=StraightRoad(lane_count=4, lane_width=3.5, origin_x=12.5, heading=0.3)))

    write_run(tmp_path / "run", record, 'seed = 3\n[scenario]\nname = "mine"\n', SUMMARY)
    run = read_run(tmp_path / "run")

    assert_same(run.record, record)
    assert (run.config["seed"], run.config["scenario"]["name"]) == (3, "mine")
    assert run.summary == {**SUMMARY, "ttc_p10": None}


def test_many_row_groups_hold_the_same_rows_as_one(tmp_path, record, monkeypatch):
    write_run(tmp_path / "one", record, CONFIG, SUMMARY)
    monkeypatch.setattr("hj_cosim.recording.trajectories.ROWS_PER_GROUP", 100)
    write_run(tmp_path / "many", record, CONFIG, SUMMARY)

    one, many = (pd.read_parquet(tmp_path / name / "trajectories.parquet") for name in ("one", "many"))
    pd.testing.assert_frame_equal(one, many)
    assert_same(read_run(tmp_path / "one").record, read_run(tmp_path / "many").record)


def test_columns_and_rows_are_those_of_the_specification(tmp_path, record):
    write_run(tmp_path / "run", record, "", SUMMARY)
    cars = pd.read_parquet(tmp_path / "run" / "trajectories.parquet")
    robot = pd.read_parquet(tmp_path / "run" / "robot.parquet")

    assert list(cars.columns) == TRAJECTORY_COLUMNS
    assert list(robot.columns) == ROBOT_COLUMNS
    assert len(cars) == len(record.time) + np.count_nonzero(record.traffic.present)
    assert len(robot) == len(record.time)
    order = [
        (time, -1 if name == "robot" else int(name[3:])) for time, name in zip(cars.time, cars.vehicle, strict=True)
    ]
    assert order == sorted(order)
    one = cars[(cars.vehicle == "car0")]
    np.testing.assert_array_equal(one.x, record.traffic.x[:, 0])
    own = cars[cars.vehicle == "robot"]
    np.testing.assert_array_equal(own.x, robot.x)
    assert set(own.lane) == {1}
    assert robot.value_vehicle.isna().tolist() == np.isinf(robot.value).tolist()


def test_the_same_record_gives_the_same_bytes(tmp_path, make_record):
    for name in ("a", "b"):
        write_run(tmp_path / name, make_record(seed=4), "", SUMMARY)
    write_run(tmp_path / "c", make_record(seed=5), "", SUMMARY)

    for file in ("trajectories.parquet", "robot.parquet", "summary.json"):
        content = [(tmp_path / name / file).read_bytes() for name in "abc"]
        assert content[0] == content[1]
        assert file == "summary.json" or content[0] != content[2]


def test_a_folder_that_holds_a_run_is_refused_and_left_alone(tmp_path, record):
    write_run(tmp_path / "run", record, "seed = 1\n", SUMMARY)

    with pytest.raises(RunFolderError, match="already holds a run; choose another --out"):
        write_run(tmp_path / "run", record, "seed = 2\n", SUMMARY)

    assert (tmp_path / "run" / "config.toml").read_text() == "seed = 1\n"
    assert [path.name for path in tmp_path.iterdir()] == ["run"]


def test_an_empty_folder_is_taken_and_a_file_is_refused(tmp_path, record):
    (tmp_path / "empty").mkdir()
    write_run(tmp_path / "empty", record, "", SUMMARY)
    assert json.loads((tmp_path / "empty" / "summary.json").read_text())["planner"] == "hjop"
    (tmp_path / "file").write_text("")
    with pytest.raises(RunFolderError, match="is a file"):
        require_free_folder(tmp_path / "file")


def test_nothing_is_left_when_writing_fails(tmp_path, record):
    with pytest.raises(TypeError):
        write_run(tmp_path / "run", record, "", {"planner": object()})
    assert list(tmp_path.iterdir()) == []


def test_what_is_no_run_is_refused_in_one_sentence(tmp_path, record):
    with pytest.raises(RunFolderError, match="is not a folder"):
        read_run(tmp_path / "nowhere")
    with pytest.raises(RunFolderError, match=r"config\.toml is missing"):
        read_run(tmp_path)
    write_run(tmp_path / "run", record, CONFIG, SUMMARY)
    for name in ("robot.parquet", "trajectories.parquet", "summary.json"):
        path = tmp_path / "run" / name
        whole = path.read_bytes()
        path.unlink()
        with pytest.raises(RunFolderError, match=f"no complete run: {name} is missing"):
            read_run(tmp_path / "run")
        path.write_bytes(whole[: len(whole) // 2])
        with pytest.raises(RunFolderError, match="no readable run"):
            read_run(tmp_path / "run")
        path.write_bytes(whole)


def test_drivers_are_kept_by_name(tmp_path, record):
    drivers = np.arange(6.0 * 12).reshape(12, 6)
    write_run(tmp_path / "run", record, "", SUMMARY, drivers)
    written = pd.read_parquet(tmp_path / "run" / "drivers.parquet")
    assert written.vehicle.tolist() == list(record.traffic.names)
    np.testing.assert_array_equal(written.drop(columns="vehicle").to_numpy(), drivers)
    assert list(written.columns[1:3]) == ["desired_speed", "max_acceleration"]


def test_a_drive_on_a_bend_is_read_back_with_its_road(make_record, tmp_path):
    road = circle(300.0)
    write_run(tmp_path / "run", make_record(road=road), 'seed = 3\n[scenario]\nname = "mine"\n', SUMMARY)
    assert road_to_json(read_run(tmp_path / "run").record.road) == road_to_json(road)


def test_who_means_harm_is_a_column_where_anybody_does(tmp_path, record):
    rogues = {record.traffic.names[2]: "cut_in", record.traffic.names[0]: "Weave"}
    write_run(tmp_path / "some", replace(record, rogues=rogues), CONFIG, SUMMARY)
    rows = pd.read_parquet(tmp_path / "some" / "trajectories.parquet")
    assert list(rows.columns) == [*TRAJECTORY_COLUMNS, "role"]
    roles = rows.groupby("vehicle", observed=True).role.unique()
    assert all(len(role) == 1 for role in roles)
    said = {name: role[0] for name, role in roles.items()}
    assert said.pop("robot") == "robot"
    assert said == {name: rogues.get(name, "driver") for name in said}
    back = read_run(tmp_path / "some").record
    assert back.rogues == {name: what for name, what in rogues.items() if name in said}
    assert back.is_rogue.sum() == len(back.rogues) == 2


def test_nobody_means_harm_where_the_column_is_not_there(tmp_path, record):
    write_run(tmp_path / "none", record, CONFIG, SUMMARY)
    assert read_run(tmp_path / "none").record.rogues == {}


def test_what_was_believed_of_each_driver_is_a_column_where_anybody_judged(tmp_path, record):
    belief = np.random.default_rng(3).uniform(size=record.traffic.x.shape)
    belief[:4] = np.nan  # nobody judged yet
    write_run(tmp_path / "some", replace(record, belief=belief), CONFIG, SUMMARY)
    rows = pd.read_parquet(tmp_path / "some" / "trajectories.parquet")
    assert list(rows.columns) == [*TRAJECTORY_COLUMNS, "belief"]
    assert rows[rows.vehicle == "robot"].belief.isna().all()
    back, present = read_run(tmp_path / "some").record.belief, record.traffic.present
    np.testing.assert_array_equal(back[present], belief[present])
    assert np.isnan(back[~present]).all()
    write_run(tmp_path / "none", record, CONFIG, SUMMARY)
    assert read_run(tmp_path / "none").record.belief is None


def test_a_belief_that_is_no_probability_is_refused(tmp_path, record):
    write_run(tmp_path / "run", replace(record, belief=np.full(record.traffic.x.shape, 1.5)), CONFIG, SUMMARY)
    with pytest.raises(RunFolderError, match="column belief has what is no probability"):
        read_run(tmp_path / "run")
