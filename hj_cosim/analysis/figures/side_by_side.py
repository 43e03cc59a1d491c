"""Several runs over one time axis: speed, value, TTC, lane, and when each one's filter intervened."""

from collections.abc import Mapping

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from hj_cosim.analysis.figures import style
from hj_cosim.analysis.figures.timeline import LARGEST_TTC, VALUE_TICKS
from hj_cosim.metrics.declared_paper import SAFE_TTC
from hj_cosim.recording.run_folder import Run

# Each run differs from the others in colour and in its dashes, for those who print in grey.
LOOKS: tuple[tuple[str, str | tuple[int, tuple[float, ...]]], ...] = (
    (style.BLUE, "-"),
    (style.VERMILION, (0, (4, 1.5))),
    (style.BLACK, (0, (1, 1))),
    (style.GREEN, (0, (6, 1.5, 1, 1.5))),
    (style.PURPLE, (0, (3, 1, 1, 1, 1, 1))),
    (style.ORANGE, (0, (8, 3))),
)


def side_by_side(runs: Mapping[str, Run], width: int = style.PAGE) -> style.Drawing:
    """Return the time lines of several runs on one axis.

    Args:
        runs: at most len(LOOKS), by their labels.
        width: of the figure, mm.
    """
    data = pd.concat([_columns(label, run) for label, run in runs.items()], ignore_index=True)
    heights = [1.0, 1.0, 1.0, 1.0, 0.18 * len(runs) + 0.1]
    with style.house_style():
        figure = style.sheet(width, 160.0, _message(data))
        panels = figure.subplots(5, 1, sharex=True, height_ratios=heights)
        for (label, own), (colour, line) in zip(data.groupby("run", sort=False), LOOKS, strict=False):
            look = {"color": colour, "linestyle": line, "label": str(label).replace("$", r"\$")}
            panels[0].plot(own.time, own.speed, **look)
            panels[1].plot(own.time, own.value.where(np.isfinite(own.value)), **look)
            panels[2].plot(own.time, own.ttc.clip(upper=LARGEST_TTC), **look)
            panels[3].plot(own.time, own.lane_position, **look)
            for axes, column in zip(panels, ("speed", "value", "ttc", "lane_position"), strict=False):
                crashed = own[own.collision].iloc[:1]
                axes.plot(crashed.time, crashed[column].clip(upper=1e3), "X", color=colour, markersize=7, zorder=5)
        _label_panels(panels, data)
        _draw_interventions(panels[4], data)
        handles, names = panels[0].get_legend_handles_labels()
        columns = 1 if len(runs) == 1 or width == style.COLUMN else 2
        figure.legend(handles, names, loc="outside lower left", ncols=columns)
    return style.Drawing(figure, dict(data.items()))


def _message(data: pd.DataFrame) -> str:
    """Return who is fastest and who comes nearest to V = 0, as a sentence."""
    speeds, least = data.groupby("run", sort=False).speed.mean(), data.groupby("run", sort=False).value.min()
    same_speed = speeds.round(2).nunique() == 1
    fastest, nearest = str(speeds.idxmax()).replace("$", r"\$"), str(least.idxmin()).replace("$", r"\$")
    speed = f"{fastest} is fastest, at {speeds.max():.2f} m/s in the mean"
    if same_speed:
        speed = f"Mean speed is {speeds.iloc[0]:.2f} m/s in all runs"
    if not np.isfinite(least).any():
        return f"{speed}; no car comes near enough to have a value"
    if same_speed:
        return f"{speed}; V falls to {least.min():.1f} m at the least"
    return f"{speed}; V falls lowest in {nearest}, to {least.min():.1f} m"


def _columns(label: str, run: Run) -> pd.DataFrame:
    record = run.record
    return pd.DataFrame(
        {
            "run": label,
            "time": record.time,
            "speed": record.robot.speed,
            "value": record.robot.value,
            "ttc": record.threats.ttc,
            "lane_position": record.robot.y / record.road.lane_width,
            "intervening": record.robot.intervening,
            "collision": record.threats.collision,
        }
    )


def _label_panels(panels: np.ndarray, data: pd.DataFrame) -> None:
    panels[0].set_ylabel("speed (m/s)")
    finite = data.value[np.isfinite(data.value)]  # none where no car comes near enough to have a value
    lowest, highest = finite.min(), finite.max()
    lowest, highest = (min(lowest, -2.0), max(highest, 12.0)) if len(finite) else (-2.0, 12.0)
    panels[1].set_yscale("symlog", linthresh=10.0)
    ticks = [tick for tick in VALUE_TICKS if 1.2 * lowest <= tick <= 1.2 * highest]
    panels[1].set_yticks(ticks, [f"{tick:g}" for tick in ticks])
    panels[1].set_ylim(1.2 * lowest, 1.2 * highest)
    panels[1].axhline(0.0, color=style.BLACK, linewidth=0.8)
    panels[1].set_ylabel("least V (m)")
    panels[2].set_yscale("symlog", linthresh=1.0)
    panels[2].set_yticks([0, 1, 3, 10, 30, 100], ["0", "1", "3", "10", "30", "100"])
    panels[2].set_ylim(0.0, 1.1 * LARGEST_TTC)
    panels[2].axhline(SAFE_TTC, color=style.GREY, linewidth=0.8)
    panels[2].set_ylabel("TTC (s)")
    panels[3].set_yticks(range(int(data.lane_position.max() + 1.5)))
    panels[3].set_ylabel("lane (0: right)")
    panels[-1].set_xlabel("time (s)")
    panels[-1].set_xlim(data.time.min(), max(data.time.max(), data.time.min() + 1e-3))


def _draw_interventions(axes: Axes, data: pd.DataFrame) -> None:
    """Draw a bar for each run, in the order of the legend, filled while its filter intervenes."""
    for place, ((_, own), (colour, _)) in enumerate(zip(data.groupby("run", sort=False), LOOKS, strict=False)):
        height = np.where(own.intervening, 0.8, 0.0)
        axes.fill_between(own.time, -place, height - place, step="mid", color=colour, linewidth=0)
    axes.set_ylim(0.9 - data.run.nunique(), 1.0)
    axes.set_yticks([])
    axes.grid(visible=False)
    axes.set_ylabel("filter\nintervenes", rotation=0, ha="right", va="center")
