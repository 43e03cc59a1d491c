"""The drive from above: the same stretch of road around the robot at evenly spaced times."""

import numpy as np
from matplotlib.axes import Axes

from hj_cosim.analysis.figures import style
from hj_cosim.analysis.figures.road_view import draw_scene, scene_rows
from hj_cosim.analysis.view import View, height_of
from hj_cosim.recording.record import RunRecord
from hj_cosim.recording.run_folder import Run

SNAPSHOTS = 6
BEHIND = {style.COLUMN: 40.0, style.PAGE: 50.0}  # m, by the figure's width
AHEAD = {style.COLUMN: 70.0, style.PAGE: 110.0}  # m
TRACE_TIME = 3.0  # s of the robot's path before and after each snapshot


def snapshots(run: Run, width: int = style.PAGE) -> style.Drawing:
    """Return the snapshot series of a run, with the way that the robot came and went on (dashed).

    Args:
        run: the run.
        width: of the figure, mm.
    """
    behind, ahead = BEHIND[width], AHEAD[width]
    record = run.record
    samples = np.unique(np.linspace(0, len(record.time) - 1, SNAPSHOTS).round().astype(int))
    rows = []
    with style.house_style():
        height = height_of(record.road, record.robot.x[samples], behind, ahead)
        road_height = width * (height[1] - height[0] + 2.0) / (behind + ahead)
        figure = style.sheet(width, len(samples) * (road_height + 5.0) + 10.0, _message(record), to_scale=True)
        panels = np.atleast_1d(figure.subplots(len(samples), 1))
        for axes, sample in zip(panels, samples, strict=True):
            seen = draw_scene(axes, record, sample, behind, ahead, height)
            _draw_trace(axes, record, sample)
            axes.set_title(_caption(record, sample), pad=2)
            axes.set_xticks([])
            rows += scene_rows(record, sample, seen)
        _draw_scale(panels[-1], float(record.robot.x[samples[-1]]), behind, ahead)
    return style.Drawing(figure, style.columns_of(rows))


def _message(record: RunRecord) -> str:
    robot, seconds = record.robot, float(record.time[-1] - record.time[0])
    crashed = ", until it collides" if record.threats.collision.any() else ""
    filtered = 100.0 * float(robot.intervening.mean())
    return (
        f"The robot (with the white arrow) drives {robot.x[-1] - robot.x[0]:.0f} m in {seconds:.0f} s{crashed}; the"
        f" filter intervenes {filtered:.0f} % of the time, and dashed is its way from {TRACE_TIME:g} s before to"
        f" {TRACE_TIME:g} s after"
    )


def _caption(record: RunRecord, sample: int) -> str:
    value = record.robot.value[sample]
    parts = [f"t = {record.time[sample]:.1f} s", f"v = {record.robot.speed[sample]:.1f} m/s"]
    parts.append(f"V = {value:.1f} m" if np.isfinite(value) else "V: nobody near")
    if record.robot.intervening[sample]:
        parts.append("filter on")
    if record.threats.collision[sample]:
        parts.append("collision")
    return style.signed(", ".join(parts))


def _draw_trace(axes: Axes, record: RunRecord, sample: int) -> None:
    near = np.abs(record.time - record.time[sample]) <= TRACE_TIME
    way = np.column_stack([record.robot.x[near], record.robot.y[near]])
    x, y = View(record.road, float(record.robot.x[sample])).points(way).T
    axes.plot(x, y, color=style.ROBOT, linewidth=1.2, linestyle=(0, (3, 2)), zorder=2)


def _draw_scale(axes: Axes, robot: float, behind: float, ahead: float) -> None:
    """Label the last panel with distances from the robot, which is at an s of `robot` (m)."""
    marks = np.arange(np.ceil(-behind / 20.0) * 20.0, ahead + 1.0, 20.0)
    axes.set_xticks(robot + marks, [style.signed(f"{mark:.0f}") for mark in marks])
    axes.set_xlabel("distance from the robot along the road (m)")
