"""How the cars' values change along a drive: over time, and where the cars are meanwhile."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from hj_cosim.analysis.figures import style
from hj_cosim.analysis.figures.timeline import shade
from hj_cosim.analysis.figures.value_plot import value_scale
from hj_cosim.analysis.values import car_values
from hj_cosim.reachability.table.table import ValueTable
from hj_cosim.recording.run_folder import Run

EVERY = 5  # samples: at 50 Hz a point each 0.1 s
VIEW = 80.0  # m ahead and behind
TOP = 40.0  # m, larger values are not drawn


def value_along_drive(run: Run, table: ValueTable) -> style.Drawing:
    """Return the values of the cars near the robot over time, and their positions relative to it in their colour."""
    record = run.record
    values = car_values(record, table)[::EVERY]
    time = record.time[::EVERY]
    relative = record.traffic.x[::EVERY] - record.robot.x[::EVERY, None]
    near = np.isfinite(values) & (np.abs(relative) <= VIEW)
    with style.house_style():
        figure = Figure(figsize=(style.PAGE_WIDTH, 4.6), layout="constrained")
        top, bottom = figure.subplots(2, 1, sharex=True)
        _draw_values(top, time, values, near, float(run.config["filter"]["epsilon"]))
        _draw_positions(bottom, time, relative, values, near)
        shade(top, record.time, record.robot.intervening, style.INTERVENTION, 0.5)
        bottom.set_xlim(time[0], max(time[-1], time[0] + 1e-3))
        figure.colorbar(value_scale(), ax=bottom, label="V (m)", extend="both", ticks=[-15, 0, 15], pad=0.01)
    sample, car = np.nonzero(near)
    names = np.array(record.traffic.names, dtype=object)
    data = {"time": time[sample], "vehicle": names[car], "p_x": relative[sample, car], "value": values[sample, car]}
    return style.Drawing(figure, data)


def _draw_values(axes: Axes, time: np.ndarray, values: np.ndarray, near: np.ndarray, epsilon: float) -> None:
    shown = np.where(near & (values <= TOP), values, np.nan)
    for car in np.flatnonzero(np.isfinite(shown).any(axis=0)):
        axes.plot(time, shown[:, car], color=style.SKY_BLUE, linewidth=0.8)
    least = np.where(near, values, np.inf).min(axis=1, initial=np.inf)
    axes.plot(time, np.where(least <= TOP, least, np.nan), color=style.BLACK, linewidth=1.6, label="least of all cars")
    axes.axhline(epsilon, color=style.GREY, linestyle="--", linewidth=1, label=f"ε = {epsilon:g} m")
    axes.axhline(0.0, color=style.BLACK, linewidth=0.8)
    axes.set_ylabel("V of each car (m)")
    axes.set_title("yellow: the filter intervenes", fontsize=8)
    axes.legend(loc="lower right", bbox_to_anchor=(1.0, 0.98), ncols=2, borderaxespad=0.0)


def _draw_positions(axes: Axes, time: np.ndarray, relative: np.ndarray, values: np.ndarray, near: np.ndarray) -> None:
    both = near[:-1] & near[1:]
    sample, car = np.nonzero(both)
    points = np.stack([np.broadcast_to(time[:, None], relative.shape), relative], axis=-1)
    segments = np.stack([points[sample, car], points[sample + 1, car]], axis=1)
    scale = value_scale()
    lines = LineCollection(list(segments), colors=scale.to_rgba(values[sample, car]), linewidths=1.8)
    axes.set_facecolor("#D9D9D9")  # V = 0 is white
    axes.add_collection(lines)
    axes.axhline(0.0, color=style.ROBOT, linewidth=2)
    axes.set(ylim=(-VIEW, VIEW), ylabel="ahead of the robot (m)", xlabel="time (s)")
