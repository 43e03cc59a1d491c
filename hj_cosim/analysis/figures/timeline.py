"""A run over time: speed, value, interventions, TTC and lane."""

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes

from hj_cosim.analysis.figures import style
from hj_cosim.metrics.declared_paper import SAFE_TTC
from hj_cosim.recording.run_folder import Run

VALUE_TICKS = (-1000.0, -100.0, -30.0, -10.0, -5.0, 0.0, 5.0, 10.0, 30.0, 100.0, 1000.0)  # m
LARGEST_TTC = 100.0  # s, what is longer is drawn at the top edge

Columns = Mapping[str, np.ndarray]


def timeline(run: Run, width: int = style.PAGE) -> style.Drawing:
    """Return a run's time line; the stretches in which the filter intervenes are shaded in every panel.

    Args:
        run: the run.
        width: of the figure, mm.
    """
    record = run.record
    robot = record.robot
    epsilon = float(run.config["filter"]["epsilon"])
    data = {
        "time": record.time,
        "speed": robot.speed,
        "plan_speed": robot.plan_speed,
        "value": robot.value,
        "ttc": record.threats.ttc,
        "lane_position": robot.y / record.road.lane_width,
        "plan_lane": robot.plan_lane,
        "intervening": robot.intervening,
        "collision": record.threats.collision,
    }
    with style.house_style():
        figure = style.sheet(width, 130.0, _message(data, record.threats.collision, robot.intervening))
        panels = figure.subplots(4, 1, sharex=True)
        _draw_speed(panels[0], data)
        _draw_value(panels[1], data, epsilon)
        _draw_ttc(panels[2], data)
        _draw_lane(panels[3], data, record.road.lane_count)
        for axes in panels:
            shade(axes, record.time, robot.intervening, style.INTERVENTION, 0.5)
            shade(axes, record.time, record.threats.collision, style.GREY, 0.6)
        panels[-1].set_xlabel("time (s)")
        panels[-1].set_xlim(record.time[0], max(record.time[-1], record.time[0] + 1e-3))
    return style.Drawing(figure, data)


def _message(data: Columns, collision: np.ndarray, intervening: np.ndarray) -> str:
    finite = data["value"][np.isfinite(data["value"])]
    least = f"V is never below {finite.min():.1f} m" if len(finite) else "nobody comes near"
    ttc = min(float(data["ttc"].min()), LARGEST_TTC)
    crashed = " and the robot collides (grey)" if collision.any() else ""
    return (
        f"The filter intervenes {100.0 * float(intervening.mean()):.0f} % of the time (yellow), {least}, TTC never"
        f" below {ttc:.1f} s{crashed}"
    )


def shade(axes: Axes, time: np.ndarray, flag: np.ndarray, colour: str, alpha: float) -> None:
    """Shade the times (s) at which a boolean (T,) is true, over the whole height of the axes."""
    # The height follows the flag; fill_between's `where` would lose what lasts a single sample.
    height = flag.astype(float)
    axes.fill_between(
        time,
        0.0,
        height,
        step="mid",
        transform=axes.get_xaxis_transform(),
        color=colour,
        alpha=alpha,
        linewidth=0,
        zorder=0.5,
    )


def _legend(axes: Axes) -> None:
    """Put the legend above the axes, where it hides nothing."""
    axes.legend(loc="lower right", bbox_to_anchor=(1.0, 0.98), ncols=2, borderaxespad=0.0)


def _draw_speed(axes: Axes, data: Columns) -> None:
    axes.plot(data["time"], data["speed"], color=style.BLUE, label="robot")
    axes.step(
        data["time"], data["plan_speed"], where="post", color=style.BLACK, linestyle="--", linewidth=1, label="planned"
    )
    axes.set_ylabel("speed (m/s)")
    _legend(axes)


def _draw_value(axes: Axes, data: Columns, epsilon: float) -> None:
    finite = np.where(np.isfinite(data["value"]), data["value"], np.nan)
    axes.plot(data["time"], finite, color=style.VERMILION, label="least value of all cars")
    axes.axhline(epsilon, color=style.GREY, linestyle="--", linewidth=1, label=f"ε = {epsilon:g} m")
    axes.axhline(0.0, color=style.BLACK, linewidth=0.8)
    # The cubic of V(0, ·) reaches hundreds of metres; what matters happens near zero.
    axes.set_yscale("symlog", linthresh=10.0)
    lowest, highest = np.nanmin(finite, initial=-2.0), np.nanmax(finite, initial=12.0)
    ticks = [tick for tick in VALUE_TICKS if 1.2 * lowest <= tick <= 1.2 * highest]
    axes.set_yticks(ticks, [f"{tick:g}" for tick in ticks])
    axes.set_ylim(1.2 * lowest, 1.2 * highest)
    axes.set_ylabel("value V (m)")
    _legend(axes)


def _draw_ttc(axes: Axes, data: Columns) -> None:
    axes.plot(
        data["time"], np.minimum(data["ttc"], LARGEST_TTC), color=style.GREEN, label=f"TTC, at most {LARGEST_TTC:g} s"
    )
    axes.axhline(SAFE_TTC, color=style.GREY, linestyle="--", linewidth=1, label=f"{SAFE_TTC:g} s")
    axes.set_yscale("symlog", linthresh=1.0)
    axes.set_yticks([0, 1, 3, 10, 30, 100], ["0", "1", "3", "10", "30", "100"])
    axes.set_ylim(0.0, 1.1 * LARGEST_TTC)
    axes.set_ylabel("TTC (s)")
    _legend(axes)


def _draw_lane(axes: Axes, data: Columns, lane_count: int) -> None:
    axes.plot(data["time"], data["lane_position"], color=style.PURPLE, label="robot")
    axes.step(
        data["time"], data["plan_lane"], where="post", color=style.BLACK, linestyle="--", linewidth=1, label="planned"
    )
    axes.set_ylim(-0.5, lane_count - 0.5)
    axes.set_yticks(range(lane_count))
    axes.set_ylabel("lane (0: right)")
    _legend(axes)
