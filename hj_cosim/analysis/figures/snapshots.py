"""The drive from above: the same stretch of road around the robot at evenly spaced times."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hj_cosim.analysis.figures import style
from hj_cosim.analysis.figures.road_view import draw_scene, scene_rows
from hj_cosim.analysis.view import View, height_of
from hj_cosim.recording.record import RunRecord
from hj_cosim.recording.run_folder import Run

SNAPSHOTS = 6
BEHIND, AHEAD = 50.0, 110.0  # m
TRACE_TIME = 3.0  # s of the robot's path before and after each snapshot


def snapshots(run: Run) -> style.Drawing:
    """Return the snapshot series of a run, with the way that the robot came and went on (dashed)."""
    record = run.record
    samples = np.unique(np.linspace(0, len(record.time) - 1, SNAPSHOTS).round().astype(int))
    rows = []
    with style.house_style():
        height = height_of(record.road, record.robot.x[samples], BEHIND, AHEAD)
        road_height = (height[1] - height[0] + 2.0) / (BEHIND + AHEAD)
        figure = Figure(
            figsize=(style.PAGE_WIDTH, len(samples) * (style.PAGE_WIDTH * road_height + 0.24) + 0.4),
            layout="constrained",
        )
        panels = np.atleast_1d(figure.subplots(len(samples), 1))
        for axes, sample in zip(panels, samples, strict=True):
            seen = draw_scene(axes, record, sample, BEHIND, AHEAD, height)
            _draw_trace(axes, record, sample)
            axes.set_title(_caption(record, sample), pad=2, fontsize=8)
            axes.set_xticks([])
            rows += scene_rows(record, sample, seen)
        _draw_scale(panels[-1], record.robot.x[samples[-1]] - BEHIND)
    return style.Drawing(figure, style.columns_of(rows))


def _caption(record: RunRecord, sample: int) -> str:
    value = record.robot.value[sample]
    parts = [f"t = {record.time[sample]:.1f} s", f"v = {record.robot.speed[sample]:.1f} m/s"]
    parts.append(f"V = {value:.1f} m" if np.isfinite(value) else "V: nobody near")
    if record.robot.intervening[sample]:
        parts.append("the filter intervenes")
    if record.threats.collision[sample]:
        parts.append("collision")
    return ",  ".join(parts)


def _draw_trace(axes: Axes, record: RunRecord, sample: int) -> None:
    near = np.abs(record.time - record.time[sample]) <= TRACE_TIME
    way = np.column_stack([record.robot.x[near], record.robot.y[near]])
    x, y = View(record.road, float(record.robot.x[sample])).points(way).T
    axes.plot(x, y, color=style.ROBOT, linewidth=1.2, linestyle=(0, (3, 2)), zorder=2)


def _draw_scale(axes: Axes, start: float) -> None:
    """Label the last panel with distances from the robot."""
    marks = np.arange(np.ceil(-BEHIND / 20.0) * 20.0, AHEAD + 1.0, 20.0)
    axes.set_xticks(start + BEHIND + marks, [f"{mark:.0f}" for mark in marks])
    axes.set_xlabel("distance from the robot along the road (m)")
