import csv
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from PIL import Image

from hj_cosim.analysis.figures.attack import BEHAVIOUR, SHARE, attack
from hj_cosim.analysis.figures.catalogue import FIGURES
from hj_cosim.analysis.figures.control_sets import _message, control_sets
from hj_cosim.analysis.figures.gallery import draw_figure
from hj_cosim.analysis.figures.highway import highway
from hj_cosim.analysis.figures.planner_comparison import SQUEEZE, planner_comparison
from hj_cosim.analysis.figures.schematic import BOXED_IN, boxed_in
from hj_cosim.analysis.figures.side_by_side import side_by_side
from hj_cosim.analysis.figures.snapshots import SNAPSHOTS, snapshots
from hj_cosim.analysis.figures.style import PAGE, Drawing, columns_of, save_drawing
from hj_cosim.analysis.figures.sweep import density_sweep
from hj_cosim.analysis.figures.target_sets import target_sets
from hj_cosim.analysis.figures.timeline import timeline
from hj_cosim.analysis.figures.trade_off import trade_off
from hj_cosim.analysis.figures.value_along_drive import value_along_drive
from hj_cosim.analysis.figures.value_slice import value_slice
from hj_cosim.errors import HjCosimError, OutputError
from hj_cosim.recording.run_folder import Run
from hj_cosim.scene.observation import Control
from hj_cosim.settings import PlannerSettings

STACKS = [("hjop", "spc", "mi"), ("op", "rss", "sw"), ("op", "none", "-")]


@pytest.fixture
def run(record, config, tmp_path) -> Run:
    return Run(tmp_path, config.model_dump(mode="json"), {}, record)


def test_the_timeline_holds_the_record(run):
    data = timeline(run).data
    np.testing.assert_array_equal(data.speed, run.record.robot.speed)
    np.testing.assert_array_equal(data.ttc, run.record.threats.ttc)
    np.testing.assert_array_equal(data.lane_position * 4.0, run.record.robot.y)


def test_the_data_of_a_figure_are_read_back_from_its_csv_digit_for_digit(run, tmp_path):
    drawing = timeline(run)
    run.record.threats.ttc[3], run.record.robot.value[4] = np.nan, np.inf
    save_drawing(drawing, tmp_path / "timeline.csv")
    with (tmp_path / "timeline.csv").open(newline="") as file:
        written = list(csv.DictReader(file))
    assert list(written[0]) == list(drawing.data)
    for name in ("time", "speed", "value", "ttc", "plan_lane"):
        np.testing.assert_array_equal([float(row[name] or "nan") for row in written], drawing.data[name])
    assert [row["intervening"] == "True" for row in written] == drawing.data.intervening.tolist()
    rows = [{"name": "a, b", "value": 1.0}, {"name": 'c"d'}]
    save_drawing(Drawing(drawing.figure, columns_of(rows)), tmp_path / "rows.csv")
    assert (tmp_path / "rows.csv").read_text() == 'name,value\n"a, b",1.0\n"c""d",\n'


def test_the_snapshots_span_the_drive_and_show_only_cars_in_view(run):
    data = snapshots(run).data
    assert data.time.nunique() == SNAPSHOTS
    assert (data.time.min(), data.time.max()) == (0.0, run.record.time[-1])
    robot = data[data.vehicle == "robot"].set_index("time").x
    assert (np.abs(data.x - data.time.map(robot)) < 115.0).all()


def test_snapshots_ring_each_car_as_opaquely_as_its_driver_is_believed_to_mean_harm(run):
    belief = np.full(run.record.traffic.x.shape, 0.25)
    drawn = snapshots(replace(run, record=replace(run.record, belief=belief))).figure.axes[0]
    rings = [
        found for found in drawn.collections if (found.get_edgecolor()[:, 3] == 0.25).all() and len(found.get_paths())
    ]
    assert len(rings) == 1
    assert len(rings[0].get_paths()) == (snapshots(run).data.query("time == 0 and vehicle != 'robot'").shape[0])
    assert all(len(found.get_edgecolor()) <= 1 for found in snapshots(run).figure.axes[0].collections)


