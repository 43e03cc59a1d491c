"""One moment of a run from above, each car in the colour of its value."""

import numpy as np
from matplotlib.figure import Figure

from hj_cosim.analysis.figures import style
from hj_cosim.analysis.figures.road_view import body_corners, draw_cars, draw_scene, scene_rows
from hj_cosim.analysis.figures.value_plot import value_colours, value_scale
from hj_cosim.analysis.values import car_values
from hj_cosim.analysis.view import View, height_of
from hj_cosim.reachability.table.table import ValueTable
from hj_cosim.recording.run_folder import Run

BEHIND, AHEAD = 60.0, 120.0  # m


def sample_at(run: Run, time: float | None) -> int:
    """Return the sample nearest to a time (s), or the one with the least value if no time is given."""
    if time is None:
        return int(np.argmin(run.record.robot.value))
    return int(np.argmin(np.abs(run.record.time - time)))


def highway(run: Run, table: ValueTable, time: float | None = None) -> style.Drawing:
    """Return a snapshot of a run, at the moment of the least value unless a time (s) is given."""
    record = run.record
    sample = sample_at(run, time)
    values = car_values(record, table)[sample]
    traffic = record.traffic
    with style.house_style():
        height = height_of(record.road, record.robot.x[sample : sample + 1], BEHIND, AHEAD)
        # Of a bend the road takes more height; the rest is for the axis and the title.
        inches = 1.7 if record.road.is_straight else 0.9 + style.PAGE_WIDTH * np.ptp(height) / (BEHIND + AHEAD)
        figure = Figure(figsize=(style.PAGE_WIDTH, inches), layout="constrained")
        axes = figure.subplots()
        seen = draw_scene(axes, record, sample, BEHIND, AHEAD, height)
        columns = (traffic.x[sample, seen], traffic.y[sample, seen], traffic.heading[sample, seen])
        x, y, heading = View(record.road, float(record.robot.x[sample])).place(*columns)
        corners = body_corners(x, y, heading, traffic.length[seen], traffic.width[seen])
        edges = [style.ROGUE if rogue else style.CAR_EDGE for rogue in record.is_rogue[seen]]
        draw_cars(axes, corners, value_colours(values[seen]), edges, zorder=4.0)
        for place in np.flatnonzero(np.abs(values[seen]) < 100.0):
            axes.annotate(
                f"{values[seen[place]]:.0f}",
                (x[place], y[place] + 0.5 * traffic.width[seen[place]]),
                fontsize=6,
                ha="center",
                va="bottom",
                annotation_clip=True,
            )
        origin = record.robot.x[sample]
        marks = np.arange(-BEHIND, AHEAD + 1.0, 20.0)
        axes.set_xticks(origin + marks, [f"{mark:.0f}" for mark in marks])
        axes.set_xlabel("distance from the robot along the road (m)")
        axes.set_title(
            f"t = {record.time[sample]:.1f} s, v = {record.robot.speed[sample]:.1f} m/s; the robot is the marked car,"
            " the numbers are V (m)",
            fontsize=8,
        )
        figure.colorbar(value_scale(), ax=axes, label="V (m)", extend="both", ticks=[-15, 0, 15], pad=0.01)
    return style.Drawing(
        figure, {**style.columns_of(scene_rows(record, sample, seen)), "value": [np.nan, *values[seen]]}
    )
