"""One moment of a run from above, each car in the colour of its value."""

import numpy as np
from matplotlib.axes import Axes

from hj_cosim.analysis.figures import style
from hj_cosim.analysis.figures.road_view import body_corners, draw_cars, draw_scene, scene_rows
from hj_cosim.analysis.figures.value_plot import value_colours, value_scale
from hj_cosim.analysis.values import car_values
from hj_cosim.analysis.view import View, height_of
from hj_cosim.reachability.table.table import ValueTable
from hj_cosim.recording.run_folder import Run

BEHIND = {style.COLUMN: 40.0, style.PAGE: 60.0}  # m, by the figure's width
AHEAD = {style.COLUMN: 70.0, style.PAGE: 120.0}  # m
DIGIT = 1.65  # mm that one takes in a number
NUMBERED = 100.0  # m, cars of larger V have no number


def sample_at(run: Run, time: float | None) -> int:
    """Return the sample nearest to a time (s), or the one with the least value if no time is given."""
    if time is None:
        return int(np.argmin(run.record.robot.value))
    return int(np.argmin(np.abs(run.record.time - time)))


def highway(run: Run, table: ValueTable, time: float | None = None, width: int = style.PAGE) -> style.Drawing:
    """Return a snapshot of a run.

    Args:
        run: the run.
        table: V.
        time: s; of the least value unless given.
        width: of the figure, mm.
    """
    record = run.record
    sample = sample_at(run, time)
    values = car_values(record, table)[sample]
    traffic = record.traffic
    with style.house_style():
        behind, ahead = BEHIND[width], AHEAD[width]
        height = height_of(record.road, record.robot.x[sample : sample + 1], behind, ahead)
        road_height = 0.9 * width * (np.ptp(height) + 1.6) / (behind + ahead)
        figure = style.sheet(width, road_height + 14.0, _message(run, sample), to_scale=True)
        axes = figure.subplots()
        seen = draw_scene(axes, record, sample, behind, ahead, height)
        columns = (traffic.x[sample, seen], traffic.y[sample, seen], traffic.heading[sample, seen])
        x, y, heading = View(record.road, float(record.robot.x[sample])).place(*columns)
        corners = body_corners(x, y, heading, traffic.length[seen], traffic.width[seen])
        edges = [style.ROGUE if rogue else style.CAR_EDGE for rogue in record.is_rogue[seen]]
        draw_cars(axes, corners, value_colours(values[seen]), edges, zorder=4.0)
        robot = record.robot
        x_r, y_r, _ = View(record.road, float(robot.x[sample])).place(robot.x[[sample]], robot.y[[sample]], np.zeros(1))
        bodies = np.append(x, x_r), np.append(y, y_r), np.append(traffic.length[seen], record.robot_length)
        _write_values(axes, width, *bodies, np.append(values[seen], np.inf))
        origin = record.robot.x[sample]
        marks = np.arange(-behind, ahead + 1.0, 20.0)
        axes.set_xticks(origin + marks, [style.signed(f"{mark:.0f}") for mark in marks])
        axes.set_xlabel("distance from the robot along the road (m)")
        figure.colorbar(value_scale(), ax=axes, label="V (m)", extend="both", ticks=[-15, 0, 15], pad=0.01)
    return style.Drawing(
        figure, {**style.columns_of(scene_rows(record, sample, seen)), "value": [np.nan, *values[seen]]}
    )


def _message(run: Run, sample: int) -> str:
    robot = run.record.robot
    value = f"V = {robot.value[sample]:.1f} m" if np.isfinite(robot.value[sample]) else "nobody near"
    least = ", the least of the drive" if sample == int(np.argmin(robot.value)) else ""
    return (
        f"At t = {run.record.time[sample]:.1f} s the robot (with the white arrow) drives {robot.speed[sample]:.1f} m/s"
        f" at {value}{least}; the numbers are V (m) of each car"
    )


def _write_values(axes: Axes, width: int, x: np.ndarray, y: np.ndarray, length: np.ndarray, values: np.ndarray) -> None:
    """Write V behind each car, the least first, unless the number would lie on another car or on another number."""
    start, stop = axes.get_xlim()
    per_character = (stop - start) * DIGIT / (0.85 * width)  # m that a digit takes
    taken = [(left, right, at) for left, right, at in zip(x - 0.5 * length, x + 0.5 * length, y, strict=True)]
    for place in np.argsort(values):
        if not abs(values[place]) < NUMBERED:
            continue
        text = style.signed(f"{values[place]:.0f}")
        right = x[place] - 0.5 * length[place] - 0.6
        left = right - per_character * len(text)
        free = all(right < a or left > b or abs(y[place] - at) > 3.0 for a, b, at in taken)
        if free and left > start:
            axes.text(right, y[place], text, fontsize=style.SMALLEST_FONT, ha="right", va="center_baseline", zorder=7)
            taken.append((left, right, y[place]))