def test_the_highway_shows_the_moment_of_the_least_value(run, table):
    data = highway(run, table).data
    least = run.record.robot.value.argmin()
    assert set(data.time) == {run.record.time[least]}
    cars = data[data.vehicle != "robot"]
    robot = data[data.vehicle == "robot"].iloc[0]
    states = np.column_stack(
        [
            robot.x - cars.x,
            robot.y - cars.y,
            np.full(len(cars), robot.heading),
            np.full(len(cars), robot.speed),
            cars.speed,
        ]
    )
    np.testing.assert_allclose(cars.value, table.value(states), rtol=1e-5)


def test_the_slice_is_the_table_s_value(table):
    data = value_slice(table).data.sample(50, random_state=1)
    states = np.column_stack([data.p_x, data.p_y, np.zeros(50), np.full(50, 10.0), np.full(50, 20.0)])
    np.testing.assert_allclose(data.value, table.value(states))


def test_the_boxed_in_robot_is_where_the_field_is_its_own_value(table):
    data = boxed_in(table).data
    field = data[data.vehicle == ""]
    here = field[(field.x.abs() < 1e-9) & ((field.y - BOXED_IN.robot[1]).abs() < 1e-9)]
    assert here.value.iloc[0] == pytest.approx(BOXED_IN.values(table).min())


def test_values_along_the_drive_are_the_nearby_cars(run, table):
    data = value_along_drive(run, table).data
    assert (data.p_x.abs() <= 80.0).all()
    assert np.isfinite(data.value).all()
    assert set(data.vehicle) <= set(run.record.traffic.names)


def test_plans_of_both_planners_start_where_the_last_step_led(table):
    data = planner_comparison(table, PlannerSettings(expansions=40)).data
    assert set(data.planner) == {"OP", "HJOP"}
    for _, rows in data[data.vehicle == "robot"].groupby("planner"):
        now, ahead = rows[rows.ahead == 0].set_index("time"), rows[rows.ahead == 1].set_index("time")
        np.testing.assert_allclose(now.x.iloc[1:], ahead.x.iloc[:-1])


def test_the_planner_comparison_has_the_cars_where_they_are_expected_when_the_robot_gets_there(table):
    drawing = planner_comparison(table, PlannerSettings(expansions=40))
    data = drawing.data[(drawing.data.planner == "HJOP") & (drawing.data.time == 0.0)]
    cars = data[data.vehicle != "robot"].pivot(index="vehicle", columns="ahead", values="x")
    speeds = data[(data.vehicle != "robot") & (data.ahead == 0)].set_index("vehicle").speed
    assert len(cars) == len(SQUEEZE.x)
    assert (cars[1] > cars[0]).all()
    assert ((cars[2] - cars[0]) / speeds).between(1.5, 2.2).all()  # 2 s on, at most braking gently
    axes = next(axes for axes in drawing.figure.axes if axes.get_title(loc="left").startswith("HJOP, t = 0 s"))
    outlines = {round(float(patch.get_xy()[:4, 0].mean()), 3) for patch in axes.patches[1:]}  # the first is the road
    assert outlines >= {round(float(x), 3) for x in cars[2]}


def test_chosen_controls_meet_their_half_planes_up_to_the_slack(run, table):
    data = control_sets(run, table).data
    assert set(data["filter"]) == {"spc", "rss"}
    rows = data.dropna(subset=["p"]) if "p" in data else data.iloc[:0]
    margin = rows.p * rows.omega + rows.q * rows.acceleration + rows.c + rows.slack
    assert len(rows) > 0
    assert (margin > -1e-4).all()


