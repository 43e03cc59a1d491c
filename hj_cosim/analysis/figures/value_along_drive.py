"""How the cars' values change along a drive: over time, and where the cars are meanwhile."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection

from hj_cosim.analysis.figures import style
from hj_cosim.analysis.figures.timeline import shade
from hj_cosim.analysis.figures.value_plot import value_scale
from hj_cosim.analysis.values import car_values
from hj_cosim.reachability.table.table import ValueTable
from hj_cosim.recording.run_folder import Run

EVERY = 5  # samples: at 50 Hz a point each 0.1 s
VIEW = 80.0  # m ahead and behind
TOP = 40.0  # m, larger values are not drawn


def value_along_drive(run: Run, table: ValueTable, width: int = style.PAGE) -> style.Drawing:
    """Return the values of the cars near the robot over time, and their positions relative to it in their colour.

    Args:
        run: the run.
        table: V.
        width: of the figure, mm.
    """
    record = run.record
    values = car_values(record, table)[::EVERY]
    time = record.time[::EVERY]
    relative = record.traffic.x[::EVERY] - record.robot.x[::EVERY, None]
    near = np.isfinite(values) & (np.abs(relative) <= VIEW)
    with style.house_style():
        epsilon = float(run.config["filter"]["epsilon"])
        figure = style.sheet(width, 105.0, _message(values, near, epsilon))
        top, bottom = figure.subplots(2, 1, sharex=True)
        _draw_values(top, time, values, near, epsilon)
        _draw_positions(bottom, time, relative, values, near)
        shade(top, record.time, record.robot.intervening, style.INTERVENTION, 0.5)
        bottom.set_xlim(time[0], max(time[-1], time[0] + 1e-3))
        figure.colorbar(value_scale(), ax=bottom, label="V (m)", extend="both", ticks=[-15, 0, 15], pad=0.01)
    sample, car = np.nonzero(near)
    names = np.array(record.traffic.names, dtype=object)
    data = {"time": time[sample], "vehicle": names[car], "p_x": relative[sample, car], "value": values[sample, car]}
    return style.Drawing(figure, data)


def _message(values: np.ndarray, near: np.ndarray, epsilon: float) -> str:
    cars, close = near.any(axis=0), (near & (values <= epsilon)).any(axis=0)
    return (
        f"Of {np.count_nonzero(cars)} cars within {VIEW:g} m of the robot, V of {np.count_nonzero(close)} falls to"
        f" ε = {epsilon:g} m or below; yellow: the filter intervenes"
    )


def _draw_values(axes: Axes, time: np.ndarray, values: np.ndarray, near: np.ndarray, epsilon: float) -> None:
    shown = np.where(near & (values <= TOP), values, np.nan)
    for car in np.flatnonzero(np.isfinite(shown).any(axis=0)):
        axes.plot(time, shown[:, car], color=style.SKY_BLUE, linewidth=0.8)
    least = np.where(near, values, np.inf).min(axis=1, initial=np.inf)
    axes.plot(time, np.where(least <= TOP, least, np.nan), color=style.BLACK, linewidth=1.6, label="least of all cars")
    axes.axhline(epsilon, color=style.GREY, linestyle="--", linewidth=1, label=f"ε = {epsilon:g} m")
    axes.axhline(0.0, color=style.BLACK, linewidth=0.8)
    axes.set_ylabel("V of each car (m)")
    axes.legend(loc="lower right", bbox_to_anchor=(1.0, 0.98), ncols=2, borderaxespad=0.0)


def _draw_positions(axes: Axes, time: np.ndarray, relative: np.ndarray, values: np.ndarray, near: np.ndarray) -> None:
    both = near[:-1] & near[1:]
    sample, car = np.nonzero(both)
    points = np.stack([np.broadcast_to(time[:, None], relative.shape), relative], axis=-1)
    segments = np.stack([points[sample, car], points[sample + 1, car]], axis=1)
    scale = value_scale()
    # An outline, for safe values are pale.
    axes.add_collection(LineCollection(list(segments), colors=style.GREY, linewidths=3.6, capstyle="round"))
    axes.add_collection(LineCollection(list(segments), colors=scale.to_rgba(values[sample, car]), linewidths=2.6))
    axes.axhline(0.0, color=style.BLACK, linewidth=1.2, linestyle="--")
    axes.set(ylim=(-VIEW, VIEW), ylabel="ahead of the robot (m)", xlabel="time (s)")