def test_the_trade_off_has_every_stack_and_its_intervals_of_speed_and_2d_ttc():
    table = pd.DataFrame(
        {"planner": p, "filter": f, "scheme": s, "mean_speed": 20.0 + n, "ttc_2d_p1": 3.0 - n}
        | {"mean_speed_lo": 19.5 + n, "mean_speed_hi": 20.2 + n, "ttc_2d_p1_lo": 2.9 - n, "ttc_2d_p1_hi": 3.4 - n}
        for n, (p, f, s) in enumerate(STACKS)
    )
    drawing = trade_off(table)
    axes = drawing.figure.axes[0]
    assert [text.get_text() for text in drawing.figure.legends[0].get_texts()] == [
        "HJOP + SPC + MI",
        "OP + RSS + SW",
        "OP + None",
    ]
    assert len(axes.containers) == len(STACKS)
    for n, bars in enumerate(axes.containers):
        across, upright = (lines.get_segments()[0] for lines in bars.lines[2])
        np.testing.assert_allclose(across, [[19.5 + n, 3.0 - n], [20.2 + n, 3.0 - n]])
        np.testing.assert_allclose(upright, [[20.0 + n, 2.9 - n], [20.0 + n, 3.4 - n]])
    assert len(drawing.data) == len(STACKS)


def test_the_title_of_control_sets_says_that_sw_does_not_leave_a_control_that_meets_all():
    met = SimpleNamespace(
        desired=Control(0.1, 0.0), rows=SimpleNamespace(p=np.array([1.0]), q=np.array([1.0]), c=np.array([0.0]))
    )
    results = {(kind, scheme): met for kind in ("spc", "rss") for scheme in ("mi", "sw")}
    assert "MI leaves it; SW takes the safest" in _message(results, "t = 1 s")


def test_the_density_sweep_goes_from_light_to_dense():
    metrics = ("mean_speed", "ttc_2d_p1", "intervention_percent", "mean_abs_acceleration")
    table = pd.DataFrame(
        {"scenario": scenario, "planner": p, "filter": f, "scheme": s}
        | {f"{metric}{end}": 1.0 for metric in metrics for end in ("", "_lo", "_hi")}
        for scenario in ("paper", "light")
        for p, f, s in STACKS
    )
    data = density_sweep(table, {"light": 6.0, "paper": 13.0}).data
    assert data.scenario.tolist() == ["light"] * 3 + ["paper"] * 3


def test_traffic_of_one_density_stands_side_by_side_and_is_not_joined():
    metrics = ("mean_speed", "ttc_2d_p1", "intervention_percent", "mean_abs_acceleration")
    table = pd.DataFrame(
        {"scenario": scenario, "planner": "hjop", "filter": "spc", "scheme": "mi"}
        | {f"{metric}{end}": speed for metric in metrics for end in ("", "_lo", "_hi")}
        for scenario, speed in (("ring", 22.0), ("dense", 16.0), ("curves", 21.0))
    )
    drawing = density_sweep(table, {"ring": 13.0, "dense": 27.0, "curves": 13.0})
    assert drawing.data.scenario.tolist() == ["ring", "curves", "dense"]
    axes = drawing.figure.axes[0]
    (points,) = [bars.lines[0] for bars in axes.containers]
    assert points.get_linestyle() == "None"
    assert points.get_ydata().tolist() == [22.0, 21.0, 16.0]
    assert [label.get_text() for label in drawing.figure.axes[-1].get_xticklabels()] == ["ring", "curves", "dense"]


def test_the_attack_has_a_column_of_panels_for_each_behaviour_and_shares_in_order():
    metrics = ("collisions", "collisions_responsible", "mean_speed")
    table = pd.DataFrame(
        {BEHAVIOUR: behaviour, SHARE: share, "planner": p, "filter": f, "scheme": s, "episodes": 3}
        | {f"{metric}{end}": share for metric in metrics for end in ("", "_lo", "_hi")}
        for behaviour in ("cut_in", "worst")
        for share in (0.2, 0.05)
        for p, f, s in STACKS
    )
    drawing = attack(table)
    panels = np.array(drawing.figure.axes).reshape(3, 2)
    assert [axes.get_title(loc="left") for axes in panels[0]] == ["cut_in", "worst"]
    for axes in panels.flat:
        lines = [bars.lines[0] for bars in axes.containers]
        assert len(lines) == len(STACKS)
        assert all(line.get_xdata().tolist() == [5.0, 20.0] for line in lines)
    # Collisions, 0.05 and 0.2 in three drives, are those of one drive; speeds are as they are.
    of_collisions, of_speed = (panels[row, 0].containers[0].lines[0].get_ydata() for row in (0, 2))
    assert of_collisions == pytest.approx([0.05 / 3, 0.2 / 3])
    assert of_speed == pytest.approx([0.05, 0.2])
    assert drawing.data.collisions_hi.tolist() == pytest.approx((table.collisions_hi / 3).tolist())
    assert table.collisions_hi.tolist() == table.mean_speed.tolist()  # what is handed over is left alone
    assert len(drawing.data) == len(table)


def test_target_sets_have_a_panel_for_each_traffic_and_every_table_in_each():
    table = pd.DataFrame(
        {"scenario": scenario, "table": name, "planner": "hjop", "filter": "spc", "scheme": "mi"}
        | {f"mean_speed{end}": 20.0 + place for end, place in (("", 0.0), ("_lo", -1.0), ("_hi", 2.0))}
        | {f"ttc_2d_p1{end}": 4.0 + place for end, place in (("", 0.0), ("_lo", -0.5), ("_hi", 0.5))}
        for scenario in ("light", "jam")
        for name in ("highway", "highway_ttc")
    )
    drawing = target_sets(table)
    light, jam = drawing.figure.axes
    assert [axes.get_title(loc="left") for axes in (light, jam)] == ["light", "jam"]
    assert light.get_legend_handles_labels()[1] == ["highway", "highway_ttc"]
    bars = light.containers[0].lines[2]
    assert [bar.get_segments()[0].tolist() for bar in bars] == [[[19.0, 4.0], [22.0, 4.0]], [[20.0, 3.5], [20.0, 4.5]]]
    assert drawing.data.shape == (4, 8)


def test_a_drawing_is_saved_as_raster_vector_and_table_and_the_same_each_time(run, tmp_path):
    paths = save_drawing(timeline(run), tmp_path / "figures" / "timeline")
    again = save_drawing(timeline(run), tmp_path / "again.pdf")

    assert [path.suffix for path in paths] == [".png", ".pdf", ".csv"]
    with Image.open(paths[0]) as image:
        assert min(image.size) > 500
    assert paths[1].read_bytes().startswith(b"%PDF")
    assert len(pd.read_csv(paths[2])) == len(run.record.time)
    assert paths[1].read_bytes() == again[0].read_bytes()


def test_what_cannot_be_drawn_is_named(run, tmp_path, table):
    with pytest.raises(OutputError, match="no figure is called 'pie'; choose one of schematic"):
        draw_figure("pie")
    with pytest.raises(OutputError, match="--run"):
        draw_figure("timeline")
    with pytest.raises(OutputError, match="--study"):
        draw_figure("trade-off")
    with pytest.raises(HjCosimError, match="holds no complete study"):
        draw_figure("trade-off", study=Path(tmp_path))
    with pytest.raises(OutputError, match=r"ends in \.png"):
        save_drawing(timeline(run), tmp_path / "timeline.bmp")
    assert set(FIGURES) >= {"schematic", "boxed-in", "highway", "value-slice", "trade-off", "planner-comparison"}


def test_a_picture_takes_the_place_of_nothing_that_a_study_found(run, tmp_path):
    (tmp_path / "study.toml").write_text("")
    (tmp_path / "table.csv").write_text("found")
    for name in ("table.csv", "table"):  # without a suffix its columns are saved under it, too
        with pytest.raises(HjCosimError, match="belongs to the study in"):
            save_drawing(timeline(run), tmp_path / name)
    assert {each.name for each in tmp_path.iterdir()} == {"study.toml", "table.csv"}
    assert (tmp_path / "table.csv").read_text() == "found"


@pytest.mark.parametrize(("slower", "message"), [(0.0, "Mean speed is 2"), (1.0, "one is fastest, at 2")])
def test_drives_that_meet_nobody_are_drawn_side_by_side_and_say_so(run, slower, message):
    run.record.robot.value[:] = np.inf
    other = replace(run.record, robot=replace(run.record.robot, speed=run.record.robot.speed - slower))
    drawing = side_by_side({"one": run, "two": replace(run, record=other)}, PAGE)
    said = drawing.figure.get_suptitle().replace("\n", " ")
    assert said.startswith(message)
    assert said.endswith("no car comes near enough to have a value")
